//! One call of the estimator: bands of rows in lanes, and single sites.

use super::Instantaneous;
use super::buffers::RowBuffers;
use super::dense::{RowKernel, Source, Target};
use super::detail::{DetailKernel, RatesRow};
use super::lane_noise::LaneNoise;
use super::noise::NoiseModel;
use super::normal::{LaneRates, noise_square, solve_affine};
use super::output::{clear, write};
use super::point::{PointRequest, PointVisitor, rounding_floor};
use super::propagation::factor_memory;
use super::uncertainty::{Detail, LaneEstimate, estimate_affine};
use crate::flow::options::EstimatorOptions;
use crate::flow::site::{FieldBand, MaskCounts};
use crate::jet::JetRates;
use crate::simd::{SimdReal, dispatch};
use crate::types::{Frame, Mask, Rect, Status};
use std::ops::Range;

/// Sites that are looked at together before each on its own.
const GROUP: usize = 64;

/// How a grid is walked row by row.
pub(super) struct RowPlan<T> {
    pub region: Rect,
    pub stride: usize,
    pub source: Source<T>,
}

/// The mask in the two forms in which a neighbourhood needs it.
pub(super) struct SiteMask<'a> {
    mask: &'a Mask,
    counts: MaskCounts,
}

impl<'a> SiteMask<'a> {
    pub fn new(mask: &'a Mask) -> Self {
        Self { mask, counts: MaskCounts::new(mask) }
    }
}

/// One call's inputs.
pub(super) struct Job<'a, T> {
    pub owner: &'a Instantaneous,
    pub frames: [&'a Frame<T>; 3],
    pub common: &'a EstimatorOptions,
    pub mask: Option<SiteMask<'a>>,
    /// Where covariance or diagnostics are wanted: the noise for the lanes.
    pub noise: Option<LaneNoise<T>>,
}

