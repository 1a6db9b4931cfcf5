//! How a tracker starts: the checks of the first frame, box and point, and the search for the first object
//! that moves.

use super::{detect::camera_moved, detect::detect_moving_target, layered, options::CameraMotion};
use crate::error::{Error, Result};
use crate::image::fill_holes;
use crate::track::grey_levels::GREATEST;
use crate::types::{Frame, TargetBox, TrackState, TrackStatus};
use std::borrow::Cow;

/// Smallest side of a frame, px.
const MIN_FRAME_SIDE: usize = 16;
/// Smallest side of a target, px.
const MIN_BOX_SIDE: f64 = 3.0;
/// Largest side of a box, in sides of the frame.
const MAX_BOX_PER_FRAME: f64 = 2.0;

/// Nothing has moved yet: the last frame, and the point near which the target is.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Waiting {
    previous: Frame<f64>,
    near: Option<[f64; 2]>,
}

impl Waiting {
    pub fn new(frame: &Frame<f64>, near: Option<[f64; 2]>) -> Self {
        Self { previous: frame.clone(), near }
    }

    /// Box of what moved since the last frame.
    pub fn find(&mut self, frame: &Frame<f64>, camera: CameraMotion) -> Option<TargetBox> {
        let still = match camera {
            CameraMotion::Auto if camera_moved(&self.previous, frame) => layered::stilled(&self.previous, frame),
            CameraMotion::Auto | CameraMotion::None => None,
        };
        let found = detect_moving_target(still.as_ref().unwrap_or(&self.previous), frame, self.near);
        let bounds = found.and_then(|found| checked_box(found.bounds, frame.size()).ok());
        if bounds.is_none() {
            self.previous = frame.clone();
        }
        bounds
    }
}

pub(super) fn nothing_yet(at: [f64; 2]) -> TrackState {
    TrackState {
        status: TrackStatus::Lost,
        reason: "nothing has moved yet".into(),
        visibility: 0.0,
        covariance: [[[f64::NAN; 3]; 3]; 2],
        ..TrackState::at(at, TargetBox::about(at, 0.0, 0.0))
    }
}

pub(super) fn checked_point(at: [f64; 2], (width, height): (usize, usize)) -> Result<[f64; 2]> {
    // Pixels reach half a pixel beyond their centers.
    let inside = |at: f64, length: usize| at >= -0.5 && at < length as f64 - 0.5;
    if inside(at[0], width) && inside(at[1], height) {
        return Ok(at);
    }
    let expected = format!("a point (x, y) in the {width} x {height} frame");
    Err(Error::argument("center", expected, format!("({}, {})", at[0], at[1])))
}

/// The first frame, without missing samples.
pub(super) fn first_frame(frame: &Frame<f64>) -> Result<Cow<'_, Frame<f64>>> {
    let (width, height) = frame.size();
    if width < MIN_FRAME_SIDE || height < MIN_FRAME_SIDE {
        let expected = format!("a frame of at least {MIN_FRAME_SIDE} x {MIN_FRAME_SIDE} px");
        return Err(Error::argument("frame", expected, format!("{width} x {height}")));
    }
    completed(frame).ok_or_else(|| {
        let expected = format!("finite samples of at most {GREATEST:e} grey levels in half of the first frame");
        Error::argument("frame", expected, "fewer")
    })
}

/// The frame with missing samples (masked, NaN, infinite, no brightness) filled by a continuation of those
/// around them; `None` where more than half are missing.
pub(super) fn completed(frame: &Frame<f64>) -> Option<Cow<'_, Frame<f64>>> {
    let known = seen(frame)?;
    Some(match known {
        Cow::Borrowed(frame) => Cow::Borrowed(frame),
        Cow::Owned(frame) => Cow::Owned(fill_holes(&frame, None).into_owned()),
    })
}

/// Also false for NaN.
fn is_brightness(sample: f64) -> bool {
    sample.abs() <= GREATEST
}

/// The frame with NaN for missing samples; `None` where more than half are missing.
pub(super) fn seen(frame: &Frame<f64>) -> Option<Cow<'_, Frame<f64>>> {
    let missing = frame.data().iter().filter(|sample| !is_brightness(**sample)).count();
    match missing {
        0 => Some(Cow::Borrowed(frame)),
        _ if 2 * missing > frame.data().len() => None,
        _ => Some(Cow::Owned(frame.map(|sample| if is_brightness(*sample) { *sample } else { f64::NAN }))),
    }
}

/// Refuses a box of which the frame shows less than half.
pub(super) fn check_shown(frame: &Frame<f64>, bounds: TargetBox) -> Result<()> {
    let inside = |at: usize, from: f64, length: f64| at as f64 >= from && at as f64 <= from + length;
    let rows = (0..frame.height()).filter(|&y| inside(y, bounds.y, bounds.height));
    let samples = rows.flat_map(|y| {
        let row = frame.row(y).iter().enumerate();
        row.filter(|(x, _)| inside(*x, bounds.x, bounds.width)).map(|(_, sample)| *sample)
    });
    let (shown, missing): (Vec<f64>, Vec<f64>) = samples.partition(|sample| is_brightness(*sample));
    if missing.len() > shown.len() {
        let expected = "a box of which the first frame shows at least half";
        return Err(Error::argument(
            "bbox",
            expected,
            format!("{} of {} samples", shown.len(), shown.len() + missing.len()),
        ));
    }
    Ok(())
}

pub(super) fn checked_box(bounds: TargetBox, (width, height): (usize, usize)) -> Result<TargetBox> {
    let TargetBox { x, y, width: w, height: h } = bounds;
    let got = || format!("x {x}, y {y}, width {w}, height {h}");
    if ![x, y, w, h].iter().all(|value| value.is_finite()) || w < MIN_BOX_SIDE || h < MIN_BOX_SIDE {
        let expected = format!("finite (x, y, width, height), sides of at least {MIN_BOX_SIDE} px");
        return Err(Error::argument("bbox", expected, got()));
    }
    if w > MAX_BOX_PER_FRAME * width as f64 || h > MAX_BOX_PER_FRAME * height as f64 {
        let expected = format!("a box at most {MAX_BOX_PER_FRAME} times as large as the {width} x {height} frame");
        return Err(Error::argument("bbox", expected, got()));
    }
    let is_apart = |from: f64, length: f64, whole: usize| from + length <= -0.5 || from >= whole as f64 - 0.5;
    if is_apart(x, w, width) || is_apart(y, h, height) {
        return Err(Error::argument("bbox", format!("a box that overlaps the {width} x {height} frame"), got()));
    }
    Ok(bounds)
}
