//! Motion in depth and overlaps of clusters: equations (30) to (32) of the stereo paper.

use super::clusters::Clusters;

/// Shares of a cluster's voxels that the clusters of another step occupy, once it is moved.
pub(super) type Row = Vec<f64>;

/// Motion of a cluster in depth, and its overlaps there.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Depth {
    /// Layers, disparity.
    pub shift: i32,
    /// `e(k -> k')` of every cluster `k'` of the other step, 0 to 1.
    pub overlaps: Row,
}

/// How many voxels of a cluster, moved by whole cells, each cluster of `other` occupies (30).
fn occupied(clusters: &Clusters, cluster: usize, other: &Clusters, by: [i32; 3]) -> Vec<u32> {
    let mut counts = vec![0; other.components()];
    for cell in clusters.cells(cluster) {
        if let Some(met) = clusters.lattice().shifted(cell, by).and_then(|cell| other.at(cell)) {
            counts[met] += 1;
        }
    }
    counts
}

/// Shift in depth, up to `reach` layers, at which one cluster of `other` occupies most voxels (31), the
/// smaller of equals, and the overlaps there (32), as shares of voxels, 0 to 1.
pub(super) fn depth_motion(
    clusters: &Clusters,
    cluster: usize,
    other: &Clusters,
    plane: [i32; 2],
    reach: i32,
) -> Depth {
    let mut best: Option<(u32, i32, Vec<u32>)> = None;
    for shift in -reach..=reach {
        let counts = occupied(clusters, cluster, other, [plane[0], plane[1], shift]);
        let most = counts.iter().copied().max().unwrap_or(0);
        let better = best
            .as_ref()
            .is_none_or(|(best, at, _)| most > *best || most == *best && (shift.abs(), shift) < (at.abs(), *at));
        if better {
            best = Some((most, shift, counts));
        }
    }
    let (_, shift, counts) = best.unwrap_or((0, 0, vec![0; other.components()]));
    let all = clusters.members[cluster].len().max(1) as f64;
    Depth { shift, overlaps: counts.into_iter().map(|n| f64::from(n) / all).collect() }
}

/// Shares of a cluster's voxels that meet each cluster of `other`, after pixel `i` moved to `moved(i)`, `(x,
/// y, d)`, px: (32) for motions that are not whole cells.
pub(super) fn moved_overlaps(
    clusters: &Clusters,
    cluster: usize,
    other: &Clusters,
    moved: impl Fn(usize) -> [f64; 3],
) -> Row {
    let lattice = clusters.lattice();
    let mut cells: Vec<[u16; 3]> =
        clusters.pixels[cluster].iter().filter_map(|&i| lattice.voxel_at(moved(i as usize))).collect();
    cells.sort_unstable();
    cells.dedup();
    let mut row = vec![0.0; other.components()];
    for &cell in &cells {
        if let Some(met) = other.at(cell) {
            row[met] += 1.0;
        }
    }
    // Voxels outside the view count as not met.
    let all = cells.len().max(clusters.members[cluster].len()).max(1) as f64;
    for share in &mut row {
        *share /= all;
    }
    row
}
