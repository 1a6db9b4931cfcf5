//! Points of a flow field that may be taken for independent.

use crate::error::{Error, Result};
use crate::math::Real;
use crate::types::{FlowField, Rect, Sites, Status};

/// Errors at a distance of this many correlation lengths have a correlation of about `exp(-4)`: they may be taken for independent.
const INDEPENDENT: f64 = 4.0;

/// Least spacing, px, where the field does not know how far its errors go together.
const LEAST_SPACING: f64 = 8.0;

/// Which points of a field are taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FieldOptions {
    /// Distance of the points along rows and columns, px; default: 4 correlation lengths of the field, at least 8 px.
    pub spacing: Option<f64>,
    /// Only points in this rectangle of pixels.
    pub region: Option<Rect>,
    /// Most points; the grid is made coarser to keep to it. Default: no limit.
    pub most: Option<usize>,
}

/// Points with their flow and its covariance, as [`Flow::Plane`](super::Flow::Plane) and [`Noise::Covariances`](super::Noise::Covariances) take them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FieldPoints {
    /// Pixels.
    pub points: Vec<[f64; 2]>,
    /// Their flow, px/frame.
    pub flow: Vec<[f64; 2]>,
    /// Its covariances, 4 values a point, px^2; of points closer than independent ones times what they share, `4 pi l^2 / spacing^2`.
    pub covariances: Vec<f64>,
    /// The spacing that came out of the options, px.
    pub spacing: f64,
}

/// Takes every so manieth valid estimate of a field.
///
/// Windowed estimates share pixels, and their errors go together over the correlation length `l`, as `exp(-d^2 / (4 l^2))`: taken for independent, close points would make the motion's covariance too small. Closer than 4 `l` they
/// get their covariance times `4 pi l^2 / spacing^2`, the number of points on the area over which errors are one.
///
/// A list of points is taken whole.
///
/// # Errors
/// [`Error::Argument`] for a field without covariance or with a pixel pitch, and for a spacing that is not positive.
pub fn field_points<T: Real>(field: &FlowField<T>, options: &FieldOptions) -> Result<FieldPoints> {
    if field.covariance.is_none() {
        return Err(Error::argument("field", "one with a covariance", "one without"));
    }
    if field.layout.pixel_pitch != (1.0, 1.0) {
        let got = format!("the pixel pitch {:?}", field.layout.pixel_pitch);
        return Err(Error::argument("field", "flow in px", got));
    }
    let usual = LEAST_SPACING.max(INDEPENDENT * field.layout.correlation_length);
    let spacing = options.spacing.unwrap_or(usual);
    if !(spacing.is_finite() && spacing > 0.0) {
        return Err(Error::argument("spacing", "a positive number", spacing));
    }
    let step = match field.layout.sites {
        Sites::Grid { stride, .. } => coarse_enough(field, (spacing / stride as f64).ceil() as usize, options.most),
        Sites::Points(_) => 1,
    };
    let shared = shared_by(field, step);
    let mut out = FieldPoints { spacing, ..FieldPoints::default() };
    for row in (step / 2..field.height).step_by(step) {
        for column in (step / 2..field.width).step_by(step) {
            let site = row * field.width + column;
            if !field.status[site].is_valid() || field.status[site] == Status::Inconsistent {
                continue;
            }
            let Some(covariance) = field.covariance_at(site) else { continue };
            let m = field.affine(site).to_array().map(Real::to_f64);
            let (x, y) = field.layout.sites.pixel(column, row);
            if !options.region.is_none_or(|r| (r.x..r.x + r.width).contains(&x) && (r.y..r.y + r.height).contains(&y)) {
                continue;
            }
            out.points.push([x as f64, y as f64]);
            out.flow.push([m[0], m[1]]);
            let [[uu, uv, ..], [vu, vv, ..], ..] = covariance;
            out.covariances.extend([uu, uv, vu, vv].map(|value| shared * value));
        }
    }
    Ok(out)
}

/// Points on the area over which errors are one, at least 1; a list of points is taken to know what it does.
fn shared_by<T>(field: &FlowField<T>, step: usize) -> f64 {
    let Sites::Grid { stride, .. } = field.layout.sites else { return 1.0 };
    let (length, spacing) = (field.layout.correlation_length, (step * stride) as f64);
    if spacing >= INDEPENDENT * length {
        return 1.0;
    }
    (4.0 * std::f64::consts::PI * length * length / (spacing * spacing)).max(1.0)
}

/// The least step of at least `step` that leaves no more than `most` points.
fn coarse_enough<T>(field: &FlowField<T>, step: usize, most: Option<usize>) -> usize {
    let count = |step: usize| (field.width.div_ceil(step)) * (field.height.div_ceil(step));
    let mut step = step.max(1);
    while most.is_some_and(|most| count(step) > most.max(1)) {
        step += 1;
    }
    step
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::FieldLayout;

    fn field() -> FlowField<f32> {
        let layout = FieldLayout {
            frame_size: (60, 40),
            sites: Sites::default(),
            model: "affine".into(),
            parameters: crate::types::MOTION_NAMES.map(String::from).to_vec(),
            frame_period: None,
            pixel_pitch: (1.0, 1.0),
            frame_index: 0,
            correlation_length: 2.5,
        };
        let mut field = FlowField::empty(layout, true).unwrap();
        field.status.fill(Status::Ok);
        field.motion.fill(0.5);
        field.covariance.as_mut().unwrap().fill(0.25);
        field
    }

    #[test]
    fn points_are_as_far_apart_as_errors_go_together() {
        let mut field = field();
        let points = field_points(&field, &FieldOptions::default()).unwrap();
        assert_eq!((points.spacing, points.points.len()), (10.0, 24));
        assert_eq!((points.points[0], points.points[1]), ([5.0, 5.0], [15.0, 5.0]));
        assert_eq!((points.flow[3], &points.covariances[..4]), ([0.5, 0.5], &[0.25; 4][..]));
        let few = FieldOptions { most: Some(7), ..FieldOptions::default() };
        assert_eq!(field_points(&field, &few).unwrap().points.len(), 6);
        let dense = FieldOptions { spacing: Some(5.0), ..FieldOptions::default() };
        let covariance = field_points(&field, &dense).unwrap().covariances[0];
        assert!((covariance / 0.25 - std::f64::consts::PI).abs() < 1e-12, "{covariance}");
        field.status[5 * 60 + 5] = Status::Inconsistent;
        assert_eq!(field_points(&field, &FieldOptions::default()).unwrap().points[0], [15.0, 5.0]);
    }

    #[test]
    fn fields_without_a_covariance_are_refused() {
        let bare = FlowField { covariance: None, ..field() };
        assert!(field_points(&bare, &FieldOptions::default()).unwrap_err().to_string().starts_with("field: "));
        let wrong = FieldOptions { spacing: Some(0.0), ..FieldOptions::default() };
        assert!(field_points(&field(), &wrong).unwrap_err().to_string().starts_with("spacing: "));
    }
}
