//! Numbered regions, and means over them.

use crate::error::{Error, Result};
use crate::math::Real;

/// Regions of an image: a number for every pixel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Region of every pixel, row-major: 0 to `count - 1`, numbered in the order of their first pixels.
    pub labels: Vec<i32>,
    /// Number of regions.
    pub count: usize,
}

impl Labels {
    /// Numbers the regions of a forest whose pixels know their root.
    pub(super) fn of_roots(width: usize, height: usize, mut root: impl FnMut(u32) -> u32) -> Self {
        const NONE: i32 = -1;
        let pixels = width * height;
        let mut numbers = vec![NONE; pixels];
        let mut count = 0;
        let number = |pixel| {
            let number = &mut numbers[root(pixel) as usize];
            if *number == NONE {
                *number = count;
                count += 1;
            }
            *number
        };
        let labels = (0..pixels as u32).map(number).collect();
        Self { width, height, labels, count: count as usize }
    }
}

/// Mean of each region, per channel: `count * channels` numbers, region by region.
///
/// `labels`: region of every pixel, each 0 to `count - 1`. `values`: `channels` numbers a pixel, interleaved.
/// NaN is left out of the mean, channel by channel; a region without a number gets NaN. Sums are taken in
/// double precision, in the order of the pixels.
///
/// # Errors
/// [`Error::Argument`] unless `values` holds `channels` numbers a label, and each label is within range.
pub fn region_means<T: Real>(labels: &[i32], count: usize, values: &[T], channels: usize) -> Result<Vec<f64>> {
    if labels.len().checked_mul(channels) != Some(values.len()) {
        let expected = format!("{channels} x {} numbers, one set a label", labels.len());
        return Err(Error::argument("values", expected, format!("{} numbers", values.len())));
    }
    if let Some(wrong) = labels.iter().find(|&&label| label < 0 || label as usize >= count) {
        return Err(Error::argument("labels", format!("0 to {}", count as i64 - 1), wrong));
    }
    let mut sums: Vec<(f64, u32)> = Vec::new();
    let bytes = count.checked_mul(channels).and_then(|n| n.checked_mul(size_of::<(f64, u32)>()));
    if bytes.is_none() || sums.try_reserve_exact(count * channels).is_err() {
        return Err(Error::memory("labels", bytes));
    }
    sums.resize(count * channels, (0.0, 0));
    if channels > 0 {
        for (&label, values) in labels.iter().zip(values.chunks_exact(channels)) {
            let sums = &mut sums[label as usize * channels..][..channels];
            for ((sum, number), value) in sums.iter_mut().zip(values) {
                let value = value.to_f64();
                if !value.is_nan() {
                    *sum += value;
                    *number += 1;
                }
            }
        }
    }
    // 0 / 0 is NaN: a region without a number has no mean.
    Ok(sums.into_iter().map(|(sum, number)| sum / f64::from(number)).collect())
}
