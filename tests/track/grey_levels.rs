//! Frames on the scale of the thresholds.

use jacoflow::track::GreyLevels;
use jacoflow::types::{AnyFrame, Frame};

fn levels(first: &AnyFrame, frame: &AnyFrame) -> Vec<f64> {
    GreyLevels::decide(first).convert(frame).into_data()
}

#[test]
fn white_is_255_for_every_type() {
    let bytes = AnyFrame::U8(Frame::new(3, 1, vec![0, 7, 255]).unwrap());
    let words = AnyFrame::U16(Frame::new(3, 1, vec![0, 7 * 257, 65535]).unwrap());
    let singles = AnyFrame::F32(Frame::new(3, 1, vec![0.0, 0.5, 1.0]).unwrap());
    assert_eq!(levels(&bytes, &bytes), [0.0, 7.0, 255.0]);
    for (got, want) in levels(&words, &words).into_iter().zip([0.0, 7.0, 255.0]) {
        assert!((got - want).abs() < 1e-12);
    }
    assert_eq!(levels(&singles, &singles), [0.0, 127.5, 255.0]);
}

#[test]
fn floats_beside_bytes_decide_for_themselves() {
    let bytes = AnyFrame::U8(Frame::new(1, 1, vec![7]).unwrap());
    let (shares, grey) = (AnyFrame::F32(Frame::filled(1, 1, 0.5)), AnyFrame::F64(Frame::filled(1, 1, 50.0)));
    for (pair, white) in [([bytes.clone(), shares.clone()], 255.0), ([grey, shares], 1.0)] {
        let together = GreyLevels::decide_together(&pair);
        assert_eq!(together.convert(&pair[1]).into_data(), [0.5 * white]);
    }
    assert_eq!(GreyLevels::decide_together(std::slice::from_ref(&bytes)).convert(&bytes).into_data(), [7.0]);
}

/// What .5 in the last of 320 x 240 pixels becomes, where `shown` says what is in the others.
fn beside(shown: impl Fn(usize, usize) -> f64) -> f64 {
    let frame = AnyFrame::F64(Frame::from_fn(320, 240, |x, y| if (x, y) == (319, 239) { 0.5 } else { shown(x, y) }));
    levels(&frame, &frame)[320 * 240 - 1]
}

#[test]
fn hot_patches_do_not_decide() {
    for (side, hot) in [(1, 2.0), (9, 1.6), (9, 200.0), (27, 1.6), (80, 1.6)] {
        let inside = |x: usize, y: usize| x < side && y < side;
        assert_eq!(beside(|x, y| if inside(x, y) { hot } else { 0.2 + 0.002 * x as f64 }), 127.5, "{side} {hot}");
    }
    // On black a small patch decides if it is far above white: a small object rather than hot pixels.
    let inside = |x: usize, y: usize| x < 9 && y < 9;
    assert_eq!(beside(|x, y| if inside(x, y) { 1.6 } else { 0.0 }), 127.5);
    assert_eq!(beside(|x, y| if inside(x, y) { 160.0 } else { 0.0 }), 0.5);
    let infinite = AnyFrame::F32(Frame::new(2, 1, vec![f32::INFINITY, 0.5]).unwrap());
    assert_eq!(levels(&infinite, &infinite)[1], 127.5);
}

#[test]
fn grey_levels_are_known_in_the_dark_too() {
    let away = |x: usize, y: usize| ((x as f64 - 160.0).powi(2) + (y as f64 - 120.0).powi(2)) / 50.0;
    // A smooth spot on black, a small bright object before a dim background, and a dim picture.
    assert_eq!(beside(|x, y| 200.0 * (-away(x, y)).exp()), 0.5);
    assert_eq!(beside(|x, y| if away(x, y) < 9.0 { 180.0 } else { 0.7 }), 0.5);
    assert_eq!(beside(|x, _| 1.0 + 0.02 * x as f64), 0.5);
}

#[test]
fn a_sequence_that_begins_with_black_has_the_scale_of_what_follows() {
    let frame =
        |gain: f64| AnyFrame::F32(Frame::from_fn(64, 48, |x, y| (gain * ((7 * x + 13 * y) % 256) as f64) as f32));
    for black in [0.0, 0.005] {
        let begun = GreyLevels::decide(&frame(black));
        let gain = |later: &AnyFrame| begun.revised(std::slice::from_ref(later)).gain(later);
        assert_eq!(gain(&frame(1.0)), 1.0, "{black}");
        assert_eq!(gain(&frame(1.0 / 255.0)), 255.0, "{black}");
    }
    // What is known to be grey levels stays it, however dark.
    let known = GreyLevels::decide(&frame(1.0)).revised(&[frame(0.005)]);
    assert_eq!(known.gain(&frame(0.005)), 1.0);
}

#[test]
fn the_first_frame_decides_for_floats() {
    let dark = AnyFrame::F64(Frame::new(2, 1, vec![f64::NAN, 1.2]).unwrap());
    let bright = AnyFrame::F64(Frame::new(2, 1, vec![1.0, 200.0]).unwrap());
    assert_eq!(levels(&bright, &dark)[1], 1.2);
    assert!(levels(&bright, &dark)[0].is_nan());
    assert_eq!(levels(&dark, &bright), [255.0, 51000.0]);
}
