//! From strips to the field: each site's estimate to its place.

use super::estimate::Strip;
use crate::flow::site::FieldBand;
use crate::flow::symmetric::upper;
use crate::simd::SimdReal;
use crate::types::{SamplingGrid, Status};
use rayon::prelude::*;
use std::ops::Range;

/// Where the computed part of the frame lies, and its units.
pub(super) struct Crop {
    /// Width of the whole frame, px.
    pub frame_width: usize,
    /// Frame coordinates of the part's corner, px.
    pub origin: (usize, usize),
    /// Derivatives were computed in this unit of length, 1/px.
    pub scale: f64,
    /// Equations at each pixel.
    pub equations: usize,
}

/// Estimates and, on request, covariances of a part of the sites.
pub(super) struct Results<T> {
    pub strip: Strip<T>,
    pub covariance: Option<Covariance<T>>,
}

/// 21 planes at these rows and columns, or 42 with the systematic part.
pub(super) struct Covariance<T> {
    pub planes: Vec<T>,
    pub rows: Vec<usize>,
    pub columns: Range<usize>,
}

impl<T: SimdReal> Results<T> {
    /// Copies the sites that lie in the strip to their bands.
    pub(super) fn write(&self, crop: &Crop, sites: &SamplingGrid, bands: &mut [FieldBand<'_, T>]) {
        bands.par_iter_mut().for_each(|band| match sites {
            SamplingGrid::Grid { region, stride } => {
                let width = region.map_or(crop.frame_width, |r| r.width).div_ceil(*stride);
                for row in band.sites.start / width..band.sites.end / width {
                    let run = Run { at: sites.pixel(0, row), step: *stride, count: width };
                    self.write_run(crop, &run, row * width - band.sites.start, band);
                }
            }
            SamplingGrid::Points(points) => {
                for index in band.sites.clone() {
                    let run = Run { at: points[index], step: 1, count: 1 };
                    self.write_run(crop, &run, index - band.sites.start, band);
                }
            }
        });
    }

    /// Copies the results of a run of the frame's pixels, if they are here, to the band from place `to` on.
    pub(super) fn write_run(&self, crop: &Crop, run: &Run, to: usize, band: &mut FieldBand<'_, T>) {
        let (x, y) = (run.at.0 - crop.origin.0, run.at.1 - crop.origin.1);
        let strip = &self.strip;
        let wanted = self.covariance.as_ref().map_or(&strip.rows, |c| &c.rows);
        if wanted.first().is_none_or(|first| y < *first) || wanted.last().is_none_or(|last| y > *last) {
            return;
        }
        let from = place(&strip.rows, &strip.columns, (x, y));
        let n = strip.rows.len() * strip.columns.len();
        let places = to..to + run.count;
        run.copy(&strip.status, from, &mut band.status[places.clone()]);
        for (k, plane) in band.motion.iter_mut().enumerate() {
            let target = &mut plane[places.clone()];
            run.copy(&strip.motion, k * n + from, target);
            if k >= 2 {
                let unit = T::from_f64(crop.scale);
                for value in target {
                    *value *= unit;
                }
            }
        }
        if let Some(covariance) = &self.covariance {
            let from = place(&covariance.rows, &covariance.columns, (x, y));
            let n = covariance.rows.len() * covariance.columns.len();
            for (k, plane) in band.covariance.iter_mut().chain(&mut band.systematic).enumerate() {
                run.copy(&covariance.planes, k * n + from, &mut plane[places.clone()]);
            }
            withdraw_unusable(band, places.clone());
        }
        if let Some(plane) = &mut band.residual {
            let rows = T::from_f64(crop.equations as f64);
            let sources = strip.residual[from..].iter().zip(&strip.weight[from..]).step_by(run.step);
            for (value, (sum, weight)) in plane[places.clone()].iter_mut().zip(sources) {
                *value = crate::simd::Lanes::sqrt(*sum / (rows * *weight));
            }
        }
        if let Some(plane) = &mut band.rank {
            run.copy(&strip.rank, from, &mut plane[places.clone()]);
        }
        if let Some(plane) = &mut band.condition {
            run.copy(&strip.condition, from, &mut plane[places]);
        }
    }
}

/// Withdraws estimates whose covariance overflowed or lost a variance to rounding.
fn withdraw_unusable<T: SimdReal>(band: &mut FieldBand<'_, T>, places: Range<usize>) {
    for place in places {
        let is_finite = band.covariance.iter().all(|plane| plane[place].finite());
        let is_negative = (0..6).any(|i| band.covariance[upper(i, i)][place] < T::default());
        if (!is_finite || is_negative) && band.status[place].is_valid() {
            band.status[place] = Status::NonFinite;
            band.motion.iter_mut().chain(&mut band.covariance).for_each(|plane| plane[place] = T::nan());
        }
    }
}

/// Evenly spaced pixels of one row of the frame.
pub(super) struct Run {
    pub at: (usize, usize),
    pub step: usize,
    pub count: usize,
}

impl Run {
    /// Copies every `step`-th value of a plane from `from` on.
    fn copy<S: Copy>(&self, plane: &[S], from: usize, target: &mut [S]) {
        if self.step == 1 {
            target.copy_from_slice(&plane[from..from + self.count]);
        } else {
            for (value, source) in target.iter_mut().zip(plane[from..].iter().step_by(self.step)) {
                *value = *source;
            }
        }
    }
}

/// Place of pixel `(x, y)` in planes of these evenly spaced rows and these columns.
fn place(rows: &[usize], columns: &Range<usize>, (x, y): (usize, usize)) -> usize {
    let spacing = rows.get(1).map_or(1, |second| second - rows[0]);
    (y - rows[0]) / spacing * columns.len() + x - columns.start
}
