//! Assembles the result for patches.

use super::system::System;
use crate::motion3d::diagnostics::contact::Rates;
use crate::motion3d::diagnostics::report::report_rotation;
use crate::motion3d::diagnostics::rotation_only::RotationOnly;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::options::CommonErrors;
use crate::motion3d::model::result::{Alternative, MotionEstimate, Status, axes, nested};
use crate::motion3d::model::rows::{Matrix5, tangents};
use crate::motion3d::solver::covariance::{direction_deviation, plugged};
use nalgebra::{Matrix2, Vector3};

/// Fills in the result of a motion; returns whether the patches are one plane that has another motion too.
pub(crate) fn report_motion(
    out: &mut MotionEstimate,
    system: &System,
    motion: &Motion,
    covariance: Option<Matrix5>,
    surfaces: Option<&[Vector3<f64>]>,
) -> bool {
    let tangent = tangents(&motion.u());
    out.motion = *motion;
    out.tangent = axes(&tangent);
    if let Some(covariance) = covariance {
        out.covariance = nested(&covariance);
        out.direction_std = direction_deviation(&covariance);
        out.rotation_std = std::array::from_fn(|i| covariance[(2 + i, 2 + i)].sqrt());
    }
    let here = system.equations(motion, &tangent, None);
    if let Some(plugged) = plugged(&here.h, &here.p) {
        out.bound = nested(&plugged.bound);
    }
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
    let distinct = (3.0 * out.direction_std).to_radians().max(1e-6);
    match system.planar_twin(motion) {
        Some(twin) if twin.angle_to(motion).min(twin.reversed().angle_to(motion)) > distinct => {
            out.alternatives.push(Alternative { motion: twin, excess: 0.0 });
            true
        }
        _ => false,
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
