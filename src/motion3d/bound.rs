//! Experiment design: what a layout of points, a field of view and a noise allow.

use super::kernels::{equations, information, slopes};
use super::model::input::{Flow, Noise, Placement};
use super::model::motion::Motion;
use super::model::observations::{Observations, UNKNOWNS};
use super::model::rows::{Matrix5, nested, tangents};
use super::model::whitening::Whitening;
use super::solver::covariance::{determined, direction_deviation};
use crate::error::{Error, Result, numbers};
use crate::parallel::Threads;
use nalgebra::Matrix2x3;

/// Covariances of `(psi, w)` that theory predicts, rad and rad/frame, in the axes `tangent`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionBound {
    /// The Cramér-Rao bound `sigma^2 M^-1` (8), (9).
    pub bound: [[f64; 5]; 5],
    /// Maximum likelihood `sigma^2 M^-1 + sigma^4 M^-1 P M^-1` (17), (24).
    pub likelihood: [[f64; 5]; 5],
    /// Ideal weights `sigma^2 M^-1 + sigma^4 M^-1 {sum c_kk P_k} M^-1` (25).
    pub ideal: [[f64; 5]; 5],
    /// Standard deviations of the direction, `sqrt(tr psi)`, degrees: of the bound, of maximum likelihood, of
    /// ideal weights.
    pub direction_std: [f64; 3],
    /// Axes of `psi`: two unit vectors perpendicular to `u`.
    pub tangent: [[f64; 3]; 2],
}

impl MotionBound {
    /// From the information `M`, the noise `P` of the depths in it and `sum c_kk P_k` for a bound.
    pub(crate) fn of(
        tangent: &Matrix2x3<f64>,
        information: &Matrix5,
        noise: &Matrix5,
        weighted: impl Fn(&Matrix5) -> Matrix5,
    ) -> Result<Self> {
        let bound = determined(information).ok_or_else(|| {
            Error::NotObservable("these points do not determine the motion; more of them, or others, would".into())
        })?;
        let (likelihood, ideal) = (bound + bound * noise * bound, bound + bound * weighted(&bound) * bound);
        Ok(Self {
            bound: nested(&bound),
            likelihood: nested(&likelihood),
            ideal: nested(&ideal),
            direction_std: [bound, likelihood, ideal].map(|covariance| direction_deviation(&covariance)),
            tangent: nested(tangent),
        })
    }
}

/// The covariances that maximum likelihood and ideal weights have, and the bound, for points whose true
/// inverse depths are given.
///
/// `points`: the places where flow is measured (their flow is not looked at); `inverse_depth`: `nu` (N) in
/// units of `|u|`. Points that are not finite are left out. (17) holds while it predicts less than about 5
/// degrees and the epipole is outside the points.
///
/// # Errors
/// [`Error::Argument`] for lengths that differ, fewer than 5 finite points, covariances or depths, noise that
/// is not given, a direction of length 0; [`Error::NotObservable`] when the points do not determine the
/// motion.
pub fn motion_bound(
    points: &Flow<'_>,
    noise: &Noise<'_>,
    motion: &Motion,
    inverse_depth: &[f64],
) -> Result<MotionBound> {
    Threads::default().install(|| of_known_depths(points, noise, motion, inverse_depth))
}

fn of_known_depths(
    points: &Flow<'_>,
    noise: &Noise<'_>,
    motion: &Motion,
    inverse_depth: &[f64],
) -> Result<MotionBound> {
    points.check(noise)?;
    if matches!(noise, Noise::Unknown) {
        return Err(Error::argument("noise_std", "the noise of the flow, as noise_std or cov", "none"));
    }
    check_motion(&motion.translation, &motion.rotation)?;
    let observations = Whitening::new(points, noise, Placement::Start).whitened();
    let places: Vec<[f64; 3]> = (0..points.len()).map(|k| points.place(k).into()).collect();
    let known = with_known_depth(&observations.source, (&places, inverse_depth), |nu| nu.is_finite(), UNKNOWNS)?;
    let observations = observations.subset(&known);
    let mut nu: Vec<f64> = observations.source.iter().map(|&k| inverse_depth[k as usize]).collect();
    nu.resize(observations.stride, 0.0);
    let tangent = tangents(&motion.u());
    let m = information(&observations, motion, &tangent, &nu, 0.0);
    let noise = equations(&observations, motion, &tangent, None).p;
    MotionBound::of(&tangent, &m, &noise, |bound| weighted_noise(&observations, motion, &tangent, &nu, bound))
}

