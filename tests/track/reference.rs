//! Parts of the paper's loop of the gradient tracker (feature `reference`): derivative masks, local flow.

use jacoflow::math::random::CounterRng;
use jacoflow::track::gradient::reference::{KernelMask, LocalFlowOptions, derivative_kernels, local_flow};
use jacoflow::types::Frame;

fn apply(mask: &KernelMask, f: impl Fn(f64, f64) -> f64) -> f64 {
    let rows = mask.iter().enumerate();
    let terms = rows.flat_map(|(j, row)| row.iter().enumerate().map(move |(i, weight)| (weight, i, j)));
    terms.map(|(weight, i, j)| weight * f(i as f64 - 2.0, j as f64 - 2.0)).sum()
}

#[test]
fn masks_are_exact_for_every_monomial_up_to_their_degree() {
    for order in 1..=4usize {
        let k = derivative_kernels(order);
        for (a, b) in (0..=order as i32).flat_map(|n| (0..=n).map(move |b| (n - b, b))) {
            let f = |x: f64, y: f64| x.powi(a) * y.powi(b);
            assert!((apply(&k.value, f) - f64::from((a, b) == (0, 0))).abs() < 1e-11, "{order} {a} {b}");
            assert!((apply(&k.x, f) - f64::from((a, b) == (1, 0))).abs() < 1e-11, "{order} {a} {b}");
            assert!((apply(&k.y, f) - f64::from((a, b) == (0, 1))).abs() < 1e-11, "{order} {a} {b}");
        }
    }
}

#[test]
fn masks_are_those_of_the_literature() {
    let ramp = [[-2.0, -1.0, 0.0, 1.0, 2.0]; 5];
    let cubic = [
        [31.0, -44.0, 0.0, 44.0, -31.0],
        [-5.0, -62.0, 0.0, 62.0, 5.0],
        [-17.0, -68.0, 0.0, 68.0, 17.0],
        [-5.0, -62.0, 0.0, 62.0, 5.0],
        [31.0, -44.0, 0.0, 44.0, -31.0],
    ];
    for order in 1..=4 {
        let k = derivative_kernels(order);
        let (want, over) = if order < 3 { (&ramp, 50.0) } else { (&cubic, 420.0) };
        for (y, x) in (0..5).flat_map(|y| (0..5).map(move |x| (y, x))) {
            assert!((k.x[y][x] - want[y][x] / over).abs() < 1e-12 && (k.y[x][y] - k.x[y][x]).abs() < 1e-13);
        }
    }
    assert!(derivative_kernels(1).value.iter().flatten().all(|weight| (weight - 0.04).abs() < 1e-12));
    for (got, want) in derivative_kernels(4).value[2].iter().zip([0.078367, 0.200816, 0.441633, 0.200816, 0.078367]) {
        assert!((got - want).abs() < 1e-6);
    }
}

/// A texture, as it is where it was moved by `(u, v)`.
fn texture(u: f64, v: f64) -> Frame<f64> {
    Frame::from_fn(40, 32, |x, y| {
        let (x, y) = (x as f64 - u, y as f64 - v);
        128.0 + 30.0 * (0.5 * x + 0.2 * y).sin() + 25.0 * (0.35 * y - 0.3 * x).cos() + 10.0 * (0.6 * y).sin()
    })
}

#[test]
fn a_small_shift_is_found_with_its_sign() {
    let options = LocalFlowOptions { min_sigma: 0.5, ..LocalFlowOptions::default() };
    let found = local_flow(&texture(0.0, 0.0), &texture(0.3, -0.2), &options);
    let middle = found.flow.get(20, 16);
    assert!((middle[0] - 0.3).abs() < 0.03 && (middle[1] + 0.2).abs() < 0.03, "{middle:?}");
    // Masks and window need 5 px to each side.
    assert!(found.accepted.get(20, 16) && !found.accepted.get(3, 16) && found.flow.get(4, 16)[0].is_nan());
    let mean = found.mean(0.25);
    assert!((mean.velocity[0] - 0.3).abs() < 0.03 && (mean.centroid[0] - 19.5).abs() < 3.0, "{mean:?}");
    assert!(mean.count > 200, "{mean:?}");
}

#[test]
fn flat_and_noisy_pictures_are_refused_and_nan_stays_where_it_is() {
    let flat = Frame::filled(30, 30, 90.0);
    assert!(local_flow(&flat, &flat, &LocalFlowOptions::default()).mean(0.5).count == 0);
    let noisy = |seed: u64| {
        let rng = CounterRng::new(seed);
        Frame::from_fn(60, 60, |x, y| f64::round(90.0 + 2.0 * rng.normal((60 * y + x) as u64)))
    };
    let count = |min_sigma: f64| {
        let options = LocalFlowOptions { min_sigma, ..LocalFlowOptions::default() };
        local_flow(&noisy(1), &noisy(2), &options).mean(0.5).count
    };
    assert!(count(0.0) > 500 && count(2.5) == 0);
    let (first, second) = (texture(0.0, 0.0), texture(0.3, -0.2));
    let mut broken = second.clone();
    broken.row_mut(10)[10] = f64::NAN;
    let [whole, holed] = [&second, &broken].map(|s| local_flow(&first, s, &LocalFlowOptions::default()));
    assert!(holed.flow.get(10, 10)[0].is_nan() && !holed.accepted.get(10, 10));
    assert_eq!(holed.flow.get(25, 20), whole.flow.get(25, 20));
}

#[test]
fn tiny_frames_have_no_flow() {
    for (width, height) in [(0, 0), (1, 1), (4, 30), (9, 9)] {
        let frame = Frame::filled(width, height, 1.0);
        let found = local_flow(&frame, &frame, &LocalFlowOptions::default());
        assert!(found.accepted.data().iter().all(|a| !a) && found.mean(0.5).count == 0);
    }
}
