//! The first object that moves: its box from two frames, where nobody gave one.

use super::{noise::NOISE_SAMPLES, noise::noise_of, shift::half_a_pixel_around};
use crate::types::{Frame, TargetBox};

/// Change over the noise of a difference that is one.
const CHANGE: f64 = 3.0;
/// Least noise, grey levels.
const MIN_NOISE: f64 = 1.0;
/// Noise that a still camera has at most, grey levels: all that a moving one changes is not noise.
const MAX_NOISE: f64 = 5.0;
/// Share of the frame that changes when the camera moves.
const MIN_CAMERA_CHANGE: f64 = 0.1;
/// Changed pixels among the nine around a pixel that make it more than noise.
const MIN_CHANGED_NEIGHBOURS: usize = 3;
/// Side of the squares that pixels are gathered in, px.
const CELL: usize = 8;
/// Share of the longer one's extent that two ends of an object have in common.
const SAME_EXTENT: f64 = 0.7;
/// What noise and soft edges add to the thickness of the ends of an object, which is how far it moved, px.
const EDGE_WIDTH: f64 = 3.0;
/// Fewest changed pixels of an object.
const MIN_PIXELS: usize = 8;
/// Farthest displacement from frame to frame, px.
const MAX_DISPLACEMENT: isize = 10;
/// Cost ratio, and residual over the noise, of displacements that count as equal: the smallest is taken,
/// since larger ones explain an even target as well. Noise alone leaves 1.13.
const EQUAL_COST: (f64, f64) = (1.05, 1.4);
/// Difference that all larger ones count as, grey levels.
const MAX_DIFFERENCE: f64 = 40.0;
/// Maximum number of pixels, about, that judge a displacement; larger objects are subsampled.
const VOTES: f64 = 4096.0;
/// Smallest side of what is found, px.
const MIN_SIDE: f64 = 3.0;

/// A moving object in two successive frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovingTarget {
    /// Its box in the second frame.
    pub bounds: TargetBox,
    /// How far it moved, whole px.
    pub displacement: [f64; 2],
}

/// Finds what moves between two frames of a still scene: the largest object, or that nearest to a point.
///
/// Changed pixels differ by three standard deviations of the noise and have changed neighbours. The
/// displacement within 10 px along each axis is the smallest that explains them nearly best, as what came or
/// as what went; the box is the extent of the changed pixels less the displacement. `None` where nothing
/// moves.
pub fn detect_moving_target(first: &Frame<f64>, second: &Frame<f64>, near: Option<[f64; 2]>) -> Option<MovingTarget> {
    if first.size() != second.size() {
        return None;
    }
    let noise = noise_of(first, second, NOISE_SAMPLES).max(MIN_NOISE);
    let changed = changed(first, second, noise);
    let mut objects = objects(&crowded(&changed));
    objects.retain(|pixels| pixels.len() >= MIN_PIXELS);
    let rank = |pixels: &[(usize, usize)]| near.map_or(-(pixels.len() as f64), |at| distance(pixels, at));
    let chosen = (0..objects.len()).min_by(|a, b| rank(&objects[*a]).total_cmp(&rank(&objects[*b])))?;
    let object = objects.swap_remove(chosen);
    let between = half_a_pixel_around(first);
    let explain = |object: &[(usize, usize)]| displacement(&between, second, object, noise);
    // An even target uncovers and covers areas apart by its length: both together leave no residual.
    let whole = objects
        .iter()
        .filter(|other| crate::ablation::keeps("gradient.detect_ends") && are_ends(&object, other))
        .filter_map(|other| {
            let both = [&object[..], other].concat();
            let (cost, displacement) = explain(&both)?;
            let explained = cost <= EQUAL_COST.1 * noise && are_as_thick(&object, other, displacement);
            explained.then_some((displacement, both))
        });
    // The nearest: there may be others like it, farther on.
    let area = |object: &[(usize, usize)]| extent(object).map(|[low, high]| high - low + 1).iter().product::<usize>();
    let whole = whole.min_by_key(|(_, both)| area(both));
    let (displacement, object) = match whole {
        Some(found) => found,
        None => (explain(&object)?.1, object),
    };
    let bounds = bounds(extent(&object), displacement);
    (bounds.width >= MIN_SIDE && bounds.height >= MIN_SIDE)
        .then_some(MovingTarget { bounds, displacement: displacement.map(|d| d as f64) })
}

