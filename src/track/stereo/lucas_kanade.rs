//! Affine motion of a cluster on its edge pixels (B. Lucas and T. Kanade, 1981), coarse to fine, robustly weighted; section 6.4 of the stereo tracker's design.

mod visible;

pub(super) use visible::{following, visible_motion};

use crate::image::GaussianSmoother;
use crate::math::median;
use crate::types::{AffineFlow, Frame};
use nalgebra::{SMatrix, SVector};

/// Deviations of the Gaussians, coarse to fine, px.
const SIGMAS: [f32; 4] = [8.0, 4.0, 2.0, 1.0];
/// Ways to the finest level: steps with a translation, and after those with an affine map, at each level before it. Of what grows the rim moves farther than a fine level can follow: the map has to be affine
/// from the coarsest one on. Of what is about to leave the picture too little is seen there, and less says more.
const WAYS: [[[usize; 2]; FINE]; 2] = [[[4, 4], [3, 3], [3, 3]], [[0, 0], [4, 0], [3, 3]]];
/// Those at the finest level.
const FINE_STEPS: [usize; 2] = [1, 6];
/// Most pixels that vote at each level: neighbours say the same in coarse pictures.
const VOTERS: [usize; 4] = [200, 400, 800, usize::MAX];
/// A step shorter than this, px, is the last one at its level.
const SETTLED: f64 = 1e-3;
/// Least deviation of the residual, grey levels: frames are rounded.
const LEAST_DEVIATION: f64 = 0.3;
/// Mean absolute deviation from the median, to the deviation of a normal distribution.
const MAD: f64 = 1.4826;
/// Deviation beforehand of a translation from its start, px, and of what the derivatives change within the cluster's radius over that radius.
const PRIOR: [f64; 2] = [16.0, 0.15];
/// Pixels that an affine map needs.
const AFFINE_PIXELS: usize = 40;
/// The finest level.
const FINE: usize = SIGMAS.len() - 1;
/// Where residuals are truncated for comparison, grey levels.
const TRUNCATED: f64 = 30.0;

/// A frame smoothed at every level.
#[derive(Debug, Clone)]
pub(super) struct SmoothedLevels([Frame<f32>; SIGMAS.len()]);

impl SmoothedLevels {
    /// Smooths a frame in grey levels.
    pub fn new(frame: &Frame<f32>) -> Self {
        // Deviations of this size are always taken; each level is smoothed from the frame itself, so that NaN stays where it reaches.
        Self(SIGMAS.map(|sigma| {
            GaussianSmoother::with(f64::from(sigma), 3.0, crate::image::Border::Reflect)
                .map_or_else(|_| frame.clone(), |smoother| smoother.apply(frame))
        }))
    }
}

/// A motion in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlaneMotion {
    /// Flow and derivatives at the centre.
    pub flow: AffineFlow<f64>,
    /// Medians of the pixels along x and y, px.
    pub centre: [f64; 2],
    /// Truncated mean absolute difference left, grey levels.
    pub residual: f64,
    /// Deviation of the difference left, from its median, grey levels.
    pub deviation: f64,
}

impl PlaneMotion {
    /// Where a pixel goes, px.
    pub fn moved(&self, x: f64, y: f64) -> [f64; 2] {
        let (u, v) = self.flow.at_offset(x - self.centre[0], y - self.centre[1]);
        [x + u, y + v]
    }
}

/// A pixel that votes: its place about the centre, brightness and gradient there.
#[derive(Debug, Clone, Copy)]
struct Voter {
    x: f32,
    y: f32,
    value: f32,
    gradient: [f32; 2],
}

/// A sum of a few unknowns at a time.
type Normal<const N: usize> = (SMatrix<f64, N, N>, SVector<f64, N>);

/// Finds the motion of pixels `(x, y)` between two smoothed frames from the best of some first guesses of the translation, px.
///
/// `None` where fewer than half of the pixels stay in the picture, there are fewer than three, or the equations have no solution.
pub(super) fn affine_motion(
    before: &SmoothedLevels,
    after: &SmoothedLevels,
    pixels: &[[f64; 2]],
    starts: &[[f64; 2]],
) -> Option<PlaneMotion> {
    let task = Task::new(before, after, pixels)?;
    let mut best: Option<([f64; 6], f64)> = None;
    for (start, way) in starts.iter().flat_map(|start| WAYS.iter().map(move |way| (start, way))) {
        let mut map = [start[0], start[1], 0.0, 0.0, 0.0, 0.0];
        let Some(residual) = task.go(way, &mut map, start) else { continue };
        if best.is_none_or(|(_, least)| residual < least) {
            best = Some((map, residual));
        }
    }
    let (mut map, _) = best?;
    let start = [map[0], map[1]];
    task.descend(FINE, FINE_STEPS, &mut map, &start)?;
    task.told(&map)
}

