//! Two views of each moment: from two sources, or cut out of frames that hold both.

use jacoflow::error::Result;
use jacoflow::io::{DoubleFrames, FrameSource, MemorySource, ViewLayout, ViewPairs};
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

/// A source that does not know how many frames it has.
struct Stream(Box<dyn FrameSource>);

impl FrameSource for Stream {
    fn next_frame(&mut self) -> Result<Option<AnyFrame>> {
        self.0.next_frame()
    }
    fn describe(&self) -> String {
        "stream".into()
    }
}

#[test]
fn double_frames_alternate_and_must_be_as_many() {
    let stream = |levels: &[u8]| -> Box<dyn FrameSource> { Box::new(Stream(source(levels))) };
    let read = |mut both: DoubleFrames| -> Result<Vec<f32>> {
        let mut found = Vec::new();
        while let Some(frame) = both.next_frame()? {
            found.push(frame.to_real::<f32>().get(0, 0));
        }
        Ok(found)
    };
    for both in [[source(&[1, 2]), source(&[5, 6])], [stream(&[1, 2]), stream(&[5, 6])]] {
        let [first, second] = both;
        assert_eq!(read(DoubleFrames::new(first, second).unwrap()).unwrap(), [1.0, 5.0, 2.0, 6.0]);
    }
    let known = DoubleFrames::new(source(&[1, 2]), source(&[5])).err().unwrap().to_string();
    assert!(known.contains("got 2 in 2 frames in memory and 1 in 1 frames in memory"), "{known}");
    for (first, second) in [(3, 1), (1, 3), (2, 3)] {
        let both = DoubleFrames::new(stream(&vec![1; first]), stream(&vec![5; second])).unwrap();
        let words = read(both).unwrap_err().to_string();
        assert!(words.contains(&format!("got {first} in stream and {second} in stream")), "{words}");
    }
}

#[test]
fn frames_are_cut_in_halves() {
    let frame = Frame::from_fn(4, 2, |x, y| (10 * y + x) as u8);
    let [left, right] = ViewLayout::SideBySide.cut(&frame).unwrap();
    assert_eq!((left.data(), right.data()), (&[0, 1, 10, 11][..], &[2, 3, 12, 13][..]));
    let [upper, lower] = ViewLayout::TopBottom.cut(&frame).unwrap();
    assert_eq!((upper.data(), lower.data()), (&[0, 1, 2, 3][..], &[10, 11, 12, 13][..]));
    let odd = ViewLayout::SideBySide.cut(&Frame::filled(3, 2, 0u8)).unwrap_err();
    assert!(odd.to_string().starts_with("layout: "));
}

#[test]
fn squeezed_views_are_stretched_again() {
    let frame = Frame::new(4, 2, vec![0.0f32, 8.0, 40.0, 48.0, 80.0, 88.0, 120.0, 160.0]).unwrap();
    let [left, right] = ViewLayout::HalfSideBySide.cut(&frame).unwrap();
    assert_eq!((left.size(), left.row(0)), ((4, 2), &[0.0, 2.0, 6.0, 8.0][..]));
    assert_eq!(right.row(1), [120.0, 130.0, 150.0, 160.0]);
    let [upper, lower] = ViewLayout::HalfTopBottom.cut(&frame).unwrap();
    assert_eq!((upper.size(), upper.row(1)), ((4, 2), &[0.0, 8.0, 40.0, 48.0][..]));
    assert_eq!(lower.row(0), [80.0, 88.0, 120.0, 160.0]);
    // A ramp comes back as it was squeezed, but for the ends.
    let ramp = Frame::from_fn(8, 1, |x, _| (10 * x) as u8);
    let squeezed = Frame::from_fn(8, 1, |x, _| (20 * (x % 4) + 5) as u8);
    let [again, _] = ViewLayout::HalfSideBySide.cut(&squeezed).unwrap();
    assert_eq!(again.data()[1..7], ramp.data()[1..7]);
    assert!(ViewLayout::HalfSideBySide.cut(&Frame::filled(3, 2, 0u8)).is_err());
}
