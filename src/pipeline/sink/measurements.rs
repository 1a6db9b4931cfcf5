//! Derived quantities of a region or of points, one row each and frame.

use super::{Sink, Step, ends_as, table::Table, table::TableTarget};
use crate::error::{Error, Result};
use crate::flow::derived::{Quantity, fit_region, value_and_std};
use crate::io::cell;
use crate::math::Real;
use crate::types::{FlowField, SamplingGrid};
use std::path::PathBuf;

/// Columns of the table.
const HEADER: [&str; 9] = ["frame", "time_s", "x", "y", "quantity", "value", "std", "unit", "valid_share"];

/// Writes `frame, time_s, x, y, quantity, value, std, unit, valid_share`.
///
/// A grid of sites is one region: [`fit_region`] gives its motion, and `x`, `y` is its centre. A list of
/// points has a row for each point. A quantity that cannot be had is NaN. Without a frame rate the time is
/// empty and units are per frame.
#[derive(Debug)]
pub struct Measurements {
    table: Table,
    quantities: Vec<Quantity>,
}

impl Measurements {
    /// Opens the table.
    pub fn open(target: &TableTarget, quantities: Vec<Quantity>) -> Result<Self> {
        Ok(Self { table: Table::create(target, &HEADER)?, quantities })
    }

    fn check<T>(&self, field: &FlowField<T>) -> Result<()> {
        for quantity in &self.quantities {
            if quantity.needs_fps() && field.layout.frame_period.is_none() {
                let expected = format!("frames per second, for {}", quantity.name());
                return Err(Error::argument("fps", expected, "none"));
            }
        }
        Ok(())
    }

    /// Rows for the motion `m` at the pixel `(x, y)`.
    fn rows<T: Real>(
        &mut self,
        step: &Step<'_, T>,
        m: [f64; 6],
        covariance: Option<&[[f64; 6]; 6]>,
        place: (f64, f64),
        share: f64,
    ) -> Result<()> {
        let layout = &step.field.layout;
        let at = (place.0 * layout.pixel_pitch.0, place.1 * layout.pixel_pitch.1);
        let time = step.time.map(cell).unwrap_or_default();
        for quantity in self.quantities.clone() {
            let (value, std) = value_and_std(quantity, m, covariance.copied(), at, layout.frame_period);
            self.table.row([
                layout.frame_index.to_string(),
                time.clone(),
                cell(place.0),
                cell(place.1),
                quantity.name().to_string(),
                cell(value),
                cell(std.unwrap_or(f64::NAN)),
                unit(quantity, layout.frame_period.is_some(), layout.pixel_pitch),
                cell(share),
            ])?;
        }
        Ok(())
    }
}

/// The unit; lengths are in units of the pixel pitch where one is given.
fn unit(quantity: Quantity, per_second: bool, pitch: (f64, f64)) -> String {
    let unit = quantity.unit(per_second);
    if pitch == (1.0, 1.0) { unit.into() } else { unit.replace("px", "pitch unit") }
}

impl<T: Real> Sink<Step<'_, T>> for Measurements {
    fn accept(&mut self, step: &Step<'_, T>) -> Result<()> {
        let field = step.field;
        self.check(field)?;
        if let SamplingGrid::Points(points) = &field.layout.sites {
            for (site, &(x, y)) in points.iter().enumerate() {
                let m = field.affine(site).to_array().map(Real::to_f64);
                let share = f64::from(u8::from(field.status[site].is_valid()));
                self.rows(step, m, field.covariance_at(site).as_ref(), (x as f64, y as f64), share)?;
            }
        } else {
            let fit = fit_region(field);
            self.rows(step, fit.motion, Some(&fit.covariance), fit.centre, fit.valid_share())?;
        }
        self.table.flush()
    }

    ends_as!(table);
}
