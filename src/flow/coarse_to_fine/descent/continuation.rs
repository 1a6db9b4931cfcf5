//! Motion of sites without data in masks and holes: that of the nearest sites with data goes on, as windows
//! do beyond the frame's edge.
//!
//! Smoothness reaches only a few sites an iteration. In a large hole the motion would lag behind that around
//! it and hold back the sites at its edge. With `z(edge)` the motion of the nearest site with data and
//! `z(mirrored)` that as far on its other side, `2 z(edge) - z(mirrored)` agrees with both.

use crate::flow::coarse_to_fine::data_term::{MIN_USABLE_SHARE, MOTION, VALID};
use crate::flow::coarse_to_fine::planes::Planes;
use crate::simd::SimdReal;

/// Sets the `motion` of every site whose window is hardly usable, after a linearisation to `data`. Slopes are
/// those of the mirrored site; where that has no data either, the flow is that of the edge without slopes.
/// Returns whether there are such sites.
pub(super) fn continue_motion<T: SimdReal>(data: &Planes<T>, motion: &mut Planes<T>) -> bool {
    let (width, height) = (motion.width, motion.height);
    let least = T::from_f64(MIN_USABLE_SHARE);
    let bare_in = |y: usize| data.line(VALID, y).iter().enumerate().filter(|(_, share)| **share < least);
    let bare: Vec<usize> = (0..height).flat_map(|y| bare_in(y).map(move |(x, _)| y * width + x)).collect();
    if bare.is_empty() {
        return false;
    }
    let nearest = nearest_with_data(&bare, (width, height));
    let value = |motion: &Planes<T>, k: usize, site: usize| motion.at(k, site % width, site / width);
    for site in bare {
        let Some(edge) = nearest[site] else { continue };
        let mirrored = mirror(site, edge, (width, height)).filter(|&other| nearest[other] == Some(other));
        for k in 0..MOTION {
            let there = mirrored.map(|other| value(motion, k, other));
            let here = value(motion, k, edge);
            motion.line_mut(k, site / width)[site % width] = match (k < 2, there) {
                (true, there) => here + here - there.unwrap_or(here),
                (false, there) => there.unwrap_or(T::from_f64(0.0)),
            };
        }
    }
    true
}

/// The site as far beyond `edge` as `site` is on this side, if there is one.
fn mirror(site: usize, edge: usize, (width, height): (usize, usize)) -> Option<usize> {
    let x = (2 * (edge % width)).checked_sub(site % width).filter(|&x| x < width)?;
    let y = (2 * (edge / width)).checked_sub(site / width).filter(|&y| y < height)?;
    Some(y * width + x)
}

/// For each site the nearest one that is not `bare`; `None` if all are bare. Layer by layer inwards each
/// takes the nearest of those that its neighbours have.
fn nearest_with_data(bare: &[usize], size: (usize, usize)) -> Vec<Option<usize>> {
    let (width, height) = size;
    let mut nearest: Vec<Option<usize>> = (0..width * height).map(Some).collect();
    for &site in bare {
        nearest[site] = None;
    }
    let distance = |a: usize, b: usize| (a % width).abs_diff(b % width).pow(2) + (a / width).abs_diff(b / width).pow(2);
    let is_beside = |site: &usize| neighbours(*site, size).any(|other| nearest[other].is_some());
    let mut layer: Vec<usize> = bare.iter().copied().filter(is_beside).collect();
    while !layer.is_empty() {
        let found = |&site: &usize| {
            let known = neighbours(site, size).filter_map(|other| nearest[other]);
            known.min_by_key(|&known| (distance(site, known), known))
        };
        let found: Vec<_> = layer.iter().map(found).collect();
        layer.iter().zip(found).for_each(|(&site, found)| nearest[site] = found);
        let beside = layer.iter().flat_map(|&site| neighbours(site, size)).filter(|&other| nearest[other].is_none());
        let mut next: Vec<usize> = beside.collect();
        next.sort_unstable();
        next.dedup();
        layer = next;
    }
    nearest
}

/// The up to eight neighbours of a site.
fn neighbours(site: usize, (width, height): (usize, usize)) -> impl Iterator<Item = usize> {
    let (x, y) = (site % width, site / width);
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    rows.flat_map(move |j| (x.saturating_sub(1)..(x + 2).min(width)).map(move |i| j * width + i))
        .filter(move |&other| other != site)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::coarse_to_fine::data_term::COUNT;

    /// Sites with data to the left of column `edge`, and their affine motion; elsewhere 9.
    fn half_known(edge: usize, (width, height): (usize, usize)) -> (Planes<f64>, Planes<f64>) {
        let (mut data, mut motion) = (Planes::new(width, height, COUNT), Planes::new(width, height, MOTION));
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let known = x < edge;
            data.line_mut(VALID, y)[x] = if known { 1.0 } else { 0.0 };
            let affine = affine(x, y);
            (0..MOTION).for_each(|k| motion.line_mut(k, y)[x] = if known { affine[k] } else { 9.0 });
        }
        (data, motion)
    }

    fn affine(x: usize, y: usize) -> [f64; 6] {
        let (x, y) = (x as f64, y as f64);
        [1.0 + 0.2 * x - 0.1 * y, 2.0 + 0.3 * y, 0.1, 0.0, -0.05, 0.15]
    }

    #[test]
    fn affine_motion_stays_affine_and_then_constant() {
        let (data, mut motion) = half_known(6, (20, 7));
        continue_motion(&data, &mut motion);
        for (x, y) in (0..7).flat_map(|y| (0..20).map(move |x| (x, y))) {
            // Column 5 is the edge: columns to 10 are mirrored at it.
            let want = if x <= 10 { affine(x, y) } else { [affine(5, y)[0], affine(5, y)[1], 0.0, 0.0, 0.0, 0.0] };
            for k in 0..MOTION {
                assert!((motion.at(k, x, y) - want[k]).abs() < 1e-12, "{x} {y} {k}");
            }
        }
    }

    #[test]
    fn without_any_data_the_motion_stays() {
        let (data, mut motion) = half_known(0, (5, 4));
        continue_motion(&data, &mut motion);
        assert!((0..MOTION).all(|k| motion.at(k, 2, 2) == 9.0));
    }
}
