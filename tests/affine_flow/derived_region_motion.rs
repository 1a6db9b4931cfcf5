//! One affine motion for a whole region, from the estimates of its sites.

use jacoflow::flow::derived::{Measured, Quantity, RegionMotion, RegionStatus, fit_region};
use jacoflow::math::random::CounterRng;
use jacoflow::types::{FieldLayout, FlowField, Interval, MOTION_NAMES, Rect, SamplingGrid, Status, Units};
use nalgebra::{Matrix6, Vector6};

const TRUTH: [f64; 6] = [0.3, -0.2, 0.01, 0.02, -0.02, 0.015];

fn field(noise: f64, claimed: f64, seed: u64) -> FlowField<f64> {
    let layout = FieldLayout {
        frame_size: (40, 30),
        sites: SamplingGrid::Grid { region: Some(Rect { x: 10, y: 5, width: 21, height: 11 }), stride: 2 },
        model: "affine".into(),
        parameters: MOTION_NAMES.map(String::from).to_vec(),
        units: Units::default(),
        interval: Interval::Instant,
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

fn fitted(field: &FlowField<f64>) -> RegionMotion {
    fit_region(field, None, None).unwrap()
}

#[test]
fn an_affine_region_is_recovered_exactly() {
    let fit = fitted(&field(0.0, 0.01, 1));
    assert_eq!((fit.centre, fit.count, fit.sites), ((20.0, 10.0), 66, 66));
    for (got, want) in fit.motion.iter().zip(TRUTH) {
        assert!((got - want).abs() < 1e-9, "{got} {want}");
    }
}

#[test]
fn normalised_errors_have_the_size_they_should() {
    let mut nees = 0.0;
    for seed in 0..200 {
        let fit = fitted(&field(0.05, 0.05, seed));
        let error = Vector6::from(fit.motion) - Vector6::from(TRUTH);
        let covariance = Matrix6::from(fit.covariance);
        nees += (error.transpose() * covariance.try_inverse().unwrap() * error)[0] / 200.0;
    }
    assert!((5.0..7.0).contains(&nees), "{nees}");
}

#[test]
fn scatter_and_shared_windows_enlarge_the_deviation() {
    let honest = fitted(&field(0.05, 0.05, 3)).covariance[2][2];
    let boastful = fitted(&field(0.05, 0.005, 3)).covariance[2][2];
    assert!((0.5..2.0).contains(&(boastful / honest)), "{}", boastful / honest);
    let mut overlapping = field(0.05, 0.05, 3);
    overlapping.layout.correlation_length = 4.0;
    let overlapping = fitted(&overlapping).covariance[2][2];
    assert!(overlapping > 10.0 * honest);
}

#[test]
fn what_is_claimed_and_does_not_scatter_is_common() {
    // An error of one claimed deviation in every u, and next to no scatter.
    let mut biased = field(0.001, 0.05, 3);
    let n = biased.len();
    biased.motion[..n].iter_mut().for_each(|u| *u += 0.05);
    let fit = fitted(&biased);
    let (error, deviation) = (fit.motion[0] - TRUTH[0], fit.covariance[0][0].sqrt());
    assert!((error - 0.05).abs() < 1e-3 && (0.8..1.1).contains(&(error / deviation)), "{error} {deviation}");
    // Errors that scatter as claimed have nothing in common.
    let honest = fitted(&field(0.05, 0.05, 3)).covariance[0][0].sqrt();
    assert!(honest < 0.25 * deviation, "{honest} {deviation}");
}

#[test]
fn too_few_sites_give_nan_not_a_guess() {
    let mut none = field(0.0, 0.01, 1);
    none.status.fill(Status::Border);
    let fit = fitted(&none);
    assert!(fit.motion.iter().all(|value| value.is_nan()) && fit.count == 0 && fit.valid_share() == 0.0);
    assert_eq!(fit.status, RegionStatus::TooFewSites);
    let mut bare = field(0.0, 0.01, 1);
    bare.covariance = None;
    assert!(fit_region(&bare, None, None).unwrap_err().to_string().starts_with("field: "));
}

/// Sites left of column `edge` of the region's 11 stand still.
fn two_motions(edge: usize) -> FlowField<f64> {
    let mut field = field(0.02, 0.02, 5);
    let (n, width, rng) = (field.len(), field.width, CounterRng::new(6));
    for site in (0..n).filter(|site| site % width < edge) {
        for p in 0..6 {
            let size = if p < 2 { 0.02 } else { 0.002 };
            field.motion[p * n + site] = size * rng.normal((6 * site + p) as u64) + if p == 0 { -3.0 } else { 0.0 };
        }
    }
    field
}

#[test]
fn the_motion_of_most_sites_is_found_and_that_around_a_pixel() {
    let curl = |found: &RegionMotion, field: &FlowField<f64>| {
        Measured::Derived(Quantity::Curl).of_region(field, found).unwrap()
    };
    let mostly = two_motions(4);
    let found = fitted(&mostly);
    let (value, std) = curl(&found, &mostly);
    assert_eq!((found.status, found.count), (RegionStatus::Ok, 42));
    assert!((value - 0.04).abs() < 4.0 * std && std < 0.002, "{value} {std}");
    // Left, where 24 of 66 sites stand still.
    let still = fit_region(&mostly, None, Some((11.0, 10.0))).unwrap();
    let (value, std) = curl(&still, &mostly);
    assert!(still.status == RegionStatus::Ok && still.count == 24 && value.abs() < 4.0 * std, "{value} {std}");
}

#[test]
fn without_a_dominant_motion_there_is_no_value() {
    let mut halves = two_motions(5);
    // A third motion for one column: none has half of the sites.
    let (n, width) = (halves.len(), halves.width);
    (0..n).filter(|site| site % width == 5).for_each(|site| halves.motion[site] += 5.0);
    let found = fitted(&halves);
    assert_eq!(found.status, RegionStatus::NoDominantMotion);
    assert!(found.motion[0].is_nan() && found.share() < 0.5, "{}", found.share());
    let outside = fit_region(&halves, None, Some((-1.0, 3.0))).unwrap_err().to_string();
    assert!(outside.starts_with("at: "), "{outside}");
}

#[test]
fn a_motion_that_few_estimates_follow_is_none() {
    // Of all sites but five the frames contradict the estimate.
    let mut doubtful = field(0.02, 0.02, 5);
    doubtful.status[5..].fill(Status::Inconsistent);
    assert_eq!(fitted(&doubtful).status, RegionStatus::TooFewSites);
}
