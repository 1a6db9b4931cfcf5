//! From frames and options to a filled field: cropping, smoothing, strips, sites.

use super::combine::Combination;
use super::estimate::{CARRY_REACH, CONDITION, MOTION, RESIDUAL, Setting, Strip, WEIGHT};
use super::moments::Window;
use super::options::WindowedOptions;
use super::scores::CovarianceSetting;
use super::support::Support;
use super::tile::{Grid, MotionRow, Source};
use crate::error::Result;
use crate::flow::options::{EstimatorOptions, RankPolicy};
use crate::flow::site::{FieldBand, bands};
use crate::flow::symmetric::upper;
use crate::image::{GaussianSmoother, are_rounded};
use crate::jet::{JetRows, JetStencil};
use crate::parallel::{self, BAND_ROWS, checkpoint};
use crate::simd::{Lanes, Level, SimdReal};
use crate::types::{FlowField, Frame, Mask, Rect, SamplingGrid, Status};
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
        let images = (frames, common, common.covariance && common.threads.install(|| are_rounded(frames)));
        let (columns, rows) = (field.width, field.height);
        common.threads.install(|| match &sites {
            SamplingGrid::Grid { stride, .. } if columns * rows > 0 => {
                let span = |count: usize| (count - 1) * stride + 1;
                let mut bands = bands(field);
                for (strip, bands) in bands.chunks_mut(STRIP_ROWS / BAND_ROWS).enumerate() {
                    checkpoint();
                    let first = strip * STRIP_ROWS;
                    let (x, y) = sites.pixel(0, first);
                    let height = span((rows - first).min(STRIP_ROWS));
                    let part = self.part(images, Rect { x, y, width: span(columns), height }, *stride);
                    parallel::for_each(bands, |band| {
                        for row in band.sites.start / columns..band.sites.end / columns {
                            let to = row * columns - band.sites.start;
                            part.write_run((sites.pixel(0, row), *stride), to..to + columns, band);
                        }
                    });
                }
            }
            SamplingGrid::Grid { .. } => {}
            SamplingGrid::Points(points) => {
                // One window at a time while that is less work than everything around the points.
                let each = (2 * self.margin(common) + 1).pow(2);
                parallel::for_each(bands(field), |mut band| {
                    let own = &points[band.sites.clone()];
                    let whole = bounds(own);
                    let size = if own.len() * each < whole.width * whole.height { 1 } else { own.len() };
                    for (k, points) in own.chunks(size).enumerate() {
                        let part = self.part(images, bounds(points), 1);
                        for (i, at) in points.iter().enumerate() {
                            part.write_run((*at, 1), k * size + i..k * size + i + 1, &mut band);
                        }
                    }
                });
            }
        });
    }

    /// Everything at each `stride`-th row of a rectangle, from the part of the frames that matters to it.
    fn part<T: SimdReal>(
        &self,
        (frames, common, rounded): (&[&Frame<T>], &EstimatorOptions, bool),
        sites: Rect,
        stride: usize,
    ) -> Results<T> {
        let options = &self.options;
        let (level, equations) = (common.level(), options.rows.count());
        let part = crop(sites, frames[0].size(), self.margin(common));
        let frames: Vec<Cow<'_, Frame<T>>> = frames.iter().map(|f| cut(f, part)).collect();
        let mask = common.mask.as_ref().map(|m| cut(m, part));
        let plain: Vec<&Frame<T>> = frames.iter().map(AsRef::as_ref).collect();
        let spread = self.smoother.as_ref().map_or(0, GaussianSmoother::radius);
        let support = Support::new(&plain, mask.as_deref(), self.stencil.reach(), spread);
        let combination = Combination::of(frames.len(), options.scheme);
        let smoothed: Vec<Cow<'_, Frame<T>>> = frames.iter().map(|f| self.smooth(level, f.clone())).collect();
        let source = Source {
            frames: smoothed.iter().map(AsRef::as_ref).collect(),
            combination,
            jets: JetRows::new(&self.stencil),
            reach: self.stencil.reach(),
            support: &support,
            rows: equations,
            carried: None,
            level,
        };
        let setting = Setting {
            window: Window::gaussian(options.sigma, options.radius()),
            scale: 1.0 / options.sigma,
            policy: options.rank_deficient,
            inverse: common.covariance,
            diagnostics: common.diagnostics,
        };
        let (left, top) = (sites.x - part.x, sites.y - part.y);
        let columns = left..left + sites.width;
        let rows: Vec<usize> = (top..top + sites.height).step_by(stride).collect();
        let origin = (part.x, part.y);
        if !common.covariance {
            let strip = Strip::new(&source, &setting, rows, columns);
            return Results { strip, covariance: None, origin, equations };
        }
        // The covariance needs the motion of all pixels that its noise and its estimates are made of.
        let noise = CovarianceSetting::new((options, &self.stencil), (common, rounded), combination);
        let margin = noise.margin().max(self.window_reach());
        let wide = columns.start.saturating_sub(margin)..(columns.end + margin).min(part.width);
        let high = top.saturating_sub(margin)..(top + sites.height + margin).min(part.height);
        let strip = Strip::new(&source, &setting, high.collect(), wide);
        let still: Vec<Cow<'_, Frame<T>>> = (frames.iter().zip(&smoothed).zip(combination.times()))
            .map(|((frame, smoothed), &time)| match time {
                0.0 => Cow::Borrowed(smoothed.as_ref()),
                _ => self.smooth(level, Cow::Owned(strip.carry(&visible(frame, mask.as_deref()), time))),
            })
            .collect();
        let motion = |x: isize, y: isize, out: &mut [T]| strip.motion_row(x, y, out);
        let plain = Setting { inverse: false, diagnostics: false, policy: RankPolicy::Nan, ..setting.clone() };
        let again = |frames: Vec<&Frame<T>>, carried: Option<&MotionRow<'_, T>>| {
            let source = Source { frames, rows: equations.min(6), carried, ..source.clone() };
            Strip::new(&source, &plain, rows.clone(), columns.clone())
        };
        let rest = again(still.iter().map(AsRef::as_ref).collect(), None);
        // One frame does not move: its equations are left with the motion of each pixel.
        let frozen = again(vec![source.frames[self.frame()]; frames.len()], Some(&motion));
        let covariance = Some(noise.covariance(&source, [&strip, &rest, &frozen]));
        Results { strip, covariance, origin, equations }
    }

    /// How far from a site samples enter its equations, px.
    fn window_reach(&self) -> usize {
        let reach = self.stencil.reach();
        let stencil = reach.left.max(reach.right).max(reach.up).max(reach.down);
        self.options.radius() + stencil + self.smoother.as_ref().map_or(0, GaussianSmoother::radius)
    }

    /// How far from a site samples have any influence, px.
    fn margin(&self, common: &EstimatorOptions) -> usize {
        let window = self.window_reach();
        if common.covariance { 2 * window + CARRY_REACH } else { window }
    }

    /// The frame, smoothed if that is an option.
    fn smooth<'f, T: SimdReal>(&self, level: Level, frame: Cow<'f, Frame<T>>) -> Cow<'f, Frame<T>> {
        match &self.smoother {
            Some(smoother) => Cow::Owned(smoother.apply_at(level, &frame)),
            None => frame,
        }
    }
}

