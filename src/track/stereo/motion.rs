//! Motion of every cluster from one step to the other: in the picture, in depth, and whom it meets.

use super::cell_luminance::CellLuminance;
use super::clusters::Clusters;
use super::disparity_change::{nearest, robust_mean};
use super::lucas_kanade::{PlaneMotion, SmoothedLevels, affine_motion, following, visible_motion};
use super::options::StereoTrackerOptions;
use super::overlap::{Row, depth_motion};
use crate::math::median;
use crate::types::{AffineFlow, Frame};
use rayon::prelude::*;

/// First guesses nearer than this to one another are one, px.
const SAME_START: f64 = 3.0;
/// Least share of a cluster's pixels at whose new places there must be a disparity, and of those disparities that agree.
const LEAST_SHARE: f64 = 0.15;
/// Changes of disparity that agree differ from their mean by no more than this, layers of voxels.
const AGREEING: f64 = 0.5;
/// Deviations of what its motion leaves above this, over that of motions in general, need another explanation than noise.
const UNEXPLAINED: f64 = 2.0;

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

/// Motion in cells of all clusters towards another step: (29), then (30) to (32). `None` for empty ones, those whose template leaves the picture, and all where the other step has no
/// edge pixels: every template fits somewhere in a picture of nothing.
pub(super) fn cell_motions(from: &Seen, to: &Seen, options: &StereoTrackerOptions) -> Vec<Option<CellMotion>> {
    if to.clusters.points.is_empty() {
        return vec![None; from.clusters.components()];
    }
    let reach = options.search as i32;
    let one = |k: usize| {
        let template = from.clusters.template(k);
        let found = from.luminance.find(&template, &to.luminance, reach)?;
        let depth = depth_motion(&from.clusters, k, &to.clusters, found.shift, reach);
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
    /// `(u, v, w)` of the cluster as a whole, px and disparity per step: medians over its pixels that follow the motion. Of what grows and has more of its pixels on one side, the motion at the centre is another one.
    pub typical: [f64; 3],
}

impl FineMotion {
    /// `(u, v, w)` at the centre, px and disparity.
    pub fn velocity(&self) -> [f64; 3] {
        [self.plane.flow.u, self.plane.flow.v, self.depth]
    }

    /// From both parts of a motion and the pixels `(x, y)` that follow it.
    fn new(plane: PlaneMotion, depth: f64, following: &[[f64; 2]]) -> Self {
        let flows = following.iter().map(|[x, y]| plane.flow.at_offset(x - plane.centre[0], y - plane.centre[1]));
        let (mut along_x, mut along_y): (Vec<f64>, Vec<f64>) = flows.unzip();
        let typical =
            [median(&mut along_x).unwrap_or(plane.flow.u), median(&mut along_y).unwrap_or(plane.flow.v), depth];
        Self { plane, depth, typical }
    }

    /// A translation of a cluster whose pixels have the middle `centre`.
    pub fn translation([u, v, w]: [f64; 3], centre: [f64; 2]) -> Self {
        let flow = AffineFlow { u, v, ..AffineFlow::default() };
        Self::new(PlaneMotion { flow, centre, residual: f64::NAN, deviation: f64::NAN }, w, &[])
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
    /// That of the component which explains its middle best after itself: what it probably belongs to.
    pub beside: Option<[f64; 3]>,
}

/// Motion of all clusters towards the next view by affine Lucas-Kanade, from the template's shift and from a guess. What leaves much more of the picture than motions in general is
/// partly hidden, or a coincidence: it is looked for again from what is expected.
///
/// Depth: robust mean of what the disparity is at the moved pixels less what it was. `None` where the picture or the disparities do not tell, or tell of more than is searched for.
pub(super) fn fine_motions(
    from: &Seen,
    next: NextView<'_>,
    guesses: &[Guess],
    options: &StereoTrackerOptions,
) -> Vec<Option<FineMotion>> {
    let count = from.clusters.components();
    let Some(levels) = &from.levels else { return vec![None; count] };
    let search = |k: usize| {
        let pixels = places(&from.clusters, k);
        // So few say nothing sure, and are seeded anew.
        if (pixels.len() as f64) < options.reseed_below {
            return None;
        }
        affine_motion(levels, next.levels, &pixels, &starts(from, next.luminance, k, guesses[k], options))
    };
    let planes: Vec<Option<PlaneMotion>> = (0..count).into_par_iter().map(search).collect();
    let noise = noise(&from.clusters, &planes);
    let one = |k: usize| {
        let plane = match (planes[k]?, noise) {
            (plane, Some(noise)) if plane.deviation > UNEXPLAINED * noise => {
                let expected: Vec<[f64; 2]> =
                    [guesses[k].last, guesses[k].beside].into_iter().flatten().map(|[u, v, _]| [u, v]).collect();
                visible_motion(levels, next.levels, &places(&from.clusters, k), (plane, &expected), noise)?
            }
            (plane, _) => plane,
        };
        let depth = depth_change(&from.clusters, k, &plane, next.disparity)?;
        let following = || following(levels, next.levels, &places(&from.clusters, k), &plane);
        (depth.abs() <= options.search as f64).then(|| FineMotion::new(plane, depth, &following()))
    };
    (0..count).into_par_iter().map(one).collect()
}

/// Change of the disparity of a cluster's pixels that move in the picture; `None` where too few meet a disparity, or too few of those agree.
fn depth_change(clusters: &Clusters, k: usize, plane: &PlaneMotion, disparity: &Frame<f32>) -> Option<f64> {
    let pixels = &clusters.pixels[k];
    let change = |&i: &u32| {
        let [x, y, d] = clusters.points.at(i as usize);
        let [x, y] = plane.moved(x, y);
        nearest(disparity, x, y).map(|there| there - d)
    };
    let mut changes: Vec<f64> = pixels.iter().filter_map(change).collect();
    if (changes.len() as f64) < LEAST_SHARE * pixels.len() as f64 {
        return None;
    }
    let depth = robust_mean(&mut changes)?;
    // Pixels that meet another surface tell a change of disparity, too, but each another one.
    let agreeing = changes.iter().filter(|change| (*change - depth).abs() <= AGREEING).count();
    (agreeing as f64 >= LEAST_SHARE * changes.len() as f64).then_some(depth)
}

/// Deviation of what motions leave in general, grey levels: the median over the pixels of all clusters that have one.
fn noise(clusters: &Clusters, planes: &[Option<PlaneMotion>]) -> Option<f64> {
    let mut told: Vec<(f64, usize)> = planes
        .iter()
        .enumerate()
        .filter_map(|(k, plane)| Some((plane.as_ref()?.deviation, clusters.pixels[k].len())))
        .collect();
    told.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = told.iter().map(|(_, pixels)| pixels).sum::<usize>() / 2;
    let mut below = 0;
    told.into_iter().find_map(|(deviation, pixels)| {
        below += pixels;
        (below > half).then_some(deviation)
    })
}

/// First guesses of a cluster's translation, px.
fn starts(from: &Seen, next: &CellLuminance, k: usize, guess: Guess, options: &StereoTrackerOptions) -> Vec<[f64; 2]> {
    let [cx, cy, _] = from.clusters.lattice().cell();
    let matched = from.luminance.find(&from.clusters.template(k), next, options.search as i32);
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
    fn a_picture_of_nothing_has_no_motion_either_way() {
        let cells: Vec<_> = (0..40).map(|i| ([20 + i % 5, 30 + i / 5, 40], 0)).collect();
        let options = StereoTrackerOptions::new(super::super::options::StereoMode::Paper);
        let seen = |clusters: Clusters, level: &dyn Fn(usize, usize) -> f32| {
            let luminance = CellLuminance::new(&Frame::from_fn(640, 480, level), clusters.lattice(), 64);
            Seen { clusters, luminance, levels: None }
        };
        let one = seen(made_up(&cells, 1), &|x, y| ((x / 8 * 37 + y / 8 * 11) % 256) as f32);
        let nothing = seen(made_up(&[], 0), &|_, _| 0.0);
        assert_eq!(cell_motions(&one, &nothing, &options), [None]);
        assert_eq!(cell_motions(&nothing, &one, &options), []);
        assert_eq!(cell_motions(&one, &one, &options)[0].as_ref().map(|motion| motion.shift), Some([0, 0, 0]));
    }

    #[test]
    fn the_noise_is_that_of_most_pixels() {
        let block = |x: u16, n: u16, k: u32| (0..n).map(move |i| ([x + i % 5, i / 5, 9], k));
        let clusters = made_up(&block(0, 20, 0).chain(block(10, 50, 1)).chain(block(20, 20, 2)).collect::<Vec<_>>(), 4);
        let left = |deviation| {
            let plane = FineMotion::translation([0.0; 3], [0.0; 2]).plane;
            Some(PlaneMotion { deviation, ..plane })
        };
        assert_eq!(noise(&clusters, &[left(0.5), left(0.8), left(9.0), None]), Some(0.8));
        assert_eq!(noise(&clusters, &[None, None, left(9.0), None]), Some(9.0));
        assert_eq!(noise(&clusters, &[None; 4]), None);
    }

    #[test]
    fn the_motion_of_a_cluster_is_that_of_most_of_its_pixels() {
        let motion = FineMotion::translation([2.0, -1.0, 0.5], [10.0, 10.0]);
        let growing = AffineFlow { u_x: 0.1, v_y: 0.1, v_x: 0.2, ..motion.plane.flow };
        let plane = PlaneMotion { flow: growing, ..motion.plane };
        // The medians along x and along y are no pixel's flow: u is 1, 1.5, 2, 2, 3 and v -3, -2, -2, -1, 2.
        let pixels = [[0.0, 10.0], [10.0, 10.0], [10.0, 0.0], [5.0, 10.0], [20.0, 20.0]];
        let [u, v, w] = FineMotion::new(plane, 0.5, &pixels).typical;
        assert!((u - 2.0).abs() < 1e-12 && (v + 2.0).abs() < 1e-12 && w == 0.5, "{u} {v} {w}");
        assert_eq!(motion.typical, [2.0, -1.0, 0.5]);
    }

    #[test]
    fn disparities_of_other_surfaces_are_no_motion_in_depth() {
        // Three columns of pixels, disparity -10; what is there next: half a disparity more, or something else in each row.
        let cells: Vec<_> = (0..30).map(|i| ([10 + i % 3, i / 3, 30], 0)).collect();
        let clusters = made_up(&cells, 1);
        let plane = FineMotion::translation([2.0, 0.0, 0.0], [88.0, 44.0]).plane;
        let next = |disparity: &dyn Fn(usize) -> f32| {
            let mut map = Frame::filled(640, 480, f32::NAN);
            for &i in &clusters.pixels[0] {
                let [x, y, _] = clusters.points.at(i as usize);
                map.row_mut(y as usize)[x as usize + 2] = disparity(i as usize);
            }
            map
        };
        let told = |disparity: &dyn Fn(usize) -> f32| depth_change(&clusters, 0, &plane, &next(disparity));
        assert!((told(&|_| -9.5).unwrap() - 0.5).abs() < 1e-6);
        // A third meets something else.
        assert!((told(&|i| if i % 3 == 0 { 5.0 } else { -9.5 }).unwrap() - 0.5).abs() < 0.05);
        assert_eq!(told(&|i| -40.0 + 2.0 * i as f32), None);
        assert_eq!(told(&|i| if i % 10 == 0 { -9.5 } else { f32::NAN }), None);
    }

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
