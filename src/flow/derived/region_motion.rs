//! One affine motion for a whole region, from the estimates of its sites.

use super::Motion;
use super::common_residual::common_residual;
use super::dominant::{Site, dominant_motion, limit_variances};
use super::region::{carry_to, sites_in, valid_sites};
use super::sharing::{in_common, sharing_among};
use crate::ablation::keeps;
use crate::error::{Error, Result};
use crate::math::Real;
use crate::types::{FlowField, MOTION_NAMES, Region, choices};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix6, Vector2, Vector6};

/// Variance added to every estimate, in squares of px/frame and 1/frame: no estimate is taken for exact.
const FLOOR: f64 = 1e-14;

/// Whether a region has the requested motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegionStatus {
    /// More than half of its valid sites follow one affine motion, and more than those whose estimates the
    /// frames contradict; or the site at the given point does.
    Ok,
    /// No motion is that of most sites, or the site at the given point differs from its neighbours.
    NoDominantMotion,
    /// Too few valid sites to determine an affine motion, or the frames contradict more than half of the
    /// estimates.
    TooFewSites,
}

choices!(RegionStatus, "status": Ok "ok", NoDominantMotion "no_dominant_motion", TooFewSites "too_few_sites");

/// The motion of a region about its centre, or about the point in it that was given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegionMotion {
    /// `(u, v, u_x, v_x, u_y, v_y)` at the centre, in the units of the field; NaN unless the status is `Ok`.
    pub motion: [f64; 6],
    /// Covariance of the motion.
    pub covariance: [[f64; 6]; 6],
    /// The centre of the region's sites, or the given point, px.
    pub centre: (f64, f64),
    /// Sites that follow the motion.
    pub count: usize,
    /// Sites in the region with a valid estimate.
    pub valid: usize,
    /// Sites in the region.
    pub sites: usize,
    /// Whether the motion can be used.
    pub status: RegionStatus,
}

impl RegionMotion {
    /// Share of the valid sites that follow the motion, 0 to 1.
    pub fn share(&self) -> f64 {
        self.count as f64 / self.valid.max(1) as f64
    }

    /// Share of the region's sites that have a valid estimate, 0 to 1.
    pub fn valid_share(&self) -> f64 {
        self.valid as f64 / self.sites.max(1) as f64
    }
}

/// Fits one affine motion `m0` about the centre (or `at`) to the estimates `m_i` (covariance `C_i`) of the
/// valid sites in `region` (`None`: all) that follow the motion of most of them, or with `at`, a pixel
/// `(x, y)`, that of the sites around it: `min sum (m_i - T_i m0)^T C_i^-1 (m_i - T_i m0)`, where `T_i`
/// carries the affine motion from the centre to the site. The motion is the fit to `(u, v)` of the sites; the
/// covariance is that of the fit to all six parameters, and what this would change.
///
/// Estimates of neighbouring sites share pixels; the covariance is enlarged by [`sharing`](super::sharing()).
/// Where the estimates scatter more than their covariances allow, it is enlarged by that ratio too (R. T.
/// Birge, "The calculation of errors by the method of least squares", 1932). Where they scatter less, they
/// have an error in common, which does not shrink with their number: the covariance holds it in full. What
/// the residuals have in common over parts of the region (two motions that are close, a flow that is not
/// affine) does not shrink either; an analysis of variance finds it.
///
/// # Errors
/// [`Error::Argument`] naming `region` or `at` where they do not fit the frame, `covariance` for a field
/// without one.
pub fn fit_region<T: Real>(
    field: &FlowField<T>,
    region: Option<&Region>,
    at: Option<(f64, f64)>,
) -> Result<RegionMotion> {
    if field.covariance.is_none() {
        return Err(Error::argument("field", "one with covariance", "one without"));
    }
    let (width, height) = field.layout.frame_size;
    if let Some((x, y)) = at
        && !(x >= 0.0 && y >= 0.0 && x <= (width - 1) as f64 && y <= (height - 1) as f64)
    {
        let expected = format!("a pixel (x, y) inside the {width} x {height} frame");
        return Err(Error::argument("at", expected, format!("({x}, {y})")));
    }
    let pixel = |index: usize| {
        let (x, y) = field.layout.sites.pixel(index % field.width, index / field.width);
        (x as f64, y as f64)
    };
    let inside = sites_in(field, region)?;
    let n = inside.len().max(1) as f64;
    let sum = inside.iter().map(|&index| pixel(index)).fold((0.0, 0.0), |sum, at| (sum.0 + at.0, sum.1 + at.1));
    let centre = at.unwrap_or((sum.0 / n, sum.1 / n));
    let scale = [field.layout.units.scale("u"), field.layout.units.scale("v")];
    let valid = valid_sites(field, &inside);
    let mut sites: Vec<Site> = valid
        .iter()
        .flatten()
        .filter_map(|&index| {
            let motion = Motion::at_site(field, index);
            let covariance = motion.covariance?;
            let per = |i: usize, j: usize| covariance[i][j] / (scale[i] * scale[j]);
            let covariance = Matrix2::new(per(0, 0) + FLOOR, per(0, 1), per(1, 0), per(1, 1) + FLOOR);
            let flow = Vector2::new(motion.parameters[0] / scale[0], motion.parameters[1] / scale[1]);
            let (x, y) = pixel(index);
            let is_known = covariance.iter().chain(flow.iter()).all(|value| value.is_finite());
            is_known.then_some(Site { index, x: x - centre.0, y: y - centre.1, flow, covariance })
        })
        .collect();
    limit_variances(&mut sites);
    let unknown = RegionMotion {
        motion: [f64::NAN; 6],
        covariance: [[f64::NAN; 6]; 6],
        centre,
        count: 0,
        valid: sites.len(),
        sites: inside.len(),
        status: RegionStatus::TooFewSites,
    };
    let nearest = |(x, y): (f64, f64)| {
        let from = |site: &Site| (site.x + centre.0 - x).hypot(site.y + centre.1 - y);
        (0..sites.len()).min_by(|&a, &b| from(&sites[a]).total_cmp(&from(&sites[b])))
    };
    let wanted = at.and_then(nearest);
    let Some(dominant) = dominant_motion(&sites, wanted) else { return Ok(unknown) };
    let followers: Vec<usize> = sites.iter().filter(|site| dominant.holds(site)).map(|site| site.index).collect();
    let count = followers.len();
    // Where the frames contradict the estimate there may be a motion that was not found.
    let estimated = inside.iter().filter(|&&index| field.status[index].has_estimate()).count();
    let contradicted = if keeps("measure.contradicted") { estimated - sites.len() } else { 0 };
    let is_dominant = 2 * count > sites.len() && count > contradicted;
    let is_found = wanted.map_or(is_dominant, |wanted| dominant.holds(&sites[wanted]));
    if !is_found {
        return Ok(RegionMotion { count, status: RegionStatus::NoDominantMotion, ..unknown });
    }
    let observed = observed_parameters(field);
    let fit = |parameters: &[usize]| least_squares(field, &followers, centre, parameters);
    // Jacobians see what lies beside a small object, too: the motion is that of the flow alone, and what they
    // would change is part of the covariance.
    let (Some((motion, _)), Some((joint, mut covariance))) = (fit(&observed[..2]), fit(&observed)) else {
        return Ok(unknown);
    };
    let near: Vec<usize> = sites.iter().filter(|site| dominant.may_hold(site)).map(|site| site.index).collect();
    let common = common_residual(field, &near, (centre, &joint), &floors(field));
    for i in 0..6 {
        for j in 0..6 {
            if keeps("measure.common_residual") {
                covariance[i][j] += common[i][j];
            }
            if keeps("measure.jacobian_change") {
                covariance[i][j] += (joint[i] - motion[i]) * (joint[j] - motion[j]);
            }
        }
    }
    Ok(RegionMotion { motion, covariance, count, status: RegionStatus::Ok, ..unknown })
}

