//! The dense flow filter against recorded runs of filterpy, the patent's reference experiment, and its own promises.

use jacoflow::image::{GaussianSmoother, Quantiser};
use jacoflow::jet::Neighbourhood;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::synth::{RotatingRamp, Scene};
use jacoflow::temporal::{FilterForm, FlowFilter, FlowFilterOptions, Transition};
use jacoflow::types::{Frame, Mask, Rect, Sites, Status};
use std::f64::consts::PI;

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
    FlowFilterOptions { sites: Sites::Points(vec![(32, 32)]), ..options }
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
    let record: serde_json::Value = serde_json::from_str(include_str!("golden/flow_filter.json")).unwrap();
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
                // Relative to the state's size: components near zero are compared with their standard deviation.
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

/// The generic filter with the plain nine-pixel measurement: nothing shared with the dense filter but the system itself.
fn oracle(
    frames: &[Frame<f64>],
    at: (usize, usize),
    form: FilterForm,
    side: usize,
    motion_first: bool,
) -> Vec<(Vec<f64>, Vec<f64>)> {
    use jacoflow::filter::{SigmaPoints, UnscentedFilter};
    use jacoflow::temporal::dynamics::rk4;
    let options = FlowFilterOptions::patent();
    // Place of state component k in the oracle's order.
    let place = |k: usize| if motion_first { (k + 6) % 12 } else { k };
    let pixels = side * side;
    let reach = (side / 2) as isize;
    let mut ukf = UnscentedFilter::new(1, 12, pixels, SigmaPoints::default()).unwrap();
    ukf.Q = vec![0.0; 144];
    for k in 0..12 {
        ukf.Q[place(k) * 13] = options.process_noise[k];
    }
    ukf.R = (0..pixels * pixels).map(|k| if k % (pixels + 1) == 0 { options.measurement_noise } else { 0.0 }).collect();
    let step = |q: &[f64], w: &[f64], out: &mut [f64]| {
        let moved = rk4(&std::array::from_fn(|k| q[place(k)]), &std::array::from_fn(|k| w[place(k)]));
        (0..12).for_each(|k| out[place(k)] = moved[k]);
    };
    frames
        .iter()
        .map(|frame| {
            if form == FilterForm::Augmented {
                ukf.predict_augmented(|q, w, out| {
                    for ((q, w), out) in q.chunks_exact(12).zip(w.chunks_exact(12)).zip(out.chunks_exact_mut(12)) {
                        step(q, w, out);
                    }
                    Ok(())
                })
                .unwrap();
            } else {
                ukf.predict(|q, out| {
                    for (q, out) in q.chunks_exact(12).zip(out.chunks_exact_mut(12)) {
                        step(q, &[0.0; 12], out);
                    }
                    Ok(())
                })
                .unwrap();
            }
            let offsets = || (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y)));
            let z: Vec<f64> =
                offsets().map(|(x, y)| frame.get(at.0.wrapping_add_signed(x), at.1.wrapping_add_signed(y))).collect();
            ukf.update(&z, |q, out| {
                for (q, out) in q.chunks_exact(12).zip(out.chunks_exact_mut(pixels)) {
                    for ((x, y), out) in offsets().zip(out) {
                        let (x, y) = (x as f64, y as f64);
                        let b = [1.0, x, y, x * x / 2.0, x * y, y * y / 2.0];
                        *out = (0..6).map(|k| b[k] * q[place(k)]).sum();
                    }
                }
                Ok(())
            })
            .unwrap();
            let x = (0..12).map(|k| ukf.x[place(k)]).collect();
            let p = (0..144).map(|k| ukf.P[place(k / 12) * 12 + place(k % 12)]).collect();
            (x, p)
        })
        .collect()
}

/// Largest difference of mean and covariance, in standard deviations.
fn difference((mean, covariance): &([f64; 12], [[f64; 12]; 12]), (x, p): &(Vec<f64>, Vec<f64>)) -> f64 {
    let deviation = |k: usize| p[k * 13].sqrt();
    let mut worst = 0.0f64;
    for a in 0..12 {
        worst = worst.max((mean[a] - x[a]).abs() / deviation(a));
        for b in 0..12 {
            worst = worst.max((covariance[a][b] - p[a * 12 + b]).abs() / (deviation(a) * deviation(b)));
        }
    }
    worst
}

