//! Derived quantities over a field, and their mean over a region.

use super::sharing::{in_common, sharing_among};
use super::{Motion, Quantity, unbiased_value_and_std, value_and_std};
use crate::error::{Error, Result};
use crate::math::{MAD_TO_STD, Real, central_median};
use crate::types::{FlowField, MOTION_NAMES, Region};
use nalgebra::{Matrix6, Vector6};

/// Standard error of a median of normal values over that of their mean.
const MEDIAN_EFFICIENCY: f64 = 1.2533;

/// How the sites of a region are combined into one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Aggregate {
    /// Weighted by the inverse of each site's variance, which needs the field's covariance.
    #[default]
    InverseVariance,
    /// The median, whose standard deviation is that of the mean times 1.2533 (its spread for normal errors),
    /// with the scatter taken from the median absolute deviation.
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

impl Mean {
    const UNKNOWN: Self = Self { value: f64::NAN, std: f64::NAN, count: 0 };
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
    let pairs = (0..field.len()).map(|index| value_and_std(quantity, &Motion::at_site(field, index)));
    let (values, std): (Vec<f64>, Vec<f64>) = pairs.map(|(value, std)| (value, std.unwrap_or(f64::NAN))).unzip();
    Ok((values, field.covariance.is_some().then_some(std)))
}

