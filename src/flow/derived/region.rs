//! Derived quantities over a field, and their mean over a region.

use super::{Quantity, sharing::in_common, sharing::sharing_among, value_and_std};
use crate::error::{Error, Result};
use crate::math::{MAD_TO_STD, Real, central_median};
use crate::types::{FlowField, Rect, SamplingGrid};

/// How the sites of a region are combined into one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Aggregate {
    /// Weighted by the inverse of each site's variance, which needs the field's covariance.
    #[default]
    InverseVariance,
    /// The median, with 1.2533 times the standard error of the mean (its spread for normal errors) as
    /// standard deviation, the spread taken from the median absolute deviation.
    Median,
}

/// One number for a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// The value; NaN when no site has one.
    pub value: f64,
    /// Its standard deviation, with the correlation of neighbouring estimates
    /// ([`sharing`](super::sharing())): at least what their scatter shows, and with
    /// [`Aggregate::InverseVariance`] what they claim and do not scatter, which they must have in common.
    pub std: f64,
    /// Sites that took part.
    pub count: usize,
}

/// The point that site `index` stands for, in units of the pixel pitch.
fn position<T: Real>(field: &FlowField<T>, index: usize) -> (f64, f64) {
    let (x, y) = field.layout.sites.pixel(index % field.width, index / field.width);
    let (dx, dy) = field.layout.pixel_pitch;
    (x as f64 * dx, y as f64 * dy)
}

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
    let pairs: Vec<(f64, Option<f64>)> = (0..field.len()).map(|i| at_site(field, quantity, i)).collect();
    let std = field.covariance.is_some().then(|| pairs.iter().map(|p| p.1.unwrap_or(f64::NAN)).collect());
    Ok((pairs.into_iter().map(|p| p.0).collect(), std))
}

fn check<T>(field: &FlowField<T>, quantity: Quantity) -> Result<()> {
    if quantity.needs_fps() && field.layout.frame_period.is_none() {
        return Err(Error::argument(
            "quantity",
            "a frame period (frames per second) to be given with rpm",
            "a field without one",
        ));
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

fn at_site<T: Real>(field: &FlowField<T>, quantity: Quantity, index: usize) -> (f64, Option<f64>) {
    let m = field.affine(index).to_array().map(Real::to_f64);
    value_and_std(quantity, m, field.covariance_at(index), position(field, index), field.layout.frame_period)
}

/// One value of a quantity for the sites inside `region` (pixels of the frame; `None`: all sites).
///
/// # Errors
/// As [`plane()`]; [`Error::Argument`] naming `region` for one that leaves the frame, and `aggregate` for
/// [`Aggregate::InverseVariance`] on a field without covariance.
pub fn region_mean<T: Real>(
    field: &FlowField<T>,
    quantity: Quantity,
    region: Option<Rect>,
    aggregate: Aggregate,
) -> Result<Mean> {
    check(field, quantity)?;
    mean_of(field, (region, aggregate), |index| at_site(field, quantity, index))
}

/// One value of the parameter `name` (u, v, u_x, ...) for the sites inside `region`, as [`region_mean`].
///
/// # Errors
/// As [`region_mean`]; [`Error::Argument`] naming `name` for a parameter that the field does not have.
pub fn parameter_mean<T: Real>(
    field: &FlowField<T>,
    name: &str,
    region: Option<Rect>,
    aggregate: Aggregate,
) -> Result<Mean> {
    let Some(plane) = field.plane(name) else {
        return Err(Error::argument("name", format!("one of {}", field.layout.parameters.join(", ")), name));
    };
    let std = field.standard_deviation(name);
    mean_of(field, (region, aggregate), |index| (plane[index].to_f64(), std.as_ref().map(|std| std[index].to_f64())))
}

/// The mean of a value with its standard deviation.
fn mean_of<T: Real>(
    field: &FlowField<T>,
    (region, aggregate): (Option<Rect>, Aggregate),
    at: impl Fn(usize) -> (f64, Option<f64>),
) -> Result<Mean> {
    if aggregate == Aggregate::InverseVariance && field.covariance.is_none() {
        return Err(Error::argument(
            "aggregate",
            "a field with covariance, or the median",
            "a field without covariance",
        ));
    }
    if let Some(r) = region {
        SamplingGrid::Grid { region: Some(r), stride: 1 }.shape(field.layout.frame_size)?;
    }
    let inside = |&index: &usize| {
        let (x, y) = field.layout.sites.pixel(index % field.width, index / field.width);
        region.is_none_or(|r| x >= r.x && y >= r.y && x - r.x < r.width && y - r.y < r.height)
    };
    let known = |&index: &usize| field.status[index].is_valid();
    let (used, sites): (Vec<usize>, Vec<(f64, Option<f64>)>) = (0..field.len())
        .filter(inside)
        .filter(known)
        .map(|index| (index, at(index)))
        .filter(|(_, (value, _))| value.is_finite())
        .unzip();
    let sharing = sharing_among(&field.layout, field.width, &used);
    Ok(match aggregate {
        Aggregate::InverseVariance => weighted(&sites, sharing),
        Aggregate::Median => median_of(sites.into_iter().map(|s| s.0).collect(), sharing),
    })
}

fn weighted(sites: &[(f64, Option<f64>)], sharing: f64) -> Mean {
    let known: Vec<(f64, f64)> =
        sites.iter().filter_map(|&(v, s)| s.filter(|s| s.is_finite()).map(|s| (v, s * s))).collect();
    // Estimates that claim no error at all (exact data) outweigh the rest and share the weight equally.
    let exact: Vec<(f64, f64)> = known.iter().filter(|k| k.1 == 0.0).map(|k| (k.0, 1.0)).collect();
    let all_exact = !exact.is_empty();
    let used = if all_exact { exact } else { known };
    let weight: f64 = used.iter().map(|k| 1.0 / k.1).sum();
    let value = used.iter().map(|k| k.0 / k.1).sum::<f64>() / weight;
    let scatter: f64 = used.iter().map(|k| (k.0 - value).powi(2) / k.1).sum();
    // The larger of the claimed and the observed spread (Birge 1932).
    let ratio = if used.len() > 1 { scatter / (used.len() - 1) as f64 } else { 1.0 };
    let common = if all_exact { 0.0 } else { in_common(ratio, (used.len(), 1), sharing) };
    let ratio = if all_exact { ratio } else { ratio.max(1.0) };
    // What all have in common does not shrink with their number.
    let variance = (sharing * ratio * (1.0 - common) + common * used.len() as f64) / weight;
    Mean { value, std: variance.sqrt(), count: used.len() }
}

fn median_of(mut values: Vec<f64>, sharing: f64) -> Mean {
    let count = values.len();
    let Some(value) = central_median(&mut values) else {
        return Mean { value: f64::NAN, std: f64::NAN, count };
    };
    let mut deviations: Vec<f64> = values.iter().map(|v| (v - value).abs()).collect();
    let spread = MAD_TO_STD * central_median(&mut deviations).unwrap_or(f64::NAN);
    Mean { value, std: 1.2533 * spread * (sharing / count as f64).sqrt(), count }
}
