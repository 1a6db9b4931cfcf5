//! The dense filter against the generic one and its own other forms.

use super::*;

/// The generic filter with the plain nine-pixel measurement: nothing shared with the dense filter but the
/// system itself.
fn oracle(
    frames: &[Frame<f64>],
    at: (usize, usize),
    form: FilterForm,
    side: usize,
    motion_first: bool,
) -> Vec<(Vec<f64>, Vec<f64>)> {
    use crate::temporal::dynamics::rk4;
    use jacoflow::filter::{SigmaPoints, UnscentedFilter};
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
            let options = FlowFilterOptions {
                form,
                neighbourhood,
                simd: Some(level),
                adaptive: false,
                ..FlowFilterOptions::patent()
            };
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
    let sites = SamplingGrid::Points(vec![(8, 8)]);
    let options = FlowFilterOptions { form: FilterForm::Fast, sites, adaptive: false, ..FlowFilterOptions::patent() };
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
        sites: SamplingGrid::Points(vec![(8, 8)]),
        adaptive: false,
        ..FlowFilterOptions::patent()
    };
    let mut filter = FlowFilter::<f64>::new((16, 16), options).unwrap();
    // The first prediction keeps P0 and adds what the flow of unit variance does to nothing: P = I + Q, mean
    // 0.
    let frame = texture(16, 16, 0);
    filter.push(&frame).unwrap();
    let (mean, covariance) = filter.state(0).unwrap();
    use jacoflow::filter::{KalmanFilter, SigmaPoints, UnscentedFilter};
    let mut ukf = UnscentedFilter::new(1, 12, 1, SigmaPoints::default()).unwrap();
    ukf.Q =
        (0..144).map(|k| if k % 13 == 0 { FlowFilterOptions::patent().process_noise[k / 13] } else { 0.0 }).collect();
    ukf.predict(|q, out| {
        for (q, out) in q.chunks_exact(12).zip(out.chunks_exact_mut(12)) {
            out.copy_from_slice(&crate::temporal::dynamics::rk4(&q.try_into().unwrap(), &[0.0; 12]));
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
                sites: SamplingGrid::Points(vec![(8, 8)]),
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
