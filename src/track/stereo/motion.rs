//! Motion of every cluster from one step to the other: in the picture, in depth, and whom it meets.

use super::cell_luminance::{CellLuminance, Window};
use super::clusters::Clusters;
use super::disparity_change::{nearest, robust_mean};
use super::lucas_kanade::{PlaneMotion, SmoothedLevels, affine_motion};
use super::options::StereoTrackerOptions;
use super::overlap::{Row, depth_motion};
use crate::types::{AffineFlow, Frame};
use rayon::prelude::*;

/// Reach of predicted windows, cells and disparities.
const PREDICTED_REACH: i32 = 2;
/// First guesses nearer than this to one another are one, px.
const SAME_START: f64 = 3.0;
/// Least share of a cluster's pixels at whose new places there must be a disparity.
const LEAST_SHARE: f64 = 0.15;

/// A step as motion needs it.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub clusters: Clusters,
    pub luminance: CellLuminance,
    /// For Lucas-Kanade (`improved`).
    pub levels: Option<SmoothedLevels>,
}

/// How a cluster moved by whole cells, and whom it meets.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellMotion {
    /// `(dx, dy, dz)`, cells.
    pub shift: [i32; 3],
    /// Mean absolute difference of the template, levels.
    pub difference: f64,
    pub overlaps: Row,
}

/// Motion in cells of all clusters towards another step: (29), then (30) to (32). `None` for empty ones and those whose template leaves the picture.
pub(super) fn cell_motions(from: &Seen, to: &Seen, options: &StereoTrackerOptions) -> Vec<Option<CellMotion>> {
    let reach = options.search as i32;
    let one = |k: usize| {
        let template = from.clusters.template(k);
        let found = from.luminance.find(&template, &to.luminance, Window { centre: [0, 0], reach })?;
        let depth = depth_motion(&from.clusters, k, &to.clusters, found.shift, 0, reach);
        let [dx, dy] = found.shift;
        Some(CellMotion { shift: [dx, dy, depth.shift], difference: found.difference, overlaps: depth.overlaps })
    };
    (0..from.clusters.components()).into_par_iter().map(one).collect()
}

/// Motion of a cluster to fractions of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FineMotion {
    pub plane: PlaneMotion,
    /// Disparity per step.
    pub depth: f64,
}

impl FineMotion {
    /// `(u, v, w)` at the centre, px and disparity.
    pub fn velocity(&self) -> [f64; 3] {
        [self.plane.flow.u, self.plane.flow.v, self.depth]
    }

    /// A translation of a cluster whose pixels have the middle `centre`.
    pub fn translation([u, v, w]: [f64; 3], centre: [f64; 2]) -> Self {
        let flow = AffineFlow { u, v, ..AffineFlow::default() };
        Self { plane: PlaneMotion { flow, centre, residual: f64::NAN }, depth: w }
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

/// What the next step shows before anything is clustered in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct NextView<'a> {
    pub luminance: &'a CellLuminance,
    pub levels: &'a SmoothedLevels,
    /// Disparities of its edge pixels, px; NaN elsewhere.
    pub disparity: &'a Frame<f32>,
}

/// How far the mean of a cluster's voxels goes, cells, once its pixels have moved and are counted anew. Counting in whole voxels moves it by up to half of one more or less than
/// the pixels, all of a flat cluster's alike in depth. `None` for a cluster without pixels.
pub(super) fn voxel_motion(clusters: &Clusters, k: usize, motion: &FineMotion) -> Option<[f64; 3]> {
    let (lattice, pixels) = (clusters.lattice(), &clusters.pixels[k]);
    let mut sum = [0.0; 3];
    for &i in pixels {
        let place = clusters.points.at(i as usize);
        let (now, then) = (lattice.cell_at(place), lattice.cell_at(motion.moved(place)));
        (0..3).for_each(|axis| sum[axis] += then[axis] - now[axis]);
    }
    (!pixels.is_empty()).then(|| sum.map(|sum| sum / pixels.len() as f64))
}

/// Places `(x, y)` of a cluster's pixels, px.
pub(super) fn places(clusters: &Clusters, k: usize) -> Vec<[f64; 2]> {
    let place = |&i: &u32| {
        let [x, y, _] = clusters.points.at(i as usize);
        [x, y]
    };
    clusters.pixels[k].iter().map(place).collect()
}

/// What a cluster's motion may be, px and disparity, before it is measured.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Guess {
    /// Its own one step ago.
    pub last: Option<[f64; 3]>,
    /// For want of that, the motion of who is nearest to it.
    pub beside: Option<[f64; 3]>,
}

