//! From the sites' motion to the field that was asked for.

use super::covariance::{Spread, covariance};
use super::data::{DataOptions, ERROR, MOTION};
use super::grid::Planes;
use super::reference::at_first_frame;
use super::resample::motion_at;
use super::rows::RowReader;
use super::run::Estimate;
use crate::flow::options::Common;
use crate::flow::site::{FieldBand, bands};
use crate::flow::windowed::solve::ENTRIES;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame, Mask, Sites, Status};
use rayon::prelude::*;

/// Pixels between sites.
const STEP: f64 = 2.0;

/// Writes the estimate at the field's sites. A pair's motion is carried from midway to the first frame.
pub(super) fn fill<T: SimdReal>(
    estimate: &Estimate<T>,
    frames: &[&Frame<T>],
    common: &Common,
    field: &mut FlowField<T>,
) {
    let moved = (frames.len() == 2).then(|| at_first_frame(&estimate.motion, STEP));
    // White noise through the rows' stencils: half its variance in each row of a pair's difference, an eighth in a triple's.
    let share = if frames.len() == 2 { 0.5 } else { 0.125 };
    let rows = 1.0 + 2.0 * DataOptions::default().gradient.powi(2);
    let noise = common.noise.map(|sigma| share * rows * (sigma * estimate.range.gain).powi(2));
    let writer = Writer {
        data: &estimate.data,
        per_row: 1.0 / (rows.sqrt() * estimate.range.gain),
        motion: moved.as_ref().unwrap_or(&estimate.motion),
        reference: frames[frames.len() - 2],
        mask: common.mask.as_ref(),
        observable: is_observable(estimate),
        covariance: field.covariance.is_some().then(|| covariance(estimate, noise, frames.len() == 2)),
    };
    let (sites, width) = (field.layout.sites.clone(), field.width);
    bands(field).into_par_iter().for_each(|mut band| match &sites {
        Sites::Points(points) => writer.points(points, &mut band),
        Sites::Grid { .. } => writer.rows(&sites, width, &mut band),
    });
}

/// Whether anything at all was seen: a constant image says nothing about motion.
fn is_observable<T: SimdReal>(estimate: &Estimate<T>) -> bool {
    let (data, least) = (&estimate.data, 1e-9 * estimate.range.contrast.powi(2));
    (0..data.height).any(|y| data.line(0, y).iter().chain(data.line(12, y)).any(|v| v.to_f64() > least))
}

/// What the sites of the field are filled from.
struct Writer<'a, T: Clone> {
    data: &'a Planes<T>,
    /// From the root of the residual energy to grey levels.
    per_row: f64,
    motion: &'a Planes<T>,
    reference: &'a Frame<T>,
    mask: Option<&'a Mask>,
    observable: bool,
    covariance: Option<Spread<T>>,
}

impl<T: SimdReal> Writer<'_, T> {
    fn points(&self, points: &[(usize, usize)], band: &mut FieldBand<'_, T>) {
        for (at, &(x, y)) in points[band.sites.clone()].iter().enumerate() {
            let motion = motion_at(self.motion, STEP, x as f64, y as f64);
            self.put(band, at, (x, y), |k| T::from_f64(motion[k]), |spread, k| spread.at(k, (x, y)));
        }
    }

    fn rows(&self, sites: &Sites, width: usize, band: &mut FieldBand<'_, T>) {
        let mut reader = RowReader::new(self.reference.width());
        let frame_width = self.reference.width();
        let (mut places, mut entries) = (Vec::new(), vec![T::from_f64(0.0); ENTRIES * frame_width]);
        for first in band.sites.clone().step_by(width) {
            let row = first / width;
            reader.read_motion(self.motion, sites.pixel(0, row).1);
            if let Some(spread) = &self.covariance {
                for (k, line) in entries.chunks_exact_mut(frame_width).enumerate() {
                    spread.row(k, sites.pixel(0, row).1, &mut places, line);
                }
            }
            for column in 0..width {
                let (x, y) = sites.pixel(column, row);
                self.put(
                    band,
                    first + column - band.sites.start,
                    (x, y),
                    |k| reader.plane(k)[x],
                    |_, k| entries[k * frame_width + x],
                );
            }
        }
    }

    fn put(
        &self,
        band: &mut FieldBand<'_, T>,
        at: usize,
        pixel: (usize, usize),
        value: impl Fn(usize) -> T,
        covariance: impl Fn(&Spread<T>, usize) -> T,
    ) {
        let status = self.status(pixel);
        band.status[at] = status;
        for k in 0..MOTION {
            band.motion[k][at] = if status == Status::Ok { value(k) } else { T::nan() };
        }
        self.diagnose(band, at, pixel, status == Status::Ok);
        if let Some(planes) = &self.covariance {
            for k in 0..ENTRIES {
                band.covariance[k][at] = if status == Status::Ok { covariance(planes, k) } else { T::nan() };
            }
        }
    }

    /// Residual, rank and condition number, where they are wanted: those of the equations around the nearest site.
    fn diagnose(&self, band: &mut FieldBand<'_, T>, at: usize, (x, y): (usize, usize), known: bool) {
        let (x, y) = (x / 2, y / 2);
        if let Some(residual) = &mut band.residual {
            let energy = self.data.at(ERROR, x, y).to_f64().max(0.0);
            residual[at] = T::from_f64(if known { self.per_row * energy.sqrt() } else { f64::NAN });
        }
        if let Some(rank) = &mut band.rank {
            rank[at] = if known { MOTION as u8 } else { 0 };
        }
        if let Some(condition) = &mut band.condition {
            let [uu, uv, vv] = [0, 6, 12].map(|k| self.data.at(k, x, y).to_f64());
            let (middle, radius) = (0.5 * (uu + vv), (0.5 * (uu - vv)).hypot(uv));
            condition[at] =
                T::from_f64(if known { ((middle + radius) / (middle - radius).max(0.0)).sqrt() } else { f64::NAN });
        }
    }

    /// What can be said of a pixel before looking at its motion.
    fn status(&self, (x, y): (usize, usize)) -> Status {
        if self.mask.is_some_and(|mask| !mask.get(x, y)) {
            Status::Masked
        } else if !self.reference.get(x, y).finite() {
            Status::NonFinite
        } else if !self.observable {
            Status::Unobservable
        } else {
            Status::Ok
        }
    }
}
