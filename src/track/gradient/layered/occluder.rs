//! Which pixels of the first box are the target's, and which are of an object at rest in front of it.

use super::{initial::Changes, initial::InitialSegmentation, patch::smooth_known, patch::wide};
use crate::math::robust_std;
use crate::types::Frame;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Change over what noise makes that is beyond doubt.
const CLEAR: f64 = 2.0;
/// Pairs of pixels on either side of the still edge, over the shorter side of the box times the displacement
/// but for a pixel.
const EDGE: f64 = 0.4;
/// Fewest of them.
const MIN_PAIRS: usize = 12;
/// Share of them that look as they should.
const MIN_AGREEING_SHARE: f64 = 0.6;
/// Width of the mean of what is known to move, share of the shorter side, and least, px.
const WIDTH: (f64, f64) = (0.25, 2.0);
/// Difference from it, over its scatter, of what looks like the target; and grey levels.
const MAX_DIFFERENCE: (f64, f64) = (3.0, 6.0);
/// Share of the box that may be hidden.
const HIDDEN_SHARE_RANGE: [f64; 2] = [0.05, 0.9];
/// Least distance of the middles of its two parts, over its shorter side: those of a box cut in two are half
/// a side apart, those of a target that changes its shape are near each other.
const MIN_CENTER_DISTANCE: f64 = 0.3;
/// Share of either part that may not do as it should.
const MAX_OUTLIER_SHARE: f64 = 0.02;
/// Around the box, what is behind the target is measured on, px.
const AROUND: usize = 3;
/// Displacement, px squared, beyond which what moves is separated from what does not.
const MIN_SQUARED_DISPLACEMENT: isize = 2;
/// Longest way between pixels, as one counts that differ only by noise.
const MAX_PATH_STEP: f64 = 1e6;

/// Part of the first box is an object at rest in front of the target.
#[derive(Debug)]
pub(super) struct HiddenPart {
    /// How far the target moved since the first frame, px.
    pub moved: [f64; 2],
    /// Frames since then.
    pub frames: usize,
    /// Pixels of the patch that are in the box and not the target's.
    pub hidden: Frame<bool>,
}

pub(super) fn find_occluder(initial: &mut InitialSegmentation, frame: &Frame<f64>, noise: f64) -> Option<HiddenPart> {
    initial.advance();
    let changes = initial.changes(frame, noise);
    let moved = changes.displacement()?;
    let told = moved[0] * moved[0] + moved[1] * moved[1] > MIN_SQUARED_DISPLACEMENT;
    let hidden = if told && crate::ablation::keeps("gradient.start_occluder") { hidden(&changes, moved) } else { None };
    initial.keep_displacement(moved);
    hidden.map(|hidden| HiddenPart { moved: moved.map(|m| m as f64), frames: initial.frames(), hidden })
}

/// Pixels of the box at which an object at rest hides the target; `None` without evidence.
///
/// Along a still edge the content of the first frame neither follows the target nor changes. The target's
/// side looks like what moves, the other side does not; from a margin behind it the target moves away.
fn hidden(changes: &Changes<'_>, moved: [isize; 2]) -> Option<Frame<bool>> {
    let evidence = Evidence::of(changes, moved);
    let look = Appearance::of(changes, &evidence.moving)?;
    let fewest = EDGE * changes.segmentation.side() * ((moved[0] as f64).hypot(moved[1] as f64) - 1.0);
    let first = &changes.segmentation.first.frame;
    let (mut still, mut agreed) = (Vec::new(), 0);
    for &(from, to) in &evidence.edge {
        let came = look.holds(changes.now.get(to[0], to[1]), to);
        let was = look.holds(first.get(from[0], from[1]), from);
        if came != was {
            agreed += 1;
            still.push(if came { from } else { to });
        }
    }
    if (agreed as f64) < fewest.max(MIN_PAIRS as f64).max(MIN_AGREEING_SHARE * evidence.edge.len() as f64) {
        return None;
    }
    let hidden = spread(changes, &evidence.moving, &still);
    let (share, apart) = parts(changes, &hidden);
    let cut = (HIDDEN_SHARE_RANGE[0]..HIDDEN_SHARE_RANGE[1]).contains(&share)
        && apart > MIN_CENTER_DISTANCE * changes.segmentation.side();
    (cut && is_so(changes, &hidden, moved)).then_some(hidden)
}

/// Whether both parts are unchanged: the occluder in place, the target moved along except where hidden.
fn is_so(changes: &Changes<'_>, hidden: &Frame<bool>, moved: [isize; 2]) -> bool {
    let (mut strays, mut counts) = ([0.0; 2], [0.0; 2]);
    let clear = CLEAR * changes.bar;
    for from in changes.inside(1) {
        let is_hidden = hidden.get(from[0], from[1]);
        let off = if is_hidden {
            changes.at_rest(from) > clear
        } else {
            let to = changes.on(from, moved).filter(|to| !hidden.get(to[0], to[1]));
            to.is_some_and(|to| unlike_all_around(changes, from, to) > clear)
        };
        counts[usize::from(is_hidden)] += 1.0;
        strays[usize::from(is_hidden)] += f64::from(u8::from(off));
    }
    (0..2).all(|k| strays[k] <= MAX_OUTLIER_SHARE * counts[k])
}

