//! The exponential function in lanes.

use super::Lanes;

/// `ln 2` in two parts, the first exact when multiplied by the exponent of a double.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
/// Below this the result is zero: less than the smallest normal number.
const MIN_EXPONENT: f64 = -708.0;
/// Above this the result is that of this.
const MAX_EXPONENT: f64 = 709.0;
/// `1 / n!` from n = 13 down.
const SERIES: [f64; 14] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// `e^x`, to 1e-15 of itself for `-708 <= x <= 709`; zero below, not above the value at 709 beyond. NaN gives
/// no NaN: callers look for that before.
///
/// `x = n ln 2 + r` with `|r| <= ln 2 / 2` and the series of `e^r`, whose first term left out is 1e-18.
#[inline(always)]
pub(crate) fn exp<V: Lanes<Scalar = f64>>(x: V) -> V {
    let inside = x.max(V::splat(MIN_EXPONENT)).min(V::splat(MAX_EXPONENT));
    let n = inside.mul_add(V::splat(std::f64::consts::LOG2_E), V::splat(0.5)).floor();
    let r = n.neg_mul_add(V::splat(LN_2[1]), n.neg_mul_add(V::splat(LN_2[0]), inside));
    let mut sum = V::splat(SERIES[0]);
    for term in &SERIES[1..] {
        sum = sum.mul_add(r, V::splat(*term));
    }
    V::select(x.lt(V::splat(MIN_EXPONENT)), V::zero(), sum * n.power_of_two())
}

#[cfg(test)]
mod tests {
    use super::super::{Kernel, Level, SimdReal, dispatch};
    use super::*;

    struct Exponentials<'a>(&'a mut [f64]);

    impl Kernel<f64> for Exponentials<'_> {
        type Output = ();
        #[inline(always)]
        fn run<V: Lanes<Scalar = f64>>(self) {
            for values in self.0.chunks_exact_mut(V::LANES) {
                exp(V::load(values)).store(values);
            }
        }
    }

    #[test]
    fn every_level_has_the_exponential_function() {
        let x: Vec<f64> = (0..8000).map(|i| f64::from(i) * 0.1771 - 708.0).collect();
        for level in Level::available() {
            let mut got = x.clone();
            dispatch(level, Exponentials(&mut got));
            for (x, got) in x.iter().zip(&got).filter(|(x, _)| **x < 709.0) {
                assert!((got / x.exp() - 1.0).abs() < 1e-15, "{level:?}: exp({x}) = {got}");
            }
            let mut edges = [-1e300, f64::NEG_INFINITY, -709.0, 0.0, -0.0, 1.0, f64::INFINITY, 1e300];
            dispatch(level, Exponentials(&mut edges));
            assert_eq!(edges[..5], [0.0, 0.0, 0.0, 1.0, 1.0]);
            assert!(edges[6].is_finite() && edges[6] > 1e307 && edges[6] == edges[7]);
        }
    }

    /// 2^x.
    struct Powers<'a, T>(&'a mut [T]);

    impl<T: SimdReal> Kernel<T> for Powers<'_, T> {
        type Output = ();
        #[inline(always)]
        fn run<V: Lanes<Scalar = T>>(self) {
            for values in self.0.chunks_exact_mut(V::LANES) {
                V::load(values).power_of_two().store(values);
            }
        }
    }

    #[test]
    fn powers_of_two_are_exact_in_both_precisions() {
        let single: Vec<f32> = (-126..=127).chain([0; 2]).map(|n: i16| f32::from(n)).collect();
        let double: Vec<f64> = (-1022..=1023).chain([0; 2]).map(|n: i16| f64::from(n)).collect();
        for level in Level::available() {
            let (mut s, mut d) = (single.clone(), double.clone());
            dispatch(level, Powers(&mut s));
            dispatch(level, Powers(&mut d));
            assert!(s.iter().zip(&single).all(|(p, n)| *p == n.exp2()), "{level:?}");
            assert!(d.iter().zip(&double).all(|(p, n)| *p == n.exp2()), "{level:?}");
        }
    }
}
