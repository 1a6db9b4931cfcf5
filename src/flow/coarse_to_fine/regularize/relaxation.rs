//! Relaxation of one row of sites.

use super::smoothness::{
    ALONG, DOWN, NeighbourRows, SmoothnessProblem, Strengths, UP, WEIGHTS, add_smoothness, each, lines, six, strain,
};
use super::solve::{ENTRIES, PLACES, factorise, solve};
use super::{EQUATIONS, HALF_SPACING};
use crate::flow::coarse_to_fine::{data_term::ERROR, data_term::normal, data_term::right, planes::LEFT};
use crate::simd::{Lanes, SimdReal};
use std::ops::Range;

/// Sites of a row that are relaxed together: their edges to the right stay in the first-level cache.
const RUN_SITES: usize = 128;
/// Gradient terms of an edge along the row at the sites of its ends.
const EDGE_TERMS: usize = 6;
/// The same for a run of sites; sample [`LEFT`] is the first's.
type EdgeTerms<T> = [[T; LEFT + RUN_SITES + LEFT]; EDGE_TERMS];

/// A row's equations and factors, packed once: a row is visited many times, and this is one stream of memory.
#[derive(Debug, Default)]
pub(super) struct PackedRow<T> {
    /// For each vector of sites its equations over their noise, [`EQUATIONS`] planes in sequence.
    equations: Vec<T>,
    /// For each vector of sites the factors of its matrix with smoothness, [`ENTRIES`] planes.
    factors: Vec<T>,
    /// The row of the data term, copied in memory order: reading its planes side by side would be slower.
    near: Vec<T>,
}

impl<T: SimdReal> PackedRow<T> {
    /// Packs the equations of row `y`. Beside the sites there are no data.
    #[inline(always)]
    pub fn fill<V: Lanes<Scalar = T>>(&mut self, problem: &SmoothnessProblem<'_, T>, y: usize) {
        let (data, zero) = (problem.data, T::from_f64(0.0));
        self.near.clear();
        self.near.extend_from_slice(data.row(y));
        self.equations.resize(EQUATIONS * data.padded(), zero);
        self.factors.resize(ENTRIES * data.padded(), zero);
        let (row, stride, width) = (self.near.as_slice(), data.stride(), data.width);
        let (noise, one) = (V::splat(problem.noise), V::constant(1.0));
        for (i, block) in self.equations.chunks_exact_mut(EQUATIONS * V::LANES).enumerate() {
            let x = i * V::LANES;
            if x >= width {
                block.fill(zero);
                continue;
            }
            let weight = one / (noise + V::load(&row[ERROR * stride + LEFT + x..]).max(V::zero()));
            for (plane, out) in block.chunks_exact_mut(V::LANES).enumerate() {
                (V::load(&row[plane * stride + LEFT + x..]) * weight).store(out);
                if x + V::LANES > width {
                    out[width - x..].fill(zero);
                }
            }
        }
    }

    #[inline(always)]
    pub fn factorise<V: Lanes<Scalar = T>>(&mut self, problem: &SmoothnessProblem<'_, T>, weights: &[T]) {
        let strengths = Strengths::<V>::new(problem.smoothness);
        let stride = weights.len() / WEIGHTS;
        let line = |k: usize| &weights[k * stride..(k + 1) * stride];
        let (along, above, below) = (line(ALONG), line(UP), line(DOWN));
        let blocks = self.equations.chunks_exact(EQUATIONS * V::LANES);
        for (i, (block, factors)) in blocks.zip(self.factors.chunks_exact_mut(ENTRIES * V::LANES)).enumerate() {
            let at = LEFT + i * V::LANES;
            let ends = [V::load(&along[at - 1..]), V::load(&along[at..]), V::load(&above[at..]), V::load(&below[at..])];
            let mut matrix = each!(k in [0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20] =>
                entry::<V, T>(block, PLACES[k].0, PLACES[k].1));
            add_smoothness(&mut matrix, ends, &strengths);
            factorise(&mut matrix, &strengths.guard);
            for (entry, out) in matrix.iter().zip(factors.chunks_exact_mut(V::LANES)) {
                entry.store(out);
            }
        }
    }
}

/// Vector `plane` of the equations of some sites.
#[inline(always)]
fn at<V: Lanes<Scalar = T>, T: SimdReal>(block: &[T], plane: usize) -> V {
    V::load(&block[plane * V::LANES..])
}

#[inline(always)]
fn entry<V: Lanes<Scalar = T>, T: SimdReal>(block: &[T], i: usize, j: usize) -> V {
    at(block, normal(i, j))
}

/// Terms of the edges that end (`back`: 1) or begin (0) at some sites.
#[inline(always)]
fn edge_terms_at<V: Lanes<Scalar = T>, T: SimdReal>(
    edge_terms: &EdgeTerms<T>,
    i: usize,
    back: usize,
) -> [V; EDGE_TERMS] {
    each!(k in [0 1 2 3 4 5] => V::load(&edge_terms[k][LEFT + i - back..]))
}

/// `start` less row `i` of the normal matrix times `m`.
#[inline(always)]
fn less_row<V: Lanes<Scalar = T>, T: SimdReal>(block: &[T], i: usize, m: &[V; 6], start: V) -> V {
    let [a, b, c, d, e, f] = each!(j in [0 1 2 3 4 5] => entry::<V, T>(block, i, j));
    let start = b.neg_mul_add(m[1], a.neg_mul_add(m[0], start));
    let start = d.neg_mul_add(m[3], c.neg_mul_add(m[2], start));
    f.neg_mul_add(m[5], e.neg_mul_add(m[4], start))
}