impl<T: SimdReal> Job<'_, T> {
    /// A band of whole rows of a grid, by the fast path, doubtful pixels with more care.
    pub fn rows(&self, band: &mut FieldBand<'_, T>, width: usize, plan: &RowPlan<T>) {
        let (w, h) = self.frames[0].size();
        let (columns, inside) = self.owner.stencil.reach().inside((w, h));
        let RowPlan { region, stride, source } = plan;
        // Columns of the frame that the kernel computes, and the first site among them.
        let first = columns.start.saturating_sub(region.x).div_ceil(*stride);
        let last = columns.end.min(region.x + region.width).saturating_sub(region.x).div_ceil(*stride).max(first);
        let from = region.x + first * stride;
        let computed = if first < last { from..region.x + (last - 1) * stride + 1 } else { 0..0 };
        let mut buffers = RowBuffers::new(source, w, computed, *stride, self.noise.is_some());
        for row in 0..band.sites.len() / width {
            let index = band.sites.start + row * width;
            let y = region.y + index / width * stride;
            let base = row * width;
            if first == last || !inside.contains(&y) {
                (0..width).for_each(|k| clear(band, base + k, Status::Border));
                continue;
            }
            (0..first).chain(last..width).for_each(|k| clear(band, base + k, Status::Border));
            let places = base + first..base + last;
            match &self.noise {
                None => self.plain_row(source, y, &mut buffers, band, places.clone()),
                Some(noise) => self.detailed_row(source, y, &mut buffers, band, places.clone(), noise),
            }
            if let Some(rank) = &mut band.rank {
                rank[places.clone()].fill(6);
            }
            band.status[places].fill(Status::Ok);
            for from in (first..last).step_by(GROUP) {
                let sites = from..(from + GROUP).min(last);
                if self.mask.is_none() && buffers.trusted(sites.start - first..sites.end - first) {
                    continue;
                }
                for k in sites {
                    let at = (region.x + k * stride, y);
                    let trusted = buffers.trusted(k - first..k - first + 1);
                    if !trusted || (self.mask.is_some() && self.obstacle(at).is_some()) {
                        self.site(band, index + k, at);
                    }
                }
            }
        }
    }

    /// The motion alone, at these places of the band.
    fn plain_row(
        &self,
        source: &Source<T>,
        y: usize,
        buffers: &mut RowBuffers<T>,
        band: &mut FieldBand<'_, T>,
        places: Range<usize>,
    ) {
        let RowBuffers { columns, stride, scratch, trust, spare, .. } = buffers;
        let n = columns.len();
        let mut motion: [&mut [T]; 6] = Default::default();
        if *stride == 1 {
            for (slot, plane) in motion.iter_mut().zip(&mut band.motion) {
                *slot = &mut plane[places.clone()];
            }
        } else {
            for (slot, plane) in motion.iter_mut().zip(spare.chunks_exact_mut(n)) {
                *slot = plane;
            }
        }
        let target = Target::Motion(motion, trust);
        self.run_row(source, y, columns.clone(), scratch, target);
        if *stride > 1 {
            for (plane, values) in band.motion.iter_mut().zip(spare.chunks_exact(n)) {
                for (to, from) in plane[places.clone()].iter_mut().zip(values.iter().step_by(*stride)) {
                    *to = *from;
                }
            }
            (0..places.len()).for_each(|k| trust[k] = trust[k * *stride]);
        }
    }

    /// Motion, covariance and diagnostics: first the coefficients of all columns, then the estimates of the
    /// sites among them.
    fn detailed_row(
        &self,
        source: &Source<T>,
        y: usize,
        buffers: &mut RowBuffers<T>,
        band: &mut FieldBand<'_, T>,
        places: Range<usize>,
        noise: &LaneNoise<T>,
    ) {
        let RowBuffers { columns, stride, scratch, trust, spare, block } = buffers;
        let len = columns.len();
        let target = Target::Rates(RatesRow { values: spare, len });
        self.run_row(source, y, columns.clone(), scratch, target);
        RatesRow { values: &mut spare[..], len }.thin(*stride);
        let mut motion: [&mut [T]; 6] = Default::default();
        for (slot, plane) in motion.iter_mut().zip(&mut band.motion) {
            *slot = &mut plane[places.clone()];
        }
        let kernel = DetailKernel {
            rates: RatesRow { values: &spare[..], len },
            noise,
            motion,
            covariance: band.covariance.iter_mut().map(|plane| &mut plane[places.clone()]).collect(),
            detail: self.detail(),
            residual: band.residual.as_mut().map(|plane| &mut plane[places.clone()]),
            condition: band.condition.as_mut().map(|plane| &mut plane[places.clone()]),
            trust: &mut trust[..places.len()],
            block,
        };
        dispatch(self.common.level(), kernel);
    }

    /// One place, so that the kernel is compiled once.
    fn run_row(&self, source: &Source<T>, y: usize, columns: Range<usize>, scratch: &mut [T], target: Target<'_, T>) {
        let (scheme, frames) = (self.owner.options.scheme, self.frames);
        dispatch(self.common.level(), RowKernel { source, scheme, frames, y, columns, scratch, target });
    }

    fn detail(&self) -> Detail {
        Detail { covariance: self.common.covariance, diagnostics: self.common.diagnostics }
    }

    /// One site of the affine model: normal equations in double precision, and the careful path where even
    /// those are doubtful.
    pub fn site(&self, band: &mut FieldBand<'_, T>, index: usize, at: (usize, usize)) {
        let local = index - band.sites.start;
        if let Some(status) = self.obstacle(at) {
            return clear(band, local, status);
        }
        let Some(rates) = self.rates(at) else {
            return clear(band, local, Status::NonFinite);
        };
        let [_, jet @ ..] = rates.jet;
        let lanes = LaneRates { jet, minus_first: rates.first.map(|v| -v), second: rates.second };
        let (brightness, samples) = (rates.jet[0], noise_square::<T>());
        let found = if self.noise.is_some() {
            estimate_affine(&lanes, brightness, samples, &self.owner.lane_noise, self.detail(), &mut factor_memory())
        } else {
            LaneEstimate::plain(&solve_affine(&lanes, samples * brightness * brightness))
        };
        // Nor is NaN trusted.
        if found.trust.is_nan() || found.trust <= 0.0 {
            return self.careful(band, index, at);
        }
        for (plane, value) in band.motion.iter_mut().zip(found.motion) {
            plane[local] = T::from_f64(value);
        }
        for (plane, value) in band.covariance.iter_mut().zip(found.covariance) {
            plane[local] = T::from_f64(value);
        }
        if let Some(plane) = &mut band.residual {
            plane[local] = T::from_f64((found.residual_square / 12.0).sqrt());
        }
        if let Some(plane) = &mut band.condition {
            plane[local] = T::from_f64(found.condition);
        }
        if let Some(plane) = &mut band.rank {
            plane[local] = 6;
        }
        band.status[local] = Status::Ok;
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
    pub fn careful(&self, band: &mut FieldBand<'_, T>, index: usize, at: (usize, usize)) {
        let local = index - band.sites.start;
        if let Some(status) = self.obstacle(at) {
            return clear(band, local, status);
        }
        let Some(rates) = self.rates(at) else {
            return clear(band, local, Status::NonFinite);
        };
        let options = &self.owner.options;
        let request = PointRequest {
            floor: rounding_floor::<T>(&rates),
            policy: options.rank_deficient,
            noise: self.common.covariance.then_some(&self.owner.noise),
            pixel_variance: &|| NoiseModel::pixel_variance(&self.owner.stencil, self.frames, at),
        };
        let estimate = options.model.dispatch(PointVisitor { rates: &rates, request: &request });
        write(band, local, &estimate);
    }
}
