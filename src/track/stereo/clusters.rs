//! Voxels and edge pixels by the component that they belong to.

use super::{voxels::EdgePoints, voxels::Lattice, voxels::Voxels};
use crate::math::median;

/// Label of a voxel without a cluster.
const NOBODY: u16 = u16::MAX;

/// The clusters of a step; components without voxels are empty.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Clusters {
    pub voxels: Voxels,
    pub points: EdgePoints,
    /// Voxels of each cluster.
    pub members: Vec<Vec<u32>>,
    /// Edge pixels of each cluster.
    pub pixels: Vec<Vec<u32>>,
    /// Cluster of each edge pixel.
    pub of_point: Vec<u32>,
    /// Cluster of each voxel of the dense grid.
    dense: Vec<u16>,
}

impl Clusters {
    /// From the component of each voxel, `components` of them in all.
    pub fn new(points: EdgePoints, voxels: Voxels, labels: &[u32], components: usize) -> Self {
        let mut dense = vec![NOBODY; voxels.lattice.volume()];
        let mut members = vec![vec![]; components];
        for (n, (&cell, &label)) in voxels.cells.iter().zip(labels).enumerate() {
            dense[voxels.lattice.index(cell)] = label as u16;
            members[label as usize].push(n as u32);
        }
        let of_point: Vec<u32> = voxels.of_point.iter().map(|&n| labels[n as usize]).collect();
        let mut pixels = vec![vec![]; components];
        for (i, &label) in of_point.iter().enumerate() {
            pixels[label as usize].push(i as u32);
        }
        Self { voxels, points, members, pixels, of_point, dense }
    }

    /// Renumbers the components.
    pub fn renamed(mut self, names: &[usize]) -> Self {
        self.members = reordered(self.members, names);
        self.pixels = reordered(self.pixels, names);
        self.of_point.iter_mut().for_each(|label| *label = names[*label as usize] as u32);
        self.dense
            .iter_mut()
            .filter(|label| **label != NOBODY)
            .for_each(|label| *label = names[usize::from(*label)] as u16);
        self
    }

    /// The grid.
    pub fn lattice(&self) -> &Lattice {
        &self.voxels.lattice
    }

    /// Number of components, empty ones too.
    pub fn components(&self) -> usize {
        self.members.len()
    }

    /// Cluster that a voxel belongs to.
    pub fn at(&self, voxel: [u16; 3]) -> Option<usize> {
        Some(self.dense[self.lattice().index(voxel)]).filter(|&label| label != NOBODY).map(usize::from)
    }

    /// Voxels of a cluster.
    pub fn cells(&self, cluster: usize) -> impl Iterator<Item = [u16; 3]> + '_ {
        self.members[cluster].iter().map(|&n| self.voxels.cells[n as usize])
    }

    /// Median disparity of a cluster's pixels, px; `None` for a cluster without any.
    pub fn disparity(&self, cluster: usize) -> Option<f64> {
        let mut along: Vec<f64> = self.pixels[cluster].iter().map(|&i| self.points.at(i as usize)[2]).collect();
        median(&mut along)
    }

    /// Distinct `(ix, iy)` of a cluster: its template.
    pub fn template(&self, cluster: usize) -> Vec<[u16; 2]> {
        let mut cells: Vec<_> = self.cells(cluster).map(|[x, y, _]| [y, x]).collect();
        cells.sort_unstable();
        cells.dedup();
        cells.into_iter().map(|[y, x]| [x, y]).collect()
    }
}

fn reordered<T>(values: Vec<T>, names: &[usize]) -> Vec<T> {
    let mut named: Vec<(usize, T)> = names.iter().copied().zip(values).collect();
    named.sort_by_key(|(name, _)| *name);
    named.into_iter().map(|(_, value)| value).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::voxels::tests::lattice;
    use super::*;

    /// One edge pixel in each given voxel of the default grid, with its cluster.
    pub fn synthetic_clusters(cells: &[([u16; 3], u32)], components: usize) -> Clusters {
        let points = EdgePoints {
            columns: cells.iter().map(|(cell, _)| 8 * u32::from(cell[0]) + 4).collect(),
            rows: cells.iter().map(|(cell, _)| 8 * u32::from(cell[1]) + 4).collect(),
            disparities: cells.iter().map(|(cell, _)| f32::from(cell[2]) - 40.0).collect(),
        };
        let voxels = Voxels::count(&points, lattice());
        let mut labels = vec![0; voxels.cells.len()];
        for (i, (_, label)) in cells.iter().enumerate() {
            labels[voxels.of_point[i] as usize] = *label;
        }
        Clusters::new(points, voxels, &labels, components)
    }

    #[test]
    fn voxels_and_pixels_know_their_cluster() {
        let clusters =
            synthetic_clusters(&[([1, 2, 3], 0), ([1, 2, 9], 2), ([1, 2, 9], 2), ([4, 2, 9], 2), ([4, 2, 8], 2)], 4);
        assert_eq!((clusters.at([1, 2, 3]), clusters.at([1, 2, 9]), clusters.at([0, 0, 0])), (Some(0), Some(2), None));
        assert_eq!(clusters.of_point, [0, 2, 2, 2, 2]);
        assert_eq!((clusters.members[2].len(), clusters.pixels[2].len(), clusters.pixels[1].len()), (3, 4, 0));
        assert_eq!(clusters.template(2), [[1, 2], [4, 2]]);
        let renamed = clusters.clone().renamed(&[0, 2, 1, 3]);
        assert_eq!((renamed.at([1, 2, 3]), renamed.at([1, 2, 9]), renamed.at([0, 0, 0])), (Some(0), Some(1), None));
        assert_eq!(renamed.of_point, [0, 1, 1, 1, 1]);
        assert_eq!((&renamed.members[1], &renamed.pixels[1]), (&clusters.members[2], &clusters.pixels[2]));
    }
}
