//! Lucas and Kanade (1981): flow constant in a window, least squares.
//!
//! At the frame's edge the window is cut off and normalised by the weight that remains, as that of the
//! windowed method: only the outermost pixels, which have no gradient, get status `Border`, and what has less
//! than a tenth of the window's weight around it (in frames smaller than the window). Masked and bad pixels,
//! in contrast, take every window with them that touches them.

use super::{pair::Crop, pair::Differences, pair::Gradients, pair::magnitude};
use crate::error::{Error, Result};
use crate::flow::options::EstimatorOptions;
use crate::flow::site::{FieldBand, MaskCounts, bands};
use crate::image::StructureTensor;
use crate::jet::Reach;
use crate::math::Real;
use crate::parallel::{self, Threads};
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame, Rect, SamplingGrid, Status};
use std::ops::Range;

/// The weights of the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Window {
    /// Gaussian of this standard deviation, px, cut off at three of them.
    Gaussian(f64),
    /// Square of this odd side, px, equal weights.
    Box(usize),
}

/// Options of the Lucas-Kanade baseline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LucasKanadeOptions {
    /// The window. Default: Gaussian, 4 px.
    pub window: Window,
    /// The frames differenced. Default: three.
    pub differences: Differences,
}

impl Default for LucasKanadeOptions {
    fn default() -> Self {
        Self { window: Window::Gaussian(4.0), differences: Differences::default() }
    }
}

/// Smallest eigenvalue of the window's gradient matrix, relative to its largest, that counts as
/// two-dimensional structure.
const RANK_TOLERANCE: f64 = 1e-9;

/// Least share of the window's weight that must lie inside the frame; that of the windowed method.
const MIN_USABLE_WEIGHT: f64 = 0.1;

/// The estimator behind the options.
#[derive(Debug)]
pub(in crate::flow) struct LucasKanade {
    options: LucasKanadeOptions,
    /// One-dimensional window weights; the window is their product.
    kernel: Vec<f64>,
}

/// Weighted sums over one window.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// `w Ix^2, w Ix Iy, w Iy^2, w Ix It, w Iy It, w It^2`, then the first three with squared weights.
    values: [f64; 9],
    /// Sum of the weights.
    weight: f64,
}

/// The taps of a kernel centred at `centre` that fall on pixels with a gradient: all of a crop of `n` but its
/// outermost.
fn taps(kernel: &[f64], centre: usize, n: usize) -> Range<usize> {
    let radius = kernel.len() / 2;
    (radius + 1).saturating_sub(centre)..kernel.len().min((n + radius).saturating_sub(centre + 1))
}

impl LucasKanade {
    /// Checks the options.
    pub fn new(options: &LucasKanadeOptions, _common: &EstimatorOptions) -> Result<Self> {
        let kernel = match options.window {
            Window::Gaussian(sigma) if sigma > 0.0 && sigma <= 100.0 => {
                let radius = (3.0 * sigma + 0.5) as i32;
                (-radius..=radius).map(|e| (-0.5 * (f64::from(e) / sigma).powi(2)).exp()).collect()
            }
            Window::Box(side) if side % 2 == 1 && (3..=601).contains(&side) => vec![1.0; side],
            Window::Gaussian(sigma) => {
                return Err(Error::argument("window", "a Gaussian of more than 0 and at most 100 px", sigma));
            }
            Window::Box(side) => return Err(Error::argument("window", "an odd side from 3 to 601 px", side)),
        };
        Ok(Self { options: *options, kernel })
    }
    /// Frames differenced.
    pub fn frames_needed(&self) -> usize {
        self.options.differences.frames()
    }
    /// The frame that the flow is filed under.
    pub fn frame(&self) -> usize {
        self.options.differences.frame()
    }
    fn radius(&self) -> usize {
        self.kernel.len() / 2
    }
    /// The window's part inside the frame, and one pixel more for its gradients.
    fn reach(&self, (x, y): (usize, usize), (w, h): (usize, usize)) -> Reach {
        let r = self.radius() + 1;
        Reach { left: r.min(x), right: r.min(w - 1 - x), up: r.min(y), down: r.min(h - 1 - y) }
    }