/// The weighted fit to the parameters `observed` of the sites `used` about `centre`, px, with its covariance.
pub(super) fn least_squares<T: Real>(
    field: &FlowField<T>,
    used: &[usize],
    centre: (f64, f64),
    observed: &[usize],
) -> Option<([f64; 6], [[f64; 6]; 6])> {
    let (dx, dy) = field.layout.units.pixel_pitch;
    let floor = floors(field);
    let (mut normal, mut right, mut square, mut count) = (Matrix6::zeros(), Vector6::zeros(), 0.0, 0);
    // Sums of the weights, and of what they make of an error that all sites have in common.
    let mut weights = DMatrix::zeros(observed.len(), observed.len());
    let mut passed = DMatrix::zeros(6, observed.len());
    for &site in used {
        let Some(weight) = inverse_covariance(field, site, observed, &floor) else { continue };
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
    let inverse = invert_scaled(&normal)?;
    let motion = inverse * right;
    let freedom = (count * observed.len()) as f64 - 6.0;
    let scatter = if freedom > 0.0 { (square - right.dot(&motion)) / freedom } else { 1.0 };
    let sharing = sharing_among(&field.layout, field.width, used);
    let common = in_common(scatter, (count, observed.len()), sharing);
    let mut covariance = inverse * (scatter.max(1.0) * sharing * (1.0 - common));
    if let Some(claimed) = weights.try_inverse() {
        let passed = inverse * passed;
        let whole = &passed * claimed * passed.transpose() * (common * count as f64);
        covariance += Matrix6::from_fn(|i, j| whole[(i, j)]);
    }
    Some((motion.into(), covariance.transpose().into()))
}

/// Variances added to those of the estimates, in the units of the field.
fn floors<T>(field: &FlowField<T>) -> [f64; 6] {
    MOTION_NAMES.map(|name| FLOOR * field.layout.units.scale(name).powi(2))
}

/// Which of the six parameters the model estimates.
pub(super) fn observed_parameters<T: Real>(field: &FlowField<T>) -> Vec<usize> {
    let known = |name: &str| field.layout.parameters.iter().any(|parameter| parameter == name);
    (0..6).filter(|&k| known(MOTION_NAMES[k])).collect()
}

fn inverse_covariance<T: Real>(
    field: &FlowField<T>,
    site: usize,
    observed: &[usize],
    floor: &[f64; 6],
) -> Option<DMatrix<f64>> {
    let covariance = field.covariance_at(site)?;
    let n = observed.len();
    let entry = |i: usize, j: usize| covariance[i][j] + if i == j { floor[i] } else { 0.0 };
    let matrix = DMatrix::from_fn(n, n, |i, j| entry(observed[i], observed[j]));
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
