//! Points of a flow field that share no window.

use super::model::options::CommonErrors;
use crate::error::{Error, Result};
use crate::math::Real;
use crate::math::{median, quantile};
use crate::types::{FlowField, Rect, SamplingGrid, Status};
use nalgebra::{Matrix2, Vector2};

/// Errors at a distance of this many correlation lengths share no window. On a recorded drive a fifth of
/// them goes together still (`benchmarks/tables/motion3d_drive.py`), which the motion's covariance sums
/// (`together`): a residual alone may be judged as if it did not.
const INDEPENDENT: f64 = 4.0;

/// Default spacing in correlation lengths. Farther apart, fewer points determine the motion less well, and
/// show outliers less well; closer ones add little.
const SPACED: f64 = 2.0;

/// Least spacing, px, where the field does not know how far its errors go together.
const MIN_SPACING: f64 = 8.0;

/// Points closer than this many correlation lengths share so much of their errors that neither chance nor
/// outliers can be judged with them as if they did not, and they would add little.
const FINEST: f64 = 1.0;

/// Points of a region below which the default grid is made finer.
const WANTED: usize = 30;

/// Which points of a field are taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FieldOptions {
    /// Distance of the points along rows and columns, px, not below the correlation length of the field;
    /// default: 2 correlation lengths, at least 8 px, and less where a region would have fewer than 30
    /// points.
    pub spacing: Option<f64>,
    /// Only points in this rectangle of pixels.
    pub region: Option<Rect>,
    /// Most points, of the region if there is one; the grid is made coarser to keep to it. Default: no limit.
    pub most: Option<usize>,
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