    /// Share of the window's weight that lies inside the frame.
    fn share(&self, (x, y): (usize, usize), (w, h): (usize, usize)) -> f64 {
        let sum = |centre, n| self.kernel[taps(&self.kernel, centre, n)].iter().sum::<f64>();
        sum(x, w) * sum(y, h) / self.kernel.iter().sum::<f64>().powi(2)
    }

    /// Fills `field`, in px and frames.
    pub fn estimate_into<T: SimdReal>(
        &self,
        frames: &[&Frame<T>],
        common: &EstimatorOptions,
        field: &mut FlowField<T>,
    ) -> Result<()> {
        let (w, h) = frames[0].size();
        let (width, sites, r) = (field.width, field.layout.sites.clone(), self.radius() + 1);
        let counts = common.mask.as_ref().map(MaskCounts::new);
        let around = |x0: usize, y0: usize, x1: usize, y1: usize| Crop {
            x0: x0.saturating_sub(r),
            y0: y0.saturating_sub(r),
            x1: (x1 + r).min(w),
            y1: (y1 + r).min(h),
        };
        let obstacle = |at: (usize, usize)| {
            let rim = Reach { left: 1, right: 1, up: 1, down: 1 };
            if !rim.fits(at, (w, h)) || self.share(at, (w, h)) < MIN_USABLE_WEIGHT {
                return Some(Status::Border);
            }
            counts.as_ref().is_some_and(|c| c.touches(at, self.reach(at, (w, h)))).then_some(Status::Masked)
        };
        let gradients = |crop: Crop, threads: Threads| {
            Gradients::new(frames, self.options.differences, crop, threads, common.level())
        };
        let region = match sites {
            SamplingGrid::Grid { region, .. } => Some(region.unwrap_or(Rect { x: 0, y: 0, width: w, height: h })),
            SamplingGrid::Points(_) => None,
        };
        let whole = match region {
            Some(q) => {
                let crop = around(q.x, q.y, q.x + q.width, q.y + q.height);
                Some((gradients(crop, common.threads)?, crop))
            }
            None => None,
        };
        let one = Threads::new(Some(1))?;
        let noise = common.noise.map(|sd| sd * sd * self.options.differences.first_gain());
        common.threads.install(|| {
            let results = parallel::map(bands(field), |mut band| {
                let mut columns = Columns::default();
                for index in band.sites.clone() {
                    let (col, row) = (index % width, index / width);
                    let at = sites.pixel(col, row);
                    let local = index - band.sites.start;
                    if let Some(status) = obstacle(at) {
                        put(&mut band, local, Err(status), &mut [[f64::NAN; 2]; 2], f64::NAN);
                        continue;
                    }
                    let (sums, brightness) = if let Some((g, crop)) = &whole {
                        columns.prepare(g, at.1 - crop.y0, &self.kernel);
                        (columns.window(at.0 - crop.x0, &self.kernel), g.brightness)
                    } else {
                        let crop = around(at.0, at.1, at.0 + 1, at.1 + 1);
                        let g = gradients(crop, one)?;
                        columns.row = None;
                        columns.prepare(&g, at.1 - crop.y0, &self.kernel);
                        (columns.window(at.0 - crop.x0, &self.kernel), g.brightness)
                    };
                    Self::solve::<T>(&mut band, local, &sums, brightness, noise);
                }
                Ok(())
            });
            results.into_iter().collect()
        })
    }

