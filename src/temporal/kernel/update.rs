//! The measurement update: six independent scalar updates, whatever the neighbourhood.
//!
//! The measured jet has covariance `C = r (B^T B)^-1`. A unit triangular change of variables `i* = T i` makes it diagonal (for rectangles only
//! `I* = I + a Ixx + b Iyy` differs from `I`; for 3x3 pixels it is their mean), so that each component is taken in by itself.

use super::{BLOCK, Constants, Lane, N, PACKED, PLANES, failed, packed};
use crate::simd::{Kernel, Lanes, SimdReal};

/// What is measured, in working precision.
#[derive(Debug, Clone)]
pub(in crate::temporal) struct Decorrelation<T> {
    /// `T` as elementary steps `(row, source, factor)`, in order: component `row` gains `factor` times component `source`.
    pub steps: Vec<(usize, usize, T)>,
    /// Variances of the six decorrelated components.
    pub variances: [T; 6],
}

impl<T: SimdReal> Decorrelation<T> {
    /// From the jet's covariance, by its `L D L^T` factors with `I` taken last.
    pub(in crate::temporal) fn new(covariance: &[[f64; 6]; 6]) -> Self {
        const ORDER: [usize; 6] = [1, 2, 3, 4, 5, 0];
        let mut rest = *covariance;
        let (mut variances, mut steps) = ([0.0; 6], Vec::new());
        for (place, &j) in ORDER.iter().enumerate() {
            variances[j] = rest[j][j];
            let mut factors = [0.0; 6];
            for &i in &ORDER[place + 1..] {
                let correlation = rest[i][j].abs() / (rest[i][i] * rest[j][j]).sqrt();
                // Zero but for rounding: the designs of rectangles have exact zeros.
                factors[i] = if correlation < 1e-12 { 0.0 } else { rest[i][j] / rest[j][j] };
            }
            let pivot = rest[j];
            for &i in &ORDER[place + 1..] {
                if factors[i] != 0.0 {
                    for &k in &ORDER[place + 1..] {
                        rest[i][k] -= factors[i] * pivot[k];
                    }
                    steps.push((i, j, T::from_f64(-factors[i])));
                }
            }
        }
        Self { steps, variances: variances.map(T::from_f64) }
    }
}

/// Updates every pixel of some blocks in place.
pub(in crate::temporal) struct Update<'a, T> {
    /// States.
    pub blocks: &'a mut [T],
    /// Measured jets, six rows of `BLOCK` for each block, then a row that is one where there is a measurement and zero where not.
    pub measured: &'a [T],
    /// Set to one for each pixel that was repaired.
    pub repaired: &'a mut [u8],
    pub decorrelation: &'a Decorrelation<T>,
    pub constants: &'a Constants<T>,
}

/// Rows of the measurement of one block.
pub(in crate::temporal) const MEASURED: usize = 7;

impl<T: SimdReal> Kernel<T> for Update<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let blocks = self.blocks.chunks_exact_mut(PLANES * BLOCK);
        let inputs = self.measured.chunks_exact(MEASURED * BLOCK);
        for ((block, input), repaired) in blocks.zip(inputs).zip(self.repaired.chunks_exact_mut(BLOCK)) {
            for at in (0..BLOCK).step_by(V::LANES) {
                let mut lane = Lane::<V>::load(block, at);
                let mut jet = [V::zero(); 6];
                for k in 0..6 {
                    jet[k] = V::load(&input[k * BLOCK + at..]);
                }
                let present = V::load(&input[6 * BLOCK + at..]);
                update(&mut lane, &mut jet, present, self.decorrelation);
                let bad = failed(sound(&lane));
                lane.store(block, at);
                if bad != 0 {
                    for k in 0..V::LANES {
                        if bad >> k & 1 == 1 {
                            super::factor::repair(block, at + k, self.constants);
                            repaired[at + k] = 1;
                        }
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn update<V: Lanes>(lane: &mut Lane<V>, jet: &mut [V; 6], present: V, decorrelation: &Decorrelation<V::Scalar>) {
    for &(row, source, factor) in &decorrelation.steps {
        let factor = V::splat(factor);
        jet[row] = jet[source].mul_add(factor, jet[row]);
        combine(lane, row, source, factor);
    }
    macro_rules! each {
        ($($j:literal)*) => { $(take_in::<V, $j>(lane, jet, present, V::splat(decorrelation.variances[$j]));)* };
    }
    each!(1 2 3 4 5 0);
    for &(row, source, factor) in decorrelation.steps.iter().rev() {
        combine(lane, row, source, -V::splat(factor));
    }
}

/// Adds `factor` times component `source` to component `row`, in mean and covariance.
#[inline(always)]
fn combine<V: Lanes>(lane: &mut Lane<V>, row: usize, source: usize, factor: V) {
    lane.mean[row] = lane.mean[source].mul_add(factor, lane.mean[row]);
    let before = lane.cov[packed(row, source)];
    for k in 0..N {
        if k != row {
            let at = packed(row, k);
            lane.cov[at] = lane.cov[packed(source, k)].mul_add(factor, lane.cov[at]);
        }
    }
    let at = packed(row, row);
    lane.cov[at] = (before + lane.cov[packed(row, source)]).mul_add(factor, lane.cov[at]);
}

/// Takes in component `J` of the jet, measured with variance `r`.
///
/// The component's own row is multiplied by `r / s`, exactly what subtraction would leave, without the cancellation.
#[inline(always)]
fn take_in<V: Lanes, const J: usize>(lane: &mut Lane<V>, jet: &[V; 6], present: V, r: V) {
    let one = V::constant(1.0);
    let inverse = present / (lane.cov[packed(J, J)] + r);
    let keep = r.mul_add(inverse, one - present);
    let innovation = jet[J] - lane.mean[J];
    let (mut row, mut gain) = ([V::zero(); N], [V::zero(); N]);
    for k in 0..N {
        row[k] = lane.cov[packed(J, k)];
        gain[k] = row[k] * inverse;
        lane.mean[k] = gain[k].mul_add(innovation, lane.mean[k]);
    }
    subtract::<V, J>(&mut lane.cov, &row, &gain);
    for k in 0..N {
        lane.cov[packed(J, k)] = row[k] * keep;
    }
}

#[inline(always)]
fn subtract<V: Lanes, const J: usize>(cov: &mut [V; PACKED], row: &[V; N], gain: &[V; N]) {
    for a in 0..N {
        if a != J {
            for b in 0..=a {
                if b != J {
                    let at = packed(a, b);
                    cov[at] = gain[a].neg_mul_add(row[b], cov[at]);
                }
            }
        }
    }
}

/// One in each lane whose mean and variances are finite and whose variances are positive.
#[inline(always)]
fn sound<V: Lanes>(lane: &Lane<V>) -> V {
    let zero = V::zero();
    let (mut product, mut least) = (zero, lane.cov[0]);
    for k in 0..N {
        // Zero times a finite number is zero; anything else is NaN.
        let variance = lane.cov[packed(k, k)];
        product = zero.mul_add(lane.mean[k], zero.mul_add(variance, product));
        least = variance.min(least);
    }
    V::select(zero.lt(least + product), V::constant(1.0), zero)
}
