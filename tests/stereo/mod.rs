//! Disparity of edge pixels and the row offset between two views.

mod edges;
mod options;
mod row_offset;
mod sequence_rows;
