//! The gradient equation in the windows around all pixels, summed: M. Chiba and S. Ozawa, equations (5) to
//! (8).

use super::{kernels::DerivativeKernels, kernels::REACH, kernels::SIDE, options::LocalFlowOptions};
use crate::image::StructureTensor;
use crate::types::Frame;

/// Products of derivatives: `xx, xy, yy, xt, yt, tt`.
type Products = [f64; 6];

/// `G'G`, `G'b` and `b'b` of the windows around all pixels; NaN where a window is incomplete.
pub(super) struct Equations {
    sums: Frame<Products>,
    /// Equations in a window.
    count: f64,
}

impl Equations {
    /// Of a frame and the next one, which was warped by what is known of the flow.
    pub fn new(first: &Frame<f64>, warped: &Frame<f64>, kernels: &DerivativeKernels, window: usize) -> Self {
        let (width, height) = first.size();
        let products = Frame::from_fn(width, height, |x, y| products(first, warped, kernels, [x, y]));
        let reach = window / 2;
        Self { sums: summed(&summed(&products, [0, reach]), [reach, 0]), count: (window * window) as f64 }
    }

    /// Residual of no step at all; infinite where it is not known.
    pub fn residual(&self, at: usize) -> f64 {
        let [.., tt] = self.sums.data()[at];
        if tt.is_nan() { f64::INFINITY } else { tt }
    }

    /// The step at a pixel (7), and whether it is accepted; `least` is the weakest gradient that counts.
    pub fn step(&self, at: usize, options: &LocalFlowOptions, least: f64) -> Option<([f64; 2], bool)> {
        let [xx, xy, yy, xt, yt, _] = self.sums.data()[at];
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

/// Products of derivatives: x and y of the mean of both frames, t of their difference; NaN at the border.
fn products(first: &Frame<f64>, warped: &Frame<f64>, kernels: &DerivativeKernels, [x, y]: [usize; 2]) -> Products {
    let (width, height) = first.size();
    if x < REACH || y < REACH || x + REACH >= width || y + REACH >= height {
        return [f64::NAN; 6];
    }
    let [mut dx, mut dy, mut dt] = [0.0; 3];
    for (j, i) in (0..SIDE).flat_map(|j| (0..SIDE).map(move |i| (j, i))) {
        let [a, b] = [first, warped].map(|frame| frame.get(x + i - REACH, y + j - REACH));
        dx += kernels.x[j][i] * 0.5 * (a + b);
        dy += kernels.y[j][i] * 0.5 * (a + b);
        dt += kernels.value[j][i] * (b - a);
    }
    [dx * dx, dx * dy, dy * dy, dx * dt, dy * dt, dt * dt]
}

/// Sums over so many pixels to either side along x and y; NaN where these are not all in the frame.
fn summed(values: &Frame<Products>, [along, down]: [usize; 2]) -> Frame<Products> {
    let (width, height) = values.size();
    Frame::from_fn(width, height, |x, y| {
        if x < along || y < down || x + along >= width || y + down >= height {
            return [f64::NAN; 6];
        }
        let mut sums = [0.0; 6];
        for (j, i) in (y - down..=y + down).flat_map(|j| (x - along..=x + along).map(move |i| (j, i))) {
            sums.iter_mut().zip(values.get(i, j)).for_each(|(sum, value)| *sum += value);
        }
        sums
    })
}
