//! One step of the filters of a block of sites, one lane a site.

use crate::flow::symmetric::{ENTRIES, factor, upper};
use crate::simd::{Kernel, Lanes, SimdReal};

/// Sites of a block.
pub(super) const BLOCK: usize = 16;

/// Normalised innovation squared beyond which a pixel starts anew: chi-square(6), one in ten thousand.
pub const RESTART: f64 = 27.86;
/// Normalised mean innovation squared beyond which the memory is shortened: chi-square(6), 1 in 16.
pub const FADE: f64 = 12.0;
/// Systematic share of the covariance for methods that do not report it: measured on the coarse-to-fine
/// estimate of textures with 4 grey levels of noise.
pub const SHARE: f64 = 0.3;
/// Normalised mean innovation squared below which there is no lag, only chance.
const LAG: f64 = 8.0;
/// Share of itself that the mean innovation keeps each frame.
const MEAN: f64 = 0.875;
/// Minimum factor of one shortening of the memory; below it the pixel starts anew.
const MIN_FADE: f64 = 1e-3;

/// Rows of a state: motion, `P`, `B`, `V`, `V / g` (0 before the start), mean innovation.
pub(super) const P: usize = 6;
pub(super) const B: usize = P + ENTRIES;
pub(super) const SHARE_LEFT: usize = B + ENTRIES;
pub(super) const RATIO: usize = SHARE_LEFT + 1;
const MEAN_INNOVATION: usize = RATIO + 1;
/// Rows of a state.
pub(super) const ROWS: usize = MEAN_INNOVATION + 6;

/// Rows of the input: motion, covariance, its systematic part, 1 where there is an estimate.
pub(super) const PRESENT: usize = 6 + 2 * ENTRIES;
/// Rows of the input.
pub(super) const INPUT: usize = PRESENT + 1;
/// Rows of the output: motion and its covariance.
pub(super) const OUTPUT: usize = 6 + ENTRIES;

/// A step of one block.
pub(super) struct Step<'a, T> {
    /// `ROWS` rows of `BLOCK` numbers.
    pub state: &'a mut [T],
    /// `INPUT` rows; finite everywhere, and definite also where there is no estimate.
    pub input: &'a [T],
    /// `OUTPUT` rows.
    pub output: &'a mut [T],
    /// Forgetting factor.
    pub forgetting: f64,
}

impl<T: SimdReal> Kernel<T> for Step<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(mut self) {
        let mut c = 0;
        while c < BLOCK {
            self.lanes::<V>(c);
            c += V::LANES;
        }
    }
}

