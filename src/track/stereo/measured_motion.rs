//! Measures the motion of every cluster towards the next view, before that is clustered.

use super::cell_luminance::CellLuminance;
use super::cell_motion::ObservedStep;
use super::cluster_motion::{ClusterMotion, PlaneMotion, places};
use super::clusters::Clusters;
use super::depth_change::{nearest, robust_mean};
use super::exposure::Exposure;
use super::lucas_kanade::{SmoothedLevels, affine_motion};
use crate::parallel;
use crate::types::Frame;
use std::borrow::Cow;

/// Starts nearer to each other count as one, px.
const MIN_START_DISTANCE: f64 = 3.0;
/// Smallest share of a cluster's pixels with a disparity at their new places.
const MIN_SHARE: f64 = 0.15;
/// Largest difference of agreeing changes of disparity from their mean, layers.
const AGREEING: f64 = 0.5;

#[derive(Debug, Clone, Copy)]
pub(super) struct NextView<'a> {
    pub luminance: &'a CellLuminance,
    pub levels: &'a SmoothedLevels,
    /// Disparities of its edge pixels, px; NaN elsewhere.
    pub disparity: &'a Frame<f32>,
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

/// Motion of all clusters of at least `least` pixels towards the next view, from the template shift (up to
/// `reach` cells) and from a guess, px. A change of exposure is applied to the last view first. Depth: robust
/// mean of the disparity change. `None` where undetermined, or beyond `reach`.
pub(super) fn measure_motions(
    from: &ObservedStep,
    next: NextView<'_>,
    guesses: &[Option<[f64; 2]>],
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
    let one = |k: usize| {
        let plane = planes[k]?;
        let (depth, support) = depth_change(&from.clusters, k, &plane, next.disparity)?;
        (depth.abs() <= f64::from(reach)).then_some(ClusterMotion { plane, depth, support })
    };
    parallel::map(0..from.clusters.components(), one)
}

fn plane_motions(
    last: &LastView<'_>,
    next: NextView<'_>,
    guesses: &[Option<[f64; 2]>],
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
    parallel::map(0..last.clusters.components(), search)
}

/// Change of the disparity of a moved cluster, and the share of its pixels that agree; `None` where too few
/// have a disparity.
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
    let agreeing = changes.iter().filter(|change| (*change - depth).abs() <= AGREEING).count();
    Some((depth, agreeing as f64 / pixels.len() as f64))
}

fn starts(last: &LastView<'_>, next: &CellLuminance, k: usize, guess: Option<[f64; 2]>, reach: i32) -> Vec<[f64; 2]> {
    let [cx, cy, _] = last.clusters.lattice().cell();
    let matched = last.luminance.find(&last.clusters.template(k), next, reach);
    let mut starts: Vec<[f64; 2]> =
        matched.iter().map(|found| [f64::from(found.shift[0]) * cx, f64::from(found.shift[1]) * cy]).collect();
    if let Some([u, v]) = guess
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
        assert_eq!(change(&|i| if i % 10 == 0 { -9.5 } else { f32::NAN }), None);
    }
}
