//! Planes of the biases: what truncation, and flow that is not affine, leave in the equations of each pixel,
//! to be summed over windows.
//!
//! The window's one affine motion `T_p m` is not the motion at its pixel p. By how much that draws the
//! estimate aside can be seen from the estimates themselves: with the motion found at p in place of the one
//! that is sought, `N^-1 sum w T^T P^T P m(p)` is what the window makes of the whole field, and its
//! difference to m is to leading order the bias. The rows of second derivatives see the curvature of the flow
//! directly, `d_x^2 (u i_x + v i_y)` contains `u_xx i_x + v_xx i_y`, and smoothing by s px adds `s^2 / 2`
//! times its Laplacian.

use super::estimate::Strip;
use super::jet_matrix::columns;
use super::tile::{JetTile, Planes, Source, padded};
use super::truncation::{DERIVATIVES, DIFFERENCED, MIXED, Truncation, residual};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};

/// Planes of a tile: `P^T r` for the six unknowns, `P^T P m` for the six, then `r^T r`.
pub(super) const PLANES: usize = 13;
/// Moments of one score, `sum w T^T` of six such planes.
pub(super) const SCORE: usize = 10;
/// Highest power of an offset for plane p, and where its moments begin: three each of a score's first two
/// planes, one each of the others.
pub(super) const fn place(p: usize) -> (usize, usize) {
    match (p / 6, p % 6) {
        (score @ 0..2, k @ 0..2) => (1, score * SCORE + 3 * k),
        (score @ 0..2, k) => (0, score * SCORE + 4 + k),
        _ => (0, 2 * SCORE + p - 12),
    }
}

/// Rows of the ring for one row of pixels: the coefficients' jet, that of the first difference, the usable
/// pixels, and the motion.
const SLOT: usize = 19;
/// Where the usable pixels and the motion stand among them.
const USABLE: usize = 12;
const MOTION: usize = 13;

/// Rows of jets and motion that differences are taken of.
pub(super) struct Ring<T> {
    /// Three slots.
    rows: Vec<T>,
}

impl<T: SimdReal> Ring<T> {
    pub fn new() -> Self {
        Self { rows: Vec::new() }
    }

    /// Fills the first [`PLANES`] of `planes`, whose corner lies at pixel `corner`, for `rows` equations a
    /// pixel.
    pub fn fill(
        &mut self,
        (level, rows): (Level, usize),
        truncation: &Truncation,
        (source, strip): (&Source<'_, T>, &Strip<T>),
        jets: &mut JetTile<T>,
        (corner, scale): ((isize, isize), f64),
        planes: &mut Planes<T>,
    ) {
        let wide = padded(planes.width + 2);
        jets.load(source, (corner.0 - 1, corner.1 - 1), wide, planes.height + 2);
        self.rows.resize(3 * SLOT * wide, T::default());
        for r in 0..planes.height + 2 {
            jets.row(level, source, r);
            let slot = &mut self.rows[r % 3 * SLOT * wide..(r % 3 + 1) * SLOT * wide];
            dispatch(level, Keep { jets, wide, slot });
            strip.motion_row(corner.0 - 1, corner.1 + r as isize - 1, scale, &mut slot[MOTION * wide..]);
            if r < 2 {
                continue;
            }
            let around: [&[T]; 3] = std::array::from_fn(|k| {
                let slot = (r + 1 + k) % 3;
                &self.rows[slot * SLOT * wide..(slot + 1) * SLOT * wide]
            });
            let row = Row { truncation, around, wide, planes, at: r - 2, scale };
            match rows {
                1 => dispatch(level, Residual::<T, 1, 1>(row)),
                3 => dispatch(level, Residual::<T, 3, 1>(row)),
                6 => dispatch(level, Residual::<T, 6, 1>(row)),
                _ => dispatch(level, Residual::<T, 6, 2>(row)),
            }
        }
    }
}

/// Copies the jets of a row and which of its pixels are usable.
struct Keep<'a, T> {
    jets: &'a JetTile<T>,
    wide: usize,
    slot: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Keep<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { jets, wide, slot } = self;
        let mut c = 0;
        while c < wide {
            let j = jets.jets::<V>(c, false);
            for (k, value) in j.coefficient.into_iter().chain(j.first).enumerate() {
                value.store(&mut slot[k * wide + c..]);
            }
            c += V::LANES;
        }
        slot[USABLE * wide..(USABLE + 1) * wide].copy_from_slice(jets.weight());
    }
}

/// One row of a tile.
struct Row<'a, T> {
    truncation: &'a Truncation,
    around: [&'a [T]; 3],
    wide: usize,
    planes: &'a mut Planes<T>,
    at: usize,
    scale: f64,
}

/// The motion at a pixel and its curvature.
struct Bent<V> {
    /// The motion, with what smoothing makes of its Laplacian.
    motion: [V; 6],
    /// Second derivatives xx, xy, yy of u, then of v.
    second: [[V; 3]; 2],
    /// Derivatives of the strain `u_x, u_y + v_x, v_y` along x and y, times the variance of the smoothing.
    strain: [[V; 3]; 2],
}