impl<T: SimdReal> Step<'_, T> {
    #[inline(always)]
    fn lanes<V: Lanes<Scalar = T>>(&mut self, c: usize) {
        // Loops and functions, not closures: those that are not inlined lose the lanes' instructions.
        let (state, input) = (&*self.state, self.input);
        let (zero, one, half) = (V::zero(), V::constant(1.0), V::constant(0.5));
        let (x, m) = (rows::<V, 6>(state, 0, c), rows::<V, 6>(input, 0, c));
        let own = rows::<V, ENTRIES>(input, 6, c);
        let own_bias = rows::<V, ENTRIES>(input, 6 + ENTRIES, c);
        let [left, ratio] = rows::<V, 2>(state, SHARE_LEFT, c);
        let bias = rows::<V, ENTRIES>(state, B, c);
        // Prediction: the motion stays, its information is forgotten.
        let grown = V::constant(1.0 / self.forgetting);
        let mut prior = rows::<V, ENTRIES>(state, P, c);
        let (mut told, mut both) = (prior, prior);
        for k in 0..ENTRIES {
            prior[k] = prior[k] * grown;
            told[k] = prior[k].mul_add(ratio, bias[k] * (one - left));
            both[k] = told[k] + own[k];
        }
        // Innovation tests.
        let mut innovation = m;
        let mut mean = rows::<V, 6>(state, MEAN_INNOVATION, c);
        for k in 0..6 {
            innovation[k] = m[k] - x[k];
            mean[k] = mean[k].mul_add(V::constant(MEAN), innovation[k] * V::constant(1.0 - MEAN));
        }
        let spread = factor(&both);
        let single = dot(&innovation, &spread.solve(&innovation));
        let lasting = dot(&mean, &spread.solve(&mean)) * V::constant((1.0 + MEAN) / (1.0 - MEAN));
        let fade = (V::constant(FADE) / lasting).min(one);
        let fade = (fade * fade).max(V::constant(MIN_FADE));
        // Update, in the form that keeps covariances definite (Joseph's).
        let mut prior_left = prior;
        for k in 0..ENTRIES {
            prior_left[k] = prior[k] / fade;
            both[k] = prior_left[k] + own[k];
        }
        let spread = factor(&both);
        let mut gain = [[zero; 6]; 6];
        let mut keep = gain;
        let mut trace = zero;
        for i in 0..6 {
            let mut row = x;
            for j in 0..6 {
                row[j] = entry(&prior_left, i, j);
            }
            gain[i] = spread.solve(&row);
            for j in 0..6 {
                keep[i][j] = if i == j { one - gain[i][j] } else { -gain[i][j] };
            }
            trace = trace + gain[i][i];
        }
        let g = (trace * V::constant(1.0 / 6.0)).max(V::constant(1e-6)).min(one);
        let rest = one - g;
        let (kept, added) = (congruence(&keep, &prior_left), congruence(&gain, &own));
        let new_left = (rest * rest).mul_add(left, g * g);
        let new_ratio = new_left / g;
        let beyond_chance = (one - V::constant(LAG) / lasting).max(zero).sqrt() * rest;
        // Whether there is no estimate, a start or an update.
        let present = half.lt(rows::<V, 1>(input, PRESENT, c)[0]);
        let goes_on = V::select(single.lt(V::constant(RESTART)), V::select(zero.lt(ratio), one, zero), zero);
        let goes_on = half.lt(goes_on);
        let which = Which { present, goes_on };
        let (state, output) = (&mut *self.state, &mut *self.output);
        for k in 0..6 {
            let motion = which.choose(x[k], m[k], x[k] + dot(&gain[k], &innovation));
            motion.store(&mut state[k * BLOCK + c..]);
            motion.store(&mut output[k * BLOCK + c..]);
            let last = V::load(&state[(MEAN_INNOVATION + k) * BLOCK + c..]);
            which.choose(last, zero, mean[k]).store(&mut state[(MEAN_INNOVATION + k) * BLOCK + c..]);
        }
        which.choose(left, one, new_left).store(&mut state[SHARE_LEFT * BLOCK + c..]);
        which.choose(ratio, one, new_ratio).store(&mut state[RATIO * BLOCK + c..]);
        for i in 0..6 {
            for j in i..6 {
                let k = upper(i, j);
                let posterior = kept[k] + added[k];
                let floor = rest.mul_add(bias[k], g * own_bias[k]);
                let whole = posterior.mul_add(new_ratio, floor * (one - new_left))
                    + mean[i] * mean[j] * (beyond_chance * beyond_chance);
                which.choose(prior[k], own[k], posterior).store(&mut state[(P + k) * BLOCK + c..]);
                which.choose(bias[k], own_bias[k], floor).store(&mut state[(B + k) * BLOCK + c..]);
                which.choose(told[k], own[k], whole).store(&mut output[(6 + k) * BLOCK + c..]);
            }
        }
    }
}

#[inline(always)]
fn dot<V: Lanes>(a: &[V; 6], b: &[V; 6]) -> V {
    let mut sum = a[0] * b[0];
    for k in 1..6 {
        sum = a[k].mul_add(b[k], sum);
    }
    sum
}

/// `N` rows of a block from row `first` on, at column `c`.
#[inline(always)]
fn rows<V: Lanes, const N: usize>(block: &[V::Scalar], first: usize, c: usize) -> [V; N] {
    let mut rows = [V::zero(); N];
    for (k, row) in rows.iter_mut().enumerate() {
        *row = V::load(&block[(first + k) * BLOCK + c..]);
    }
    rows
}

/// Whether a site has no estimate, a start or an update.
struct Which<V: Lanes> {
    present: V::Mask,
    goes_on: V::Mask,
}

impl<V: Lanes> Which<V> {
    #[inline(always)]
    fn choose(&self, missing: V, start: V, update: V) -> V {
        V::select(self.present, V::select(self.goes_on, update, start), missing)
    }
}

/// Entry (i, j) of a symmetric matrix kept as its upper triangle.
#[inline(always)]
fn entry<V: Lanes>(list: &[V; ENTRIES], i: usize, j: usize) -> V {
    list[if i <= j { upper(i, j) } else { upper(j, i) }]
}

/// The upper triangle of `A C A^T`.
#[inline(always)]
fn congruence<V: Lanes>(a: &[[V; 6]; 6], c: &[V; ENTRIES]) -> [V; ENTRIES] {
    let mut half = [[V::zero(); 6]; 6];
    for i in 0..6 {
        for j in 0..6 {
            for k in 0..6 {
                half[i][j] = a[i][k].mul_add(entry(c, k, j), half[i][j]);
            }
        }
    }
    let mut out = [V::zero(); ENTRIES];
    for i in 0..6 {
        for j in i..6 {
            out[upper(i, j)] = dot(&half[i], &a[j]);
        }
    }
    out
}
