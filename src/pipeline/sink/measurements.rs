//! Motion and derived quantities of a region or of points, one row each and frame.

use super::{Sink, Step, ends_as, table::Table, table::TableTarget};
use crate::error::{Error, Result};
use crate::flow::derived::{Measured, Motion, RegionStatus, fit_region};
use crate::io::cell;
use crate::math::Real;
use crate::types::{Region, SamplingGrid};
use std::path::PathBuf;

/// Columns of the table.
const HEADER: [&str; 11] =
    ["frame", "time_s", "x", "y", "quantity", "value", "std", "unit", "share", "valid_share", "status"];

/// Where a quantity is measured: the region, `None` for all sites, and a pixel `(x, y)` that belongs to the
/// motion that is wanted.
#[derive(Debug, Clone, Default)]
pub struct MeasuredRegion {
    /// The region.
    pub region: Option<Region>,
    /// A pixel of the motion.
    pub at: Option<(f64, f64)>,
}

/// Writes `frame, time_s, x, y, quantity, value, std, unit, share, valid_share, status`.
///
/// A grid of sites is one region: [`fit_region`] gives its motion, `x`, `y` is its centre, `share` that of
/// the valid sites that follow the motion. A list of points has a row for each point. A quantity that cannot
/// be had is NaN. Without a frame rate the time is empty and units are per frame.
#[derive(Debug)]
pub struct Measurements {
    table: Table,
    quantities: Vec<Measured>,
    place: MeasuredRegion,
}

/// What the rows of one place and frame have in common.
struct Place {
    at: (f64, f64),
    share: f64,
    valid_share: f64,
    status: &'static str,
}

impl Measurements {
    /// Opens the table.
    pub fn open(target: &TableTarget, quantities: Vec<Measured>, place: MeasuredRegion) -> Result<Self> {
        Ok(Self { table: Table::create(target, &HEADER)?, quantities, place })
    }

    /// Rows for the values `of` each quantity at a place.
    fn rows<T: Real>(
        &mut self,
        step: &Step<'_, T>,
        place: &Place,
        of: impl Fn(Measured) -> Result<(f64, f64)>,
    ) -> Result<()> {
        let layout = &step.field.layout;
        let time = step.time.map(cell).unwrap_or_default();
        for &quantity in &self.quantities {
            if quantity.needs_fps() && layout.units.frame_period.is_none() {
                let expected = format!("frames per second, for {}", quantity.name());
                return Err(Error::argument("fps", expected, "none"));
            }
            let (value, std) = of(quantity)?;
            self.table.row([
                layout.frame_index.to_string(),
                time.clone(),
                cell(place.at.0),
                cell(place.at.1),
                quantity.name().to_string(),
                cell(value),
                cell(std),
                quantity.unit(&layout.units),
                cell(place.share),
                cell(place.valid_share),
                place.status.to_string(),
            ])?;
        }
        Ok(())
    }
}

impl<T: Real> Sink<Step<'_, T>> for Measurements {
    fn accept(&mut self, step: &Step<'_, T>) -> Result<()> {
        let field = step.field;
        if let SamplingGrid::Points(points) = &field.layout.sites {
            for (site, &(x, y)) in points.iter().enumerate() {
                let motion = Motion::at_site(field, site);
                let share = f64::from(u8::from(field.status[site].is_valid()));
                let at = (x as f64, y as f64);
                let place = Place { at, share, valid_share: share, status: field.status[site].name() };
                self.rows(step, &place, |quantity| Ok(quantity.of_motion(&motion)))?;
            }
        } else {
            let fit = fit_region(field, self.place.region.as_ref(), self.place.at)?;
            let (share, valid_share) = (fit.share(), fit.valid_share());
            let place = Place { at: fit.centre, share, valid_share, status: RegionStatus::name(fit.status) };
            self.rows(step, &place, |quantity| quantity.of_region(field, &fit))?;
        }
        self.table.flush()
    }

    ends_as!(table);
}