/// # Errors
/// [`Error::Argument`] naming `quantity` for one that the field cannot give.
pub(super) fn check<T>(field: &FlowField<T>, quantity: Quantity) -> Result<()> {
    if quantity.needs_fps() && field.layout.units.frame_period.is_none() {
        let expected = "a frame period (frames per second) to be given with rpm";
        return Err(Error::argument("quantity", expected, "a field without one"));
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

/// One value of a quantity for the sites inside `region` (`None`: all sites): that of their mean motion at
/// their centre, so that ratios, lengths and angles are formed after the mean is.
///
/// Sites are weighted by the inverse variance of what the quantity is a linear combination of, or of what it
/// is formed of. What noise adds to the length of a vector is taken off. NaN where the frames contradict more
/// than half of the region's estimates.
///
/// # Errors
/// As [`plane()`]; [`Error::Argument`] naming `region` for one that does not fit the frame, and `aggregate`
/// for [`Aggregate::InverseVariance`] on a field without covariance.
pub fn region_mean<T: Real>(
    field: &FlowField<T>,
    quantity: Quantity,
    region: Option<&Region>,
    aggregate: Aggregate,
) -> Result<Mean> {
    check(field, quantity)?;
    let Some((motion, count)) = mean_motion(field, quantity.combinations(), (region, aggregate))? else {
        return Ok(Mean::UNKNOWN);
    };
    let (value, std) = unbiased_value_and_std(quantity, &motion);
    Ok(Mean { value, std: std.unwrap_or(f64::NAN), count })
}

/// One value of the parameter `name` (u, v, u_x, ...) for the sites inside `region`, as [`region_mean`].
///
/// # Errors
/// As [`region_mean`]; [`Error::Argument`] naming `name` for a parameter that the field does not have.
pub fn parameter_mean<T: Real>(
    field: &FlowField<T>,
    name: &str,
    region: Option<&Region>,
    aggregate: Aggregate,
) -> Result<Mean> {
    let place = MOTION_NAMES.iter().position(|known| *known == name);
    let Some(place) = place.filter(|_| field.plane(name).is_some()) else {
        let known = field.layout.parameters.iter().filter(|p| MOTION_NAMES.contains(&p.as_str()));
        let names: Vec<&str> = known.map(String::as_str).collect();
        return Err(Error::argument("name", format!("one of {}", names.join(", ")), name));
    };
    let itself = std::array::from_fn(|k| if k == place { 1.0 } else { 0.0 });
    let Some((motion, count)) = mean_motion(field, &[itself], (region, aggregate))? else { return Ok(Mean::UNKNOWN) };
    let variance = motion.covariance.map_or(f64::NAN, |c| c[place][place]);
    Ok(Mean { value: motion.parameters[place], std: variance.sqrt(), count })
}

/// The sites of `region`.
///
/// # Errors
/// [`Error::Argument`] naming `region` for one that does not fit the frame.
pub(super) fn sites_in<T: Real>(field: &FlowField<T>, region: Option<&Region>) -> Result<Vec<usize>> {
    if let Some(region) = region {
        region.check(field.layout.frame_size)?;
    }
    let is_inside = |&index: &usize| {
        let (x, y) = field.layout.sites.pixel(index % field.width, index / field.width);
        region.is_none_or(|region| region.contains(x, y))
    };
    Ok((0..field.len()).filter(is_inside).collect())
}

/// The valid ones of some sites; `None` where the frames contradict more than half of the estimates: the
/// others are then no better.
pub(super) fn valid_sites<T: Real>(field: &FlowField<T>, sites: &[usize]) -> Option<Vec<usize>> {
    let estimated = sites.iter().filter(|&&index| field.status[index].has_estimate()).count();
    let valid: Vec<usize> = sites.iter().copied().filter(|&index| field.status[index].is_valid()).collect();
    (2 * valid.len() >= estimated).then_some(valid)
}

/// The mean motion of a region for what is formed of `combinations`, and the number of sites that took part.
fn mean_motion<'a, T: Real>(
    field: &'a FlowField<T>,
    combinations: &[[f64; 6]],
    (region, aggregate): (Option<&Region>, Aggregate),
) -> Result<Option<(Motion<'a>, usize)>> {
    if aggregate == Aggregate::InverseVariance && field.covariance.is_none() {
        let expected = "a field with covariance, or the median";
        return Err(Error::argument("aggregate", expected, "a field without covariance"));
    }
    let Some(mut used) = valid_sites(field, &sites_in(field, region)?) else { return Ok(None) };
    used.retain(|&index| field.affine(index).to_array().iter().all(|value| value.finite()));
    Ok(match aggregate {
        Aggregate::InverseVariance => weighted(field, &used, combinations),
        Aggregate::Median => median(field, &used),
    })
}

/// `a^T C a`.
fn along(a: &[f64; 6], c: &[[f64; 6]; 6]) -> f64 {
    (0..6).map(|i| a[i] * (0..6).map(|j| c[i][j] * a[j]).sum::<f64>()).sum()
}

fn weighted<'a, T: Real>(
    field: &'a FlowField<T>,
    used: &[usize],
    combinations: &[[f64; 6]],
) -> Option<(Motion<'a>, usize)> {
    let claimed = |&index: &usize| -> f64 {
        let covariance = field.covariance_at(index);
        covariance.map_or(f64::NAN, |c| combinations.iter().map(|a| along(a, &c)).sum())
    };
    let known: Vec<(usize, f64)> =
        used.iter().map(|index| (*index, claimed(index))).filter(|(_, variance)| variance.is_finite()).collect();
    // Estimates that claim no error at all (exact data) outweigh the rest and share the weight equally.
    let is_exact = known.iter().any(|(_, variance)| *variance == 0.0);
    let sites: Vec<(usize, f64)> = known
        .into_iter()
        .filter(|(_, variance)| !is_exact || *variance == 0.0)
        .map(|(index, variance)| (index, if is_exact { 1.0 } else { 1.0 / variance }))
        .collect();
    let total: f64 = sites.iter().map(|(_, weight)| weight).sum();
    let n = sites.len() as f64;
    let (mut parameters, mut at, mut centre) = ([0.0; 6], (0.0, 0.0), (0.0, 0.0));
    for &(index, weight) in &sites {
        let motion = Motion::at_site(field, index);
        let share = weight / total;
        parameters.iter_mut().zip(motion.parameters).for_each(|(sum, value)| *sum += share * value);
        (at.0, at.1) = (at.0 + share * motion.at.0, at.1 + share * motion.at.1);
        (centre.0, centre.1) = (centre.0 + motion.at.0 / n, centre.1 + motion.at.1 / n);
    }
    // Where the flow changes over the region a weighted mean belongs to the weighted mean of the places; the
    // mean Jacobian carries it to their centre.
    let mean = Vector6::from(parameters);
    let at_place = |place: (f64, f64)| carry_to(place.0 - at.0, place.1 - at.1) * mean;
    let step = (centre.0 - at.0, centre.1 - at.1);
    // Mean squares about the mean motion, and mean of the claimed covariances.
    let (mut spread, mut covariance) = ([[0.0; 6]; 6], [[0.0; 6]; 6]);
    for &(index, weight) in &sites {
        let motion = Motion::at_site(field, index);
        let share = weight / total;
        let off = Vector6::from(motion.parameters) - at_place(motion.at);
        for i in 0..6 {
            for j in 0..6 {
                spread[i][j] += share * off[i] * off[j];
                covariance[i][j] += share * motion.covariance.map_or(0.0, |c| c[i][j]);
            }
        }
    }
    let count = sites.len();
    let indices: Vec<usize> = sites.iter().map(|(index, _)| *index).collect();
    let sharing = sharing_among(&field.layout, field.width, &indices);
    // The larger of the claimed and the observed spread (Birge 1932).
    let scatter: f64 = combinations.iter().map(|a| along(a, &spread)).sum::<f64>() * total;
    let ratio = if count > 1 { scatter / (n - 1.0) } else { 1.0 };
    let common = if is_exact { 0.0 } else { in_common(ratio, (count, combinations.len()), sharing) };
    // What all have in common does not shrink with their number.
    let factor = if is_exact { sharing / n } else { sharing * ratio.max(1.0) * (1.0 - common) / n + common };
    let of_mean = if is_exact { spread } else { covariance };
    let motion = Motion {
        parameters: at_place(centre).into(),
        covariance: Some(carried(&of_mean.map(|row| row.map(|value| factor * value)), step)),
        at: centre,
        ..Motion::at_site(field, *indices.first()?)
    };
    Some((motion, count))
}

