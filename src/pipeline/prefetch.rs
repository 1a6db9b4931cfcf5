//! Reading ahead: the source works on its own thread, so that decoding and estimating overlap and a blocked
//! read never keeps the run from being stopped.

use crate::error::{Error, Result};
use crate::io::{FrameFormat, FrameSource, PixelSize, ViewPairs};
use crate::types::AnyFrame;
use std::cell::Cell;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Frames that may wait, decoded, for the stage.
pub const READ_AHEAD: usize = 2;

/// How often a waiting run looks whether it should stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// The receiving end of a reader thread.
pub(super) struct Prefetch<T = AnyFrame> {
    frames: Receiver<Result<(T, Option<f64>)>>,
    /// Time that the source has for the frame received last, s.
    time: Cell<Option<f64>>,
}

impl<F: FrameFormat> Prefetch<F> {
    /// Starts to read the frames of `source`.
    pub(super) fn start(mut source: Box<dyn FrameSource<F>>) -> Result<Self> {
        Self::of(move || Ok(source.next_frame()?.map(|frame| (frame, source.time()))))
    }
}

impl Prefetch<[AnyFrame; 2]> {
    /// Starts to read pairs of views.
    pub(super) fn pairs(mut views: ViewPairs) -> Result<Self> {
        Self::of(move || Ok(views.next_pair()?.map(|pair| (pair, None))))
    }
}

impl<T: Send + 'static> Prefetch<T> {
    /// Starts to call `read`. The thread ends at the end, at the first error, or when this is dropped.
    fn of(mut read: impl FnMut() -> Result<Option<(T, Option<f64>)>> + Send + 'static) -> Result<Self> {
        let (sender, frames) = sync_channel(READ_AHEAD);
        std::thread::Builder::new()
            .name("jacoflow-reader".into())
            .spawn(move || {
                while let Some(frame) = read().transpose() {
                    let last = frame.is_err();
                    if sender.send(frame).is_err() || last {
                        break;
                    }
                }
            })
            .map_err(|error| Error::io("reader thread", error))?;
        Ok(Self { frames, time: Cell::new(None) })
    }

    /// The next frame; calls `wait` while there is none yet and stops when `wait` fails.
    pub(super) fn next(&self, wait: impl Fn() -> Result<()>) -> Result<Option<T>> {
        loop {
            match self.frames.recv_timeout(PATIENCE) {
                Ok(received) => {
                    let (frame, time) = received?;
                    self.time.set(time);
                    return Ok(Some(frame));
                }
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
                Err(RecvTimeoutError::Timeout) => wait()?,
            }
        }
    }
}

impl<T> Prefetch<T> {
    /// Time that the source has for the frame received last, s.
    pub(super) fn last_time(&self) -> Option<f64> {
        self.time.get()
    }
}

/// A source whose first frame has been looked at.
struct Peeked<F> {
    hint: Option<usize>,
    first: Option<F>,
    rest: Box<dyn FrameSource<F>>,
}

impl<F: FrameFormat> FrameSource<F> for Peeked<F> {
    fn next_frame(&mut self) -> Result<Option<F>> {
        match self.first.take() {
            Some(frame) => Ok(Some(frame)),
            None => self.rest.next_frame(),
        }
    }
    fn len_hint(&self) -> Option<usize> {
        self.hint
    }
    fn frame_rate(&self) -> Option<f64> {
        self.rest.frame_rate()
    }
    fn time(&self) -> Option<f64> {
        self.rest.time()
    }
    fn pixel_size(&self) -> Option<PixelSize> {
        self.rest.pixel_size()
    }
    fn describe(&self) -> String {
        self.rest.describe()
    }
}

/// Properties of a sequence, read from its first frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FirstFrame {
    /// `(width, height)` in pixels.
    pub size: (usize, usize),
    /// numpy's name of the sample type.
    pub dtype: &'static str,
}

/// Looks at the first frame of `source`: what it is (`None`: no frame), and the whole source again.
pub fn peek<F: FrameFormat>(
    mut source: Box<dyn FrameSource<F>>,
) -> Result<(Option<FirstFrame>, Box<dyn FrameSource<F>>)> {
    // A source may count what is left, so the hint is read before the first frame is taken.
    let hint = source.len_hint();
    let first = source.next_frame()?;
    let seen = first.as_ref().map(|frame| FirstFrame { size: frame.size(), dtype: frame.dtype() });
    Ok((seen, Box::new(Peeked { hint, first, rest: source })))
}
