//! Assembles the result for patches, and finds what else could be true.

use super::FEW;
use super::system::System;
use crate::motion3d::diagnostics::contact::Rates;
use crate::motion3d::diagnostics::report::{report_rotation, set_motion};
use crate::motion3d::diagnostics::rotation::RotationOnly;
use crate::motion3d::diagnostics::status::{SURE, WIDE};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::options::CommonErrors;
use crate::motion3d::model::result::{Alternative, MotionEstimate, Status};
use crate::motion3d::model::rows::{Matrix5, tangents};
use crate::motion3d::solver::likelihood::DISTINCT;
use nalgebra::{Matrix2, Vector3};

/// Motions nearer than so many degrees are one.
const APART: f64 = 3.0;

/// Fills in the result of a motion.
pub(crate) fn report_motion(
    out: &mut MotionEstimate,
    system: &System,
    motion: &Motion,
    covariance: Option<Matrix5>,
    surfaces: Option<&[Vector3<f64>]>,
) {
    let tangent = tangents(&motion.u());
    set_motion(out, motion, &tangent, covariance.as_ref(), &system.equations(motion, &tangent, None));
    let rates = Rates::new(&out.uncertain());
    out.surfaces = vec![[f64::NAN; 3]; out.inliers.len()];
    for (k, (patch, &source)) in system.patches.iter().zip(&system.source).enumerate() {
        let (source, seen) = (source as usize, patch.seen(motion));
        let surface = surfaces.map_or(seen.surface, |surfaces| surfaces[k]);
        out.inverse_depth[source] = seen.surface[0];
        out.inverse_depth_std[source] = seen.covariance[(0, 0)].sqrt();
        out.inverse_depth_smooth[source] = surface[0];
        out.surfaces[source] = surface.into();
        out.residuals[source] = seen.cost.sqrt();
        out.inliers[source] = true;
        let slopes = rates.slopes_of(surface[0], patch.depth_slopes(&tangent, motion, &seen));
        (out.time_to_contact[source], out.time_to_contact_std[source]) =
            rates.contact(surface[0], seen.covariance[(0, 0)], &slopes);
    }
}

/// The result of a camera that only rotates, or stands still.
///
/// `to_plane` maps flow to the plane at distance 1.
pub(crate) fn turning_report(
    system: &System,
    n: usize,
    rotation: &RotationOnly,
    common: &CommonErrors,
    to_plane: &Matrix2<f64>,
) -> MotionEstimate {
    let mut out = MotionEstimate::nothing(n, Status::RotationOnly, 1.0);
    let moved = rotation.covariance * system.translation_to_rotation() * to_plane;
    let covariance = rotation.covariance + common.added_to_rotation(&rotation.rotation, &moved);
    report_rotation(&mut out, &rotation.rotation, &covariance, rotation.chi2, &system.source);
    out.surfaces = vec![[f64::NAN; 3]; n];
    for (patch, &source) in system.patches.iter().zip(&system.source) {
        let source = source as usize;
        out.surfaces[source] = [0.0; 3];
        out.residuals[source] = (patch.f - patch.r * rotation.rotation).norm();
        out.inliers[source] = true;
    }
    out
}

/// Finds what else could be true: the status, and the other motions among the alternatives.
///
/// `minima`: all that were found, maximum likelihood's first; `places`: where patches lie; `low`: whether
/// their surfaces are mostly noise.
pub(crate) fn judge(out: &mut MotionEstimate, system: &System, minima: &[Motion], places: usize, low: bool) {
    let own = out.direction_std;
    out.alternatives = others(system, &out.motion, minima, if own.is_finite() { own } else { 0.0 });
    out.status = if places < FEW {
        Status::FewPoints
    } else if own.is_nan() || own > WIDE {
        Status::IllConditioned
    } else if !out.alternatives.is_empty() {
        Status::Ambiguous
    } else if low {
        Status::LowSnr
    } else {
        Status::Ok
    };
}

/// Other minima, and the opposites of all, that are about as likely with no patch behind the camera: each
/// with the direction and the rotation that suit it best; the likeliest first.
fn others(system: &System, motion: &Motion, minima: &[Motion], deviation: f64) -> Vec<Alternative> {
    let least = system.refine_in_front(motion).equations.cost;
    let distinct = (DISTINCT * deviation).max(APART).to_radians();
    // Residuals of other minima are other components of the noise.
    let limit = SURE + (3.0 * system.patches.len() as f64).sqrt();
    let starts = minima.iter().flat_map(|minimum| [*minimum, minimum.reversed()]);
    let mut found: Vec<Alternative> = Vec::new();
    for other in starts.map(|start| system.refine_in_front(&start)) {
        let other = Alternative { motion: other.motion, excess: other.equations.cost - least };
        let same = |known: &Alternative| known.motion.angle_to(&other.motion).to_degrees() < APART;
        if other.excess < limit && other.motion.angle_to(motion) > distinct && !found.iter().any(same) {
            found.push(other);
        }
    }
    found.sort_by(|a, b| a.excess.total_cmp(&b.excess));
    found
}
