//! Error at motion boundaries: a site near one may have the motion of the other side.
//!
//! The change of the motion between neighbouring sites that the slopes of both do not explain is a jump,
//! spread over a strip. The squared jump, times the share of sites on the wrong side, is added along its own
//! direction.

use super::NODES_PER_TASK;
use crate::flow::coarse_to_fine::nodes::{binomial_mean, sites_around};
use crate::flow::coarse_to_fine::planes::{Planes, SITE_SPACING};
use crate::parallel;
use crate::simd::SimdReal;

/// Unexplained strain between neighbouring sites, 1/frame, of which half counts as a jump: above that of
/// curved motion.
const BOUNDARY_STRAIN: f64 = 0.3;
/// Width of the strip beside a boundary, px, and the share of its sites with the motion of the other side.
const BOUNDARY_WIDTH: f64 = 8.0;
const OTHER_SIDE_SHARE: f64 = 0.3;
/// Variance of slopes over that of the flow, px^-2, for jumps across a strip.
pub(super) const SLOPE_SHARE: f64 = 1.0 / (BOUNDARY_WIDTH * BOUNDARY_WIDTH);

/// Variances `xx, xy, yy` of the flow, px^2, at every node.
pub(super) fn boundary_errors<T: SimdReal>(motion: &Planes<T>, (width, height): (usize, usize)) -> Vec<[f64; 3]> {
    let rows: Vec<Vec<[f64; 3]>> = parallel::map(0..motion.height, |y| jumps(motion, y));
    let node = |n: usize| {
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for (y, down) in sites_around(n / width, motion.height) {
            for (x, along) in sites_around(n % width, motion.width) {
                sum.iter_mut().zip(rows[y][x]).for_each(|(sum, jump)| *sum += down * along * jump);
                weights += down * along;
            }
        }
        sum.map(|sum| sum / weights)
    };
    let mut errors: Vec<[f64; 3]> = parallel::map_range(width * height, NODES_PER_TASK, node);
    binomial_mean(&mut errors, (width, height));
    errors
}

/// Squared jumps `xx, xy, yy` of the flow at the sites of row `y`, px^2, times the share on the wrong side.
fn jumps<T: SimdReal>(motion: &Planes<T>, y: usize) -> Vec<[f64; 3]> {
    let (width, last_row) = (motion.width, motion.height - 1);
    let mut jumps = vec![[0.0; 4]; width];
    for k in 0..2 {
        let (flow, along) = (motion.line(k, y), motion.line(k + 2, y));
        for x in 0..width - 1 {
            jumps[x][k] = unexplained([flow[x], flow[x + 1]], [along[x], along[x + 1]]);
        }
        if y < last_row {
            let (below, across, across_below) =
                (motion.line(k, y + 1), motion.line(k + 4, y), motion.line(k + 4, y + 1));
            for x in 0..width {
                jumps[x][2 + k] = unexplained([flow[x], below[x]], [across[x], across_below[x]]);
            }
        }
    }
    let site = |[u_x, v_x, u_y, v_y]: [f64; 4]| {
        let squares = [u_x * u_x + u_y * u_y, u_x * v_x + u_y * v_y, v_x * v_x + v_y * v_y];
        let ratio = ((squares[0] + squares[2]) / BOUNDARY_STRAIN.powi(2)).powi(4);
        let share = OTHER_SIDE_SHARE * BOUNDARY_WIDTH.powi(2) * ratio / (1.0 + ratio);
        squares.map(|square| share * square)
    };
    jumps.into_iter().map(site).collect()
}

/// Strain between two neighbouring sites that their slopes do not explain, 1/frame: smooth motion has none.
fn unexplained<T: SimdReal>([flow, next]: [T; 2], [slope, next_slope]: [T; 2]) -> f64 {
    (next - flow).to_f64() / SITE_SPACING - 0.5 * (slope + next_slope).to_f64()
}
