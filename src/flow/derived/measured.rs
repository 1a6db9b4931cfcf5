//! What can be measured: the parameters of a motion and the quantities derived from them.

use super::region::check;
use super::{Motion, Quantity, RegionMotion, unbiased_value_and_std, value_and_std};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::types::{FlowField, MOTION_NAMES, Units};

/// A parameter or a derived quantity of affine motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measured {
    /// A parameter, by its place among `(u, v, u_x, v_x, u_y, v_y)`.
    Parameter(usize),
    /// A derived quantity.
    Derived(Quantity),
}

impl Measured {
    /// The one called `name`.
    ///
    /// # Errors
    /// [`Error::Argument`] named `quantity` for an unknown name.
    pub fn parse(name: &str) -> Result<Self> {
        match MOTION_NAMES.iter().position(|known| *known == name) {
            Some(place) => Ok(Self::Parameter(place)),
            None => Quantity::parse(name)
                .map(Self::Derived)
                .map_err(|_| Error::argument("quantity", Quantity::expected(name, &MOTION_NAMES), format!("{name:?}"))),
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parameter(place) => MOTION_NAMES[place],
            Self::Derived(quantity) => quantity.name(),
        }
    }

    /// The unit of its values.
    pub fn unit(self, units: &Units) -> String {
        match self {
            Self::Parameter(place) => units.of_parameter(MOTION_NAMES[place]),
            Self::Derived(quantity) => quantity.unit(units),
        }
    }

    /// Whether it has no meaning without the frame period.
    pub fn needs_fps(self) -> bool {
        matches!(self, Self::Derived(quantity) if quantity.needs_fps())
    }

    /// Value and standard deviation (NaN where the covariance is not known) for a motion.
    pub fn of_motion(self, motion: &Motion<'_>) -> (f64, f64) {
        let std = |place: usize| motion.covariance.map_or(f64::NAN, |covariance| covariance[place][place].sqrt());
        match self {
            Self::Parameter(place) => (motion.parameters[place], std(place)),
            Self::Derived(quantity) => {
                let (value, std) = value_and_std(quantity, motion);
                (value, std.unwrap_or(f64::NAN))
            }
        }
    }

    /// Value and standard deviation for the motion of a region; see [`fit_region`](super::fit_region).
    /// Parameters are those at its centre.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) naming `quantity` for one that the field cannot give.
    pub fn of_region<T: Real>(self, field: &FlowField<T>, fit: &RegionMotion) -> Result<(f64, f64)> {
        let quantity = match self {
            Self::Parameter(place) => return Ok((fit.motion[place], fit.covariance[place][place].sqrt())),
            Self::Derived(quantity) => quantity,
        };
        check(field, quantity)?;
        let (dx, dy) = field.layout.units.pixel_pitch;
        let motion = Motion {
            parameters: fit.motion,
            covariance: Some(fit.covariance),
            at: (fit.centre.0 * dx, fit.centre.1 * dy),
            interval: field.layout.interval,
            units: &field.layout.units,
        };
        let (value, std) = unbiased_value_and_std(quantity, &motion);
        Ok((value, std.unwrap_or(f64::NAN)))
    }
}
