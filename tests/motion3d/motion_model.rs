//! Flow, displacement and matrices of a known motion.

use super::{Motion, oblique};
use nalgebra::{Matrix3, Vector3};

fn near(got: &[f64], want: &[f64], tolerance: f64) {
    for (got, want) in got.iter().zip(want) {
        assert!((got - want).abs() < tolerance, "{got} is not {want}");
    }
}

#[test]
fn published_values_of_six_numbers_and_of_the_sphere() {
    let six = oblique().affine_flow([0.2, -0.1], [0.8, 0.3, -0.4]);
    near(&six, &[0.337146, 0.206645, -0.483972, 0.097092, -0.197473, -0.725699], 5e-7);
    near(&six[..2], &oblique().plane_flow([0.2, -0.1], 0.8), 1e-15);
    near(&oblique().sphere_flow([0.48, -0.6, 0.64], 0.8), &[0.222428, 0.472128, 0.275799], 5e-7);
}

#[test]
fn affine_flow_is_the_slope_of_flow() {
    let (motion, at, surface, h) = (oblique(), [0.3, -0.2], [0.8, 0.3, -0.4], 1e-6);
    let flow = |x: f64, y: f64| motion.plane_flow([x, y], 0.8 + 0.3 * (x - at[0]) - 0.4 * (y - at[1]));
    let six = motion.affine_flow(at, surface);
    for i in 0..2 {
        let along_x = (flow(at[0] + h, at[1])[i] - flow(at[0] - h, at[1])[i]) / (2.0 * h);
        let along_y = (flow(at[0], at[1] + h)[i] - flow(at[0], at[1] - h)[i]) / (2.0 * h);
        near(&[six[2 + i], six[4 + i]], &[along_x, along_y], 1e-9);
    }
}

#[test]
fn the_essential_matrix_holds_for_two_views() {
    for rotation in [[0.02, -0.03, 0.01], [1e-6, 0.0, 2e-6], [0.4, 0.3, -0.2]] {
        let motion = Motion::new(oblique().translation, rotation);
        let (essential, t) = (Matrix3::from_fn(|i, j| motion.essential_matrix()[i][j]), motion.displacement());
        let turn = Matrix3::from_fn(|i, j| motion.rotation_matrix()[i][j]);
        let before = Vector3::new(0.4, -0.7, 3.0);
        let after = turn * before + Vector3::from(t) * 0.3;
        assert!((after.transpose() * essential * before)[0].abs() < 1e-14);
    }
}
