//! Which condition of WO2010/098160's theorem 1 makes a pixel observable.

use super::instantaneous::rounding_floor;
use super::least_squares::{RANK_TOLERANCE, solve};
use super::model::{Affine, MotionModel};
use crate::error::{Error, Result};
use crate::jet::{JetRates, JetStencil, Neighbourhood, TimeScheme};
use crate::parallel::{self, BAND_ROWS, Threads};
use crate::simd::SimdReal;
use crate::types::Frame;

/// Why `[J(i); J(i')]` has full rank, or has not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
pub enum Condition {
    /// No condition holds: `(u, v)` and the Jacobian are not all determined.
    #[default]
    Neither = 0,
    /// (i): regular Hessian and flow, or M no multiple of the identity, or M and gradient not zero.
    RegularHessian = 1,
    /// (ii): the gradient and its time derivative are independent (28), even where the Hessian vanishes.
    TurningGradient = 2,
    /// Both.
    Both = 3,
    /// Full rank although neither holds strictly: a Hessian of rank 1 helps the gradient.
    Degenerate = 4,
}

/// Theorem 1 at one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observability {
    /// The condition that holds.
    pub condition: Condition,
    /// Rank of `J(i)`, at most 5.
    pub rank_single: u8,
    /// Rank of `[J(i); J(i')]`: 6 where the affine model is observable.
    pub rank: u8,
    /// Condition number of the column-scaled `[J(i); J(i')]`.
    pub condition_number: f64,
}

/// Observability of a jet with its time derivatives.
///
/// `floor`: standard deviation of the rounding noise in the jets, grey levels; 0 where they are exact.
fn judge(rates: &JetRates<f64>, floor: f64) -> Observability {
    let [_, ix, iy, ixx, ixy, iyy] = rates.jet;
    let [_, tx, ty, ..] = rates.first;
    let single = solve(&Affine::brightness_jacobian(&rates.jet), &[0.0; 6], floor);
    let (a, b) = Affine::equations(rates);
    let both = solve(&a, &b, floor);
    // With a regular Hessian the exceptions of (i) are exactly the motions that leave rank 5.
    let hessian = regular([[ixx, ixy], [ixy, iyy]], floor) && both.rank == 6;
    let turning = regular([[ix, iy], [tx, ty]], floor);
    let condition = match (hessian, turning) {
        (true, true) => Condition::Both,
        (true, false) => Condition::RegularHessian,
        (false, true) => Condition::TurningGradient,
        (false, false) if both.rank == 6 => Condition::Degenerate,
        (false, false) => Condition::Neither,
    };
    Observability { condition, rank_single: single.rank as u8, rank: both.rank as u8, condition_number: both.condition }
}

/// Whether a 2x2 matrix has rank 2: its smaller singular value against noise and its own size.
fn regular(a: [[f64; 2]; 2], floor: f64) -> bool {
    let det = (a[0][0] * a[1][1] - a[0][1] * a[1][0]).abs();
    let square: f64 = a.iter().flatten().map(|v| v * v).sum();
    let largest = (0.5 * (square + (square * square - 4.0 * det * det).max(0.0).sqrt())).sqrt();
    largest > 0.0 && det / largest > (2.0 * floor).max(RANK_TOLERANCE * largest)
}

/// Theorem 1 for a jet `i` moving by `m = (u, v, u_x, v_x, u_y, v_y)`: `i' = J(i) m`.
pub fn classify(jet: [f64; 6], motion: [f64; 6]) -> Observability {
    let j = Affine::brightness_jacobian(&jet);
    let first = j.map(|row| row.iter().zip(&motion).map(|(a, m)| a * m).sum());
    judge(&JetRates { jet, first, second: [0.0; 6] }, 0.0)
}

/// Theorem 1 at every pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservabilityMap {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Observability of each pixel, row-major; `None` at the border and where a sample is not finite.
    pub pixels: Vec<Option<Observability>>,
}

/// The observability of the affine model at every pixel, from three frames, oldest first.
///
/// # Errors
/// [`Error::Argument`] naming `frames` when their sizes differ or are below 3x3, or `neighbourhood` when that
/// is unusable.
pub fn observability<T: SimdReal>(
    frames: [&Frame<T>; 3],
    scheme: TimeScheme,
    neighbourhood: &Neighbourhood,
    threads: Threads,
) -> Result<ObservabilityMap> {
    let (width, height) = frames[0].size();
    if frames.iter().any(|f| f.size() != (width, height)) {
        let got = format!("{:?}", frames.map(Frame::size));
        return Err(Error::argument("frames", "frames of one size", got));
    }
    if width < 3 || height < 3 {
        return Err(Error::argument("frames", "at least 3 x 3 pixels", format!("{width} x {height}")));
    }
    let stencil = JetStencil::new(neighbourhood, (1.0, 1.0))?;
    let at = |x: usize, y: usize| {
        let [old, middle, new] = frames.map(|f| stencil.at_f64(f, x, y));
        let rates = scheme.rates(old, middle, new);
        let finite = [old, middle, new].iter().flatten().all(|v| v.is_finite());
        finite.then(|| judge(&rates, rounding_floor::<T>(&rates)))
    };
    let mut pixels = vec![None; width * height];
    threads.install(|| {
        parallel::for_each(pixels.chunks_mut(BAND_ROWS * width).enumerate(), |(band, chunk)| {
            for (k, pixel) in chunk.iter_mut().enumerate() {
                *pixel = at(k % width, band * BAND_ROWS + k / width);
            }
        });
    });
    Ok(ObservabilityMap { width, height, pixels })
}
