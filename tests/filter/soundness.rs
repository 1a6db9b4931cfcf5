//! What is refused, and what is mended.

use jacoflow::error::Error;
use jacoflow::filter::{KalmanFilter, SigmaPoints, UnscentedFilter};

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
