//! The stencil of a neighbourhood: weights, covariance, and the jet at one pixel.

use super::{neighbourhood::Neighbourhood, neighbourhood::weight, separable::Axis, separable::taylor};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::types::Frame;
use nalgebra::DMatrix;

/// How far a neighbourhood reaches from its site, px. Where it would leave the frame there is no jet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reach {
    /// To the left.
    pub left: usize,
    /// To the right.
    pub right: usize,
    /// Upwards.
    pub up: usize,
    /// Downwards.
    pub down: usize,
}

impl Reach {
    /// Whether the neighbourhood of pixel `(x, y)` lies inside a frame of `(width, height)`.
    #[inline]
    pub fn fits(self, (x, y): (usize, usize), (width, height): (usize, usize)) -> bool {
        x >= self.left && y >= self.up && x + self.right < width && y + self.down < height
    }

    /// Columns and rows with a jet, in a frame of `(width, height)`.
    pub fn inside(self, (width, height): (usize, usize)) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let range = |before: usize, after: usize, n: usize| before..n.saturating_sub(after).max(before);
        (range(self.left, self.right, width), range(self.up, self.down, height))
    }
}

/// The linear map from a neighbourhood's brightness to the 2-jet `(I, Ix, Iy, Ixx, Ixy, Iyy)`.
///
/// WO2010/098160, (32), (33) and paragraph 0081: `i = (B^T W B)^-1 B^T W z` with rows of B `[1, ex, ey,
/// ex^2/2, ex ey, ey^2/2]`. Derivatives are per px, or per unit of the pixel pitch.
#[derive(Debug, Clone)]
pub struct JetStencil {
    pitch: (f64, f64),
    offsets: Vec<(i32, i32)>,
    weights: Vec<[f64; 6]>,
    covariance: [[f64; 6]; 6],
    freedom: f64,
    reach: Reach,
    axes: Option<(Axis, Axis)>,
}

impl JetStencil {
    /// The stencil of `neighbourhood` for pixels of `pitch = (dx, dy)`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `neighbourhood` when it is smaller than 3x3 or its design matrix (with its
    /// weights) has a rank below 6; naming `pixel_pitch` when that is not positive and finite.
    pub fn new(neighbourhood: &Neighbourhood, pitch: (f64, f64)) -> Result<Self> {
        neighbourhood.check()?;
        let positive = |p: f64| p.is_finite() && p > 0.0;
        if !(positive(pitch.0) && positive(pitch.1)) {
            return Err(Error::argument("pixel_pitch", "two positive, finite lengths", format!("{pitch:?}")));
        }
        let offsets = neighbourhood.offsets();
        let scale = scales(pitch);
        let mut weights = fit(neighbourhood, &offsets)?;
        let freedom = freedom(&offsets, &weights);
        for w in &mut weights {
            for k in 0..6 {
                w[k] *= scale[k];
            }
        }
        let mut covariance = [[0.0; 6]; 6];
        for (i, row) in covariance.iter_mut().enumerate() {
            for (j, c) in row.iter_mut().enumerate() {
                *c = weights.iter().map(|w| w[i] * w[j]).sum();
            }
        }
        let axes = match *neighbourhood {
            Neighbourhood::Rectangle { width, height, sigma } => Axis::new(width, sigma).zip(Axis::new(height, sigma)),
            Neighbourhood::Points { .. } => None,
        };
        let most = |f: &dyn Fn(&(i32, i32)) -> i32| offsets.iter().map(f).max().unwrap_or(0).max(0) as usize;
        let reach = Reach { left: most(&|p| -p.0), right: most(&|p| p.0), up: most(&|p| -p.1), down: most(&|p| p.1) };
        Ok(Self { pitch, offsets, weights, covariance, freedom, reach, axes })
    }

    /// How far the neighbourhood reaches from its site.
    pub fn reach(&self) -> Reach {
        self.reach
    }
    /// Offsets `(ex, ey)` of the pixels, px.
    pub fn offsets(&self) -> &[(i32, i32)] {
        &self.offsets
    }
    /// `weights()[o][j]`: weight of the pixel at `offsets()[o]` in component `j` of the jet.
    pub fn weights(&self) -> &[[f64; 6]] {
        &self.weights
    }
    /// Covariance of the jet for white pixel noise of variance 1: `(B^T B)^-1` with equal weights, else
    /// `(B^T W B)^-1 B^T W^2 B (B^T W B)^-1`.
    pub fn covariance(&self) -> [[f64; 6]; 6] {
        self.covariance
    }
    /// Whether dense planes are computed by one-dimensional filters.
    pub fn is_separable(&self) -> bool {
        self.axes.is_some()
    }

    /// Filters of the two axes, and the map from their coefficients to the jet.
    pub(super) fn separable(&self) -> Option<(&Axis, &Axis, [[f64; 6]; 6])> {
        let (x, y) = self.axes.as_ref()?;
        let mut map = taylor(x, y);
        for (row, s) in map.iter_mut().zip(scales(self.pitch)) {
            for m in row {
                *m *= s;
            }
        }
        Some((x, y, map))
    }

    /// The jet at pixel `(x, y)`; NaN where the neighbourhood leaves the frame or is not finite.
    ///
    /// Summed in double precision whatever `T` is.
    pub fn at<T: Real>(&self, frame: &Frame<T>, x: usize, y: usize) -> [T; 6] {
        self.at_f64(frame, x, y).map(T::from_f64)
    }

