//! Entry point for flow fields: selects points or windows of a field and estimates their motion with the
//! field's own covariances.
//!
//! Points are estimates of a grid; `patches` fits one affine flow to each of several windows.

mod patches;

pub use patches::{FieldPatches, field_patches};

use super::estimate::estimate_motion;
use super::model::input::{Flow, Noise, check_field, measurement, refuse_if};
use super::model::observations::SAMPLE;
use super::model::options::{MotionOptions, SystematicErrors};
use super::model::result::MotionEstimate;
use super::patches::estimate_patch_motion;
use super::solver::refine::MANY;
use crate::error::Result;
use crate::math::{Real, median, quantile};
use crate::types::{FlowField, Intrinsics, Rect, SamplingGrid};
use nalgebra::{Matrix2, Vector2};

/// Standard deviation of the flow's common displacement, in those of one point: 0.2 to 0.4 in rendered rooms
/// (`benchmarks/tables/motion3d_fields.py --only errors`).
const BIAS_PER_NOISE: f64 = 0.4;

/// Share of the points that determine the scale error; others have large covariances for lack of texture.
const SHARPEST_SHARE: f64 = 0.25;

/// Default spacing in correlation lengths, and the least, px: of farther points there are fewer, closer ones
/// add little.
const DEFAULT_SPACING: f64 = 2.0;
const MIN_SPACING: f64 = 8.0;

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
    /// Maximum number of points, of the region if there is one: above it the grid is coarser. Default: no
    /// limit.
    pub max_points: Option<usize>,
    /// Side of square windows, px, each of which becomes one patch with six numbers; not with `spacing` and
    /// `max_points`. Default: points.
    pub patches: Option<usize>,
}

/// Points with their flow and its covariance, as [`Flow::Plane`](crate::motion3d::Flow::Plane) and
/// [`Noise::Covariances`](crate::motion3d::Noise::Covariances) take them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FieldPoints {
    /// Pixels.
    pub points: Vec<[f64; 2]>,
    /// Their flow, px/frame.
    pub flow: Vec<[f64; 2]>,
    /// Its covariances, 4 values a point, px^2; of points closer than independent ones times what they share,
    /// `4 pi l^2 / spacing^2`.
    pub covariances: Vec<f64>,
    /// Number of given points per statistically independent one, the factor in the covariances. For
    /// [`MotionOptions::points_per_independent_sample`](crate::motion3d::MotionOptions).
    pub points_per_independent_sample: f64,
    /// How far errors of neighbours go together, px: the field's own. For
    /// [`MotionOptions::correlation_length`](crate::motion3d::MotionOptions).
    pub correlation_length: f64,
    /// What the flow of the whole field may have in common, estimated from its covariances.
    pub systematic_errors: SystematicErrors,
    /// The spacing that came out of the options, px.
    pub spacing: f64,
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
/// standard deviations of systematic errors.
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
        for (name, is_given) in [("spacing", chosen.spacing.is_some()), ("max_points", chosen.max_points.is_some())] {
            refuse_if(is_given, name, "its default with patches", "another value")?;
        }
        let patches = field_patches(field, size, chosen.region)?;
        let estimate = estimate_patch_motion(
            &patches.seen_by(camera),
            &options.with_systematic_errors(patches.systematic_errors),
        )?;
        return Ok(FieldMotion { estimate, points: patches.points, spacing: size as f64 });
    }
    let found = field_points(field, chosen)?;
    let mut options = options.with_systematic_errors(found.systematic_errors);
    options.points_per_independent_sample.get_or_insert(found.points_per_independent_sample);
    options.correlation_length.get_or_insert(found.correlation_length);
    let flow = Flow::Plane { points: &found.points, flow: &found.flow, camera: Some(camera) };
    let estimate = estimate_motion(&flow, &Noise::Covariances(&found.covariances), &options)?;
    Ok(FieldMotion { estimate, points: found.points, spacing: found.spacing })
}

