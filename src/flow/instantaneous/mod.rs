//! The per-pixel estimate, WO2010/098160 (34): `[J(i); J(i')] m = [i'; i'']`, least squares at each pixel on its own.
//!
//! Two paths. The careful one ([`point`]) solves one pixel by orthogonal transformations in double precision and can say everything about
//! it: rank, condition, residual, covariance. The fast one (`dense`) runs the affine model over rows in lanes by normal
//! equations; pixels whose pivots are too small for its precision are done again in double precision, at last by the careful path. What is reported as
//! unobservable is always the careful path's decision.
//!
//! Equations are formed per px and frame whatever the pixel pitch is, so that the pitch scales results and never changes a decision.

mod dense;
mod noise;
mod normal;
mod point;

use super::model::ModelKind;
use super::options::{Common, RankPolicy};
use super::site::{FieldBand, MaskCounts, bands};
use crate::error::Result;
use crate::jet::{JetRates, JetRows, JetStencil, Neighbourhood, TimeScheme};
use crate::math::Real;
use crate::simd::{SimdReal, dispatch};
use crate::types::{FlowField, Frame, Mask, Rect, Sites, Status};
use dense::{RowKernel, Source, scratch_len};
use noise::NoiseModel;
use normal::{LaneRates, noise_square, solve_affine};
pub(super) use point::rounding_floor;
use point::{Asked, PointEstimate, PointVisitor};
use rayon::prelude::*;

/// Options of the per-pixel estimate.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InstantaneousOptions {
    /// The motion model. Default: affine.
    pub model: ModelKind,
    /// Time differences. Default: central.
    pub scheme: TimeScheme,
    /// The pixels a jet is fitted to. Default: 3x3.
    pub neighbourhood: Neighbourhood,
    /// What to report where a pixel is not observable. Default: NaN.
    pub rank_deficient: RankPolicy,
}

/// The estimator behind the options.
#[derive(Debug)]
pub(super) struct Instantaneous {
    options: InstantaneousOptions,
    stencil: JetStencil,
    noise: NoiseModel,
}

impl Instantaneous {
    /// Prepares the stencil.
    pub fn new(options: &InstantaneousOptions, common: &Common) -> Result<Self> {
        let stencil = JetStencil::new(&options.neighbourhood, (1.0, 1.0))?;
        let noise = NoiseModel::new(&stencil, options.scheme, common.noise);
        Ok(Self { options: options.clone(), stencil, noise })
    }

    /// The motion model.
    pub fn model(&self) -> ModelKind {
        self.options.model
    }

    /// Which of the three frames the estimate belongs to.
    pub fn frame(&self) -> usize {
        self.options.scheme.frame()
    }

    /// Fills `field`, in px and frames. `frames`: three of one size, oldest first.
    pub fn estimate_into<T: SimdReal>(&self, frames: [&Frame<T>; 3], common: &Common, field: &mut FlowField<T>) {
        let mask = common.mask.as_ref().map(|mask| SiteMask { mask, counts: MaskCounts::new(mask) });
        let job = Job { owner: self, frames, common, mask };
        let (width, sites) = (field.width, field.layout.sites.clone());
        let quick = self.options.model == ModelKind::Affine && !common.covariance && !common.diagnostics;
        let rows = match (&sites, quick) {
            (&Sites::Grid { region, stride }, true) => {
                let (w, h) = frames[0].size();
                let region = region.unwrap_or(Rect { x: 0, y: 0, width: w, height: h });
                Some(RowPlan { region, stride, source: self.source::<T>() })
            }
            _ => None,
        };
        let all = bands(field);
        common.threads.install(|| {
            all.into_par_iter().for_each(|mut band| {
                if let Some(plan) = &rows {
                    return job.rows(&mut band, width, plan);
                }
                for index in band.sites.clone() {
                    let at = sites.pixel(index % width, index / width);
                    if quick {
                        job.site(&mut band, index, at);
                    } else {
                        job.careful(&mut band, index, at);
                    }
                }
            });
        });
    }

