//! Entry point for flow fields: selects points or windows of a field and estimates their motion with the
//! field's own covariances.
//!
//! `points` takes the estimates of a grid, `patches` fits one affine flow to each of several windows.

mod patches;
mod points;

pub use patches::{FieldPatches, field_patches};
pub use points::{FieldPoints, field_points};

use super::estimate::estimate_motion;
use super::model::camera::Intrinsics;
use super::model::input::{Flow, Noise};
use super::model::options::{CommonErrors, MotionOptions};
use super::model::result::MotionEstimate;
use super::patches::estimate_patch_motion;
use crate::error::{Error, Result};
use crate::math::{Real, median, quantile};
use crate::types::{FlowField, Rect, Status};
use nalgebra::{Matrix2, Vector2};

/// Standard deviation of the flow's common displacement, in those of one point: in rendered rooms, by both
/// methods with a field of windows, mean errors of a picture are 0.2 to 0.4 of it
/// (`benchmarks/tables/motion3d_fields.py --only errors`).
const BIAS_PER_NOISE: f64 = 0.4;

/// Share of the points that determine the scale error; others have large covariances for lack of texture.
const SHARPEST_SHARE: f64 = 0.25;

/// About so many sites of a field are used for its common errors.
const COMMON_ERROR_SITES: f64 = 4000.0;

/// Which points of a field are taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FieldOptions {
    /// Distance of the points along rows and columns, px, not below the correlation length of the field;
    /// default: 2 correlation lengths, at least 8 px, and less where a region would have fewer than 30
    /// points.
    pub spacing: Option<f64>,
    /// Only points in this rectangle of pixels.
    pub region: Option<Rect>,
    /// Only points outside of this rectangle of pixels.
    pub excluded: Option<Rect>,
    /// Most points, of the region if there is one; the grid is made coarser to keep to it. Default: no limit.
    pub most: Option<usize>,
    /// Side of square windows, px, each of which becomes one patch with six numbers; not with `spacing` and
    /// `most`. Default: points.
    pub patches: Option<usize>,
}

/// The motion of a field with the points that it was estimated from.
#[derive(Debug, Clone)]
pub struct FieldMotion {
    /// The motion.
    pub estimate: MotionEstimate,
    /// Pixels; of patches the middles of their windows.
    pub points: Vec<[f64; 2]>,
    /// Distance of the points along rows and columns, px.
    pub spacing: f64,
}

/// The rigid motion of the scene in a flow field, from the field's own covariances.
///
/// Options that are `None` take the field's: number of points per independent one, correlation length,
/// standard deviations of common errors.
///
/// # Errors
/// As [`field_points`], [`field_patches`] and the estimates from them.
pub fn estimate_field_motion<T: Real>(
    field: &FlowField<T>,
    camera: &Intrinsics,
    chosen: &FieldOptions,
    options: &MotionOptions,
) -> Result<FieldMotion> {
    if let Some(size) = chosen.patches {
        for (name, is_given) in [("spacing", chosen.spacing.is_some()), ("max_points", chosen.most.is_some())] {
            if is_given {
                return Err(Error::argument(name, "its default with patches", "another value"));
            }
        }
        let patches = field_patches(field, size, chosen.region)?;
        let estimate = estimate_patch_motion(&patches.seen_by(camera), &options.with_common(patches.common))?;
        return Ok(FieldMotion { estimate, points: patches.points, spacing: size as f64 });
    }
    let found = field_points(field, chosen)?;
    let mut options = options.with_common(found.common);
    options.points_per_independent_sample.get_or_insert(found.points_per_independent_sample);
    options.correlation_length.get_or_insert(found.correlation_length);
    let flow = Flow::Plane { points: &found.points, flow: &found.flow, camera: Some(camera) };
    let estimate = estimate_motion(&flow, &Noise::Covariances(&found.covariances), &options)?;
    Ok(FieldMotion { estimate, points: found.points, spacing: found.spacing })
}

/// Whether a pixel lies in the region, which is everything where there is none.
fn is_within(region: Option<Rect>, x: usize, y: usize) -> bool {
    region.is_none_or(|r| (r.x..r.x + r.width).contains(&x) && (r.y..r.y + r.height).contains(&y))
}

/// Flow `(u, v, u_x, v_x, u_y, v_y)` and the covariance of `(u, v)` at a site, if they are valid.
fn measurement<T: Real>(field: &FlowField<T>, site: usize) -> Option<([f64; 6], [[f64; 2]; 2])> {
    let valid = field.status[site].is_valid() && field.status[site] != Status::Inconsistent;
    let [[uu, uv, ..], [vu, vv, ..], ..] = field.covariance_at(site).filter(|_| valid)?;
    Some((field.affine(site).to_array().map(Real::to_f64), [[uu, uv], [vu, vv]]))
}

/// Common errors of a whole field: an object that moves little in the picture does not determine the scale
/// error of flow.
fn common_errors<T: Real>(field: &FlowField<T>) -> CommonErrors {
    let step = ((field.len() as f64 / COMMON_ERROR_SITES).sqrt() as usize).max(1);
    let sites = (0..field.height)
        .step_by(step)
        .flat_map(|row| (0..field.width).step_by(step).map(move |column| row * field.width + column));
    let flow = |site: usize| {
        let ([u, v, ..], covariance) = measurement(field, site)?;
        Some((Vector2::new(u, v), Matrix2::from_fn(|i, j| covariance[i][j])))
    };
    common_errors_of(sites.filter_map(flow))
}

/// Common errors of points with flow and covariance: the scale is off by what would be the whole error of the
/// points that determine it best.
fn common_errors_of(points: impl Iterator<Item = (Vector2<f64>, Matrix2<f64>)>) -> CommonErrors {
    let (mut squares, mut variances) = (Vec::new(), Vec::new());
    for (flow, covariance) in points {
        let square = covariance.cholesky().map(|factor| flow.dot(&factor.solve(&flow)));
        if let Some(square) = square.filter(|square| square.is_finite()) {
            squares.push(square);
            variances.push(0.5 * covariance.trace());
        }
    }
    let square = quantile(&mut squares, 1.0 - SHARPEST_SHARE).unwrap_or(0.0);
    // An error has two components. Flow that may be twice as long or none has no scale.
    let scale = if square > 0.0 { (2.0 / square).sqrt().min(1.0) } else { 1.0 };
    CommonErrors { scale, offset: BIAS_PER_NOISE * median(&mut variances).unwrap_or(0.0).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_errors_are_estimated_from_the_sharpest_points() {
        let point = |length: f64| (Vector2::new(length, 0.0), Matrix2::identity() * 0.04);
        let common = common_errors_of([1.0, 4.0, 9.0].into_iter().map(point));
        // A flow of 45 standard deviations, and one point's of 0.2.
        assert!((common.scale - (2.0f64 / 2025.0).sqrt()).abs() < 1e-12, "{common:?}");
        assert!((common.offset - BIAS_PER_NOISE * 0.2).abs() < 1e-12, "{common:?}");
        assert_eq!(common_errors_of(std::iter::empty()).scale, 1.0);
    }
}
