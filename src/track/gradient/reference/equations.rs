//! The gradient equation in the windows around all pixels, summed: M. Chiba and S. Ozawa, equations (5) to
//! (8). In single precision: windows hold few pixels of some hundred grey levels, and ill-conditioned ones
//! are refused.

use super::kernels::{DerivativeKernels, REACH};
use super::options::LocalFlowOptions;
use crate::image::StructureTensor;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::types::Frame;
use std::ops::Range;

/// Sums of products of derivatives.
const SUMS: usize = 6;

/// `G'G`, `G'b` and `b'b` of the windows around all pixels; NaN where a window reaches over the border or
/// holds NaN.
pub(super) struct Equations {
    /// Row-major planes of `xx, xy, yy, xt, yt, tt`.
    sums: [Vec<f32>; SUMS],
    /// Equations in a window.
    count: f64,
}

impl Equations {
    /// Of a frame and the next one, which was warped by what is known of the flow.
    pub fn new(first: &Frame<f64>, warped: &Frame<f64>, kernels: &DerivativeKernels, window: usize) -> Self {
        let sums = dispatch(Level::detect(), Build { first, warped, kernels, window });
        Self { sums, count: (window * window) as f64 }
    }

    /// Residual of no step at all; infinite where it is not known.
    pub fn residual(&self, at: usize) -> f64 {
        let tt = self.sums[5][at];
        if tt.is_nan() { f64::INFINITY } else { f64::from(tt) }
    }

    /// The step at a pixel (7), and whether it is accepted; `least` is the weakest gradient that counts.
    pub fn step(&self, at: usize, options: &LocalFlowOptions, least: f64) -> Option<([f64; 2], bool)> {
        let [xx, xy, yy, xt, yt, _] = std::array::from_fn(|k| f64::from(self.sums[k][at]));
        let tensor = StructureTensor { xx, xy, yy };
        let determinant = tensor.determinant();
        if determinant.is_nan() || determinant <= 0.0 {
            return None;
        }
        let step = tensor.solve([-xt, -yt]);
        let largest = tensor.larger_eigenvalue();
        let smallest = determinant / largest;
        let accepted = largest <= options.cond_max.powi(2) * smallest
            && smallest >= least * least * self.count
            && step[0] * step[0] + step[1] * step[1] <= options.step_max.powi(2);
        step[0].is_finite().then_some((step, accepted && step[1].is_finite()))
    }
}

/// Derivatives by the masks, then products summed over windows.
struct Build<'a> {
    first: &'a Frame<f64>,
    warped: &'a Frame<f64>,
    kernels: &'a DerivativeKernels,
    window: usize,
}

impl Kernel<f32> for Build<'_> {
    type Output = [Vec<f32>; SUMS];

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(self) -> Self::Output {
        let (width, height) = self.first.size();
        let margin = REACH + self.window / 2;
        let mut sums = std::array::from_fn(|_| vec![f32::NAN; width * height]);
        if width > 2 * margin && height > 2 * margin {
            // A row narrower than one vector is left to single lanes.
            if width < 2 * margin + V::LANES { self.fill::<f32>(&mut sums) } else { self.fill::<V>(&mut sums) }
        }
        sums
    }
}

