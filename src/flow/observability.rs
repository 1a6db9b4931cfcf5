//! Which condition of WO2010/098160's theorem 1 makes a pixel observable.

use super::instantaneous::rounding_floor;
use super::least_squares::{RANK_TOLERANCE, solve};
use super::model::{Affine, MotionModel};
use crate::error::{Error, Result};
use crate::jet::{JetRates, JetStencil, Neighbourhood, TimeScheme};
use crate::parallel::{BAND_ROWS, Threads};
use crate::simd::SimdReal;
use crate::types::Frame;
use rayon::prelude::*;

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

impl Condition {
    /// The word used in files and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Self::Neither => "neither",
            Self::RegularHessian => "regular_hessian",
            Self::TurningGradient => "turning_gradient",
            Self::Both => "both",
            Self::Degenerate => "degenerate",
        }
    }
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
        pixels.par_chunks_mut(BAND_ROWS * width).enumerate().for_each(|(band, chunk)| {
            for (k, pixel) in chunk.iter_mut().enumerate() {
                *pixel = at(k % width, band * BAND_ROWS + k / width);
            }
        });
    });
    Ok(ObservabilityMap { width, height, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: [f64; 2] = [3.1, -1.7];
    const H: [f64; 3] = [0.9, 0.35, -0.6];
    const F: [f64; 2] = [0.7, -0.4];
    const M: [f64; 4] = [0.11, -0.07, 0.05, 0.02];
    const ALPHA: [f64; 4] = [0.13, 0.0, 0.0, 0.13];
    const ROTATION: [f64; 4] = [0.0, 0.03, -0.03, 0.0];
    /// n n^T for n = (0.8, -0.5).
    const H1: [f64; 3] = [0.64, -0.4, 0.25];

    fn case(g: [f64; 2], h: [f64; 3], f: [f64; 2], m: [f64; 4]) -> Observability {
        classify([100.0, g[0], g[1], h[0], h[1], h[2]], [f[0], f[1], m[0], m[1], m[2], m[3]])
    }

    #[test]
    fn ranks_are_those_of_the_theorems_table() {
        let (z2, z3, z4) = ([0.0; 2], [0.0; 3], [0.0; 4]);
        let table = [
            ("generic", case(G, H, F, M), 5, 6),
            ("H regular, flow, M = 0", case(G, H, F, z4), 5, 6),
            ("H regular, no flow, M generic", case(G, H, z2, M), 5, 6),
            ("H regular, no flow, M generic, g = 0", case(z2, H, z2, M), 5, 6),
            ("H regular, no flow, M = alpha Id, g", case(G, H, z2, ALPHA), 5, 6),
            ("H regular, no flow, M = alpha Id, g = 0", case(z2, H, z2, ALPHA), 5, 5),
            ("H regular, no motion", case(G, H, z2, z4), 5, 5),
            ("H regular, no motion, g = 0", case(z2, H, z2, z4), 5, 5),
            ("H = 0, rotation", case(G, z3, F, ROTATION), 3, 6),
            ("H = 0, M generic", case(G, z3, F, M), 3, 6),
            ("H = 0, M = alpha Id", case(G, z3, F, ALPHA), 3, 3),
            ("H = 0, M = 0", case(G, z3, F, z4), 3, 3),
            ("H of rank 1, generic", case(G, H1, F, M), 5, 6),
            ("H of rank 1, g = 0, M = 0", case(z2, H1, F, z4), 3, 3),
        ];
        for (name, got, single, both) in table {
            assert_eq!((got.rank_single, got.rank), (single, both), "{name}");
        }
    }

    #[test]
    fn full_rank_and_the_theorems_conditions_go_together() {
        use Condition::{Both, Neither, RegularHessian, TurningGradient};
        let (z2, z3, z4) = ([0.0; 2], [0.0; 3], [0.0; 4]);
        assert_eq!(case(G, H, F, M).condition, Both);
        assert_eq!(case(z2, H, F, M).condition, RegularHessian);
        assert_eq!(case(G, H, z2, ALPHA).condition, RegularHessian);
        assert_eq!(case(G, z3, z2, ROTATION).condition, TurningGradient);
        assert_eq!(case(G, H1, F, M).condition, TurningGradient);
        assert_eq!(case(G, z3, F, ALPHA).condition, Neither);
        assert_eq!(case(G, H, z2, z4).condition, Neither);
    }

    #[test]
    fn intensity_gain_changes_nothing() {
        for gain in [1e-6, 1.0 / 255.0, 257.0] {
            let scaled = case(G.map(|v| v * gain), H.map(|v| v * gain), F, M);
            let (want, c) = (case(G, H, F, M), scaled.condition_number);
            assert_eq!((scaled.rank, scaled.condition), (want.rank, want.condition));
            assert!((c / want.condition_number - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_map_says_what_holds_where() {
        // A ramp turning about the origin on the left, nothing on the right.
        let frames: Vec<Frame<f32>> = (0..3)
            .map(|t| {
                let a = f64::from(t) * 0.03;
                Frame::from_fn(24, 12, |x, y| {
                    if x < 12 { (100.0 + 2.0 * (x as f64 * a.cos() + y as f64 * a.sin())) as f32 } else { 0.7 }
                })
            })
            .collect();
        let three = [&frames[0], &frames[1], &frames[2]];
        let map = observability(three, TimeScheme::Central, &Neighbourhood::default(), Threads::default()).unwrap();
        let at = |x: usize, y: usize| map.pixels[y * map.width + x];
        assert!(at(0, 5).is_none());
        assert_eq!(at(5, 5).unwrap().condition, Condition::TurningGradient);
        assert_eq!((at(18, 5).unwrap().rank, at(18, 5).unwrap().condition), (0, Condition::Neither));
        let small = Frame::filled(2, 9, 0.0);
        let refused = observability([&small; 3], TimeScheme::Central, &Neighbourhood::default(), Threads::default());
        assert!(refused.unwrap_err().to_string().starts_with("frames"));
    }
}
