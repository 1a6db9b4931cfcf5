//! Horn and Schunck (1981): globally smooth flow.
//!
//! The energy's Euler-Lagrange equations with free boundary are a symmetric positive (semi-)definite linear
//! system, solved by conjugate gradients with the inverse of each pixel's 2x2 block as preconditioner. Sums
//! run over fixed bands in a fixed order, so the result does not depend on the number of threads.

use super::{pair::Crop, pair::Differences, pair::Gradients, pair::magnitude};
use crate::error::{Error, Result};
use crate::flow::options::EstimatorOptions;
use crate::flow::site::{MaskCounts, bands};
use crate::jet::Reach;
use crate::parallel::{self, checkpoint};
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame, Status};

/// The smoothness weight g of the energy `sum (Ix u + Iy v + It)^2 + g^2 (|grad u|^2 + |grad v|^2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Smoothness {
    /// In units of the frame's root mean square gradient, so that the flow does not depend on the intensity
    /// gain.
    Relative(f64),
    /// In grey levels per px.
    Absolute(f64),
}

/// Options of the Horn-Schunck baseline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HornSchunckOptions {
    /// Smoothness weight. Default: the root mean square gradient.
    pub smoothness: Smoothness,
    /// The linear system is solved to this relative residual. Default 1e-6.
    pub tolerance: f64,
    /// Most iterations; an error when they do not suffice. Default 5000.
    pub iterations: usize,
    /// The frames differenced. Default: three.
    pub differences: Differences,
}

impl Default for HornSchunckOptions {
    fn default() -> Self {
        Self {
            smoothness: Smoothness::Relative(1.0),
            tolerance: 1e-6,
            iterations: 5000,
            differences: Differences::default(),
        }
    }
}

/// Pixels of one partial sum. Fixed, so that sums never depend on the number of threads.
const BLOCK: usize = 8192;

/// The estimator behind the options.
#[derive(Debug)]
pub(in crate::flow) struct HornSchunck {
    options: HornSchunckOptions,
}

impl HornSchunck {
    /// Checks the options.
    pub fn new(options: &HornSchunckOptions, common: &EstimatorOptions) -> Result<Self> {
        let (Smoothness::Relative(g) | Smoothness::Absolute(g)) = options.smoothness;
        if !(g.is_finite() && g > 0.0) {
            return Err(Error::argument("smoothness", "a positive weight", g));
        }
        if !(options.tolerance > 0.0 && options.tolerance < 1.0) {
            return Err(Error::argument("tolerance", "a relative residual between 0 and 1", options.tolerance));
        }
        if options.iterations == 0 {
            return Err(Error::argument("iterations", "a positive integer", 0));
        }
        if common.covariance {
            return Err(Error::argument(
                "covariance",
                "false with Horn-Schunck, whose smoothness is no noise model",
                true,
            ));
        }
        Ok(Self { options: *options })
    }
    /// Frames differenced.
    pub fn frames_needed(&self) -> usize {
        self.options.differences.frames()
    }
    /// The frame that the flow is filed under.
    pub fn frame(&self) -> usize {
        self.options.differences.frame()
    }