/// Medians of the pixels along x and y: unlike their mean, stray pixels hardly move them.
pub(super) fn middle(pixels: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|i| {
        let mut along: Vec<f64> = pixels.iter().map(|pixel| pixel[i]).collect();
        median(&mut along).unwrap_or(f64::NAN)
    })
}

/// Mean size of residuals, each no more than [`TRUNCATED`]; NaN outside of the picture is left out.
fn truncated_mean(residuals: &[f32]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for residual in residuals.iter().filter(|residual| residual.is_finite()) {
        sum += f64::from(residual.abs()).min(TRUNCATED);
        count += 1.0;
    }
    sum / count
}

/// What all levels share. Maps are `(u, v, u_x, v_x, u_y, v_y)` with derivatives per radius.
struct Task<'a> {
    before: &'a SmoothedLevels,
    after: &'a SmoothedLevels,
    pixels: &'a [[f64; 2]],
    centre: [f64; 2],
    radius: f64,
}

impl<'a> Task<'a> {
    /// `None` for fewer than three pixels.
    fn new(before: &'a SmoothedLevels, after: &'a SmoothedLevels, pixels: &'a [[f64; 2]]) -> Option<Self> {
        if pixels.len() < 3 {
            return None;
        }
        let n = pixels.len() as f64;
        let centre = middle(pixels);
        let spread = pixels.iter().map(|p| (p[0] - centre[0]).powi(2) + (p[1] - centre[1]).powi(2)).sum::<f64>() / n;
        Some(Self { before, after, pixels, centre, radius: spread.sqrt().max(1.0) })
    }

    /// A map as a motion, with what it leaves at the finest level.
    fn told(&self, map: &[f64; 6]) -> Option<PlaneMotion> {
        let voters = self.voters(FINE);
        let mut residuals = Vec::with_capacity(voters.len());
        let deviation = self.residuals(&voters, &self.after.0[FINE], map, &mut residuals)?;
        let [u, v, u_x, v_x, u_y, v_y] = *map;
        let r = self.radius;
        let flow = AffineFlow { u, v, u_x: u_x / r, v_x: v_x / r, u_y: u_y / r, v_y: v_y / r };
        Some(PlaneMotion { flow, centre: self.centre, residual: truncated_mean(&residuals), deviation })
    }

    /// A step of the map's first `N` unknowns, two for a translation and six for an affine map, from residuals of some deviation; its length, px.
    fn step<const N: usize>(
        &self,
        voters: &[Voter],
        (residuals, deviation): (&[f32], f64),
        map: &mut [f64; 6],
        start: &[f64; 2],
    ) -> Option<f64> {
        let (mut matrix, mut right) = self.normal::<N>(voters, residuals, deviation);
        for k in 0..N {
            let (scale, from) = if k < 2 { (PRIOR[0], start[k]) } else { (PRIOR[1] * self.radius, 0.0) };
            let prior = (deviation / scale).powi(2);
            matrix[(k, k)] += prior;
            right[k] -= prior * (map[k] - from);
        }
        let step = matrix.cholesky()?.solve(&right);
        map.iter_mut().zip(step.iter()).for_each(|(value, step)| *value += step);
        Some(step.norm())
    }

