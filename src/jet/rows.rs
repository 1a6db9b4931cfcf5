//! Jets of one image row at a time, in lanes: the parts that dense estimators are made of.

use super::{stencil::JetStencil, stencil::Reach};
use crate::simd::{Lanes, SimdReal};

/// Starts of the vectors that cover `range`: the last one is moved back to end with the range.
///
/// For maps only: the overlap is computed twice. Yields nothing for a range shorter than a vector.
#[inline(always)]
pub(crate) fn starts(range: std::ops::Range<usize>, lanes: usize) -> Starts {
    let fits = range.end >= range.start + lanes;
    Starts { next: range.start, last: if fits { range.end - lanes } else { 0 }, lanes, done: !fits }
}

pub(crate) struct Starts {
    next: usize,
    last: usize,
    lanes: usize,
    done: bool,
}

impl Iterator for Starts {
    type Item = usize;
    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.done {
            return None;
        }
        let at = self.next;
        if at >= self.last {
            self.done = true;
            return Some(self.last);
        }
        self.next = at + self.lanes;
        Some(at)
    }
}

/// A stencil in working precision, ready to be run over rows.
#[derive(Debug, Clone)]
pub(crate) struct JetRows<T> {
    reach: Reach,
    form: Form<T>,
}

#[derive(Debug, Clone)]
enum Form<T> {
    /// Filters of the coefficients of `p_i` on each axis, and the map to the jet.
    Separable { x: [Vec<T>; 3], y: [Vec<T>; 3], map: [[T; 6]; 6], symmetric: bool },
    /// Offset and weights of each pixel.
    Direct { taps: Vec<(i32, i32, [T; 6])> },
}

impl<T: SimdReal> JetRows<T> {
    pub fn new(stencil: &JetStencil) -> Self {
        let cast = |v: &[f64]| v.iter().map(|&w| T::from_f64(w)).collect::<Vec<T>>();
        let form = match stencil.separable() {
            Some((x, y, map)) => Form::Separable {
                x: [cast(&x.filters[0]), cast(&x.filters[1]), cast(&x.filters[2])],
                y: [cast(&y.filters[0]), cast(&y.filters[1]), cast(&y.filters[2])],
                map: map.map(|row| row.map(T::from_f64)),
                symmetric: x.is_symmetric() && y.is_symmetric(),
            },
            None => Self::direct(stencil),
        };
        Self { reach: stencil.reach(), form }
    }

    /// The same by direct summation over the pixels.
    fn direct(stencil: &JetStencil) -> Form<T> {
        let taps = stencil.offsets().iter().zip(stencil.weights());
        Form::Direct { taps: taps.map(|(&(x, y), w)| (x, y, w.map(T::from_f64))).collect() }
    }

    /// Values of working memory that [`JetRows::row`] needs for frames of this width.
    pub fn scratch_len(&self, width: usize) -> usize {
        match self.form {
            Form::Separable { .. } => 3 * width,
            Form::Direct { .. } => 0,
        }
    }

    /// Jets of row `y` of a row-major image `width` wide, to the six rows of `out`.
    ///
    /// Writes columns whose neighbourhood fits. `scratch` holds [`JetRows::scratch_len`] values.
    #[inline(always)]
    pub fn row<V: Lanes<Scalar = T>>(&self, image: &[T], width: usize, y: usize, scratch: &mut [T], out: &mut [T]) {
        let inside = self.reach.left..width.saturating_sub(self.reach.right).max(self.reach.left);
        if inside.len() >= V::LANES {
            self.row_lanes::<V>(image, width, y, scratch, out, inside);
        } else {
            self.row_lanes::<T>(image, width, y, scratch, out, inside);
        }
    }

