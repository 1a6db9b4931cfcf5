//! Six numbers of displacements over a whole frame, with the rotation taken out of both views.

use super::system::{Patch, System};
use super::{AffinePatches, cheapest, least_squares};
use crate::motion3d::model::camera::affine_map;
use crate::motion3d::model::derotation::Derotation;
use crate::motion3d::model::input::Placement;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::options::MotionOptions;
use nalgebra::{Matrix2, Matrix6, Vector6};

/// Times that a rotation is taken out of displacements, and the change of it, rad, that is rounding.
const TURNS: usize = 6;
const ROUNDING: f64 = 1e-13;

/// The map from one view to the other is `I + M` to first order: with the slopes `D_1`, `D_2` of what turns
/// both views it is `D_2 (I + M) D_1^-1`.
pub(crate) fn turned_patch(given: &AffinePatches<'_>, k: usize, turn: &Derotation) -> Option<Patch> {
    let (mut m, at) = (Vector6::from(given.motion[k]), given.points[k]);
    let mut covariance = Matrix6::from_row_slice(&given.covariances[36 * k..36 * (k + 1)]);
    let mut ends = [at, [at[0] + m[0], at[1] + m[1]]];
    if let Some(camera) = given.camera {
        let map = camera.affine_scale();
        m = map * m;
        covariance = map * covariance * map.transpose();
        ends = ends.map(|at| camera.to_plane(at));
    }
    let turned = turn.out_of(ends[0], ends[1])?;
    let back = turned.first.try_inverse()?;
    let one = Matrix2::identity();
    let slopes = turned.spread * (one + Matrix2::new(m[2], m[4], m[3], m[5])) * back - one;
    let map = affine_map(&turned.spread, &turned.first);
    covariance = map * covariance * map.transpose();
    let slopes = slopes * (one + 0.5 * slopes).try_inverse()?;
    m.fixed_rows_mut::<2>(0).copy_from(&turned.left);
    m.fixed_rows_mut::<4>(2).copy_from_slice(slopes.as_slice());
    Patch::new(turned.middle, &m, &covariance, Some(turn))
}

/// Patches with a rotation taken out that explains most of their flow by itself.
pub(crate) fn beforehand(patches: &AffinePatches<'_>, options: &MotionOptions) -> System {
    let mut system = patches.system(options.placement, None);
    if options.placement == Placement::Midpoint {
        for _ in 0..TURNS {
            let Some(rotation) = least_squares(&system) else { break };
            system = patches.system(options.placement, Some(&Derotation::new(&rotation.rotation)));
        }
    }
    system
}

/// Takes the rotation of the likeliest minimum out of displacements, and refines all again, until it stays.
pub(crate) fn settle(
    patches: &AffinePatches<'_>,
    options: &MotionOptions,
    system: &mut System,
    minima: &mut Vec<Motion>,
) {
    if options.placement != Placement::Midpoint {
        return;
    }
    for _ in 0..TURNS {
        let Some(w) = minima.first().map(Motion::w) else { break };
        *system = patches.system(options.placement, Some(&Derotation::new(&w)));
        *minima = cheapest(system, minima.iter().map(|motion| system.refine(motion)));
        if minima.first().is_some_and(|motion| (motion.w() - w).norm() < ROUNDING) {
            break;
        }
    }
}
