//! What is refused, what is repaired, and which states fail.

#![allow(non_snake_case, reason = "P, H are the literature's name")]

use jacoflow::error::Error;
use jacoflow::filter::{ExtendedFilter, KalmanFilter, SigmaPoints, UnscentedFilter};
use jacoflow::math::random::CounterRng;
use nalgebra::{DMatrix, DVector};

#[test]
fn a_lost_covariance_is_mended_and_counted() {
    let mut filter = UnscentedFilter::new(1, 2, 1, SigmaPoints::default()).unwrap();
    filter.P = vec![1.0, 1.0 + 1e-9, 1.0 + 1e-9, 1.0];
    filter
        .predict(|p, out| {
            out.copy_from_slice(p);
            Ok(())
        })
        .unwrap();
    assert_eq!(filter.repairs, 1);
    assert!(filter.P.iter().all(|p| p.is_finite()));
    filter.P = vec![f64::NAN; 4];
    assert!(matches!(filter.draw(), Err(Error::Numerical(_))));
}

#[test]
fn a_covariance_lost_in_a_step_is_mended_and_counted() {
    // Points close to the centre, which has a large negative weight: the square's variance comes out
    // negative.
    let near = SigmaPoints::new(1.0, 0.0, -1.9).unwrap();
    let mut filter = UnscentedFilter::new(1, 2, 1, near).unwrap();
    filter.Q = vec![0.0; 4];
    let square = |p: &[f64], out: &mut [f64]| {
        for (p, out) in p.chunks_exact(2).zip(out.chunks_exact_mut(2)) {
            out.copy_from_slice(&[p[0] * p[0], p[1]]);
        }
        Ok(())
    };
    filter.predict(square).unwrap();
    assert_eq!(filter.repairs, 1);
    assert!(filter.P[0] > 0.0 && filter.P[3] > 0.9, "{:?}", filter.P);
    filter
        .update(&[1.0], |p, out| {
            out.iter_mut().zip(p.chunks_exact(2)).for_each(|(z, p)| *z = p[1]);
            Ok(())
        })
        .unwrap();
    assert!(filter.x.iter().chain(&filter.P).all(|v| v.is_finite()));
}

#[test]
fn what_is_no_covariance_is_refused_by_name() {
    let with = |change: &dyn Fn(&mut KalmanFilter)| {
        let mut filter = KalmanFilter::new(2, 2, 1).unwrap();
        (filter.F, filter.H) = (vec![1.0, 1.0, 0.0, 1.0], vec![1.0, 0.0]);
        change(&mut filter);
        let error = filter.predict().and_then(|()| filter.update(&[0.5, 1.0])).unwrap_err();
        assert!(matches!(error, Error::Argument { .. }));
        error.to_string()
    };
    let both = |p: [f64; 4]| [[1.0, 0.0, 0.0, 1.0], p].concat();
    for (name, text) in [
        ("P", with(&|f| f.P = both([1.0, 2.0, 2.0, 1.0]))),
        ("P", with(&|f| f.P = both([1.0, 5.0, 0.0, 1.0]))),
        ("Q", with(&|f| f.Q = vec![-1.0, 0.0, 0.0, 1.0])),
        ("Q", with(&|f| f.Q = vec![1.0, 0.0, 0.0, f64::NAN])),
        ("R", with(&|f| f.R = vec![-1.0])),
        ("x", with(&|f| f.x[2] = f64::INFINITY)),
        ("F", with(&|f| f.F[0] = f64::INFINITY)),
        ("H", with(&|f| f.H[0] = f64::NAN)),
    ] {
        assert!(text.starts_with(name), "{name}: {text}");
    }
    let mut filter = KalmanFilter::new(1, 2, 1).unwrap();
    assert!(filter.update(&[f64::INFINITY]).unwrap_err().to_string().starts_with('z'));
    // Singular covariances are covariances: a state known exactly, noise along one direction.
    (filter.P, filter.Q) = (vec![0.0; 4], vec![0.25, 0.5, 0.5, 1.0]);
    filter.predict().unwrap();
    filter.update(&[1.0]).unwrap();
    assert_eq!(filter.repairs, 0);
    filter.F = vec![1e200, 0.0, 0.0, 1.0];
    assert!(matches!(filter.predict(), Err(Error::Numerical(_))), "an overflow is told");
}