    /// The quickest way to the jets of rows.
    fn source<T: SimdReal>(&self) -> Source<T> {
        match self.options.neighbourhood {
            Neighbourhood::Rectangle { width: 3, height: 3, sigma: None } => Source::Three,
            _ => Source::Rows(JetRows::new(&self.stencil)),
        }
    }
}

/// How a grid is walked row by row.
struct RowPlan<T> {
    region: Rect,
    stride: usize,
    source: Source<T>,
}

/// The mask in the two forms that a neighbourhood asks it in.
struct SiteMask<'a> {
    mask: &'a Mask,
    counts: MaskCounts,
}

/// One call's inputs.
struct Job<'a, T> {
    owner: &'a Instantaneous,
    frames: [&'a Frame<T>; 3],
    common: &'a Common,
    mask: Option<SiteMask<'a>>,
}

impl<T: SimdReal> Job<'_, T> {
    /// A band of whole rows of a grid, by the fast path, doubtful pixels with more care.
    fn rows(&self, band: &mut FieldBand<'_, T>, width: usize, plan: &RowPlan<T>) {
        let level = self.common.level();
        let (w, h) = self.frames[0].size();
        let (columns, inside) = self.owner.stencil.reach().inside((w, h));
        let RowPlan { region, stride, source } = plan;
        // Columns of the frame that the kernel computes, and the first site among them.
        let first = columns.start.saturating_sub(region.x).div_ceil(*stride);
        let last = columns.end.min(region.x + region.width).saturating_sub(region.x).div_ceil(*stride).max(first);
        let from = region.x + first * stride;
        let computed = if first < last { from..region.x + (last - 1) * stride + 1 } else { 0..0 };
        let n = computed.len();
        let mut scratch = vec![T::default(); scratch_len(source, w)];
        let mut trust = vec![T::default(); n];
        let mut spare = vec![T::default(); if *stride == 1 { 0 } else { 6 * n }];
        for row in 0..band.sites.len() / width {
            let index = band.sites.start + row * width;
            let y = region.y + index / width * stride;
            let base = row * width;
            if n == 0 || !inside.contains(&y) {
                (0..width).for_each(|k| clear(band, base + k, Status::Border));
                continue;
            }
            (0..first).chain(last..width).for_each(|k| clear(band, base + k, Status::Border));
            let mut kernel = RowKernel {
                source,
                scheme: self.owner.options.scheme,
                frames: self.frames,
                y,
                columns: computed.clone(),
                scratch: &mut scratch,
                motion: Default::default(),
                trust: &mut trust,
            };
            if *stride == 1 {
                for (slot, plane) in kernel.motion.iter_mut().zip(&mut band.motion) {
                    *slot = &mut plane[base + first..base + last];
                }
                dispatch(level, kernel);
            } else {
                for (slot, plane) in kernel.motion.iter_mut().zip(spare.chunks_exact_mut(n)) {
                    *slot = plane;
                }
                dispatch(level, kernel);
                for (plane, values) in band.motion.iter_mut().zip(spare.chunks_exact(n)) {
                    for (to, from) in plane[base + first..base + last].iter_mut().zip(values.iter().step_by(*stride)) {
                        *to = *from;
                    }
                }
            }
            band.status[base + first..base + last].fill(Status::Ok);
            for k in first..last {
                let at = (region.x + k * stride, y);
                let trusted = trust[(k - first) * stride] > T::default();
                if !trusted || (self.mask.is_some() && self.obstacle(at).is_some()) {
                    self.site(band, index + k, at);
                }
            }
        }
    }

    /// One site of the affine model without diagnostics: normal equations in double precision, and the careful path where even those are doubtful.
    fn site(&self, band: &mut FieldBand<'_, T>, index: usize, at: (usize, usize)) {
        let local = index - band.sites.start;
        if let Some(status) = self.obstacle(at) {
            return clear(band, local, status);
        }
        let Some(rates) = self.rates(at) else {
            return clear(band, local, Status::NonFinite);
        };
        let [_, jet @ ..] = rates.jet;
        let lanes = LaneRates { jet, minus_first: rates.first.map(|v| -v), second: rates.second };
        let solution = solve_affine(&lanes, noise_square::<T>() * rates.jet[0] * rates.jet[0]);
        if solution.trust > 0.0 {
            for (plane, value) in band.motion.iter_mut().zip(solution.motion) {
                plane[local] = T::from_f64(value);
            }
            band.status[local] = Status::Ok;
        } else {
            self.careful(band, index, at);
        }
    }

    /// Why there can be no estimate at this pixel, from its place alone.
    fn obstacle(&self, at: (usize, usize)) -> Option<Status> {
        let stencil = &self.owner.stencil;
        if !stencil.reach().fits(at, self.frames[0].size()) {
            return Some(Status::Border);
        }
        let site_mask = self.mask.as_ref()?;
        let masked = site_mask.counts.touches(at, stencil.reach())
            && (stencil.is_separable()
                || stencil.offsets().iter().any(|&(ex, ey)| {
                    let (x, y) = (at.0.wrapping_add_signed(ex as isize), at.1.wrapping_add_signed(ey as isize));
                    !site_mask.mask.get(x, y)
                }));
        masked.then_some(Status::Masked)
    }

    /// The jet and its time derivatives at a pixel, in double precision; `None` when a sample is not finite.
    fn rates(&self, (x, y): (usize, usize)) -> Option<JetRates<f64>> {
        let [old, middle, new] = self.frames.map(|f| self.owner.stencil.at_f64(f, x, y));
        let finite = [old, middle, new].iter().all(|j| j.iter().all(|v| v.is_finite()));
        finite.then(|| self.owner.options.scheme.rates(old, middle, new))
    }

    /// Everything about one site by the careful path, written to its place in the band.
    fn careful(&self, band: &mut FieldBand<'_, T>, index: usize, at: (usize, usize)) {
        let local = index - band.sites.start;
        if let Some(status) = self.obstacle(at) {
            return clear(band, local, status);
        }
        let Some(rates) = self.rates(at) else {
            return clear(band, local, Status::NonFinite);
        };
        let options = &self.owner.options;
        let asked = Asked {
            floor: rounding_floor::<T>(&rates),
            policy: options.rank_deficient,
            noise: self.common.covariance.then_some(&self.owner.noise),
            pixel_variance: &|| NoiseModel::pixel_variance(&self.owner.stencil, self.frames, at),
        };
        let estimate = options.model.visit(PointVisitor { rates: &rates, asked: &asked });
        write(band, local, &estimate);
    }
}

