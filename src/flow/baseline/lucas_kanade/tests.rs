use super::*;
use crate::flow::{Estimator, Method};
use crate::types::Mask;

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

fn estimate(options: LucasKanadeOptions, common: Common, frames: &[Frame<f64>]) -> FlowField<f64> {
    let estimator = Estimator::new(Method::LucasKanade(options), common).unwrap();
    let some: Vec<&Frame<f64>> = frames.iter().take(estimator.frames_needed()).collect();
    estimator.estimate(&some, 7).unwrap()
}

#[test]
fn a_translation_is_found_with_either_window_and_difference() {
    let f = frames(0.3, -0.2);
    for window in [Window::Gaussian(3.0), Window::Box(11)] {
        for differences in [Differences::Central, Differences::Pair] {
            let field = estimate(LucasKanadeOptions { window, differences }, Common::default(), &f);
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
    let dense = estimate(LucasKanadeOptions::default(), Common::default(), &f);
    let sites = Sites::Points(vec![(24, 20), (20, 18)]);
    let points = estimate(LucasKanadeOptions::default(), Common { sites, ..Common::default() }, &f);
    for (k, (x, y)) in [(24, 20), (20, 18)].into_iter().enumerate() {
        assert!((points.motion[k] - dense.motion[y * 48 + x]).abs() < 1e-12);
    }
    let stripes: Vec<Frame<f64>> =
        (0..3).map(|t| Frame::from_fn(48, 40, |x, _| (0.3 * (x as f64 - 0.2 * f64::from(t))).sin())).collect();
    let field = estimate(LucasKanadeOptions::default(), Common::default(), &stripes);
    assert!(field.status[20 * 48 + 24] == Status::Unobservable && field.motion[20 * 48 + 24].is_nan());
}

#[test]
fn masks_and_bad_samples_touch_only_their_windows() {
    let mut f = frames(0.3, -0.2);
    f[1].row_mut(20)[24] = f64::NAN;
    let mask = Mask::from_fn(48, 40, |x, y| (x, y) != (10, 12));
    let options = LucasKanadeOptions { window: Window::Box(5), ..LucasKanadeOptions::default() };
    let field = estimate(options, Common { mask: Some(mask), ..Common::default() }, &f);
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
