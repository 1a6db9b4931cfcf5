//! The mean motion of a region, and what is formed of it.

use super::region::{carry_to, check, sites_in, valid_sites};
use super::region_motion::{least_squares, observed_parameters};
use super::sharing::{in_common, sharing_among};
use super::{Motion, Quantity, unbiased_value_and_std};
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

/// One value of a quantity for the sites inside `region` (`None`: all sites): that of their mean motion at
/// their centre, so that ratios, lengths and angles are formed after the mean is.
///
/// Sites are weighted by the inverse variance of what the quantity is a linear combination of, or of what it
/// is formed of; to those of a field without slopes an affine motion is fitted. What noise adds to the length
/// of a vector is taken off. NaN where the frames contradict more than half of the region's estimates.
///
/// # Errors
/// As [`plane`](super::plane()); [`Error::Argument`] naming `region` for one that does not fit the frame, and
/// `aggregate` for [`Aggregate::InverseVariance`] on a field without covariance.
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
    let Some(plane) = field.plane(name) else {
        let expected = format!("one of {}", field.layout.parameters.join(", "));
        return Err(Error::argument("name", expected, name));
    };
    let Some(place) = MOTION_NAMES.iter().position(|known| *known == name) else {
        return mean_of_plane(field, (name, plane), region, aggregate);
    };
    let itself = std::array::from_fn(|k| if k == place { 1.0 } else { 0.0 });
    let Some((motion, count)) = mean_motion(field, &[itself], (region, aggregate))? else { return Ok(Mean::UNKNOWN) };
    let variance = motion.covariance.map_or(f64::NAN, |c| c[place][place]);
    Ok(Mean { value: motion.parameters[place], std: variance.sqrt(), count })
}

/// The valid sites of a region; `None` as for [`valid_sites`].
fn region_sites<T: Real>(
    field: &FlowField<T>,
    region: Option<&Region>,
    aggregate: Aggregate,
) -> Result<Option<Vec<usize>>> {
    if aggregate == Aggregate::InverseVariance && field.covariance.is_none() {
        let expected = "a field with covariance, or the median";
        return Err(Error::argument("aggregate", expected, "a field without covariance"));
    }
    Ok(valid_sites(field, &sites_in(field, region)?))
}

/// The mean motion of a region for what is formed of `combinations`, and the number of sites that took part.
fn mean_motion<'a, T: Real>(
    field: &'a FlowField<T>,
    combinations: &[[f64; 6]],
    (region, aggregate): (Option<&Region>, Aggregate),
) -> Result<Option<(Motion<'a>, usize)>> {
    let Some(mut used) = region_sites(field, region, aggregate)? else { return Ok(None) };
    used.retain(|&index| field.affine(index).to_array().iter().all(|value| value.finite()));
    Ok(match aggregate {
        Aggregate::InverseVariance => fitted(field, &used).or_else(|| weighted(field, &used, combinations)),
        Aggregate::Median => median(field, &used),
    })
}

/// The mean of a parameter that affine motion does not have, with the standard deviation of [`region_mean`].
fn mean_of_plane<T: Real>(
    field: &FlowField<T>,
    (name, plane): (&str, &[T]),
    region: Option<&Region>,
    aggregate: Aggregate,
) -> Result<Mean> {
    let deviations = field.standard_deviation(name);
    let Some(sites) = region_sites(field, region, aggregate)? else { return Ok(Mean::UNKNOWN) };
    let value = |index: usize| plane[index].to_f64();
    let variance = |index: usize| deviations.as_ref().map_or(1.0, |all| all[index].to_f64().powi(2));
    let used: Vec<usize> =
        sites.into_iter().filter(|&i| value(i).is_finite() && variance(i).is_finite() && variance(i) > 0.0).collect();
    let (sharing, n) = (sharing_among(&field.layout, field.width, &used), used.len() as f64);
    if aggregate == Aggregate::Median {
        let mut values: Vec<f64> = used.iter().map(|&index| value(index)).collect();
        let Some(middle) = central_median(&mut values) else { return Ok(Mean::UNKNOWN) };
        for value in &mut values {
            *value = (*value - middle).abs();
        }
        let spread = MAD_TO_STD * central_median(&mut values).unwrap_or(f64::NAN);
        return Ok(Mean { value: middle, std: MEDIAN_EFFICIENCY * spread * (sharing / n).sqrt(), count: used.len() });
    }
    let total: f64 = used.iter().map(|&index| variance(index).recip()).sum();
    let mean = used.iter().map(|&index| value(index) / variance(index)).sum::<f64>() / total;
    let square = used.iter().map(|&index| (value(index) - mean).powi(2) / variance(index)).sum::<f64>();
    let factor = of_mean(square / (n - 1.0).max(1.0), (used.len(), 1), sharing);
    Ok(Mean { value: mean, std: (factor * n / total).sqrt(), count: used.len() })
}

/// The variance of a weighted mean in units of the claimed variance: `scatter` is the mean square of the
/// sites in these units. The larger of the claimed and the observed spread counts (Birge 1932); what all have
/// in common does not shrink with their number.
fn of_mean(scatter: f64, (count, values): (usize, usize), sharing: f64) -> f64 {
    let ratio = if count > 1 { scatter } else { 1.0 };
    let common = in_common(ratio, (count, values), sharing);
    sharing * ratio.max(1.0) * (1.0 - common) / count as f64 + common
}

/// `a^T C a`.
fn along(a: &[f64; 6], c: &[[f64; 6]; 6]) -> f64 {
    (0..6).map(|i| a[i] * (0..6).map(|j| c[i][j] * a[j]).sum::<f64>()).sum()
}

/// The mean motion of sites without slopes: a mean with unequal weights would be that of another place than
/// their centre. The affine fit to their flow is carried there.
fn fitted<'a, T: Real>(field: &'a FlowField<T>, used: &[usize]) -> Option<(Motion<'a>, usize)> {
    let flow = observed_parameters(field);
    let places = || used.iter().map(|&site| field.layout.sites.pixel(site % field.width, site / field.width));
    let sum = places().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x as f64, sum.1 + y as f64));
    let centre = (sum.0 / used.len() as f64, sum.1 / used.len() as f64);
    let (parameters, covariance) =
        if flow == [0, 1] { least_squares(field, used, centre, &flow)? } else { return None };
    let (dx, dy) = field.layout.units.pixel_pitch;
    let at = (centre.0 * dx, centre.1 * dy);
    Some((
        Motion { parameters, covariance: Some(covariance), at, ..Motion::at_site(field, *used.first()?) },
        used.len(),
    ))
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
    let scatter = combinations.iter().map(|a| along(a, &spread)).sum::<f64>() * total / (n - 1.0).max(1.0);
    let factor = if is_exact { sharing / n } else { of_mean(scatter, (count, combinations.len()), sharing) };
    let of_each = if is_exact { spread } else { covariance };
    let motion = Motion {
        parameters: at_place(centre).into(),
        covariance: Some(carried(&of_each.map(|row| row.map(|value| factor * value)), step)),
        at: centre,
        ..Motion::at_site(field, *indices.first()?)
    };
    Some((motion, count))
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
