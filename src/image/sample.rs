//! Brightness between the pixels and beyond the edge of an image.

use crate::math::Real;
use crate::types::Frame;

/// How an image continues beyond its edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Border {
    /// Mirrored about the last pixel's side: `d c b a | a b c d | d c b a` (scipy's `reflect`).
    #[default]
    Reflect,
    /// The last pixel repeated: `a a a a | a b c d | d d d d` (scipy's `nearest`).
    Replicate,
    /// Periodic: `a b c d | a b c d | a b c d` (scipy's `wrap`).
    Wrap,
}

impl Border {
    /// The sample inside `0..len` that stands for position `index`, however far outside it is.
    ///
    /// `len` must not be 0.
    #[inline]
    pub fn index(self, index: isize, len: usize) -> usize {
        let n = len as isize;
        if (0..n).contains(&index) {
            return index as usize;
        }
        let inside = match self {
            Self::Replicate => index.clamp(0, n - 1),
            Self::Wrap => index.rem_euclid(n),
            Self::Reflect => {
                let folded = index.rem_euclid(2 * n);
                if folded < n { folded } else { 2 * n - 1 - folded }
            }
        };
        inside as usize
    }
}

/// How brightness is read between pixel centres, which lie at integer coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// From the four nearest pixels: continuous, exact for brightness that is linear in x and in y.
    Bilinear,
    /// From the sixteen nearest pixels by cubic convolution with a = -1/2 (R. Keys, "Cubic convolution
    /// interpolation for digital image processing", 1981): continuous slope, exact for quadratics. The
    /// default.
    #[default]
    Bicubic,
}

impl Interpolation {
    /// Brightness of `frame` at `(x, y)` px; NaN where a pixel it needs is outside the frame or NaN.
    ///
    /// At integer coordinates the pixel itself is returned: neighbours of weight zero are not needed.
    pub fn at<T: Real>(self, frame: &Frame<T>, x: f64, y: f64) -> T {
        let (Some((x0, fx)), Some((y0, fy))) = (split(x, frame.width()), split(y, frame.height())) else {
            return T::nan();
        };
        let (wx, wy) = (self.weights(fx), self.weights(fy));
        let mut sum = 0.0;
        for (j, &b) in wy.iter().enumerate().filter(|(_, w)| **w != 0.0) {
            for (i, &a) in wx.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                let (px, py) = ((x0 + i).wrapping_sub(1), (y0 + j).wrapping_sub(1));
                if px >= frame.width() || py >= frame.height() {
                    return T::nan();
                }
                sum += a * b * frame.get(px, py).to_f64();
            }
        }
        T::from_f64(sum)
    }

    /// Weights of the pixels at -1, 0, 1, 2 for a position `f` in [0, 1) past pixel 0.
    pub(crate) fn weights(self, f: f64) -> [f64; 4] {
        match self {
            Self::Bilinear => [0.0, 1.0 - f, f, 0.0],
            Self::Bicubic => [
                ((-0.5 * f + 1.0) * f - 0.5) * f,
                (1.5 * f - 2.5) * f * f + 1.0,
                ((-1.5 * f + 2.0) * f + 0.5) * f,
                (0.5 * f - 0.5) * f * f,
            ],
        }
    }
}

/// Brightness at `(x, y)` px by the polynomials of degree 5 through six pixels along each axis; beyond the
/// border its pixels go on. NaN where one of these pixels is NaN. The frame must not be empty.
pub fn lagrange_at<T: Real>(frame: &Frame<T>, x: f64, y: f64) -> T {
    let ((left, along), (top, down)) = (lagrange_weights(x), lagrange_weights(y));
    let inside = |at: isize, size: usize| at.clamp(0, size as isize - 1) as usize;
    let mut sum = 0.0;
    for (j, weight) in down.iter().enumerate() {
        let row = frame.row(inside(top + j as isize, frame.height()));
        let values: [T; 6] = match usize::try_from(left).ok().and_then(|left| row.get(left..left + 6)) {
            Some(values) => std::array::from_fn(|i| values[i]),
            None => std::array::from_fn(|i| row[inside(left + i as isize, row.len())]),
        };
        sum += weight * (0..6).map(|i| along[i] * values[i].to_f64()).sum::<f64>();
    }
    T::from_f64(sum)
}

/// The first of the six pixels around a position, and their weights.
fn lagrange_weights(position: f64) -> (isize, [f64; 6]) {
    let whole = position as isize;
    let whole = if whole as f64 > position { whole - 1 } else { whole };
    let distance = |i: usize| position - (whole - 2 + i as isize) as f64;
    // The products of a pixel's distances from the others, inverse.
    let mut weights = [-120.0, 24.0, -12.0, 12.0, -24.0, 120.0].map(|product: f64| 1.0 / product);
    let (mut before, mut after) = (1.0, 1.0);
    for i in 0..6 {
        weights[i] *= before;
        weights[5 - i] *= after;
        before *= distance(i);
        after *= distance(5 - i);
    }
    (whole - 2, weights)
}

/// The pixel at or before `position` and the rest; `None` outside `0..=len - 1` and for NaN.
fn split(position: f64, len: usize) -> Option<(usize, f64)> {
    if !(position >= 0.0 && position <= len as f64 - 1.0) {
        return None;
    }
    let whole = position.floor();
    Some((whole as usize, position - whole))
}
