//! Measures the motion of every cluster towards the next view, before that is clustered.

use super::cell_luminance::CellLuminance;
use super::cell_motion::ObservedStep;
use super::cluster_motion::{ClusterMotion, PlaneMotion, places};
use super::clusters::Clusters;
use super::depth_change::{nearest, robust_mean};
use super::exposure::Exposure;
use super::lucas_kanade::{SmoothedLevels, affine_motion, visible_motion};
use crate::types::Frame;
use rayon::prelude::*;
use std::borrow::Cow;

/// Starts nearer to each other count as one, px.
const MIN_START_DISTANCE: f64 = 3.0;
/// Smallest share of a cluster's pixels with a disparity at their new places, and of those disparities that
/// agree.
const MIN_SHARE: f64 = 0.15;
/// Largest difference of agreeing changes of disparity from their mean, layers.
const AGREEING: f64 = 0.5;
/// Residual of a cluster over that of all clusters above which it is partly covered or the motion is wrong.
const MAX_UNEXPLAINED_RATIO: f64 = 2.0;

/// The next view before it is clustered.
#[derive(Debug, Clone, Copy)]
pub(super) struct NextView<'a> {
    pub luminance: &'a CellLuminance,
    pub levels: &'a SmoothedLevels,
    /// Disparities of its edge pixels, px; NaN elsewhere.
    pub disparity: &'a Frame<f32>,
}

/// Expected motion of a cluster, px and disparity.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Guess {
    /// Its last motion.
    pub last: Option<[f64; 3]>,
    /// Motion of the component that explains its middle best after itself: probably of the same object.
    pub beside: Option<[f64; 3]>,
}

/// The last view, under the exposure of the next one.
struct LastView<'a> {
    clusters: &'a Clusters,
    luminance: Cow<'a, CellLuminance>,
    levels: Cow<'a, SmoothedLevels>,
}

impl<'a> LastView<'a> {
    fn new(from: &'a ObservedStep, levels: &'a SmoothedLevels, exposure: &Exposure) -> Self {
        let clusters = &from.clusters;
        if !exposure.differs(&Exposure::SAME) {
            return Self { clusters, luminance: Cow::Borrowed(&from.luminance), levels: Cow::Borrowed(levels) };
        }
        let (luminance, levels) = (from.luminance.exposed(exposure), levels.exposed(exposure));
        Self { clusters, luminance: Cow::Owned(luminance), levels: Cow::Owned(levels) }
    }
}

/// Motion of all clusters with at least `least` pixels towards the next view by affine Lucas-Kanade, from the
/// template shift (up to `reach` cells) and from a guess. A cluster with a residual far above the others is
/// searched again from its expected motion. A change of exposure is applied to the last view first.
///
/// Depth: robust mean of the disparity at the moved pixels less the old one. `None` where views or
/// disparities do not determine the motion, or beyond `reach`.
pub(super) fn measure_motions(
    from: &ObservedStep,
    next: NextView<'_>,
    guesses: &[Guess],
    (reach, least): (i32, f64),
) -> Vec<Option<ClusterMotion>> {
    let Some(levels) = &from.levels else { return vec![None; from.clusters.components()] };
    let pictures = [levels.smooth(), next.levels.smooth()];
    let large = Exposure::large(pictures[0], pictures[1]);
    let mut last = LastView::new(from, levels, &large);
    let mut planes = plane_motions(&last, next, guesses, (reach, least));
    // A better exposure gives better motions.
    if let Some(exposure) = Exposure::of_motions(&from.clusters, &planes, pictures)
        .filter(|exposure| crate::ablation::keeps("stereo.exposure_motion") && exposure.differs(&large))
    {
        last = LastView::new(from, levels, &exposure);
        planes = plane_motions(&last, next, guesses, (reach, least));
    }
    let noise = noise(&from.clusters, &planes);
    let one = |k: usize| {
        let plane = match (planes[k]?, noise) {
            (plane, Some(noise))
                if crate::ablation::keeps("stereo.visible_motion")
                    && plane.deviation > MAX_UNEXPLAINED_RATIO * noise =>
            {
                let expected: Vec<[f64; 2]> =
                    [guesses[k].last, guesses[k].beside].into_iter().flatten().map(|[u, v, _]| [u, v]).collect();
                visible_motion(&last.levels, next.levels, &places(&from.clusters, k), (plane, &expected), noise)?
            }
            (plane, _) => plane,
        };
        let (depth, support) = depth_change(&from.clusters, k, &plane, next.disparity)?;
        (depth.abs() <= f64::from(reach)).then_some(ClusterMotion { plane, depth, support })
    };
    (0..from.clusters.components()).into_par_iter().map(one).collect()
}

/// Motion in the picture of all clusters with at least `least` pixels.
fn plane_motions(
    last: &LastView<'_>,
    next: NextView<'_>,
    guesses: &[Guess],
    (reach, least): (i32, f64),
) -> Vec<Option<PlaneMotion>> {
    let search = |k: usize| {
        let pixels = places(last.clusters, k);
        // Too few pixels: the component is seeded again.
        if (pixels.len() as f64) < least {
            return None;
        }
        let starts = starts(last, next.luminance, k, guesses[k], reach);
        affine_motion(&last.levels, next.levels, &pixels, &starts)
    };
    (0..last.clusters.components()).into_par_iter().map(search).collect()
}

