//! A part of a sequence.

use jacoflow::io::{FrameSource, MemorySource, OpenOptions, Selected};
use jacoflow::types::{AnyFrame, Frame};
use proptest::prelude::*;

proptest! {
    #[test]
    fn selects_as_an_iterator_does(n in 0usize..20, start in 0usize..25, step in 1usize..6, stop in proptest::option::of(0usize..40)) {
        let frames: Vec<_> = (0..n).map(|i| AnyFrame::U8(Frame::filled(1, 1, i as u8))).collect();
        let want: Vec<_> = frames.iter().take(stop.unwrap_or(usize::MAX)).skip(start).step_by(step).cloned().collect();
        let options = OpenOptions { start, stop, step, ..OpenOptions::default() };
        let mut source = Selected::new(MemorySource::new(frames).unwrap().with_frame_rate(30.0), &options).unwrap();
        prop_assert_eq!(source.len_hint(), Some(want.len()));
        prop_assert_eq!(source.frame_rate(), Some(30.0 / step as f64));
        let mut got = Vec::new();
        while let Some(frame) = source.next_frame().unwrap() {
            got.push(frame);
        }
        prop_assert_eq!(got, want);
        prop_assert!(source.next_frame().unwrap().is_none());
    }
}
