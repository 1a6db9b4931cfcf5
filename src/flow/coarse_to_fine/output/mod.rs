//! Field at the requested sites: motion, covariance, status (`consistency`) and diagnostics.

mod consistency;

use super::brightness_scale::BrightnessScale;
use super::covariance::{CovarianceMap, CovarianceMaps, Energy, covariance};
use super::data_term::{DataOptions, ENERGY, MOTION, SEEN, UU, UV, VV, View};
use super::estimate::Estimate;
use super::plane_pool::PlanePool;
use super::planes::{Planes, SITE_SPACING};
use super::refine::{SITES_PER_NODE, WindowStatistics};
use super::resample::{finer, motion_at};
use super::variational::PixelMotion;
use crate::ablation::keeps;
use crate::flow::coarse_to_fine::{resample::first_frame::at_first_frame, resample::rows::RowReader};
use crate::flow::options::EstimatorOptions;
use crate::flow::site::{FieldBand, bands};
use crate::flow::symmetric::upper;
use crate::image::{are_rounded, halved_noise, halved_size};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::{FlowField, Frame, Mask, SamplingGrid, Status};
use consistency::Consistency;
use std::borrow::Cow;
use std::ops::Range;

/// Sum of the squared weights of a data term's rows: one of brightness, two of its gradient.
fn rows() -> f64 {
    1.0 + 2.0 * DataOptions::default().gradient.powi(2)
}

/// Residual energy of white noise of variance 1 in the frames, as they are compared.
fn noise_energy<T>(estimate: &Estimate<T>, frames: &[&Frame<T>]) -> f64 {
    // In each row: half its variance in a pair's difference, an eighth in a triple's.
    let share = if frames.len() == 2 { 0.5 } else { 0.125 };
    share * rows() * halved_noise().powi(estimate.level as i32)
}

pub(super) fn covariance_of<T: SimdReal>(
    estimate: &Estimate<T>,
    frames: &[&Frame<T>],
    common: &EstimatorOptions,
) -> CovarianceMaps<T> {
    let energy_of = |variance: f64| {
        noise_energy(estimate, frames) * variance * estimate.noise_gain * estimate.brightness.gain.powi(2)
    };
    let noise = match common.noise {
        Some(sigma) => Energy::Known(energy_of(sigma * sigma)),
        None => Energy::AtLeast(energy_of(rounding_variance(&estimate.brightness, frames))),
    };
    covariance(common.level(), estimate, noise, frames.len() == 2, common.systematic)
}

/// Variance of rounding, the minimum noise: of integers to grey levels, of other samples to the precision
/// they are computed in.
fn rounding_variance<T: SimdReal>(brightness: &BrightnessScale, frames: &[&Frame<T>]) -> f64 {
    if are_rounded(frames) {
        return 1.0 / 12.0;
    }
    let relative = if size_of::<T>() < size_of::<f64>() { f64::from(f32::EPSILON) } else { f64::EPSILON };
    let largest = brightness.mean.abs() + LARGEST_DEVIATION * brightness.contrast / brightness.gain;
    (OPERATIONS * relative * largest).powi(2)
}

/// Brightness that samples reach, standard deviations from the mean; and errors, in units of the precision,
/// that splines add to that of a sample.
const LARGEST_DEVIATION: f64 = 4.0;
const OPERATIONS: f64 = 2.0;

/// Writes the estimate and its covariance at the field's sites, a pair's at the first frame.
pub(super) fn fill<T: SimdReal>(
    (estimate, spreads): (&Estimate<T>, Option<CovarianceMaps<T>>),
    space: &PlanePool<T>,
    views: Option<Vec<View<'_, T>>>,
    frames: &[&Frame<T>],
    common: &EstimatorOptions,
    field: &mut FlowField<T>,
) {
    let simd = common.level();
    let moved = (frames.len() == 2).then(|| at_first_frame(simd, space, &estimate.motion));
    let found = moved.as_ref().unwrap_or(&estimate.motion);
    let full = at_full_resolution(simd, space, (estimate.level, found), frames[0].size());
    let contrast = estimate.brightness.contrast;
    let pixels = views.map(|views| PixelMotion::new(simd, space, (&views, contrast), found, frames[0].size()));
    let writer = Writer {
        simd,
        pitch: 2 << estimate.level,
        data: &estimate.data,
        per_row: 1.0 / (rows().sqrt() * estimate.brightness.gain),
        motion: full.as_ref().unwrap_or(found),
        pixels: pixels.as_ref(),
        reference: frames[frames.len() - 2],
        mask: common.mask.as_ref(),
        of_all: status_of_all(estimate, frames),
        consistency: Consistency::of(estimate),
        spreads,
        statistics: estimate.statistics.as_ref(),
    };
    let (sites, width) = (field.layout.sites.clone(), field.width);
    parallel::for_each(bands(field), |mut band| match &sites {
        SamplingGrid::Points(points) => writer.points(points, &mut band),
        SamplingGrid::Grid { .. } => {
            dispatch(writer.simd, Rows { writer: &writer, sites: &sites, width, band: &mut band });
        }
    });
    moved.into_iter().chain(full).for_each(|planes| space.keep(planes));
    if let Some(pixels) = pixels {
        pixels.recycle(space);
    }
}

