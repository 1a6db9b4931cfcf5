//! A part of a sequence.

use super::{FrameSource, OpenOptions};
use crate::error::{Error, Result};
use crate::io::planes::PixelSize;

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
    fn time(&self) -> Option<f64> {
        self.inner.time()
    }
    fn pixel_size(&self) -> Option<PixelSize> {
        self.inner.pixel_size()
    }
    fn describe(&self) -> String {
        self.inner.describe()
    }
}
