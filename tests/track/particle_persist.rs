//! States of the particle tracker as bytes.

use jacoflow::math::random::CounterRng;
use jacoflow::track::particle::{ParticleOptions, ParticleTracker, StepRecord};
use jacoflow::types::{AnyColourFrame, Frame, TargetBox};

/// A textured picture moving by one pixel a frame, of any sample type.
fn frame(t: usize) -> AnyColourFrame {
    let rng = CounterRng::new(3);
    AnyColourFrame::F32(Frame::from_fn(64, 48, |x, y| {
        let at = |c: u64| rng.uniform((((x + t) / 3 * 97 + y / 3) * 3) as u64 + c) as f32;
        if (x, y) == (0, 0) { [f32::NAN; 3] } else { [at(0), at(1), at(2)] }
    }))
}

fn tracker() -> ParticleTracker {
    let boxes = [(3, TargetBox { x: 20.0, y: 10.0, width: 12.0, height: 20.0 })];
    let options = ParticleOptions { n_particles: 40, n_near: 60, ..ParticleOptions::default() };
    let mut tracker = ParticleTracker::new(&frame(0), &boxes, &options).unwrap();
    tracker.update(&frame(1)).unwrap();
    tracker
}

#[test]
fn a_restored_tracker_goes_on_bit_for_bit() {
    let mut one = tracker();
    let mut other = ParticleTracker::from_bytes(&one.to_bytes()).unwrap();
    for t in 2..5 {
        one.update(&frame(t)).unwrap();
        other.update(&frame(t)).unwrap();
        // Steps hold NaN, which is not equal to itself; bytes are.
        assert_eq!(one.to_bytes(), other.to_bytes());
        assert_eq!(one.step().targets[0].state.reason, other.step().targets[0].state.reason);
    }
    let record = one.record();
    let copy = StepRecord::from_bytes(&record.to_bytes()).unwrap();
    assert_eq!(copy.to_bytes(), record.to_bytes());
    assert_eq!(copy.foreground().unwrap(), record.foreground().unwrap());
    assert_eq!(copy.segments().unwrap().labels, record.segments().unwrap().labels);
}

#[test]
fn damage_is_refused() {
    let bytes = tracker().to_bytes();
    for at in (0..bytes.len()).step_by(1 + bytes.len() / 97) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x41;
        for bytes in [&damaged[..], &bytes[..at]] {
            let message = ParticleTracker::from_bytes(bytes).unwrap_err().to_string();
            assert!(message.starts_with("state: expected "), "{message}");
        }
    }
    assert!(StepRecord::from_bytes(&bytes).is_err());
    // A true checksum over nonsense: an error, too.
    for length in 0..40 {
        let nonsense: Vec<u8> = (0..length).map(|k| (k * 37 + 11) as u8).collect();
        // Mark and layout are six bytes.
        let mut bytes = [&bytes[..6], &nonsense].concat();
        let fnv = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        let checksum = bytes.iter().fold(0xcbf2_9ce4_8422_2325, fnv);
        bytes.extend(checksum.to_le_bytes());
        let message = ParticleTracker::from_bytes(&bytes).unwrap_err().to_string();
        assert!(!message.contains("checksum"), "{message}");
    }
}