/// NaN everywhere, with a reason.
fn clear<T: Real>(band: &mut FieldBand<'_, T>, local: usize, status: Status) {
    for plane in band.motion.iter_mut().chain(&mut band.covariance) {
        plane[local] = T::nan();
    }
    band.status[local] = status;
    if let Some(p) = &mut band.residual {
        p[local] = T::nan();
    }
    if let Some(p) = &mut band.condition {
        p[local] = T::nan();
    }
    if let Some(p) = &mut band.rank {
        p[local] = 0;
    }
}

/// Puts an estimate in its place.
fn write<T: Real>(band: &mut FieldBand<'_, T>, local: usize, estimate: &PointEstimate) {
    for (plane, value) in band.motion.iter_mut().zip(estimate.values) {
        plane[local] = T::from_f64(value);
    }
    let p = band.motion.len();
    let pairs = (0..p).flat_map(|i| (i..p).map(move |j| (i, j)));
    for (plane, (i, j)) in band.covariance.iter_mut().zip(pairs) {
        plane[local] = T::from_f64(estimate.covariance[i][j]);
    }
    band.status[local] = estimate.status;
    if let Some(plane) = &mut band.residual {
        plane[local] = T::from_f64(estimate.residual);
    }
    if let Some(plane) = &mut band.condition {
        plane[local] = T::from_f64(estimate.condition);
    }
    if let Some(plane) = &mut band.rank {
        plane[local] = estimate.rank;
    }
}