#[test]
fn sizes_beyond_memory_are_refused_by_name() {
    let message = |batch, n, m| KalmanFilter::new(batch, n, m).unwrap_err().to_string();
    for (text, name) in [
        (message(1, 1_000_000, 1), "dim_x"),
        (message(1, 1, usize::MAX), "dim_z"),
        (message(1_000_000_000_000_000, 4, 2), "batch"),
        (message(usize::MAX, 4, 2), "batch"),
        (message(0, 4, 2), "batch"),
    ] {
        assert!(text.starts_with(name), "{name}: {text}");
    }
    let points = SigmaPoints::default();
    assert!(UnscentedFilter::new(1, 5000, 1, points).unwrap_err().to_string().starts_with("dim_x"));
    assert!(points.sigma_points(&[f64::NAN], &[1.0]).unwrap_err().to_string().starts_with('x'));
}

/// Least eigenvalue of the correlations of `(n, n)` matrices; variances must not be negative.
fn least_correlation(P: &[f64], n: usize) -> f64 {
    let of_one = |P: &[f64]| {
        let scale: Vec<f64> = (0..n).map(|k| P[k * (n + 1)].sqrt()).collect();
        assert!(scale.iter().all(|v| *v > 0.0), "{P:?}");
        let correlation = DMatrix::from_fn(n, n, |i, j| P[i * n + j] / scale[i] / scale[j]);
        correlation.symmetric_eigenvalues().min()
    };
    P.chunks_exact(n * n).map(of_one).fold(f64::INFINITY, f64::min)
}

#[test]
fn precise_sensors_of_one_quantity_agree() {
    for (p0, r) in [(1e6, 1e-11), (1e12, 1e-12), (1e6, 1e-13)] {
        let mut filter = KalmanFilter::new(1, 2, 2).unwrap();
        (filter.P, filter.R) = (vec![p0, 0.0, 0.0, p0], vec![r, 0.0, 0.0, r]);
        filter.H = vec![1.0, 0.0, 1.0, 0.0];
        filter.update(&[1.0, 1.0]).unwrap();
        assert!((filter.x[0] - 1.0).abs() < 1e-9 && filter.x[1] == 0.0, "{:?}", filter.x);
        let found = [filter.P[0] / (0.5 * r), filter.P[3] / p0].map(|ratio| (ratio - 1.0).abs());
        assert!(found[0] < 1e-3 && found[1] < 1e-9, "{p0}, {r}: {:?}", filter.P);
    }
}

#[test]
fn many_precise_sensors_leave_the_covariance_of_least_squares() {
    let rng = CounterRng::new(7);
    let H = DMatrix::from_fn(6, 3, |i, j| rng.normal((3 * i + j) as u64));
    for r in [1e-8, 1e-10, 1e-12] {
        let mut filter = KalmanFilter::new(1, 3, 6).unwrap();
        filter.H = H.transpose().as_slice().to_vec();
        (filter.P, filter.R) = ([3, 6].map(|n| DMatrix::<f64>::identity(n, n).as_slice().to_vec())).into();
        filter.P.iter_mut().for_each(|p| *p *= 1e6);
        filter.R.iter_mut().for_each(|noise| *noise *= r);
        filter.update((&H * DVector::from_element(3, 1.0)).as_slice()).unwrap();
        let expected = (H.transpose() * &H).try_inverse().unwrap() * r;
        let found = DMatrix::from_row_slice(3, 3, &filter.P);
        assert!((&found - &expected).amax() < 1e-3 * expected.amax(), "{r}: {found} {expected}");
        assert!(filter.x.iter().all(|x| (x - 1.0).abs() < 1e-9) && filter.repairs == 0, "{r}: {:?}", filter.x);
    }
}

