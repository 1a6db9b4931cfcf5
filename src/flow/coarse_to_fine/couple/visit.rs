//! One visit to a row of sites.

use super::solve::{ENTRIES, Guard, PLACES, factorise, lower, solve};
use super::{Coupling, EQUATIONS, HALF};
use crate::flow::coarse_to_fine::data::{ERROR, normal, right};
use crate::flow::coarse_to_fine::grid::{LEFT, Planes};
use crate::simd::{Lanes, SimdReal};
use std::ops::Range;

/// The values of an expression for each index in a list, written out: the optimiser does not unroll loops
/// with this much in them.
macro_rules! each {
    ($index:ident in [$($value:literal)*] => $expression:expr) => {
        [$({ let $index: usize = $value; $expression }),*]
    };
}

/// What binds the sites of a level.
pub(super) struct Bonds<'a, T> {
    pub data: &'a Planes<T>,
    /// `s^2`, positive.
    pub noise: T,
    pub coupling: &'a Coupling,
}

/// SamplingGrid of a row that are visited together: their bonds to the right stay in the first-level cache.
const RUN: usize = 128;
/// The pulls of a bond along the row on the sites at its ends.
const PULLS: usize = 6;
/// These for a run of sites, sample [`LEFT`] the first's.
type Pulls<T> = [[T; LEFT + RUN + LEFT]; PULLS];

/// What the visits to a row need, made when they begin: a row is visited many times, and this is one stream
/// of memory.
#[derive(Debug, Default)]
pub(super) struct Packed<T> {
    /// For each vector of sites its equations over their noise, [`EQUATIONS`] planes one after the other.
    equations: Vec<T>,
    /// For each vector of sites the factors of its matrix, bonds included, [`ENTRIES`] planes.
    factors: Vec<T>,
    /// The row of the data term, fetched in the order of memory: the planes' short lines, read side by side,
    /// would come one by one.
    near: Vec<T>,
}

/// Lines of a row's weights `omega`: of the bonds from each site to the next in its row, to the row above and
/// to the row below; 0 where there is none, and beside the sites.
pub(super) const WEIGHTS: usize = 3;
const ALONG: usize = 0;
const UP: usize = 1;
const DOWN: usize = 2;

impl<T: SimdReal> Packed<T> {
    /// Takes the equations of row `y`. Beside the sites there is no data.
    #[inline(always)]
    pub fn fill<V: Lanes<Scalar = T>>(&mut self, bonds: &Bonds<'_, T>, y: usize) {
        let (data, zero) = (bonds.data, T::from_f64(0.0));
        self.near.clear();
        self.near.extend_from_slice(data.row(y));
        self.equations.resize(EQUATIONS * data.padded(), zero);
        self.factors.resize(ENTRIES * data.padded(), zero);
        let (row, stride, width) = (self.near.as_slice(), data.stride(), data.width);
        let (noise, one) = (V::splat(bonds.noise), V::constant(1.0));
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

    /// Factorises the sites' matrices with bonds of the given weights.
    #[inline(always)]
    pub fn factorise<V: Lanes<Scalar = T>>(&mut self, bonds: &Bonds<'_, T>, weights: &[T]) {
        let strengths = Strengths::<V>::new(bonds.coupling);
        let stride = weights.len() / WEIGHTS;
        let line = |k: usize| &weights[k * stride..(k + 1) * stride];
        let (along, above, below) = (line(ALONG), line(UP), line(DOWN));
        let blocks = self.equations.chunks_exact(EQUATIONS * V::LANES);
        for (i, (block, factors)) in blocks.zip(self.factors.chunks_exact_mut(ENTRIES * V::LANES)).enumerate() {
            let at = LEFT + i * V::LANES;
            let ends = [V::load(&along[at - 1..]), V::load(&along[at..]), V::load(&above[at..]), V::load(&below[at..])];
            let mut matrix = each!(k in [0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20] =>
                entry::<V, T>(block, PLACES[k].0, PLACES[k].1));
            bind(&mut matrix, ends, &strengths);
            factorise(&mut matrix, &strengths.guard);
            for (entry, out) in matrix.iter().zip(factors.chunks_exact_mut(V::LANES)) {
                entry.store(out);
            }
        }
    }
}

/// Weighs the bonds of the row `own` by their present strain.
#[inline(always)]
pub(super) fn weigh<V: Lanes<Scalar = T>, T: SimdReal>(
    bonds: &Bonds<'_, T>,
    own: &[T],
    around: Around<'_, T>,
    weights: &mut [T],
) {
    let strengths = Strengths::<V>::new(bonds.coupling);
    let (stride, width) = (around.stride, bonds.data.width);
    let count = stride - 2 * LEFT;
    let there = [Some((own, 1)), around.above.map(|row| (row, 0)), around.below.map(|row| (row, 0))];
    let ways = [(1, true), (2, false), (2, true)];
    let here = lines(own, stride, LEFT, count);
    for ((there, way), out) in there.into_iter().zip(ways).zip(weights.chunks_exact_mut(stride)) {
        out.fill(T::from_f64(0.0));
        let Some((row, shift)) = there else { continue };
        let there = lines(row, stride, LEFT + shift, count);
        for x in (0..count).step_by(V::LANES) {
            strain(&six::<V, T>(&here, x), &six(&there, x), way).weight(&strengths).store(&mut out[LEFT + x..]);
        }
        out[LEFT + width - shift..].fill(T::from_f64(0.0));
    }
}

/// Adds what bonds of the given strengths (behind, ahead, up, down) do to the site's matrix.
#[inline(always)]
fn bind<V: Lanes>(matrix: &mut [V; ENTRIES], [behind, ahead, up, down]: [V; 4], strengths: &Strengths<V>) {
    let half = V::constant(HALF);
    let (across, along) = (behind + ahead, up + down);
    let by_jacobian = (across + along) * strengths.jacobian;
    let steep = strengths.flow * half;
    let bonds = [
        [(across + along) * strengths.flow, V::zero(), V::zero()],
        [(ahead - behind) * steep, (steep * half).mul_add(across, by_jacobian), V::zero()],
        [(down - up) * steep, V::zero(), (steep * half).mul_add(along, by_jacobian)],
    ];
    for k in 0..3 {
        for l in 0..=k {
            for c in 0..2 {
                let place = lower(2 * k + c, 2 * l + c);
                matrix[place] = matrix[place] + bonds[k][l];
            }
        }
    }
}

/// The rows that a row's bonds lead to.
#[derive(Clone, Copy)]
pub(super) struct Around<'a, T> {
    /// Nothing above the first row.
    pub above: Option<&'a [T]>,
    /// Nothing below the last row.
    pub below: Option<&'a [T]>,
    /// From a plane's row to the next plane's.
    pub stride: usize,
}

