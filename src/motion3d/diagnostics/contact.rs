//! Time to contact: how fast points come nearer, with what is known of that.

use crate::error::Result;
use crate::math::Real;
use crate::motion3d::model::input::{Placement, check_field, measurement};
use crate::motion3d::model::measurement::Measurement;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Row;
use crate::motion3d::model::result::{SystematicEffect, UncertainMotion};
use crate::motion3d::model::rows::{Matrix5, MidpointDepth};
use crate::motion3d::model::whitening::plane_row;
use crate::parallel::{self, Threads};
use crate::types::{FlowField, Intrinsics};
use nalgebra::{Matrix2x3, SVector, Vector1};

/// Sites of one task.
const SITES_PER_TASK: usize = 256;

/// Rates of approach `nu u_z` under a motion.
pub(crate) struct Rates {
    motion: Motion,
    tangent: Matrix2x3<f64>,
    /// Without what errors add that all flow has in common, where that is known.
    covariance: Matrix5,
    systematic_errors: SystematicEffect,
}

/// Slopes of a rate along the axes of `u` and along `w` (5), and by the point's own flow on the plane at
/// distance 1 (2).
pub(crate) type Slopes = SVector<f64, 7>;

impl Rates {
    /// Without a covariance, standard deviations are NaN.
    pub fn new(of: &UncertainMotion) -> Self {
        let covariance = Matrix5::from_fn(|i, j| of.covariance[i][j]) - of.systematic_errors.added();
        let tangent = Matrix2x3::from_fn(|i, j| of.tangent[i][j]);
        Self { motion: of.motion, tangent, covariance, systematic_errors: of.systematic_errors }
    }

    /// Slopes of `nu u_z` with this surface; of the flow alone at the epipole, where a depth is its
    /// neighbours'.
    pub fn slopes<const N: usize, const L: usize>(&self, of: &Measurement<N, L>, surface: &SVector<f64, L>) -> Slopes {
        let u = self.motion.u();
        let (mut motion, flow) = of.depth_slopes(&self.tangent, &self.motion, surface);
        motion *= u.z;
        motion[0] += surface[0] * self.tangent[(0, 2)];
        motion[1] += surface[0] * self.tangent[(1, 2)];
        let [along, across] = (flow * u.z).into();
        motion.push(along).push(across)
    }

    /// What the motion's covariance makes of slopes, and what errors do that all flow has in common: a factor
    /// is one of the rate, a displacement moves the motion and each point's depth together.
    pub fn variance(&self, rate: f64, slopes: &Slopes) -> f64 {
        let (motion, flow) = (slopes.fixed_rows::<5>(0).into_owned(), slopes.fixed_rows::<2>(5).transpose());
        motion.dot(&(self.covariance * motion)) + self.systematic_errors.variance(rate, &motion, &flow)
    }

    /// `-1 / (nu u_z)` and its standard deviation, frames, by first order from the variance of `nu` and from
    /// the motion's covariance; infinite where nothing comes nearer.
    pub fn contact(&self, nu: f64, variance: f64, slopes: &Slopes) -> (f64, f64) {
        let u_z = self.motion.u().z;
        let rate = nu * u_z;
        if rate == 0.0 {
            return (f64::INFINITY, f64::INFINITY);
        }
        let variance = u_z * u_z * variance + self.variance(rate, slopes);
        (-1.0 / rate, variance.sqrt() / (rate * rate))
    }

    /// The same from a point's own flow, and its residual across the epipolar line in units of noise.
    fn own(&self, row: &Row, half_way: MidpointDepth) -> [f64; 3] {
        let (t, d) = (row.g * self.motion.u(), row.f - row.r * self.motion.w());
        let s2 = t.norm_squared();
        let nu = t.dot(&d) / s2;
        let depth = half_way.depth(nu);
        let slopes = self.slopes(&row.measurement(), &Vector1::new(depth));
        let (contact, deviation) = self.contact(depth, half_way.slope(nu).powi(2) / s2, &slopes);
        [contact, deviation, (t.y * d.x - t.x * d.y) / s2.sqrt()]
    }
}

