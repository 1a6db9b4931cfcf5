//! The window that is looked at: how large it is, and what a frame shows in it.

use crate::types::{Frame, TargetBox};

/// Side of the window of small targets, px.
const FOV: usize = 51;
/// Side of the window over that of a large target.
const ROOM: f64 = 1.6;

/// Side of the window, px: as wanted, or as the target needs it. Beyond the frame there is nothing, and a
/// window has a middle.
pub(super) fn side(wanted: Option<usize>, bounds: TargetBox, (width, height): (usize, usize)) -> usize {
    let needed = (ROOM * bounds.width.max(bounds.height)) as usize;
    wanted.unwrap_or(needed.max(FOV)).min(2 * width.max(height)) | 1
}

/// A square of the frame from a corner on; NaN outside.
pub(super) fn whole_pixels(frame: &Frame<f64>, corner: [isize; 2], side: usize) -> Frame<f64> {
    // Columns or rows of the square that are in the frame.
    let within = |corner: isize, length: usize| {
        let first = (-corner).clamp(0, side as isize);
        let end = (length as isize - corner).clamp(first, side as isize);
        first as usize..end as usize
    };
    let columns = within(corner[0], frame.width());
    let mut out = Frame::filled(side, side, f64::NAN);
    for y in within(corner[1], frame.height()).filter(|_| !columns.is_empty()) {
        let from = (corner[0] + columns.start as isize) as usize;
        let row = &frame.row((corner[1] + y as isize) as usize)[from..from + columns.len()];
        out.row_mut(y)[columns.clone()].copy_from_slice(row);
    }
    out
}
