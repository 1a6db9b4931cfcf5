//! Edge pixels, and the class of every pixel's gradient direction: (2), (3) and (5) of the paper.

use super::options::EdgeDisparityOptions;
use crate::image::gaussian_gradient;
use crate::parallel::for_each_band;
use crate::simd::Level;
use crate::types::Frame;

/// The class of a pixel without a direction.
pub const NO_CLASS: u8 = u8::MAX;

/// Gradients of one view, the class of their direction, and where its edges are.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeMap {
    /// Slope along x, grey levels/px: (2) of the stereo paper.
    pub gradient_x: Frame<f32>,
    /// Slope along y, grey levels/px: (3).
    pub gradient_y: Frame<f32>,
    /// Magnitude of the gradient, grey levels/px.
    pub magnitude: Frame<f32>,
    /// Class of the gradient's direction, 0 to n - 1, class 0 centred on the x axis, turning towards y: (5)
    /// with the sign kept; [`NO_CLASS`] below the threshold and where a sample in reach is not finite.
    pub class: Frame<u8>,
    /// Rows of the edge pixels, in row-major order.
    pub rows: Vec<u32>,
    /// Their columns.
    pub columns: Vec<u32>,
}

/// Settings of the edge detection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeSettings {
    /// Standard deviation of the Gaussian, px; cut off at four times that.
    pub blur_sigma: f64,
    /// Smallest magnitude with a direction, grey levels/px.
    pub threshold: f64,
    /// Classes over the whole turn.
    pub classes: usize,
}

impl EdgeSettings {
    /// The settings of matching options.
    pub(super) fn of(options: &EdgeDisparityOptions) -> Self {
        Self { blur_sigma: options.blur_sigma, threshold: options.threshold, classes: options.classes }
    }
}

impl EdgeMap {
    /// Edges of a view.
    ///
    /// An edge pixel has a class and is the greatest magnitude along its gradient: not less than one px back
    /// and more than one px ahead (bilinear), so that of two equal neighbours one remains. The outermost
    /// pixels have no neighbours and are none. Identical for any number of threads.
    pub fn new(view: &Frame<f32>, settings: &EdgeSettings) -> Self {
        let radius = (4.0 * settings.blur_sigma).round() as usize;
        let (gradient_x, gradient_y) = gaussian_gradient(Level::detect(), view, settings.blur_sigma, radius);
        let (width, height) = view.size();
        let mut magnitude = Frame::filled(width, height, 0.0f32);
        for_each_band(magnitude.data_mut(), width, |_, rows, band| {
            let pixels = rows.start * width..rows.start * width + band.len();
            let slopes = gradient_x.data()[pixels.clone()].iter().zip(&gradient_y.data()[pixels]);
            for (out, (x, y)) in band.iter_mut().zip(slopes) {
                *out = (x * x + y * y).sqrt();
            }
        });
        let mut class = Frame::filled(width, height, NO_CLASS);
        for_each_band(class.data_mut(), width, |_, rows, band| {
            let first = rows.start * width;
            for (i, out) in band.iter_mut().enumerate() {
                let at = first + i;
                if magnitude.data()[at] >= settings.threshold as f32 {
                    *out = direction_class(gradient_x.data()[at], gradient_y.data()[at], settings.classes);
                }
            }
        });
        let mut map = Self { gradient_x, gradient_y, magnitude, class, rows: Vec::new(), columns: Vec::new() };
        map.find_edges();
        map
    }

    /// How many edge pixels there are.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether the view has no edges.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Lists the edge pixels.
    fn find_edges(&mut self) {
        let (width, height) = self.magnitude.size();
        let mut is_edge = Frame::filled(width, height, false);
        for_each_band(is_edge.data_mut(), width, |_, rows, band| {
            for (y, row) in rows.zip(band.chunks_exact_mut(width)) {
                for (x, out) in row.iter_mut().enumerate() {
                    *out = self.is_greatest(x, y);
                }
            }
        });
        for y in 0..height {
            for (x, _) in is_edge.row(y).iter().enumerate().filter(|(_, edge)| **edge) {
                self.rows.push(y as u32);
                self.columns.push(x as u32);
            }
        }
    }

    /// Whether a pixel has a class and the greatest magnitude along its gradient.
    #[inline]
    fn is_greatest(&self, x: usize, y: usize) -> bool {
        let (width, height) = self.magnitude.size();
        if x == 0 || y == 0 || x + 1 >= width || y + 1 >= height || self.class.get(x, y) == NO_CLASS {
            return false;
        }
        let own = self.magnitude.get(x, y);
        let (dx, dy) = (self.gradient_x.get(x, y) / own, self.gradient_y.get(x, y) / own);
        let (x, y) = (x as f32, y as f32);
        own >= self.magnitude_at(x - dx, y - dy) && own > self.magnitude_at(x + dx, y + dy)
    }

    /// Magnitude between pixels, bilinear; at least 0 and at most one px from an inner pixel.
    #[inline]
    fn magnitude_at(&self, x: f32, y: f32) -> f32 {
        let (width, height) = self.magnitude.size();
        let (x0, y0) = ((x.max(0.0) as usize).min(width - 2), (y.max(0.0) as usize).min(height - 2));
        let (fx, fy) = (x - x0 as f32, y - y0 as f32);
        let at = y0 * width + x0;
        let data = self.magnitude.data();
        let upper = data[at] + fx * (data[at + 1] - data[at]);
        let lower = data[at + width] + fx * (data[at + width + 1] - data[at + width]);
        upper + fy * (lower - upper)
    }
}

/// (5): `floor((theta + 180 / n) / (360 / n)) mod n` degrees of the gradient's signed direction `theta`.
#[inline]
fn direction_class(x: f32, y: f32, classes: usize) -> u8 {
    let turns = y.atan2(x) / std::f32::consts::TAU;
    // From -1/2 to 1/2 turn: a turn more, and cutting off is rounding down.
    let class = ((turns + 1.0) * classes as f32 + 0.5) as u32;
    (class % classes as u32) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_keep_their_sign() {
        for k in 0..12 {
            for offset in [-14.0f64, 0.0, 14.0] {
                let angle = (30.0 * f64::from(k) + offset).to_radians();
                assert_eq!(direction_class(angle.cos() as f32, angle.sin() as f32, 12), k as u8);
            }
        }
    }
}
