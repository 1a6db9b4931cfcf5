//! The lower root of a covariance, and what is done with a covariance that has none.

use super::{BLOCK, Constants, N, PACKED, packed};
use crate::math::Real;
use crate::simd::{Lanes, SimdReal};

/// The columns of a root, zero above its diagonal: `columns[place][state index]` or `columns[place][place]`.
pub(super) type Columns<V> = [[V; N]; N];

/// How small a pivot may be relative to its variance before it is rounding, in units of the last place.
const PIVOT_ULPS: f64 = 4.0;

/// The rounding of a pivot relative to its variance.
fn pivot_rounding<T: SimdReal>() -> f64 {
    PIVOT_ULPS * if size_of::<T>() == 4 { f64::from(f32::EPSILON) } else { f64::EPSILON }
}

/// The lower root of `cov` with the components in `order`, into columns whose upper part is zero already. A
/// pivot that is lost to rounding is raised to its size. Returns one in each lane whose pivots were all
/// positive to rounding.
#[inline(always)]
pub(super) fn factor<V: Lanes>(cov: &[V; PACKED], order: &[usize; N], columns: &mut Columns<V>) -> V {
    let mut ok = V::constant(1.0);
    for j in 0..N {
        for i in j..N {
            columns[j][i] = cov[packed(order[i], order[j])];
        }
    }
    macro_rules! all {
        ($($j:literal)*) => { $(column::<V, $j>(columns, &mut ok);)* };
    }
    all!(0 1 2 3 4 5 6 7 8 9 10 11);
    ok
}

#[inline(always)]
fn column<V: Lanes, const J: usize>(columns: &mut Columns<V>, ok: &mut V) {
    let mut rest = [V::zero(); N];
    rest[J..N].copy_from_slice(&columns[J][J..N]);
    let rounding = rest[J] * V::constant(pivot_rounding::<V::Scalar>());
    for k in 0..J {
        let factor = columns[k][J];
        for i in J..N {
            rest[i] = columns[k][i].neg_mul_add(factor, rest[i]);
        }
    }
    *ok = V::select((rounding * V::constant(-(N as f64))).lt(rest[J]), *ok, V::zero());
    let root = rounding.max(rest[J]).sqrt();
    let inverse = V::constant(1.0) / root;
    columns[J][J] = root;
    for i in J + 1..N {
        columns[J][i] = rest[i] * inverse;
    }
}

/// The covariance of one pixel, packed by components, of a root packed by places.
pub(in crate::temporal) fn square(root: &[f64; PACKED], places: &[usize; N]) -> [f64; PACKED] {
    let mut cov = [0.0; PACKED];
    for a in 0..N {
        for b in 0..=a {
            let (i, j) = (places[a], places[b]);
            cov[packed(a, b)] = (0..=i.min(j)).map(|k| root[packed(i, k)] * root[packed(j, k)]).sum();
        }
    }
    cov
}

/// Gives pixel `lane` of a block a covariance that has a root: a loaded diagonal, or a new start.
#[cold]
#[inline(never)]
pub(super) fn repair<T: SimdReal>(block: &mut [T], lane: usize, constants: &Constants<T>) {
    let mut mean: [f64; N] = std::array::from_fn(|k| block[k * BLOCK + lane].to_f64());
    let mut cov: [f64; PACKED] = std::array::from_fn(|k| block[(N + k) * BLOCK + lane].to_f64());
    let finite = mean.iter().chain(&cov).all(|v| v.is_finite());
    if !(finite && load_diagonal(&mut cov, &constants.start.1)) {
        mean = constants.start.0.map(Real::to_f64);
        cov = [0.0; PACKED];
        for k in 0..N {
            cov[packed(k, k)] = constants.start.1[k].to_f64();
        }
    }
    for (plane, value) in mean.into_iter().chain(cov).enumerate() {
        block[plane * BLOCK + lane] = T::from_f64(value);
    }
}

/// Raises the diagonal until every pivot is a safe part of it; false when even doubling does not help.
fn load_diagonal<T: SimdReal>(cov: &mut [f64; PACKED], start: &[T; N]) -> bool {
    for k in 0..N {
        // A variance that is gone has no meaningful covariances either.
        if cov[packed(k, k)] <= 0.0 {
            for j in 0..N {
                cov[packed(k, j)] = 0.0;
            }
            cov[packed(k, k)] = 1e-6 * start[k].to_f64();
        }
    }
    let mut load = 1e-6;
    while load <= 1.0 {
        let mut loaded = *cov;
        for k in 0..N {
            loaded[packed(k, k)] *= 1.0 + load;
        }
        if has_safe_pivots(&loaded, 0.1 * load) {
            *cov = loaded;
            return true;
        }
        load *= 10.0;
    }
    false
}

fn has_safe_pivots(cov: &[f64; PACKED], least: f64) -> bool {
    let mut l = [0.0; PACKED];
    for i in 0..N {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| l[packed(i, k)] * l[packed(j, k)]).sum();
            let rest = cov[packed(i, j)] - dot;
            if i == j {
                if rest <= least * cov[packed(i, i)] {
                    return false;
                }
                l[packed(i, i)] = rest.sqrt();
            } else {
                l[packed(i, j)] = rest / l[packed(j, j)];
            }
        }
    }
    true
}
