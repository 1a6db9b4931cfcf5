//! Points carried along by a field, with their covariance.

use jacoflow::flow::advect;
use jacoflow::math::random::CounterRng;
use jacoflow::types::{FieldLayout, FlowField, Interval, MOTION_NAMES, Rect, SamplingGrid, Status, Units};
use proptest::prelude::*;

const MOTION: [f64; 6] = [1.2, -0.7, 0.05, 0.04, -0.06, 0.03];

fn layout(sites: SamplingGrid, parameters: &[&str]) -> FieldLayout {
    FieldLayout {
        frame_size: (30, 24),
        sites,
        model: "affine".into(),
        parameters: parameters.iter().map(|name| (*name).to_string()).collect(),
        units: Units::default(),
        interval: Interval::Instant,
        frame_index: 0,
        correlation_length: 0.0,
    }
}

/// The affine motion `MOTION` about pixel (0, 0), as every site tells it.
fn affine(sites: SamplingGrid, parameters: &[&str]) -> FlowField<f64> {
    let mut field = FlowField::empty(layout(sites, parameters), true).unwrap();
    let n = field.len();
    for site in 0..n {
        let (x, y) = field.layout.sites.pixel(site % field.width, site / field.width);
        let there = flow_at([x as f64, y as f64]);
        for p in 0..parameters.len() {
            field.motion[p * n + site] = if p < 2 { there[p] } else { MOTION[p] };
        }
        field.status[site] = Status::Ok;
    }
    field.covariance.as_mut().unwrap().fill(0.0);
    field
}

fn flow_at([x, y]: [f64; 2]) -> [f64; 2] {
    [MOTION[0] + MOTION[2] * x + MOTION[4] * y, MOTION[1] + MOTION[3] * x + MOTION[5] * y]
}

fn region() -> SamplingGrid {
    SamplingGrid::Grid { region: Some(Rect { x: 3, y: 2, width: 25, height: 19 }), stride: 4 }
}

proptest! {
    #[test]
    fn affine_motion_is_exact_between_sites(x in 3.0..27.0f64, y in 2.0..18.0f64) {
        let point = [x, y];
        let flow = flow_at(point);
        let identity = [[1.0, 0.0], [0.0, 1.0]];
        let step = [[1.0 + MOTION[2], MOTION[4]], [MOTION[3], 1.0 + MOTION[5]]];
        for parameters in [&MOTION_NAMES[..], &MOTION_NAMES[..2]] {
            let moved = advect(&affine(region(), parameters), &[point], Some(&[identity])).unwrap();
            for c in 0..2 {
                prop_assert!((moved.points[0][c] - point[c] - flow[c]).abs() < 1e-12);
                for d in 0..2 {
                    let want = step[c][0] * step[d][0] + step[c][1] * step[d][1];
                    prop_assert!((moved.covariances.as_ref().unwrap()[0][c][d] - want).abs() < 1e-12);
                }
            }
        }
    }
}

#[test]
fn outside_and_invalid_is_nan_and_edges_are_inside() {
    let mut field = affine(region(), &MOTION_NAMES);
    // The site at column 2, row 1: pixel (11, 6).
    field.status[field.width + 2] = Status::Unobservable;
    let known = |x: f64, y: f64| advect(&field, &[[x, y]], None).unwrap().points[0][0].is_finite();
    for (x, y) in [(3.0, 2.0), (27.0, 18.0), (27.0, 2.0), (15.0, 6.0), (7.0, 6.0), (11.0, 2.0), (12.0, 2.0)] {
        assert!(known(x, y), "{x} {y}");
    }
    for (x, y) in
        [(2.9, 5.0), (27.1, 5.0), (5.0, 18.1), (f64::NAN, 5.0), (1e300, 5.0), (11.0, 6.0), (14.9, 6.0), (8.0, 3.0)]
    {
        assert!(!known(x, y), "{x} {y}");
    }
    let nan = advect(&field, &[[0.0, 0.0]], Some(&[[[1.0, 0.0], [0.0, 1.0]]])).unwrap();
    assert!(nan.covariances.unwrap()[0][1][1].is_nan());
    let one =
        affine(SamplingGrid::Grid { region: Some(Rect { x: 5, y: 6, width: 1, height: 1 }), stride: 1 }, &MOTION_NAMES);
    assert!(advect(&one, &[[5.0, 6.0]], None).unwrap().points[0][1].is_finite());
}

