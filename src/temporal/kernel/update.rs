//! The measurement update: six independent scalar updates, whatever the neighbourhood.
//!
//! The measured jet has covariance `C = r (B^T B)^-1`. A unit triangular change of variables `i* = T i` makes
//! it diagonal (for rectangles only `I* = I + a Ixx + b Iyy` differs from `I`; for 3x3 pixels it is their
//! mean), so that each component is taken in by itself.
//!
//! Where the quadratic does not describe the neighbourhood, its misfit is noise of the measurement, and it
//! enters the brightness as process noise, because another part of it lies in the neighbourhood after each
//! frame. A measurement that the prediction excludes starts the brightness anew and leaves the motion.

// Unrolled loops compare constant indices, the smallest of which is zero.
#![allow(clippy::absurd_extreme_comparisons)]

use super::factor::{Columns, factor, repair};
use super::{BLOCK, Constants, Lane, N, PACKED, PLANES, SCALE, failed, order, packed, vector::for_six};
use crate::simd::{Kernel, Lanes, SimdReal};

/// Normalised innovation squared beyond which the brightness starts anew: chi-square(6), one in ten thousand.
pub(super) const GATE: f64 = 27.86;
/// Frames over which the noise scale follows the normalised innovations.
const SCALE_MEMORY: f64 = 16.0;
/// Maximum noise scale.
const MAX_SCALE: f64 = 100.0;
/// Factor of the motion's covariance when the brightness starts anew: the motion may have changed, too.
const INFLATION: f64 = 2.0;

/// What is measured, in working precision.
#[derive(Debug, Clone)]
pub(in crate::temporal) struct Decorrelation<T> {
    /// `T` as elementary steps `(row, source, factor)`, in order: component `row` gains `factor` times
    /// component `source`.
    pub steps: Vec<(usize, usize, T)>,
    /// Variances of the six decorrelated components.
    pub variances: [T; 6],
    /// Variance of the pixel noise that they are for.
    pub noise: T,
    /// The jet's covariance for pixel noise of variance 1.
    pub unit: [[T; 6]; 6],
}

impl<T: SimdReal> Decorrelation<T> {
    /// From the jet's covariance for unit pixel noise and the noise's variance, by `L D L^T` factors with `I`
    /// taken last.
    pub(in crate::temporal) fn new(covariance: &[[f64; 6]; 6], noise: f64) -> Self {
        const ORDER: [usize; 6] = [1, 2, 3, 4, 5, 0];
        let mut rest = covariance.map(|row| row.map(|c| c * noise));
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
        let unit = covariance.map(|row| row.map(T::from_f64));
        Self { steps, variances: variances.map(T::from_f64), noise: T::from_f64(noise), unit }
    }
}

/// Updates every pixel of some blocks in place.
pub(in crate::temporal) struct Update<'a, T> {
    /// States with predicted covariances; afterwards with roots.
    pub blocks: &'a mut [T],
    /// Measured jets, six rows of `BLOCK` for each block, then `PRESENT`, `MISFIT` and `SHARE`.
    pub measured: &'a [T],
    /// Receives [`REPAIRED`] and [`RESTARTED`] of each pixel.
    pub events: &'a mut [u8],
    pub decorrelation: &'a Decorrelation<T>,
    pub constants: &'a Constants<T>,
    /// Whether this is the first frame: no prediction of it exists.
    pub is_first: bool,
}

/// Row of a measurement that is one where measured, else zero.
pub(in crate::temporal) const PRESENT: usize = 6;
/// Row of the residual variance of sites that a quadratic does not describe, grey levels squared.
pub(in crate::temporal) const MISFIT: usize = 7;
/// Row of the misfit as a share of the neighbourhood's variance.
pub(in crate::temporal) const SHARE: usize = 8;
/// Rows of the measurement of one block.
pub(in crate::temporal) const MEASURED: usize = 9;

/// Event of a pixel whose covariance was repaired.
pub(in crate::temporal) const REPAIRED: u8 = 1;
/// Event of a pixel whose brightness started anew.
pub(in crate::temporal) const RESTARTED: u8 = 2;

impl<T: SimdReal> Kernel<T> for Update<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let blocks = self.blocks.chunks_exact_mut(PLANES * BLOCK);
        let inputs = self.measured.chunks_exact(MEASURED * BLOCK);
        let gate = if self.is_first { V::constant(f64::MAX) } else { V::splat(self.constants.gate) };
        let mut columns: Columns<V> = [[V::zero(); N]; N];
        for ((block, input), events) in blocks.zip(inputs).zip(self.events.chunks_exact_mut(BLOCK)) {
            for at in (0..BLOCK).step_by(V::LANES) {
                let mut lane = Lane::<V>::load(block, at);
                let mut jet = [V::zero(); 6];
                for k in 0..6 {
                    jet[k] = V::load(&input[k * BLOCK + at..]);
                }
                let scale = V::load(&block[SCALE * BLOCK + at..]);
                let given = Given {
                    present: V::load(&input[PRESENT * BLOCK + at..]),
                    misfit: V::load(&input[MISFIT * BLOCK + at..]),
                    scale,
                    gate,
                };
                let (innovation, restarted) = update(&mut lane, &mut jet, &given, self.decorrelation, self.constants);
                if !self.is_first {
                    let change = innovation.mul_add(V::constant(1.0 / 6.0), -given.present);
                    let scale = (scale * change).mul_add(V::constant(1.0 / SCALE_MEMORY), scale);
                    let scale = scale.max(V::constant(1.0)).min(V::constant(MAX_SCALE));
                    scale.store(&mut block[SCALE * BLOCK + at..]);
                }
                let bad = failed(root(&lane, self.constants.motion_first, &mut columns));
                if bad != 0 {
                    lane.store(block, at);
                    for k in (0..V::LANES).filter(|k| bad >> k & 1 == 1) {
                        repair(block, at + k, self.constants);
                        events[at + k] |= REPAIRED;
                    }
                    lane = Lane::load(block, at);
                    root(&lane, self.constants.motion_first, &mut columns);
                }
                for i in 0..N {
                    for j in 0..=i {
                        lane.cov[packed(i, j)] = columns[j][i];
                    }
                }
                lane.store(block, at);
                for k in (0..V::LANES).filter(|k| restarted >> k & 1 == 1) {
                    events[at + k] |= RESTARTED;
                }
            }
        }
    }
}

