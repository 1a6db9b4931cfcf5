//! Disparity of the edge pixels of two views.
//!
//! Source: the stereo paper ("tracking of moving objects in stereo sequences by fusing disparity and
//! luminance"), sections on gradients and disparity, equations (1) to (5). `d = x_left - x_right`; near is
//! large, and disparities are negative where cameras that converge look far.
//!
//! Two ways to match ([`Method`]): the paper's agreement of signed gradient classes in a window, and
//! semi-global matching of gradients along chains of edge pixels (after H. Hirschmueller, "Stereo processing
//! by semiglobal matching and mutual information", 2008, with edge pixels in place of a dense grid), which
//! wants the rows of the cameras aligned: [`estimate_row_offset`].
//!
//! `disparity` is the entry point. Views pass `edges` (edge pixels, classes of their gradients), then either
//! `classes`, or `contrast` (different gains), `row_offset` (judged by `agreement`) and `align`, which calls
//! `semi_global` (`cost` of two pixels, summed along `chains`) and `subpixel`. `sequence_rows` keeps the row
//! offset of a sequence.

mod agreement;
mod align;
mod chains;
mod classes;
mod contrast;
mod cost;
mod disparity;
mod edges;
mod options;
mod row_offset;
mod semi_global;
mod sequence_rows;
mod subpixel;

pub use agreement::RowOffset;
pub use disparity::{EdgeDisparity, edge_disparity};
pub use edges::{EdgeMap, EdgeSettings, NO_CLASS};
pub use options::{EdgeDisparityOptions, MIN_VIEW_SIDE, Method};
pub use row_offset::{estimate_row_offset, find_row_offset};
pub use sequence_rows::SequenceRows;
