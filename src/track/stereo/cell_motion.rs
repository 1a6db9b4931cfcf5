//! Motion of clusters by whole cells (paper mode).

use super::cell_luminance::CellLuminance;
use super::clusters::Clusters;
use super::lucas_kanade::SmoothedLevels;
use super::overlap::{Row, depth_motion};
use crate::parallel;

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct ObservedStep {
    pub clusters: Clusters,
    pub luminance: CellLuminance,
    /// For Lucas-Kanade (`improved`).
    pub levels: Option<SmoothedLevels>,
}

/// Motion of a cluster by whole cells, and its overlaps.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellMotion {
    /// `(dx, dy, dz)`, cells.
    pub shift: [i32; 3],
    /// Mean absolute difference of the template, levels.
    pub difference: f64,
    pub overlaps: Row,
}

/// Motion in cells of all clusters towards another step, up to `reach` cells: (29), then (30) to (32). `None`
/// for empty clusters, templates that leave the view, and a step without edge pixels.
pub(super) fn cell_motions(from: &ObservedStep, to: &ObservedStep, reach: i32) -> Vec<Option<CellMotion>> {
    if to.clusters.points.is_empty() {
        return vec![None; from.clusters.components()];
    }
    let one = |k: usize| {
        let template = from.clusters.template(k);
        let found = from.luminance.find(&template, &to.luminance, reach)?;
        let depth = depth_motion(&from.clusters, k, &to.clusters, found.shift, reach);
        let [dx, dy] = found.shift;
        Some(CellMotion { shift: [dx, dy, depth.shift], difference: found.difference, overlaps: depth.overlaps })
    };
    parallel::map(0..from.clusters.components(), one)
}
