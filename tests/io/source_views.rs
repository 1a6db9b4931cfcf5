//! Two views of each moment: from two sources, or cut out of frames that hold both.

use jacoflow::io::{FrameSource, MemorySource, ViewLayout, ViewPairs};
use jacoflow::types::{AnyFrame, Frame};

fn source(levels: &[u8]) -> Box<dyn FrameSource> {
    let frames = levels.iter().map(|&level| AnyFrame::U8(Frame::from_fn(2, 1, |x, _| level + x as u8))).collect();
    Box::new(MemorySource::new(frames).unwrap())
}

fn levels(pair: &[AnyFrame; 2]) -> [f32; 2] {
    [0, 1].map(|i| pair[i].to_real::<f32>().get(0, 0))
}

#[test]
fn pairs_come_in_step_and_the_first_view_is_the_left_one() {
    let mut pairs = ViewPairs::separate(source(&[10, 20]), source(&[30, 40]));
    assert_eq!(pairs.len_hint(), Some(2));
    assert_eq!(levels(&pairs.next_pair().unwrap().unwrap()), [10.0, 30.0]);
    assert_eq!(levels(&pairs.next_pair().unwrap().unwrap()), [20.0, 40.0]);
    assert!(pairs.next_pair().unwrap().is_none());
    let mut pairs = ViewPairs::joined(source(&[10]), ViewLayout::SideBySide).with_swapped(true);
    assert_eq!(levels(&pairs.next_pair().unwrap().unwrap()), [11.0, 10.0]);
    let mut uneven = ViewPairs::separate(source(&[10]), source(&[30, 40]));
    uneven.next_pair().unwrap();
    assert!(uneven.next_pair().unwrap_err().to_string().contains("fewer left than right"));
}
