//! The first object that moves.

use jacoflow::math::random::CounterRng;
use jacoflow::track::gradient::detect_moving_target;
use jacoflow::types::{Frame, TargetBox};

fn scene(at: [usize; 2], seed: u64) -> Frame<f64> {
    let rng = CounterRng::new(seed);
    Frame::from_fn(96, 80, |x, y| {
        let inside = (at[0]..at[0] + 13).contains(&x) && (at[1]..at[1] + 9).contains(&y);
        let brightness = if inside { 200.0 } else { 90.0 + 20.0 * (0.2 * x as f64).sin() };
        f64::round(brightness + 2.0 * rng.normal((96 * y + x) as u64))
    })
}

#[test]
fn a_square_is_found_with_its_step() {
    for (dx, dy) in [(3, 0), (0, -2), (-2, 1)] {
        let at = [(40 + dx) as usize, (30 + dy) as usize];
        let found = detect_moving_target(&scene([40, 30], 1), &scene(at, 2), None).unwrap();
        assert_eq!(found.displacement, [f64::from(dx), f64::from(dy)], "{found:?}");
        let truth = TargetBox { x: at[0] as f64 - 0.5, y: at[1] as f64 - 0.5, width: 13.0, height: 9.0 };
        assert!(found.bounds.overlap(&truth) > 0.85, "{found:?}");
    }
}

#[test]
fn of_two_that_move_alike_one_is_found() {
    let both = |shift: usize, seed: u64| {
        let (one, two) = (scene([20 + shift, 12], seed), scene([20 + shift, 52], seed + 1));
        Frame::from_fn(96, 80, |x, y| if y < 40 { one.get(x, y) } else { two.get(x, y) })
    };
    let (first, second) = (both(0, 7), both(2, 9));
    for (near, y) in [([28.0, 16.0], 12.0), ([28.0, 56.0], 52.0)] {
        let found = detect_moving_target(&first, &second, Some(near)).unwrap();
        let truth = TargetBox { x: 21.5, y: y - 0.5, width: 13.0, height: 9.0 };
        assert!(found.bounds.overlap(&truth) > 0.8, "{found:?}");
    }
}

#[test]
fn nothing_is_found_where_nothing_moves_and_the_nearer_of_two_otherwise() {
    assert_eq!(detect_moving_target(&scene([40, 30], 1), &scene([40, 30], 2), None), None);
    let both = |a: [usize; 2], b: [usize; 2], seed: u64| {
        let (one, two) = (scene(a, seed), scene(b, seed + 1));
        Frame::from_fn(96, 80, |x, y| if x < 48 { one.get(x, y) } else { two.get(x, y) })
    };
    let (first, second) = (both([10, 20], [70, 50], 3), both([12, 20], [70, 53], 5));
    let found = detect_moving_target(&first, &second, Some([75.0, 55.0])).unwrap();
    assert_eq!(found.displacement, [0.0, 3.0]);
    assert_eq!(detect_moving_target(&first, &second, Some([15.0, 25.0])).unwrap().displacement, [2.0, 0.0]);
    assert_eq!(detect_moving_target(&first, &Frame::filled(4, 4, 0.0), None), None);
}
