//! Prediction over one frame: mean and covariance through the non-linear step, by one of the four forms.

use super::factor::Columns;
use super::moments::{cross, outer};
use super::noise::noise_pairs;
use super::transition::{Generator, Step};
use super::vector::{minus, plus, six, times};
use super::{BLOCK, Constants, Lane, N, PACKED, PLANES, order, packed};
use crate::simd::{Kernel, Lanes, SimdReal};
use crate::temporal::FilterForm;
use std::marker::PhantomData;

/// Which form a kernel is compiled for; a value of [`FilterForm`] as a constant.
pub(in crate::temporal) const AUGMENTED: u8 = FilterForm::Augmented as u8;
pub(in crate::temporal) const NON_AUGMENTED: u8 = FilterForm::NonAugmented as u8;
pub(in crate::temporal) const FAST: u8 = FilterForm::Fast as u8;
pub(in crate::temporal) const EXTENDED: u8 = FilterForm::Extended as u8;

/// Most vectors that a form's covariance is summed from: 24 images and 11 of noise.
const VECTORS: usize = 35;

/// Room for one vector of pixels; made once, since clearing it costs a tenth of the work.
struct Scratch<V> {
    /// The factor. Entries above its diagonal are zero from the beginning and never written.
    columns: Columns<V>,
    images: [[V; 6]; VECTORS],
    differences: [[V; 6]; N],
}

impl<V: Lanes> Scratch<V> {
    #[inline(always)]
    fn new() -> Self {
        let zero = V::zero();
        Self { columns: [[zero; N]; N], images: [[zero; 6]; VECTORS], differences: [[zero; 6]; N] }
    }
}

/// Predicts every pixel of some blocks in place.
pub(in crate::temporal) struct Predict<'a, T, S, const FORM: u8> {
    /// States with roots; afterwards with the predicted covariances.
    pub blocks: &'a mut [T],
    pub constants: &'a Constants<T>,
    pub step: PhantomData<S>,
}

impl<T: SimdReal, S: Step, const FORM: u8> Kernel<T> for Predict<'_, T, S, FORM> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let mut scratch = Scratch::<V>::new();
        for block in self.blocks.chunks_exact_mut(PLANES * BLOCK) {
            for at in (0..BLOCK).step_by(V::LANES) {
                let mut lane = Lane::<V>::load(block, at);
                if FORM == FAST || (FORM != EXTENDED && self.constants.motion_first) {
                    spread(&lane.cov, order(true), &mut scratch.columns);
                    motion_block::<V, 0>(&scratch.columns, &mut lane.cov);
                } else {
                    spread(&lane.cov, order(false), &mut scratch.columns);
                    motion_block::<V, 6>(&scratch.columns, &mut lane.cov);
                }
                predict::<V, S, FORM>(&mut lane, &mut scratch, self.constants);
                lane.store(block, at);
            }
        }
    }
}

/// The columns of a root, by components.
#[inline(always)]
fn spread<V: Lanes>(root: &[V; PACKED], order: &[usize; N], columns: &mut Columns<V>) {
    for j in 0..N {
        for i in j..N {
            columns[j][order[i]] = root[packed(i, j)];
        }
    }
}

/// The covariance of the motion, whose columns of its own begin with `FIRST`.
#[inline(always)]
fn motion_block<V: Lanes, const FIRST: usize>(columns: &Columns<V>, cov: &mut [V; PACKED]) {
    for a in 0..6 {
        for b in 0..=a {
            let mut sum = V::zero();
            for k in 0..=FIRST + b {
                sum = columns[k][6 + a].mul_add(columns[k][6 + b], sum);
            }
            cov[packed(6 + a, 6 + b)] = sum;
        }
    }
}

#[inline(always)]
fn predict<V: Lanes, S: Step, const FORM: u8>(
    lane: &mut Lane<V>,
    scratch: &mut Scratch<V>,
    constants: &Constants<V::Scalar>,
) {
    // Nothing depends on I: moving it without its value keeps the digits of what is added to it.
    let brightness = lane.mean[0];
    let mut i = six(&lane.mean, 0);
    i[0] = V::zero();
    let m = six(&lane.mean, 6);
    let map = S::map(&m);
    let centre = S::apply(&map, &i);

    let shift = match FORM {
        EXTENDED => {
            linearised::<V, S>(lane, scratch, &i, &m, &map);
            [V::zero(); 6]
        }
        FAST => sigma_points::<V, S, FORM, 6, 12, 18>(lane, scratch, &i, &m, &centre, constants),
        AUGMENTED if S::NOISE_INSIDE => {
            sigma_points::<V, S, FORM, 12, 24, 35>(lane, scratch, &i, &m, &centre, constants)
        }
        _ => sigma_points::<V, S, FORM, 12, 24, 24>(lane, scratch, &i, &m, &centre, constants),
    };
    if !(FORM == AUGMENTED && S::NOISE_INSIDE) {
        for k in 0..N {
            let at = packed(k, k);
            lane.cov[at] = lane.cov[at] + V::splat(constants.q[k]);
        }
    }
    for k in 0..6 {
        lane.mean[k] = centre[k] + shift[k];
    }
    lane.mean[0] = lane.mean[0] + brightness;
}

