//! Two views of each moment: from two sources, or cut out of frames that hold both.

use super::{FrameSource, OpenOptions, open};
use crate::error::{Error, Result};
use crate::types::{AnyFrame, Frame, Sample};

/// How one frame holds both views, the left one first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewLayout {
    /// The left view in the left half.
    SideBySide,
    /// The left view in the upper half.
    TopBottom,
    /// Side by side in a frame of the ordinary size: each view is widened to twice its columns.
    HalfSideBySide,
    /// One above the other in a frame of the ordinary size: each view is stretched to twice its rows.
    HalfTopBottom,
}

impl ViewLayout {
    /// The left or upper half, and the other one, as wide and as high as they were.
    ///
    /// # Errors
    /// [`Error::Argument`] named `layout` for an odd number of columns or rows.
    pub fn cut<T: Sample>(self, frame: &Frame<T>) -> Result<[Frame<T>; 2]> {
        let (width, height) = frame.size();
        let beside = self.beside();
        let divided = if beside { width } else { height };
        if !divided.is_multiple_of(2) {
            let expected = "frames of an even width (side-by-side) or height (top-bottom)";
            return Err(Error::argument("layout", expected, divided));
        }
        let (w, h) = if beside { (width / 2, height) } else { (width, height / 2) };
        let (dx, dy) = if beside { (w, 0) } else { (0, h) };
        let views = [0, 1].map(|half| Frame::from_fn(w, h, |x, y| frame.get(x + half * dx, y + half * dy)));
        Ok(if self.squeezed() { views.map(|view| stretched(&view, beside)) } else { views })
    }

    fn beside(self) -> bool {
        matches!(self, Self::SideBySide | Self::HalfSideBySide)
    }

    fn squeezed(self) -> bool {
        matches!(self, Self::HalfSideBySide | Self::HalfTopBottom)
    }
}

/// Pairs of views, left and right, one pair at a time.
///
/// Movies that squeeze both views into a frame of the ordinary size ("half" formats) look like those that do
/// not; [`ViewLayout`] has a layout of its own for them. Taken for the others, they give views of half the
/// width, and disparities half as large, or of half the height.
pub struct ViewPairs {
    views: Views,
    swapped: bool,
}

enum Views {
    Two([Box<dyn FrameSource>; 2]),
    One(Box<dyn FrameSource>, ViewLayout),
}

impl ViewPairs {
    /// Left and right views from sources of their own.
    pub fn separate(left: Box<dyn FrameSource>, right: Box<dyn FrameSource>) -> Self {
        Self { views: Views::Two([left, right]), swapped: false }
    }

    /// Both views out of the frames of one source.
    pub fn joined(both: Box<dyn FrameSource>, layout: ViewLayout) -> Self {
        Self { views: Views::One(both, layout), swapped: false }
    }

    /// Opens two specifications, or with a layout one, each as [`open`] takes it; the options choose pairs.
    ///
    /// # Errors
    /// [`Error::Argument`] named `input` for another number of specifications; those of [`open`].
    pub fn open(specs: &[String], layout: Option<ViewLayout>, options: &OpenOptions) -> Result<Self> {
        match (specs, layout) {
            ([left, right], None) => Ok(Self::separate(open(left, options)?, open(right, options)?)),
            ([both], Some(layout)) => Ok(Self::joined(open(both, options)?, layout)),
            (_, None) => {
                let expected = "two views, or --layout for one input that holds both";
                Err(Error::argument("input", expected, specs.len()))
            }
            (_, Some(_)) => Err(Error::argument("input", "one input that holds both views", specs.len())),
        }
    }

    /// The same with the right view first.
    pub fn with_swapped(mut self, swapped: bool) -> Self {
        self.swapped = swapped;
        self
    }

    /// The next left and right view; `None` after the last.
    ///
    /// # Errors
    /// Those of the sources; [`Error::Argument`] named `input` where one of two ends before the other,
    /// `layout` for frames that cannot be cut in half.
    pub fn next_pair(&mut self) -> Result<Option<[AnyFrame; 2]>> {
        let pair = match &mut self.views {
            Views::Two([left, right]) => match (left.next_frame()?, right.next_frame()?) {
                (Some(left), Some(right)) => Some([left, right]),
                (None, None) => None,
                (ended, _) => {
                    let got = if ended.is_none() { "fewer left than right" } else { "fewer right than left" };
                    return Err(Error::argument("input", "as many left views as right ones", got));
                }
            },
            Views::One(both, layout) => both.next_frame()?.map(|frame| halves(&frame, *layout)).transpose()?,
        };
        let swapped = self.swapped;
        Ok(pair.map(|[first, second]| if swapped { [second, first] } else { [first, second] }))
    }

    /// How many pairs are left, where that is known without reading them.
    pub fn len_hint(&self) -> Option<usize> {
        self.first().len_hint()
    }

    /// Pairs per second, where the source says so.
    pub fn frame_rate(&self) -> Option<f64> {
        self.first().frame_rate()
    }

    /// What this is, for messages.
    pub fn describe(&self) -> String {
        match &self.views {
            Views::Two([left, right]) => format!("{}, {}", left.describe(), right.describe()),
            Views::One(both, _) => both.describe(),
        }
    }

    fn first(&self) -> &dyn FrameSource {
        match &self.views {
            Views::Two([source, _]) | Views::One(source, _) => source.as_ref(),
        }
    }
}

fn halves(frame: &AnyFrame, layout: ViewLayout) -> Result<[AnyFrame; 2]> {
    match frame {
        AnyFrame::U8(frame) => Ok(layout.cut(frame)?.map(AnyFrame::U8)),
        AnyFrame::U16(frame) => Ok(layout.cut(frame)?.map(AnyFrame::U16)),
        AnyFrame::F32(frame) => Ok(layout.cut(frame)?.map(AnyFrame::F32)),
        AnyFrame::F64(frame) => Ok(layout.cut(frame)?.map(AnyFrame::F64)),
    }
}

/// A frame twice as wide or twice as high, interpolated along that axis. Squeezed pixels are as wide as two:
/// the middles of these are a quarter of it from its own.
fn stretched<T: Sample>(frame: &Frame<T>, wider: bool) -> Frame<T> {
    let (width, height) = frame.size();
    let size = if wider { (2 * width, height) } else { (width, 2 * height) };
    // The squeezed sample that a place lies in, and the one on the side of that where the place is.
    let both = |at: usize, count: usize| {
        let beside = if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { (at / 2 + 1).min(count - 1) };
        (at / 2, beside)
    };
    Frame::from_fn(size.0, size.1, |x, y| {
        let (own, other) = if wider {
            let (own, other) = both(x, width);
            (frame.get(own, y), frame.get(other, y))
        } else {
            let (own, other) = both(y, height);
            (frame.get(x, own), frame.get(x, other))
        };
        T::from_f64_nearest(0.75 * own.to_real::<f64>() + 0.25 * other.to_real::<f64>())
    })
}
