//! A part of a sequence.

use super::{FrameSource, OpenOptions};
use crate::error::{Error, Result};

/// The frames `start`, `start + step`, ... below `stop` of another source.
#[derive(Debug)]
pub struct Selected<S> {
    inner: S,
    /// Frames to pass over before the next one.
    gap: usize,
    step: usize,
    left: Option<usize>,
}

impl<S> Selected<S> {
    /// The part of `inner` that `options` selects.
    ///
    /// # Errors
    /// [`Error::Argument`] for a step of 0.
    pub fn new(inner: S, options: &OpenOptions) -> Result<Self> {
        if options.step == 0 {
            return Err(Error::argument("step", "a positive integer", 0));
        }
        let left = options.stop.map(|stop| stop.saturating_sub(options.start).div_ceil(options.step));
        Ok(Self { inner, gap: options.start, step: options.step, left })
    }
}

impl<F, S: FrameSource<F>> FrameSource<F> for Selected<S> {
    fn next_frame(&mut self) -> Result<Option<F>> {
        if self.left == Some(0) || self.inner.skip(self.gap)? < self.gap {
            self.left = Some(0);
            return Ok(None);
        }
        let frame = self.inner.next_frame()?;
        self.gap = self.step - 1;
        self.left = match frame {
            Some(_) => self.left.map(|n| n - 1),
            None => Some(0),
        };
        Ok(frame)
    }
    fn len_hint(&self) -> Option<usize> {
        let inside = self.inner.len_hint().map(|n| n.saturating_sub(self.gap).div_ceil(self.step));
        match (inside, self.left) {
            (Some(n), Some(left)) => Some(n.min(left)),
            (None, Some(0)) => Some(0),
            (n, _) => n,
        }
    }
    fn frame_rate(&self) -> Option<f64> {
        self.inner.frame_rate().map(|rate| rate / self.step as f64)
    }
    fn describe(&self) -> String {
        self.inner.describe()
    }
}

#[cfg(test)]
mod tests {
    use super::super::MemorySource;
    use super::*;
    use crate::types::{AnyFrame, Frame};
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
}