/// `T` that carries an affine motion by the offset `(dx, dy)`: `(u, v, ...)(p) = T m0`.
pub(super) fn carry_to(dx: f64, dy: f64) -> Matrix6<f64> {
    let mut carry = Matrix6::identity();
    (carry[(0, 2)], carry[(0, 4)]) = (dx, dy);
    (carry[(1, 3)], carry[(1, 5)]) = (dx, dy);
    carry
}

/// The covariance of an affine motion carried by `(dx, dy)`.
fn carried(covariance: &[[f64; 6]; 6], (dx, dy): (f64, f64)) -> [[f64; 6]; 6] {
    let carry = carry_to(dx, dy);
    let matrix = carry * Matrix6::from_fn(|i, j| covariance[i][j]) * carry.transpose();
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

/// The median of each parameter, with independent standard deviations.
fn median<'a, T: Real>(field: &'a FlowField<T>, used: &[usize]) -> Option<(Motion<'a>, usize)> {
    let first = Motion::at_site(field, *used.first()?);
    let middle = |value: &dyn Fn(Motion<'_>) -> f64| {
        let mut values: Vec<f64> = used.iter().map(|&index| value(Motion::at_site(field, index))).collect();
        central_median(&mut values).unwrap_or(f64::NAN)
    };
    let parameters: [f64; 6] = std::array::from_fn(|p| middle(&|motion| motion.parameters[p]));
    let sharing = sharing_among(&field.layout, field.width, used);
    let shrink = MEDIAN_EFFICIENCY * MAD_TO_STD * (sharing / used.len() as f64).sqrt();
    let variance = |p: usize| (shrink * middle(&|motion| (motion.parameters[p] - parameters[p]).abs())).powi(2);
    let covariance = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { variance(i) } else { 0.0 }));
    let at = (middle(&|motion| motion.at.0), middle(&|motion| motion.at.1));
    Some((Motion { parameters, covariance: Some(covariance), at, ..first }, used.len()))
}
