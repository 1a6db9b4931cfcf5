//! A picture between its pixels: moved by fractions of one, by cubic convolution (R. Keys, 1981), and the
//! range of its brightness around each pixel.

use crate::image::Interpolation;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::types::Frame;

/// A frame read at `(x + shift, y + shift)` by cubic convolution; NaN where a tap is outside the frame.
pub(super) fn shifted(frame: &Frame<f64>, shift: [f64; 2]) -> Frame<f64> {
    if shift == [0.0; 2] {
        return frame.clone();
    }
    let (width, height) = frame.size();
    Frame::new(width, height, shifted_into(Vec::new(), frame, shift)).unwrap_or_default()
}

pub(super) fn shifted_into(mut memory: Vec<f64>, frame: &Frame<f64>, shift: [f64; 2]) -> Vec<f64> {
    memory.clear();
    memory.resize(frame.data().len(), f64::NAN);
    dispatch(Level::detect(), Shift { frame, taps: shift.map(Taps::of), out: &mut memory });
    memory
}

/// Rows are read along x once each, as they are needed, and their sum along y goes to the output.
struct Shift<'a> {
    frame: &'a Frame<f64>,
    taps: [Taps; 2],
    out: &'a mut [f64],
}

impl Kernel<f64> for Shift<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        let (width, height) = self.frame.size();
        let [across, down] = &self.taps;
        let (columns, rows) = (across.range(width), down.range(height));
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        // Rows read along x, each in the line of its index modulo the number of taps.
        let mut lines = [0; TAPS].map(|_| vec![0.0; columns.len()]);
        let mut next = down.from(rows.start, down.first());
        for y in rows {
            while next <= down.from(y, down.last()) {
                let source = self.frame.row(next);
                across.add(&mut lines[next % TAPS], |k| &source[across.from(columns.start, k)..]);
                next += 1;
            }
            let out = &mut self.out[y * width..][columns.clone()];
            down.add(out, |k| &lines[down.from(y, k) % TAPS]);
        }
    }
}

/// Pixels that cubic convolution reads along an axis.
const TAPS: usize = 4;

/// Taps of a shift along one axis; those of weight zero are not needed.
struct Taps {
    whole: isize,
    weights: Vec<(usize, f64)>,
}

impl Taps {
    fn of(shift: f64) -> Self {
        let weights = Interpolation::Bicubic.weights(shift - shift.floor());
        let weights = weights.into_iter().enumerate().filter(|(_, w)| *w != 0.0).collect();
        Self { whole: shift.floor() as isize - 1, weights }
    }

    fn first(&self) -> usize {
        self.weights.first().map_or(0, |tap| tap.0)
    }

    fn last(&self) -> usize {
        self.weights.last().map_or(0, |tap| tap.0)
    }

    fn range(&self, length: usize) -> std::ops::Range<usize> {
        let length = length as isize;
        let first = (-self.whole - self.first() as isize).clamp(0, length);
        let end = (length - self.whole - self.last() as isize).clamp(first, length);
        first as usize..end as usize
    }

    fn from(&self, at: usize, k: usize) -> usize {
        (at as isize + self.whole + k as isize).max(0) as usize
    }

    #[inline(always)]
    fn add<'a>(&self, target: &mut [f64], row: impl Fn(usize) -> &'a [f64]) {
        if let [(a, wa), (b, wb), (c, wc), (d, wd)] = self.weights[..] {
            let pairs = row(a).iter().zip(row(b)).zip(row(c)).zip(row(d));
            for (t, (((a, b), c), d)) in target.iter_mut().zip(pairs) {
                *t = wa * a + wb * b + wc * c + wd * d;
            }
            return;
        }
        target.fill(0.0);
        for &(k, w) in &self.weights {
            target.iter_mut().zip(row(k)).for_each(|(t, e)| *t += w * e);
        }
    }
}

/// Brightness range within half a pixel: displacements are whole pixels, true motions are not.
pub(super) fn half_a_pixel_around(frame: &Frame<f64>) -> Frame<[f64; 2]> {
    let (width, height) = frame.size();
    Frame::from_fn(width, height, |x, y| {
        let own = frame.get(x, y);
        let columns = [x.saturating_sub(1), (x + 1).min(width - 1)].map(|i| frame.get(i, y));
        let rows = [y.saturating_sub(1), (y + 1).min(height - 1)].map(|j| frame.get(x, j));
        columns.into_iter().chain(rows).fold([own; 2], |[low, high], beside| {
            let half = 0.5 * (own + beside);
            [low.min(half), high.max(half)]
        })
    })
}
