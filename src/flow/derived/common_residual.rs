//! What residuals of a fit have in common over parts of its region.

use super::{Motion, sharing::sharing_among};
use crate::math::Real;
use crate::types::FlowField;

/// Parts of a region along an axis whose residuals are compared.
const STRIPS: usize = 4;
/// Deviations of the squares of the parts' residuals that are taken for chance.
const CHANCE: f64 = 2.0;
/// Variance that an affine motion takes from two motions that meet in the middle of a region, over the
/// variance it leaves: 3 for a step, some 15 for one that the field smooths (`benchmarks/tables/limits.py`).
const TAKEN: f64 = 15.0;

/// Covariance, about `centre`, that a fit gets from residuals which are not independent over the region.
///
/// The residuals of the flow of all sites that may follow the motion, weighted by the inverse variance, are
/// averaged over `STRIPS` parts of the region along x, and along y. What their squares exceed those of
/// residuals without structure by (analysis of variance) belongs to a motion that the fit does not hold, and
/// of which it took `TAKEN` times as much: as an error of the flow in the middle of the sites, and of its
/// change along that axis.
pub(super) fn common_residual<T: Real>(
    field: &FlowField<T>,
    used: &[usize],
    (centre, motion): ((f64, f64), &[f64; 6]),
    floors: &[f64; 6],
) -> [[f64; 6]; 6] {
    let pitch = [field.layout.units.pixel_pitch.0, field.layout.units.pixel_pitch.1];
    let places: Vec<[usize; 2]> = used
        .iter()
        .map(|&site| field.layout.sites.pixel(site % field.width, site / field.width))
        .map(|(x, y)| [x, y])
        .collect();
    let offset = |place: &[usize; 2], axis: usize| (place[axis] as f64 - [centre.0, centre.1][axis]) * pitch[axis];
    let sharing = sharing_among(&field.layout, field.width, used);
    let by_chance = STRIPS as f64 * (1.0 + CHANCE * (2.0 / STRIPS as f64).sqrt()) * sharing;
    let mut covariance = [[0.0; 6]; 6];
    for component in 0..2 {
        let floor = floors[component];
        // The weight and the residual of each site.
        let residuals: Vec<(f64, f64)> = used
            .iter()
            .zip(&places)
            .map(|(&site, place)| {
                let estimate = Motion::at_site(field, site);
                let variance = estimate.covariance.map_or(f64::INFINITY, |c| c[component][component] + floor);
                let change = |axis: usize| motion[2 + 2 * axis + component] * offset(place, axis);
                (1.0 / variance, estimate.parameters[component] - (motion[component] + change(0) + change(1)))
            })
            .collect();
        let square: f64 = residuals.iter().map(|(weight, residual)| weight * residual * residual).sum();
        let total: f64 = residuals.iter().map(|(weight, _)| weight).sum();
        for axis in 0..2 {
            let (first, last) = places.iter().fold((usize::MAX, 0), |(a, b), p| (a.min(p[axis]), b.max(p[axis])));
            let mut strips = [(0.0, 0.0); STRIPS];
            let (mut sum, mut square_of_place) = (0.0, 0.0);
            for (&(weight, residual), place) in residuals.iter().zip(&places) {
                let strip = &mut strips[STRIPS * (place[axis] - first) / (last - first + 1)];
                *strip = (strip.0 + weight, strip.1 + weight * residual);
                sum += weight * offset(place, axis);
                square_of_place += weight * offset(place, axis).powi(2);
            }
            let between: f64 =
                strips.iter().filter(|strip| strip.0 > 0.0).map(|(weight, sum)| sum * sum / weight).sum();
            let taken = TAKEN * (between - by_chance * (square - between) / used.len() as f64);
            if taken > 0.0 {
                // From the middle of the sites to the centre the change counts, too.
                let (middle, slope) = (sum / total, taken / (square_of_place - sum * sum / total));
                let change = 2 + 2 * axis + component;
                covariance[component][component] += taken / total + middle * middle * slope;
                covariance[component][change] -= middle * slope;
                covariance[change][component] -= middle * slope;
                covariance[change][change] += slope;
            }
        }
    }
    covariance
}
