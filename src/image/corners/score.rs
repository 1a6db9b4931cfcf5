//! The corner score of every pixel, vectorised along rows and parallel over row bands.

use crate::error::{Error, Result};
use crate::image::{blocks::cover, blocks::load, blocks::store};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::types::Frame;

/// Side of the window that is usual for corners of single pixels, px (the default of OpenCV's
/// `goodFeaturesToTrack`).
pub const CORNER_WINDOW: usize = 3;

/// Largest accepted side of the window, px.
const MAX_WINDOW: usize = 31;

/// Smaller eigenvalue of the structure tensor of every pixel, (grey levels / px)^2, a frame of the same size:
/// `min eig mean_w (Ix^2, Ix Iy; Ix Iy, Iy^2)`, the mean over a square window of odd side `window` px.
///
/// `Ix`, `Iy` are Sobel's slopes: central differences smoothed 1-2-1 across. The border is replicated, that
/// of the slopes' products, too. Each result is a direct sum: a sample that is not finite makes the score NaN
/// in the windows whose slopes touch it, and in no other. Identical for any number of threads.
///
/// # Errors
/// [`Error::Argument`] unless `window` is odd, from 1 to 31.
///
/// Source: J. Shi, C. Tomasi, "Good features to track", CVPR 1994.
pub fn corner_score(frame: &Frame<f32>, window: usize) -> Result<Frame<f32>> {
    let mut score = Frame::default();
    corner_score_into(Level::detect(), frame, window, &mut score)?;
    Ok(score)
}

/// As [`corner_score`] at an instruction set, into a frame that is made anew only when it is of another size.
pub fn corner_score_into(level: Level, frame: &Frame<f32>, window: usize, score: &mut Frame<f32>) -> Result<()> {
    if window.is_multiple_of(2) || window > MAX_WINDOW {
        return Err(Error::argument("window", format!("an odd integer from 1 to {MAX_WINDOW}"), window));
    }
    let (width, height) = frame.size();
    if score.size() != (width, height) {
        *score = Frame::filled(width, height, 0.0);
    }
    if frame.data().is_empty() {
        return Ok(());
    }
    for_each_band(score.data_mut(), width, |_, rows, output| {
        dispatch(level, Band { frame, radius: window / 2, first_row: rows.start, output });
    });
    Ok(())
}

struct Band<'a> {
    frame: &'a Frame<f32>,
    radius: usize,
    first_row: usize,
    output: &'a mut [f32],
}

/// One row of the products `Ix^2, Ix Iy, Iy^2`, summed along the window.
type Products = [Vec<f32>; 3];

impl Kernel<f32> for Band<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(self) {
        if self.frame.width() < V::LANES { self.rows::<f32>() } else { self.rows::<V>() }
    }
}

impl Band<'_> {
    #[inline(always)]
    fn rows<V: Lanes<Scalar = f32>>(self) {
        let Self { frame, radius, first_row, output } = self;
        let (width, last_row) = (frame.width(), frame.height() as isize - 1);
        let side = 2 * radius + 1;
        let mut slopes = Slopes::new(width, radius);
        // The rows of products under the window, row `y` at `y mod side`.
        let mut ring: Vec<Products> = (0..side).map(|_| std::array::from_fn(|_| vec![0.0; width])).collect();
        let mut made = isize::MIN;
        for (offset, out) in output.chunks_exact_mut(width).enumerate() {
            let y = (first_row + offset) as isize;
            let clamp = |at: isize| at.clamp(0, last_row);
            let (first, last) = (clamp(y - radius as isize), clamp(y + radius as isize));
            for at in first.max(made.saturating_add(1))..=last {
                slopes.products::<V>(frame, at as usize, &mut ring[at as usize % side]);
            }
            made = last;
            let under = |at: usize| &ring[clamp(y + at as isize - radius as isize) as usize % side];
            let mean = V::splat(1.0 / (side * side) as f32);
            cover!(width, V, |x, N| {
                let mut sums = [[V::zero(); N]; 3];
                for at in 0..side {
                    let rows = under(at);
                    for k in 0..3 {
                        let values = load::<V, N>(&rows[k][x..]);
                        for i in 0..N {
                            sums[k][i] = sums[k][i] + values[i];
                        }
                    }
                }
                let mut score = [V::zero(); N];
                for i in 0..N {
                    score[i] = smaller_eigenvalue([sums[0][i], sums[1][i], sums[2][i]]) * mean;
                }
                store(&score, &mut out[x..]);
            });
        }
    }
}

