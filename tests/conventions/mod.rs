//! What x, y, u, v and the Jacobian's order mean, shown on motions with one parameter only.

use jacoflow::flow::derived::{Quantity, plane};
use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::types::{FlowField, Frame, MOTION_NAMES};

mod dense;
mod error;
mod field;
mod frame;
mod parallel;
mod random;
mod region;
mod special;
mod statistics;
mod status;
mod track;

/// A quadratic carried by the motion `m` about pixel (4, 4), at frames -1, 0, 1, to second order in time.
fn field(m: [f64; 6]) -> FlowField<f64> {
    let [u, v, ux, vx, uy, vy] = m;
    let frames: Vec<Frame<f64>> = (-1..=1)
        .map(|t| {
            let t = f64::from(t);
            Frame::from_fn(9, 9, |x, y| {
                let (dx, dy) = (x as f64 - 4.0, y as f64 - 4.0);
                // One backward step along the flow, with its change on the way.
                let (a, b) = (u + ux * dx + uy * dy, v + vx * dx + vy * dy);
                let (x0, y0) =
                    (dx - t * a + 0.5 * t * t * (ux * a + uy * b), dy - t * b + 0.5 * t * t * (vx * a + vy * b));
                100.0 + 9.0 * x0 - 7.0 * y0 + 2.0 * x0 * x0 + 1.3 * x0 * y0 - 1.6 * y0 * y0
            })
        })
        .collect();
    let estimator = Estimator::new(Method::parse("instantaneous").unwrap(), EstimatorOptions::default()).unwrap();
    estimator.estimate(&[&frames[0], &frames[1], &frames[2]], 0).unwrap()
}

#[test]
fn a_pure_stretch_along_x_gives_only_u_x_and_so_for_each_parameter() {
    for k in 0..6 {
        let mut m = [0.0; 6];
        m[k] = 0.01;
        let field = field(m);
        let got = field.affine(4 * 9 + 4).to_array();
        for j in 0..6 {
            let want = if j == k { 0.01 } else { 0.0 };
            assert!((got[j] - want).abs() < 5e-4, "{} moved, {} = {}", MOTION_NAMES[k], MOTION_NAMES[j], got[j]);
        }
        assert_eq!(field.plane(MOTION_NAMES[k]).unwrap()[40], got[k]);
    }
}

#[test]
fn u_is_along_columns_and_v_along_rows() {
    // A blob that moves one column to the right and half a row down per frame, told by where its brightness
    // goes.
    let blob = |t: f64| {
        Frame::from_fn(21, 21, |x, y| {
            let (dx, dy) = (x as f64 - 10.0 - t, y as f64 - 10.0 - 0.5 * t);
            200.0 * (-(dx * dx + dy * dy) / 128.0).exp()
        })
    };
    let frames = [-0.1, 0.0, 0.1].map(blob);
    let estimator = Estimator::new(Method::parse("instantaneous").unwrap(), EstimatorOptions::default()).unwrap();
    let field = estimator.estimate(&[&frames[0], &frames[1], &frames[2]], 0).unwrap();
    let m = field.affine(13 * 21 + 7);
    assert!((m.u - 0.1).abs() < 0.02 && (m.v - 0.05).abs() < 0.02, "{m:?}");
}

#[test]
fn divergence_and_curl_have_their_signs() {
    let turning = field([0.0, 0.0, 0.0, 0.01, -0.01, 0.0]);
    let growing = field([0.0, 0.0, 0.01, 0.0, 0.0, 0.01]);
    let of = |f: &FlowField<f64>, q| plane(f, q).unwrap()[40];
    // x towards y is positive: clockwise on the screen.
    assert!((of(&turning, Quantity::Curl) - 0.02).abs() < 5e-4 && of(&turning, Quantity::Divergence).abs() < 5e-4);
    assert!((of(&growing, Quantity::Divergence) - 0.02).abs() < 5e-4 && of(&growing, Quantity::Curl).abs() < 5e-4);
    assert!((of(&growing, Quantity::TimeToContact) - 100.0).abs() < 3.0);
}
