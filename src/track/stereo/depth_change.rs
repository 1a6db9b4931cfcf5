//! Motion in depth at edge pixels: the disparity at the moved pixels less that at the pixels themselves.

use crate::math::{geman_mcclure, median, robust_std};
use crate::types::Frame;

/// Largest distance of the nearest edge pixel, px.
const MAX_NEIGHBOUR_DISTANCE: f64 = 1.0;
/// Floor of the standard deviation, disparity.
const MIN_DISPARITY_STD: f64 = 0.03;
/// Iterations of the weighted mean.
const ROUNDS: usize = 5;

/// The disparity of the pixel of `map` nearest to `(x, y)`, at most one pixel away.
pub(super) fn nearest(map: &Frame<f32>, x: f64, y: f64) -> Option<f64> {
    let (width, height) = (map.width() as i64, map.height() as i64);
    let (column, row) = (x.round() as i64, y.round() as i64);
    let mut best: Option<(f64, f64)> = None;
    for j in (row - 1).max(0)..=(row + 1).min(height - 1) {
        for i in (column - 1).max(0)..=(column + 1).min(width - 1) {
            let value = map.get(i as usize, j as usize);
            let distance = (i as f64 - x).powi(2) + (j as f64 - y).powi(2);
            if value.is_finite()
                && distance <= MAX_NEIGHBOUR_DISTANCE * MAX_NEIGHBOUR_DISTANCE
                && best.is_none_or(|(least, _)| distance < least)
            {
                best = Some((distance, f64::from(value)));
            }
        }
    }
    best.map(|(_, value)| value)
}

/// Mean of numbers among outliers: from the median, weights `1 / (1 + (e / 2 s)^2)^2`. `None` of fewer than
/// three.
pub(super) fn robust_mean(values: &mut [f64]) -> Option<f64> {
    if values.len() < 3 {
        return None;
    }
    let mut mean = median(values)?;
    let mut sizes: Vec<f64> = values.iter().map(|value| (value - mean).abs()).collect();
    let deviation = robust_std(&mut sizes)?.max(MIN_DISPARITY_STD);
    for _ in 0..ROUNDS {
        let (mut sum, mut weights) = (0.0, 0.0);
        for value in &*values {
            let weight = geman_mcclure(value - mean, 2.0 * deviation);
            sum += weight * value;
            weights += weight;
        }
        mean = sum / weights;
    }
    mean.is_finite().then_some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_within_a_pixel_counts() {
        let mut map = Frame::filled(5, 5, f32::NAN);
        map.row_mut(2)[2] = 7.0;
        map.row_mut(2)[3] = 9.0;
        assert_eq!((nearest(&map, 2.4, 2.0), nearest(&map, 2.6, 2.1)), (Some(7.0), Some(9.0)));
        assert_eq!((nearest(&map, 1.2, 2.0), nearest(&map, 0.9, 2.0)), (Some(7.0), None));
        assert_eq!((nearest(&map, -7.0, 2.0), nearest(&map, 2.0, 99.0)), (None, None));
    }
}
