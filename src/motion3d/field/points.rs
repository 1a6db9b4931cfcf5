//! Points of a flow field that share no window.

use super::{FieldOptions, common_errors, is_within, measurement};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::motion3d::model::input::check_field;
use crate::motion3d::model::options::CommonErrors;
use crate::types::{FlowField, Rect, SamplingGrid};
use nalgebra::Matrix2;

/// Distance in correlation lengths from which on errors share no window. On a recorded drive a fifth of them
/// is still correlated (`benchmarks/tables/motion3d_drive.py`); the motion's covariance sums that.
const INDEPENDENT: f64 = 4.0;

/// Default spacing in correlation lengths: of farther points there are fewer, closer ones add little.
const DEFAULT_SPACING: f64 = 2.0;

/// Least default spacing, px.
const MIN_SPACING: f64 = 8.0;

/// Least spacing in correlation lengths: of closer points neither chance nor outliers can be judged.
const FINEST_SPACING: f64 = 1.0;

/// Points of a region below which the default grid is made finer.
const MIN_REGION_POINTS: usize = 30;

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
    /// How many points share one error: what the covariances are multiplied with. For
    /// [`MotionOptions::points_per_independent_sample`](crate::motion3d::MotionOptions).
    pub points_per_independent_sample: f64,
    /// How far errors of neighbours go together, px: the field's own. For
    /// [`MotionOptions::correlation_length`](crate::motion3d::MotionOptions).
    pub correlation_length: f64,
    /// What the flow of the whole field may have in common, estimated from its covariances. For
    /// [`MotionOptions::common`](crate::motion3d::MotionOptions).
    pub common: CommonErrors,
    /// The spacing that came out of the options, px.
    pub spacing: f64,
}

/// Takes every so manieth valid estimate of a field.
///
/// Windowed estimates share pixels, and where they do their errors go together over the correlation length
/// `l`, as `exp(-d^2 / (4 l^2))`: taken for independent, close points would make the motion's covariance too
/// small. Closer than 4 `l` they get their covariance times `4 pi l^2 / spacing^2`, the number of points on
/// the area over which errors are one. What goes together farther than that is for
/// [`MotionOptions::correlation_length`](crate::motion3d::MotionOptions).
///
/// A list of points is taken whole.
///
/// # Errors
/// [`Error::Argument`] for a field without covariance or with a pixel pitch, and for a spacing that is not
/// positive.
pub fn field_points<T: Real>(field: &FlowField<T>, options: &FieldOptions) -> Result<FieldPoints> {
    check_field(field)?;
    let usual = MIN_SPACING.max(DEFAULT_SPACING * field.layout.correlation_length);
    let spacing = options.spacing.unwrap_or(usual);
    if !(spacing.is_finite() && spacing > 0.0) {
        return Err(Error::argument("spacing", "a positive number", spacing));
    }
    let step = match field.layout.sites {
        SamplingGrid::Grid { stride, .. } => {
            let steps = |px: f64| ((px / stride as f64).ceil() as usize).max(1);
            let finest = steps(FINEST_SPACING * field.layout.correlation_length);
            let mut step = steps(spacing).max(finest);
            if options.spacing.is_none() && options.region.is_some() {
                step = fine_enough(field, step, finest, options.region);
            }
            coarse_enough(field, step, options)
        }
        SamplingGrid::Points(_) => 1,
    };
    let points_per_independent_sample = shared_by(field, step);
    let spacing = match field.layout.sites {
        SamplingGrid::Grid { stride, .. } => (step * stride) as f64,
        SamplingGrid::Points(_) => spacing,
    };
    let correlation_length = field.layout.correlation_length;
    let common = common_errors(field);
    let mut out =
        FieldPoints { points_per_independent_sample, correlation_length, common, spacing, ..FieldPoints::default() };
    for row in (step / 2..field.height).step_by(step) {
        for column in (step / 2..field.width).step_by(step) {
            let site = row * field.width + column;
            let (x, y) = field.layout.sites.pixel(column, row);
            let excluded = options.excluded.is_some() && is_within(options.excluded, x, y);
            if excluded || !is_within(options.region, x, y) {
                continue;
            }
            let Some((m, [[uu, uv], [vu, vv]])) = measurement(field, site) else { continue };
            // Rounded, that of an edge may be none.
            if Matrix2::new(uu, 0.5 * (uv + vu), 0.5 * (uv + vu), vv).cholesky().is_none() {
                continue;
            }
            out.points.push([x as f64, y as f64]);
            out.flow.push([m[0], m[1]]);
            out.covariances.extend([uu, uv, vu, vv].map(|value| points_per_independent_sample * value));
        }
    }
    Ok(out)
}

/// Points on the area over which errors are one, at least 1; a list of points is taken to know what it does.
fn shared_by<T>(field: &FlowField<T>, step: usize) -> f64 {
    let SamplingGrid::Grid { stride, .. } = field.layout.sites else { return 1.0 };
    let (length, spacing) = (field.layout.correlation_length, (step * stride) as f64);
    if spacing >= INDEPENDENT * length {
        return 1.0;
    }
    (4.0 * std::f64::consts::PI * length * length / (spacing * spacing)).max(1.0)
}

