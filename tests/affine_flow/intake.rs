//! What every method makes of masked samples and of brightness of any magnitude.

use super::*;
use jacoflow::flow::METHODS;

macro_rules! field {
    ($name:expr, $frames:expr, $mask:expr) => {{
        let method = Method::parse($name).unwrap();
        let common = EstimatorOptions {
            mask: $mask,
            covariance: method.info().has_covariance,
            diagnostics: true,
            ..EstimatorOptions::default()
        };
        let estimator = Estimator::new(method, common).unwrap();
        let frames: Vec<_> = $frames.iter().take(estimator.frames_needed()).collect();
        estimator.estimate(&frames, 0).unwrap()
    }};
}

#[test]
fn what_masked_samples_hold_changes_no_bit() {
    let clean: Vec<Frame<f32>> = texture(21).iter().map(|f| f.map(|&v| v as f32)).collect();
    let mask = Mask::from_fn(60, 50, |x, y| !((20..26).contains(&x) && (18..30).contains(&y)) && x + y > 6);
    for info in METHODS {
        let want = field!(info.name, clean, Some(mask.clone()));
        let known = want.status.iter().filter(|&&status| status == Status::Ok).count();
        assert!(known > 1000, "{}: {known} sites", info.name);
        for fill in [9.97e36, 1e20, -1e9, f32::NAN, f32::INFINITY] {
            let filled: Vec<Frame<f32>> = (clean.iter())
                .map(|f| Frame::from_fn(60, 50, |x, y| if mask.get(x, y) { f.get(x, y) } else { fill }))
                .collect();
            let got = field!(info.name, filled, Some(mask.clone()));
            assert_eq!(bits(&got), bits(&want), "{} {fill}", info.name);
            assert_eq!(format!("{:?}", got.covariance), format!("{:?}", want.covariance), "{} {fill}", info.name);
        }
    }
}

#[test]
fn the_unit_of_brightness_changes_no_flow() {
    let double = texture(22);
    let single: Vec<Frame<f32>> = double.iter().map(|f| f.map(|&v| v as f32)).collect();
    for info in METHODS {
        let (want, fine) = (field!(info.name, single, None), field!(info.name, double, None));
        // Powers of two: scaling does not round.
        for exponent in [30, 90, -40, -100] {
            let factor = f32::powi(2.0, exponent);
            let scaled: Vec<Frame<f32>> = single.iter().map(|f| f.map(|&v| v * factor)).collect();
            let got = field!(info.name, scaled, None);
            assert_eq!(bits(&got).1, bits(&want).1, "{} 2^{exponent}", info.name);
            same(&got, &want, f64::from(factor), 1e-4, info.name);
        }
        for exponent in [266, -200] {
            let factor = f64::powi(2.0, exponent);
            let scaled: Vec<Frame<f64>> = double.iter().map(|f| f.map(|&v| v * factor)).collect();
            let got = field!(info.name, scaled, None);
            same(&got, &fine, factor, 1e-9, info.name);
        }
    }
}

/// Asserts equal motion and covariance, and residuals that differ by `factor`.
fn same<T: jacoflow::math::Real>(got: &FlowField<T>, want: &FlowField<T>, factor: f64, tolerance: f64, name: &str) {
    let close = |a: &[T], b: &[T], unit: f64| {
        let far = a.iter().zip(b).find(|(a, b)| {
            let (a, b) = (a.to_f64() / unit, b.to_f64());
            !(a.is_nan() && b.is_nan() || (a - b).abs() <= tolerance * (1e-3 + b.abs()))
        });
        assert!(far.is_none(), "{name} {factor:e}: {far:?}");
    };
    close(&got.motion, &want.motion, 1.0);
    if let Some((a, b)) = got.covariance.as_ref().zip(want.covariance.as_ref()) {
        close(a, b, 1.0);
    }
    if let Some((a, b)) = got.residual.as_ref().zip(want.residual.as_ref()) {
        close(a, b, factor);
    }
}
