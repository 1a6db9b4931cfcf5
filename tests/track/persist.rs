//! Trackers as bytes: they go on as they would have.

use jacoflow::track::gradient::{GradientOptions, Start};
use jacoflow::track::stereo::{StereoMode, StereoTrackerOptions};
use jacoflow::track::{GradientTracker, StereoTracker, Tracker};
use jacoflow::types::{Frame, TargetBox};

/// A textured square that moves by two pixels a frame before a textured scene, hidden in frames 6 and 7.
fn frame(t: usize) -> Frame<f64> {
    let texture = |x: usize, y: usize| (((x * 7919 + y * 104_729) ^ (x * y * 31)) % 97) as f64;
    Frame::from_fn(96, 72, |x, y| {
        let inside = (20 + 2 * t..44 + 2 * t).contains(&x) && (24..48).contains(&y) && !(6..8).contains(&t);
        if inside { 120.0 + texture(x - 2 * t, y) } else { 0.5 * texture(x / 3, y / 3) }
    })
}

/// Goes on with the tracker and with a copy made after each of the first steps.
fn go_on(mut tracker: GradientTracker) {
    let mut copies = vec![GradientTracker::from_bytes(&tracker.to_bytes()).unwrap()];
    for t in 1..14 {
        let state = tracker.update(&frame(t)).unwrap();
        for copy in &mut copies {
            let other = copy.update(&frame(t)).unwrap();
            assert_eq!((other.position, other.status, &other.reason), (state.position, state.status, &state.reason));
            assert_eq!(copy.to_bytes(), tracker.to_bytes());
        }
        copies.push(GradientTracker::from_bytes(&tracker.to_bytes()).unwrap());
    }
}

#[test]
#[cfg_attr(feature = "reference", expect(clippy::default_trait_access, reason = "its type is private"))]
fn a_restored_gradient_tracker_goes_on_bit_for_bit() {
    let bounds = TargetBox { x: 19.5, y: 23.5, width: 24.0, height: 24.0 };
    for start in [Start::Box(bounds), Start::Centre([32.0, 36.0]), Start::Motion] {
        go_on(GradientTracker::new(&frame(0), start, &GradientOptions::default()).unwrap());
    }
    #[cfg(feature = "reference")]
    go_on(GradientTracker::reference(&frame(0), Start::Box(bounds), &Default::default()).unwrap());
}

#[test]
fn a_restored_stereo_tracker_goes_on_bit_for_bit() {
    for mode in [StereoMode::Improved, StereoMode::Paper] {
        let options = StereoTrackerOptions::new(mode).with_disparities([-4, 8]);
        let mut tracker = StereoTracker::new(StereoTrackerOptions { n_components: 4, ..options }).unwrap();
        let mut copies = vec![StereoTracker::from_bytes(&tracker.to_bytes()).unwrap()];
        let view = |t: usize, shift: usize| {
            let whole = frame(t);
            Frame::from_fn(88, 72, |x, y| whole.get(x + shift, y) as f32)
        };
        for t in 0..4 {
            let step = tracker.update(&view(t, 0), &view(t, 3)).unwrap();
            for copy in &mut copies {
                let other = copy.update(&view(t, 0), &view(t, 3)).unwrap();
                assert_eq!((other.labels, other.row_offset), (step.labels.clone(), step.row_offset));
                assert_eq!(copy.to_bytes(), tracker.to_bytes());
            }
            copies.push(StereoTracker::from_bytes(&tracker.to_bytes()).unwrap());
        }
        assert!(tracker.graph().nodes().count() > 0);
    }
}

#[test]
fn damaged_bytes_and_those_of_another_tracker_are_refused() {
    let tracker = GradientTracker::new(&frame(0), Start::Motion, &GradientOptions::default()).unwrap();
    let bytes = tracker.to_bytes();
    for at in (0..bytes.len()).step_by(1 + bytes.len() / 53) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x41;
        for bytes in [&damaged[..], &bytes[..at]] {
            let message = GradientTracker::from_bytes(bytes).unwrap_err().to_string();
            assert!(message.starts_with("state: expected the bytes of a pickled gradient tracker"), "{message}");
        }
    }
    assert!(StereoTracker::from_bytes(&bytes).is_err());
}
