//! Motion of every cluster measured towards the next view, before anything is clustered there.

use super::cell_luminance::CellLuminance;
use super::clusters::Clusters;
use super::disparity_change::{nearest, robust_mean};
use super::exposure::Exposure;
use super::fine_motion::{FineMotion, places};
use super::lucas_kanade::{PlaneMotion, SmoothedLevels, affine_motion, visible_motion};
use super::motion::Seen;
use crate::types::Frame;
use rayon::prelude::*;
use std::borrow::Cow;

/// First guesses nearer than this to one another are one, px.
const SAME_START: f64 = 3.0;
/// Least share of a cluster's pixels at whose new places there must be a disparity, and of those disparities
/// that agree.
const LEAST_SHARE: f64 = 0.15;
/// Changes of disparity that agree differ from their mean by no more than this, layers of voxels.
const AGREEING: f64 = 0.5;
/// Deviations of what its motion leaves above this, over that of motions in general, need another explanation
/// than noise.
const UNEXPLAINED: f64 = 2.0;

/// What the next step shows before anything is clustered in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct NextView<'a> {
    pub luminance: &'a CellLuminance,
    pub levels: &'a SmoothedLevels,
    /// Disparities of its edge pixels, px; NaN elsewhere.
    pub disparity: &'a Frame<f32>,
}

/// What a cluster's motion may be, px and disparity, before it is measured.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Guess {
    /// The one that it had last.
    pub last: Option<[f64; 3]>,
    /// That of the component which explains its middle best after itself: what it probably belongs to.
    pub beside: Option<[f64; 3]>,
}

/// The last step's picture, under the exposure of the next one.
struct LastView<'a> {
    clusters: &'a Clusters,
    luminance: Cow<'a, CellLuminance>,
    levels: Cow<'a, SmoothedLevels>,
}

impl<'a> LastView<'a> {
    fn new(from: &'a Seen, levels: &'a SmoothedLevels, exposure: &Exposure) -> Self {
        let clusters = &from.clusters;
        if !exposure.differs(&Exposure::SAME) {
            return Self { clusters, luminance: Cow::Borrowed(&from.luminance), levels: Cow::Borrowed(levels) };
        }
        let (luminance, levels) = (from.luminance.exposed(exposure), levels.exposed(exposure));
        Self { clusters, luminance: Cow::Owned(luminance), levels: Cow::Owned(levels) }
    }
}

/// Motion of all clusters with at least so many pixels towards the next view by affine Lucas-Kanade, from the
/// template's shift (up to `reach` cells) and from a guess. What leaves much more of the picture than motions
/// in general is partly hidden, or a coincidence: it is looked for again from what is expected. Where the
/// exposure changed, both are done in the last picture as that would have made it.
///
/// Depth: robust mean of what the disparity is at the moved pixels less what it was. `None` where the picture
/// or the disparities do not tell, or tell of more than is searched for.
pub(super) fn fine_motions(
    from: &Seen,
    next: NextView<'_>,
    guesses: &[Guess],
    (reach, least): (i32, f64),
) -> Vec<Option<FineMotion>> {
    let Some(levels) = &from.levels else { return vec![None; from.clusters.components()] };
    let pictures = [levels.smooth(), next.levels.smooth()];
    let large = Exposure::large(pictures[0], pictures[1]);
    let mut last = LastView::new(from, levels, &large);
    let mut planes = plane_motions(&last, next, guesses, (reach, least));
    // What motions tell of the exposure leads to better ones.
    if let Some(told) = Exposure::of_motions(&from.clusters, &planes, pictures)
        .filter(|told| crate::ablation::keeps("stereo.exposure_motion") && told.differs(&large))
    {
        last = LastView::new(from, levels, &told);
        planes = plane_motions(&last, next, guesses, (reach, least));
    }
    let noise = noise(&from.clusters, &planes);
    let one = |k: usize| {
        let plane = match (planes[k]?, noise) {
            (plane, Some(noise))
                if crate::ablation::keeps("stereo.visible_motion") && plane.deviation > UNEXPLAINED * noise =>
            {
                let expected: Vec<[f64; 2]> =
                    [guesses[k].last, guesses[k].beside].into_iter().flatten().map(|[u, v, _]| [u, v]).collect();
                visible_motion(&last.levels, next.levels, &places(&from.clusters, k), (plane, &expected), noise)?
            }
            (plane, _) => plane,
        };
        let (depth, support) = depth_change(&from.clusters, k, &plane, next.disparity)?;
        (depth.abs() <= f64::from(reach)).then_some(FineMotion { plane, depth, support })
    };
    (0..from.clusters.components()).into_par_iter().map(one).collect()
}

/// Motion in the picture of all clusters with at least so many pixels.
fn plane_motions(
    last: &LastView<'_>,
    next: NextView<'_>,
    guesses: &[Guess],
    (reach, least): (i32, f64),
) -> Vec<Option<PlaneMotion>> {
    let search = |k: usize| {
        let pixels = places(last.clusters, k);
        // So few say nothing sure, and are seeded anew.
        if (pixels.len() as f64) < least {
            return None;
        }
        let starts = starts(last, next.luminance, k, guesses[k], reach);
        affine_motion(&last.levels, next.levels, &pixels, &starts)
    };
    (0..last.clusters.components()).into_par_iter().map(search).collect()
}

/// Change of the disparity of a cluster's pixels that move in the picture, and the share of all its pixels
/// that meet it; `None` where too few meet a disparity, or too few of those agree.
fn depth_change(clusters: &Clusters, k: usize, plane: &PlaneMotion, disparity: &Frame<f32>) -> Option<(f64, f64)> {
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
    (!crate::ablation::keeps("stereo.depth_agreeing") || agreeing as f64 >= LEAST_SHARE * changes.len() as f64)
        .then_some((depth, agreeing as f64 / pixels.len() as f64))
}

/// Deviation of what motions leave in general, grey levels: the median over the pixels of all clusters that
/// have one.
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
fn starts(last: &LastView<'_>, next: &CellLuminance, k: usize, guess: Guess, reach: i32) -> Vec<[f64; 2]> {
    let [cx, cy, _] = last.clusters.lattice().cell();
    let matched = last.luminance.find(&last.clusters.template(k), next, reach);
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
    fn disparities_of_other_surfaces_are_no_motion_in_depth() {
        // Three columns of pixels, disparity -10; what is there next: half a disparity more, or something
        // else in each row.
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
        let (depth, support) = told(&|_| -9.5).unwrap();
        assert!((depth - 0.5).abs() < 1e-6 && support == 1.0);
        // A third meets something else.
        let (depth, support) = told(&|i| if i % 3 == 0 { 5.0 } else { -9.5 }).unwrap();
        assert!((depth - 0.5).abs() < 0.05 && (support - 2.0 / 3.0).abs() < 1e-9);
        assert_eq!(told(&|i| -40.0 + 2.0 * i as f32), None);
        assert_eq!(told(&|i| if i % 10 == 0 { -9.5 } else { f32::NAN }), None);
    }
}
