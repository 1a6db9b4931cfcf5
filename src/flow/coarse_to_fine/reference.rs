//! A pair's motion, found midway between the frames, told at the pixels of the first.

use super::data::MOTION;
use super::grid::{LEFT, Planes};
use super::resample::motion_at;
use crate::simd::SimdReal;
use rayon::prelude::*;

/// Corrections of the place midway that the affine model about the pixel gives.
const ITERATIONS: usize = 1;

/// The motion of the pixels of the first frame, from that of the places half way to the second.
///
/// The pixel `p` goes by `u_1(p) = u(p + u_1(p) / 2)`: its match lies half its own way off. The implicit equation is started from the affine model
/// about `p` and iterated; its derivative is `M_1 = (I - M / 2)^-1 M`, `M` at the place midway.
pub(super) fn at_first_frame<T: SimdReal>(motion: &Planes<T>, step: f64) -> Planes<T> {
    let mut out = Planes::new(motion.width, motion.height, MOTION);
    let (stride, len) = (out.stride(), out.row_len().max(1));
    out.data_mut().par_chunks_mut(len).enumerate().with_min_len(32).for_each(|(y, row)| {
        for x in 0..motion.width {
            let here = carried(motion, step, x as f64 * step, y as f64 * step);
            for (k, value) in here.into_iter().enumerate() {
                row[k * stride + LEFT + x] = T::from_f64(value);
            }
        }
    });
    out
}

/// The motion of the first frame's pixel `(x, y)`.
fn carried<T: SimdReal>(motion: &Planes<T>, step: f64, x: f64, y: f64) -> [f64; MOTION] {
    let start = motion_at(motion, step, x, y);
    let mut flow = solve(&start, (start[0], start[1])).unwrap_or((start[0], start[1]));
    let mut midway = start;
    for _ in 0..ITERATIONS {
        midway = motion_at(motion, step, x + 0.5 * flow.0, y + 0.5 * flow.1);
        flow = (midway[0], midway[1]);
    }
    let column = |a: f64, b: f64| solve(&midway, (a, b)).unwrap_or((a, b));
    let ((u_x, v_x), (u_y, v_y)) = (column(midway[2], midway[3]), column(midway[4], midway[5]));
    [flow.0, flow.1, u_x, v_x, u_y, v_y]
}

/// `(I - M / 2)^-1 b`, unless the motion folds the image.
fn solve(motion: &[f64; MOTION], (a, b): (f64, f64)) -> Option<(f64, f64)> {
    let [_, _, u_x, v_x, u_y, v_y] = motion;
    let (p, q, r, s) = (1.0 - 0.5 * u_x, -0.5 * u_y, -0.5 * v_x, 1.0 - 0.5 * v_y);
    let determinant = p * s - q * r;
    (determinant > 0.1).then(|| ((s * a - q * b) / determinant, (p * b - r * a) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn affine_motion_of_the_first_frame_is_exact() {
        // x_2 = x_1 + d + D x_1; midway x = x_1 + (d + D x_1) / 2 moves by the same d + D x_1.
        let (d, jacobian) = ([0.8, -0.5], [[0.04, -0.02], [0.03, 0.01]]);
        let inverse = |x: f64, y: f64| {
            // x_1 from the place midway.
            let (p, q) = (1.0 + 0.5 * jacobian[0][0], 0.5 * jacobian[0][1]);
            let (r, s) = (0.5 * jacobian[1][0], 1.0 + 0.5 * jacobian[1][1]);
            let (a, b) = (x - 0.5 * d[0], y - 0.5 * d[1]);
            let det = p * s - q * r;
            ((s * a - q * b) / det, (p * b - r * a) / det)
        };
        let flow = |x: f64, y: f64| {
            let (x, y) = inverse(x, y);
            (d[0] + jacobian[0][0] * x + jacobian[0][1] * y, d[1] + jacobian[1][0] * x + jacobian[1][1] * y)
        };
        let mut midway = Planes::<f64>::new(12, 10, MOTION);
        for y in 0..10 {
            for x in 0..12 {
                let (px, py) = (2.0 * x as f64, 2.0 * y as f64);
                let (here, right, below) = (flow(px, py), flow(px + 1.0, py), flow(px, py + 1.0));
                let all = [here.0, here.1, right.0 - here.0, right.1 - here.1, below.0 - here.0, below.1 - here.1];
                for (k, value) in all.into_iter().enumerate() {
                    midway.line_mut(k, y)[x] = value;
                }
            }
        }
        let first = at_first_frame(&midway, 2.0);
        let want = |x: f64, y: f64| d[0] + jacobian[0][0] * x + jacobian[0][1] * y;
        assert!((first.at(0, 4, 3) - want(8.0, 6.0)).abs() < 1e-9);
        assert!((first.at(2, 4, 3) - 0.04).abs() < 1e-9 && (first.at(3, 4, 3) - 0.03).abs() < 1e-9);
        assert!((first.at(4, 4, 3) + 0.02).abs() < 1e-9 && (first.at(5, 4, 3) - 0.01).abs() < 1e-9);
    }
}