    /// As [`JetStencil::at`], not rounded to `T`.
    pub fn at_f64<T: Real>(&self, frame: &Frame<T>, x: usize, y: usize) -> [f64; 6] {
        if !self.reach.fits((x, y), frame.size()) {
            return [f64::NAN; 6];
        }
        // Derivatives do not see a constant: sums of differences from one sample keep every digit of theirs.
        let base = self.sample(frame, x, y, self.offsets[0]);
        let mut jet = [0.0; 6];
        for (&offset, w) in self.offsets.iter().zip(&self.weights) {
            let z = self.sample(frame, x, y, offset) - base;
            for k in 0..6 {
                jet[k] += w[k] * z;
            }
        }
        jet[0] += base;
        // A weight of zero on one component must not let a bad sample pass in another.
        if jet.iter().all(|v| v.is_finite()) { jet } else { [f64::NAN; 6] }
    }

    #[inline(always)]
    #[allow(clippy::unused_self)]
    fn sample<T: Real>(&self, frame: &Frame<T>, x: usize, y: usize, (ex, ey): (i32, i32)) -> f64 {
        frame.get(x.wrapping_add_signed(ex as isize), y.wrapping_add_signed(ey as isize)).to_f64()
    }

    /// Estimate of the pixel noise's variance from what the quadratic leaves, `|z - B i|^2 / (n - 6)` (with
    /// unequal weights the divisor is the residual's expected square for unit noise). It includes what a
    /// quadratic cannot describe. `None` with six pixels, which always fit. NaN where there is no jet.
    pub fn noise_variance<T: Real>(&self, frame: &Frame<T>, x: usize, y: usize) -> Option<f64> {
        if self.freedom < 1e-9 {
            return None;
        }
        let jet = self.at_f64(frame, x, y);
        if !jet[0].is_finite() {
            return Some(f64::NAN);
        }
        let (dx, dy) = self.pitch;
        let left: f64 = self
            .offsets
            .iter()
            .map(|&(ex, ey)| {
                let row = design_row(f64::from(ex) * dx, f64::from(ey) * dy);
                let fitted: f64 = row.iter().zip(jet).map(|(b, i)| b * i).sum();
                (self.sample(frame, x, y, (ex, ey)) - fitted).powi(2)
            })
            .sum();
        Some(left / self.freedom)
    }

    /// The rows `[1, ex, ey, ex^2/2, ex ey, ey^2/2]` of the design matrix B, offsets in pitch units.
    pub fn design(&self) -> Vec<[f64; 6]> {
        let (dx, dy) = self.pitch;
        self.offsets.iter().map(|&(ex, ey)| design_row(f64::from(ex) * dx, f64::from(ey) * dy)).collect()
    }
}

/// Factors that turn derivatives per px into derivatives per unit of the pitch.
fn scales((dx, dy): (f64, f64)) -> [f64; 6] {
    [1.0, 1.0 / dx, 1.0 / dy, 1.0 / (dx * dx), 1.0 / (dx * dy), 1.0 / (dy * dy)]
}

fn design_row(ex: f64, ey: f64) -> [f64; 6] {
    [1.0, ex, ey, 0.5 * ex * ex, ex * ey, 0.5 * ey * ey]
}

/// The weighted pseudo-inverse of the design, per px, after checking its rank.
fn fit(neighbourhood: &Neighbourhood, offsets: &[(i32, i32)]) -> Result<Vec<[f64; 6]>> {
    let refuse = |got: String| Error::argument("neighbourhood", "pixels that determine a quadratic (rank 6)", got);
    if offsets.len() < 6 {
        return Err(refuse(format!("{} pixels", offsets.len())));
    }
    let root: Vec<f64> = offsets
        .iter()
        .map(|&(ex, ey)| weight(neighbourhood.sigma(), f64::from(ex).hypot(f64::from(ey))).sqrt())
        .collect();
    let mut b = DMatrix::from_fn(offsets.len(), 6, |o, k| {
        root[o] * design_row(f64::from(offsets[o].0), f64::from(offsets[o].1))[k]
    });
    let norms: Vec<f64> = b.column_iter().map(|c| c.norm()).collect();
    for (k, norm) in norms.iter().enumerate() {
        if *norm > 0.0 {
            b.column_mut(k).scale_mut(1.0 / norm);
        }
    }
    let svd = b.svd(true, true);
    let largest = svd.singular_values.max();
    let rank = svd.singular_values.iter().filter(|s| **s > 1e-9 * largest).count();
    if rank < 6 {
        return Err(refuse(format!("{} pixels of rank {rank}", offsets.len())));
    }
    let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else {
        return Err(Error::Numerical("the singular vectors of the neighbourhood's design were not computed".into()));
    };
    let inverse = |o: usize, k: usize| -> f64 {
        (0..6).map(|r| v_t[(r, k)] * u[(o, r)] / svd.singular_values[r]).sum::<f64>() * root[o] / norms[k]
    };
    Ok((0..offsets.len()).map(|o| std::array::from_fn(|k| inverse(o, k))).collect())
}

/// Expected squared residual for unit noise, `tr (I - B W)^T (I - B W)`: n - 6 with equal weights.
fn freedom(offsets: &[(i32, i32)], weights: &[[f64; 6]]) -> f64 {
    // tr(F) = 6 and tr(F F^T) = sum over pairs of (b_o . w_p)^2 for F = B W.
    let rows: Vec<[f64; 6]> = offsets.iter().map(|&(ex, ey)| design_row(f64::from(ex), f64::from(ey))).collect();
    let mut bb = [[0.0; 6]; 6];
    let mut ww = [[0.0; 6]; 6];
    for (b, w) in rows.iter().zip(weights) {
        for i in 0..6 {
            for j in 0..6 {
                bb[i][j] += b[i] * b[j];
                ww[i][j] += w[i] * w[j];
            }
        }
    }
    let square: f64 = (0..6).flat_map(|i| (0..6).map(move |j| (i, j))).map(|(i, j)| bb[i][j] * ww[i][j]).sum();
    offsets.len() as f64 - 12.0 + square
}