/// Solves the equations of each site of the row `own`; its neighbours have their values from before.
#[inline(always)]
pub(super) fn relax_row<V: Lanes<Scalar = T>, T: SimdReal>(
    problem: &SmoothnessProblem<'_, T>,
    (packed, weights): (&PackedRow<T>, &[T]),
    own: &mut [T],
    neighbours: NeighbourRows<'_, T>,
) {
    let strengths = Strengths::<V>::new(problem.smoothness);
    let padded = own.len() / 6 - 2 * LEFT;
    // The first site has no edge to the left.
    let mut edge_terms = [[T::from_f64(0.0); LEFT + RUN_SITES + LEFT]; EDGE_TERMS];
    let mut start = 0;
    while start < padded {
        let run = LEFT + start..LEFT + padded.min(start + RUN_SITES);
        let count = run.len();
        edge_term::<V, T>(weights, own, neighbours.stride, run.clone(), &strengths, &mut edge_terms);
        solve_sites::<V, T>((packed, weights), own, neighbours, run, &strengths, &edge_terms);
        for plane in &mut edge_terms {
            plane[LEFT - 1] = plane[LEFT + count - 1];
        }
        start += count;
    }
}

/// Terms of the edges from each site of a run to its right neighbour.
#[inline(always)]
fn edge_term<V: Lanes<Scalar = T>, T: SimdReal>(
    weights: &[T],
    own: &[T],
    stride: usize,
    run: Range<usize>,
    strengths: &Strengths<V>,
    edge_terms: &mut EdgeTerms<T>,
) {
    let count = run.len().min(RUN_SITES);
    let here = lines(own, stride, run.start, count);
    let there = lines(own, stride, run.start + 1, count);
    let weights = &weights[ALONG * stride + run.start..][..count];
    for i in (0..count).step_by(V::LANES) {
        let strain = strain(&six::<V, T>(&here, i), &six(&there, i), (1, true));
        let edge_term = strain.edge_term(V::load(&weights[i..]), strengths);
        for c in 0..2 {
            edge_term.flow[c].store(&mut edge_terms[c][LEFT + i..]);
        }
        for k in 0..4 {
            edge_term.jacobian[k].store(&mut edge_terms[2 + k][LEFT + i..]);
        }
    }
}

#[inline(always)]
fn solve_sites<V: Lanes<Scalar = T>, T: SimdReal>(
    (packed, weights): (&PackedRow<T>, &[T]),
    own: &mut [T],
    neighbours: NeighbourRows<'_, T>,
    run: Range<usize>,
    strengths: &Strengths<V>,
    edge_terms: &EdgeTerms<T>,
) {
    let (stride, count) = (neighbours.stride, run.len().min(RUN_SITES));
    let half = V::constant(HALF_SPACING);
    // A missing row has weight 0; any row may stand in for it.
    let zeros = [T::from_f64(0.0); RUN_SITES];
    let [above, below] = [neighbours.above.or(neighbours.below), neighbours.below.or(neighbours.above)]
        .map(|row| row.map_or([&zeros[..count]; 6], |row| lines(row, stride, run.start, count)));
    let weights = |k: usize| &weights[k * stride + run.start..][..count];
    let (up_weights, down_weights) = (weights(UP), weights(DOWN));
    let sites = run.start - LEFT..run.start - LEFT + count;
    let blocks = packed.equations[EQUATIONS * sites.start..EQUATIONS * sites.end].chunks_exact(EQUATIONS * V::LANES);
    let factors = packed.factors[ENTRIES * sites.start..ENTRIES * sites.end].chunks_exact(ENTRIES * V::LANES);
    let mut planes = own.chunks_exact_mut(stride);
    let own: [&mut [T]; 6] =
        std::array::from_fn(|_| planes.next().map_or(&mut [][..], |plane| &mut plane[run.clone()]));
    for ((block, factors), i) in blocks.zip(factors).zip((0..count).step_by(V::LANES)) {
        let here = each!(k in [0 1 2 3 4 5] => V::load(&own[k][i..]));
        let up = strain(&here, &six(&above, i), (2, false)).edge_term(V::load(&up_weights[i..]), strengths);
        let down = strain(&here, &six(&below, i), (2, true)).edge_term(V::load(&down_weights[i..]), strengths);
        let ahead = edge_terms_at::<V, T>(edge_terms, i, 0);
        let behind = edge_terms_at::<V, T>(edge_terms, i, 1);

        // Minus half the gradient of the energy.
        let mut step = each!(k in [0 1 2 3 4 5] =>
            less_row(block, k, &here, at(block, right(k))));
        for c in 0..2 {
            let along = [behind[c] + ahead[c], up.flow[c] - down.flow[c]];
            step[c] = step[c] + (behind[c] - ahead[c]) - (up.flow[c] + down.flow[c]);
            step[2 + c] = half.neg_mul_add(along[0], step[2 + c]);
            step[4 + c] = half.mul_add(along[1], step[4 + c]);
        }
        for k in 0..4 {
            step[2 + k] = step[2 + k] + (behind[2 + k] - ahead[2 + k]) - (up.jacobian[k] + down.jacobian[k]);
        }
        let factors = each!(k in [0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20] => at(factors, k));
        let step = solve(&factors, step);
        for k in 0..6 {
            (here[k] + step[k]).store(&mut own[k][i..]);
        }
    }
}