    /// At most so many steps of the map's first `N` unknowns at one level, with room for the residuals.
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
            if self.step::<N>(voters, (residuals, deviation), map, start)? < SETTLED {
                break;
            }
        }
        Some(())
    }

    /// Goes a way as far as the level before the finest; the truncated residual there.
    fn go(&self, way: &[[usize; 2]; FINE], map: &mut [f64; 6], start: &[f64; 2]) -> Option<f64> {
        let mut levels = way.iter().enumerate().filter(|(_, steps)| **steps != [0, 0]);
        levels.try_fold(f64::INFINITY, |_, (level, steps)| self.descend(level, *steps, map, start))
    }

    /// Steps at one level, with a translation and with an affine map; the truncated residual at its end.
    fn descend(
        &self,
        level: usize,
        [translations, affine]: [usize; 2],
        map: &mut [f64; 6],
        start: &[f64; 2],
    ) -> Option<f64> {
        let voters = self.voters(level);
        let after = &self.after.0[level];
        let mut residuals = Vec::with_capacity(voters.len());
        let affine = if voters.len() < AFFINE_PIXELS { 0 } else { affine };
        self.settle::<2>(translations, (&voters, after), map, start, &mut residuals)?;
        self.settle::<6>(affine, (&voters, after), map, start, &mut residuals)?;
        self.residuals(&voters, after, map, &mut residuals)?;
        map.iter().all(|value| value.is_finite()).then(|| truncated_mean(&residuals))
    }

    /// Pixels that vote at a level, evenly drawn, those beside the border or anything that is not finite left out.
    fn voters(&self, level: usize) -> Vec<Voter> {
        let frame = &self.before.0[level];
        let (width, height) = frame.size();
        let stride = self.pixels.len().div_ceil(VOTERS[level]).max(1);
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

    /// Brightness after the motion less that before, NaN outside; the deviation, robustly. `None` unless at least half of the pixels are inside.
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
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f32::total_cmp).1;
        Some((MAD * f64::from(median)).max(LEAST_DEVIATION))
    }

    /// Weighted normal equations of a step, weights `1 / (1 + (e / 2 s)^2)^2`.
    fn normal<const N: usize>(&self, voters: &[Voter], residuals: &[f32], deviation: f64) -> Normal<N> {
        let (mut matrix, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
        let inverse_radius = (1.0 / self.radius) as f32;
        for (voter, &residual) in voters.iter().zip(residuals) {
            if !residual.is_finite() {
                continue;
            }
            let outlying = 1.0 + (f64::from(residual) / (2.0 * deviation)).powi(2);
            let weight = 1.0 / (outlying * outlying);
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Smooth waves, as they are at a place of the first frame.
    pub fn waves(x: f64, y: f64) -> f64 {
        128.0 + 40.0 * (0.31 * x + 0.11 * y).sin() + 35.0 * (0.23 * y - 0.13 * x).cos()
    }

    /// Frames whose second shows the first one moved: `x' = x + u + A (x - c)`.
    pub fn pair(translation: [f64; 2], a: [f64; 4]) -> (SmoothedLevels, SmoothedLevels) {
        let first = Frame::from_fn(120, 100, |x, y| waves(x as f64, y as f64) as f32);
        let [p, q, r, s] = [1.0 + a[0], a[1], a[2], 1.0 + a[3]];
        let determinant = p * s - q * r;
        let second = Frame::from_fn(120, 100, |x, y| {
            let (dx, dy) = (x as f64 - 60.0 - translation[0], y as f64 - 50.0 - translation[1]);
            waves(60.0 + (s * dx - q * dy) / determinant, 50.0 + (p * dy - r * dx) / determinant) as f32
        });
        (SmoothedLevels::new(&first), SmoothedLevels::new(&second))
    }

    pub fn pixels() -> Vec<[f64; 2]> {
        (0..31).flat_map(|j| (0..41).map(move |i| [40.0 + f64::from(i), 35.0 + f64::from(j)])).collect()
    }

    #[test]
    fn an_affine_motion_is_found() {
        let (first, second) = pair([3.4, -2.7], [0.02, 0.015, -0.01, 0.03]);
        let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
        let (u, v) = found.flow.at_offset(60.0 - found.centre[0], 50.0 - found.centre[1]);
        let found = PlaneMotion { flow: AffineFlow { u, v, ..found.flow }, ..found };
        let want = [3.4, -2.7, 0.02, -0.01, 0.015, 0.03];
        for (got, (want, tolerance)) in
            found.flow.to_array().into_iter().zip(want.into_iter().zip([0.02; 2].into_iter().chain([0.002; 4])))
        {
            assert!((got - want).abs() < tolerance, "{:?}", found.flow);
        }
        assert!((found.centre[0] - 60.0).abs() < 3.0 && (found.centre[1] - 50.0).abs() < 3.0, "{:?}", found.centre);
        let moved = PlaneMotion { centre: [60.0, 50.0], ..found }.moved(70.0, 50.0);
        assert!((moved[0] - 73.6).abs() < 0.05 && (moved[1] - 47.2).abs() < 0.05);
    }

    #[test]
    fn the_start_with_the_smaller_residual_wins() {
        let (first, second) = pair([17.0, 9.0], [0.0; 4]);
        let found = affine_motion(&first, &second, &pixels(), &[[-9.0, 0.0], [16.0, 8.0]]).unwrap();
        assert!((found.flow.u - 17.0).abs() < 0.02 && (found.flow.v - 9.0).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn what_covers_a_quarter_hardly_matters() {
        let (first, mut second) = pair([1.5, 0.5], [0.0; 4]);
        for frame in &mut second.0 {
            for y in 0..100 {
                frame.row_mut(y)[70..].fill(20.0);
            }
        }
        let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
        assert!((found.flow.u - 1.5).abs() < 0.1 && (found.flow.v - 0.5).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn nothing_is_said_of_what_is_not_there() {
        let (first, second) = pair([0.0; 2], [0.0; 4]);
        assert_eq!(affine_motion(&first, &second, &pixels()[..2], &[[0.0, 0.0]]), None);
        assert_eq!(affine_motion(&first, &second, &pixels(), &[[90.0, 0.0]]), None);
        let blind = SmoothedLevels(second.0.clone().map(|frame| frame.map(|_| f32::NAN)));
        assert_eq!(affine_motion(&first, &blind, &pixels(), &[[0.0, 0.0]]), None);
        assert_eq!(affine_motion(&blind, &first, &pixels(), &[[0.0, 0.0]]), None);
    }
}
