//! One step of the filters of a block of sites, one lane a site.

use crate::flow::windowed::solve::{ENTRIES, factor, upper};
use crate::simd::{Kernel, Lanes, SimdReal};

/// Sites of a block.
pub(super) const BLOCK: usize = 16;

/// Normalised innovations squared beyond this start a pixel anew: chi-square with six degrees of freedom, one in ten thousand.
pub const RESTART: f64 = 27.86;
/// Normalised mean innovations squared beyond this shorten the memory; six are expected, one in sixteen is larger.
pub const FADE: f64 = 12.0;
/// Share of the covariance that is taken for systematic where the method does not tell: measured on the coarse-to-fine estimate of textures with 4 grey levels of noise.
pub const SHARE: f64 = 0.3;
/// Normalised mean innovations squared below this are chance, and no lag.
const LAG: f64 = 8.0;
/// The mean innovation keeps this share of itself each frame.
const MEAN: f64 = 0.875;
/// The memory is never shortened by more than this at once without starting anew.
const LEAST_FADE: f64 = 1e-3;

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
    /// `INPUT` rows; finite everywhere, and definite, where there is no estimate too.
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
        // Closures that are not inlined would lose the lanes' instructions: hence functions for what is called often.
        let (state, input) = (&*self.state, self.input);
        let (zero, one, half) = (V::zero(), V::constant(1.0), V::constant(0.5));
        let x: [V; 6] = std::array::from_fn(|k| load(state, k, c));
        let m: [V; 6] = std::array::from_fn(|k| load(input, k, c));
        let own: [V; ENTRIES] = std::array::from_fn(|k| load(input, 6 + k, c));
        let own_bias: [V; ENTRIES] = std::array::from_fn(|k| load(input, 6 + ENTRIES + k, c));
        let (left, ratio) = (load::<V>(state, SHARE_LEFT, c), load::<V>(state, RATIO, c));
        let bias: [V; ENTRIES] = std::array::from_fn(|k| load(state, B + k, c));
        // Prediction: the motion stays, its information is forgotten.
        let grown = V::constant(1.0 / self.forgetting);
        let prior: [V; ENTRIES] = std::array::from_fn(|k| load::<V>(state, P + k, c) * grown);
        let told: [V; ENTRIES] = std::array::from_fn(|k| prior[k].mul_add(ratio, bias[k] * (one - left)));
        // Innovation tests.
        let innovation: [V; 6] = std::array::from_fn(|k| m[k] - x[k]);
        let spread = factor(&std::array::from_fn::<V, ENTRIES, _>(|k| told[k] + own[k]));
        let mean: [V; 6] = std::array::from_fn(|k| {
            load::<V>(state, MEAN_INNOVATION + k, c).mul_add(V::constant(MEAN), innovation[k] * V::constant(1.0 - MEAN))
        });
        let single = dot(&innovation, &spread.solve(&innovation));
        let lasting = dot(&mean, &spread.solve(&mean)) * V::constant((1.0 + MEAN) / (1.0 - MEAN));
        let fade = (V::constant(FADE) / lasting).min(one);
        let fade = (fade * fade).max(V::constant(LEAST_FADE));
        // Update, in the form that keeps covariances definite (Joseph's).
        let prior_left: [V; ENTRIES] = std::array::from_fn(|k| prior[k] / fade);
        let both = factor(&std::array::from_fn::<V, ENTRIES, _>(|k| prior_left[k] + own[k]));
        let gain: [[V; 6]; 6] = std::array::from_fn(|i| both.solve(&std::array::from_fn(|j| entry(&prior_left, i, j))));
        let keep: [[V; 6]; 6] =
            std::array::from_fn(|i| std::array::from_fn(|j| if i == j { one - gain[i][j] } else { -gain[i][j] }));
        let trace = (0..6).fold(zero, |sum, i| sum + gain[i][i]);
        let g = (trace * V::constant(1.0 / 6.0)).max(V::constant(1e-6)).min(one);
        let rest = one - g;
        let (kept, added) = (congruence(&keep, &prior_left), congruence(&gain, &own));
        let new_left = (rest * rest).mul_add(left, g * g);
        let new_ratio = new_left / g;
        let beyond_chance = (one - V::constant(LAG) / lasting).max(zero);
        let lag: [V; 6] = std::array::from_fn(|k| mean[k] * rest * beyond_chance.sqrt());
        // Which of the three it is: no estimate, a start, an update.
        let present = half.lt(load::<V>(input, PRESENT, c));
        let goes_on = V::select(single.lt(V::constant(RESTART)), V::select(zero.lt(ratio), one, zero), zero);
        let goes_on = half.lt(goes_on);
        let which = Which { present, goes_on };
        let (state, output) = (&mut *self.state, &mut *self.output);
        for k in 0..6 {
            let moved = (0..6).fold(x[k], |sum, j| gain[k][j].mul_add(innovation[j], sum));
            let motion = which.choose(x[k], m[k], moved);
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
                let whole = posterior.mul_add(new_ratio, floor * (one - new_left)) + lag[i] * lag[j];
                which.choose(prior[k], own[k], posterior).store(&mut state[(P + k) * BLOCK + c..]);
                which.choose(bias[k], own_bias[k], floor).store(&mut state[(B + k) * BLOCK + c..]);
                which.choose(told[k], own[k], whole).store(&mut output[(6 + k) * BLOCK + c..]);
            }
        }
    }
}

#[inline(always)]
fn dot<V: Lanes>(a: &[V; 6], b: &[V; 6]) -> V {
    (0..6).fold(V::zero(), |sum, k| a[k].mul_add(b[k], sum))
}

/// Row `row` of a block, from column `c` on.
#[inline(always)]
fn load<V: Lanes>(block: &[V::Scalar], row: usize, c: usize) -> V {
    V::load(&block[row * BLOCK + c..])
}

/// Which of three a site goes through: no estimate, a start, an update.
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
    let half: [[V; 6]; 6] = std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..6).fold(V::zero(), |sum, k| a[i][k].mul_add(entry(c, k, j), sum)))
    });
    let mut out = [V::zero(); ENTRIES];
    for i in 0..6 {
        for j in i..6 {
            out[upper(i, j)] = dot(&half[i], &a[j]);
        }
    }
    out
}
