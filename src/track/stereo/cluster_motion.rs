//! Motion of a cluster: affine in the picture, one change of disparity.

use super::clusters::Clusters;
use crate::math::median;
use crate::types::AffineFlow;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlaneMotion {
    /// Flow and derivatives at the centre.
    pub flow: AffineFlow<f64>,
    /// Medians of the pixels along x and y, px.
    pub centre: [f64; 2],
    /// Truncated mean absolute difference left, grey levels.
    pub residual: f64,
}

impl PlaneMotion {
    /// Where a pixel goes, px.
    pub fn moved(&self, x: f64, y: f64) -> [f64; 2] {
        let (u, v) = self.flow.at_offset(x - self.centre[0], y - self.centre[1]);
        [x + u, y + v]
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ClusterMotion {
    pub plane: PlaneMotion,
    /// Change of the disparity.
    pub depth: f64,
    /// Support: share of the pixels at whose new places the next view has an edge at the new depth; 0 if not
    /// measured.
    pub support: f64,
}

impl ClusterMotion {
    /// The motion as `(u, v, u_x, v_x, u_y, v_y)` at a place of the step that it begins with.
    pub fn affine_at(&self, [x, y]: [f64; 2]) -> [f64; 6] {
        let PlaneMotion { flow, centre, .. } = self.plane;
        let (u, v) = flow.at_offset(x - centre[0], y - centre[1]);
        AffineFlow { u, v, ..flow }.to_array()
    }

    /// `(u, v, w)` at the centre (medians of the pixels, robust against outliers), px and disparity.
    pub fn at_centre(&self) -> [f64; 3] {
        [self.plane.flow.u, self.plane.flow.v, self.depth]
    }

    /// A translation of a cluster whose pixels have the middle `centre`.
    pub fn translation([u, v, w]: [f64; 3], centre: [f64; 2]) -> Self {
        let flow = AffineFlow { u, v, ..AffineFlow::default() };
        Self { plane: PlaneMotion { flow, centre, residual: f64::NAN }, depth: w, support: 0.0 }
    }

    /// Where a point `(x, y, d)` goes.
    pub fn moved(&self, [x, y, d]: [f64; 3]) -> [f64; 3] {
        let [x, y] = self.plane.moved(x, y);
        [x, y, d + self.depth]
    }

    /// The motion as `(u, v, u_x, v_x, u_y, v_y)` at a place of the next step.
    pub fn affine_after(&self, [x, y]: [f64; 2]) -> [f64; 6] {
        let PlaneMotion { flow, centre, .. } = self.plane;
        let (u, v) = flow.at_offset(x - flow.u - centre[0], y - flow.v - centre[1]);
        AffineFlow { u, v, ..flow }.to_array()
    }

    /// Where a point `(x, y, d)` of the next step came from, to first order in the derivatives of the flow.
    pub fn moved_back(&self, [x, y, d]: [f64; 3]) -> [f64; 3] {
        let flow = self.plane.flow;
        let (du, dv) = flow.at_offset(x - flow.u - self.plane.centre[0], y - flow.v - self.plane.centre[1]);
        [x - du, y - dv, d - self.depth]
    }
}

/// Motion of the mean of a cluster's voxels, cells, after its moved pixels are quantised again: whole cells
/// along x and y change it by up to half a cell; depths are means. `None` without pixels.
pub(super) fn voxel_motion(clusters: &Clusters, k: usize, motion: &ClusterMotion) -> Option<[f64; 3]> {
    let (lattice, pixels) = (clusters.lattice(), &clusters.pixels[k]);
    let mut sum = [0.0; 2];
    for &i in pixels {
        let place = clusters.points.at(i as usize);
        let (now, then) = (lattice.cell_at(place), lattice.cell_at(motion.moved(place)));
        (0..2).for_each(|axis| sum[axis] += then[axis] - now[axis]);
    }
    let count = pixels.len() as f64;
    (!pixels.is_empty()).then(|| [sum[0] / count, sum[1] / count, motion.depth])
}

/// Medians of the pixels along x and y, robust against outliers.
pub(super) fn middle(pixels: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|i| {
        let mut along: Vec<f64> = pixels.iter().map(|pixel| pixel[i]).collect();
        median(&mut along).unwrap_or(f64::NAN)
    })
}

pub(super) fn places(clusters: &Clusters, k: usize) -> Vec<[f64; 2]> {
    let place = |&i: &u32| {
        let [x, y, _] = clusters.points.at(i as usize);
        [x, y]
    };
    clusters.pixels[k].iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::super::clusters::tests::synthetic_clusters;
    use super::*;

    #[test]
    fn voxels_move_by_what_counting_makes_of_the_motion() {
        // Pixels at x = 84 and 92, disparity -10.
        let clusters = synthetic_clusters(&[([10, 5, 30], 0), ([11, 5, 30], 0)], 2);
        let moved = |motion| voxel_motion(&clusters, 0, &ClusterMotion::translation(motion, [88.0, 44.0]));
        assert_eq!(moved([8.0, -8.0, 2.0]), Some([1.0, -1.0, 2.0]));
        assert_eq!(moved([3.0, 4.0, 0.4]), Some([0.0, 1.0, 0.4]));
        assert_eq!(moved([3.6, 0.0, 0.6]), Some([1.0, 0.0, 0.6]));
        assert_eq!(voxel_motion(&clusters, 1, &ClusterMotion::translation([1.0; 3], [0.0; 2])), None);
    }
}
