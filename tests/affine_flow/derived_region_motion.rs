//! One affine motion for a whole region, from the estimates of its sites.

use jacoflow::flow::derived::fit_region;
use jacoflow::math::random::CounterRng;
use jacoflow::types::{FieldLayout, FlowField, MOTION_NAMES, Rect, SamplingGrid, Status};
use nalgebra::{Matrix6, Vector6};

const TRUTH: [f64; 6] = [0.3, -0.2, 0.01, 0.02, -0.02, 0.015];

fn field(noise: f64, claimed: f64, seed: u64) -> FlowField<f64> {
    let layout = FieldLayout {
        frame_size: (40, 30),
        sites: SamplingGrid::Grid { region: Some(Rect { x: 10, y: 5, width: 21, height: 11 }), stride: 2 },
        model: "affine".into(),
        parameters: MOTION_NAMES.map(String::from).to_vec(),
        frame_period: None,
        pixel_pitch: (1.0, 1.0),
        frame_index: 1,
        correlation_length: 0.0,
    };
    let mut field = FlowField::empty(layout, true).unwrap();
    let (n, rng) = (field.len(), CounterRng::new(seed));
    field.status.fill(Status::Ok);
    field.covariance.as_mut().unwrap().fill(0.0);
    for site in 0..n {
        let (x, y) = field.layout.sites.pixel(site % field.width, site / field.width);
        let (dx, dy, [u, v, u_x, v_x, u_y, v_y]) = (x as f64 - 20.0, y as f64 - 10.0, TRUTH);
        let carried = [u + u_x * dx + u_y * dy, v + v_x * dx + v_y * dy, u_x, v_x, u_y, v_y];
        for p in 0..6 {
            let size = if p < 2 { 1.0 } else { 0.1 };
            field.motion[p * n + site] = carried[p] + noise * size * rng.normal((6 * site + p) as u64);
            let plane = [0, 6, 11, 15, 18, 20][p];
            field.covariance.as_mut().unwrap()[plane * n + site] = (claimed * size).powi(2);
        }
    }
    field
}

#[test]
fn an_affine_region_is_recovered_exactly() {
    let fit = fit_region(&field(0.0, 0.01, 1));
    assert_eq!((fit.centre, fit.count, fit.sites), ((20.0, 10.0), 66, 66));
    for (got, want) in fit.motion.iter().zip(TRUTH) {
        assert!((got - want).abs() < 1e-9, "{got} {want}");
    }
}

#[test]
fn normalised_errors_have_the_size_they_should() {
    let mut nees = 0.0;
    for seed in 0..200 {
        let fit = fit_region(&field(0.05, 0.05, seed));
        let error = Vector6::from(fit.motion) - Vector6::from(TRUTH);
        let covariance = Matrix6::from(fit.covariance);
        nees += (error.transpose() * covariance.try_inverse().unwrap() * error)[0] / 200.0;
    }
    assert!((5.0..7.0).contains(&nees), "{nees}");
}

#[test]
fn scatter_and_shared_windows_enlarge_the_deviation() {
    let honest = fit_region(&field(0.05, 0.05, 3)).covariance[2][2];
    let boastful = fit_region(&field(0.05, 0.005, 3)).covariance[2][2];
    assert!((0.5..2.0).contains(&(boastful / honest)), "{}", boastful / honest);
    let mut overlapping = field(0.05, 0.05, 3);
    overlapping.layout.correlation_length = 4.0;
    let overlapping = fit_region(&overlapping).covariance[2][2];
    assert!(overlapping > 10.0 * honest);
}

#[test]
fn what_is_claimed_and_does_not_scatter_is_common() {
    // An error of one claimed deviation in every u, and next to no scatter.
    let mut biased = field(0.001, 0.05, 3);
    let n = biased.len();
    biased.motion[..n].iter_mut().for_each(|u| *u += 0.05);
    let fit = fit_region(&biased);
    let (error, deviation) = (fit.motion[0] - TRUTH[0], fit.covariance[0][0].sqrt());
    assert!((error - 0.05).abs() < 1e-3 && (0.8..1.1).contains(&(error / deviation)), "{error} {deviation}");
    // Errors that scatter as claimed have nothing in common.
    let honest = fit_region(&field(0.05, 0.05, 3)).covariance[0][0].sqrt();
    assert!(honest < 0.25 * deviation, "{honest} {deviation}");
}

#[test]
fn too_few_sites_give_nan_not_a_guess() {
    let mut none = field(0.0, 0.01, 1);
    none.status.fill(Status::Border);
    let fit = fit_region(&none);
    assert!(fit.motion.iter().all(|value| value.is_nan()) && fit.count == 0 && fit.valid_share() == 0.0);
    let mut bare = field(0.0, 0.01, 1);
    bare.covariance = None;
    assert!(fit_region(&bare).motion[0].is_nan());
}
