//! Resampling (selection): particles are copied in proportion to their weights.
//!
//! Schemes: R. Douc, O. Cappé, E. Moulines, "Comparison of resampling schemes for particle filtering", 2005.
//! In each the expected number of copies of particle i is `count w_i`; they differ in its variance.

use crate::math::random::CounterRng;
use crate::types::choices;

/// How particles are selected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Resampling {
    /// Independent draws: the largest variance, `count w (1 - w)`.
    Multinomial,
    /// One position in each of `count` equal intervals, each with its own uniform number.
    Stratified,
    /// Positions `(i + u) / count` with one uniform number: copies differ from `count w` by less than 1.
    #[default]
    Systematic,
    /// `floor(count w)` copies of each, the rest by independent draws from the remainders (J. S. Liu and R.
    /// Chen 1998).
    Residual,
}

choices!(Resampling, "resampling":
    Multinomial "multinomial",
    Stratified "stratified",
    Systematic "systematic",
    Residual "residual",
);

impl Resampling {
    /// `count` indices of particles by the uniform numbers of `rng`, into `out`; see [`resample_indices`].
    pub fn indices(self, weights: &[f64], count: usize, rng: &CounterRng, out: &mut Vec<usize>) {
        resample_indices(self, weights, count, |i| rng.uniform(i), out);
    }
}

/// `count` indices of particles, into `out`, by `scheme` and the numbers `uniform(0), uniform(1), ...` in [0,
/// 1].
///
/// `weights` are linear and need not be normalised. A position t in [0, 1] selects the first particle with a
/// weight above zero whose cumulative weight is at least t times the sum. Indices ascend, except that
/// multinomial draws keep the order of their numbers, as do those at the end of residual resampling. A weight
/// that is negative or NaN counts as zero. `out` stays empty if no weight is positive.
pub fn resample_indices(
    scheme: Resampling,
    weights: &[f64],
    count: usize,
    uniform: impl Fn(u64) -> f64,
    out: &mut Vec<usize>,
) {
    out.clear();
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let scaled: Vec<f64>;
    let weights = if largest > f64::MAX / weights.len() as f64 && largest.is_finite() {
        scaled = weights.iter().map(|weight| weight / largest).collect();
        &scaled
    } else {
        weights
    };
    let share = |i: usize, u: f64| (i as f64 + u) / count as f64;
    match scheme {
        Resampling::Multinomial => draw(&Cumulative::new(weights.iter().copied()), count, uniform, out),
        Resampling::Stratified => walk(weights, (0..count).map(|i| share(i, uniform(i as u64))), out),
        Resampling::Systematic => {
            let u = uniform(0);
            walk(weights, (0..count).map(|i| share(i, u)), out);
        }
        Resampling::Residual => residual(weights, count, uniform, out),
    }
}

/// Cumulative weights of particles.
struct Cumulative {
    sums: Vec<f64>,
    /// The last particle with a weight above zero.
    last: Option<usize>,
}

impl Cumulative {
    fn new(weights: impl Iterator<Item = f64>) -> Self {
        let (mut total, mut last) = (0.0, None);
        let sums = weights.enumerate().map(|(i, weight)| {
            if weight > 0.0 {
                (total, last) = (total + weight, Some(i));
            }
            total
        });
        Self { sums: sums.collect(), last }
    }

    fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }
}

/// The particle of each ascending position, in one pass.
fn walk(weights: &[f64], positions: impl Iterator<Item = f64>, out: &mut Vec<usize>) {
    let cumulative = Cumulative::new(weights.iter().copied());
    let (Some(last), total) = (cumulative.last, cumulative.total()) else { return };
    let mut j = 0;
    out.extend(positions.map(|position| {
        let target = position * total;
        // A sum of zero belongs to particles before the first weight above zero.
        while j < last && (cumulative.sums[j] < target || cumulative.sums[j] == 0.0) {
            j += 1;
        }
        j
    }));
}

/// `count` independent draws, by bisection.
fn draw(cumulative: &Cumulative, count: usize, uniform: impl Fn(u64) -> f64, out: &mut Vec<usize>) {
    let (Some(last), total) = (cumulative.last, cumulative.total()) else { return };
    out.extend((0..count as u64).map(|i| {
        let target = uniform(i) * total;
        cumulative.sums.partition_point(|&sum| sum < target || sum == 0.0).min(last)
    }));
}

/// Whole copies first, then independent draws from what is left of each weight.
fn residual(weights: &[f64], count: usize, uniform: impl Fn(u64) -> f64, out: &mut Vec<usize>) {
    let total: f64 = weights.iter().filter(|weight| **weight > 0.0).sum();
    if total <= 0.0 {
        return;
    }
    let expected = |weight: f64| count as f64 * (weight.max(0.0) / total);
    for (i, &weight) in weights.iter().enumerate() {
        // Rounding may make the whole copies one too many.
        let copies = (expected(weight).floor() as usize).min(count - out.len());
        out.extend(std::iter::repeat_n(i, copies));
    }
    if out.len() < count {
        let rest = Cumulative::new(weights.iter().map(|&weight| expected(weight).fract()));
        draw(&rest, count - out.len(), uniform, out);
    }
}