/// Motion on the sites of the frame, if estimated on a coarser level.
fn at_full_resolution<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    (level, found): (usize, &Planes<T>),
    size: (usize, usize),
) -> Option<Planes<T>> {
    let mut motion: Option<Planes<T>> = None;
    for level in (0..level).rev() {
        let size = (0..level).fold(size, |size, _| halved_size(size));
        let mut next = space.planes(size.0.div_ceil(2), size.1.div_ceil(2), MOTION);
        finer(simd, motion.as_ref().unwrap_or(found), size, &mut next);
        motion.replace(next).into_iter().for_each(|planes| space.keep(planes));
    }
    motion
}

/// Status of every pixel, if frames say nothing: one without finite samples, a constant image, or frames that
/// have nothing in common.
fn status_of_all<T: SimdReal>(estimate: &Estimate<T>, frames: &[&Frame<T>]) -> Option<Status> {
    let (data, threshold) = (&estimate.data, 1e-9 * estimate.brightness.contrast.powi(2));
    let mut information = (0..data.height).flat_map(|y| data.line(UU, y).iter().chain(data.line(VV, y)));
    if information.any(|v| v.to_f64() > threshold) {
        return are_unrelated(estimate, frames).then_some(Status::Inconsistent);
    }
    let has_finite = |frame: &&Frame<T>| (0..frame.height()).any(|y| frame.row(y).iter().any(|value| value.finite()));
    Some(if frames.iter().all(has_finite) { Status::Unobservable } else { Status::NonFinite })
}

/// Minimum residual energy of unrelated frames, over that of white noise of their variance: motion fitted to
/// noise takes a third of its energy.
const MIN_UNRELATED_ENERGY: f64 = 0.6;

/// Whether frames differ as independent noise does. Texture as fine as a pixel has so much information that
/// single sites do not show it; coarser levels have none so fine.
fn are_unrelated<T: SimdReal>(estimate: &Estimate<T>, frames: &[&Frame<T>]) -> bool {
    if estimate.level > 0 || !keeps("flow.unrelated_frames") {
        return false;
    }
    let (data, brightness) = (&estimate.data, &estimate.brightness);
    let lines = || (0..data.height).step_by(SITES_PER_NODE);
    let sum = |k: usize| lines().flat_map(|y| data.line(k, y)).map(|value| value.to_f64()).sum::<f64>();
    let energy = sum(ENERGY) / (MIN_UNRELATED_ENERGY * noise_energy(estimate, frames) * sum(SEEN));
    // The contrast leaves the extremes out, so that most frames need no other.
    energy > brightness.contrast.powi(2)
        && energy > brightness.gain.powi(2) * frames.iter().map(|frame| variance(frame)).fold(0.0, f64::max)
}

/// Variance of the finite samples of a frame.
fn variance<T: SimdReal>(frame: &Frame<T>) -> f64 {
    let samples = || frame.data().iter().map(|value| value.to_f64()).filter(|value| value.is_finite());
    let count = samples().count().max(1) as f64;
    let mean = samples().sum::<f64>() / count;
    samples().map(|value| (value - mean).powi(2)).sum::<f64>() / count
}