/// The strengths in vectors.
pub(super) struct Strengths<V> {
    flow: V,
    jacobian: V,
    /// The same over the strain at which bonds break.
    flow_strain: V,
    jacobian_strain: V,
    guard: Guard<V>,
}

impl<V: Lanes> Strengths<V> {
    pub fn new(coupling: &Coupling) -> Self {
        let Coupling { flow, jacobian, break_at, .. } = *coupling;
        Self {
            flow: V::constant(flow),
            jacobian: V::constant(jacobian),
            flow_strain: V::constant(flow / break_at),
            jacobian_strain: V::constant(jacobian / break_at),
            guard: Guard::new(),
        }
    }
}

/// How far two neighbours are from giving one affine motion.
struct Strain<V> {
    /// `du`: the flows' difference in the middle between them.
    flow: [V; 2],
    /// `dJ`.
    jacobian: [V; 4],
}

/// The strain between `here` and the neighbour `there`, forwards or backwards along axis 1 (x) or 2 (y).
#[inline(always)]
fn strain<V: Lanes>(here: &[V; 6], there: &[V; 6], (axis, forwards): (usize, bool)) -> Strain<V> {
    let half = V::constant(if forwards { HALF } else { -HALF });
    let (mut flow, mut jacobian) = ([half; 2], [half; 4]);
    for c in 0..2 {
        flow[c] = (here[2 * axis + c] + there[2 * axis + c]).mul_add(half, here[c] - there[c]);
    }
    for k in 0..4 {
        jacobian[k] = here[2 + k] - there[2 + k];
    }
    Strain { flow, jacobian }
}

impl<V: Lanes> Strain<V> {
    /// The strength of a bond under this strain, 1 without any.
    #[inline(always)]
    fn weight(&self, strengths: &Strengths<V>) -> V {
        let [du, dv] = self.flow;
        let [a, b, c, d] = self.jacobian;
        let flow = dv.mul_add(dv, du * du);
        let jacobian = b.mul_add(b, a * a) + d.mul_add(d, c * c);
        let strain = jacobian.mul_add(strengths.jacobian_strain, flow.mul_add(strengths.flow_strain, V::constant(1.0)));
        V::constant(1.0) / strain
    }

    /// What a bond of such a strength does to the site at its beginning, `omega flow du` and `omega jacobian
    /// dJ`; to the one at its end it does the opposite, but for the flow's pull on the derivative along the
    /// bond, which is the same at both ends.
    #[inline(always)]
    fn pull(mut self, weight: V, strengths: &Strengths<V>) -> Self {
        let (by_flow, by_jacobian) = (weight * strengths.flow, weight * strengths.jacobian);
        for x in &mut self.flow {
            *x = *x * by_flow;
        }
        for x in &mut self.jacobian {
            *x = *x * by_jacobian;
        }
        self
    }
}

/// One vector of each of the six planes.
#[inline(always)]
fn six<V: Lanes<Scalar = T>, T: SimdReal>(planes: &[&[T]; 6], i: usize) -> [V; 6] {
    each!(k in [0 1 2 3 4 5] => V::load(&planes[k][i..]))
}

