//! Rows of pixels interpolated from planes on every second pixel.

use crate::flow::coarse_to_fine::{data_term::MOTION, planes::Planes};
use crate::simd::SimdReal;

/// Reads planes on the sites (every second pixel) at the pixels of a row; keeps its memory between rows.
#[derive(Debug)]
pub(in crate::flow::coarse_to_fine) struct RowReader<T> {
    /// The planes at the sites' columns of the row.
    sites: Vec<T>,
    /// The planes at every pixel of the row, one after the other.
    pixels: Vec<T>,
    width: usize,
}

impl<T: SimdReal> RowReader<T> {
    /// For frames `width` px wide.
    pub fn new(width: usize) -> Self {
        Self { sites: Vec::new(), pixels: Vec::new(), width }
    }

    /// Plane `k` along the row read last.
    pub fn plane(&self, k: usize) -> &[T] {
        &self.pixels[k * self.width..(k + 1) * self.width]
    }

    /// Reads row `y` of an affine motion: parabolas between sites, with values and slopes of both.
    #[inline(always)]
    pub fn read_motion(&mut self, motion: &Planes<T>, y: usize) {
        self.read(motion, y);
        let quarter = T::from_f64(0.25);
        let n = motion.width;
        if y % 2 == 1 {
            // The slopes along y: a quarter of their difference; beyond the last row, the whole slope.
            let (above, below) = (y / 2, y / 2 + 1);
            for c in 0..2 {
                let (first, flow) = (motion.line(4 + c, above), &mut self.sites[c * n..(c + 1) * n]);
                if below < motion.height {
                    for ((out, &a), &b) in flow.iter_mut().zip(first).zip(motion.line(4 + c, below)) {
                        *out += quarter * (a - b);
                    }
                } else {
                    flow.iter_mut().zip(first).for_each(|(out, &a)| *out += a);
                }
            }
        }
        for k in 0..MOTION {
            let slopes = if k < 2 { Some(&self.sites[(2 + k) * n..(3 + k) * n]) } else { None };
            widen(&self.sites[k * n..(k + 1) * n], slopes, &mut self.pixels[k * self.width..(k + 1) * self.width]);
        }
    }

    /// The means of the rows of sites around `y`.
    #[inline(always)]
    fn read(&mut self, planes: &Planes<T>, y: usize) {
        let zero = T::from_f64(0.0);
        self.sites.clear();
        self.pixels.resize(planes.count * self.width, zero);
        let (above, below) = (y / 2, (y / 2 + y % 2).min(planes.height - 1));
        let half = T::from_f64(0.5);
        for k in 0..planes.count {
            let (a, b) = (planes.line(k, above), planes.line(k, below));
            self.sites.extend(a.iter().zip(b).map(|(&a, &b)| half * (a + b)));
        }
    }
}

/// Pixels of a row from its sites: linear, or with slopes a parabola.
#[inline(always)]
fn widen<T: SimdReal>(sites: &[T], slopes: Option<&[T]>, pixels: &mut [T]) {
    let (half, quarter) = (T::from_f64(0.5), T::from_f64(0.25));
    let last = sites.len() - 1;
    let (inner, rim) = pixels.split_at_mut((2 * last).min(pixels.len()));
    let (here, next) = (&sites[..last], &sites[1..]);
    match slopes {
        None => {
            for ((pair, &a), &b) in inner.chunks_exact_mut(2).zip(here).zip(next) {
                (pair[0], pair[1]) = (a, half * (a + b));
            }
        }
        Some(slopes) => {
            let slopes = slopes[..last].iter().zip(&slopes[1..]);
            for (((pair, &a), &b), (&p, &q)) in inner.chunks_exact_mut(2).zip(here).zip(next).zip(slopes) {
                (pair[0], pair[1]) = (a, half * (a + b) + quarter * (p - q));
            }
        }
    }
    // The last site, and its extrapolation to the pixel after it.
    let beyond = slopes.map_or(sites[last], |slopes| sites[last] + slopes[last]);
    for (pixel, value) in rim.iter_mut().zip([sites[last], beyond]) {
        *pixel = value;
    }
}