/// Times to contact of all sites of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactMap {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `-1 / (nu u_z)`, frames, row by row: positive where a point comes nearer, infinite where none
    /// does, NaN where the field is not valid.
    pub contact: Vec<f64>,
    /// Their standard deviations, frames, by first order from those of the site's own flow and of the motion.
    pub deviation: Vec<f64>,
    /// Residuals across the epipolar lines in units of noise: far from 0 on what moves by itself, whose time
    /// to contact is not that of the scene.
    pub residual: Vec<f64>,
}

/// The time to contact of the point at each site of a field, if it has the motion; counted from half way
/// between the frames with [`Placement::Midpoint`].
///
/// Where the motion has no translation all times are infinite.
///
/// # Errors
/// [`Error::Argument`](crate::Error::Argument) for a field without covariance.
pub fn contact_map<T: Real>(
    field: &FlowField<T>,
    camera: &Intrinsics,
    known: &UncertainMotion,
    placement: Placement,
) -> Result<ContactMap> {
    check_field(field)?;
    let field = &*field.in_pixels_and_frames();
    let (rates, motion) = (Rates::new(known), &known.motion);
    let turning = motion.translation[0].is_nan() && motion.rotation[0].is_finite();
    let turn = (placement == Placement::Midpoint).then(|| motion.derotation());
    let half_way = turn.filter(|_| !turning).map_or_else(MidpointDepth::default, |turn| turn.half_way(&motion.u()));
    let at = |site: usize| -> [f64; 3] {
        let row = measurement(field, site).and_then(|(flow, covariance)| {
            let (x, y) = field.layout.sites.pixel(site % field.width, site / field.width);
            let way = (Placement::Start, turn.as_ref());
            plane_row([x as f64, y as f64], flow.into(), &covariance, Some(camera), way)
        });
        let Some((row, _)) = row else { return [f64::NAN; 3] };
        if turning {
            return [f64::INFINITY, f64::INFINITY, (row.f - row.r * motion.w()).norm()];
        }
        rates.own(&row, half_way)
    };
    let sites = field.width * field.height;
    let values = Threads::default().install(|| parallel::map_range(sites, SITES_PER_TASK, at));
    let plane = |k: usize| values.iter().map(|value| value[k]).collect();
    Ok(ContactMap {
        width: field.width,
        height: field.height,
        contact: plane(0),
        deviation: plane(1),
        residual: plane(2),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::model::rows::Vector5;
    use crate::motion3d::tests::scenes::Scene;

    /// The slopes of the rate are those of the depth that a point's own flow has.
    #[test]
    fn slopes_are_those_of_the_rate() {
        let scene = Scene::oblique(20, 0.1, 5);
        let observations = scene.observations();
        let tangent = crate::math::tangents(&scene.motion.u());
        let known = UncertainMotion {
            motion: scene.motion,
            tangent: crate::motion3d::model::rows::nested(&tangent),
            covariance: [[f64::NAN; 5]; 5],
            systematic_errors: SystematicEffect::default(),
        };
        let rates = Rates::new(&known);
        let row = observations.row(3);
        let rate = |step: &Vector5| {
            let motion = scene.motion.stepped(&tangent, step);
            let t = row.g * motion.u();
            t.dot(&(row.f - row.r * motion.w())) / t.norm_squared() * motion.u().z
        };
        let t = row.g * scene.motion.u();
        let nu = t.dot(&(row.f - row.r * scene.motion.w())) / t.norm_squared();
        let slopes = rates.slopes(&row.measurement(), &Vector1::new(nu)).fixed_rows::<5>(0).into_owned();
        // Along the epipolar line alone: the part across moves the depth in second order only at the truth.
        for axis in 2..5 {
            let mut step = Vector5::zeros();
            step[axis] = 1e-6;
            let numeric = (rate(&step) - rate(&-step)) / 2e-6;
            assert!((numeric - slopes[axis]).abs() < 1e-5 * slopes.norm(), "{axis}: {numeric} {}", slopes[axis]);
        }
    }
}
