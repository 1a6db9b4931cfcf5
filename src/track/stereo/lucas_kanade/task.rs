//! Gauss-Newton iterations for one cluster, level by level.

use super::super::{cluster_motion::PlaneMotion, cluster_motion::middle};
use super::{FINE, MAX_RESIDUAL, MAX_VOTERS, MIN_AFFINE_PIXELS, MIN_NOISE_STD, MIN_STEP, PRIOR_STD, SmoothedLevels};
use crate::math::{geman_mcclure, robust_std};
use crate::types::{AffineFlow, Frame};
use nalgebra::{SMatrix, SVector};

/// A sampled pixel: place about the centre, brightness and gradient.
#[derive(Debug, Clone, Copy)]
struct Voter {
    x: f32,
    y: f32,
    value: f32,
    gradient: [f32; 2],
}

/// Normal equations of N unknowns.
type Normal<const N: usize> = (SMatrix<f64, N, N>, SVector<f64, N>);

/// Mean absolute residual, each at most [`MAX_RESIDUAL`]; NaN (outside the view) is left out.
fn truncated_mean(residuals: &[f32]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for residual in residuals.iter().filter(|residual| residual.is_finite()) {
        sum += f64::from(residual.abs()).min(MAX_RESIDUAL);
        count += 1.0;
    }
    sum / count
}

/// Data of one cluster. Maps are `(u, v, u_x, v_x, u_y, v_y)` with derivatives per radius.
pub(super) struct Task<'a> {
    before: &'a SmoothedLevels,
    after: &'a SmoothedLevels,
    pixels: &'a [[f64; 2]],
    centre: [f64; 2],
    radius: f64,
}

impl<'a> Task<'a> {
    /// `None` for fewer than three pixels.
    pub(super) fn new(before: &'a SmoothedLevels, after: &'a SmoothedLevels, pixels: &'a [[f64; 2]]) -> Option<Self> {
        if pixels.len() < 3 {
            return None;
        }
        let n = pixels.len() as f64;
        let centre = middle(pixels);
        let spread = pixels.iter().map(|p| (p[0] - centre[0]).powi(2) + (p[1] - centre[1]).powi(2)).sum::<f64>() / n;
        Some(Self { before, after, pixels, centre, radius: spread.sqrt().max(1.0) })
    }

    /// The motion of a map, with its residual at the finest level.
    pub(super) fn motion_of(&self, map: &[f64; 6]) -> Option<PlaneMotion> {
        let voters = self.voters(FINE);
        let mut residuals = Vec::with_capacity(voters.len());
        self.residuals(&voters, &self.after.0[FINE], map, &mut residuals)?;
        let [u, v, u_x, v_x, u_y, v_y] = *map;
        let r = self.radius;
        let flow = AffineFlow { u, v, u_x: u_x / r, v_x: v_x / r, u_y: u_y / r, v_y: v_y / r };
        Some(PlaneMotion { flow, centre: self.centre, residual: truncated_mean(&residuals) })
    }

    /// One Gauss-Newton step of the first `N` unknowns (2: translation, 6: affine). Returns its length, px.
    fn step<const N: usize>(
        &self,
        voters: &[Voter],
        (residuals, deviation): (&[f32], f64),
        map: &mut [f64; 6],
        start: &[f64; 2],
    ) -> Option<f64> {
        let (mut matrix, mut right) = self.normal::<N>(voters, residuals, deviation);
        for k in 0..N {
            let (scale, from) = if k < 2 { (PRIOR_STD[0], start[k]) } else { (PRIOR_STD[1] * self.radius, 0.0) };
            let prior = (deviation / scale).powi(2);
            matrix[(k, k)] += prior;
            right[k] -= prior * (map[k] - from);
        }
        let step = matrix.cholesky()?.solve(&right);
        map.iter_mut().zip(step.iter()).for_each(|(value, step)| *value += step);
        Some(step.norm())
    }

    /// At most `steps` steps of the first `N` unknowns at one level.
    fn settle<const N: usize>(
        &self,
        steps: usize,
        (voters, after): (&[Voter], &Frame<f32>),
        map: &mut [f64; 6],
        start: &[f64; 2],
        residuals: &mut Vec<f32>,
    ) -> Option<()> {
        for _ in 0..steps {
            let deviation = self.residuals(voters, after, map, residuals)?;
            if self.step::<N>(voters, (residuals, deviation), map, start)? < MIN_STEP {
                break;
            }
        }
        Some(())
    }

    /// Runs a schedule up to the level before the finest. Returns the truncated residual there.
    pub(super) fn go(&self, way: &[[usize; 2]; FINE], map: &mut [f64; 6], start: &[f64; 2]) -> Option<f64> {
        let mut levels = way.iter().enumerate().filter(|(_, steps)| **steps != [0, 0]);
        levels.try_fold(f64::INFINITY, |_, (level, steps)| self.descend(level, *steps, map, start))
    }