#[test]
fn every_level_equals_the_generic_filter_with_every_pixel_measured() {
    let frames: Vec<_> = (0..25).map(|t| texture(40, 16, t)).collect();
    // With 25 pixels the generic filter inverts a 25 x 25 matrix whose condition costs it digits.
    for (form, side, tolerance) in
        [(FilterForm::Augmented, 3, 1e-8), (FilterForm::NonAugmented, 3, 1e-8), (FilterForm::NonAugmented, 5, 1e-6)]
    {
        // A site in the middle of a block: its neighbours in the lanes are other pixels.
        let at = (14, 7);
        let want = oracle(&frames, at, form, side, false);
        for level in Level::available() {
            let neighbourhood = Neighbourhood::square(side);
            let options = FlowFilterOptions { form, neighbourhood, simd: Some(level), ..FlowFilterOptions::patent() };
            let mut filter = FlowFilter::<f64>::new((40, 16), options).unwrap();
            for (frame, want) in frames.iter().zip(&want) {
                filter.push(frame).unwrap();
                let got = filter.state(at.1 * 40 + at.0).unwrap();
                let worst = difference(&got, want);
                assert!(worst < tolerance, "{form:?} {side} {} {worst}", level.name());
            }
        }
    }
}

#[test]
fn thirteen_points_equal_twenty_five_that_take_the_motion_first() {
    let frames: Vec<_> = (0..25).map(|t| texture(16, 16, t)).collect();
    let want = oracle(&frames, (8, 8), FilterForm::NonAugmented, 3, true);
    let sites = Sites::Points(vec![(8, 8)]);
    let options = FlowFilterOptions { form: FilterForm::Fast, sites, ..FlowFilterOptions::patent() };
    let mut filter = FlowFilter::<f64>::new((16, 16), options).unwrap();
    for (frame, want) in frames.iter().zip(&want) {
        filter.push(frame).unwrap();
        let worst = difference(&filter.state(0).unwrap(), want);
        assert!(worst < 3e-8, "{worst}");
    }
}

