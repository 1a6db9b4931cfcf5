//! One affine motion for a whole region, from the estimates of its sites.

use super::{sharing, sharing::in_common};
use crate::math::Real;
use crate::types::{FlowField, Rect, SamplingGrid};
use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, Vector6};

/// Variance added to every estimate, (px/frame)^2 and 1/frame^2: no estimate is taken for exact.
const FLOOR: f64 = 1e-14;

/// The motion of a region about its centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegionMotion {
    /// `(u, v, u_x, v_x, u_y, v_y)` at the centre, units of the field.
    pub motion: [f64; 6],
    /// Covariance of the motion.
    pub covariance: [[f64; 6]; 6],
    /// The centre in pixels.
    pub centre: (f64, f64),
    /// Sites that took part.
    pub count: usize,
    /// SamplingGrid in the region.
    pub sites: usize,
}

impl RegionMotion {
    /// Share of the region's sites that took part, 0 to 1.
    pub fn valid_share(&self) -> f64 {
        if self.sites == 0 { 0.0 } else { self.count as f64 / self.sites as f64 }
    }
}

/// Fits one affine motion `m0` about the centre to the estimates `m_i` (covariance `C_i`) of a field's valid
/// sites: `min sum (m_i - T_i m0)^T C_i^-1 (m_i - T_i m0)`, where `T_i` carries the affine motion from the
/// centre to the site.
///
/// Estimates of neighbouring sites share pixels; the covariance is enlarged by [`sharing`](super::sharing).
/// Where the estimates scatter more than their covariances allow, it is enlarged by that ratio too (R. T.
/// Birge, "The calculation of errors by the method of least squares", 1932), so that a region that does not
/// move as one affine motion shows in the standard deviation. Where they scatter less, they have an error in
/// common, which does not shrink with their number: the covariance holds it in full.
///
/// The motion is NaN where the field has no covariance or the sites do not determine six parameters.
pub fn fit_region<T: Real>(field: &FlowField<T>) -> RegionMotion {
    let centre = centre_of(field);
    let (dx, dy) = field.layout.pixel_pitch;
    let observed: Vec<usize> = observed_parameters(field);
    let (mut normal, mut right, mut square, mut count) = (Matrix6::zeros(), Vector6::zeros(), 0.0, 0);
    // Sums of the weights, and of what they make of an error that all sites have in common.
    let mut weights = DMatrix::zeros(observed.len(), observed.len());
    let mut passed = DMatrix::zeros(6, observed.len());
    for site in (0..field.len()).filter(|&site| field.status[site].is_valid()) {
        let Some(weight) = inverse_covariance(field, site, &observed) else { continue };
        let (x, y) = field.layout.sites.pixel(site % field.width, site / field.width);
        let carry = carry_to((x as f64 - centre.0) * dx, (y as f64 - centre.1) * dy);
        let rows = carry.select_rows(observed.iter());
        let estimate = field.affine(site).to_array().map(Real::to_f64);
        let value = DVector::from_iterator(observed.len(), observed.iter().map(|&k| estimate[k]));
        let weighted = rows.transpose() * &weight;
        normal += &weighted * &rows;
        right += &weighted * &value;
        passed += &weighted;
        weights += &weight;
        square += (value.transpose() * &weight * &value)[0];
        count += 1;
    }
    let unknown =
        RegionMotion { motion: [f64::NAN; 6], covariance: [[f64::NAN; 6]; 6], centre, count, sites: field.len() };
    let Some(inverse) = invert_scaled(&normal) else { return unknown };
    let motion = inverse * right;
    let freedom = (count * observed.len()) as f64 - 6.0;
    let scatter = if freedom > 0.0 { (square - right.dot(&motion)) / freedom } else { 1.0 };
    let sharing = sharing(&field.layout);
    let common = in_common(scatter, (count, observed.len()), sharing);
    let mut covariance = inverse * (scatter.max(1.0) * sharing * (1.0 - common));
    if let Some(claimed) = weights.try_inverse() {
        let passed = inverse * passed;
        let whole = &passed * claimed * passed.transpose() * (common * count as f64);
        covariance += Matrix6::from_fn(|i, j| whole[(i, j)]);
    }
    RegionMotion { motion: motion.into(), covariance: covariance.transpose().into(), ..unknown }
}

/// `(u, v, ...)(p) = T m0` at the offset `(dx, dy)`.
fn carry_to(dx: f64, dy: f64) -> SMatrix<f64, 6, 6> {
    let mut carry = Matrix6::identity();
    (carry[(0, 2)], carry[(0, 4)]) = (dx, dy);
    (carry[(1, 3)], carry[(1, 5)]) = (dx, dy);
    carry
}

/// Which of the six parameters the model estimates.
fn observed_parameters<T: Real>(field: &FlowField<T>) -> Vec<usize> {
    let known = |name: &str| field.layout.parameters.iter().any(|parameter| parameter == name);
    (0..6).filter(|&k| known(crate::types::MOTION_NAMES[k])).collect()
}

fn inverse_covariance<T: Real>(field: &FlowField<T>, site: usize, observed: &[usize]) -> Option<DMatrix<f64>> {
    let covariance = field.covariance_at(site)?;
    let n = observed.len();
    let matrix = DMatrix::from_fn(n, n, |i, j| covariance[observed[i]][observed[j]] + if i == j { FLOOR } else { 0.0 });
    matrix.iter().all(|value| value.is_finite()).then_some(())?;
    matrix.cholesky().map(|factor| factor.inverse())
}

/// The inverse of a symmetric positive matrix, its rows and columns scaled to a unit diagonal first.
fn invert_scaled(matrix: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let scale = matrix.diagonal().map(|value| 1.0 / value.sqrt());
    if !scale.iter().all(|value| value.is_finite()) {
        return None;
    }
    let scaled = Matrix6::from_fn(|i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled.cholesky()?.inverse();
    Some(Matrix6::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// The middle of the sites in pixels; of points, their mean.
fn centre_of<T>(field: &FlowField<T>) -> (f64, f64) {
    match &field.layout.sites {
        SamplingGrid::Grid { region, .. } => {
            let (width, height) = field.layout.frame_size;
            let r = region.unwrap_or(Rect { x: 0, y: 0, width, height });
            (r.x as f64 + (r.width as f64 - 1.0) / 2.0, r.y as f64 + (r.height as f64 - 1.0) / 2.0)
        }
        SamplingGrid::Points(points) => {
            let n = points.len().max(1) as f64;
            let sum = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 as f64, y + point.1 as f64));
            (sum.0 / n, sum.1 / n)
        }
    }
}