/// Takes valid estimates of a field at a spacing.
///
/// Errors of windowed estimates correlate over the length `l`, as `exp(-d^2 / (4 l^2))`. Points of a grid get
/// their covariance times `4 pi l^2 / spacing^2`, the number of points on the area over which errors are one,
/// if that is above 1; farther correlation is for
/// [`MotionOptions::correlation_length`](crate::motion3d::MotionOptions). A list of points is taken whole.
///
/// # Errors
/// [`Error::Argument`](crate::error::Error::Argument) for a field without covariance, and for a
/// spacing that is not positive.
pub fn field_points<T: Real>(field: &FlowField<T>, options: &FieldOptions) -> Result<FieldPoints> {
    check_field(field)?;
    let field = &*field.in_pixels_and_frames();
    let correlation_length = field.layout.correlation_length;
    let mut spacing = options.spacing.unwrap_or(MIN_SPACING.max(DEFAULT_SPACING * correlation_length));
    refuse_if(!(spacing.is_finite() && spacing > 0.0), "spacing", "a positive number", spacing)?;
    let (mut step, mut points_per_independent_sample) = (1, 1.0);
    if let SamplingGrid::Grid { stride, .. } = field.layout.sites {
        let steps = |px: f64| ((px / stride as f64).ceil() as usize).max(1);
        // Of points closer than one correlation length neither chance nor outliers can be judged.
        let finest = steps(correlation_length);
        step = steps(spacing).max(finest);
        let count = |step: usize| site_pixels(field, step).filter(|(_, at)| is_within(options.region, *at)).count();
        if options.spacing.is_none() && options.region.is_some() {
            step = (finest..=step).rev().find(|&step| count(step) >= SAMPLE).unwrap_or(finest);
        }
        while options.max_points.is_some_and(|limit| count(step) > limit.max(1)) {
            step += 1;
        }
        spacing = (step * stride) as f64;
        let shared = 4.0 * std::f64::consts::PI * (correlation_length / spacing).powi(2);
        points_per_independent_sample = shared.max(1.0);
    }
    let systematic_errors = systematic_errors(field);
    let mut out = FieldPoints {
        points_per_independent_sample,
        correlation_length,
        systematic_errors,
        spacing,
        ..FieldPoints::default()
    };
    for (site, at) in site_pixels(field, step) {
        let excluded = options.excluded.is_some() && is_within(options.excluded, at);
        if excluded || !is_within(options.region, at) {
            continue;
        }
        let Some((flow, covariance)) = measurement(field, site) else { continue };
        // Rounded, that of an edge may be none.
        if covariance.cholesky().is_none() {
            continue;
        }
        out.points.push([at.0 as f64, at.1 as f64]);
        out.flow.push(flow.into());
        out.covariances.extend((covariance * points_per_independent_sample).iter());
    }
    Ok(out)
}

/// Every `step`-th site of both axes, from half a step on, and its pixel.
fn site_pixels<T>(field: &FlowField<T>, step: usize) -> impl Iterator<Item = (usize, (usize, usize))> + '_ {
    let columns = move |row: usize| {
        let site = move |column: usize| (row * field.width + column, field.layout.sites.pixel(column, row));
        (step / 2..field.width).step_by(step).map(site)
    };
    (step / 2..field.height).step_by(step).flat_map(columns)
}

/// Whether a pixel lies in the region, which is everything where there is none.
fn is_within(region: Option<Rect>, (x, y): (usize, usize)) -> bool {
    region.is_none_or(|r| (r.x..r.x + r.width).contains(&x) && (r.y..r.y + r.height).contains(&y))
}

/// Common errors of a whole field: an object that moves little in the picture does not determine the scale
/// error of flow.
fn systematic_errors<T: Real>(field: &FlowField<T>) -> SystematicErrors {
    let step = (field.len() / MANY).isqrt().max(1);
    systematic_errors_of(site_pixels(field, step).filter_map(|(site, _)| measurement(field, site)))
}

/// Systematic errors of points with flow and covariance: the scale is off by what would be the whole error of
/// the points that determine it best.
fn systematic_errors_of(points: impl Iterator<Item = (Vector2<f64>, Matrix2<f64>)>) -> SystematicErrors {
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
    SystematicErrors { scale, offset: BIAS_PER_NOISE * median(&mut variances).unwrap_or(0.0).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_errors_are_estimated_from_the_sharpest_points() {
        let point = |length: f64| (Vector2::new(length, 0.0), Matrix2::identity() * 0.04);
        let common = systematic_errors_of([1.0, 4.0, 9.0].into_iter().map(point));
        // A flow of 45 standard deviations, and one point's of 0.2.
        assert!((common.scale - (2.0f64 / 2025.0).sqrt()).abs() < 1e-12, "{common:?}");
        assert!((common.offset - BIAS_PER_NOISE * 0.2).abs() < 1e-12, "{common:?}");
        assert_eq!(systematic_errors_of(std::iter::empty()).scale, 1.0);
    }
}
