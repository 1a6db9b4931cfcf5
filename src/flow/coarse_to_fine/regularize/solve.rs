//! The 6x6 equations of a site.

use crate::simd::Lanes;

/// Index of entry (i, j), j <= i, in the list of the lower triangle, row by row.
#[inline(always)]
pub(super) const fn lower(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// Entries of the lower triangle of a symmetric 6x6 matrix.
pub(super) const ENTRIES: usize = 21;

/// Row and column of each entry in that list.
pub(super) const PLACES: [(usize, usize); ENTRIES] = {
    let mut places = [(0, 0); ENTRIES];
    let mut i = 0;
    while i < 6 {
        let mut j = 0;
        while j <= i {
            places[lower(i, j)] = (i, j);
            j += 1;
        }
        i += 1;
    }
    places
};

/// Keeps pivots positive: each grows by a share above its rounding error, and by a tiny constant. As the
/// unknowns are increments, both only shorten undetermined steps.
pub(super) struct Guard<V> {
    share: V,
    least: V,
    least_product: V,
}

impl<V: Lanes> Guard<V> {
    pub fn new() -> Self {
        let (share, least, product) =
            if size_of::<V::Scalar>() == 4 { (4e-6, 1e-9, 1e-35) } else { (1e-14, 1e-13, 1e-60) };
        Self { share: V::constant(share), least: V::constant(least), least_product: V::constant(product) }
    }
}

/// Factorises a matrix, given by its lower triangle, into `L` below the diagonal and `1 / D` on it.
///
/// Pivots are taken in pairs, which share one division: with the leading block `[[a, b], [b, c]]` and its
/// determinant `d` they are `a` and `d / a`, and their inverses follow from `1 / (a d)`.
#[inline(always)]
pub(super) fn factorise<V: Lanes>(m: &mut [V; ENTRIES], guard: &Guard<V>) {
    for i in 0..6 {
        let diagonal = m[lower(i, i)];
        m[lower(i, i)] = diagonal.mul_add(guard.share, diagonal + guard.least);
    }
    for i in [0, 2, 4] {
        let [first, second] = eliminate(m, i, guard);
        (m[lower(i, i)], m[lower(i + 1, i + 1)]) = (first, second);
    }
}

#[inline(always)]
pub(super) fn solve<V: Lanes>(factors: &[V; ENTRIES], right: [V; 6]) -> [V; 6] {
    let mut x = right;
    for i in 1..6 {
        for k in 0..i {
            x[i] = factors[lower(i, k)].neg_mul_add(x[k], x[i]);
        }
    }
    for i in (0..6).rev() {
        x[i] = x[i] * factors[lower(i, i)];
        for k in i + 1..6 {
            x[i] = factors[lower(k, i)].neg_mul_add(x[k], x[i]);
        }
    }
    x
}

/// Eliminates columns `i` and `i + 1`, turning them into those of `L`; returns the inverses of both pivots.
#[inline(always)]
fn eliminate<V: Lanes>(m: &mut [V; ENTRIES], i: usize, guard: &Guard<V>) -> [V; 2] {
    let (a, b, c) = (m[lower(i, i)], m[lower(i + 1, i)], m[lower(i + 1, i + 1)]);
    let product = a * c;
    let determinant = b.neg_mul_add(b, product).max(product * guard.share);
    let both = V::constant(1.0) / (a * determinant).max(guard.least_product);
    let inverse = [determinant * both, a * a * both];
    let mixed = b * inverse[0];
    m[lower(i + 1, i)] = mixed;
    for j in i + 2..6 {
        // Row j, times D: this times L is subtracted from the remaining matrix.
        let first = m[lower(j, i)];
        let second = mixed.neg_mul_add(first, m[lower(j, i + 1)]);
        m[lower(j, i)] = first * inverse[0];
        m[lower(j, i + 1)] = second * inverse[1];
        for k in i + 2..=j {
            let rest = m[lower(k, i)].neg_mul_add(first, m[lower(j, k)]);
            m[lower(j, k)] = m[lower(k, i + 1)].neg_mul_add(second, rest);
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;
    use nalgebra::{Matrix6, Vector6};

    /// The normal equations of flow at some places.
    fn random(seed: u64, places: usize) -> ([f64; ENTRIES], Matrix6<f64>) {
        let rng = CounterRng::new(seed);
        let mut dense = Matrix6::zeros();
        for i in 0..places {
            let r: [f64; 4] = std::array::from_fn(|k| rng.normal((4 * i + k) as u64));
            let (x, y) = (3.0 * r[2], 3.0 * r[3]);
            let row = Vector6::new(r[0], r[1], x * r[0], x * r[1], y * r[0], y * r[1]);
            dense += row * row.transpose();
        }
        let mut list = [0.0; ENTRIES];
        (0..6).for_each(|i| (0..=i).for_each(|j| list[lower(i, j)] = dense[(i, j)]));
        (list, dense)
    }

    fn solved<T: crate::simd::SimdReal>(mut m: [T; ENTRIES], right: [T; 6]) -> [T; 6] {
        factorise(&mut m, &Guard::new());
        solve(&m, right)
    }

    #[test]
    fn singular_equations_give_steps_that_solve_them() {
        for (places, seed) in (0..6).flat_map(|places| (0..50).map(move |seed| (places, seed))) {
            let (list, dense) = random(seed, places);
            let right = dense * Vector6::repeat(0.1);
            let good = |x: [f64; 6], tolerance: f64| {
                let left = dense * Vector6::from(x) - right;
                x.iter().all(|x| x.is_finite() && x.abs() < 10.0) && left.norm() <= tolerance * right.norm()
            };
            let double = solved::<f64>(list, right.into());
            assert!(good(double, 1e-9), "{places} {seed}: {double:?}");
            let single = solved::<f32>(list.map(|x| x as f32), std::array::from_fn(|i| right[i] as f32));
            assert!(good(single.map(f64::from), 1e-3), "{places} {seed}: {single:?}");
        }
    }
}