#[test]
fn any_neighbourhood_updates_as_its_pixels_would() {
    // A shape without any symmetry: the six numbers are correlated in every way.
    let offsets = vec![(0, 0), (1, 0), (-1, 1), (2, 1), (0, -2), (1, 2), (-2, -1), (1, -1)];
    let options = FlowFilterOptions {
        neighbourhood: Neighbourhood::Points { offsets: offsets.clone(), sigma: None },
        form: FilterForm::NonAugmented,
        sites: Sites::Points(vec![(8, 8)]),
        ..FlowFilterOptions::patent()
    };
    let mut filter = FlowFilter::<f64>::new((16, 16), options).unwrap();
    // The first prediction keeps P0 and adds what the flow of unit variance does to nothing: P = I + Q, mean 0.
    let frame = texture(16, 16, 0);
    filter.push(&frame).unwrap();
    let (mean, covariance) = filter.state(0).unwrap();
    use jacoflow::filter::{KalmanFilter, SigmaPoints, UnscentedFilter};
    let mut ukf = UnscentedFilter::new(1, 12, 1, SigmaPoints::default()).unwrap();
    ukf.Q =
        (0..144).map(|k| if k % 13 == 0 { FlowFilterOptions::patent().process_noise[k / 13] } else { 0.0 }).collect();
    ukf.predict(|q, out| {
        for (q, out) in q.chunks_exact(12).zip(out.chunks_exact_mut(12)) {
            out.copy_from_slice(&jacoflow::temporal::dynamics::rk4(&q.try_into().unwrap(), &[0.0; 12]));
        }
        Ok(())
    })
    .unwrap();
    let n = offsets.len();
    let mut kf = KalmanFilter::new(1, 12, n).unwrap();
    (kf.x, kf.P) = (ukf.x.clone(), ukf.P.clone());
    kf.R = (0..n * n).map(|k| if k % (n + 1) == 0 { 1e-3 } else { 0.0 }).collect();
    kf.H = offsets
        .iter()
        .flat_map(|&(x, y)| {
            let (x, y) = (f64::from(x), f64::from(y));
            [1.0, x, y, x * x / 2.0, x * y, y * y / 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        })
        .collect();
    let z: Vec<f64> = offsets.iter().map(|&(x, y)| frame.get((8 + x) as usize, (8 + y) as usize)).collect();
    kf.update(&z).unwrap();
    let worst = difference(&(mean, covariance), &(kf.x.clone(), kf.P.clone()));
    assert!(worst < 1e-8, "{worst}");
}

#[test]
fn exact_transition_agrees_with_runge_kutta_where_motion_is_small() {
    let frames: Vec<_> = (0..40).map(|t| texture(16, 16, t)).collect();
    for form in FilterForm::ALL {
        let state = |transition| {
            let options = FlowFilterOptions {
                form,
                transition,
                sites: Sites::Points(vec![(8, 8)]),
                measurement_noise: 0.01,
                process_noise: [1e-4, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8, 1e-8],
                initial_covariance: [1e4, 10.0, 10.0, 1.0, 1.0, 1.0, 0.1, 0.1, 1e-3, 1e-3, 1e-3, 1e-3],
                ..FlowFilterOptions::patent()
            };
            let mut filter = FlowFilter::<f64>::new((16, 16), options).unwrap();
            for frame in &frames {
                filter.push(frame).unwrap();
            }
            filter.state(0).unwrap()
        };
        let (rk4, (x, p)) = (state(Transition::Rk4), state(Transition::Exact));
        let worst = difference(&rk4, &(x.to_vec(), p.iter().flatten().copied().collect()));
        assert!(worst > 0.0 && worst < 0.1, "{form:?}: {worst} standard deviations");
    }
}

#[test]
fn all_forms_find_the_turning_ramp_in_both_precisions() {
    let frames = reference_frames(200, false);
    for form in FilterForm::ALL {
        for transition in Transition::ALL {
            let options = at_centre(FlowFilterOptions { form, transition, ..FlowFilterOptions::measured() });
            let mut double = FlowFilter::<f64>::new((65, 65), options.clone()).unwrap();
            let mut single = FlowFilter::<f32>::new((65, 65), options).unwrap();
            for frame in &frames {
                double.push(frame).unwrap();
                single.push(&frame.map(|&v| v as f32)).unwrap();
            }
            for (mean, _) in [double.state(0).unwrap(), single.state(0).unwrap()] {
                for k in 0..6 {
                    let tolerance = if k < 2 { 0.15 } else { 0.01 };
                    assert!((mean[6 + k] - TRUTH[k]).abs() < tolerance, "{form:?} {transition:?} {k} {mean:?}");
                }
            }
            assert_eq!(double.repairs() + single.repairs(), 0, "{form:?} {transition:?}");
        }
    }
}

#[test]
fn patent_constants_in_single_precision_never_give_a_silent_nan() {
    let mut filter = FlowFilter::<f32>::new((65, 65), FlowFilterOptions::patent()).unwrap();
    for frame in reference_frames(120, true) {
        let field = filter.push(&frame.map(|&v| v as f32)).unwrap();
        for (site, status) in field.status.iter().enumerate() {
            assert_eq!(field.motion[site].is_nan(), *status == Status::Border);
            assert!(matches!(status, Status::Ok | Status::Repaired | Status::Border));
        }
    }
    // The centre still agrees with the truth, as in double precision.
    let (mean, _) = filter.state(32 * 65 + 32).unwrap();
    assert!((mean[6] - TRUTH[0]).abs() < 0.25 && (mean[7] - TRUTH[1]).abs() < 0.25, "{mean:?}");
}

#[test]
fn threads_and_resuming_change_no_bit() {
    let size = (50, 40);
    let options = |threads| FlowFilterOptions {
        covariance: true,
        threads: Threads::new(Some(threads)).unwrap(),
        ..FlowFilterOptions::patent()
    };
    let mut one = FlowFilter::<f64>::new(size, options(1)).unwrap();
    let mut two = FlowFilter::<f64>::new(size, options(2)).unwrap();
    for t in 0..6 {
        let frame = texture(size.0, size.1, t);
        let (a, b) = (one.push(&frame).unwrap(), two.push(&frame).unwrap());
        assert_eq!(bits(&a.motion), bits(&b.motion));
        assert_eq!(bits(a.covariance.as_ref().unwrap()), bits(b.covariance.as_ref().unwrap()));
        assert_eq!(bits(a.residual.as_ref().unwrap()), bits(b.residual.as_ref().unwrap()));
        assert_eq!(a.status, b.status);
        if t == 2 {
            let path = std::env::temp_dir().join(format!("jacoflow-filter-{}.npz", std::process::id()));
            two.save(&path).unwrap();
            two = FlowFilter::<f64>::load(&path).unwrap().with_computation(Threads::new(Some(2)).unwrap(), None);
            std::fs::remove_file(&path).unwrap();
            assert_eq!(two.frames(), 3);
            assert_eq!(
                two.to_bytes().unwrap(),
                FlowFilter::<f64>::from_bytes(&two.to_bytes().unwrap()).unwrap().to_bytes().unwrap()
            );
        }
    }
}

#[test]
fn options_survive_saving() {
    let mask = Mask::from_fn(20, 12, |x, y| (x, y) != (7, 6));
    let options = FlowFilterOptions {
        neighbourhood: Neighbourhood::Rectangle { width: 5, height: 3, sigma: Some(1.5) },
        sites: Sites::Grid { region: Some(Rect { x: 2, y: 1, width: 15, height: 9 }), stride: 2 },
        mask: Some(mask),
        form: FilterForm::Fast,
        transition: Transition::Exact,
        simd: Some(Level::SCALAR),
        pixel_pitch: (0.5, 0.25),
        frame_period: Some(0.04),
        ..FlowFilterOptions::measured()
    };
    let mut filter = FlowFilter::<f32>::new((20, 12), options).unwrap();
    filter.push(&texture(20, 12, 0).map(|&v| v as f32)).unwrap();
    let again = FlowFilter::<f32>::from_bytes(&filter.to_bytes().unwrap()).unwrap();
    assert_eq!(again.options(), filter.options());
    assert_eq!((again.frames(), again.frame_size(), again.state(3)), (1, (20, 12), filter.state(3)));
}

#[test]
fn broken_states_are_refused_with_words() {
    let mut filter = FlowFilter::<f64>::new((8, 8), FlowFilterOptions::patent()).unwrap();
    filter.push(&texture(8, 8, 0)).unwrap();
    let good = filter.to_bytes().unwrap();
    let message = |bytes: &[u8]| FlowFilter::<f64>::from_bytes(bytes).unwrap_err().to_string();
    assert!(message(b"PK nothing").contains("filter state"));
    assert!(message(&[]).contains("filter state"));
    for at in (0..good.len()).step_by(7) {
        let mut bytes = good.clone();
        bytes[at] ^= 0x20;
        if let Ok(filter) = FlowFilter::<f64>::from_bytes(&bytes) {
            assert_eq!(filter.to_bytes().unwrap(), good, "byte {at} is wrong and not noticed");
        }
    }
    for cut in [10, good.len() / 2, good.len() - 3] {
        assert!(FlowFilter::<f64>::from_bytes(&good[..cut]).is_err());
    }
    let error = FlowFilter::<f32>::from_bytes(&good).unwrap_err().to_string();
    assert!(error.contains("float32") && error.contains("float64"), "{error}");
}

#[test]
fn bad_pixels_damage_only_what_they_touch_and_only_for_a_while() {
    let options = FlowFilterOptions { residual: false, ..FlowFilterOptions::patent() };
    for residual in [false, true] {
        let options = FlowFilterOptions { residual, ..options.clone() };
        let mut clean = FlowFilter::<f64>::new((40, 30), options.clone()).unwrap();
        let mut spoilt = FlowFilter::<f64>::new((40, 30), options).unwrap();
        for t in 0..5 {
            let frame = texture(40, 30, t);
            let mut bad = frame.clone();
            if t == 2 {
                bad.row_mut(10)[12] = f64::NAN;
                bad.row_mut(20)[30] = f64::INFINITY;
            }
            let (a, b) = (clean.push(&frame).unwrap(), spoilt.push(&bad).unwrap());
            for y in 0..30usize {
                for x in 0..40usize {
                    let near = |cx: usize, cy: usize| x.abs_diff(cx) <= 1 && y.abs_diff(cy) <= 1;
                    let (site, touched) = (y * 40 + x, near(12, 10) || near(30, 20));
                    if touched && t == 2 {
                        assert_eq!(b.status[site], Status::NonFinite);
                        assert!(b.motion[site].is_nan());
                        // It has predicted: its uncertainty grew.
                        let (p, q) = (spoilt.state(site).unwrap(), clean.state(site).unwrap());
                        assert!(p.1[6][6] > q.1[6][6] && p.0.iter().all(|v| v.is_finite()));
                    } else if !(touched && t > 2) {
                        assert_eq!(
                            (a.status[site], a.motion[site].to_bits()),
                            (b.status[site], b.motion[site].to_bits())
                        );
                    } else {
                        assert_eq!(b.status[site], Status::Ok);
                    }
                }
            }
        }
    }
}

#[test]
fn points_regions_and_masks_compute_the_same_pixels() {
    let size = (40, 30);
    let points = vec![(5, 5), (20, 11), (0, 0), (39, 29), (20, 11)];
    let with = |sites: Sites, mask: Option<Mask>| FlowFilterOptions { sites, mask, ..FlowFilterOptions::patent() };
    let mask = Mask::from_fn(size.0, size.1, |x, y| (x, y) != (10, 10));
    let grid = Sites::Grid { region: Some(Rect { x: 4, y: 3, width: 20, height: 18 }), stride: 3 };
    let mut dense = FlowFilter::<f64>::new(size, with(Sites::default(), None)).unwrap();
    let mut at_points = FlowFilter::<f64>::new(size, with(Sites::Points(points.clone()), None)).unwrap();
    let mut on_grid = FlowFilter::<f64>::new(size, with(grid.clone(), None)).unwrap();
    let mut masked = FlowFilter::<f64>::new(size, with(Sites::default(), Some(mask))).unwrap();
    for t in 0..3 {
        let frame = texture(size.0, size.1, t);
        let all = dense.push(&frame).unwrap();
        let p = at_points.push(&frame).unwrap();
        for (k, &(x, y)) in points.iter().enumerate() {
            assert_eq!(p.motion[k].to_bits(), all.motion[y * size.0 + x].to_bits());
            assert_eq!(p.status[k], all.status[y * size.0 + x]);
        }
        let g = on_grid.push(&frame).unwrap();
        for row in 0..g.height {
            for col in 0..g.width {
                let (x, y) = grid.pixel(col, row);
                assert_eq!(g.motion[row * g.width + col].to_bits(), all.motion[y * size.0 + x].to_bits());
            }
        }
        let m = masked.push(&frame).unwrap();
        for y in 1..size.1 - 1 {
            for x in 1..size.0 - 1 {
                let site = y * size.0 + x;
                if x.abs_diff(10) <= 1 && y.abs_diff(10) <= 1 {
                    assert_eq!(m.status[site], Status::Masked);
                    assert!(m.motion[site].is_nan() && masked.state(site).is_none());
                } else {
                    assert_eq!(m.motion[site].to_bits(), all.motion[site].to_bits());
                }
            }
        }
    }
    assert_eq!(p_status(&mut at_points, 2), Status::Border);
}

fn p_status(filter: &mut FlowFilter<f64>, site: usize) -> Status {
    filter.push(&texture(40, 30, 9)).unwrap().status[site]
}

#[test]
fn grey_scale_pitch_and_covariance_are_in_their_units() {
    let frames: Vec<_> = (0..4).map(|t| texture(16, 16, t)).collect();
    let sites = Sites::Points(vec![(8, 8)]);
    let options = FlowFilterOptions { sites, covariance: true, ..FlowFilterOptions::patent() };
    let scaled = FlowFilterOptions { full_scale: 1.0, pixel_pitch: (2.0, 0.5), ..options.clone() };
    let mut a = FlowFilter::<f64>::new((16, 16), options).unwrap();
    let mut b = FlowFilter::<f64>::new((16, 16), scaled).unwrap();
    let mut last = None;
    for frame in &frames {
        last = Some((a.push(frame).unwrap(), b.push(&frame.map(|v| v / 255.0)).unwrap()));
    }
    let (fa, fb) = last.unwrap();
    let unit = [2.0, 0.5, 1.0, 0.25, 4.0, 1.0];
    let (ca, cb) = (fa.covariance_at(0).unwrap(), fb.covariance_at(0).unwrap());
    let (_, full) = a.state(0).unwrap();
    for k in 0..6 {
        assert!((fb.motion[k] - unit[k] * fa.motion[k]).abs() < 1e-10 * (1.0 + fa.motion[k].abs()));
        for j in 0..6 {
            assert!((cb[k][j] - unit[k] * unit[j] * ca[k][j]).abs() < 1e-9);
            assert_eq!(ca[k][j], full[6 + k][6 + j]);
        }
    }
}

#[test]
fn residual_estimates_the_pixel_noise() {
    use jacoflow::math::random::CounterRng;
    let rng = CounterRng::new(11);
    let frame = Frame::from_fn(64, 64, |x, y| 100.0 + 0.5 * x as f64 + 3.0 * rng.normal((y * 64 + x) as u64));
    for (neighbourhood, tolerance) in [
        (Neighbourhood::square(3), 0.15),
        (Neighbourhood::square(7), 0.1),
        (Neighbourhood::Rectangle { width: 7, height: 7, sigma: Some(2.0) }, 0.1),
    ] {
        let options = FlowFilterOptions { neighbourhood, ..FlowFilterOptions::patent() };
        let field = FlowFilter::<f64>::new((64, 64), options).unwrap().push(&frame).unwrap();
        let values: Vec<f64> = field.residual.unwrap().into_iter().filter(|v| v.is_finite()).collect();
        let variance = values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        assert!((variance.sqrt() / 3.0 - 1.0).abs() < tolerance, "{}", variance.sqrt());
    }
}

#[test]
fn unusable_options_and_frames_are_named() {
    let message = |size, options| FlowFilter::<f64>::new(size, options).unwrap_err().to_string();
    let patent = FlowFilterOptions::patent;
    let mut noise = patent();
    noise.process_noise[3] = -1.0;
    let mut start = patent();
    start.initial_covariance[7] = 0.0;
    for (options, name) in [
        (noise, "process_noise"),
        (start, "initial_covariance"),
        (FlowFilterOptions { measurement_noise: 0.0, ..patent() }, "measurement_noise"),
        (FlowFilterOptions { full_scale: f64::NAN, ..patent() }, "full_scale"),
        (FlowFilterOptions { mask: Some(Mask::filled(3, 3, true)), ..patent() }, "mask"),
        (FlowFilterOptions { sites: Sites::Points(vec![(9, 0)]), ..patent() }, "points"),
        (FlowFilterOptions { pixel_pitch: (0.0, 1.0), ..patent() }, "pixel_pitch"),
    ] {
        let text = message((8, 8), options);
        assert!(text.starts_with(name), "{text}");
    }
    assert!(message((2, 8), patent()).contains("frame_size"));
    let mut filter = FlowFilter::<f64>::new((8, 8), patent()).unwrap();
    assert!(filter.push(&texture(8, 9, 0)).unwrap_err().to_string().contains("8 x 9"));
    assert_eq!(filter.frames(), 0);
}

#[test]
fn constant_pictures_and_empty_site_lists_are_no_errors() {
    let mut filter = FlowFilter::<f32>::new((8, 8), FlowFilterOptions::patent()).unwrap();
    for _ in 0..300 {
        let field = filter.push(&Frame::filled(8, 8, 77.0f32)).unwrap();
        assert!(field.affine(27).to_array().iter().all(|v| v.is_finite()));
    }
    let none = FlowFilterOptions { sites: Sites::Points(Vec::new()), ..FlowFilterOptions::patent() };
    let mut filter = FlowFilter::<f32>::new((8, 8), none).unwrap();
    assert!(filter.push(&Frame::filled(8, 8, 1.0)).unwrap().is_empty());
    assert!(FlowFilter::<f32>::from_bytes(&filter.to_bytes().unwrap()).unwrap().is_empty());
}
