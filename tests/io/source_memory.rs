//! Frames that are already in memory.

use jacoflow::io::{FrameSource, MemorySource};
use jacoflow::types::{AnyColourFrame, AnyFrame, Frame};

#[test]
fn frames_come_in_order_and_must_agree() {
    let frame = |v| AnyFrame::U8(Frame::filled(3, 2, v));
    let mut source = MemorySource::new(vec![frame(1), frame(2)]).unwrap().with_frame_rate(25.0);
    assert_eq!((source.len_hint(), source.frame_rate()), (Some(2), Some(25.0)));
    assert_eq!(source.next_frame().unwrap(), Some(frame(1)));
    assert_eq!(source.skip(5).unwrap(), 1);
    assert_eq!(source.next_frame().unwrap(), None);
    let odd = MemorySource::new(vec![frame(1), AnyFrame::U8(Frame::filled(2, 3, 0))]).unwrap_err();
    assert!(odd.to_string().contains("index 1"), "{odd}");
    assert!(MemorySource::new(vec![frame(1), AnyFrame::U16(Frame::filled(3, 2, 0))]).is_err());
    assert!(MemorySource::<AnyFrame>::new(vec![]).unwrap().next_frame().unwrap().is_none());
}

#[test]
fn colour_frames_are_frames() {
    let frame = |v| AnyColourFrame::F32(Frame::filled(3, 2, [v, 0.0, 1.0]));
    let mut source = MemorySource::new(vec![frame(0.5), frame(0.25)]).unwrap();
    assert_eq!(source.skip(1).unwrap(), 1);
    assert_eq!(source.next_frame().unwrap(), Some(frame(0.25)));
    let odd = AnyColourFrame::U8(Frame::filled(3, 2, [0; 3]));
    assert!(MemorySource::new(vec![frame(0.5), odd]).unwrap_err().to_string().contains("uint8 at index 1"));
}