/// Number of sites of a grid with that step inside the region.
fn count<T>(field: &FlowField<T>, step: usize, region: Option<Rect>) -> usize {
    let rows = |column: usize| {
        let inside = |row: &usize| {
            let (x, y) = field.layout.sites.pixel(column, *row);
            is_within(region, x, y)
        };
        (step / 2..field.height).step_by(step).filter(inside).count()
    };
    (step / 2..field.width).step_by(step).map(rows).sum()
}

/// The largest step of at most `step` that has points enough in the region, down to `finest`.
fn fine_enough<T>(field: &FlowField<T>, step: usize, finest: usize, region: Option<Rect>) -> usize {
    (finest..=step).rev().find(|&step| count(field, step, region) >= MIN_REGION_POINTS).unwrap_or(finest)
}

/// The least step of at least `step` that leaves no more than the most points wanted.
fn coarse_enough<T>(field: &FlowField<T>, step: usize, options: &FieldOptions) -> usize {
    let mut step = step.max(1);
    while options.most.is_some_and(|most| count(field, step, options.region) > most.max(1)) {
        step += 1;
    }
    step
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{FieldLayout, Status};

    fn field() -> FlowField<f32> {
        let layout = FieldLayout {
            frame_size: (60, 40),
            sites: SamplingGrid::default(),
            model: "affine".into(),
            parameters: crate::types::MOTION_NAMES.map(String::from).to_vec(),
            frame_period: None,
            pixel_pitch: (1.0, 1.0),
            frame_index: 0,
            correlation_length: 5.0,
        };
        let mut field = FlowField::empty(layout, true).unwrap();
        field.status.fill(Status::Ok);
        field.motion.fill(0.5);
        // Of u and v alone, which are independent.
        let (size, covariance) = (field.len(), field.covariance.as_mut().unwrap());
        covariance.fill(0.25);
        covariance[size..2 * size].fill(0.0);
        field
    }

    #[test]
    fn points_are_as_far_apart_as_errors_go_together() {
        let mut field = field();
        let points = field_points(&field, &FieldOptions::default()).unwrap();
        assert_eq!((points.spacing, points.points.len()), (10.0, 24));
        assert_eq!((points.points[0], points.points[1], points.flow[3]), ([5.0, 5.0], [15.0, 5.0], [0.5, 0.5]));
        let few = FieldOptions { most: Some(7), ..FieldOptions::default() };
        assert_eq!(field_points(&field, &few).unwrap().points.len(), 6);
        let dense = FieldOptions { spacing: Some(5.0), ..FieldOptions::default() };
        let covariance = field_points(&field, &dense).unwrap().covariances[0];
        assert!((covariance / 0.25 - 4.0 * std::f64::consts::PI).abs() < 1e-12, "{covariance}");
        assert!((points.covariances[0] / 0.25 - std::f64::consts::PI).abs() < 1e-12, "{}", points.covariances[0]);
        assert_eq!(field_points(&field, &dense).unwrap().points_per_independent_sample, covariance / 0.25);
        assert_eq!(
            (points.points_per_independent_sample, points.correlation_length),
            (points.covariances[0] / 0.25, 5.0)
        );
        let denser = FieldOptions { spacing: Some(1.0), ..FieldOptions::default() };
        assert_eq!(field_points(&field, &denser).unwrap().spacing, 5.0);
        let far = FieldOptions { spacing: Some(20.0), ..FieldOptions::default() };
        let far = field_points(&field, &far).unwrap();
        assert_eq!((far.points_per_independent_sample, &far.covariances[..4]), (1.0, &[0.25, 0.0, 0.0, 0.25][..]));
        field.status[5 * 60 + 5] = Status::Inconsistent;
        assert_eq!(field_points(&field, &FieldOptions::default()).unwrap().points[0], [15.0, 5.0]);
    }

    #[test]
    fn a_region_has_its_own_grid_and_its_own_most() {
        let field = field();
        let region = Some(Rect { x: 10, y: 5, width: 40, height: 30 });
        let inside = |options: FieldOptions| field_points(&field, &options).unwrap();
        let found = inside(FieldOptions { region, ..FieldOptions::default() });
        assert!(found.points.len() >= 30 && found.spacing < 10.0, "{} {}", found.points.len(), found.spacing);
        assert!(found.covariances[0] > 0.25);
        // As many as are wanted in the region, regardless of the rest of the field.
        let few = inside(FieldOptions { region, most: Some(12), ..FieldOptions::default() });
        assert!((9..=12).contains(&few.points.len()), "{}", few.points.len());
        let rest = inside(FieldOptions { excluded: region, ..FieldOptions::default() });
        assert_eq!((rest.points.len(), rest.flow.len(), rest.covariances.len()), (12, 12, 48));
        assert!(rest.points.iter().all(|&[x, y]| !is_within(region, x as usize, y as usize)));
        // A given spacing stays.
        let given = inside(FieldOptions { region, spacing: Some(10.0), ..FieldOptions::default() });
        assert_eq!((given.spacing, given.points.len()), (10.0, 12));
    }

    #[test]
    fn fields_without_a_covariance_are_refused() {
        let bare = FlowField { covariance: None, ..field() };
        assert!(field_points(&bare, &FieldOptions::default()).unwrap_err().to_string().starts_with("field: "));
        let wrong = FieldOptions { spacing: Some(0.0), ..FieldOptions::default() };
        assert!(field_points(&field(), &wrong).unwrap_err().to_string().starts_with("spacing: "));
    }
}