impl<V: Lanes> Bent<V> {
    /// From the motion at the pixel and around it, for brightness smoothed with this variance.
    #[inline(always)]
    fn new(at: &impl Fn(usize, isize, isize) -> V, smoothing: f64) -> Self {
        let half = V::constant(0.5);
        let along_x = |k: usize| (at(MOTION + k, 1, 0) - at(MOTION + k, -1, 0)) * half;
        let along_y = |k: usize| (at(MOTION + k, 0, 1) - at(MOTION + k, 0, -1)) * half;
        let second = [0, 1].map(|i| [along_x(2 + i), (along_y(2 + i) + along_x(4 + i)) * half, along_y(4 + i)]);
        let [u, v] = second;
        let variance = V::constant(smoothing);
        let strain = [0, 1].map(|i| [u[i] * variance, (u[i + 1] + v[i]) * variance, v[i + 1] * variance]);
        let motion = std::array::from_fn(|k| {
            let centre = at(MOTION + k, 0, 0);
            let (x, y) = (at(MOTION + k, 1, 0) + at(MOTION + k, -1, 0), at(MOTION + k, 0, 1) + at(MOTION + k, 0, -1));
            (x + y - centre * V::constant(4.0)).mul_add(V::constant(0.5 * smoothing), centre)
        });
        Self { motion, second, strain }
    }

    /// `P m` and the share of the curvature in row k, of these columns, jet and third derivatives of the
    /// image.
    #[inline(always)]
    fn rate(&self, p: &[[V; 6]; 6], jet: &[V; 6], third: &[V], k: usize) -> V {
        let mut rate = V::zero();
        for (column, m) in p.iter().zip(&self.motion) {
            rate = column[k].mul_add(*m, rate);
        }
        if k >= 3 {
            for (second, slope) in self.second.iter().zip(&jet[1..]) {
                rate = second[k - 3].mul_add(*slope, rate);
            }
        }
        let [x, y] = &self.strain;
        match k {
            0 => rate,
            1 => dot(x, &jet[3..], rate),
            2 => dot(y, &jet[3..], rate),
            3 => dot(x, third, dot(x, third, rate)),
            4 => dot(x, &third[1..], dot(y, third, rate)),
            _ => dot(y, &third[1..], dot(y, &third[1..], rate)),
        }
    }
}

/// `a . b + start` for the first three.
#[inline(always)]
fn dot<V: Lanes>(a: &[V; 3], b: &[V], start: V) -> V {
    a.iter().zip(b).fold(start, |sum, (a, b)| a.mul_add(*b, sum))
}

/// The residual of the first `BLOCK` rows (1, 3 or 6) of `BLOCKS` blocks, and its products with P.
struct Residual<'a, T, const BLOCK: usize, const BLOCKS: usize>(Row<'a, T>);

impl<T: SimdReal, const BLOCK: usize, const BLOCKS: usize> Kernel<T> for Residual<'_, T, BLOCK, BLOCKS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Row { truncation, around, wide, planes, at: row, scale } = self.0;
        let mut c = 0;
        while c < planes.width {
            // Row k of the ring at the offset (x, y).
            let at = |k: usize, x: isize, y: isize| {
                V::load(&around[(y + 1) as usize][k * wide + (c as isize + 1 + x) as usize..])
            };
            let m: [V; 6] = std::array::from_fn(|k| at(MOTION + k, 0, 0));
            let bent = Bent::new(&at, truncation.smoothing);
            // Differences need all neighbours.
            let mut least = at(USABLE, 0, 0);
            for y in -1..=1 {
                for x in -1..=1 {
                    least = least.min(at(USABLE, x, y));
                }
            }
            let usable = V::zero().lt(least);
            let (mut products, mut energy) = ([V::zero(); 6], V::zero());
            let mut carried = [V::zero(); 6];
            let own = V::zero().lt(at(USABLE, 0, 0));
            for block in 0..BLOCKS {
                let jet: [V; 6] = std::array::from_fn(|k| at(6 * block + k, 0, 0));
                let derivatives: [V; DERIVATIVES] = std::array::from_fn(|d| {
                    let (k, axis) = DIFFERENCED[d];
                    if d >= 9 {
                        return jet[k];
                    }
                    if d == MIXED {
                        let second = |k: usize, x: isize, y: isize| {
                            at(6 * block + k, x, y) + at(6 * block + k, -x, -y) - (jet[k] + jet[k])
                        };
                        return (second(3, 0, 1) + second(5, 1, 0)) * V::constant(0.5);
                    }
                    let (x, y) = if axis == 0 { (1, 0) } else { (0, 1) };
                    let (before, after) = (at(6 * block + k, -x, -y), at(6 * block + k, x, y));
                    if d < 4 { (after - before) * V::constant(0.5) } else { after + before - (jet[k] + jet[k]) }
                });
                let mut r = residual::<V, BLOCK>(truncation, block, &m, &jet, &derivatives);
                let p = columns::<V, BLOCK>(&jet);
                for (k, r) in r.iter_mut().enumerate() {
                    *r = V::select(usable, *r, V::zero());
                    energy = r.mul_add(*r, energy);
                    let rate = V::select(own, bent.rate(&p, &jet, &derivatives, k), V::zero());
                    for ((product, carried), column) in products.iter_mut().zip(&mut carried).zip(&p) {
                        *product = column[k].mul_add(*r, *product);
                        *carried = column[k].mul_add(rate, *carried);
                    }
                }
            }
            for (a, product) in products.into_iter().chain(carried).enumerate() {
                let place = planes.at(a, row, c);
                (product * V::constant(if a % 6 < 2 { 1.0 } else { scale })).store(&mut planes.data[place..]);
            }
            let place = planes.at(12, row, c);
            energy.store(&mut planes.data[place..]);
            c += V::LANES;
        }
    }
}
