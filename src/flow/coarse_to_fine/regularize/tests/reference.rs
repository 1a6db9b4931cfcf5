//! The definition, written out in double precision; synthetic data and motions.

use crate::flow::coarse_to_fine::planes::Planes;
use crate::flow::coarse_to_fine::regularize::{ERROR, HALF_SPACING, MAX_FLOW_CHANGE, Smoothness, VALID};
use crate::math::random::CounterRng;
use crate::simd::SimdReal;

const POWER: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

fn site<T: SimdReal>(data: &Planes<T>, x: usize, y: usize) -> (nalgebra::Matrix6<f64>, nalgebra::Vector6<f64>) {
    let at = |k: usize| data.at(k, x, y).to_f64();
    let n = nalgebra::Matrix6::from_fn(|i, j| at(6 * (i % 2 + j % 2) + POWER[i / 2][j / 2]));
    (n, nalgebra::Vector6::from_fn(|i, _| at(18 + 3 * (i % 2) + i / 2)))
}

pub(super) fn motion_at<T: SimdReal>(motion: &Planes<T>, x: usize, y: usize) -> [f64; 6] {
    std::array::from_fn(|k| motion.at(k, x, y).to_f64())
}

/// The difference of the motions in the middle of an edge along `(dx, dy)`, and that of their Jacobians.
fn strain(here: &[f64; 6], there: &[f64; 6], (dx, dy): (f64, f64)) -> ([f64; 2], [f64; 4]) {
    let at = |m: &[f64; 6], s: f64, c: usize| m[c] + s * (dx * m[2 + c] + dy * m[4 + c]);
    let flow = std::array::from_fn(|c| at(here, HALF_SPACING, c) - at(there, -HALF_SPACING, c));
    (flow, std::array::from_fn(|k| here[2 + k] - there[2 + k]))
}

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum()
}

const AROUND: [(isize, isize); 4] = [(1, 0), (-1, 0), (0, 1), (0, -1)];

fn beside(x: usize, y: usize, (dx, dy): (isize, isize), size: (usize, usize)) -> Option<(usize, usize)> {
    let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
    (x < size.0 && y < size.1).then_some((x, y))
}

/// The same by the definition, in double precision and in the plain order of visits.
pub(super) fn naive<T: SimdReal>(data: &Planes<T>, motion: &Planes<T>, c: &Smoothness, noise: f64) -> Vec<[f64; 6]> {
    let size @ (w, h) = (motion.width, motion.height);
    let mut m: Vec<[f64; 6]> = (0..w * h).map(|i| motion_at(motion, i % w, i / w)).collect();
    let start = m.clone();
    let mut omegas = vec![[0.0; 4]; w * h];
    for sweep in 0..c.sweeps {
        for parity in [sweep % 2, 1 - sweep % 2] {
            for y in (parity..h).step_by(2) {
                let old = m.clone();
                for x in 0..w {
                    let (n, r) = site(data, x, y);
                    let loc = noise + data.at(ERROR, x, y).to_f64().max(0.0);
                    let (mut a, mut b) = (n / loc, r / loc);
                    for (way, omega) in AROUND.into_iter().zip(&mut omegas[y * w + x]) {
                        let Some((nx, ny)) = beside(x, y, way, size) else { continue };
                        let (there, way) = (old[ny * w + nx], (way.0 as f64, way.1 as f64));
                        if sweep % c.reweight_every == 0 {
                            let (du, dj) = strain(&old[y * w + x], &there, way);
                            *omega = 1.0 / (1.0 + (c.flow * squares(&du) + c.jacobian * squares(&dj)) / c.break_strain);
                        }
                        // Rows of a least-squares problem: weight, the six coefficients, the right side.
                        let t = [1.0, HALF_SPACING * way.0, HALF_SPACING * way.1];
                        for k in 0..6 {
                            let mut row = nalgebra::Vector6::zeros();
                            let (weight, value) = if k < 2 {
                                (0..3).for_each(|l| row[2 * l + k] = t[l]);
                                (c.flow, there[k] - HALF_SPACING * (way.0 * there[2 + k] + way.1 * there[4 + k]))
                            } else {
                                row[k] = 1.0;
                                (c.jacobian, there[k])
                            };
                            a += row * row.transpose() * (*omega * weight);
                            b += row * (*omega * weight * value);
                        }
                    }
                    if let Some(solved) = a.cholesky() {
                        m[y * w + x] = solved.solve(&b).into();
                    }
                }
            }
        }
    }
    for (m, s) in m.iter_mut().zip(&start) {
        let (du, dv) = (m[0] - s[0], m[1] - s[1]);
        let length = du.hypot(dv);
        if length > MAX_FLOW_CHANGE {
            (m[0], m[1]) = (s[0] + du * MAX_FLOW_CHANGE / length, s[1] + dv * MAX_FLOW_CHANGE / length);
        }
    }
    m
}