    /// The 2x2 normal equations of one window.
    fn solve<T: Real>(band: &mut FieldBand<'_, T>, local: usize, sums: &Sums, brightness: f64, noise: Option<f64>) {
        // Without the gain in intensity, whose fourth power may be beyond any number.
        let gain = magnitude(sums.values[0] + sums.values[2]);
        let [xx, xy, yy, xt, yt, tt, sxx, sxy, syy] = sums.values.map(|v| v / gain);
        let mut none = [[f64::NAN; 2]; 2];
        if !sums.values.iter().all(|v| v.is_finite()) {
            return put(band, local, Err(Status::NonFinite), &mut none, f64::NAN);
        }
        let weight = sums.weight;
        let tensor = StructureTensor { xx, xy, yy };
        let (det, largest) = (tensor.determinant(), tensor.larger_eigenvalue());
        let spacing = if size_of::<T>() == 4 { f64::from(f32::EPSILON) } else { f64::EPSILON };
        let floor = weight * (brightness * spacing).powi(2) / gain;
        if !(largest > 0.0 && det / largest > floor.max(RANK_TOLERANCE * largest)) {
            return put(band, local, Err(Status::Unobservable), &mut none, f64::NAN);
        }
        let inverse = [[yy / det, -xy / det], [-xy / det, xx / det]];
        let u = -(inverse[0][0] * xt + inverse[0][1] * yt);
        let v = -(inverse[1][0] * xt + inverse[1][1] * yt);
        let left = (tt + u * xt + v * yt).max(0.0);
        // Sandwich A^-1 (sum w^2 g g^T) A^-1: the weights are no inverse variances.
        let middle = [[sxx, sxy], [sxy, syy]];
        let mut covariance = [[0.0; 2]; 2];
        for i in 0..2 {
            for j in 0..2 {
                for k in 0..2 {
                    for l in 0..2 {
                        covariance[i][j] += inverse[i][k] * middle[k][l] * inverse[l][j];
                    }
                }
            }
        }
        let used = inverse[0][0] * sxx + 2.0 * inverse[0][1] * sxy + inverse[1][1] * syy;
        let variance = noise.map_or(left / (weight - used), |variance| variance / gain);
        covariance.iter_mut().flatten().for_each(|c| *c *= variance);
        put(band, local, Ok((u, v)), &mut covariance, (left * gain / weight).sqrt());
        let smallest = det / largest;
        if let Some(p) = &mut band.condition {
            p[local] = T::from_f64((largest / smallest).sqrt());
        }
    }
}

/// Products summed down the columns of one row of windows.
#[derive(Default)]
struct Columns {
    row: Option<usize>,
    sums: Vec<[f64; 9]>,
    /// Sum of the weights down a column.
    weight: f64,
}

impl Columns {
    fn prepare(&mut self, g: &Gradients, y: usize, kernel: &[f64]) {
        if self.row == Some(y) {
            return;
        }
        self.row = Some(y);
        self.sums.clear();
        self.sums.resize(g.ix.width(), [0.0; 9]);
        let taps = taps(kernel, y, g.ix.height());
        self.weight = kernel[taps.clone()].iter().sum();
        for k in taps {
            let (w, row) = (kernel[k], y + k - kernel.len() / 2);
            let lines = g.ix.row(row).iter().zip(g.iy.row(row)).zip(g.it.row(row));
            for (sum, ((&x, &y), &t)) in self.sums.iter_mut().zip(lines) {
                let products = [x * x, x * y, y * y, x * t, y * t, t * t];
                for (s, p) in sum.iter_mut().zip(products) {
                    *s += w * p;
                }
                for (s, p) in sum[6..].iter_mut().zip(products) {
                    *s += w * w * p;
                }
            }
        }
    }

    fn window(&self, x: usize, kernel: &[f64]) -> Sums {
        let mut out = Sums::default();
        let taps = taps(kernel, x, self.sums.len());
        out.weight = self.weight * kernel[taps.clone()].iter().sum::<f64>();
        for (&w, column) in kernel[taps.clone()].iter().zip(&self.sums[x + taps.start - kernel.len() / 2..]) {
            for (k, (o, c)) in out.values.iter_mut().zip(column).enumerate() {
                *o += c * if k < 6 { w } else { w * w };
            }
        }
        out
    }
}

/// Writes flow or its absence.
fn put<T: Real>(
    band: &mut FieldBand<'_, T>,
    local: usize,
    flow: std::result::Result<(f64, f64), Status>,
    covariance: &mut [[f64; 2]; 2],
    residual: f64,
) {
    let (u, v) = flow.unwrap_or((f64::NAN, f64::NAN));
    band.motion[0][local] = T::from_f64(u);
    band.motion[1][local] = T::from_f64(v);
    let upper = [covariance[0][0], covariance[0][1], covariance[1][1]];
    for (plane, value) in band.covariance.iter_mut().zip(upper) {
        plane[local] = T::from_f64(value);
    }
    if let Some(p) = &mut band.residual {
        p[local] = T::from_f64(residual);
    }
    if let Some(p) = &mut band.rank {
        p[local] = if flow.is_ok() { 2 } else { 0 };
    }
    if let Some(p) = &mut band.condition {
        p[local] = T::nan();
    }
    band.status[local] = flow.err().unwrap_or(Status::Ok);
}