impl FieldPoints {
    /// The points outside of a rectangle of pixels.
    #[must_use]
    pub fn outside(&self, region: Rect) -> Self {
        let mut out = Self {
            spacing: self.spacing,
            points_per_independent_sample: self.points_per_independent_sample,
            correlation_length: self.correlation_length,
            common: self.common,
            ..Self::default()
        };
        for (k, &[x, y]) in self.points.iter().enumerate() {
            if !within(Some(region), x as usize, y as usize) {
                out.points.push([x, y]);
                out.flow.push(self.flow[k]);
                out.covariances.extend_from_slice(&self.covariances[4 * k..4 * (k + 1)]);
            }
        }
        out
    }
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
    measured(field)?;
    let usual = MIN_SPACING.max(SPACED * field.layout.correlation_length);
    let spacing = options.spacing.unwrap_or(usual);
    if !(spacing.is_finite() && spacing > 0.0) {
        return Err(Error::argument("spacing", "a positive number", spacing));
    }
    let step = match field.layout.sites {
        SamplingGrid::Grid { stride, .. } => {
            let steps = |px: f64| ((px / stride as f64).ceil() as usize).max(1);
            let finest = steps(FINEST * field.layout.correlation_length);
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
    let common = of_field(field);
    let mut out =
        FieldPoints { points_per_independent_sample, correlation_length, common, spacing, ..FieldPoints::default() };
    for row in (step / 2..field.height).step_by(step) {
        for column in (step / 2..field.width).step_by(step) {
            let site = row * field.width + column;
            if !field.status[site].is_valid() || field.status[site] == Status::Inconsistent {
                continue;
            }
            let Some(covariance) = field.covariance_at(site) else { continue };
            let m = field.affine(site).to_array().map(Real::to_f64);
            let (x, y) = field.layout.sites.pixel(column, row);
            if !within(options.region, x, y) {
                continue;
            }
            let [[uu, uv, ..], [vu, vv, ..], ..] = covariance;
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

/// Whether a field says in px, and how surely, what moves.
pub(crate) fn measured<T>(field: &FlowField<T>) -> Result<()> {
    if field.covariance.is_none() {
        return Err(Error::argument("field", "one with a covariance", "one without"));
    }
    if field.layout.pixel_pitch != (1.0, 1.0) {
        let got = format!("the pixel pitch {:?}", field.layout.pixel_pitch);
        return Err(Error::argument("field", "flow in px", got));
    }
    Ok(())
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

/// Whether a pixel lies in the region, which is everything where there is none.
pub(crate) fn within(region: Option<Rect>, x: usize, y: usize) -> bool {
    region.is_none_or(|r| (r.x..r.x + r.width).contains(&x) && (r.y..r.y + r.height).contains(&y))
}

/// SamplingGrid of a grid with that step inside the region.
fn count<T>(field: &FlowField<T>, step: usize, region: Option<Rect>) -> usize {
    let rows = |column: usize| {
        let inside = |row: &usize| {
            let (x, y) = field.layout.sites.pixel(column, *row);
            within(region, x, y)
        };
        (step / 2..field.height).step_by(step).filter(inside).count()
    };
    (step / 2..field.width).step_by(step).map(rows).sum()
}

/// The largest step of at most `step` that has points enough in the region, down to `finest`.
fn fine_enough<T>(field: &FlowField<T>, step: usize, finest: usize, region: Option<Rect>) -> usize {
    (finest..=step).rev().find(|&step| count(field, step, region) >= WANTED).unwrap_or(finest)
}

/// The least step of at least `step` that leaves no more than the most points wanted.
fn coarse_enough<T>(field: &FlowField<T>, step: usize, options: &FieldOptions) -> usize {
    let mut step = step.max(1);
    while options.most.is_some_and(|most| count(field, step, options.region) > most.max(1)) {
        step += 1;
    }
    step
}

/// The displacement's deviation in those of a point: in rendered rooms, by both methods with a field of
/// windows, in much noise and in little, means of errors over a picture are 0.2 to 0.4 of it
/// (`benchmarks/tables/motion3d_fields.py --only errors`).
const SHARE: f64 = 0.4;

/// The share of the points that determine the scale error: others have large covariances for lack of
/// texture.
const BEST: f64 = 0.25;

/// About so many sites of a field are used.
const FIELD_SITES: f64 = 4000.0;

/// Estimated from covariances. The factor: by the whole error of the points that determine it
/// best. Of each point, its flow and the covariance of that.
fn common_errors(points: impl Iterator<Item = (Vector2<f64>, Matrix2<f64>)>) -> CommonErrors {
    let (mut squares, mut variances) = (Vec::new(), Vec::new());
    for (flow, covariance) in points {
        let square = covariance.cholesky().map(|factor| flow.dot(&factor.solve(&flow)));
        if let Some(square) = square.filter(|square| square.is_finite()) {
            squares.push(square);
            variances.push(0.5 * covariance.trace());
        }
    }
    let square = quantile(&mut squares, 1.0 - BEST).unwrap_or(0.0);
    // An error has two components. Flow that may be twice as long or none has no scale.
    let scale = if square > 0.0 { (2.0 / square).sqrt().min(1.0) } else { 1.0 };
    CommonErrors { scale, offset: SHARE * median(&mut variances).unwrap_or(0.0).sqrt() }
}

/// Those of a whole field: an object that moves little in the picture does not
/// determine the scale error of flow.
pub(crate) fn of_field<T: Real>(field: &FlowField<T>) -> CommonErrors {
    let step = ((field.len() as f64 / FIELD_SITES).sqrt() as usize).max(1);
    let sites = (0..field.height)
        .step_by(step)
        .flat_map(|row| (0..field.width).step_by(step).map(move |column| row * field.width + column));
    let measurement = |site: usize| {
        let valid = field.status[site].is_valid() && field.status[site] != Status::Inconsistent;
        let covariance = field.covariance_at(site).filter(|_| valid)?;
        let [u, v, ..] = field.affine(site).to_array().map(Real::to_f64);
        Some((Vector2::new(u, v), Matrix2::from_fn(|i, j| covariance[i][j])))
    };
    common_errors(sites.filter_map(measurement))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::FieldLayout;

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
        let rest = inside(FieldOptions::default()).outside(Rect { x: 10, y: 5, width: 40, height: 30 });
        assert_eq!((rest.points.len(), rest.flow.len(), rest.covariances.len()), (12, 12, 48));
        assert!(rest.points.iter().all(|&[x, y]| !within(region, x as usize, y as usize)));
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

    #[test]
    fn both_are_estimated_from_points() {
        let point = |length: f64| (Vector2::new(length, 0.0), Matrix2::identity() * 0.04);
        let common = common_errors([1.0, 4.0, 9.0].into_iter().map(point));
        // A flow of 45 deviations, and one point's of 0.2.
        assert!((common.scale - (2.0f64 / 2025.0).sqrt()).abs() < 1e-12, "{common:?}");
        assert!((common.offset - SHARE * 0.2).abs() < 1e-12, "{common:?}");
        assert_eq!(common_errors(std::iter::empty()).scale, 1.0);
    }
}
