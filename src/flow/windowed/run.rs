//! From frames and options to a filled field: cropping, smoothing, strips, sites.

use super::combine::Combination;
use super::estimate::{Setting, Strip};
use super::high_frequencies::HighFrequencies;
use super::noise_setting::NoiseSetting;
use super::options::WindowedOptions;
use super::results::{Covariance, Crop, Results, Run};
use super::rounding_floor;
use super::support::Support;
use super::tile::Source;
use super::window::Window;
use crate::error::Result;
use crate::flow::options::EstimatorOptions;
use crate::flow::site::bands;
use crate::image::{GaussianSmoother, are_rounded};
use crate::jet::{JetRows, JetStencil};
use crate::parallel::BAND_ROWS;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame, Rect, SamplingGrid};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Site rows whose results are held at a time; a multiple of [`BAND_ROWS`].
const STRIP_ROWS: usize = 16 * BAND_ROWS;
/// A cropped frame is at least this wide where the frame is, so that every crop runs the same vector code.
const MIN_CROP: usize = 64;

/// The estimator behind the options.
#[derive(Debug)]
pub(in crate::flow) struct Windowed {
    options: WindowedOptions,
    stencil: JetStencil,
    smoother: Option<GaussianSmoother>,
}

impl Windowed {
    /// Checks the options.
    pub fn new(options: &WindowedOptions) -> Result<Self> {
        options.check()?;
        let stencil = JetStencil::new(&options.neighbourhood, (1.0, 1.0))?;
        let smoother = options.presmooth.map(GaussianSmoother::new).transpose()?;
        Ok(Self { options: options.clone(), stencil, smoother })
    }

    /// Frames of one estimate, 2 or 3.
    pub fn frames_needed(&self) -> usize {
        self.options.frames
    }

    /// Which of the frames the estimate belongs to. That of a pair lies between the two and is counted with
    /// the first.
    pub fn frame(&self) -> usize {
        if self.options.frames == 2 { 0 } else { self.options.scheme.frame() }
    }

    /// Fills `field`, in px and frames. `frames`: as many as needed, of one size, oldest first.
    pub fn estimate_into<T: SimdReal>(
        &self,
        frames: &[&Frame<T>],
        common: &EstimatorOptions,
        field: &mut FlowField<T>,
    ) {
        let sites = field.layout.sites.clone();
        let size = frames[0].size();
        let rounded = common.covariance && are_rounded(frames);
        common.threads.install(|| match &sites {
            SamplingGrid::Grid { region, stride } => {
                let whole = Rect { x: 0, y: 0, width: size.0, height: size.1 };
                let job = Job::new(self, frames, (common, rounded), region.unwrap_or(whole));
                let last = (field.width.saturating_sub(1)) * stride;
                let columns = job.local_x(region.map_or(0, |r| r.x));
                let columns = columns..columns + last + 1;
                let top = job.local_y(region.map_or(0, |r| r.y));
                let rows: Vec<usize> = (0..field.height).map(|r| top + r * stride).collect();
                let mut field_bands = bands(field);
                for (rows, bands) in rows.chunks(STRIP_ROWS).zip(field_bands.chunks_mut(STRIP_ROWS / BAND_ROWS)) {
                    job.strip(rows, columns.clone()).write(&job.crop, &sites, bands);
                }
            }
            SamplingGrid::Points(points) => self.points(frames, (common, rounded), points, field),
        });
    }

    fn points<T: SimdReal>(
        &self,
        frames: &[&Frame<T>],
        (common, rounded): (&EstimatorOptions, bool),
        points: &[(usize, usize)],
        field: &mut FlowField<T>,
    ) {
        let Some(&(x, y)) = points.first() else { return };
        let bounds = points.iter().fold((x, y, x, y), |b, &(x, y)| (b.0.min(x), b.1.min(y), b.2.max(x), b.3.max(y)));
        let box_ = Rect { x: bounds.0, y: bounds.1, width: bounds.2 - bounds.0 + 1, height: bounds.3 - bounds.1 + 1 };
        let sites = field.layout.sites.clone();
        // One window at a time while that is less work than everything around the points.
        let each = (2 * self.margin(common) + 1).pow(2);
        if points.len().saturating_mul(each) < box_.width.saturating_mul(box_.height) {
            bands(field).into_par_iter().for_each(|mut band| {
                for index in band.sites.clone() {
                    let (x, y) = points[index];
                    let job = Job::new(self, frames, (common, rounded), Rect { x, y, width: 1, height: 1 });
                    let column = job.local_x(x);
                    let results = job.strip(&[job.local_y(y)], column..column + 1);
                    let run = Run { at: (x, y), step: 1, count: 1 };
                    results.write_run(&job.crop, &run, index - band.sites.start, &mut band);
                }
            });
        } else {
            let job = Job::new(self, frames, (common, rounded), box_);
            let (left, top) = (job.local_x(box_.x), job.local_y(box_.y));
            let rows: Vec<usize> = (top..top + box_.height).collect();
            let mut field_bands = bands(field);
            for rows in rows.chunks(STRIP_ROWS) {
                job.strip(rows, left..left + box_.width).write(&job.crop, &sites, &mut field_bands);
            }
        }
    }