    /// Fills `field`, in px and frames.
    ///
    /// The domain is the frame without its outermost pixels, which have no gradient. Masked and bad pixels
    /// contribute no data there and get no estimate. Where all gradients of the frame are parallel one
    /// component is free up to a constant: the status is then `MinNorm`.
    pub fn estimate_into<T: SimdReal>(
        &self,
        frames: &[&Frame<T>],
        common: &EstimatorOptions,
        field: &mut FlowField<T>,
    ) -> Result<()> {
        let (w, h) = frames[0].size();
        let crop = Crop { x0: 0, y0: 0, x1: w, y1: h };
        let g = Gradients::new(frames, self.options.differences, crop, common.threads, common.level())?;
        let counts = common.mask.as_ref().map(MaskCounts::new);
        let reach = Reach { left: 1, right: 1, up: 1, down: 1 };
        let status = |x: usize, y: usize| {
            if !reach.fits((x, y), (w, h)) {
                Status::Border
            } else if counts.as_ref().is_some_and(|c| c.touches((x, y), reach)) {
                Status::Masked
            } else if [&g.ix, &g.iy, &g.it].iter().all(|p| p.get(x, y).is_finite()) {
                Status::Ok
            } else {
                Status::NonFinite
            }
        };
        let (n, m) = (w - 2, h - 2);
        let mut data = Vec::with_capacity(n * m);
        for y in 1..h - 1 {
            for x in 1..w - 1 {
                let ok = status(x, y) == Status::Ok;
                data.push(if ok { [g.ix.get(x, y), g.iy.get(x, y), g.it.get(x, y)] } else { [0.0; 3] });
            }
        }
        // Squares of squares are to come: without the gain they neither overflow nor vanish.
        let gain = magnitude(data.iter().flatten().fold(0.0, |largest: f64, d| largest.max(d.abs())));
        data.iter_mut().flatten().for_each(|d| *d /= gain);
        let structure = Structure::new(&data);
        let spacing = if size_of::<T>() == 4 { f64::from(f32::EPSILON) } else { f64::EPSILON };
        let rank = structure.rank((g.brightness / gain * spacing).powi(2) * data.len() as f64);
        let solution = if rank == 0 {
            None
        } else {
            let weight = match self.options.smoothness {
                Smoothness::Absolute(weight) => weight / gain,
                Smoothness::Relative(factor) => factor * structure.mean_square.sqrt(),
            };
            let system = System { width: n, height: m, data: &data, square: weight * weight };
            Some(common.threads.install(|| system.solve(self.options.tolerance, self.options.iterations))?)
        };
        let (width, sites) = (field.width, field.layout.sites.clone());
        for mut band in bands(field) {
            for index in band.sites.clone() {
                let (x, y) = sites.pixel(index % width, index / width);
                let local = index - band.sites.start;
                let mut here = status(x, y);
                let mut flow = [f64::NAN; 2];
                if here == Status::Ok {
                    (here, flow) = match (&solution, rank) {
                        (Some(f), 2) => (Status::Ok, f[(y - 1) * n + x - 1]),
                        (Some(f), _) => (Status::MinNorm, f[(y - 1) * n + x - 1]),
                        (None, _) => (Status::Unobservable, flow),
                    };
                }
                band.status[local] = here;
                for (plane, value) in band.motion.iter_mut().zip(flow) {
                    plane[local] = T::from_f64(value);
                }
                if let Some(p) = &mut band.residual {
                    let left = g.ix.get(x, y) * flow[0] + g.iy.get(x, y) * flow[1] + g.it.get(x, y);
                    p[local] = T::from_f64(left.abs());
                }
                if let Some(p) = &mut band.rank {
                    p[local] = if flow[0].is_finite() { rank } else { 0 };
                }
            }
        }
        Ok(())
    }
}

/// The sum of `grad I grad I^T` over the frame.
struct Structure {
    xx: f64,
    xy: f64,
    yy: f64,
    mean_square: f64,
}

impl Structure {
    fn new(data: &[[f64; 3]]) -> Self {
        let sum = |f: &dyn Fn(&[f64; 3]) -> f64| data.iter().map(f).sum::<f64>();
        let (xx, xy, yy) = (sum(&|d| d[0] * d[0]), sum(&|d| d[0] * d[1]), sum(&|d| d[1] * d[1]));
        let used = data.iter().filter(|d| **d != [0.0; 3]).count().max(1);
        Self { xx, xy, yy, mean_square: (xx + yy) / used as f64 }
    }

    /// How many components of a constant flow the frame determines.
    fn rank(&self, floor: f64) -> u8 {
        let spread = ((self.xx - self.yy).powi(2) + 4.0 * self.xy * self.xy).sqrt();
        let (large, small) = (0.5 * (self.xx + self.yy + spread), 0.5 * (self.xx + self.yy - spread));
        u8::from(large > floor) + u8::from(small > floor.max(1e-9 * large))
    }
}

/// `(grad I grad I^T + g^2 L) f = -It grad I`, L the five-point Laplacian with free boundary.
struct System<'a> {
    width: usize,
    height: usize,
    data: &'a [[f64; 3]],
    square: f64,
}

type Flow = Vec<[f64; 2]>;