impl Build<'_> {
    #[inline(always)]
    fn fill<V: Lanes<Scalar = f32>>(&self, sums: &mut [Vec<f32>; SUMS]) {
        let (width, height) = self.first.size();
        let derivatives = self.derivatives::<V>();
        let reach = self.window / 2;
        let columns = REACH + reach..width - REACH - reach;
        let mut lines: [Vec<f32>; SUMS] = std::array::from_fn(|_| vec![0.0; width]);
        for y in REACH + reach..height - REACH - reach {
            for x in starts::<V>(REACH..width - REACH) {
                let mut down = [V::zero(); SUMS];
                for j in y - reach..=y + reach {
                    let at = j * width + x;
                    let (dx, dy) = (V::load(&derivatives[0][at..]), V::load(&derivatives[1][at..]));
                    let dt = V::load(&derivatives[2][at..]);
                    for (sum, (a, b)) in
                        down.iter_mut().zip([(dx, dx), (dx, dy), (dy, dy), (dx, dt), (dy, dt), (dt, dt)])
                    {
                        *sum = a.mul_add(b, *sum);
                    }
                }
                for (sum, line) in down.iter().zip(&mut lines) {
                    sum.store(&mut line[x..]);
                }
            }
            for (line, sums) in lines.iter().zip(sums.iter_mut()) {
                for x in starts::<V>(columns.clone()) {
                    let mut along = V::load(&line[x - reach..]);
                    for i in 1..self.window {
                        along = along + V::load(&line[x - reach + i..]);
                    }
                    along.store(&mut sums[y * width + x..]);
                }
            }
        }
    }

    /// Derivatives along x and y of the mean of both frames, and by time of their smoothed difference;
    /// row-major, nothing along the border.
    ///
    /// The masks are even or odd along each axis: rows and columns as far above as below are added or
    /// subtracted first, which leaves a third of the products.
    #[inline(always)]
    fn derivatives<V: Lanes<Scalar = f32>>(&self) -> [Vec<f32>; 3] {
        let (width, height) = self.first.size();
        let DerivativeKernels { value: mask, x: x_mask, y: y_mask } = self.kernels;
        let frames = self.first.data().iter().zip(self.warped.data());
        let (mean, difference): (Vec<f32>, Vec<f32>) =
            frames.map(|(a, b)| ((0.5 * (a + b)) as f32, (b - a) as f32)).unzip();
        let mut out = std::array::from_fn(|_| vec![0.0; width * height]);
        let mut folded: [Folded; REACH + 1] = std::array::from_fn(|_| Folded::new(width));
        for y in REACH..height - REACH {
            for (k, folded) in folded.iter_mut().enumerate() {
                let (above, below) = ((y - k) * width..(y - k + 1) * width, (y + k) * width..(y + k + 1) * width);
                folded.fill::<V>(
                    k,
                    [&mean[above.clone()], &mean[below.clone()]],
                    [&difference[above], &difference[below]],
                );
            }
            for x in starts::<V>(REACH..width - REACH) {
                let (mut dx, mut dy, mut dt) = (V::zero(), V::zero(), V::zero());
                for (k, Folded { sum, rise, change }) in folded.iter().enumerate() {
                    let (mask, x_mask, y_mask) = (&mask[REACH + k], &x_mask[REACH + k], &y_mask[REACH + k]);
                    dy = V::load(&rise[x..]).mul_add(V::splat(y_mask[REACH] as f32), dy);
                    dt = V::load(&change[x..]).mul_add(V::splat(mask[REACH] as f32), dt);
                    for i in 1..=REACH {
                        let around = |line: &[f32]| (V::load(&line[x - i..]), V::load(&line[x + i..]));
                        let ((left, right), (a, b), (c, d)) = (around(sum), around(rise), around(change));
                        dx = (right - left).mul_add(V::splat(x_mask[REACH + i] as f32), dx);
                        dy = (a + b).mul_add(V::splat(y_mask[REACH + i] as f32), dy);
                        dt = (c + d).mul_add(V::splat(mask[REACH + i] as f32), dt);
                    }
                }
                for (value, plane) in [dx, dy, dt].into_iter().zip(&mut out) {
                    value.store(&mut plane[y * width + x..]);
                }
            }
        }
        out
    }
}

/// Two rows, so far above and below a third one, as one.
struct Folded {
    /// Their sum in the mean of the frames.
    sum: Vec<f32>,
    /// The lower one less the upper one there.
    rise: Vec<f32>,
    /// Their sum in the difference of the frames.
    change: Vec<f32>,
}