fn changed(first: &Frame<f64>, second: &Frame<f64>, noise: f64) -> Frame<bool> {
    let bar = CHANGE * noise * std::f64::consts::SQRT_2;
    Frame::from_fn(first.width(), first.height(), |x, y| (second.get(x, y) - first.get(x, y)).abs() > bar)
}

/// Whether so much changes that the camera must have moved: one target alone changes little.
pub(super) fn camera_moved(first: &Frame<f64>, second: &Frame<f64>) -> bool {
    if !crate::ablation::keeps("gradient.detect_camera") {
        return false;
    }
    let changed = changed(first, second, MIN_NOISE.max(noise_of(first, second, NOISE_SAMPLES).min(MAX_NOISE)));
    let count = changed.data().iter().filter(|changed| **changed).count();
    count as f64 > MIN_CAMERA_CHANGE * changed.data().len() as f64
}

/// Whether two groups may be the ends of one object: nearly the same extent along x or along y.
fn are_ends(a: &[(usize, usize)], b: &[(usize, usize)]) -> bool {
    let [a, b] = [a, b].map(|object| bounds(extent(object), [0, 0]));
    let alike = |a: [f64; 2], b: [f64; 2]| {
        let common = (a[0] + a[1]).min(b[0] + b[1]) - a[0].max(b[0]);
        common >= SAME_EXTENT * a[1].max(b[1])
    };
    alike([a.x, a.width], [b.x, b.width]) || alike([a.y, a.height], [b.y, b.height])
}

/// Whether two groups apart along an axis are as thick as their object moved; two objects are thicker.
fn are_as_thick(a: &[(usize, usize)], b: &[(usize, usize)], displacement: [isize; 2]) -> bool {
    let (a, b) = (extent(a), extent(b));
    (0..2).filter(|&k| a[k][1] < b[k][0] || b[k][1] < a[k][0]).all(|k| {
        let most = displacement[k].unsigned_abs() as f64 + EDGE_WIDTH;
        [a, b].iter().all(|part| (part[k][1] - part[k][0] + 1) as f64 <= most)
    })
}

fn around(at: usize, length: usize) -> std::ops::Range<usize> {
    at.saturating_sub(1)..(at + 2).min(length)
}

/// Changed pixels with enough changed neighbours, and those beside such.
fn crowded(changed: &Frame<bool>) -> Frame<bool> {
    let (width, height) = changed.size();
    let count = |mask: &Frame<bool>, x: usize, y: usize| {
        around(y, height).map(|j| mask.row(j)[around(x, width)].iter().filter(|c| **c).count()).sum::<usize>()
    };
    let middle =
        Frame::from_fn(width, height, |x, y| changed.get(x, y) && count(changed, x, y) >= MIN_CHANGED_NEIGHBOURS);
    Frame::from_fn(width, height, |x, y| changed.get(x, y) && count(&middle, x, y) > 0)
}

/// Groups of changed pixels: occupied cells with at most one empty cell between them.
fn objects(changed: &Frame<bool>) -> Vec<Vec<(usize, usize)>> {
    let (width, height) = changed.size();
    let (columns, rows) = (width.div_ceil(CELL), height.div_ceil(CELL));
    let mut cells: Frame<Vec<(usize, usize)>> = Frame::from_fn(columns, rows, |_, _| Vec::new());
    for y in 0..height {
        for x in (0..width).filter(|x| changed.get(*x, y)) {
            cells.row_mut(y / CELL)[x / CELL].push((x, y));
        }
    }
    let near = |at: usize, length: usize| at.saturating_sub(2)..(at + 3).min(length);
    let mut found = Vec::new();
    for start in 0..columns * rows {
        let mut object = std::mem::take(&mut cells.data_mut()[start]);
        let mut next = if object.is_empty() { Vec::new() } else { vec![start] };
        while let Some(at) = next.pop() {
            for j in near(at / columns, rows) {
                for i in near(at % columns, columns) {
                    let cell = &mut cells.row_mut(j)[i];
                    if !cell.is_empty() {
                        object.append(cell);
                        next.push(j * columns + i);
                    }
                }
            }
        }
        if !object.is_empty() {
            object.sort_unstable_by_key(|(x, y)| (*y, *x));
            found.push(object);
        }
    }
    found
}