    /// How far from a site samples have any influence, px.
    fn margin(&self, common: &EstimatorOptions) -> usize {
        let reach = self.stencil.reach();
        let stencil = reach.left.max(reach.right).max(reach.up).max(reach.down);
        let smoothing = self.smoother.as_ref().map_or(0, GaussianSmoother::radius);
        let window = self.options.radius() + stencil + smoothing;
        if common.covariance { 2 * window } else { window }
    }
}

/// One rectangle of sites with the part of the frames that matters to it.
pub(super) struct Job<'a, T: Clone> {
    owner: &'a Windowed,
    frames: Vec<Cow<'a, Frame<T>>>,
    support: Support,
    crop: Crop,
    setting: Setting<T>,
    noise: Option<NoiseSetting<T>>,
    /// What the noise is read from, unless it is given.
    detail: Option<HighFrequencies<T>>,
}

impl<'a, T: SimdReal> Job<'a, T> {
    fn new(
        owner: &'a Windowed,
        frames: &[&'a Frame<T>],
        (common, rounded): (&'a EstimatorOptions, bool),
        sites: Rect,
    ) -> Self {
        let options = &owner.options;
        let whole = frames[0].size();
        let part = crop(sites, whole, owner.margin(common));
        let crop = Crop {
            frame_width: whole.0,
            origin: (part.x, part.y),
            scale: 1.0 / options.sigma,
            equations: options.rows.count(),
        };
        let frames: Vec<Cow<'a, Frame<T>>> = frames.iter().map(|f| cut(f, part)).collect();
        let mask = common.mask.as_ref().map(|m| cut(m, part));
        let plain: Vec<&Frame<T>> = frames.iter().map(AsRef::as_ref).collect();
        let spread = owner.smoother.as_ref().map_or(0, GaussianSmoother::radius);
        let support = Support::new(&plain, mask.as_deref(), owner.stencil.reach(), spread);
        let combination = Combination::of(frames.len(), options.scheme);
        let detail = (common.covariance && common.noise.is_none()).then(|| HighFrequencies::new(&plain, combination));
        let frames = match &owner.smoother {
            Some(s) => frames.iter().map(|f| Cow::Owned(s.apply_at(common.level(), f))).collect(),
            None => frames,
        };
        let window = Window::gaussian(options.sigma, options.radius());
        let setting = Setting {
            window: window.clone(),
            scale: crop.scale,
            rows: crop.equations,
            policy: options.rank_deficient,
            floor: rounding_floor::of_frames(frames.iter().map(AsRef::as_ref)),
            level: common.level(),
            inverse: common.covariance,
            diagnostics: common.diagnostics,
        };
        let noise = common
            .covariance
            .then(|| NoiseSetting::new((options, &owner.stencil), (common, rounded), window, frames.len()));
        Self { owner, frames, support, crop, setting, noise, detail }
    }

    pub fn local_x(&self, x: usize) -> usize {
        x - self.crop.origin.0
    }
    pub fn local_y(&self, y: usize) -> usize {
        y - self.crop.origin.1
    }

    /// Everything at these rows and columns of the crop.
    fn strip(&self, rows: &[usize], columns: Range<usize>) -> Results<T> {
        let source = Source {
            frames: self.frames.iter().map(AsRef::as_ref).collect(),
            combination: Combination::of(self.frames.len(), self.owner.options.scheme),
            jets: JetRows::new(&self.owner.stencil),
            reach: self.owner.stencil.reach(),
            support: &self.support,
            second: self.setting.rows == 12,
        };
        let Some(noise) = &self.noise else {
            let strip = Strip::new(&source, &self.setting, rows.to_vec(), columns);
            return Results { strip, covariance: None };
        };
        // The covariance needs the motion of the neighbours too.
        let (width, height) = self.frames[0].size();
        let margin = noise.margin();
        let (top, bottom) = (rows.first().copied().unwrap_or(0), rows.last().copied().unwrap_or(0));
        let wide = columns.start.saturating_sub(margin)..(columns.end + margin).min(width);
        let high = top.saturating_sub(margin)..(bottom + 1 + margin).min(height);
        let strip = Strip::new(&source, &self.setting, high.collect(), wide);
        let planes = noise.covariance((&source, self.detail.as_ref()), &strip, rows, &columns);
        Results { strip, covariance: Some(Covariance { planes, rows: rows.to_vec(), columns }) }
    }
}

/// The rectangle with a margin, inside the frame; the whole frame where little would be saved.
fn crop(sites: Rect, (width, height): (usize, usize), margin: usize) -> Rect {
    let span = |at: usize, len: usize, size: usize| {
        let from = at.saturating_sub(margin);
        let to = (at + len + margin).min(size);
        let from = from.min(to.saturating_sub(MIN_CROP));
        (from, to.max(from + MIN_CROP).min(size))
    };
    let (x0, x1) = span(sites.x, sites.width, width);
    let (y0, y1) = span(sites.y, sites.height, height);
    if 4 * (x1 - x0) * (y1 - y0) > 3 * width * height {
        return Rect { x: 0, y: 0, width, height };
    }
    Rect { x: x0, y: y0, width: x1 - x0, height: y1 - y0 }
}

/// The part of an image inside a rectangle; nothing is copied where that is all of it.
fn cut<S: Copy>(frame: &Frame<S>, part: Rect) -> Cow<'_, Frame<S>> {
    if (part.width, part.height) == frame.size() {
        return Cow::Borrowed(frame);
    }
    Cow::Owned(Frame::from_fn(part.width, part.height, |x, y| frame.get(part.x + x, part.y + y)))
}