/// Which of the usable points, from `source` among all `places`, have a known depth: at least `least`.
pub(crate) fn with_known_depth<const N: usize, D>(
    source: &[u32],
    (places, depths): (&[[f64; N]], &[D]),
    is_known: impl Fn(&D) -> bool,
    least: usize,
) -> Result<Vec<u32>> {
    if depths.len() != places.len() {
        let expected = format!("{} values, one for each point", places.len());
        return Err(Error::argument("inv_depth", expected, depths.len()));
    }
    if source.len() < least {
        let finite = places.iter().filter(|at| at.iter().all(|value| value.is_finite())).count();
        // The others lack a finite covariance.
        return Err(if finite < least {
            Error::argument("points", format!("at least {least} points that are finite"), finite)
        } else {
            Error::argument("cov", format!("finite covariances of at least {least} points"), "fewer")
        });
    }
    let known: Vec<u32> =
        (0..source.len() as u32).filter(|&k| is_known(&depths[source[k as usize] as usize])).collect();
    if known.len() < least {
        return Err(Error::argument("inv_depth", format!("finite values of at least {least} points"), known.len()));
    }
    Ok(known)
}

/// Whether a motion is finite and has a direction.
pub(crate) fn check_motion(translation: &[f64; 3], rotation: &[f64; 3]) -> Result<()> {
    let finite = |values: &[f64; 3]| values.iter().all(|value| value.is_finite());
    if !finite(translation) || *translation == [0.0; 3] {
        return Err(Error::argument("translation", "a finite vector with a direction", numbers(translation)));
    }
    if !finite(rotation) {
        return Err(Error::argument("rotation", "a finite vector", numbers(rotation)));
    }
    Ok(())
}

/// `sum c_kk P_k` with `c_kk = D_k M^-1 D_k^t`.
fn weighted_noise(
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    nu: &[f64],
    bound: &Matrix5,
) -> Matrix5 {
    let mut sum = Matrix5::zeros();
    for k in 0..observations.n {
        let [d, far] = [nu[k], 1.0].map(|nu| slopes(observations, motion, tangent, nu, k));
        let along = far.fixed_rows::<2>(0);
        let s2 = (observations.row(k).g * motion.u()).norm_squared().max(observations.floor);
        let mut block = sum.fixed_view_mut::<2, 2>(0, 0);
        block += along * along.transpose() * (d.dot(&(bound * d)) / s2);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::lateral_bound;

    /// The direction lies in the image plane once the other unknowns are taken out.
    #[test]
    fn the_closed_forms_of_one_unknown_are_the_general_ones() {
        let depths: Vec<f64> = (0..101).map(|k| 0.5 + f64::from(k) / 100.0).collect();
        let bound = lateral_bound(&depths, 0.3).unwrap();
        let at = vec![[0.0; 2]; 101];
        let flow = Flow::Plane { points: &at, flow: &at, camera: None };
        let observations = Whitening::new(&flow, &Noise::StandardDeviation(0.3), Placement::Start).whitened();
        let motion = Motion::new([1.0, 0.0, 0.0], [0.0; 3]);
        let tangent = tangents(&motion.u());
        let mut nu = depths.clone();
        nu.resize(observations.stride, 0.0);
        let m = information(&observations, &motion, &tangent, &nu, 0.0);
        let p = equations(&observations, &motion, &tangent, None).p;
        // The axis that lies in the plane is y; the other is z, along which nothing is seen at the centre.
        let axis = usize::from(tangent[(1, 1)].abs() > 0.5);
        let (m, p) = (m[(axis, axis)], p[(axis, axis)]);
        assert!((1.0 / m - bound.bound).abs() < 1e-12, "{m}");
        assert!((1.0 / m + p / (m * m) - bound.likelihood).abs() < 1e-12, "{m} {p}");
    }
}