    /// Steps at one level, translation then affine. Returns the truncated residual at the end.
    pub(super) fn descend(
        &self,
        level: usize,
        [translations, affine]: [usize; 2],
        map: &mut [f64; 6],
        start: &[f64; 2],
    ) -> Option<f64> {
        let voters = self.voters(level);
        let after = &self.after.0[level];
        let mut residuals = Vec::with_capacity(voters.len());
        let affine = if voters.len() < MIN_AFFINE_PIXELS { 0 } else { affine };
        self.settle::<2>(translations, (&voters, after), map, start, &mut residuals)?;
        self.settle::<6>(affine, (&voters, after), map, start, &mut residuals)?;
        self.residuals(&voters, after, map, &mut residuals)?;
        map.iter().all(|value| value.is_finite()).then(|| truncated_mean(&residuals))
    }

    /// Evenly sampled pixels of a level, without those beside the border or with samples that are not finite.
    fn voters(&self, level: usize) -> Vec<Voter> {
        let frame = &self.before.0[level];
        let (width, height) = frame.size();
        let stride = self.pixels.len().div_ceil(MAX_VOTERS[level]).max(1);
        let mut voters = Vec::with_capacity(self.pixels.len() / stride + 1);
        for &[px, py] in self.pixels.iter().step_by(stride) {
            let (x, y) = (px as usize, py as usize);
            if x == 0 || y == 0 || x + 1 >= width || y + 1 >= height {
                continue;
            }
            let gradient =
                [0.5 * (frame.get(x + 1, y) - frame.get(x - 1, y)), 0.5 * (frame.get(x, y + 1) - frame.get(x, y - 1))];
            let value = frame.get(x, y);
            if (value + gradient[0] + gradient[1]).is_finite() {
                let place = [(px - self.centre[0]) as f32, (py - self.centre[1]) as f32];
                voters.push(Voter { x: place[0], y: place[1], value, gradient });
            }
        }
        voters
    }

    /// Residuals after the motion, NaN outside, and their robust scale; `None` unless half are inside.
    fn residuals(&self, voters: &[Voter], after: &Frame<f32>, map: &[f64; 6], out: &mut Vec<f32>) -> Option<f64> {
        let (width, height) = after.size();
        let (last_x, last_y) = ((width - 1) as f32, (height - 1) as f32);
        let data = after.data();
        let [u, v] = [map[0] + self.centre[0], map[1] + self.centre[1]].map(|value| value as f32);
        let [u_x, v_x, u_y, v_y] = [map[2], map[3], map[4], map[5]].map(|value| (value / self.radius) as f32);
        out.clear();
        for voter in voters {
            let x = voter.x + u + u_x * voter.x + u_y * voter.y;
            let y = voter.y + v + v_x * voter.x + v_y * voter.y;
            let inside = x >= 0.0 && y >= 0.0 && x < last_x && y < last_y;
            out.push(if inside {
                let (column, row) = (x as usize, y as usize);
                let (fx, fy) = (x - column as f32, y - row as f32);
                let at = row * width + column;
                let upper = data[at] + fx * (data[at + 1] - data[at]);
                let lower = data[at + width] + fx * (data[at + width + 1] - data[at + width]);
                upper + fy * (lower - upper) - voter.value
            } else {
                f32::NAN
            });
        }
        let mut sizes: Vec<f32> = out.iter().filter(|r| r.is_finite()).map(|r| r.abs()).collect();
        if sizes.len() < 3 || 2 * sizes.len() < voters.len() {
            return None;
        }
        Some(robust_std(&mut sizes)?.max(MIN_NOISE_STD))
    }

    /// Weighted normal equations of a step, weights `1 / (1 + (e / 2 s)^2)^2`.
    fn normal<const N: usize>(&self, voters: &[Voter], residuals: &[f32], deviation: f64) -> Normal<N> {
        let (mut matrix, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
        let inverse_radius = (1.0 / self.radius) as f32;
        for (voter, &residual) in voters.iter().zip(residuals) {
            if !residual.is_finite() {
                continue;
            }
            let weight = geman_mcclure(f64::from(residual), 2.0 * deviation);
            let [gx, gy] = voter.gradient.map(f64::from);
            let (x, y) = (f64::from(voter.x * inverse_radius), f64::from(voter.y * inverse_radius));
            let columns = [gx, gy, x * gx, x * gy, y * gx, y * gy];
            for i in 0..N {
                let column = weight * columns[i];
                right[i] -= column * f64::from(residual);
                for j in i..N {
                    matrix[(i, j)] += column * columns[j];
                }
            }
        }
        matrix.fill_lower_triangle_with_upper_triangle();
        (matrix, right)
    }
}