/// Random texture under a small window with the motion `truth` at each site; no data where that is `None`.
pub(super) fn made<T: SimdReal>(
    width: usize,
    height: usize,
    truth: impl Fn(usize, usize) -> Option<[f64; 6]>,
) -> Planes<T> {
    let rng = CounterRng::new(7);
    let mut data = Planes::new(width, height, 26);
    // Samples beside the sites may hold any finite value.
    data.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = T::from_f64(1e3 * rng.normal(i as u64)));
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let mut planes = [0.0; 26];
        if let Some(truth) = truth(x, y) {
            let rng = rng.stream((y * width + x) as u64);
            for i in 0..20 {
                let [gx, gy, px, py] = std::array::from_fn(|k| rng.normal(4 * i + k as u64));
                let (px, py) = (2.0 * px, 2.0 * py);
                let flow: [f64; 2] = std::array::from_fn(|c| truth[c] + px * truth[2 + c] + py * truth[4 + c]);
                let change = gx * flow[0] + gy * flow[1];
                let moments = [1.0, px, py, px * px, px * py, py * py];
                for k in 0..6 {
                    for (first, p) in [(0, gx * gx), (6, gx * gy), (12, gy * gy)] {
                        planes[first + k] += p * moments[k];
                    }
                }
                for k in 0..3 {
                    planes[18 + k] += gx * change * moments[k];
                    planes[21 + k] += gy * change * moments[k];
                }
            }
            planes[ERROR] = 0.1 + rng.uniform(1000);
            planes[VALID] = 1.0;
        }
        (0..26).for_each(|k| data.line_mut(k, y)[x] = T::from_f64(planes[k]));
    }
    data
}

pub(super) fn filled<T: SimdReal>(width: usize, height: usize, value: impl Fn(usize, usize) -> [f64; 6]) -> Planes<T> {
    let mut motion = Planes::new(width, height, 6);
    motion.data_mut().fill(T::from_f64(1e30));
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        (0..6).for_each(|k| motion.line_mut(k, y)[x] = T::from_f64(value(x, y)[k]));
    }
    motion
}

/// Motions that differ from site to site, some of them much.
pub(super) fn rough(x: usize, y: usize) -> [f64; 6] {
    let rng = CounterRng::new(3).stream((1000 * y + x) as u64);
    let size = if rng.uniform(9) < 0.1 { 5.0 } else { 1.0 };
    std::array::from_fn(|k| size * rng.normal(k as u64) * if k < 2 { 0.5 } else { 0.03 })
}

/// One affine motion of the whole frame, sampled 2 px apart.
pub(super) fn affine(x: usize, y: usize) -> [f64; 6] {
    let [u, v, ux, vx, uy, vy] = [0.5, -0.3, 0.02, -0.01, 0.015, -0.03];
    let (x, y) = (2.0 * HALF_SPACING * x as f64, 2.0 * HALF_SPACING * y as f64);
    [u + x * ux + y * uy, v + x * vx + y * vy, ux, vx, uy, vy]
}