/// What an update is given beside the jet.
struct Given<V> {
    present: V,
    misfit: V,
    scale: V,
    gate: V,
}

/// Only the brightness block is updated component by component; columns of the other blocks take the same six
/// elimination steps in registers, and the motion block takes all six at once. Returns the normalised
/// innovation squared, at most the gate, and the lanes whose brightness started anew, as bits.
#[inline(always)]
fn update<V: Lanes>(
    lane: &mut Lane<V>,
    jet: &mut [V; 6],
    given: &Given<V>,
    decorrelation: &Decorrelation<V::Scalar>,
    constants: &Constants<V::Scalar>,
) -> (V, u32) {
    let steps = &decorrelation.steps;
    let entering = given.misfit * given.scale;
    for a in 0..6 {
        for b in 0..=a {
            let at = packed(a, b);
            lane.cov[at] = entering.mul_add(V::splat(decorrelation.unit[a][b]), lane.cov[at]);
        }
    }
    let mut variances = [V::zero(); 6];
    let ratio = (given.misfit / V::splat(decorrelation.noise)).max(V::constant(1.0));
    for k in 0..6 {
        variances[k] = V::splat(decorrelation.variances[k]) * ratio;
    }
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
    let elimination = brightness_block(lane, jet, given.present, &variances);
    let mut innovation = V::zero();
    for k in 0..6 {
        let normalised = elimination.innovation[k] * elimination.inverse[k];
        innovation = normalised.mul_add(elimination.innovation[k], innovation);
    }
    let excluded = given.gate.lt(innovation);
    let restarted = failed(V::select(excluded, V::zero(), V::constant(1.0)));
    if restarted != 0 {
        restart(lane, jet, excluded, &variances, constants);
    }
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
    (innovation.min(given.gate), restarted)
}

/// Takes the measurement for the brightness, independent of the motion, where the prediction is excluded. The
/// motion stays, with a covariance that grows up to that of the start.
#[inline(always)]
fn restart<V: Lanes>(
    lane: &mut Lane<V>,
    jet: &[V; 6],
    excluded: V::Mask,
    variances: &[V; 6],
    constants: &Constants<V::Scalar>,
) {
    let (zero, inflation) = (V::zero(), V::constant(INFLATION));
    let mut factor = inflation;
    for a in 0..6 {
        let start = V::splat(constants.start.1[6 + a]);
        let variance = lane.cov[packed(6 + a, 6 + a)];
        factor = V::select(start.lt(variance * inflation), V::constant(1.0), factor);
        lane.mean[a] = V::select(excluded, jet[a], lane.mean[a]);
        for b in 0..6 {
            lane.cov[packed(6 + a, b)] = V::select(excluded, zero, lane.cov[packed(6 + a, b)]);
            if b <= a {
                let own = if a == b { variances[a] } else { zero };
                lane.cov[packed(a, b)] = V::select(excluded, own, lane.cov[packed(a, b)]);
            }
        }
    }
    for a in 0..6 {
        for b in 0..=a {
            let at = packed(6 + a, 6 + b);
            lane.cov[at] = V::select(excluded, lane.cov[at] * factor, lane.cov[at]);
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
fn brightness_block<V: Lanes>(lane: &mut Lane<V>, jet: &[V; 6], present: V, r: &[V; 6]) -> Elimination<V> {
    let (zero, missing) = (V::zero(), V::constant(1.0) - present);
    let mut all = Elimination { gain: [[zero; 6]; 6], keep: [zero; 6], inverse: [zero; 6], innovation: [zero; 6] };
    macro_rules! each {
        ($($j:literal)*) => {$({
            let r = r[$j];
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

/// The root of the covariance. Returns one in each lane that has one and whose mean is finite.
#[inline(always)]
fn root<V: Lanes>(lane: &Lane<V>, motion_first: bool, columns: &mut Columns<V>) -> V {
    let ok =
        if motion_first { factor(&lane.cov, order(true), columns) } else { factor(&lane.cov, order(false), columns) };
    let (zero, mut product) = (V::zero(), V::zero());
    for k in 0..N {
        // Zero times a finite number is zero; anything else is NaN.
        product = zero.mul_add(lane.mean[k], zero.mul_add(columns[k][k], product));
    }
    V::select(zero.lt(ok + product), V::constant(1.0), zero)
}