/// Estimates and, on request, covariances of a part of the sites.
struct Results<T> {
    strip: Strip<T>,
    /// Upper triangles of the covariances, or those and after them of the systematic part.
    covariance: Option<Grid<T>>,
    /// Frame coordinates of the part's corner, px.
    origin: (usize, usize),
    /// Equations at each pixel.
    equations: usize,
}

impl<T: SimdReal> Results<T> {
    /// Copies the results of a run of the frame's pixels from `at` on, `step` apart, to the places `to` of a
    /// band.
    fn write_run(&self, (at, step): ((usize, usize), usize), to: Range<usize>, band: &mut FieldBand<'_, T>) {
        let (x, y) = (at.0 - self.origin.0, at.1 - self.origin.1);
        let (strip, grid) = (&self.strip, &self.strip.grid);
        let Some(j) = grid.place(y) else { return };
        let from = x - grid.columns.start;
        let first = j * grid.columns.len() + from;
        copy(&strip.status[first..], step, &mut band.status[to.clone()]);
        for (k, plane) in band.motion.iter_mut().enumerate() {
            let unit = T::from_f64(if k < 2 { 1.0 } else { strip.scale });
            let row = grid.row(MOTION + k, j)[from..].iter().step_by(step);
            for (value, scaled) in plane[to.clone()].iter_mut().zip(row) {
                *value = *scaled * unit;
            }
        }
        if let Some(grid) = &self.covariance {
            let j = grid.place(y).unwrap_or_default();
            for (k, plane) in band.covariance.iter_mut().chain(&mut band.systematic).enumerate() {
                copy(&grid.row(k, j)[x - grid.columns.start..], step, &mut plane[to.clone()]);
            }
        }
        withdraw_unusable(band, to.clone());
        if let Some(plane) = &mut band.residual {
            let rows = T::from_f64(self.equations as f64);
            let sums = grid.row(RESIDUAL, j)[from..].iter().zip(&grid.row(WEIGHT, j)[from..]);
            for (value, (sum, weight)) in plane[to.clone()].iter_mut().zip(sums.step_by(step)) {
                *value = Lanes::sqrt(*sum / (rows * *weight));
            }
        }
        if let Some(plane) = &mut band.rank {
            copy(&strip.rank[first..], step, &mut plane[to.clone()]);
        }
        if let Some(plane) = &mut band.condition {
            copy(&grid.row(CONDITION, j)[from..], step, &mut plane[to]);
        }
    }
}

