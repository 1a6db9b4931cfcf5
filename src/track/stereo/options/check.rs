//! Options out of range are refused by name.

use super::super::{clock::MAX_REACH, clock::STEP_TIME_RANGE};
use super::{StereoCamera, StereoTrackerOptions, VoxelGrid};
use crate::error::{Error, Result};

/// Largest number of components: every pair is compared at each step.
const MAX_COMPONENTS: usize = 4096;

impl StereoTrackerOptions {
    /// Checks every option by itself.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        self.matching_options(self.row_offset).check()?;
        if !(1..=MAX_COMPONENTS).contains(&self.n_components) {
            let expected = format!("a positive integer up to {MAX_COMPONENTS}");
            return Err(Error::argument("n_components", expected, self.n_components));
        }
        self.mixture_options(false, 0).check()?;
        let VoxelGrid { columns, rows, layers, .. } = self.grid;
        if [columns, rows, layers].iter().any(|side| !(1..=4096).contains(side)) || columns * rows * layers > 1 << 26 {
            let expected = "1 to 4096 cells along y, x and disparity, at most 2^26 in all";
            return Err(Error::argument("grid", expected, format!("({rows}, {columns}, {layers})")));
        }
        let ([least, greatest], first) = (self.disparity_range, i64::from(self.grid.first_disparity));
        if i64::from(least) < first || i64::from(greatest) > first + layers as i64 {
            let expected = format!(
                "layers for the disparities {least} to {greatest}, at least {}",
                i64::from(greatest) - i64::from(least)
            );
            return Err(Error::argument("grid", expected, format!("{layers} from {first}")));
        }
        if !(1..=MAX_REACH).contains(&self.search) {
            return Err(Error::argument("search", "1 to 64 cells", self.search));
        }
        if !STEP_TIME_RANGE.contains(&self.step_time) {
            return Err(Error::argument("step_time", "a time above 0, from 1e-12 to 1e12", self.step_time));
        }
        self.camera.map_or(Ok(()), |camera| camera.check())
    }
}

impl StereoCamera {
    /// Checks the camera.
    pub fn check(&self) -> Result<()> {
        for (name, value) in [("focal", self.focal), ("baseline", self.baseline)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::argument(name, "a length above 0", value));
            }
        }
        if !self.d_infinity.is_finite() {
            return Err(Error::argument("d_infinity", "a disparity, px", self.d_infinity));
        }
        Ok(())
    }
}
