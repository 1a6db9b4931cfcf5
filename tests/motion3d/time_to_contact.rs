//! Times to contact of fields and points whose depths are known.

use super::motion3d::{Intrinsics, SystematicEffect, UncertainMotion, contact_map};
use super::scenes::{Scene, smooth};
use super::{Motion, MotionOptions, Noise, Placement, empty_field, estimate_motion};
use jacoflow::types::{FlowField, Status};

/// The same depth everywhere, seen by a camera of 100 px, with standard deviations of 0.05 px.
fn wall(motion: &Motion, nu: f64, camera: &Intrinsics) -> FlowField<f64> {
    let mut field = empty_field::<f64>((64, 48), 1, 2.0);
    field.covariance.as_mut().unwrap().fill(0.0);
    let n = field.width * field.height;
    for site in 0..n {
        let at = [(site % field.width) as f64, (site / field.width) as f64];
        let [u, v] = motion.picture_flow(at, nu, Some(camera));
        (field.motion[site], field.motion[n + site]) = (u, v);
        let covariance = field.covariance.as_mut().unwrap();
        // Planes 0 and 6 are the variances of u and v.
        (covariance[site], covariance[6 * n + site]) = (0.0025, 0.0025);
    }
    field
}

const TANGENT: [[f64; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn a_wall_is_reached_everywhere_at_once() {
    let camera = Intrinsics::pinhole((100.0, 100.0), (32.0, 24.0)).unwrap();
    let motion = Motion::new([0.0, 0.0, -1.0], [0.001, -0.002, 0.003]);
    let mut field = wall(&motion, 0.02, &camera);
    field.status[5] = Status::Inconsistent;
    // An object with another motion.
    field.motion[100] += 5.0;
    let mut covariance = [[0.0; 5]; 5];
    let map = |motion: Motion, covariance: [[f64; 5]; 5]| {
        let known =
            UncertainMotion { motion, tangent: TANGENT, covariance, systematic_errors: SystematicEffect::default() };
        contact_map(&field, &camera, &known, Placement::Start).unwrap()
    };
    let exact = map(motion, covariance);
    assert_eq!((exact.width, exact.height, exact.contact.len()), (64, 48, 64 * 48));
    assert!(exact.contact[5].is_nan() && exact.residual[100].abs() > 3.0);
    let corner = 0;
    assert!((exact.contact[corner] - 50.0).abs() < 1e-6 && exact.residual[corner].abs() < 1e-9);
    // nu = 1/50 with the standard deviation 0.0005 / s at s = 0.4.
    assert!((exact.deviation[corner] - 50.0 * 50.0 * 5e-4 / 0.4).abs() < 1e-3, "{}", exact.deviation[corner]);
    covariance[3][3] = 1e-6;
    let unsure = map(motion, covariance);
    assert!(unsure.deviation[corner] > 1.1 * exact.deviation[corner]);
    let still = Motion { translation: [f64::NAN; 3], ..motion };
    let never = map(still, covariance);
    assert!(never.contact[corner].is_infinite() && never.contact[5].is_nan());
}

/// Where depths are smoothed their standard deviations are smaller than those of single points, and hold.
#[test]
fn deviations_are_those_of_the_smoothed_depths() {
    let motion = Motion::new([0.35, 0.25, 1.0], [0.02, -0.03, 0.01]);
    let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
    let (mut held, mut all, mut narrower) = (0, 0, 0);
    for seed in 0..20 {
        let scene = Scene::new(motion, 500, 0.6, 0.05, seed, |x, y, _| smooth(x, y));
        let found = estimate_motion(&scene.flow(), &Noise::StandardDeviation(0.05), &options).unwrap();
        for k in 0..500 {
            // Rates are normal where times are not.
            let (contact, deviation) = (found.time_to_contact[k], found.time_to_contact_std[k]);
            let (rate, spread) = (-1.0 / contact, deviation / (contact * contact));
            held += u32::from((rate - scene.inverse_depth[k] * motion.translation[2]).abs() < 1.96 * spread);
            narrower += u32::from(spread < 0.7 * found.inverse_depth_std[k] * motion.translation[2].abs());
            all += 1;
        }
    }
    let share = f64::from(held) / f64::from(all);
    assert!((0.88..0.99).contains(&share) && 2 * narrower > all, "{share} {narrower} of {all}");
}