impl Folded {
    fn new(width: usize) -> Self {
        let [sum, rise, change] = std::array::from_fn(|_| vec![0.0; width]);
        Self { sum, rise, change }
    }

    /// Of the rows `k` above and below; for 0 both are the same one, which counts once.
    #[inline(always)]
    fn fill<V: Lanes<Scalar = f32>>(&mut self, k: usize, mean: [&[f32]; 2], difference: [&[f32]; 2]) {
        let share = V::splat(if k == 0 { 0.5 } else { 1.0 });
        for x in starts::<V>(0..self.sum.len()) {
            let [above, below] = [V::load(&mean[0][x..]), V::load(&mean[1][x..])];
            ((above + below) * share).store(&mut self.sum[x..]);
            (below - above).store(&mut self.rise[x..]);
            ((V::load(&difference[0][x..]) + V::load(&difference[1][x..])) * share).store(&mut self.change[x..]);
        }
    }
}

/// First indices of vectors that cover a range at least one vector long; the last one may overlap the one
/// before.
#[inline(always)]
fn starts<V: Lanes>(range: Range<usize>) -> impl Iterator<Item = usize> {
    let last = range.end - V::LANES;
    (range.start..last).step_by(V::LANES).chain(std::iter::once(last))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;
    use crate::track::gradient::reference::kernels::SIDE;
    use crate::track::gradient::reference::kernels::derivative_kernels;

    /// Straight from the definition.
    fn sums_at(
        first: &Frame<f64>,
        second: &Frame<f64>,
        kernels: &DerivativeKernels,
        window: usize,
        [x, y]: [usize; 2],
    ) -> [f64; SUMS] {
        let mut sums = [0.0; SUMS];
        let reach = window / 2;
        for (j, i) in (y - reach..=y + reach).flat_map(|j| (x - reach..=x + reach).map(move |i| (j, i))) {
            let mut d = [0.0; 3];
            for (n, m) in (0..SIDE).flat_map(|n| (0..SIDE).map(move |m| (n, m))) {
                let (a, b) = (first.get(i + m - REACH, j + n - REACH), second.get(i + m - REACH, j + n - REACH));
                d[0] += kernels.x[n][m] * 0.5 * (a + b);
                d[1] += kernels.y[n][m] * 0.5 * (a + b);
                d[2] += kernels.value[n][m] * (b - a);
            }
            let [x, y, t] = d;
            for (sum, product) in sums.iter_mut().zip([x * x, x * y, y * y, x * t, y * t, t * t]) {
                *sum += product;
            }
        }
        sums
    }

    #[test]
    fn sums_are_those_of_the_definition_on_every_instruction_set() {
        for (window, order, (width, height)) in [(7, 4, (33, 14)), (5, 2, (9, 12)), (3, 1, (7, 7)), (7, 3, (15, 15))] {
            let rng = CounterRng::new(3);
            let frame =
                |k: u64| Frame::from_fn(width, height, |x, y| 90.0 + 30.0 * rng.normal(k + (y * width + x) as u64));
            let (first, second) = (frame(0), frame(9999));
            let kernels = derivative_kernels(order);
            let margin = REACH + window / 2;
            for level in Level::available() {
                let got = dispatch(level, Build { first: &first, warped: &second, kernels: &kernels, window });
                for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                    let inside = (margin..width - margin).contains(&x) && (margin..height - margin).contains(&y);
                    let want =
                        if inside { sums_at(&first, &second, &kernels, window, [x, y]) } else { [f64::NAN; SUMS] };
                    for k in 0..SUMS {
                        let got = f64::from(got[k][y * width + x]);
                        let close = (got - want[k]).abs() <= 1e-5 * want[0].max(want[2]).max(want[5]).max(1.0);
                        assert!(
                            close || got.is_nan() && want[k].is_nan(),
                            "{level:?} {window} {k} {x} {y}: {got} {}",
                            want[k]
                        );
                    }
                }
            }
        }
    }
}
