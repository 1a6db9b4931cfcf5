//! Frames that are already in memory.

use super::FrameSource;
use crate::error::{Error, Result};
use crate::io::channels::FrameFormat;
use crate::types::AnyFrame;

/// A list of frames of one size and sample type, all grey or all colour.
#[derive(Debug)]
pub struct MemorySource<F = AnyFrame> {
    frames: std::vec::IntoIter<F>,
    frame_rate: Option<f64>,
}

impl<F: FrameFormat> MemorySource<F> {
    /// A source of these frames, in this order.
    ///
    /// # Errors
    /// [`Error::Argument`] named `frames` when they differ in size or sample type.
    pub fn new(frames: Vec<F>) -> Result<Self> {
        if let Some((index, odd)) =
            frames.iter().enumerate().find(|(_, f)| f.size() != frames[0].size() || f.dtype() != frames[0].dtype())
        {
            let spell = |f: &F| format!("{} x {} {}", f.size().0, f.size().1, f.dtype());
            let expected = format!("frames of one size and type, {} as the first", spell(&frames[0]));
            return Err(Error::argument("frames", expected, format!("{} at index {index}", spell(odd))));
        }
        Ok(Self { frames: frames.into_iter(), frame_rate: None })
    }

    /// The same with a frame rate, in frames per second.
    pub fn with_frame_rate(mut self, frame_rate: f64) -> Self {
        self.frame_rate = Some(frame_rate);
        self
    }
}

impl<F: FrameFormat> FrameSource<F> for MemorySource<F> {
    fn next_frame(&mut self) -> Result<Option<F>> {
        Ok(self.frames.next())
    }
    fn len_hint(&self) -> Option<usize> {
        Some(self.frames.len())
    }
    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }
    fn describe(&self) -> String {
        format!("{} frames in memory", self.frames.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{AnyColourFrame, Frame};

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
}
