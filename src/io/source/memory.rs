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
