//! The first thing that moves: its box from two frames, where nobody gave one.

use super::local_flow::noise_of;
use crate::types::{Frame, TargetBox};

/// Change over the noise of a difference that is one.
const CHANGE: f64 = 3.0;
/// Least noise, grey levels.
const LEAST_NOISE: f64 = 1.0;
/// Changed pixels among the nine around a pixel that make it more than noise.
const CROWD: usize = 3;
/// Gap inside one object, px: of an even target only what it uncovers and what it covers changes.
const GAP: usize = 16;
/// Fewest changed pixels of an object.
const FEWEST: usize = 8;
/// Farthest displacement from frame to frame, px.
const REACH: isize = 10;
/// Of displacements whose cost is within this factor of the best, or that leave no more than so many times the noise, the smallest is taken: larger ones explain an even target as well.
/// Noise alone leaves 1.13 times.
const ALIKE: (f64, f64) = (1.05, 1.4);
/// Difference that all larger ones count as, grey levels.
const CAP: f64 = 40.0;
/// Smallest side of what is found, px.
const LEAST_SIDE: f64 = 3.0;

/// A moving object in two successive frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovingTarget {
    /// Its box in the second frame.
    pub bounds: TargetBox,
    /// How far it moved, whole px.
    pub displacement: [f64; 2],
}

/// Finds what moves between two frames of a still scene: the largest thing, or that nearest to a point.
///
/// Changed pixels differ by three deviations of the noise and have changed neighbours. The displacement within 10 px along each axis is the smallest that explains them nearly best, as what came or as what
/// went; the box is the extent of the changed pixels less the displacement. `None` where nothing moves.
pub fn detect_moving_target(first: &Frame<f64>, second: &Frame<f64>, near: Option<[f64; 2]>) -> Option<MovingTarget> {
    if first.size() != second.size() {
        return None;
    }
    let noise = noise_of(first, second).max(LEAST_NOISE);
    let bar = CHANGE * noise * std::f64::consts::SQRT_2;
    let changed =
        Frame::from_fn(first.width(), first.height(), |x, y| (second.get(x, y) - first.get(x, y)).abs() > bar);
    let object = objects(&crowded(&changed)).into_iter().filter(|pixels| pixels.len() >= FEWEST).min_by(|a, b| {
        let rank = |pixels: &[(usize, usize)]| match near {
            Some(at) => distance(pixels, at),
            None => -(pixels.len() as f64),
        };
        rank(a).total_cmp(&rank(b))
    })?;
    let displacement = displacement(first, second, &object, noise)?;
    let bounds = bounds(&object, displacement);
    (bounds.width >= LEAST_SIDE && bounds.height >= LEAST_SIDE)
        .then_some(MovingTarget { bounds, displacement: displacement.map(|d| d as f64) })
}

/// Changed pixels with enough changed neighbours.
fn crowded(changed: &Frame<bool>) -> Frame<bool> {
    let (width, height) = changed.size();
    let around = |at: usize, length: usize| at.saturating_sub(1)..(at + 2).min(length);
    Frame::from_fn(width, height, |x, y| {
        let count = || {
            around(y, height).map(|j| changed.row(j)[around(x, width)].iter().filter(|c| **c).count()).sum::<usize>()
        };
        changed.get(x, y) && count() >= CROWD
    })
}

/// Pixels that belong together, gaps of a few pixels included.
fn objects(changed: &Frame<bool>) -> Vec<Vec<(usize, usize)>> {
    let (width, height) = changed.size();
    let mut left = changed.clone();
    let mut found = Vec::new();
    for y in 0..height {
        for x in 0..width {
            if !left.get(x, y) {
                continue;
            }
            left.row_mut(y)[x] = false;
            let (mut object, mut next) = (vec![(x, y)], 0);
            while let Some(&(i, j)) = object.get(next) {
                next += 1;
                for b in j.saturating_sub(GAP)..(j + GAP + 1).min(height) {
                    for a in i.saturating_sub(GAP)..(i + GAP + 1).min(width) {
                        if left.get(a, b) {
                            left.row_mut(b)[a] = false;
                            object.push((a, b));
                        }
                    }
                }
            }
            found.push(object);
        }
    }
    found
}

fn distance(pixels: &[(usize, usize)], at: [f64; 2]) -> f64 {
    let far = |(x, y): &(usize, usize)| (*x as f64 - at[0]).hypot(*y as f64 - at[1]);
    pixels.iter().map(far).sum::<f64>() / pixels.len() as f64
}

