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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_read_whatever_separates_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("groundtruth_rect.txt");
        std::fs::write(&path, "\u{feff}11,21,13,5\n11\t21\t13\t5\r\n 11 21  13 5\n0,0,0,0\nNaN,NaN,NaN,NaN\n").unwrap();
        let bounds = TargetBox { x: 9.5, y: 19.5, width: 13.0, height: 5.0 };
        assert_eq!(read_otb(&path).unwrap(), [Some(bounds), Some(bounds), Some(bounds), None, None]);
        // The benchmark's own centre of a box, x + (w - 1) / 2 counted from 1, is ours.
        assert_eq!(bounds.centre(), [11.0 + 6.0 - 1.0, 21.0 + 2.0 - 1.0]);
    }

    #[test]
    fn damage_is_named_by_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        for (damage, words) in [("1,2,3,4\n1,2,3", "line 2"), ("1,2,3,x", "line 1"), ("\n\n1,2,3,4,5", "line 3")] {
            std::fs::write(&path, damage).unwrap();
            let error = read_otb(&path).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains("a.txt"), "{error}");
        }
        std::fs::write(&path, [0xff, 0xfe, 0]).unwrap();
        assert!(matches!(read_otb(&path), Err(Error::Format { .. })));
        assert!(matches!(read_otb(folder.path().join("none")), Err(Error::Io { .. })));
    }
}