/// Standard deviations of the parameters at every site, independent of each other.
const DEVIATIONS: [f64; 6] = [0.2, 0.3, 0.02, 0.01, 0.03, 0.02];

fn uncertain() -> FlowField<f64> {
    let mut field = affine(region(), &MOTION_NAMES);
    let n = field.len();
    // Planes of the variances in the upper triangle.
    for (plane, deviation) in [0, 6, 11, 15, 18, 20].into_iter().zip(DEVIATIONS) {
        field.covariance.as_mut().unwrap()[plane * n..(plane + 1) * n].fill(deviation * deviation);
    }
    field
}

#[test]
fn the_covariance_is_that_of_a_monte_carlo_run() {
    // A site, so that the flow's errors are those of u and v there.
    let (point, spread) = ([11.0, 10.0], [[0.25, 0.1], [0.1, 0.16]]);
    let got = advect(&uncertain(), &[point], Some(&[spread])).unwrap().covariances.unwrap()[0];
    // Cholesky of the spread.
    let root = [0.5, 0.2, (0.16f64 - 0.04).sqrt()];
    let count = 40_000;
    let random = CounterRng::new(7);
    let (mut sum, mut squares) = ([0.0; 2], [[0.0; 2]; 2]);
    for index in 0..count {
        let normal = |k: u64| random.stream(k).normal(index);
        let at = [point[0] + root[0] * normal(0), point[1] + root[1] * normal(0) + root[2] * normal(1)];
        let flow = flow_at(at);
        let moved = [at[0] + flow[0] + DEVIATIONS[0] * normal(2), at[1] + flow[1] + DEVIATIONS[1] * normal(3)];
        for c in 0..2 {
            sum[c] += moved[c];
            (0..2).for_each(|d| squares[c][d] += moved[c] * moved[d]);
        }
    }
    let count = count as f64;
    for c in 0..2 {
        for d in 0..2 {
            let want = squares[c][d] / count - sum[c] * sum[d] / (count * count);
            assert!((got[c][d] - want).abs() < 0.01, "{c}{d}: {got:?} {want}");
        }
    }
}

#[test]
fn between_sites_the_slopes_errors_count_too() {
    // In the middle of a cell every site is (2, 2) px away.
    let moved = advect(&uncertain(), &[[13.0, 8.0]], Some(&[[[0.0; 2]; 2]])).unwrap();
    let got = moved.covariances.unwrap()[0];
    let variance = |p: usize| DEVIATIONS[p] * DEVIATIONS[p];
    for (c, value) in [got[0][0], got[1][1]].into_iter().enumerate() {
        let want = variance(c) + 4.0 * (variance(2 + c) + variance(4 + c));
        assert!((value - want).abs() < 1e-12, "{c}: {value} {want}");
    }
    assert_eq!(got[0][1], 0.0);
}

#[test]
fn fields_without_a_grid_are_refused() {
    let mut field = affine(SamplingGrid::Points(vec![(4, 5), (6, 7)]), &MOTION_NAMES);
    assert!(advect(&field, &[], None).unwrap_err().to_string().starts_with("field: "));
    field = affine(region(), &MOTION_NAMES);
    assert!(advect(&field, &[[5.0, 5.0]], Some(&[])).unwrap_err().to_string().starts_with("covariance: "));
}

#[test]
fn fields_in_other_units_move_points_in_pixels() {
    let field = affine(region(), &MOTION_NAMES);
    let want = advect(&field, &[[5.25, 6.5]], None).unwrap().points[0];
    let mut metric = field.clone();
    metric.convert(Units::new((0.5, 0.25), Some("mm"), Some(0.04)));
    let got = advect(&metric, &[[5.25, 6.5]], None).unwrap().points[0];
    assert!((0..2).all(|c| (got[c] - want[c]).abs() < 1e-12), "{got:?} {want:?}");
}
