//! Clusters that touch and move alike are one object.

use super::clusters::Clusters;
use crate::math::median;

/// Grouping of clusters (`improved`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grouping {
    /// Largest distance of grouped clusters, cells; default 3.5.
    pub reach: f64,
    /// Largest median difference of their affine motions, px per ordinary step; default 1.
    pub motion: f64,
    /// Largest difference of their depth motions, disparity per ordinary step; default 0.15.
    pub depth_motion: f64,
}

impl Default for Grouping {
    fn default() -> Self {
        Self { reach: 3.5, motion: 1.0, depth_motion: 0.15 }
    }
}

impl Grouping {
    /// The limits over a gap, ordinary steps.
    pub fn over(self, gap: f64) -> Self {
        Self { motion: gap * self.motion, depth_motion: gap * self.depth_motion, ..self }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GroupMotion {
    /// `(u, v, u_x, v_x, u_y, v_y)` at `centre`.
    pub affine: [f64; 6],
    /// Where, `(x, y)` px.
    pub centre: [f64; 2],
    /// Motion in depth, disparity per step.
    pub depth: f64,
}

impl GroupMotion {
    /// Growth in the picture, 1/step: half the divergence of the flow.
    fn growth(&self) -> f64 {
        0.5 * (self.affine[2] + self.affine[5])
    }

    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let [u, v, u_x, v_x, u_y, v_y] = self.affine;
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        [u + u_x * dx + u_y * dy, v + v_x * dx + v_y * dy]
    }
}

/// Smallest member of each cluster's group. Joins clusters within reach whose affine motions differ, in the
/// median over the pixels of both, by no more than the limit, and whose depth motions agree, directly or as
/// parts of one approaching object. Clusters without a motion stay alone.
///
/// An approaching object grows at a rate `g = D c`, with disparity `D` from that at infinity and a constant
/// `c`, and its disparity changes by `w = D^2 c`. Two of its parts have `w_a - w_b = (D_a + D_b)(D_a - D_b) c
/// = (g_a + g_b)(d_a - d_b)`, independent of the disparity at infinity.
pub(super) fn groups(clusters: &Clusters, motions: &[Option<GroupMotion>], limits: &Grouping) -> Vec<usize> {
    let count = clusters.components();
    let mut parent: Vec<usize> = (0..count).collect();
    let disparities: Vec<f64> = (0..count).map(|k| clusters.disparity(k).unwrap_or(f64::NAN)).collect();
    let touching = neighbours(clusters, limits.reach);
    for (a, b) in touching {
        let (Some(first), Some(second)) = (motions[a], motions[b]) else { continue };
        let difference = first.depth - second.depth;
        let approaching = (first.growth() + second.growth()) * (disparities[a] - disparities[b]);
        let alike = difference.abs().min(if crate::ablation::keeps("stereo.approaching") {
            (difference - approaching).abs()
        } else {
            f64::INFINITY
        }) <= limits.depth_motion
            && median_difference(clusters, [a, b], [&first, &second]) <= limits.motion;
        if alike {
            let (a, b) = (root(&parent, a), root(&parent, b));
            parent[a.max(b)] = a.min(b);
        }
    }
    (0..count).map(|k| root(&parent, k)).collect()
}

fn root(parent: &[usize], mut k: usize) -> usize {
    while parent[k] != k {
        k = parent[k];
    }
    k
}

/// Pairs of clusters with cells no farther apart than `reach`, the smaller index first, in order.
fn neighbours(clusters: &Clusters, reach: f64) -> Vec<(usize, usize)> {
    let grid = clusters.lattice().grid;
    let count = clusters.components();
    // Clusters in each cell of the picture.
    let mut there: Vec<Vec<u16>> = vec![vec![]; grid.columns * grid.rows];
    for k in 0..count {
        for [x, y] in clusters.template(k) {
            there[usize::from(y) * grid.columns + usize::from(x)].push(k as u16);
        }
    }
    let span = reach.clamp(0.0, grid.columns.max(grid.rows) as f64).floor() as i32;
    let offsets: Vec<(i32, i32)> = (-span..=span)
        .flat_map(|dy| (-span..=span).map(move |dx| (dx, dy)))
        .filter(|&(dx, dy)| f64::from(dx * dx + dy * dy) <= reach * reach && (dy, dx) >= (0, 0))
        .collect();
    let mut touch = vec![false; count * count];
    for y in 0..grid.rows as i32 {
        for x in 0..grid.columns as i32 {
            let here = &there[y as usize * grid.columns + x as usize];
            if here.is_empty() {
                continue;
            }
            for &(dx, dy) in &offsets {
                let (i, j) = (x + dx, y + dy);
                if !(0..grid.columns as i32).contains(&i) || !(0..grid.rows as i32).contains(&j) {
                    continue;
                }
                for &b in &there[j as usize * grid.columns + i as usize] {
                    for &a in here {
                        touch[usize::from(a.min(b)) * count + usize::from(a.max(b))] = true;
                    }
                }
            }
        }
    }
    (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b))).filter(|&(a, b)| touch[a * count + b]).collect()
}

/// Median distance of two motions over the pixels of both clusters, px.
fn median_difference(clusters: &Clusters, both: [usize; 2], motions: [&GroupMotion; 2]) -> f64 {
    let pixels = both.iter().flat_map(|&k| &clusters.pixels[k]);
    let mut differences: Vec<f64> = pixels
        .map(|&i| {
            let [x, y, _] = clusters.points.at(i as usize);
            let [[u, v], [s, t]] = [motions[0].at(x, y), motions[1].at(x, y)];
            (u - s).hypot(v - t)
        })
        .collect();
    median(&mut differences).unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::super::clusters::tests::synthetic_clusters;
    use super::*;

    fn moving(u: f64, depth: f64) -> GroupMotion {
        GroupMotion { affine: [u, 0.0, 0.0, 0.0, 0.0, 0.0], centre: [0.0, 0.0], depth }
    }

    #[test]
    fn neighbours_that_move_alike_are_one() {
        // In a row, 3 cells apart but for the last, which is 5 apart.
        let cells = [([10, 5, 9], 0), ([13, 5, 30], 1), ([16, 5, 9], 2), ([19, 5, 9], 3), ([24, 5, 9], 4)];
        let clusters = synthetic_clusters(&cells, 6);
        let moved =
            [(3.0, 0.0), (3.9, 0.1), (5.5, 0.0), (5.4, 0.3), (5.4, 0.3)].map(|(u, depth)| Some(moving(u, depth)));
        let motions = [&moved[..], &[None]].concat();
        assert_eq!(groups(&clusters, &motions, &Grouping::default()), [0, 0, 2, 3, 4, 5]);
        let far = Grouping { reach: 5.0, ..Grouping::default() };
        assert_eq!(groups(&clusters, &motions, &far), [0, 0, 2, 3, 3, 5]);
        let everywhere = Grouping { reach: f64::INFINITY, motion: 9.0, depth_motion: 9.0 };
        assert_eq!(groups(&clusters, &motions, &everywhere), [0, 0, 0, 0, 0, 5]);
    }
}