struct Writer<'a, T: Clone> {
    simd: Level,
    /// Distance, px of the frame, between the sites of the data.
    pitch: usize,
    data: &'a Planes<T>,
    /// Factor from the root of the residual energy to grey levels.
    per_row: f64,
    motion: &'a Planes<T>,
    /// The same at every pixel, if refined there.
    pixels: Option<&'a PixelMotion<T>>,
    reference: &'a Frame<T>,
    mask: Option<&'a Mask>,
    /// Status of every pixel that is neither masked nor itself not finite, if it is the same.
    of_all: Option<Status>,
    consistency: Consistency,
    spreads: Option<CovarianceMaps<T>>,
    statistics: Option<&'a WindowStatistics<T>>,
}

impl<T: SimdReal> Writer<'_, T> {
    fn points(&self, points: &[(usize, usize)], band: &mut FieldBand<'_, T>) {
        for (at, &(x, y)) in points[band.sites.clone()].iter().enumerate() {
            if let Some(pixels) = self.pixels {
                (0..MOTION).for_each(|k| band.motion[k][at] = pixels.unrefined.at(k, x, y));
            } else {
                let motion = motion_at(self.motion, SITE_SPACING, x as f64, y as f64);
                (0..MOTION).for_each(|k| band.motion[k][at] = T::from_f64(motion[k]));
            }
            for (spread, planes) in self.spreads(band) {
                for (k, plane) in planes.iter_mut().enumerate() {
                    plane[at] = spread.at(k, (x, y));
                }
            }
            self.move_row(band, (y, (x, 1)), at..at + 1);
            self.finish_site(band, at, (x, y));
        }
    }

    /// The covariance and its systematic part, if requested, with the planes they are written to.
    fn spreads<'s, 'p, 'b>(
        &'s self,
        band: &'p mut FieldBand<'b, T>,
    ) -> impl Iterator<Item = (&'s CovarianceMap<T>, &'p mut Vec<&'b mut [T]>)> {
        let whole = self.spreads.as_ref().map(|spreads| &spreads.whole);
        let systematic = self.spreads.as_ref().and_then(|spreads| spreads.systematic.as_ref());
        whole.zip(Some(&mut band.covariance)).into_iter().chain(systematic.zip(Some(&mut band.systematic)))
    }

    /// Moves the flow at `places` of a band, which are pixels of row `y`, and widens its covariance by that.
    fn move_row(&self, band: &mut FieldBand<'_, T>, (y, (first, step)): (usize, (usize, usize)), places: Range<usize>) {
        let Some(pixels) = self.pixels else { return };
        let moves = [0, 1].map(|k| {
            let line = &pixels.moves.line(k, y)[first..];
            // A slice where every pixel is a site, so that the compiler uses lanes.
            if step == 1 { Cow::from(line) } else { line.iter().copied().step_by(step).collect() }
        });
        for (flow, moves) in band.motion.iter_mut().zip(&moves) {
            flow[places.clone()].iter_mut().zip(&**moves).for_each(|(flow, &by)| *flow += by);
        }
        for (_, planes) in self.spreads(band).filter(|_| keeps("flow.refinement_error")) {
            for (i, j) in [(0, 0), (0, 1), (1, 1)] {
                let products = moves[i].iter().zip(&*moves[j]).map(|(&a, &b)| a * b);
                planes[upper(i, j)][places.clone()].iter_mut().zip(products).for_each(|(entry, by)| *entry += by);
            }
        }
    }

    /// Writes status and diagnostics of a site, and NaN where there is no valid estimate.
    fn finish_site(&self, band: &mut FieldBand<'_, T>, at: usize, pixel: (usize, usize)) {
        let status = self.status(pixel);
        band.status[at] = status;
        if !status.has_estimate() {
            let planes = band.motion.iter_mut().chain(&mut band.covariance).chain(&mut band.systematic);
            planes.for_each(|plane| plane[at] = T::nan());
        }
        self.diagnose(band, at, pixel, status.has_estimate());
    }

    /// Whether every pixel of row `y` has a valid estimate and no diagnostics are requested.
    fn is_plain(&self, y: usize, band: &FieldBand<'_, T>) -> bool {
        let bare = band.residual.is_none() && band.rank.is_none() && band.condition.is_none() && band.window.is_none();
        // Without a short circuit, so that the compiler uses lanes.
        let finite = || self.reference.row(y).iter().fold(true, |so_far, value| so_far & value.finite());
        let agrees = !self.consistency.has_contradiction(y / self.pitch);
        bare && agrees && self.of_all.is_none() && self.mask.is_none() && finite()
    }

    /// Residual, rank and condition number of the equations at the nearest site, if requested.
    fn diagnose(&self, band: &mut FieldBand<'_, T>, at: usize, (x, y): (usize, usize), known: bool) {
        let (x, y) = (x / self.pitch, y / self.pitch);
        if let Some(window) = &mut band.window {
            window[at] =
                self.statistics.filter(|_| known).map_or(T::nan(), |statistics| self.window_at(statistics, (x, y)));
        }
        if let Some(residual) = &mut band.residual {
            let energy = self.data.at(ENERGY, x, y).to_f64().max(0.0);
            residual[at] = T::from_f64(if known { self.per_row * energy.sqrt() } else { f64::NAN });
        }
        if let Some(rank) = &mut band.rank {
            rank[at] = if known { MOTION as u8 } else { 0 };
        }
        if let Some(condition) = &mut band.condition {
            let [uu, uv, vv] = [UU, UV, VV].map(|k| self.data.at(k, x, y).to_f64());
            let (middle, radius) = (0.5 * (uu + vv), (0.5 * (uu - vv)).hypot(uv));
            condition[at] =
                T::from_f64(if known { ((middle + radius) / (middle - radius).max(0.0)).sqrt() } else { f64::NAN });
        }
    }

    /// Window of the slopes, px of the frame, at the nearest node of the window statistics.
    fn window_at(&self, statistics: &WindowStatistics<T>, (x, y): (usize, usize)) -> T {
        let nearest = |site: usize, count: usize| ((site + SITES_PER_NODE / 2) / SITES_PER_NODE).min(count - 1);
        let (columns, rows) = statistics.size();
        let [_, slopes] = statistics.mean_sigmas(nearest(x, columns), nearest(y, rows));
        T::from_f64(slopes * self.pitch as f64 / SITE_SPACING)
    }

    /// Status of a pixel, before its motion is looked at.
    fn status(&self, (x, y): (usize, usize)) -> Status {
        if self.mask.is_some_and(|mask| !mask.get(x, y)) {
            Status::Masked
        } else if !self.reference.get(x, y).finite() {
            Status::NonFinite
        } else if let Some(status) = self.of_all {
            status
        } else if self.consistency.is_contradicted(x / self.pitch, y / self.pitch) {
            Status::Inconsistent
        } else {
            Status::Ok
        }
    }
}