    #[inline(always)]
    fn row_lanes<V: Lanes<Scalar = T>>(
        &self,
        image: &[T],
        width: usize,
        y: usize,
        scratch: &mut [T],
        out: &mut [T],
        inside: std::ops::Range<usize>,
    ) {
        let [o0, o1, o2, o3, o4, o5] = six_rows(out, width);
        match &self.form {
            Form::Separable { x: fx, y: fy, map, symmetric } => {
                let (v0, rest) = scratch.split_at_mut(width);
                let (v1, v2) = rest.split_at_mut(width);
                let top = (y - self.reach.up) * width;
                for x in starts(0..width, V::LANES) {
                    let (mut a0, mut a1, mut a2) = (V::zero(), V::zero(), V::zero());
                    for ((&w0, &w1), (&w2, r)) in fy[0].iter().zip(&fy[1]).zip(fy[2].iter().zip(0..)) {
                        let z = V::load(&image[top + r * width + x..]);
                        a0 = z.mul_add(V::splat(w0), a0);
                        a1 = z.mul_add(V::splat(w1), a1);
                        a2 = z.mul_add(V::splat(w2), a2);
                    }
                    a0.store(&mut v0[x..]);
                    a1.store(&mut v1[x..]);
                    a2.store(&mut v2[x..]);
                }
                let m = |i: usize, j: usize| map[i][j];
                for x in starts(inside, V::LANES) {
                    let (mut c00, mut c10, mut c20) = (V::zero(), V::zero(), V::zero());
                    let (mut c01, mut c11, mut c02) = (V::zero(), V::zero(), V::zero());
                    let left = x - self.reach.left;
                    for ((&w0, &w1), (&w2, k)) in fx[0].iter().zip(&fx[1]).zip(fx[2].iter().zip(0..)) {
                        let z0 = V::load(&v0[left + k..]);
                        let z1 = V::load(&v1[left + k..]);
                        let z2 = V::load(&v2[left + k..]);
                        let (w0, w1, w2) = (V::splat(w0), V::splat(w1), V::splat(w2));
                        c00 = z0.mul_add(w0, c00);
                        c10 = z0.mul_add(w1, c10);
                        c20 = z0.mul_add(w2, c20);
                        c01 = z1.mul_add(w0, c01);
                        c11 = z1.mul_add(w1, c11);
                        c02 = z2.mul_add(w0, c02);
                    }
                    let s = |i, j| V::splat(m(i, j));
                    let mut i = c20.mul_add(s(0, 3), c02.mul_add(s(0, 5), c00 * s(0, 0)));
                    let (mut ix, mut iy) = (c10 * s(1, 1), c01 * s(2, 2));
                    if !symmetric {
                        i = c10.mul_add(s(0, 1), c01.mul_add(s(0, 2), c11.mul_add(s(0, 4), i)));
                        ix = c20.mul_add(s(1, 3), c11.mul_add(s(1, 4), ix));
                        iy = c11.mul_add(s(2, 4), c02.mul_add(s(2, 5), iy));
                    }
                    i.store(&mut o0[x..]);
                    ix.store(&mut o1[x..]);
                    iy.store(&mut o2[x..]);
                    (c20 * s(3, 3)).store(&mut o3[x..]);
                    (c11 * s(4, 4)).store(&mut o4[x..]);
                    (c02 * s(5, 5)).store(&mut o5[x..]);
                }
            }
            Form::Direct { taps } => {
                for x in starts(inside, V::LANES) {
                    let mut jet = [V::zero(); 6];
                    for (ex, ey, w) in taps {
                        let row = y.wrapping_add_signed(*ey as isize) * width;
                        let z = V::load(&image[row + x.wrapping_add_signed(*ex as isize)..]);
                        for k in 0..6 {
                            jet[k] = z.mul_add(V::splat(w[k]), jet[k]);
                        }
                    }
                    jet[0].store(&mut o0[x..]);
                    jet[1].store(&mut o1[x..]);
                    jet[2].store(&mut o2[x..]);
                    jet[3].store(&mut o3[x..]);
                    jet[4].store(&mut o4[x..]);
                    jet[5].store(&mut o5[x..]);
                }
            }
        }
    }
}

/// Six consecutive rows of `width` values.
#[inline(always)]
pub(crate) fn six_rows<T>(buffer: &mut [T], width: usize) -> [&mut [T]; 6] {
    let (o0, rest) = buffer.split_at_mut(width);
    let (o1, rest) = rest.split_at_mut(width);
    let (o2, rest) = rest.split_at_mut(width);
    let (o3, rest) = rest.split_at_mut(width);
    let (o4, rest) = rest.split_at_mut(width);
    [o0, o1, o2, o3, o4, &mut rest[..width]]
}
