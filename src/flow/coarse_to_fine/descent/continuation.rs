//! Motion of sites without data in masks and holes: that of the nearest sites with data goes on, as windows
//! do beyond the frame's edge.
//!
//! Smoothness reaches only a few sites an iteration. In a large hole the motion would lag behind that around
//! it and hold back the sites at its edge. With `z(edge)` the motion of the nearest site with data and
//! `z(mirrored)` that as far on its other side, `2 z(edge) - z(mirrored)` agrees with both.

use crate::flow::coarse_to_fine::data_term::{MIN_USABLE_SHARE, MOTION, VALID};
use crate::flow::coarse_to_fine::planes::Planes;
use crate::simd::SimdReal;

/// Column and row of a site.
type Site = [i32; 2];
/// In place of a site where there is none.
const NONE: Site = [i32::MIN; 2];

/// Sets the `motion` of every site with less than [`MIN_USABLE_SHARE`] of its window in `data`. Slopes are
/// those of the mirrored site; where that has no data either, the flow is that of the edge without slopes.
/// Returns whether there are such sites.
pub(super) fn continue_motion<T: SimdReal>(data: &Planes<T>, motion: &mut Planes<T>) -> bool {
    let least = T::from_f64(MIN_USABLE_SHARE);
    let bare_in = |y: usize| data.line(VALID, y).iter().enumerate().filter(|(_, share)| **share < least);
    let bare: Vec<Site> = (0..data.height).flat_map(|y| bare_in(y).map(move |(x, _)| [x as i32, y as i32])).collect();
    if bare.is_empty() {
        return false;
    }
    let nearest = Nearest::new(&bare, (data.width, data.height));
    let value = |motion: &Planes<T>, k: usize, [x, y]: Site| motion.at(k, x as usize, y as usize);
    for [x, y] in bare {
        let edge = nearest.at([x, y]);
        if edge == NONE {
            continue;
        }
        let mirrored = [2 * edge[0] - x, 2 * edge[1] - y];
        let is_known = nearest.at(mirrored) == mirrored;
        for k in 0..MOTION {
            let here = value(motion, k, edge);
            motion.line_mut(k, y as usize)[x as usize] = match (k < 2, is_known) {
                (true, true) => here + here - value(motion, k, mirrored),
                (true, false) => here,
                (false, true) => value(motion, k, mirrored),
                (false, false) => T::from_f64(0.0),
            };
        }
    }
    true
}

/// For each site the nearest one with data, itself where it has data.
struct Nearest {
    sites: Vec<Site>,
    size: (usize, usize),
}

impl Nearest {
    /// Each site without data takes the nearest of what its neighbours have: those before it, row by row, and
    /// then, from the last on, those after it (P.-E. Danielsson, "Euclidean distance mapping", 1980).
    fn new(bare: &[Site], (width, height): (usize, usize)) -> Self {
        let mut sites: Vec<Site> = (0..height).flat_map(|y| (0..width).map(move |x| [x as i32, y as i32])).collect();
        for &[x, y] in bare {
            sites[y as usize * width + x as usize] = NONE;
        }
        let mut nearest = Self { sites, size: (width, height) };
        for &site in bare {
            nearest.take(site, [[-1, 0], [-1, -1], [0, -1], [1, -1]]);
        }
        for &site in bare.iter().rev() {
            nearest.take(site, [[1, 0], [1, 1], [0, 1], [-1, 1]]);
        }
        nearest
    }

    /// [`NONE`] beyond the frame and where no site has data.
    fn at(&self, [x, y]: Site) -> Site {
        let (width, height) = self.size;
        let is_inside = (0..width as i32).contains(&x) && (0..height as i32).contains(&y);
        if is_inside { self.sites[y as usize * width + x as usize] } else { NONE }
    }

    fn take(&mut self, site: Site, neighbours: [Site; 4]) {
        let distance = |other: Site| (site[0] - other[0]).pow(2) + (site[1] - other[1]).pow(2);
        let mut best = self.at(site);
        for [dx, dy] in neighbours {
            let found = self.at([site[0] + dx, site[1] + dy]);
            if found != NONE && (best == NONE || distance(found) < distance(best)) {
                best = found;
            }
        }
        self.sites[site[1] as usize * self.size.0 + site[0] as usize] = best;
    }
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
    fn the_nearest_site_is_found_from_all_sides() {
        let (width, height) = (9, 7);
        let bare: Vec<Site> = (1..6).flat_map(|y| (1..8).map(move |x| [x, y])).collect();
        let nearest = Nearest::new(&bare, (width, height));
        for &[x, y] in &bare {
            let edge = nearest.at([x, y]);
            let distance = (edge[0] - x).abs().max((edge[1] - y).abs());
            assert_eq!(distance, x.min(8 - x).min(y).min(6 - y), "{x} {y}: {edge:?}");
        }
    }

    #[test]
    fn without_any_data_the_motion_stays() {
        let (data, mut motion) = half_known(0, (5, 4));
        continue_motion(&data, &mut motion);
        assert!((0..MOTION).all(|k| motion.at(k, 2, 2) == 9.0));
    }
}
