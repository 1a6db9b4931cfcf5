//! What a target looks like: banded colour histograms of its first box, compared with those of other boxes.

use super::bins::{BINS, NO_BIN};
use super::geometry::{CentredBox, visible_share};
use crate::types::Frame;

/// Bands of a box, from top to bottom.
const BANDS: usize = 8;
/// Neighbouring bands that are compared together.
const WINDOW: usize = 3;
/// Bands of boxes too low for eight.
const MIN_BANDS: usize = 3;

/// Pixel columns `[left, right)` and edges of the bands of a box, not yet cut to the picture.
pub(super) struct BandGrid {
    pub columns: [i64; 2],
    /// Rows at which the bands begin, and the end of the last.
    pub edges: [i64; BANDS + 1],
    pub bands: usize,
}

impl BandGrid {
    /// The grid of a box with this many bands.
    #[inline]
    pub fn new([x, y, w, h]: CentredBox, bands: usize) -> Self {
        let first = |value: f64| (value + 0.5).floor() as i64;
        let mut edges = [0; BANDS + 1];
        for (j, edge) in edges.iter_mut().enumerate().take(bands + 1) {
            *edge = first(y - h / 2.0 + h * j as f64 / bands as f64);
        }
        Self { columns: [first(x - w / 2.0), first(x + w / 2.0)], edges, bands }
    }

    /// The rows of each window of three bands.
    #[inline]
    pub fn windows(&self) -> impl Iterator<Item = [i64; 2]> + '_ {
        (0..=self.bands - WINDOW).map(|j| [self.edges[j], self.edges[j + WINDOW]])
    }
}

/// Reference histograms of a target over the bins that occur in them.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Appearance {
    /// Number of bands, 8 unless the first box has fewer rows.
    pub bands: usize,
    /// The slot of each bin, `NO_BIN` for those that do not occur.
    pub slots: Vec<u8>,
    /// Number of slots.
    pub used: usize,
    /// Share of each slot in each window: window by window, `used` values each.
    pub reference: Vec<f32>,
    /// Weight of each slot in each window, likewise.
    pub weights: Vec<f32>,
}

impl Appearance {
    /// Learns the colours of a box. `contrast`: bins that are frequent around the box, too, count less.
    pub fn learn(bins: &Frame<u8>, bounds: CentredBox, contrast: bool) -> Self {
        let bands = if bounds[3] < BANDS as f64 { MIN_BANDS.max(bounds[3] as usize) } else { BANDS };
        let [x, y, w, h] = bounds;
        let own = histograms(bins, &BandGrid::new(bounds, bands));
        let wide = histograms(bins, &BandGrid::new([x, y, 2.0 * w, h], bands));
        let mut slots = vec![NO_BIN; BINS];
        let mut used = Vec::new();
        for bin in 0..BINS {
            if own.iter().any(|window| window[bin] > 0.0) {
                slots[bin] = used.len() as u8;
                used.push(bin);
            }
        }
        let (mut reference, mut weights) = (Vec::new(), Vec::new());
        for (own, wide) in own.iter().zip(&wide) {
            let weight = |bin: usize| {
                let ring = (2.0 * wide[bin] - own[bin]).max(0.0);
                if own[bin] > 0.0 { own[bin] / (own[bin] + ring) } else { 0.0 }
            };
            let total: f64 = used.iter().map(|&bin| weight(bin) * own[bin]).sum();
            for &bin in &used {
                reference.push(own[bin] as f32);
                weights.push(if contrast && total > 0.0 { (weight(bin) / total) as f32 } else { 1.0 });
            }
        }
        Self { bands, slots, used: used.len(), reference, weights }
    }

    /// Windows of three bands.
    pub fn windows(&self) -> usize {
        self.bands + 1 - WINDOW
    }

    /// Similarity of another target's reference to this one, 0 to 1.
    pub fn likeness(&self, other: &Self) -> f64 {
        if self.bands != other.bands {
            return 0.0;
        }
        let mut sum = 0.0;
        for window in 0..self.windows() {
            for (bin, &slot) in self.slots.iter().enumerate() {
                let theirs = other.slots[bin];
                if slot != NO_BIN && theirs != NO_BIN {
                    let at = window * self.used + slot as usize;
                    let share = other.reference[window * other.used + theirs as usize];
                    sum += f64::from(self.weights[at] * self.reference[at].min(share));
                }
            }
        }
        sum / self.windows() as f64
    }

    /// Similarity of the colours in a box to the reference, counted pixel by pixel; 0 to 1.
    pub fn similarity(&self, bins: &Frame<u8>, bounds: CentredBox) -> f64 {
        let shown = histograms(bins, &BandGrid::new(bounds, self.bands));
        let mut sum = 0.0;
        for (window, shown) in shown.iter().enumerate() {
            for (bin, &slot) in self.slots.iter().enumerate().filter(|(_, slot)| **slot != NO_BIN) {
                let at = window * self.used + slot as usize;
                sum += f64::from(self.weights[at]) * f64::from(self.reference[at]).min(shown[bin]);
            }
        }
        sum / self.windows() as f64 * visibility_factor(bounds, bins.size())
    }
}

/// Boxes of which less than half is in the picture are less similar.
#[inline]
pub(super) fn visibility_factor(bounds: CentredBox, size: (usize, usize)) -> f64 {
    if !crate::ablation::keeps("particle.visible_share") {
        return 1.0;
    }
    (2.0 * visible_share(bounds, size)).min(1.0)
}

/// Relative frequency of each bin in each window of a grid; zero where no pixel is counted.
fn histograms(bins: &Frame<u8>, grid: &BandGrid) -> Vec<Vec<f64>> {
    let (width, height) = bins.size();
    let clip = |[low, high]: [i64; 2], size: usize| {
        let low = low.clamp(0, size as i64) as usize;
        low..(high.clamp(0, size as i64) as usize).max(low)
    };
    let columns = clip(grid.columns, width);
    grid.windows()
        .map(|rows| {
            let mut counts = vec![0u32; usize::from(NO_BIN) + 1];
            for y in clip(rows, height) {
                for &bin in &bins.row(y)[columns.clone()] {
                    counts[usize::from(bin)] += 1;
                }
            }
            let total: u32 = counts[..BINS].iter().sum();
            counts[..BINS].iter().map(|&count| f64::from(count) / f64::from(total.max(1))).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn striped() -> Frame<u8> {
        Frame::from_fn(60, 60, |x, y| if (20..40).contains(&x) { (y / 6) as u8 } else { 50 })
    }

    #[test]
    fn a_box_is_like_itself_and_unlike_others() {
        for contrast in [false, true] {
            let bins = striped();
            let bounds = [29.5, 29.5, 20.0, 48.0];
            let appearance = Appearance::learn(&bins, bounds, contrast);
            assert!((appearance.similarity(&bins, bounds) - 1.0).abs() < 1e-6);
            assert!((appearance.likeness(&appearance) - 1.0).abs() < 1e-6);
            assert_eq!(appearance.similarity(&bins, [9.5, 29.5, 20.0, 48.0]), 0.0);
            let half = appearance.similarity(&bins, [39.5, 29.5, 20.0, 48.0]);
            assert!((half - 0.5).abs() < 0.06, "{half}");
        }
    }
}
