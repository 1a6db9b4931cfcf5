//! The measurement update: six independent scalar updates, whatever the neighbourhood.
//!
//! The measured jet has covariance `C = r (B^T B)^-1`. A unit triangular change of variables `i* = T i` makes
//! it diagonal (for rectangles only `I* = I + a Ixx + b Iyy` differs from `I`; for 3x3 pixels it is their
//! mean), so that each component is taken in by itself.

// Unrolled loops compare constant indices, the smallest of which is zero.
#![allow(clippy::absurd_extreme_comparisons)]

use super::vector::for_six;
use super::{BLOCK, Constants, Lane, N, PACKED, PLANES, failed, packed};
use crate::simd::{Kernel, Lanes, SimdReal};

/// What is measured, in working precision.
#[derive(Debug, Clone)]
pub(in crate::temporal) struct Decorrelation<T> {
    /// `T` as elementary steps `(row, source, factor)`, in order: component `row` gains `factor` times
    /// component `source`.
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
    /// Measured jets, six rows of `BLOCK` for each block, then a row that is one where measured, else zero.
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

/// Only the brightness block is updated component by component; columns of the other blocks take the same six
/// elimination steps in registers, and the motion block takes all six at once.
#[inline(always)]
fn update<V: Lanes>(lane: &mut Lane<V>, jet: &mut [V; 6], present: V, decorrelation: &Decorrelation<V::Scalar>) {
    let steps = &decorrelation.steps;
    // The two steps of a rectangle are known beforehand; written out they cost no address arithmetic.
    let rectangle = match steps[..] {
        [(0, 3, x), (0, 5, y)] => Some((V::splat(x), V::splat(y))),
        _ => None,
    };
    if let Some((x, y)) = rectangle {
        jet[0] = jet[3].mul_add(x, jet[5].mul_add(y, jet[0]));
        combine_into_brightness::<V, 3>(lane, x);
        combine_into_brightness::<V, 5>(lane, y);
    } else {
        for &(row, source, factor) in steps {
            let factor = V::splat(factor);
            jet[row] = jet[source].mul_add(factor, jet[row]);
            combine(lane, row, source, factor);
        }
    }
    let elimination = brightness_block(lane, jet, present, &decorrelation.variances);
    let (mut rows, mut gains) = ([[V::zero(); 6]; 6], [[V::zero(); 6]; 6]);
    for m in 0..6 {
        let mut column = [V::zero(); 6];
        for j in 0..6 {
            column[j] = lane.cov[packed(6 + m, j)];
        }
        elimination.run(&mut column, &mut rows[m]);
        let mut mean = lane.mean[6 + m];
        for j in 0..6 {
            lane.cov[packed(6 + m, j)] = column[j];
            gains[m][j] = rows[m][j] * elimination.inverse[j];
            mean = gains[m][j].mul_add(elimination.innovation[j], mean);
        }
        lane.mean[6 + m] = mean;
    }
    macro_rules! motion_rows {
        ($($a:literal)*) => { $(motion_row::<V, $a>(&mut lane.cov, &rows, &gains[$a]);)* };
    }
    motion_rows!(0 1 2 3 4 5);
    if let Some((x, y)) = rectangle {
        combine_into_brightness::<V, 5>(lane, -y);
        combine_into_brightness::<V, 3>(lane, -x);
    } else {
        for &(row, source, factor) in steps.iter().rev() {
            combine(lane, row, source, -V::splat(factor));
        }
    }
}

/// `P_ab - sum_j K_aj P_jb` for one row of the motion block.
#[inline(always)]
fn motion_row<V: Lanes, const A: usize>(cov: &mut [V; PACKED], rows: &[[V; 6]; 6], gain: &[V; 6]) {
    for b in 0..=A {
        let at = packed(6 + A, 6 + b);
        let mut sum = cov[at];
        for j in 0..6 {
            sum = gain[j].neg_mul_add(rows[b][j], sum);
        }
        cov[at] = sum;
    }
}

/// [`combine`] for row `I` and a source known beforehand.
#[inline(always)]
fn combine_into_brightness<V: Lanes, const SOURCE: usize>(lane: &mut Lane<V>, factor: V) {
    lane.mean[0] = lane.mean[SOURCE].mul_add(factor, lane.mean[0]);
    let before = lane.cov[packed(SOURCE, 0)];
    for_six!(K => {
        if K != 0 {
            lane.cov[packed(K, 0)] = lane.cov[packed(SOURCE, K)].mul_add(factor, lane.cov[packed(K, 0)]);
        }
        lane.cov[packed(6 + K, 0)] = lane.cov[packed(6 + K, SOURCE)].mul_add(factor, lane.cov[packed(6 + K, 0)]);
    });
    lane.cov[0] = (before + lane.cov[packed(SOURCE, 0)]).mul_add(factor, lane.cov[0]);
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

/// The six scalar updates, as they act on any column.
struct Elimination<V> {
    /// `gain[j][k]`: what component `k` gains for each unit of innovation `j`; unused for `k = j`.
    gain: [[V; 6]; 6],
    /// `r_j / s_j`: what is left of component `j`'s own row.
    keep: [V; 6],
    /// `1 / s_j`.
    inverse: [V; 6],
    /// The innovations.
    innovation: [V; 6],
}

impl<V: Lanes> Elimination<V> {
    /// Takes one column through all updates; `rows[j]` receives its component `j` as update `j` met it.
    #[inline(always)]
    fn run(&self, column: &mut [V; 6], rows: &mut [V; 6]) {
        self.step::<1>(column, rows);
        self.step::<2>(column, rows);
        self.step::<3>(column, rows);
        self.step::<4>(column, rows);
        self.step::<5>(column, rows);
        self.step::<0>(column, rows);
    }

    #[inline(always)]
    fn step<const J: usize>(&self, column: &mut [V; 6], rows: &mut [V; 6]) {
        let own = column[J];
        rows[J] = own;
        for_six!(K => {
            if K != J {
                column[K] = self.gain[J][K].neg_mul_add(own, column[K]);
            }
        });
        column[J] = own * self.keep[J];
    }
}

/// Updates mean and covariance of the brightness with six components of variances `r`. A component's own row
/// is multiplied by `r / s`: no cancellation.
#[inline(always)]
fn brightness_block<V: Lanes>(lane: &mut Lane<V>, jet: &[V; 6], present: V, r: &[V::Scalar; 6]) -> Elimination<V> {
    let (zero, missing) = (V::zero(), V::constant(1.0) - present);
    let mut all = Elimination { gain: [[zero; 6]; 6], keep: [zero; 6], inverse: [zero; 6], innovation: [zero; 6] };
    macro_rules! each {
        ($($j:literal)*) => {$({
            let r = V::splat(r[$j]);
            all.inverse[$j] = present / (lane.cov[packed($j, $j)] + r);
            all.keep[$j] = r.mul_add(all.inverse[$j], missing);
            all.innovation[$j] = jet[$j] - lane.mean[$j];
            take_in::<V, $j>(lane, &mut all);
        })*};
    }
    each!(1 2 3 4 5 0);
    all
}

#[inline(always)]
fn take_in<V: Lanes, const J: usize>(lane: &mut Lane<V>, all: &mut Elimination<V>) {
    let mut row = [V::zero(); 6];
    for_six!(K => {
        row[K] = lane.cov[packed(J, K)];
        all.gain[J][K] = row[K] * all.inverse[J];
        lane.mean[K] = all.gain[J][K].mul_add(all.innovation[J], lane.mean[K]);
    });
    for_six!(A => {
        for_six!(B => {
            if B <= A && A != J && B != J {
                let at = packed(A, B);
                lane.cov[at] = all.gain[J][A].neg_mul_add(row[B], lane.cov[at]);
            }
        });
    });
    for_six!(K => {
        lane.cov[packed(J, K)] = row[K] * all.keep[J];
    });
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