fn distance(pixels: &[(usize, usize)], at: [f64; 2]) -> f64 {
    let far = |(x, y): &(usize, usize)| (*x as f64 - at[0]).hypot(*y as f64 - at[1]);
    pixels.iter().map(far).sum::<f64>() / pixels.len() as f64
}

/// Smallest displacement that explains the changed pixels nearly best, and the residual, grey levels.
/// `between`: brightness range of the first frame within half a pixel.
fn displacement(
    between: &Frame<[f64; 2]>,
    second: &Frame<f64>,
    object: &[(usize, usize)],
    noise: f64,
) -> Option<(f64, [isize; 2])> {
    let extent = extent(object);
    let cost = |dx: isize, dy: isize| {
        let TargetBox { x, y, width, height } = bounds(extent, [dx, dy]);
        let inside = |from: f64, length: f64| (from + 0.5) as isize..(from + length + 0.5) as isize;
        let step = ((width * height / VOTES).sqrt().ceil() as usize).max(1);
        let pixels = inside(y, height).step_by(step).flat_map(|j| inside(x, width).step_by(step).map(move |i| (i, j)));
        let off = pixels.map(|(i, j)| match (read(second, i, j), read(between, i - dx, j - dy)) {
            (Some(now), Some([low, high])) => (low - now).max(now - high).clamp(0.0, MAX_DIFFERENCE),
            _ => MAX_DIFFERENCE,
        });
        let (sum, count) = off.fold((0.0, 0), |(sum, count), off| (sum + off, count + 1));
        if width < MIN_SIDE || height < MIN_SIDE { f64::INFINITY } else { sum / f64::from(count.max(1)) }
    };
    let all: Vec<_> = (-MAX_DISPLACEMENT..=MAX_DISPLACEMENT)
        .flat_map(|dy| (-MAX_DISPLACEMENT..=MAX_DISPLACEMENT).map(move |dx| (dx, dy)))
        .filter(|d| *d != (0, 0))
        .map(|(dx, dy)| (cost(dx, dy), [dx, dy]))
        .collect();
    let best = all.iter().map(|(cost, _)| *cost).fold(f64::INFINITY, f64::min);
    let size = |d: &[isize; 2]| d[0] * d[0] + d[1] * d[1];
    let bar = (EQUAL_COST.0 * best).max(EQUAL_COST.1 * noise);
    let alike = all.into_iter().filter(|(cost, _)| *cost <= bar);
    alike.min_by_key(|(_, d)| size(d))
}

fn read<T: Copy>(frame: &Frame<T>, x: isize, y: isize) -> Option<T> {
    let inside = x >= 0 && y >= 0 && (x as usize) < frame.width() && (y as usize) < frame.height();
    inside.then(|| frame.get(x as usize, y as usize))
}

fn extent(object: &[(usize, usize)]) -> [[usize; 2]; 2] {
    let none = [usize::MAX, 0];
    object.iter().fold([none; 2], |[[left, right], [top, bottom]], &(x, y)| {
        [[left.min(x), right.max(x)], [top.min(y), bottom.max(y)]]
    })
}

/// Extent of the object in the second frame: the other end of the changed pixels than in the first.
fn bounds([columns, rows]: [[usize; 2]; 2], displacement: [isize; 2]) -> TargetBox {
    let along = |[low, high]: [usize; 2], moved: isize| {
        let (low, high) = (low as f64 - 0.5, high as f64 + 0.5);
        if moved > 0 { (low + moved as f64, high) } else { (low, high + moved as f64) }
    };
    let ((x0, x1), (y0, y1)) = (along(columns, displacement[0]), along(rows, displacement[1]));
    TargetBox { x: x0, y: y0, width: x1 - x0, height: y1 - y0 }
}