/// Change of the disparity of a moved cluster, and the share of its pixels that agree; `None` where too few
/// do.
fn depth_change(clusters: &Clusters, k: usize, plane: &PlaneMotion, disparity: &Frame<f32>) -> Option<(f64, f64)> {
    let pixels = &clusters.pixels[k];
    let change = |&i: &u32| {
        let [x, y, d] = clusters.points.at(i as usize);
        let [x, y] = plane.moved(x, y);
        nearest(disparity, x, y).map(|there| there - d)
    };
    let mut changes: Vec<f64> = pixels.iter().filter_map(change).collect();
    if (changes.len() as f64) < MIN_SHARE * pixels.len() as f64 {
        return None;
    }
    let depth = robust_mean(&mut changes)?;
    // Pixels on another surface each give another change.
    let agreeing = changes.iter().filter(|change| (*change - depth).abs() <= AGREEING).count();
    (!crate::ablation::keeps("stereo.depth_agreeing") || agreeing as f64 >= MIN_SHARE * changes.len() as f64)
        .then_some((depth, agreeing as f64 / pixels.len() as f64))
}

/// Noise: weighted median of the residuals of all clusters, grey levels.
fn noise(clusters: &Clusters, planes: &[Option<PlaneMotion>]) -> Option<f64> {
    let mut deviations: Vec<(f64, usize)> = planes
        .iter()
        .enumerate()
        .filter_map(|(k, plane)| Some((plane.as_ref()?.deviation, clusters.pixels[k].len())))
        .collect();
    deviations.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = deviations.iter().map(|(_, pixels)| pixels).sum::<usize>() / 2;
    let mut below = 0;
    deviations.into_iter().find_map(|(deviation, pixels)| {
        below += pixels;
        (below > half).then_some(deviation)
    })
}

/// Starts of a cluster's translation, px.
fn starts(last: &LastView<'_>, next: &CellLuminance, k: usize, guess: Guess, reach: i32) -> Vec<[f64; 2]> {
    let [cx, cy, _] = last.clusters.lattice().cell();
    let matched = last.luminance.find(&last.clusters.template(k), next, reach);
    let mut starts: Vec<[f64; 2]> =
        matched.iter().map(|found| [f64::from(found.shift[0]) * cx, f64::from(found.shift[1]) * cy]).collect();
    if let Some([u, v, _]) = guess.last.or(guess.beside)
        && starts.iter().all(|start| (start[0] - u).hypot(start[1] - v) > MIN_START_DISTANCE)
    {
        starts.push([u, v]);
    }
    starts
}

#[cfg(test)]
mod tests {
    use super::super::clusters::tests::synthetic_clusters;
    use super::*;

    #[test]
    fn the_noise_is_that_of_most_pixels() {
        let block = |x: u16, n: u16, k: u32| (0..n).map(move |i| ([x + i % 5, i / 5, 9], k));
        let clusters =
            synthetic_clusters(&block(0, 20, 0).chain(block(10, 50, 1)).chain(block(20, 20, 2)).collect::<Vec<_>>(), 4);
        let left = |deviation| {
            let plane = ClusterMotion::translation([0.0; 3], [0.0; 2]).plane;
            Some(PlaneMotion { deviation, ..plane })
        };
        assert_eq!(noise(&clusters, &[left(0.5), left(0.8), left(9.0), None]), Some(0.8));
        assert_eq!(noise(&clusters, &[None, None, left(9.0), None]), Some(9.0));
        assert_eq!(noise(&clusters, &[None; 4]), None);
    }

    #[test]
    fn disparities_of_other_surfaces_are_no_motion_in_depth() {
        // Three columns of pixels, disparity -10; next: half a disparity more, or another surface in each
        // row.
        let cells: Vec<_> = (0..30).map(|i| ([10 + i % 3, i / 3, 30], 0)).collect();
        let clusters = synthetic_clusters(&cells, 1);
        let plane = ClusterMotion::translation([2.0, 0.0, 0.0], [88.0, 44.0]).plane;
        let next = |disparity: &dyn Fn(usize) -> f32| {
            let mut map = Frame::filled(640, 480, f32::NAN);
            for &i in &clusters.pixels[0] {
                let [x, y, _] = clusters.points.at(i as usize);
                map.row_mut(y as usize)[x as usize + 2] = disparity(i as usize);
            }
            map
        };
        let change = |disparity: &dyn Fn(usize) -> f32| depth_change(&clusters, 0, &plane, &next(disparity));
        let (depth, support) = change(&|_| -9.5).unwrap();
        assert!((depth - 0.5).abs() < 1e-6 && support == 1.0);
        // A third is on another surface.
        let (depth, support) = change(&|i| if i % 3 == 0 { 5.0 } else { -9.5 }).unwrap();
        assert!((depth - 0.5).abs() < 0.05 && (support - 2.0 / 3.0).abs() < 1e-9);
        assert_eq!(change(&|i| -40.0 + 2.0 * i as f32), None);
        assert_eq!(change(&|i| if i % 10 == 0 { -9.5 } else { f32::NAN }), None);
    }
}
