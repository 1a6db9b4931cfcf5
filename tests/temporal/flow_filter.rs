//! The dense flow filter against recorded runs of filterpy, the patent's reference experiment, and its own
//! promises.

use jacoflow::image::{GaussianSmoother, Quantiser};
use jacoflow::jet::Neighbourhood;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::synth::{RotatingRamp, Scene};
use jacoflow::temporal::{FilterForm, FlowFilter, FlowFilterOptions, Transition};
use jacoflow::types::{Frame, Mask, Rect, SamplingGrid, Status, Units};
use std::f64::consts::PI;

mod definiteness;
mod equivalence;
mod promises;
mod robustness;

const TRUTH: [f64; 6] = [-80.0 * PI / 100.0, 60.0 * PI / 100.0, 0.0, PI / 100.0, -PI / 100.0, 0.0];

/// The reference scene around (60, 80), which is pixel (32, 32), quantised; smoothed where asked.
fn reference_frames(count: usize, smooth: bool) -> Vec<Frame<f64>> {
    let scene = RotatingRamp::reference(65, 65).with_origin((28.0, 48.0));
    let quantiser = Quantiser::default();
    let smoother = GaussianSmoother::new(3.0).unwrap();
    (0..count)
        .map(|t| {
            let frame = quantiser.apply(&scene.frame(t as f64));
            if smooth { smoother.apply(&frame) } else { frame }
        })
        .collect()
}

fn at_centre(options: FlowFilterOptions) -> FlowFilterOptions {
    FlowFilterOptions { sites: SamplingGrid::Points(vec![(32, 32)]), ..options }
}

/// Means after every frame.
fn run(frames: &[Frame<f64>], options: FlowFilterOptions) -> Vec<[f64; 12]> {
    let mut filter = FlowFilter::<f64>::new(frames[0].size(), options).unwrap();
    let means = frames
        .iter()
        .map(|frame| {
            let field = filter.push(frame).unwrap();
            assert_eq!(field.status, [Status::Ok]);
            filter.state(0).unwrap().0
        })
        .collect();
    assert_eq!(filter.repairs(), 0);
    means
}

struct Errors {
    rms: [f64; 6],
    bias: [f64; 6],
    /// First frame from which both flow errors stay below 0.25 px.
    settled: usize,
}

fn errors(means: &[[f64; 12]]) -> Errors {
    let late = &means[200..];
    let sum = |f: &dyn Fn(f64) -> f64, k: usize| -> f64 {
        late.iter().map(|q| f(q[6 + k] - TRUTH[k])).sum::<f64>() / late.len() as f64
    };
    let off = |q: &[f64; 12]| (0..2).any(|k| (q[6 + k] - TRUTH[k]).abs() >= 0.25);
    Errors {
        rms: std::array::from_fn(|k| sum(&|e| e * e, k).sqrt()),
        bias: std::array::from_fn(|k| sum(&|e| e, k)),
        settled: means.iter().rposition(off).map_or(0, |last| last + 1),
    }
}

#[test]
fn agrees_with_filterpy_over_400_frames() {
    let record: serde_json::Value = serde_json::from_str(include_str!("../golden/flow_filter.json")).unwrap();
    let frames = reference_frames(400, true);
    for (name, form) in [("augmented", FilterForm::Augmented), ("non_augmented", FilterForm::NonAugmented)] {
        let options = at_centre(FlowFilterOptions { form, ..FlowFilterOptions::patent() });
        let mut filter = FlowFilter::<f64>::new((65, 65), options).unwrap();
        let mut recorded =
            record["frames"].as_array().unwrap().iter().map(|f| f.as_u64().unwrap() as usize).enumerate().peekable();
        for (t, frame) in frames.iter().enumerate() {
            filter.push(frame).unwrap();
            let Some((row, _)) = recorded.next_if(|&(_, f)| f == t) else { continue };
            let (mean, covariance) = filter.state(0).unwrap();
            for k in 0..12 {
                let want = |what: &str| record[name][what][row][k].as_f64().unwrap();
                let (m, v) = (want("means"), want("variances"));
                // Relative to the state's size: components near zero are compared with their standard
                // deviation.
                assert!(
                    (mean[k] - m).abs() <= 1e-6 * m.abs().max(v.sqrt()),
                    "{name} frame {t} mean {k}: {} {m}",
                    mean[k]
                );
                assert!(
                    (covariance[k][k] - v).abs() <= 1e-6 * v,
                    "{name} frame {t} variance {k}: {} {v}",
                    covariance[k][k]
                );
            }
        }
        assert!(recorded.next().is_none());
    }
}

#[test]
fn reference_experiment_augmented_and_not() {
    let frames = reference_frames(400, true);
    let augmented = run(&frames, at_centre(FlowFilterOptions::patent()));
    let first = augmented[0];
    assert!((first[0] - 139.52981).abs() < 1e-5 && (first[1] - 0.20018528).abs() < 1e-5 && first[2].abs() < 1e-5);
    assert!(first[6..].iter().all(|m| m.abs() < 1e-12));
    assert!((augmented[1][6] + 0.3596).abs() < 0.002 && (augmented[1][11] - 0.0788).abs() < 0.001);

    let a = errors(&augmented);
    assert!((60..=130).contains(&a.settled), "settled {}", a.settled);
    assert!(a.rms[0] <= 0.045 && a.rms[1] <= 0.065, "rms {:?}", a.rms);
    assert!(a.rms[3] <= 0.06 && a.rms[4] <= 0.06, "rms {:?}", a.rms);
    for k in [2, 5] {
        assert!((0.07..=0.11).contains(&a.bias[k]), "bias {:?}", a.bias);
    }

    let form = FilterForm::NonAugmented;
    let n = errors(&run(&frames, at_centre(FlowFilterOptions { form, ..FlowFilterOptions::patent() })));
    assert!(a.rms[0] < n.rms[0] && a.rms[1] < n.rms[1], "{:?} {:?}", a.rms, n.rms);
    assert!((n.rms[0] - 0.063).abs() < 0.002 && (n.rms[1] - 0.079).abs() < 0.002, "{:?}", n.rms);
}

/// A smooth texture that drifts, in grey levels.
fn texture(width: usize, height: usize, t: usize) -> Frame<f64> {
    let t = t as f64;
    Frame::from_fn(width, height, |x, y| {
        let (x, y) = (x as f64 - 0.3 * t, y as f64 + 0.2 * t);
        128.0 + 20.0 * (x * 0.31 + y * 0.15).sin() + 15.0 * (y * 0.23 - x * 0.13).cos()
    })
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn nine_by_nine_on_raw_frames_reaches_the_measured_errors() {
    let frames = reference_frames(400, false);
    let e = errors(&run(&frames, at_centre(FlowFilterOptions::measured())));
    assert!(e.rms[0] <= 1.3 * 0.013 && e.rms[1] <= 1.3 * 0.031, "rms {:?}", e.rms);
    assert!(e.rms[2..].iter().all(|&r| r <= 1.3 * 0.002), "rms {:?}", e.rms);
    assert!(e.bias[2].abs() < 0.002 && e.bias[5].abs() < 0.002, "bias {:?}", e.bias);
}
