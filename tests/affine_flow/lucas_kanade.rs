//! Lucas and Kanade's baseline.

use jacoflow::flow::baseline::{Differences, LucasKanadeOptions, Window};
use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::types::{FlowField, Frame, Mask, SamplingGrid, Status};

/// Two crossed waves moving by (u, v) px/frame.
fn frames(u: f64, v: f64) -> Vec<Frame<f64>> {
    (0..3)
        .map(|t| {
            Frame::from_fn(48, 40, |x, y| {
                let (x, y) = (x as f64 - u * f64::from(t), y as f64 - v * f64::from(t));
                100.0 + 30.0 * (0.31 * x + 0.12 * y).sin() + 25.0 * (0.27 * y - 0.09 * x).cos()
            })
        })
        .collect()
}

fn estimate(options: LucasKanadeOptions, common: EstimatorOptions, frames: &[Frame<f64>]) -> FlowField<f64> {
    let estimator = Estimator::new(Method::LucasKanade(options), common).unwrap();
    let some: Vec<&Frame<f64>> = frames.iter().take(estimator.frames_needed()).collect();
    estimator.estimate(&some, 7).unwrap()
}

#[test]
fn a_translation_is_found_with_either_window_and_difference() {
    let f = frames(0.3, -0.2);
    for window in [Window::Gaussian(3.0), Window::Box(11)] {
        for differences in [Differences::Central, Differences::Pair] {
            let field = estimate(LucasKanadeOptions { window, differences }, EstimatorOptions::default(), &f);
            assert_eq!(field.layout.frame_index, 7 + usize::from(differences == Differences::Central));
            let i = 20 * field.width + 24;
            assert_eq!((field.status[i], field.status[0]), (Status::Ok, Status::Border));
            let m = field.affine(i);
            assert!((m.u - 0.3).abs() < 0.01 && (m.v + 0.2).abs() < 0.01, "{window:?} {differences:?} {m:?}");
        }
    }
}

#[test]
fn points_equal_the_dense_field_and_one_direction_is_not_enough() {
    let f = frames(0.3, -0.2);
    let dense = estimate(LucasKanadeOptions::default(), EstimatorOptions::default(), &f);
    let sites = SamplingGrid::Points(vec![(24, 20), (20, 18)]);
    let points = estimate(LucasKanadeOptions::default(), EstimatorOptions { sites, ..EstimatorOptions::default() }, &f);
    for (k, (x, y)) in [(24, 20), (20, 18)].into_iter().enumerate() {
        assert!((points.motion[k] - dense.motion[y * 48 + x]).abs() < 1e-12);
    }
    let stripes: Vec<Frame<f64>> =
        (0..3).map(|t| Frame::from_fn(48, 40, |x, _| (0.3 * (x as f64 - 0.2 * f64::from(t))).sin())).collect();
    let field = estimate(LucasKanadeOptions::default(), EstimatorOptions::default(), &stripes);
    assert!(field.status[20 * 48 + 24] == Status::Unobservable && field.motion[20 * 48 + 24].is_nan());
}

#[test]
fn masks_and_bad_samples_touch_only_their_windows() {
    let mut f = frames(0.3, -0.2);
    f[1].row_mut(20)[24] = f64::NAN;
    let mask = Mask::from_fn(48, 40, |x, y| (x, y) != (10, 12));
    let options = LucasKanadeOptions { window: Window::Box(5), ..LucasKanadeOptions::default() };
    let field = estimate(options, EstimatorOptions { mask: Some(mask), ..EstimatorOptions::default() }, &f);
    for y in 3..37usize {
        for x in 3..45usize {
            let near = |cx: usize, cy: usize, r: usize| x.abs_diff(cx) <= r && y.abs_diff(cy) <= r;
            let got = field.status[y * 48 + x];
            if near(10, 12, 3) {
                assert_eq!(got, Status::Masked);
            } else if got != Status::Ok {
                assert!(got == Status::NonFinite && near(24, 20, 3));
            }
        }
    }
    assert_eq!(field.status[20 * 48 + 24], Status::NonFinite);
}

#[test]
fn a_window_is_cut_off_at_the_edge_and_only_the_rim_has_no_estimate() {
    let f = frames(0.3, -0.2);
    let common = EstimatorOptions { covariance: true, ..EstimatorOptions::default() };
    let dense = estimate(LucasKanadeOptions::default(), common.clone(), &f);
    for (i, status) in dense.status.iter().enumerate() {
        let (x, y) = (i % 48, i / 48);
        let rim = x == 0 || y == 0 || x == 47 || y == 39;
        assert_eq!(*status, if rim { Status::Border } else { Status::Ok }, "{x} {y}");
        let m = dense.affine(i);
        assert!(rim || (m.u - 0.3).abs() < 0.02 && (m.v + 0.2).abs() < 0.02, "{x} {y} {m:?}");
    }
    // Half the window, half the knowledge: the variance of both components is about twice that of the middle.
    let known = EstimatorOptions { noise: Some(1.0), ..common.clone() };
    let variance = estimate(LucasKanadeOptions::default(), known, &f).covariance.unwrap();
    let mean = |columns: &[usize]| {
        let sites = columns.iter().flat_map(|x| (13..27).map(move |y| y * 48 + x));
        sites.map(|i| variance[i] + variance[2 * 48 * 40 + i]).sum::<f64>() / (14 * columns.len()) as f64
    };
    let ratio = mean(&[1, 46]) / mean(&(16..32).collect::<Vec<_>>());
    assert!((1.7..2.2).contains(&ratio), "{ratio}");
    let places = vec![(1, 1), (46, 38), (3, 20), (24, 37)];
    let points = EstimatorOptions { sites: SamplingGrid::Points(places.clone()), ..common };
    let points = estimate(LucasKanadeOptions::default(), points, &f);
    for (k, (x, y)) in places.into_iter().enumerate() {
        assert!((points.motion[k] - dense.motion[y * 48 + x]).abs() < 1e-12);
    }
    // A frame that holds less than a tenth of its windows knows too little.
    let wide = LucasKanadeOptions { window: Window::Gaussian(100.0), ..LucasKanadeOptions::default() };
    assert!(estimate(wide, EstimatorOptions::default(), &f).status.iter().all(|s| *s == Status::Border));
}

#[test]
fn gain_in_intensity_changes_nothing() {
    let f = frames(0.3, -0.2);
    let of = |gain: f64| {
        let brighter: Vec<_> = f.iter().map(|frame| frame.map(|v| v * gain)).collect();
        let common = EstimatorOptions { covariance: true, noise: Some(gain), ..EstimatorOptions::default() };
        estimate(LucasKanadeOptions::default(), common, &brighter)
    };
    let one = of(1.0);
    for gain in [1e-100, 3.0, 1e100] {
        let other = of(gain);
        assert_eq!(one.status, other.status, "{gain}");
        let planes = one.motion.iter().chain(one.covariance.as_ref().unwrap());
        for (a, b) in planes.zip(other.motion.iter().chain(other.covariance.as_ref().unwrap())) {
            assert!(a.is_nan() && b.is_nan() || (a - b).abs() < 1e-9 * (1.0 + a.abs()), "{gain}: {a} {b}");
        }
    }
}
