//! Double-frame recordings whose first and second frames have a source each.

use super::FrameSource;
use crate::error::{Error, Result};
use crate::io::planes::PixelSize;

/// Frame n of one source followed by frame n of the other. The frame rate is unknown: that of the sources
/// counts pairs, not the time from the first frame of a pair to its second.
pub struct DoubleFrames {
    sources: [Box<dyn FrameSource>; 2],
    delivered: usize,
}

impl DoubleFrames {
    /// Pairs of frames from `first` and `second`.
    ///
    /// # Errors
    /// [`Error::Argument`] named `input` where one has more frames, as far as that is known without reading.
    pub fn new(first: Box<dyn FrameSource>, second: Box<dyn FrameSource>) -> Result<Self> {
        let sources = Self { sources: [first, second], delivered: 0 };
        if let [Some(a), Some(b)] = [0, 1].map(|which| sources.sources[which].len_hint())
            && a != b
        {
            return Err(sources.unequal([a, b]));
        }
        Ok(sources)
    }

    fn unequal(&self, counts: [usize; 2]) -> Error {
        let [first, second] = [0, 1].map(|which| format!("{} in {}", counts[which], self.sources[which].describe()));
        let expected = "as many frames in both inputs, whose frames are pairs";
        Error::argument("input", expected, format!("{first} and {second}"))
    }
}

impl FrameSource for DoubleFrames {
    fn next_frame(&mut self) -> Result<Option<crate::types::AnyFrame>> {
        let which = self.delivered % 2;
        if let Some(frame) = self.sources[which].next_frame()? {
            self.delivered += 1;
            return Ok(Some(frame));
        }
        let mut counts = [self.delivered.div_ceil(2), self.delivered / 2];
        while self.sources[1 - which].next_frame()?.is_some() {
            counts[1 - which] += 1;
        }
        if counts[0] == counts[1] { Ok(None) } else { Err(self.unequal(counts)) }
    }
    fn len_hint(&self) -> Option<usize> {
        Some(self.sources[0].len_hint()? + self.sources[1].len_hint()?)
    }
    fn pixel_size(&self) -> Option<PixelSize> {
        self.sources[0].pixel_size()
    }
    fn describe(&self) -> String {
        format!("{}, {}", self.sources[0].describe(), self.sources[1].describe())
    }
}
