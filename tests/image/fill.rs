//! Holes filled from their surroundings.

use jacoflow::image::{fill_holes, usable_pixels};
use jacoflow::parallel::Threads;
use jacoflow::types::Frame;
use std::borrow::Cow;

fn surface(width: usize, height: usize) -> Frame<f64> {
    Frame::from_fn(width, height, |x, y| 100.0 + 20.0 * (x as f64 * 0.05).sin() + 15.0 * (y as f64 * 0.04).cos())
}

#[test]
fn frames_without_holes_are_not_copied() {
    let frame = surface(20, 10);
    assert!(matches!(fill_holes(&frame, None), Cow::Borrowed(_)));
    assert!(matches!(fill_holes(&frame, Some(&Frame::filled(20, 10, true))), Cow::Borrowed(_)));
    assert!(matches!(fill_holes(&Frame::<f32>::default(), None), Cow::Borrowed(_)));
}

#[test]
fn usable_pixels_stay_and_holes_become_smooth() {
    let (truth, inside) = (surface(90, 70), |x: usize, y: usize| (20..44).contains(&x) && (30..50).contains(&y));
    let mut frame = truth.clone();
    for (i, bad) in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].into_iter().enumerate() {
        frame.row_mut(5)[7 * i] = bad;
    }
    let mask = Frame::from_fn(90, 70, |x, y| !inside(x, y));
    for y in 30..50 {
        frame.row_mut(y)[20..44].fill(-1e9);
    }
    let filled = fill_holes(&frame, Some(&mask));
    for y in 0..70 {
        for x in 0..90 {
            let (got, want) = (filled.get(x, y), truth.get(x, y));
            if inside(x, y) {
                assert!((got - want).abs() < 12.0, "{x}, {y}: {got} {want}");
            } else if frame.get(x, y).is_finite() {
                assert_eq!(got, want);
            } else {
                assert!((got - want).abs() < 1.5, "{x}, {y}: {got} {want}");
            }
        }
    }
    // No edge at the hole's rim or inside.
    for y in 30..50 {
        assert!((19..44).all(|x| (filled.get(x + 1, y) - filled.get(x, y)).abs() < 6.0), "row {y}");
    }
}

#[test]
fn a_constant_is_filled_with_itself_and_nothing_with_zero() {
    for (w, h) in [(1, 1), (1, 9), (7, 2), (33, 18)] {
        let mut frame = Frame::filled(w, h, 7.25f32);
        let mask = usable_pixels(&frame, None);
        frame.data_mut()[w * h / 2..].fill(f32::NAN);
        let want = if w * h == 1 { 0.0 } else { 7.25 };
        assert!(fill_holes(&frame, Some(&mask)).data().iter().all(|&v| v == want), "{w} x {h}");
        assert!(fill_holes(&frame, Some(&Frame::filled(w, h, false))).data().iter().all(|&v| v == 0.0));
    }
}

#[test]
fn the_largest_numbers_do_not_overflow() {
    let mut frame = Frame::filled(9, 9, 0.9 * f32::MAX);
    frame.row_mut(4)[4] = f32::NAN;
    assert!(fill_holes(&frame, None).data().iter().all(|v| v.is_finite()));
}

#[test]
fn usable_are_the_finite_and_allowed() {
    let frame = Frame::new(4, 1, vec![1.0, f64::NAN, 3.0, f64::INFINITY]).unwrap();
    let mask = Frame::new(4, 1, vec![true, true, false, true]).unwrap();
    assert_eq!(usable_pixels(&frame, Some(&mask)).data(), &[true, false, false, false]);
    assert_eq!(usable_pixels(&frame, None).data(), &[true, false, true, false]);
}

#[test]
fn threads_do_not_matter() {
    let frame = surface(65, 130).map(|&v| if (v * 1e3) as i64 % 3 == 0 { f64::NAN } else { v });
    let [one, two] = [1, 2].map(|n| Threads::new(Some(n)).unwrap().install(|| fill_holes(&frame, None).into_owned()));
    assert_eq!(one, two);
    assert!(one.data().iter().all(|v| v.is_finite()));
}