/// The smallest displacement that explains the changed pixels nearly best: their extent less the displacement holds what was there in the first frame.
fn displacement(first: &Frame<f64>, second: &Frame<f64>, object: &[(usize, usize)], noise: f64) -> Option<[isize; 2]> {
    let between = half_a_pixel_around(first);
    let cost = |dx: isize, dy: isize| {
        let TargetBox { x, y, width, height } = bounds(object, [dx, dy]);
        let inside = |from: f64, length: f64| (from + 0.5) as isize..(from + length + 0.5) as isize;
        let pixels = inside(y, height).flat_map(|j| inside(x, width).map(move |i| (i, j)));
        let off = pixels.map(|(i, j)| match (read(second, i, j), read(&between, i - dx, j - dy)) {
            (Some(now), Some([low, high])) => (low - now).max(now - high).clamp(0.0, CAP),
            _ => CAP,
        });
        let (sum, count) = off.fold((0.0, 0), |(sum, count), off| (sum + off, count + 1));
        if width < LEAST_SIDE || height < LEAST_SIDE { f64::INFINITY } else { sum / f64::from(count.max(1)) }
    };
    let all: Vec<_> = (-REACH..=REACH)
        .flat_map(|dy| (-REACH..=REACH).map(move |dx| (dx, dy)))
        .filter(|d| *d != (0, 0))
        .map(|(dx, dy)| (cost(dx, dy), [dx, dy]))
        .collect();
    let best = all.iter().map(|(cost, _)| *cost).fold(f64::INFINITY, f64::min);
    let size = |d: &[isize; 2]| d[0] * d[0] + d[1] * d[1];
    let bar = (ALIKE.0 * best).max(ALIKE.1 * noise);
    let alike = all.into_iter().filter(|(cost, _)| *cost <= bar);
    alike.map(|(_, d)| d).min_by_key(size)
}

/// Least and greatest brightness within half a pixel along either axis: displacements are whole pixels, objects do not move by those.
fn half_a_pixel_around(frame: &Frame<f64>) -> Frame<[f64; 2]> {
    let (width, height) = frame.size();
    Frame::from_fn(width, height, |x, y| {
        let own = frame.get(x, y);
        let columns = [x.saturating_sub(1), (x + 1).min(width - 1)].map(|i| frame.get(i, y));
        let rows = [y.saturating_sub(1), (y + 1).min(height - 1)].map(|j| frame.get(x, j));
        columns.into_iter().chain(rows).fold([own; 2], |[low, high], beside| {
            let half = 0.5 * (own + beside);
            [low.min(half), high.max(half)]
        })
    })
}

fn read<T: Copy>(frame: &Frame<T>, x: isize, y: isize) -> Option<T> {
    let inside = x >= 0 && y >= 0 && (x as usize) < frame.width() && (y as usize) < frame.height();
    inside.then(|| frame.get(x as usize, y as usize))
}

/// Extent of the changed pixels in the second frame.
fn bounds(object: &[(usize, usize)], displacement: [isize; 2]) -> TargetBox {
    let along = |value: fn(&(usize, usize)) -> usize, moved: isize| {
        let (low, high) = object.iter().map(value).fold((usize::MAX, 0), |(low, high), at| (low.min(at), high.max(at)));
        // The object was at one end of the changed pixels and is at the other.
        let (low, high) = (low as f64 - 0.5, high as f64 + 0.5);
        if moved > 0 { (low + moved as f64, high) } else { (low, high + moved as f64) }
    };
    let ((x0, x1), (y0, y1)) = (along(|p| p.0, displacement[0]), along(|p| p.1, displacement[1]));
    TargetBox { x: x0, y: y0, width: x1 - x0, height: y1 - y0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;

    fn scene(at: [usize; 2], seed: u64) -> Frame<f64> {
        let rng = CounterRng::new(seed);
        Frame::from_fn(96, 80, |x, y| {
            let inside = (at[0]..at[0] + 13).contains(&x) && (at[1]..at[1] + 9).contains(&y);
            let brightness = if inside { 200.0 } else { 90.0 + 20.0 * (0.2 * x as f64).sin() };
            f64::round(brightness + 2.0 * rng.normal((96 * y + x) as u64))
        })
    }

    #[test]
    fn a_square_is_found_with_its_step() {
        for (dx, dy) in [(3, 0), (0, -2), (-2, 1)] {
            let at = [(40 + dx) as usize, (30 + dy) as usize];
            let found = detect_moving_target(&scene([40, 30], 1), &scene(at, 2), None).unwrap();
            assert_eq!(found.displacement, [f64::from(dx), f64::from(dy)], "{found:?}");
            let truth = TargetBox { x: at[0] as f64 - 0.5, y: at[1] as f64 - 0.5, width: 13.0, height: 9.0 };
            assert!(found.bounds.overlap(&truth) > 0.85, "{found:?}");
        }
    }

    #[test]
    fn nothing_is_found_where_nothing_moves_and_the_nearer_of_two_otherwise() {
        assert_eq!(detect_moving_target(&scene([40, 30], 1), &scene([40, 30], 2), None), None);
        let both = |a: [usize; 2], b: [usize; 2], seed: u64| {
            let (one, two) = (scene(a, seed), scene(b, seed + 1));
            Frame::from_fn(96, 80, |x, y| if x < 48 { one.get(x, y) } else { two.get(x, y) })
        };
        let (first, second) = (both([10, 20], [70, 50], 3), both([12, 20], [70, 53], 5));
        let found = detect_moving_target(&first, &second, Some([75.0, 55.0])).unwrap();
        assert_eq!(found.displacement, [0.0, 3.0]);
        assert_eq!(detect_moving_target(&first, &second, Some([15.0, 25.0])).unwrap().displacement, [2.0, 0.0]);
        assert_eq!(detect_moving_target(&first, &Frame::filled(4, 4, 0.0), None), None);
    }
}