#[test]
fn covariances_stay_definite_however_far_apart_the_noises_are() {
    let step = |p: &[f64], out: &mut [f64]| {
        p.chunks_exact(2).zip(out.chunks_exact_mut(2)).for_each(|(p, q)| q.copy_from_slice(&[p[0] + p[1], p[1]]));
        Ok(())
    };
    let first = |p: &[f64], out: &mut [f64]| {
        p.chunks_exact(2).zip(out).for_each(|(p, z)| *z = p[0]);
        Ok(())
    };
    for (q, r, p0) in [(1e10, 1e-12, 1e12), (0.0, 1e-13, 1e6), (1e-12, 1e-6, 1e12), (1.0, 0.0, 1e6)] {
        let mut unscented = UnscentedFilter::new(1, 2, 1, SigmaPoints::default()).unwrap();
        let mut linear = KalmanFilter::new(1, 2, 1).unwrap();
        (linear.F, linear.H) = (vec![1.0, 1.0, 0.0, 1.0], vec![1.0, 0.0]);
        let mut extended = ExtendedFilter::new(1, 2, 1).unwrap();
        for state in [&mut unscented.state, &mut linear.state, &mut extended.state] {
            (state.Q, state.R) = (vec![q, 0.0, 0.0, q], vec![r]);
            state.P = vec![p0, 0.0, 0.0, p0];
        }
        for t in 0..200 {
            let z = [(0.1 * f64::from(t)).sin()];
            unscented.predict(step).unwrap();
            linear.predict().unwrap();
            extended.predict_by_differences(step).unwrap();
            unscented.update(&z, first).unwrap();
            linear.update(&z).unwrap();
            extended.update_by_differences(&z, first).unwrap();
            for state in [&unscented.state, &linear.state, &extended.state] {
                if r > 0.0 {
                    let least = least_correlation(&state.P, 2);
                    assert!(least > -1e-15, "Q {q} R {r} P0 {p0}, step {t}: {least}, {:?}", state.P);
                }
                assert!(state.P[0] >= 0.0 && state.P[3] >= 0.0, "{:?}", state.P);
                assert_eq!((state.repairs, state.failed[0]), (0, false), "Q {q} R {r} P0 {p0}, step {t}");
            }
        }
        let known = |state: &jacoflow::filter::GaussianState| (state.x[0] - (19.9f64).sin()).abs();
        for state in [&unscented.state, &linear.state, &extended.state] {
            assert!(q < 1.0 || known(state) < 1e-6, "{:?}", state.x);
        }
    }
}

#[test]
fn a_state_that_fails_is_marked_and_the_batch_goes_on() {
    let mut filter = UnscentedFilter::new(3, 2, 1, SigmaPoints::default()).unwrap();
    filter.x[2] = 7.0;
    let mut alone = UnscentedFilter::new(1, 2, 1, SigmaPoints::default()).unwrap();
    let wild = |p: &[f64], out: &mut [f64]| {
        // Seven is where the second state starts.
        p.chunks_exact(2).zip(out.chunks_exact_mut(2)).for_each(|(p, q)| {
            q.copy_from_slice(&[p[0] + p[1], if p[0] > 3.0 { f64::NAN } else { p[1] }]);
        });
        Ok(())
    };
    let first = |p: &[f64], out: &mut [f64]| {
        p.chunks_exact(2).zip(out).for_each(|(p, z)| *z = p[0]);
        Ok(())
    };
    filter.predict(wild).unwrap();
    filter.update(&[0.1, f64::NAN, 0.1], first).unwrap();
    alone.predict(wild).unwrap();
    alone.update(&[0.1], first).unwrap();
    assert_eq!(filter.failed, [false, true, false]);
    assert_eq!((&filter.x[2..4], &filter.P[4..8]), (&[7.0, 0.0][..], &[1.0, 0.0, 0.0, 1.0][..]));
    for (x, P) in filter.x.chunks(2).zip(filter.P.chunks(4)).step_by(2) {
        assert_eq!((x, P), (&alone.x[..], &alone.P[..]));
    }
    // A singular S fails, too: nothing is known better than exactly.
    filter.P[4..8].fill(0.0);
    filter.R = vec![0.0];
    filter.failed[1] = false;
    filter.update(&[0.1, 7.0, 0.1], first).unwrap();
    assert_eq!(filter.failed, [false, true, false]);
    // When every state fails, the reason is reported and nothing changes.
    let before = filter.clone();
    let all = |_: &[f64], out: &mut [f64]| {
        out.fill(f64::INFINITY);
        Ok(())
    };
    assert!(filter.predict(all).unwrap_err().to_string().starts_with("fx"));
    assert_eq!(filter, before);
}
