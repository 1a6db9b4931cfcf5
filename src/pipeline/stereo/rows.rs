//! Clusters as rows of a table.

use super::{StereoSink, StereoStep};
use crate::error::Result;
use crate::io::cell;
use crate::pipeline::sink::{Table, TableTarget, TextFormat, ends_as};
use crate::track::stereo::{Node, TrackGraph};
use std::path::PathBuf;

/// Texts that the stereo tracker's results are written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StereoFormat {
    /// A row for each cluster and step, as [`ClusterRows`].
    Csv,
    /// The graph of all clusters, as [`TrackGraph::to_json`].
    Json,
}

impl TextFormat for StereoFormat {
    const ALL: &'static [Self] = &[Self::Csv, Self::Json];

    fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Json => "json",
        }
    }
}

/// Columns of the table.
const COLUMNS: [&str; 32] = [
    "step",
    "frame",
    "time",
    "cluster",
    "track",
    "group",
    "pixels",
    "weight",
    "x",
    "y",
    "disparity",
    "u",
    "v",
    "w",
    "u_x",
    "v_x",
    "u_y",
    "v_y",
    "middle_x",
    "middle_y",
    "residual",
    "coasting",
    "cov_xx",
    "cov_xy",
    "cov_xd",
    "cov_yy",
    "cov_yd",
    "cov_dd",
    "depth",
    "velocity_x",
    "velocity_y",
    "velocity_z",
];

/// Writes a row for every cluster and step. Numbers read back exactly; what is not known is `nan`. A file
/// gets its name when the run is complete; the rows of a run that was stopped are kept beside it, as
/// `name.partial.csv`.
///
/// | columns | unit |
/// |---|---|
/// | `step` | from 0 |
/// | `frame` | index of the pair in the input, from 0 |
/// | `time` | s from the first frame of the input; `nan` where neither the frame rate nor the time is known |
/// | `cluster`, `track`, `group` | numbers, as [`Node`] has them |
/// | `pixels`, `weight` | edge pixels; weight of the component, 0 to 1 |
/// | `x`, `y`, `disparity` | mean, px |
/// | `u`, `v`, `w` | motion since the last step, px/step and disparity/step; of steps with uneven times, for an ordinary one |
/// | `u_x`, `v_x`, `u_y`, `v_y` | derivatives of that at `(middle_x, middle_y)`, 1/step |
/// | `residual` | grey levels |
/// | `coasting` | `true` or `false` |
/// | `cov_xx` to `cov_dd` | covariance of x, y and disparity, px^2 |
/// | `depth`, `velocity_x` to `velocity_z` | in units of the baseline, and those per step, where the cameras are known |
#[derive(Debug)]
pub struct ClusterRows {
    table: Table,
}

impl ClusterRows {
    /// Begins the table.
    pub fn create(target: &TableTarget) -> Result<Self> {
        Ok(Self { table: Table::create(target, &COLUMNS)? })
    }
}

/// The numbers of a vector, or as many times `nan`.
fn numbers<const N: usize>(values: Option<[f64; N]>) -> [String; N] {
    values.unwrap_or([f64::NAN; N]).map(cell)
}

/// The cells of a cluster.
fn cells(step: &StereoStep<'_>, node: &Node) -> Vec<String> {
    let mut cells = vec![node.time.to_string(), step.frame_index.to_string(), cell(step.time.unwrap_or(f64::NAN))];
    cells.extend([node.index.to_string(), node.track_id.to_string(), node.group.to_string()]);
    cells.extend([node.n_pixels.to_string(), cell(node.weight)]);
    cells.extend(node.mean.map(cell));
    cells.extend(numbers(node.velocity));
    cells.extend(numbers(node.affine.map(|[_, _, u_x, v_x, u_y, v_y]| [u_x, v_x, u_y, v_y])));
    cells.extend(node.middle.map(cell));
    cells.extend(numbers(node.residual.map(|residual| [residual])));
    cells.push(node.coasting.to_string());
    let [x, y, d] = node.covariance;
    cells.extend([x[0], x[1], x[2], y[1], y[2], d[2]].map(cell));
    cells.extend(numbers(node.depth.map(|depth| [depth])));
    cells.extend(numbers(node.metric_velocity));
    cells
}

impl StereoSink for ClusterRows {
    fn accept(&mut self, step: &StereoStep<'_>) -> Result<()> {
        for node in &step.step.clusters {
            self.table.row(cells(step, node))?;
        }
        self.table.flush()
    }

    ends_as!(table, &TrackGraph);
}
