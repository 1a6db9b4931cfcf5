//! Boxes of one target a line, as the object tracking benchmark (OTB) keeps its ground truth; and the reading
//! of such texts.

use crate::error::{Error, Result};
use crate::types::TargetBox;
use std::path::Path;

/// From a side of our boxes, where pixel 0 reaches from -1/2 to 1/2, to the number of the first pixel counted
/// from 1.
pub(super) const FIRST_PIXEL: f64 = 1.5;

/// Longest text that is read, bytes: hours of boxes.
const LONGEST: u64 = 256 << 20;

/// Reads ground truth of one target as the object tracking benchmark has it (`groundtruth_rect.txt`): a line
/// `x,y,w,h` a frame, pixels counted from 1, separated by commas, tabs or blanks. `None` where the target is
/// not in the picture: a box without an extent, or of NaN.
///
/// Source: Y. Wu, J. Lim, M.-H. Yang, "Object Tracking Benchmark", 2015.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`] with the line for anything but four numbers.
pub fn read_otb(path: impl AsRef<Path>) -> Result<Vec<Option<TargetBox>>> {
    let path = path.as_ref();
    numbers(path)?
        .into_iter()
        .map(|(line, values)| match values[..] {
            [x, y, width, height] => {
                let there = [x, y, width, height].iter().all(|v| v.is_finite()) && width > 0.0 && height > 0.0;
                Ok(there.then_some(TargetBox { x: x - FIRST_PIXEL, y: y - FIRST_PIXEL, width, height }))
            }
            _ => Err(Error::format(path, format!("line {line}: expected four numbers x,y,w,h, got {}", values.len()))),
        })
        .collect()
}

/// The numbers of each line that is not blank, with the line's number (from 1).
pub(super) fn numbers(path: &Path) -> Result<Vec<(usize, Vec<f64>)>> {
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
