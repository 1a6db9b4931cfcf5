//! Derived quantities over a field, and the sites of a region.

use super::{Motion, Quantity, value_and_std};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::types::{FlowField, Region};
use nalgebra::Matrix6;

/// Values of a quantity at every site, row-major; NaN without estimate or Jacobian.
///
/// # Errors
/// [`Error::Argument`] naming `quantity` for one that needs the frame period of a field without.
pub fn plane<T: Real>(field: &FlowField<T>, quantity: Quantity) -> Result<Vec<f64>> {
    Ok(planes(field, quantity)?.0)
}

/// As [`plane()`], with the plane of standard deviations where the field has a covariance.
pub fn planes<T: Real>(field: &FlowField<T>, quantity: Quantity) -> Result<(Vec<f64>, Option<Vec<f64>>)> {
    check(field, quantity)?;
    let pairs = (0..field.len()).map(|index| value_and_std(quantity, &Motion::at_site(field, index)));
    let (values, std): (Vec<f64>, Vec<f64>) = pairs.map(|(value, std)| (value, std.unwrap_or(f64::NAN))).unzip();
    Ok((values, field.covariance.is_some().then_some(std)))
}

/// # Errors
/// [`Error::Argument`] naming `quantity` for one that the field cannot give.
pub(super) fn check<T>(field: &FlowField<T>, quantity: Quantity) -> Result<()> {
    if quantity.needs_fps() && field.layout.units.frame_period.is_none() {
        let expected = "a field with a frame period (fps) for rpm";
        return Err(Error::argument("quantity", expected, "one without"));
    }
    if quantity.needs_jacobian() && !field.layout.parameters.iter().any(|p| p == "u_x") {
        return Err(Error::argument(
            "quantity",
            format!("speed, the only one that the {} model's flow without Jacobian has", field.layout.model),
            quantity.name(),
        ));
    }
    Ok(())
}

/// The sites of `region`.
///
/// # Errors
/// [`Error::Argument`] naming `region` for one that does not fit the frame or holds no site.
pub(super) fn sites_in<T: Real>(field: &FlowField<T>, region: Option<&Region>) -> Result<Vec<usize>> {
    if let Some(region) = region {
        region.check(field.layout.frame_size)?;
    }
    let is_inside = |&index: &usize| {
        let (x, y) = field.layout.sites.pixel(index % field.width, index / field.width);
        region.is_none_or(|region| region.contains(x, y))
    };
    let sites: Vec<usize> = (0..field.len()).filter(is_inside).collect();
    if region.is_some() && sites.is_empty() {
        return Err(Error::argument("region", "one that holds at least one site of the field", "one without"));
    }
    Ok(sites)
}

/// The valid ones of some sites; `None` where the frames contradict more than half of the estimates: the
/// others are then no better.
pub(super) fn valid_sites<T: Real>(field: &FlowField<T>, sites: &[usize]) -> Option<Vec<usize>> {
    let estimated = sites.iter().filter(|&&index| field.status[index].has_estimate()).count();
    let valid: Vec<usize> = sites.iter().copied().filter(|&index| field.status[index].is_valid()).collect();
    (2 * valid.len() >= estimated).then_some(valid)
}

/// `T` that carries an affine motion by the offset `(dx, dy)`: `(u, v, ...)(p) = T m0`.
pub(super) fn carry_to(dx: f64, dy: f64) -> Matrix6<f64> {
    let mut carry = Matrix6::identity();
    (carry[(0, 2)], carry[(0, 4)]) = (dx, dy);
    (carry[(1, 3)], carry[(1, 5)]) = (dx, dy);
    carry
}
