//! Covariance of a pair at the pixels of the first frame, from that midway between the frames.
//!
//! The motion `m` at `p + u / 2` becomes that of the pixel `p` by `u_1 = u(p + u_1 / 2)` and `M_1 = N M` with
//! `N = (I - M / 2)^-1`. To first order errors become `N du` and `N dM N`.

use super::{Entries, NODES_PER_TASK};
use crate::flow::coarse_to_fine::nodes::NodeAxis;
use crate::flow::coarse_to_fine::{planes::Planes, planes::SITE_SPACING, refine::SITES_PER_NODE};
use crate::flow::symmetric::{ENTRIES, upper};
use crate::parallel;
use crate::simd::SimdReal;

type Square = [[f64; 6]; 6];

pub(super) fn to_first_frame<T: SimdReal>(
    nodes: &[Entries],
    motion: &Planes<T>,
    axes: (NodeAxis, NodeAxis),
) -> Vec<Entries> {
    let last = (motion.width - 1, motion.height - 1);
    parallel::map_range(nodes.len(), NODES_PER_TASK, |n| {
        let (x, y) = (n % axes.0.count, n / axes.0.count);
        let m = super::curvature_bias::motion_at(motion, (x, y));
        let node = |n: usize, last: usize| (SITES_PER_NODE * n).min(last) as f64 / SITES_PER_NODE as f64;
        let half_way = 0.5 / (SITE_SPACING * SITES_PER_NODE as f64);
        let there = blend(nodes, axes, node(x, last.0) + half_way * m[0], node(y, last.1) + half_way * m[1]);
        inverse_half_step(&m).map_or(there, |inverse| transformed(&there, &inverse))
    })
}

/// Linear between the nodes, constant beyond.
fn blend(nodes: &[Entries], (along, across): (NodeAxis, NodeAxis), x: f64, y: f64) -> Entries {
    let ((left, right, fx), (above, below, fy)) = (along.around(x), across.around(y));
    let at = |x: usize, y: usize| &nodes[y * along.count + x];
    let (a, b, c, d) = (at(left, above), at(right, above), at(left, below), at(right, below));
    std::array::from_fn(|k| (1.0 - fy) * ((1.0 - fx) * a[k] + fx * b[k]) + fy * ((1.0 - fx) * c[k] + fx * d[k]))
}

/// `N = (I - M / 2)^-1`, unless the motion folds the image.
fn inverse_half_step(m: &[f64; 6]) -> Option<[[f64; 2]; 2]> {
    let (p, q, r, s) = (1.0 - 0.5 * m[2], -0.5 * m[4], -0.5 * m[3], 1.0 - 0.5 * m[5]);
    let determinant = p * s - q * r;
    (determinant > 0.1).then(|| [[s / determinant, -q / determinant], [-r / determinant, p / determinant]])
}

/// `T C T^T` of the map `du -> N du`, `dM -> N dM N`.
fn transformed(entries: &Entries, n: &[[f64; 2]; 2]) -> Entries {
    let mut map: Square = [[0.0; 6]; 6];
    for i in 0..2 {
        for j in 0..2 {
            map[i][j] = n[i][j];
            // Column b of the new derivative from column a of the old: N dM e_a N_ab.
            for a in 0..2 {
                for b in 0..2 {
                    map[2 + 2 * b + i][2 + 2 * a + j] = n[i][j] * n[a][b];
                }
            }
        }
    }
    let at = |i: usize, j: usize| entries[upper(i.min(j), i.max(j))];
    // Flow is mapped to flow, derivatives to derivatives.
    let block = |i: usize| if i < 2 { 0..2 } else { 2..6 };
    let mut half: Square = [[0.0; 6]; 6];
    for i in 0..6 {
        for j in 0..6 {
            half[i][j] = block(i).map(|k| map[i][k] * at(k, j)).sum();
        }
    }
    let mut out = [0.0; ENTRIES];
    for i in 0..6 {
        for j in i..6 {
            out[upper(i, j)] = block(j).map(|k| half[i][k] * map[j][k]).sum();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_go_along_with_the_motion() {
        let m = [0.0, 0.0, 0.1, -0.05, 0.2, 0.08];
        let n = inverse_half_step(&m).unwrap();
        let carried = |m: [f64; 6]| {
            let n = inverse_half_step(&m).unwrap();
            let column = |a: f64, b: f64| [n[0][0] * a + n[0][1] * b, n[1][0] * a + n[1][1] * b];
            [column(m[2], m[3]), column(m[4], m[5])].concat()
        };
        // An error along one direction, by differences of the transformed motion.
        let error = [0.3, -0.2, 0.5, 0.1, -0.4, 0.2];
        let mut entries = [0.0; ENTRIES];
        for i in 0..6 {
            for j in i..6 {
                entries[upper(i, j)] = error[i] * error[j];
            }
        }
        let got = transformed(&entries, &n);
        let step = 1e-6;
        let moved = carried(std::array::from_fn(|k| m[k] + step * error[k]));
        let base = carried(m);
        for k in 0..4 {
            let want = (moved[k] - base[k]) / step;
            assert!((got[upper(2 + k, 2 + k)] - want * want).abs() < 1e-5, "{k}");
        }
        let flow = n[0][0] * error[0] + n[0][1] * error[1];
        assert!((got[upper(0, 0)] - flow * flow).abs() < 1e-12);
    }
}
