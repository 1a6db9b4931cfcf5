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
    let below = (y + 1).min(motion.height - 1);
    let site = |x: usize| {
        let next = (x + 1).min(motion.width - 1);
        // Along x and y, 1/frame: smooth motion of any strain has none.
        let unexplained = |k: usize| {
            [(next, y, 2), (x, below, 4)].map(|(i, j, slope)| {
                let rise = (motion.at(k, i, j) - motion.at(k, x, y)).to_f64() / SITE_SPACING;
                let slopes = (motion.at(k + slope, i, j) + motion.at(k + slope, x, y)).to_f64();
                if (i, j) == (x, y) { 0.0 } else { rise - 0.5 * slopes }
            })
        };
        let ([u_x, u_y], [v_x, v_y]) = (unexplained(0), unexplained(1));
        let squares = [u_x * u_x + u_y * u_y, u_x * v_x + u_y * v_y, v_x * v_x + v_y * v_y];
        let ratio = ((squares[0] + squares[2]) / BOUNDARY_STRAIN.powi(2)).powi(4);
        squares.map(|square| OTHER_SIDE_SHARE * BOUNDARY_WIDTH.powi(2) * ratio / (1.0 + ratio) * square)
    };
    (0..motion.width).map(site).collect()
}