/// The sites of a band of whole rows.
struct Rows<'a, 'b, T: Clone> {
    writer: &'a Writer<'a, T>,
    sites: &'a SamplingGrid,
    width: usize,
    band: &'a mut FieldBand<'b, T>,
}

impl<T: SimdReal> Kernel<T> for Rows<'_, '_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { writer, sites, width, band } = self;
        let mut reader = RowReader::new(writer.reference.width());
        let (mut entries, mut line) = (Vec::new(), vec![T::from_f64(0.0); writer.reference.width()]);
        let start = band.sites.start;
        for first in band.sites.clone().step_by(width) {
            let row = first / width;
            let ((from, y), (next, _)) = (sites.pixel(0, row), sites.pixel(1, row));
            let columns = (from, next - from);
            let places = first - start..first - start + width;
            if writer.pixels.is_none() {
                reader.read_motion(writer.motion, y);
            }
            for (k, plane) in band.motion.iter_mut().enumerate() {
                let line = writer.pixels.map_or_else(|| reader.plane(k), |pixels| pixels.unrefined.line(k, y));
                copy(line, columns, &mut plane[places.clone()]);
            }
            for (spread, planes) in writer.spreads(band) {
                for (k, plane) in planes.iter_mut().enumerate() {
                    if columns == (0, 1) {
                        spread.row(k, y, &mut entries, &mut plane[places.clone()]);
                    } else {
                        spread.row(k, y, &mut entries, &mut line);
                        copy(&line, columns, &mut plane[places.clone()]);
                    }
                }
            }
            writer.move_row(band, (y, columns), places.clone());
            if writer.is_plain(y, band) {
                band.status[places].fill(Status::Ok);
            } else {
                places.enumerate().for_each(|(column, at)| writer.finish_site(band, at, sites.pixel(column, row)));
            }
        }
    }
}

#[inline(always)]
fn copy<T: Copy>(from: &[T], (first, step): (usize, usize), to: &mut [T]) {
    if step == 1 {
        to.copy_from_slice(&from[first..first + to.len()]);
    } else {
        to.iter_mut().zip(from[first..].iter().step_by(step)).for_each(|(to, from)| *to = *from);
    }
}