/// The unscented transform over the first `PAIRS` columns of the factor, `POINTS = 2 PAIRS`, together with
/// the vectors that a form adds up to `TOTAL`: they enter the covariance with weight one. Returns the shift
/// of the mean from the centre's image.
///
/// With `a, b` the images of a pair less the centre's and `c = n + lambda`: shift `d = sum (a + b) / 2c`,
/// covariance `sum (a a^T + b b^T) / 2c + (beta - alpha^2) d d^T`, covariance with the motion `sum (a - b)
/// l^T / 2 sqrt(c)`. The usual weights, with the centre's large cancelling terms gone; the motion's own block
/// does not change but for its noise.
#[inline(always)]
fn sigma_points<V: Lanes, S: Step, const FORM: u8, const PAIRS: usize, const POINTS: usize, const TOTAL: usize>(
    lane: &mut Lane<V>,
    scratch: &mut Scratch<V>,
    i: &[V; 6],
    m: &[V; 6],
    centre: &[V; 6],
    constants: &Constants<V::Scalar>,
) -> [V; 6] {
    let spread = V::splat(constants.spread);
    let one = V::constant(1.0);
    let half = V::constant(0.5);
    let Scratch { columns, images, differences } = scratch;
    let (images, differences) = (&mut images[..TOTAL], &mut differences[..PAIRS]);
    let mut sums = [V::zero(); 6];
    for k in 0..PAIRS {
        let step = times(&columns[k], spread);
        let (di, dm) = (six(&step, 0), six(&step, 6));
        let a = minus(&S::advance(&plus(i, &di), &plus(m, &dm)), centre);
        let b = minus(&S::advance(&minus(i, &di), &minus(m, &dm)), centre);
        images[2 * k] = a;
        images[2 * k + 1] = b;
        differences[k] = minus(&a, &b);
        sums = plus(&sums, &plus(&a, &b));
    }
    let inverse = one / spread;
    let scale = half * inverse * inverse;
    let mut shift = times(&sums, scale);
    // Vectors of weight one undo the scale that all share.
    let whole = spread * V::constant(std::f64::consts::SQRT_2);
    if FORM == AUGMENTED && S::NOISE_INSIDE {
        let noise = noise_pairs(i, &Generator::new(m), constants);
        for k in 0..noise.full.len() {
            images[POINTS + k] = times(&noise.full[k], whole);
        }
        outer(images, scale, &mut lane.cov);
        cross(differences, columns, half * inverse, &mut lane.cov);
        noise.add_to(&mut lane.cov, constants);
        for k in 0..6 {
            shift[k] = shift[k] + noise.shift[k];
        }
    } else {
        if FORM == FAST {
            conditional::<V, S>(columns, m, whole, &mut images[POINTS..]);
        }
        outer(images, scale, &mut lane.cov);
        cross(differences, columns, half * inverse, &mut lane.cov);
    }
    let weight = V::splat(constants.shift);
    for a in 0..6 {
        let weighted = weight * shift[a];
        for b in 0..=a {
            lane.cov[packed(a, b)] = weighted.mul_add(shift[b], lane.cov[packed(a, b)]);
        }
    }
    shift
}

/// The factor of the brightness's covariance given the motion, moved by the mean motion: exact.
#[inline(always)]
fn conditional<V: Lanes, S: Step>(columns: &Columns<V>, m: &[V; 6], whole: V, out: &mut [[V; 6]]) {
    let map = S::map(m);
    for k in 6..9 {
        out[k - 6] = times(&S::apply(&map, &six(&columns[k], 0)), whole);
    }
    for k in 9..12 {
        let [value, gx, gy] = S::apply_slope(&map, &[columns[k][0], columns[k][1], columns[k][2]]);
        out[k - 6] = [value * whole, gx * whole, gy * whole, V::zero(), V::zero(), V::zero()];
    }
}

/// The covariance through the linearised step, as a square root: `F L` squared.
#[inline(always)]
fn linearised<V: Lanes, S: Step>(
    lane: &mut Lane<V>,
    scratch: &mut Scratch<V>,
    i: &[V; 6],
    m: &[V; 6],
    map: &S::Map<V>,
) {
    let Scratch { columns, images, .. } = scratch;
    let moved = &mut images[..N];
    for k in 0..N {
        moved[k] = S::apply(map, &six(&columns[k], 0));
    }
    for direction in 0..6 {
        let tangent = S::tangent(i, m, direction);
        for k in 0..N {
            for j in 0..6 {
                moved[k][j] = tangent[j].mul_add(columns[k][6 + direction], moved[k][j]);
            }
        }
    }
    outer(moved, V::constant(1.0), &mut lane.cov);
    cross(moved, columns, V::constant(1.0), &mut lane.cov);
}
