//! From the sites' motion to the field that was asked for.

use super::covariance::{ENTRIES, covariance};
use super::data::MOTION;
use super::grid::Planes;
use super::reference::at_first_frame;
use super::resample::motion_at;
use super::rows::RowReader;
use super::run::Estimate;
use crate::flow::options::Common;
use crate::flow::site::{FieldBand, bands};
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
    let writer = Writer {
        motion: moved.as_ref().unwrap_or(&estimate.motion),
        reference: frames[frames.len() - 2],
        mask: common.mask.as_ref(),
        observable: is_observable(estimate),
        covariance: field.covariance.is_some().then(|| covariance(common.level(), estimate)),
    };
    let (sites, width) = (field.layout.sites.clone(), field.width);
    bands(field).into_par_iter().for_each(|mut band| match &sites {
        Sites::Points(points) => writer.points(points, &mut band),
        Sites::Grid { .. } => writer.rows(&sites, width, &mut band),
    });
}

/// Whether anything at all was seen: a constant image says nothing about motion.
fn is_observable<T: SimdReal>(estimate: &Estimate<T>) -> bool {
    let (data, least) = (&estimate.data, 1e-9 * estimate.contrast * estimate.contrast);
    (0..data.height).any(|y| data.line(0, y).iter().chain(data.line(12, y)).any(|v| v.to_f64() > least))
}

/// What the sites of the field are filled from.
struct Writer<'a, T: Clone> {
    motion: &'a Planes<T>,
    reference: &'a Frame<T>,
    mask: Option<&'a Mask>,
    observable: bool,
    covariance: Option<Planes<T>>,
}

impl<T: SimdReal> Writer<'_, T> {
    fn points(&self, points: &[(usize, usize)], band: &mut FieldBand<'_, T>) {
        for (at, &(x, y)) in points[band.sites.clone()].iter().enumerate() {
            let motion = motion_at(self.motion, STEP, x as f64, y as f64);
            self.put(
                band,
                at,
                (x, y),
                |k| T::from_f64(motion[k]),
                |planes, k| {
                    let site = |at: usize, count: usize| ((at as f64 / STEP) as usize).min(count - 1);
                    planes.at(k, site(x, planes.width), site(y, planes.height))
                },
            );
        }
    }

    fn rows(&self, sites: &Sites, width: usize, band: &mut FieldBand<'_, T>) {
        let mut reader = RowReader::new(self.reference.width());
        let mut spread = RowReader::new(self.reference.width());
        for first in band.sites.clone().step_by(width) {
            let row = first / width;
            reader.read_motion(self.motion, sites.pixel(0, row).1);
            if let Some(planes) = &self.covariance {
                spread.read_values(planes, sites.pixel(0, row).1);
            }
            for column in 0..width {
                let (x, y) = sites.pixel(column, row);
                self.put(
                    band,
                    first + column - band.sites.start,
                    (x, y),
                    |k| reader.plane(k)[x],
                    |_, k| spread.plane(k)[x],
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
        covariance: impl Fn(&Planes<T>, usize) -> T,
    ) {
        let status = self.status(pixel);
        band.status[at] = status;
        for k in 0..MOTION {
            band.motion[k][at] = if status == Status::Ok { value(k) } else { T::nan() };
        }
        if let Some(planes) = &self.covariance {
            for k in 0..ENTRIES {
                band.covariance[k][at] = if status == Status::Ok { covariance(planes, k) } else { T::nan() };
            }
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
