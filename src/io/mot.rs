//! Boxes of tracks as text in the form of the MOT challenge, and what is read back from it.
//!
//! A line is `frame,id,x,y,w,h,conf,-1,-1,-1`. Frames and pixels are counted from 1: `x`, `y` is the first
//! pixel that the box covers. A box of ours that covers exactly the pixels `a ..= b` (from 0) reaches from `a
//! - 1/2` to `b + 1/2`, since centres of pixels lie at integers; hence `x = box_x + 3/2`.
//!
//! Source: A. Milan, L. Leal-Taixe, I. Reid, S. Roth, K. Schindler, "MOT16: A Benchmark for Multi-Object
//! Tracking", 2016.

use super::{table::TableWriter, table::table_endings};
use crate::error::{Error, Result};
use crate::types::{TargetBox, TrackState, TrackStatus};
use std::path::Path;

/// From a side of our boxes, where pixel 0 begins at -1/2, to the first pixel counted from 1.
const FIRST_PIXEL: f64 = 1.5;

/// Longest text that is read, bytes: hours of boxes.
const LONGEST: u64 = 256 << 20;

/// Writes boxes in the form of the MOT challenge, in thousandths of a pixel.
#[derive(Debug)]
pub struct MotTable {
    table: TableWriter,
}

impl MotTable {
    /// Begins a file, or standard output for `-`.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        Ok(Self { table: TableWriter::create_without_header(path, 10)? })
    }

    /// Adds the line of target number `target` (from 1) at frame `frame` (from 0) of the input. The
    /// confidence is the visibility, and 0 where the target was not measured. A target that is out of the
    /// picture or lost, and a box that is not known, have no line.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be written.
    pub fn write(&mut self, target: usize, frame: usize, state: &TrackState) -> Result<()> {
        let TargetBox { x, y, width, height } = state.bounds;
        let sides = [x + FIRST_PIXEL, y + FIRST_PIXEL, width, height];
        let gone = matches!(state.status, TrackStatus::Out | TrackStatus::Lost);
        if gone || !sides.iter().all(|side| side.is_finite()) {
            return Ok(());
        }
        let confidence = if state.status.is_measured() { state.visibility } else { 0.0 };
        let mut cells = vec![(frame + 1).to_string(), target.to_string()];
        cells.extend(sides.map(thousandths));
        cells.push(thousandths(if confidence.is_finite() { confidence } else { 0.0 }));
        cells.extend(["-1"; 3].map(String::from));
        self.table.row(&cells)
    }
}

table_endings!(MotTable);

fn thousandths(value: f64) -> String {
    let text = format!("{value:.3}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}

/// One box of a MOT file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotBox {
    /// Index of the frame, from 0.
    pub frame: usize,
    /// Number of the target as the file has it; -1 in files of detections.
    pub target: i64,
    /// The box, px.
    pub bounds: TargetBox,
    /// The seventh number, 1 without one: confidence; 0 in ground truth for boxes not to be judged.
    pub confidence: f64,
}

/// Reads a MOT challenge file (`gt.txt`, detections or results), in the order of its lines. Numbers may be
/// separated by commas, tabs or blanks; what follows the seventh is not read.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`] with the line for fewer than six numbers, a
/// frame below 1 or a box without an extent.
pub fn read_mot(path: impl AsRef<Path>) -> Result<Vec<MotBox>> {
    let path = path.as_ref();
    numbers(path)?
        .into_iter()
        .map(|(line, values)| {
            mot_box(&values).ok_or_else(|| {
                let wanted = "expected frame,id,x,y,w,h,conf,... with a frame from 1 and a positive width and height";
                Error::format(path, format!("line {line}: {wanted}"))
            })
        })
        .collect()
}

fn mot_box(values: &[f64]) -> Option<MotBox> {
    let &[frame, target, x, y, width, height, ref rest @ ..] = values else { return None };
    let whole = |value: f64| value.is_finite() && value.fract() == 0.0;
    let sound = whole(frame) && whole(target) && frame >= 1.0 && x.is_finite() && y.is_finite();
    (sound && width > 0.0 && height > 0.0 && width.is_finite() && height.is_finite()).then(|| MotBox {
        frame: frame as usize - 1,
        target: target as i64,
        bounds: TargetBox { x: x - FIRST_PIXEL, y: y - FIRST_PIXEL, width, height },
        confidence: rest.first().copied().unwrap_or(1.0),
    })
}

/// The numbers of each line that is not blank, with the line's number (from 1).
fn numbers(path: &Path) -> Result<Vec<(usize, Vec<f64>)>> {
    let length = path.metadata().map_err(|e| Error::io(path, e))?.len();
    if length > LONGEST {
        return Err(Error::format(path, format!("{length} bytes; expected a text of boxes, at most {LONGEST}")));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    let text = std::str::from_utf8(&bytes).map_err(|_| Error::format(path, "not a text of boxes"))?;
    let text = text.trim_start_matches('\u{feff}');
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines
        .map(|(index, line)| {
            let words = line.split([',', ';', ' ', '\t']).filter(|word| !word.is_empty());
            let values: std::result::Result<_, _> = words.map(|word| word.trim().parse::<f64>()).collect();
            let values = values.map_err(|_| Error::format(path, format!("line {}: expected numbers", index + 1)))?;
            Ok((index + 1, values))
        })
        .collect()
}