/// Withdraws motion at pixels without equations of their own, and estimates whose covariance overflowed or
/// lost a variance to rounding.
fn withdraw_unusable<T: SimdReal>(band: &mut FieldBand<'_, T>, places: Range<usize>) {
    for place in places {
        let is_negative = |i: usize| band.covariance.get(upper(i, i)).is_some_and(|plane| plane[place] < T::default());
        let broken = band.covariance.iter().any(|plane| !plane[place].finite()) || (0..6).any(is_negative);
        if broken && band.status[place].has_estimate() {
            band.status[place] = Status::NonFinite;
            band.covariance.iter_mut().for_each(|plane| plane[place] = T::nan());
        }
        if !band.status[place].has_estimate() && band.status[place] != Status::MinNorm {
            band.motion.iter_mut().for_each(|plane| plane[place] = T::nan());
        }
    }
}

/// Copies every `step`-th value.
fn copy<S: Copy>(row: &[S], step: usize, target: &mut [S]) {
    for (value, source) in target.iter_mut().zip(row.iter().step_by(step)) {
        *value = *source;
    }
}

/// The frame, NaN where it is masked.
fn visible<'f, T: SimdReal>(frame: &'f Frame<T>, mask: Option<&Mask>) -> Cow<'f, Frame<T>> {
    let Some(mask) = mask else { return Cow::Borrowed(frame) };
    let value = |x: usize, y: usize| if mask.get(x, y) { frame.get(x, y) } else { T::nan() };
    Cow::Owned(Frame::from_fn(frame.width(), frame.height(), value))
}

/// The smallest rectangle that holds the points, of which there is at least one.
fn bounds(points: &[(usize, usize)]) -> Rect {
    let (x, y) = points[0];
    let grow = |b: [usize; 4], &(x, y): &(usize, usize)| [b[0].min(x), b[1].min(y), b[2].max(x), b[3].max(y)];
    let [x0, y0, x1, y1] = points.iter().fold([x, y, x, y], grow);
    Rect { x: x0, y: y0, width: x1 - x0 + 1, height: y1 - y0 + 1 }
}

/// The rectangle with a margin, inside the frame.
fn crop(sites: Rect, (width, height): (usize, usize), margin: usize) -> Rect {
    let span = |at: usize, len: usize, size: usize| {
        let to = (at + len + margin).min(size);
        let from = at.saturating_sub(margin).min(to.saturating_sub(MIN_CROP));
        (from, to.max(from + MIN_CROP).min(size) - from)
    };
    let ((x, width), (y, height)) = (span(sites.x, sites.width, width), span(sites.y, sites.height, height));
    Rect { x, y, width, height }
}

/// The part of an image inside a rectangle; nothing is copied where that is all of it.
fn cut<S: Copy>(frame: &Frame<S>, part: Rect) -> Cow<'_, Frame<S>> {
    if (part.width, part.height) == frame.size() {
        return Cow::Borrowed(frame);
    }
    Cow::Owned(Frame::from_fn(part.width, part.height, |x, y| frame.get(part.x + x, part.y + y)))
}