/// Motion of all clusters towards the next view by affine Lucas-Kanade, from the template's shift and from a guess.
///
/// Depth: robust mean of what the disparity is at the moved pixels less what it was. `None` where the picture or the disparities do not tell, or tell of more than is searched for.
pub(super) fn fine_motions(
    from: &Seen,
    next: NextView<'_>,
    guesses: &[Guess],
    options: &StereoTrackerOptions,
) -> Vec<Option<FineMotion>> {
    let levels = from.levels.as_ref();
    let one = |k: usize| {
        let clusters = &from.clusters;
        let pixels = places(clusters, k);
        // So few say nothing sure, and are seeded anew.
        if (pixels.len() as f64) < options.reseed_below {
            return None;
        }
        let starts = starts(from, next.luminance, k, guesses[k], options);
        let plane = affine_motion(levels?, next.levels, &pixels, &starts)?;
        let mut changes: Vec<f64> = clusters.pixels[k]
            .iter()
            .filter_map(|&i| {
                let [x, y, d] = clusters.points.at(i as usize);
                let [x, y] = plane.moved(x, y);
                nearest(next.disparity, x, y).map(|there| there - d)
            })
            .collect();
        if (changes.len() as f64) < LEAST_SHARE * pixels.len() as f64 {
            return None;
        }
        // Pixels that meet another surface tell a change of disparity, too, but not a motion.
        let depth = robust_mean(&mut changes).filter(|depth| depth.abs() <= options.search as f64)?;
        Some(FineMotion { plane, depth })
    };
    (0..from.clusters.components()).into_par_iter().map(one).collect()
}

/// First guesses of a cluster's translation, px.
fn starts(from: &Seen, next: &CellLuminance, k: usize, guess: Guess, options: &StereoTrackerOptions) -> Vec<[f64; 2]> {
    let [cx, cy, _] = from.clusters.lattice().cell();
    let window = match guess.last.filter(|_| options.predicted_windows) {
        Some([u, v, _]) => {
            Window { centre: [(u / cx).round() as i32, (v / cy).round() as i32], reach: PREDICTED_REACH }
        }
        None => Window { centre: [0, 0], reach: options.search as i32 },
    };
    let matched = from.luminance.find(&from.clusters.template(k), next, window);
    let mut starts: Vec<[f64; 2]> =
        matched.iter().map(|found| [f64::from(found.shift[0]) * cx, f64::from(found.shift[1]) * cy]).collect();
    if let Some([u, v, _]) = guess.last.or(guess.beside)
        && starts.iter().all(|start| (start[0] - u).hypot(start[1] - v) > SAME_START)
    {
        starts.push([u, v]);
    }
    starts
}

#[cfg(test)]
mod tests {
    use super::super::clusters::tests::made_up;
    use super::*;

    #[test]
    fn voxels_move_by_what_counting_makes_of_the_motion() {
        // Pixels at x = 84 and 92, disparity -10.
        let clusters = made_up(&[([10, 5, 30], 0), ([11, 5, 30], 0)], 2);
        let moved = |motion| voxel_motion(&clusters, 0, &FineMotion::translation(motion, [88.0, 44.0]));
        assert_eq!(moved([8.0, -8.0, 2.0]), Some([1.0, -1.0, 2.0]));
        assert_eq!(moved([3.0, 4.0, 0.4]), Some([0.0, 1.0, 0.0]));
        assert_eq!(moved([3.6, 0.0, 0.6]), Some([1.0, 0.0, 1.0]));
        assert_eq!(voxel_motion(&clusters, 1, &FineMotion::translation([1.0; 3], [0.0; 2])), None);
    }
}
