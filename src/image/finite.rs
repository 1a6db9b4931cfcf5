//! Whether a frame may be used at all.

use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;

/// Whether no sample is NaN or infinite.
pub(crate) fn all_finite<T: SimdReal>(frame: &Frame<T>) -> bool {
    dispatch(Level::detect(), AllFinite(frame.data()))
}

struct AllFinite<'a, T>(&'a [T]);

impl<T: SimdReal> Kernel<T> for AllFinite<'_, T> {
    type Output = bool;

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) -> bool {
        let vectors = self.0.chunks_exact(V::LANES);
        let mut rest = vectors.remainder().iter();
        // A finite sample times zero is zero, any other is NaN; and NaN stays.
        let mut sum = V::zero();
        for vector in vectors {
            sum = sum + V::load(vector) * V::zero();
        }
        let mut lanes = vec![T::nan(); V::LANES];
        sum.store(&mut lanes);
        lanes.iter().all(|lane| lane.finite()) && rest.all(|sample| sample.finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_bad_sample_anywhere_is_seen() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for at in 0..35 {
                let mut frame = Frame::from_fn(7, 5, |x, y| (x * y) as f32 - 3e38);
                for level in Level::available() {
                    assert!(dispatch(level, AllFinite(frame.data())));
                }
                frame.data_mut()[at] = bad;
                for level in Level::available() {
                    assert!(!dispatch(level, AllFinite(frame.data())), "{level:?} {at}");
                }
            }
        }
        assert!(all_finite(&Frame::<f64>::default()));
    }
}