impl System<'_> {
    fn neighbours(&self, i: usize) -> impl Iterator<Item = usize> {
        let (x, y, w) = (i % self.width, i / self.width, self.width);
        [
            (x > 0).then(|| i - 1),
            (x + 1 < w).then(|| i + 1),
            (y > 0).then(|| i - w),
            (y + 1 < self.height).then(|| i + w),
        ]
        .into_iter()
        .flatten()
    }

    /// `out = A f`.
    fn apply(&self, f: &Flow, out: &mut Flow) {
        parallel::for_each(out.chunks_mut(BLOCK).enumerate(), |(block, chunk)| {
            for (k, o) in chunk.iter_mut().enumerate() {
                let i = block * BLOCK + k;
                let [ix, iy, _] = self.data[i];
                let [u, v] = f[i];
                let along = ix * u + iy * v;
                let (mut lu, mut lv) = (0.0, 0.0);
                for j in self.neighbours(i) {
                    lu += u - f[j][0];
                    lv += v - f[j][1];
                }
                *o = [ix * along + self.square * lu, iy * along + self.square * lv];
            }
        });
    }

    /// `out = B^-1 r`, B the 2x2 blocks of the diagonal.
    fn precondition(&self, r: &Flow, out: &mut Flow) {
        parallel::for_each(out.chunks_mut(BLOCK).enumerate(), |(block, chunk)| {
            for (k, o) in chunk.iter_mut().enumerate() {
                let i = block * BLOCK + k;
                let [ix, iy, _] = self.data[i];
                // A frame of one pixel has no neighbour; the block must stay regular.
                let d = self.square * (self.neighbours(i).count().max(1)) as f64;
                // (d 1 + g g^T)^-1 = (1 - g g^T / (d + |g|^2)) / d.
                let along = (ix * r[i][0] + iy * r[i][1]) / (d + ix * ix + iy * iy);
                *o = [(r[i][0] - ix * along) / d, (r[i][1] - iy * along) / d];
            }
        });
    }

    /// Preconditioned conjugate gradients from zero flow (M. Hestenes, E. Stiefel 1952).
    fn solve(&self, tolerance: f64, iterations: usize) -> Result<Flow> {
        let n = self.data.len();
        let mut f = vec![[0.0; 2]; n];
        let mut r: Flow = self.data.iter().map(|d| [-d[2] * d[0], -d[2] * d[1]]).collect();
        let (mut z, mut q) = (vec![[0.0; 2]; n], vec![[0.0; 2]; n]);
        self.precondition(&r, &mut z);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let target = tolerance * tolerance * rz;
        for _ in 0..iterations {
            checkpoint();
            if rz <= target {
                return Ok(f);
            }
            self.apply(&p, &mut q);
            let alpha = rz / dot(&p, &q);
            step(&mut f, alpha, &p);
            step(&mut r, -alpha, &q);
            self.precondition(&r, &mut z);
            let next = dot(&r, &z);
            let beta = next / rz;
            rz = next;
            parallel::for_each(p.chunks_mut(BLOCK).zip(z.chunks(BLOCK)), |(p, z)| {
                for (p, z) in p.iter_mut().zip(z) {
                    *p = [z[0] + beta * p[0], z[1] + beta * p[1]];
                }
            });
        }
        if rz <= target {
            return Ok(f);
        }
        Err(Error::Numerical(format!(
            "Horn-Schunck reached a relative residual of {:.1e} in {iterations} iterations, not the tolerance of {tolerance:.1e}; allow more iterations or less smoothness",
            (rz / target).sqrt() * tolerance
        )))
    }
}

/// `f += alpha p`.
fn step(f: &mut Flow, alpha: f64, p: &Flow) {
    parallel::for_each(f.chunks_mut(BLOCK).zip(p.chunks(BLOCK)), |(f, p)| {
        for (f, p) in f.iter_mut().zip(p) {
            *f = [f[0] + alpha * p[0], f[1] + alpha * p[1]];
        }
    });
}

/// Scalar product, by blocks in a fixed order.
fn dot(a: &Flow, b: &Flow) -> f64 {
    let parts: Vec<f64> = parallel::map(a.chunks(BLOCK).zip(b.chunks(BLOCK)), |(a, b)| {
        a.iter().zip(b).map(|(a, b)| a[0] * b[0] + a[1] * b[1]).sum()
    });
    parts.iter().sum()
}