/// `(a + c - sqrt((a - c)^2 + 4 b^2)) / 2` of the matrix `(a, b; b, c)`.
#[inline(always)]
fn smaller_eigenvalue<V: Lanes>([a, b, c]: [V; 3]) -> V {
    let (apart, twice) = (a - c, b + b);
    (a + c - apart.mul_add(apart, twice * twice).sqrt()) * V::constant(0.5)
}

struct Slopes {
    radius: usize,
    /// Smoothed 1-2-1 down, and the difference down, with one replicated sample at either end.
    smooth: Vec<f32>,
    difference: Vec<f32>,
    /// The products with `radius` replicated samples at either end.
    products: Products,
}

impl Slopes {
    fn new(width: usize, radius: usize) -> Self {
        let row = || vec![0.0; width + 2];
        Self {
            radius,
            smooth: row(),
            difference: row(),
            products: std::array::from_fn(|_| vec![0.0; width + 2 * radius]),
        }
    }

    /// The products of the slopes of row `y`, summed along the window.
    #[inline(always)]
    fn products<V: Lanes<Scalar = f32>>(&mut self, frame: &Frame<f32>, y: usize, out: &mut Products) {
        let (width, radius) = (frame.width(), self.radius);
        let (above, middle) = (frame.row(y.saturating_sub(1)), frame.row(y));
        let below = frame.row((y + 1).min(frame.height() - 1));
        cover!(width, V, |x, N| {
            let (a, m) = (load::<V, N>(&above[x..]), load::<V, N>(&middle[x..]));
            let b = load::<V, N>(&below[x..]);
            let (mut smooth, mut difference) = ([V::zero(); N], [V::zero(); N]);
            for i in 0..N {
                smooth[i] = m[i].mul_add(V::constant(2.0), a[i] + b[i]);
                // Zero times the middle: a bad sample there must not be overlooked.
                difference[i] = m[i].mul_add(V::zero(), b[i] - a[i]);
            }
            store(&smooth, &mut self.smooth[x + 1..]);
            store(&difference, &mut self.difference[x + 1..]);
        });
        replicate(&mut self.smooth, 1);
        replicate(&mut self.difference, 1);
        let [xx, xy, yy] = &mut self.products;
        cover!(width, V, |x, N| {
            let (left, right) = (load::<V, N>(&self.smooth[x..]), load::<V, N>(&self.smooth[x + 2..]));
            let (before, here) = (load::<V, N>(&self.difference[x..]), load::<V, N>(&self.difference[x + 1..]));
            let after = load::<V, N>(&self.difference[x + 2..]);
            let eighth = V::constant(0.125);
            let mut products = [[V::zero(); N]; 3];
            for i in 0..N {
                let gx = (right[i] - left[i]) * eighth;
                let gy = here[i].mul_add(V::constant(2.0), before[i] + after[i]) * eighth;
                (products[0][i], products[1][i], products[2][i]) = (gx * gx, gx * gy, gy * gy);
            }
            store(&products[0], &mut xx[radius + x..]);
            store(&products[1], &mut xy[radius + x..]);
            store(&products[2], &mut yy[radius + x..]);
        });
        for (products, out) in self.products.iter_mut().zip(out) {
            replicate(products, radius);
            cover!(width, V, |x, N| {
                let mut sum = load::<V, N>(&products[x..]);
                for k in 1..=2 * radius {
                    let values = load::<V, N>(&products[x + k..]);
                    for i in 0..N {
                        sum[i] = sum[i] + values[i];
                    }
                }
                store(&sum, &mut out[x..]);
            });
        }
    }
}

/// Fills `margin` samples at either end with the nearest inner one.
fn replicate(row: &mut [f32], margin: usize) {
    let end = row.len() - margin;
    let (first, last) = (row[margin], row[end - 1]);
    row[..margin].fill(first);
    row[end..].fill(last);
}