/// Share of the box that is hidden, and the distance of the middles of its two parts, px.
fn parts(changes: &Changes<'_>, hidden: &Frame<bool>) -> (f64, f64) {
    let mut sums = [[0.0; 3]; 2];
    for [x, y] in changes.inside(1) {
        let sum = &mut sums[usize::from(hidden.get(x, y))];
        *sum = [sum[0] + 1.0, sum[1] + x as f64, sum[2] + y as f64];
    }
    let [seen, not] = sums.map(|[count, x, y]| [x / count, y / count]);
    (sums[1][0] / (sums[0][0] + sums[1][0]), (seen[0] - not[0]).hypot(seen[1] - not[1]))
}

struct Evidence {
    /// Pixels of the first box that were followed by the displacement, and not by rest.
    moving: Vec<[usize; 2]>,
    /// Pairs (pixel of the box, moved pixel) where the displacement fails and neither pixel changed.
    edge: Vec<([usize; 2], [usize; 2])>,
}

impl Evidence {
    fn of(changes: &Changes<'_>, moved: [isize; 2]) -> Self {
        let (mut moving, mut edge) = (Vec::new(), Vec::new());
        let clear = CLEAR * changes.bar;
        for from in changes.inside(1) {
            let Some(to) = changes.on(from, moved) else { continue };
            let (along, here, there) = (changes.along(from, to), changes.at_rest(from), changes.at_rest(to));
            let stays = here <= changes.bar || there <= changes.bar && changes.segmentation.inside.get(to[0], to[1]);
            if along <= changes.bar && here.max(there) > clear {
                moving.push(from);
            } else if stays && unlike_all_around(changes, from, to) > clear {
                edge.push((from, to));
            }
        }
        Self { moving, edge }
    }
}

/// Change between the surroundings of two pixels: displacements are whole pixels, targets turn and grow.
fn unlike_all_around(changes: &Changes<'_>, [x, y]: [usize; 2], [i, j]: [usize; 2]) -> f64 {
    let first = &changes.segmentation.first.frame;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for row in wide(y, 1, first.height()) {
        for value in &first.row(row)[wide(x, 1, first.width())] {
            (low, high) = (low.min(*value), high.max(*value));
        }
    }
    let now = changes.now.get(i, j);
    (low - now).max(now - high)
}

struct Appearance {
    mean: Frame<f64>,
    scatter: f64,
    behind: f64,
}

impl Appearance {
    fn of(changes: &Changes<'_>, moving: &[[usize; 2]]) -> Option<Self> {
        let first = &changes.segmentation.first.frame;
        let (width, height) = first.size();
        let mut known = Frame::filled(width, height, f64::NAN);
        for [x, y] in moving {
            known.row_mut(*y)[*x] = first.get(*x, *y);
        }
        let mean = smooth_known(&known, (WIDTH.0 * changes.segmentation.side()).max(WIDTH.1));
        let mut off: Vec<f64> = moving.iter().map(|[x, y]| (first.get(*x, *y) - mean.get(*x, *y)).abs()).collect();
        let scatter = robust_std(&mut off).unwrap_or(0.0);
        (moving.len() >= MIN_PAIRS).then(|| Self {
            mean,
            scatter: scatter.max(changes.bar / 4.0),
            behind: behind(changes),
        })
    }

    fn holds(&self, value: f64, [x, y]: [usize; 2]) -> bool {
        let off = (value - self.mean.get(x, y)).abs();
        // Far from all that moves nothing is known, and nothing holds.
        off < MAX_DIFFERENCE.0 * self.scatter + MAX_DIFFERENCE.1 && off < (value - self.behind).abs()
    }
}

/// Mean brightness around the box in the first frame, grey levels.
fn behind(changes: &Changes<'_>) -> f64 {
    let inside = &changes.segmentation.inside;
    let (width, height) = inside.size();
    let (mut sum, mut count) = (0.0, 0.0);
    for y in 0..height {
        for x in (0..width).filter(|x| !inside.get(*x, y)) {
            if wide(y, AROUND, height).any(|j| inside.row(j)[wide(x, AROUND, width)].contains(&true)) {
                sum += changes.segmentation.first.frame.get(x, y);
                count += 1.0;
            }
        }
    }
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

/// Assigns every pixel of the box to what moves or is still, by paths that avoid brightness steps.
fn spread(changes: &Changes<'_>, moving: &[[usize; 2]], still: &[[usize; 2]]) -> Frame<bool> {
    let first = &changes.segmentation.first.frame;
    let (width, height) = first.size();
    let mut hidden = Frame::filled(width, height, false);
    let mut reached = Frame::filled(width, height, u64::MAX);
    let mut next = BinaryHeap::new();
    for (seeds, label) in [(moving, false), (still, true)] {
        for &[x, y] in seeds {
            reached.row_mut(y)[x] = 0;
            next.push(Reverse((0, y, x, label)));
        }
    }
    while let Some(Reverse((way, y, x, label))) = next.pop() {
        if way > reached.get(x, y) {
            continue;
        }
        hidden.row_mut(y)[x] = label;
        for (i, j) in [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)] {
            if i >= width || j >= height || !changes.segmentation.inside.get(i, j) {
                continue;
            }
            let step = (first.get(i, j) - first.get(x, y)) / changes.bar;
            let longer = way + (1.0 + (3.0 * step).powi(2)).min(MAX_PATH_STEP) as u64;
            if longer < reached.get(i, j) {
                reached.row_mut(j)[i] = longer;
                next.push(Reverse((longer, j, i, label)));
            }
        }
    }
    hidden
}
