//! Tracks as CSV: one row a target and frame.

use super::{table::TableWriter, table::cell, table::table_endings};
use crate::error::Result;
use crate::types::TrackState;
use std::path::Path;

/// Columns before the covariance.
const NUMBERS: [&str; 28] = [
    "target",
    "frame",
    "time",
    "status",
    "reason",
    "reacquired",
    "x",
    "y",
    "velocity_x",
    "velocity_y",
    "acceleration_x",
    "acceleration_y",
    "scene_velocity_x",
    "scene_velocity_y",
    "camera_motion_x",
    "camera_motion_y",
    "displacement_x",
    "displacement_y",
    "box_x",
    "box_y",
    "box_width",
    "box_height",
    "scale",
    "rotation",
    "rotation_observable",
    "visibility",
    "innovation",
    "gain",
];

/// The entries of one axis's covariance with their names: p position, v velocity, a acceleration.
const ENTRIES: [(&str, usize, usize); 6] =
    [("pp", 0, 0), ("pv", 0, 1), ("pa", 0, 2), ("vv", 1, 1), ("va", 1, 2), ("aa", 2, 2)];

/// Writes tracks as CSV. Numbers read back exactly; what is not known is `nan`.
///
/// | columns | unit |
/// |---|---|
/// | `target` | number of the target, from 1 |
/// | `frame` | index of the frame in the input, from 0 |
/// | `time` | s from the first frame of the input; `nan` where the frame rate is not known |
/// | `status`, `reason` | words, as [`TrackStatus::name`](crate::types::TrackStatus::name) and [`TrackState::reason`] |
/// | `reacquired`, `rotation_observable` | `true` or `false` |
/// | `x`, `y` | px, centres of pixels at integers, x right, y down |
/// | `velocity_*`, `scene_velocity_*` | px/frame |
/// | `acceleration_*` | px/frame^2 |
/// | `camera_motion_*`, `displacement_*` | px since the frame before |
/// | `box_x`, `box_y`, `box_width`, `box_height` | px, as [`TargetBox`](crate::types::TargetBox): the centre is `(box_x + box_width / 2, box_y + box_height / 2)` |
/// | `scale`, `gain` | of what they were at the beginning |
/// | `rotation` | rad since the beginning, from x towards y |
/// | `visibility` | share, 0 to 1 |
/// | `innovation` | squared, over its variance: no unit |
/// | `cov_x_pp`, `cov_x_pv`, `cov_x_pa`, `cov_x_vv`, `cov_x_va`, `cov_x_aa`, the same with `cov_y_` | covariance of position (p, px), velocity (v, px/frame) and acceleration (a, px/frame^2) along the axis |
#[derive(Debug)]
pub struct TrackTable {
    table: TableWriter,
}

impl TrackTable {
    /// Names of the columns, in their order.
    pub fn columns() -> Vec<String> {
        let covariance = ["x", "y"].into_iter().flat_map(|axis| ENTRIES.map(|(name, ..)| format!("cov_{axis}_{name}")));
        NUMBERS.into_iter().map(String::from).chain(covariance).collect()
    }

    /// Begins a table in a file, or on standard output for `-`, with `further` columns after the others.
    pub fn create(path: impl AsRef<Path>, further: &[&str]) -> Result<Self> {
        let columns: Vec<String> = Self::columns().into_iter().chain(further.iter().map(ToString::to_string)).collect();
        Ok(Self { table: TableWriter::create(path, &columns)? })
    }

    /// Adds the row of target `target` (from 1) at a frame of the input, and its time, s, if known, with a
    /// cell for each further column.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) when it cannot be written.
    pub fn write(
        &mut self,
        target: usize,
        (frame, time): (usize, Option<f64>),
        state: &TrackState,
        further: &[String],
    ) -> Result<()> {
        let mut cells = vec![
            target.to_string(),
            frame.to_string(),
            cell(time.unwrap_or(f64::NAN)),
            state.status.name().to_string(),
            state.reason.to_string(),
            state.reacquired.to_string(),
        ];
        let bounds = state.bounds;
        let pairs = [
            state.position,
            state.velocity,
            state.acceleration,
            state.scene_velocity,
            state.camera_motion,
            state.displacement,
            [bounds.x, bounds.y],
            [bounds.width, bounds.height],
            [state.scale, state.rotation],
        ];
        cells.extend(pairs.into_iter().flatten().map(cell));
        cells.push(state.rotation_observable.to_string());
        cells.extend([state.visibility, state.innovation, state.gain].map(cell));
        cells.extend(state.covariance.iter().flat_map(|axis| ENTRIES.map(|(_, row, column)| cell(axis[row][column]))));
        cells.extend_from_slice(further);
        self.table.row(&cells)
    }
}

table_endings!(TrackTable);