/// Vector `plane` of the equations of some sites.
#[inline(always)]
fn at<V: Lanes<Scalar = T>, T: SimdReal>(block: &[T], plane: usize) -> V {
    V::load(&block[plane * V::LANES..])
}

/// Entry (i, j) of their normal matrix.
#[inline(always)]
fn entry<V: Lanes<Scalar = T>, T: SimdReal>(block: &[T], i: usize, j: usize) -> V {
    at(block, normal(i, j))
}

/// The bonds that end (`back`: 1) or begin (0) at some sites.
#[inline(always)]
fn pulls_at<V: Lanes<Scalar = T>, T: SimdReal>(pulls: &Pulls<T>, i: usize, back: usize) -> [V; PULLS] {
    each!(k in [0 1 2 3 4 5] => V::load(&pulls[k][LEFT + i - back..]))
}

/// `start` less row `i` of the normal matrix times `m`.
#[inline(always)]
fn less_row<V: Lanes<Scalar = T>, T: SimdReal>(block: &[T], i: usize, m: &[V; 6], start: V) -> V {
    let [a, b, c, d, e, f] = each!(j in [0 1 2 3 4 5] => entry::<V, T>(block, i, j));
    let start = b.neg_mul_add(m[1], a.neg_mul_add(m[0], start));
    let start = d.neg_mul_add(m[3], c.neg_mul_add(m[2], start));
    f.neg_mul_add(m[5], e.neg_mul_add(m[4], start))
}

/// The run of each plane that begins with sample `first` of its row.
#[inline(always)]
fn lines<T>(row: &[T], stride: usize, first: usize, len: usize) -> [&[T]; 6] {
    std::array::from_fn(|k| &row[k * stride + first..][..len])
}

/// Solves the equations of each site of the row `own` with its neighbours as they are, those in the row as
/// they were before the visit.
#[inline(always)]
pub(super) fn visit<V: Lanes<Scalar = T>, T: SimdReal>(
    bonds: &Bonds<'_, T>,
    (packed, weights): (&Packed<T>, &[T]),
    own: &mut [T],
    around: Around<'_, T>,
) {
    let strengths = Strengths::<V>::new(bonds.coupling);
    let padded = own.len() / 6 - 2 * LEFT;
    // No bond leads to the first site from the left.
    let mut pulls = [[T::from_f64(0.0); LEFT + RUN + LEFT]; PULLS];
    let mut start = 0;
    while start < padded {
        let run = LEFT + start..LEFT + padded.min(start + RUN);
        let count = run.len();
        pull::<V, T>(weights, own, around.stride, run.clone(), &strengths, &mut pulls);
        settle::<V, T>((packed, weights), own, around, run, &strengths, &pulls);
        for plane in &mut pulls {
            plane[LEFT - 1] = plane[LEFT + count - 1];
        }
        start += count;
    }
}

/// The bonds from each site of a run to its right neighbour.
#[inline(always)]
fn pull<V: Lanes<Scalar = T>, T: SimdReal>(
    weights: &[T],
    own: &[T],
    stride: usize,
    run: Range<usize>,
    strengths: &Strengths<V>,
    pulls: &mut Pulls<T>,
) {
    let count = run.len().min(RUN);
    let here = lines(own, stride, run.start, count);
    let there = lines(own, stride, run.start + 1, count);
    let weights = &weights[ALONG * stride + run.start..][..count];
    for i in (0..count).step_by(V::LANES) {
        let strain = strain(&six::<V, T>(&here, i), &six(&there, i), (1, true));
        let pull = strain.pull(V::load(&weights[i..]), strengths);
        for c in 0..2 {
            pull.flow[c].store(&mut pulls[c][LEFT + i..]);
        }
        for k in 0..4 {
            pull.jacobian[k].store(&mut pulls[2 + k][LEFT + i..]);
        }
    }
}

/// Moves each site of a run to where its equations are solved.
#[inline(always)]
fn settle<V: Lanes<Scalar = T>, T: SimdReal>(
    (packed, weights): (&Packed<T>, &[T]),
    own: &mut [T],
    around: Around<'_, T>,
    run: Range<usize>,
    strengths: &Strengths<V>,
    pulls: &Pulls<T>,
) {
    let (stride, count) = (around.stride, run.len().min(RUN));
    let half = V::constant(HALF);
    // A row that is not there pulls with no weight; any row may stand in for it.
    let idle = [T::from_f64(0.0); RUN];
    let [above, below] = [around.above.or(around.below), around.below.or(around.above)]
        .map(|row| row.map_or([&idle[..count]; 6], |row| lines(row, stride, run.start, count)));
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
        let up = strain(&here, &six(&above, i), (2, false)).pull(V::load(&up_weights[i..]), strengths);
        let down = strain(&here, &six(&below, i), (2, true)).pull(V::load(&down_weights[i..]), strengths);
        let ahead = pulls_at::<V, T>(pulls, i, 0);
        let behind = pulls_at::<V, T>(pulls, i, 1);

        // Downhill: minus half the gradient of the energy.
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
