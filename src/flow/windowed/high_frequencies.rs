//! Reads the noise where motion enters least: in the highest frequencies of space and time.
//!
//! `e = sum_t c_t sum_o k(o) I_t(p + o)` with `k = [1, -2, 1] x [1, -2, 1]` and `c` the second difference of
//! three frames (the difference of a pair): fourth derivatives of the image, differenced once or twice more
//! in time. Texture of two pixels or more leaves next to nothing of itself there, while white noise keeps `36
//! sum_t c_t^2` times its variance.

use super::combine::Combination;
use crate::simd::SimdReal;
use crate::types::Frame;
use rayon::prelude::*;

/// `[1, -2, 1]`.
const MASK: [f64; 3] = [1.0, -2.0, 1.0];

/// Squares of `e`, and where there are any.
pub(super) struct HighFrequencies<T> {
    /// `e^2`; 0 where a sample lies outside the frame or is not finite.
    pub energy: Frame<T>,
    /// 1 where there is a value, else 0.
    pub known: Frame<T>,
}

impl<T: SimdReal> HighFrequencies<T> {
    /// Of frames as they came, before any smoothing by the estimator.
    pub fn new(frames: &[&Frame<T>], combination: Combination) -> Self {
        let (w, h) = frames[0].size();
        let weights = times(combination).map(T::from_f64);
        let two = T::from_f64(2.0);
        let mut energy = Frame::filled(w, h, T::default());
        let mut known = Frame::filled(w, h, T::default());
        if w < 3 || h < 3 {
            return Self { energy, known };
        }
        let rows = energy.data_mut().par_chunks_mut(w).zip(known.data_mut().par_chunks_mut(w)).enumerate();
        rows.skip(1).take(h - 2).for_each_init(
            || vec![T::default(); w],
            |across, (y, (energy, known))| {
                // Down the columns and over time first, in one go.
                across.fill(T::default());
                for (frame, weight) in frames.iter().zip(weights) {
                    let (up, own, down) = (frame.row(y - 1), frame.row(y), frame.row(y + 1));
                    for ((a, up), (own, down)) in across.iter_mut().zip(up).zip(own.iter().zip(down)) {
                        *a += weight * ((*up - *own) - (*own - *down));
                    }
                }
                let neighbours = across.windows(3).zip(&mut energy[1..]).zip(&mut known[1..]);
                for ((a, energy), known) in neighbours {
                    let e = a[0] - two * a[1] + a[2];
                    if e.finite() {
                        *energy = e * e;
                        *known = T::from_f64(1.0);
                    }
                }
            },
        );
        Self { energy, known }
    }

    /// Copies row `y` from column `x` on, either of which may lie outside the frame. `energy` comes with 1
    /// where the pixel is usable and 0 elsewhere.
    pub fn row(&self, x: isize, y: isize, energy: &mut [T], known: &mut [T]) {
        known.fill(T::default());
        let (w, h) = self.energy.size();
        let Some(y) = usize::try_from(y).ok().filter(|y| *y < h) else { return energy.fill(T::default()) };
        for (c, (energy, known)) in energy.iter_mut().zip(known).enumerate() {
            let usable = *energy;
            *energy = T::default();
            if let Some(x) = usize::try_from(x + c as isize).ok().filter(|x| *x < w) {
                *energy = usable * self.energy.get(x, y);
                *known = usable * self.known.get(x, y);
            }
        }
    }
}

/// Weights of the frames.
fn times(combination: Combination) -> [f64; 3] {
    let weights = combination.weights();
    if combination == Combination::Pair { weights[1] } else { weights[2] }
}

/// Expectation of `e^2` for white noise of variance 1.
pub(super) fn gain(combination: Combination) -> f64 {
    let axis = MASK.iter().map(|a| a * a).sum::<f64>();
    axis * axis * times(combination).iter().map(|c| c * c).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jet::TimeScheme;
    use crate::math::random::CounterRng;

    #[test]
    fn noise_has_the_expected_energy_and_quadratics_none() {
        let noise = |k: u64| {
            let rng = CounterRng::new(7).stream(k);
            Frame::from_fn(200, 150, |x, y| rng.normal((y * 200 + x) as u64))
        };
        for (n, combination) in [
            (2, Combination::Pair),
            (3, Combination::Triple(TimeScheme::Central)),
            (3, Combination::Triple(TimeScheme::Backward)),
        ] {
            let frames: Vec<Frame<f64>> = (0..n).map(noise).collect();
            let detail = HighFrequencies::new(&frames.iter().collect::<Vec<_>>(), combination);
            let (mut sum, mut count) = (0.0, 0.0);
            for y in 10..140 {
                for x in 10..190 {
                    sum += detail.energy.get(x, y);
                    count += detail.known.get(x, y);
                }
            }
            assert_eq!(count, 130.0 * 180.0);
            assert!((sum / count / gain(combination) - 1.0).abs() < 0.06, "{combination:?}");
        }
        let smooth: Vec<Frame<f64>> =
            (0..3).map(|t| Frame::from_fn(9, 8, |x, y| (x * x * x + 3 * x * y + t * y * y) as f64)).collect();
        let mut frames: Vec<&Frame<f64>> = smooth.iter().collect();
        let combination = Combination::Triple(TimeScheme::Central);
        assert!(HighFrequencies::new(&frames, combination).energy.data().iter().all(|e| *e == 0.0));
        let broken = Frame::from_fn(9, 8, |x, y| if (x, y) == (4, 4) { f64::NAN } else { 1.0 });
        frames[1] = &broken;
        let known = HighFrequencies::new(&frames, combination).known;
        assert!(known.get(3, 3) == 0.0 && known.get(4, 5) == 0.0 && known.get(0, 2) == 0.0 && known.get(2, 3) == 1.0);
    }
}
