//! Planes extended beyond the frame, so that windows need no special case at its edge.

use crate::flow::coarse_to_fine::{plane_pool::PlanePool, planes::CHUNK, planes::LEFT, planes::Planes};
use crate::simd::SimdReal;
use std::ops::Range;

/// Sites on each side of the frame: the maximum reach of a window.
pub(super) const RIM: usize = LEFT;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Continuation {
    /// Reflected at the point on the edge, `2 z(edge) - z(mirrored)`: affine motion stays affine.
    Odd,
    /// Mirrored, the edge itself not repeated.
    Even,
}

/// Planes with [`RIM`] more sites on every side.
pub(super) struct Field<T> {
    planes: Planes<T>,
    pub width: usize,
    pub height: usize,
}

impl<T: SimdReal> Field<T> {
    /// `width x height` sites (both positive) with any finite content.
    pub fn make(space: &PlanePool<T>, width: usize, height: usize, count: usize) -> Self {
        Self { planes: space.planes(width, height + 2 * RIM, count), width, height }
    }

    pub fn take(&mut self) -> Option<Self> {
        let planes = std::mem::take(&mut self.planes);
        (planes.room() > 0).then_some(Self { planes, width: self.width, height: self.height })
    }

    pub fn keep(space: &PlanePool<T>, fields: impl IntoIterator<Item = Self>) {
        fields.into_iter().for_each(|field| space.keep(field.planes));
    }

    /// Zeros on `width x height` sites (both positive) and beyond.
    #[cfg(test)]
    pub fn new(width: usize, height: usize, count: usize) -> Self {
        Self { planes: Planes::new(width, height + 2 * RIM, count), width, height }
    }

    /// Sites that a kernel computes in a row.
    pub fn padded(&self) -> usize {
        self.planes.padded()
    }

    pub fn stride(&self) -> usize {
        self.planes.stride()
    }

    pub fn row_len(&self) -> usize {
        self.planes.row_len()
    }

    pub fn data(&self) -> &[T] {
        self.planes.data()
    }

    pub fn data_mut(&mut self) -> &mut [T] {
        self.planes.data_mut()
    }

    /// Where plane `k` begins in row `y` (from `-RIM` on); its site 0 is [`LEFT`] further.
    #[inline(always)]
    pub fn start(&self, k: usize, y: isize) -> usize {
        (y + RIM as isize) as usize * self.row_len() + k * self.stride()
    }

    #[inline(always)]
    pub fn line(&self, k: usize, y: isize) -> &[T] {
        let start = self.start(k, y);
        &self.data()[start..start + self.stride()]
    }

    /// The rows of the frame, to be cut into rows of [`Field::row_len`].
    pub fn rows_mut(&mut self) -> &mut [T] {
        let (len, height) = (self.row_len(), self.height);
        &mut self.data_mut()[RIM * len..(RIM + height) * len]
    }

    #[cfg(test)]
    pub fn at(&self, k: usize, x: usize, y: usize) -> T {
        self.line(k, y as isize)[LEFT + x]
    }

    /// Extends some planes by `reach` sites beyond each edge.
    pub fn extend(&mut self, planes: Range<usize>, beyond: Continuation, reach: usize) {
        let (width, height, stride) = (self.width, self.height, self.stride());
        for k in planes.clone() {
            for y in 0..height {
                let start = self.start(k, y as isize);
                extend_line(&mut self.data_mut()[start..start + stride], width, beyond, reach);
            }
        }
        for step in 1..=reach as isize {
            for k in planes.clone() {
                self.extend_down(k, step, beyond);
            }
        }
    }

    /// Rows `-step` and `height - 1 + step` of a plane, after those nearer to the frame.
    fn extend_down(&mut self, k: usize, step: isize, beyond: Continuation) {
        let (last, stride) = (self.height as isize - 1, self.stride());
        // A single row is repeated.
        let mirrored = if last == 0 { 0 } else { step };
        let (edge, source, target) = (self.start(k, 0), self.start(k, mirrored), self.start(k, -step));
        let (before, after) = self.data_mut().split_at_mut(edge);
        let inside = &after[source - edge..][..stride];
        reflect(&after[..stride], inside, &mut before[target..target + stride], beyond);
        let (edge, source, target) = (self.start(k, last), self.start(k, last - mirrored), self.start(k, last + step));
        let (before, after) = self.data_mut().split_at_mut(edge + stride);
        let (edge, inside) = (&before[edge..], &before[source..source + stride]);
        let from = target - before.len();
        reflect(edge, inside, &mut after[from..from + stride], beyond);
    }
}

fn reflect<T: SimdReal>(edge: &[T], inside: &[T], target: &mut [T], beyond: Continuation) {
    match beyond {
        Continuation::Even => target.copy_from_slice(inside),
        Continuation::Odd => {
            for ((t, e), i) in target.iter_mut().zip(edge).zip(inside) {
                *t = *e + *e - *i;
            }
        }
    }
}

/// Values beyond an edge from those `inside`, in the order of the target.
fn mirror<'a, T: SimdReal>(target: &mut [T], inside: impl Iterator<Item = &'a T>, edge: T, beyond: Continuation) {
    match beyond {
        Continuation::Even => target.iter_mut().zip(inside).for_each(|(t, i)| *t = *i),
        Continuation::Odd => target.iter_mut().zip(inside).for_each(|(t, i)| *t = edge + edge - *i),
    }
}

fn extend_line<T: SimdReal>(line: &mut [T], width: usize, beyond: Continuation, reach: usize) {
    let (first, last) = (LEFT, LEFT + width - 1);
    let (left, right) = (line[first], line[last]);
    if width > reach {
        // Samples beyond one edge are never mirrored at the other.
        let (before, inside) = line.split_at_mut(first + 1);
        mirror(&mut before[first - reach..first], inside[..reach].iter().rev(), left, beyond);
        let (inside, after) = line.split_at_mut(last + 1);
        mirror(&mut after[..reach], inside[last - reach..last].iter().rev(), right, beyond);
        return;
    }
    for step in 1..=reach {
        let mirrored = if width == 1 { 0 } else { step };
        let (a, b) = (line[first + mirrored], line[last - mirrored]);
        (line[first - step], line[last + step]) = match beyond {
            Continuation::Even => (a, b),
            Continuation::Odd => (left + left - a, right + right - b),
        };
    }
}

/// The first [`CHUNK`] values: of known length, so that loops over them check no bounds.
#[inline(always)]
pub(super) fn chunk_of<T>(values: &[T]) -> &[T; CHUNK] {
    values.first_chunk().expect("rows end with a rim")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn affine_values_go_on_affinely_from_frames_of_any_size() {
        for (width, height) in [(2, 3), (5, 2), (40, 20)] {
            let mut f = Field::<f64>::new(width, height, 2);
            let truth = |k: usize, x: f64, y: f64| 3.0 + k as f64 + 2.0 * x - 0.5 * y;
            for k in 0..2 {
                for y in 0..height {
                    let at = f.start(k, y as isize) + LEFT;
                    (0..width).for_each(|x| f.data_mut()[at + x] = truth(k, x as f64, y as f64));
                }
            }
            f.extend(0..2, Continuation::Odd, RIM);
            for k in 0..2 {
                for y in -16..height as isize + 16 {
                    for x in -16..width as isize + 16 {
                        let got = f.line(k, y)[(x + LEFT as isize) as usize];
                        assert!((got - truth(k, x as f64, y as f64)).abs() < 1e-11, "{width} {height} {x} {y}");
                    }
                }
            }
        }
    }
}
