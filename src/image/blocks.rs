//! Rows cut into blocks of vectors.

use crate::simd::Lanes;

/// Vectors summed side by side, so that one addition need not wait for the last.
pub(super) const BLOCK: usize = 4;

/// Runs the body with `x` and `N` such that every column of `0..width` is covered, `width >= LANES`: blocks,
/// single vectors, and one last vector that overlaps.
macro_rules! cover {
    ($width:expr, $V:ty, |$x:ident, $N:ident| $body:expr) => {{
        let mut $x = 0;
        while $x + $crate::image::blocks::BLOCK * <$V>::LANES <= $width {
            const $N: usize = $crate::image::blocks::BLOCK;
            $body;
            $x += $crate::image::blocks::BLOCK * <$V>::LANES;
        }
        while $x < $width {
            const $N: usize = 1;
            $x = $x.min($width - <$V>::LANES);
            $body;
            $x += <$V>::LANES;
        }
    }};
}
pub(super) use cover;

/// `N` vectors from the start of `source` (panics when it is shorter).
#[inline(always)]
pub(super) fn load<V: Lanes, const N: usize>(source: &[V::Scalar]) -> [V; N] {
    let source = &source[..N * V::LANES];
    std::array::from_fn(|i| V::load(&source[i * V::LANES..]))
}

/// Writes `N` vectors to the start of `target` (panics when it is shorter).
#[inline(always)]
pub(super) fn store<V: Lanes, const N: usize>(values: &[V; N], target: &mut [V::Scalar]) {
    let target = &mut target[..N * V::LANES];
    for i in 0..N {
        values[i].store(&mut target[i * V::LANES..]);
    }
}
