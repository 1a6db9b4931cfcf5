//! Pictures of results: flow as colours or arrows, divergence and curl as a diverging map, frames as grey,
//! tracks, clusters and disparities over them, graphs over time.
//!
//! Everything here turns row-major planes into a [`Picture`], eight bits a channel.

mod chart;
mod clusters;
mod contact;
mod disparity;
mod diverging;
mod draw;
mod grey;
mod overlay;
mod quiver;
mod wheel;

pub use chart::{ChartArc, ChartNode, chart_picture};
pub use clusters::{ClusterMark, cluster_picture, identity_colour};
pub use contact::{ContactMark, draw_contacts};
pub use disparity::draw_disparity;
pub use diverging::{SignedMap, symmetric_range};
pub use grey::{GreyRange, grey_picture};
pub use overlay::{PathPoint, TrackColours, TrackOverlay, status_colour};
pub use quiver::{Arrow, Quiver, arrows_on_grid};
pub use wheel::FlowColours;

use crate::error::{Error, Result};
use crate::math::nearest_quantile;

/// An RGB colour.
pub type Rgb = [u8; 3];

/// An RGB picture, eight bits a channel, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

impl Picture {
    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, colour: Rgb) -> Self {
        Self { width, height, data: colour.repeat(width * height) }
    }

    /// A picture whose pixel at column `x`, row `y` is `colour(x, y)`.
    pub fn from_fn(width: usize, height: usize, mut colour: impl FnMut(usize, usize) -> Rgb) -> Self {
        let mut data = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            for x in 0..width {
                data.extend(colour(x, y));
            }
        }
        Self { width, height, data }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }
    /// Interleaved samples `[row][col][r, g, b]`.
    pub fn data(&self) -> &[u8] {
        &self.data
    }
    /// The colour at column `x`, row `y`.
    pub fn pixel(&self, x: usize, y: usize) -> Rgb {
        let at = 3 * (y * self.width + x);
        [self.data[at], self.data[at + 1], self.data[at + 2]]
    }

    /// Mixes `colour` into the pixel at column `x`, row `y`, if there is one, by `coverage`, 0 to 1.
    pub fn blend(&mut self, x: isize, y: isize, colour: Rgb, coverage: f64) {
        if x < 0 || y < 0 || x as usize >= self.width || y as usize >= self.height {
            return;
        }
        let at = 3 * (y as usize * self.width + x as usize);
        for (old, new) in self.data[at..at + 3].iter_mut().zip(colour) {
            *old = (f64::from(*old) + coverage * (f64::from(new) - f64::from(*old))).round() as u8;
        }
    }

    /// Every pixel as a block of `factor x factor`: for results on a coarse grid.
    pub fn enlarged(&self, factor: usize) -> Self {
        let factor = factor.max(1);
        Self::from_fn(self.width * factor, self.height * factor, |x, y| self.pixel(x / factor, y / factor))
    }
}

/// Checks that a plane handed to this module holds `width * height` values.
fn check_plane<T>(name: &'static str, plane: &[T], width: usize, height: usize) -> Result<()> {
    if width.checked_mul(height) == Some(plane.len()) {
        return Ok(());
    }
    Err(Error::argument(name, format!("{width} x {height} values"), format!("{} values", plane.len())))
}

/// The `percentile` (0 to 100) of the finite values that `values` yields; 0 when there are none.
fn percentile(values: impl Iterator<Item = f64>, percentile: f64) -> f64 {
    let mut finite: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    nearest_quantile(&mut finite, percentile.clamp(0.0, 100.0) / 100.0).unwrap_or(0.0)
}
