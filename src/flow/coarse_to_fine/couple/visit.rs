//! One visit to a row of sites.

use super::solve::{Guard, PLACES, lower, solve};
use super::{Coupling, EQUATIONS, HALF};
use crate::flow::coarse_to_fine::data::{ERROR, normal, right};
use crate::flow::coarse_to_fine::grid::{LEFT, Planes};
use crate::simd::{Lanes, SimdReal};
use std::ops::Range;

/// What binds the sites of a level.
pub(super) struct Bonds<'a, T> {
    pub data: &'a Planes<T>,
    /// `s^2`, positive.
    pub noise: T,
    pub coupling: &'a Coupling,
    /// 1 where a bond leads from a site to its right neighbour, else 0.
    pub edges: &'a [T],
}

/// Sites of a row that are visited together: their bonds to the right stay in the first-level cache.
const RUN: usize = 128;
/// Values a bond along the row leaves for the sites at its ends: its strength and the six pulls.
const PULLS: usize = 7;
/// These for a run of sites, sample [`LEFT`] the first's.
type Pulls<T> = [[T; LEFT + RUN + LEFT]; PULLS];

/// Writes the equations of row `y` over their noise to `packed`: for each vector of sites its [`EQUATIONS`] planes, one after the other.
///
/// A row is visited many times; this way it is one stream of memory. Beside the sites there is no data.
#[inline(always)]
pub(super) fn pack<V: Lanes<Scalar = T>, T: SimdReal>(bonds: &Bonds<'_, T>, y: usize, packed: &mut [T]) {
    let data = bonds.data;
    let (row, stride, width) = (data.row(y), data.stride(), data.width);
    let (noise, one) = (V::splat(bonds.noise), V::constant(1.0));
    for (i, block) in packed.chunks_exact_mut(EQUATIONS * V::LANES).enumerate() {
        let x = i * V::LANES;
        if x >= width {
            block.fill(T::from_f64(0.0));
            continue;
        }
        let weight = one / (noise + V::load(&row[ERROR * stride + LEFT + x..]).max(V::zero()));
        for (plane, out) in block.chunks_exact_mut(V::LANES).enumerate() {
            (V::load(&row[plane * stride + LEFT + x..]) * weight).store(out);
            if x + V::LANES > width {
                out[width - x..].fill(T::from_f64(0.0));
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
struct Strengths<V> {
    flow: V,
    jacobian: V,
    /// The same over the strain at which bonds break.
    flow_strain: V,
    jacobian_strain: V,
    guard: Guard<V>,
}

impl<V: Lanes> Strengths<V> {
    fn new(coupling: &Coupling) -> Self {
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

/// What a bond does to the site at its beginning; to the one at its end it does the opposite, but for the flow's pull on the
/// derivative along the bond, which is the same at both ends.
struct Bond<V> {
    /// Its weight `omega`.
    weight: V,
    /// `omega flow du`.
    flow: [V; 2],
    /// `omega jacobian dJ`.
    jacobian: [V; 4],
}

/// The bond from `here` to the neighbour `there`, forwards or backwards along axis 1 (x) or 2 (y); `full` is its weight without strain.
#[inline(always)]
fn bond<V: Lanes>(
    here: &[V; 6],
    there: &[V; 6],
    (axis, forwards): (usize, bool),
    full: V,
    strengths: &Strengths<V>,
) -> Bond<V> {
    let half = V::constant(if forwards { HALF } else { -HALF });
    let mut strain = V::constant(1.0);
    let (mut flow, mut jacobian) = ([strain; 2], [strain; 4]);
    for c in 0..2 {
        flow[c] = (here[2 * axis + c] + there[2 * axis + c]).mul_add(half, here[c] - there[c]);
    }
    for k in 0..4 {
        jacobian[k] = here[2 + k] - there[2 + k];
    }
    let flow_square = flow[1].mul_add(flow[1], flow[0] * flow[0]);
    let first = jacobian[1].mul_add(jacobian[1], jacobian[0] * jacobian[0]);
    let second = jacobian[3].mul_add(jacobian[3], jacobian[2] * jacobian[2]);
    strain = flow_square.mul_add(strengths.flow_strain, strain);
    strain = (first + second).mul_add(strengths.jacobian_strain, strain);
    let weight = full / strain;
    let (by_flow, by_jacobian) = (weight * strengths.flow, weight * strengths.jacobian);
    for x in &mut flow {
        *x = *x * by_flow;
    }
    for x in &mut jacobian {
        *x = *x * by_jacobian;
    }
    Bond { weight, flow, jacobian }
}

/// The values of an expression for each index in a list, written out: the optimiser does not unroll loops with this much in them.
macro_rules! each {
    ($index:ident in [$($value:literal)*] => $expression:expr) => {
        [$({ let $index: usize = $value; $expression }),*]
    };
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
    each!(k in [0 1 2 3 4 5 6] => V::load(&pulls[k][LEFT + i - back..]))
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

/// Solves the equations of each site of the row `own` with its neighbours as they are, those in the row as they were before the visit.
#[inline(always)]
pub(super) fn visit<V: Lanes<Scalar = T>, T: SimdReal>(
    bonds: &Bonds<'_, T>,
    packed: &[T],
    own: &mut [T],
    around: Around<'_, T>,
) {
    let strengths = Strengths::<V>::new(bonds.coupling);
    let padded = bonds.edges.len();
    // No bond leads to the first site from the left.
    let mut pulls = [[T::from_f64(0.0); LEFT + RUN + LEFT]; PULLS];
    let mut start = 0;
    while start < padded {
        let run = LEFT + start..LEFT + padded.min(start + RUN);
        let count = run.len();
        pull::<V, T>(own, around.stride, run.clone(), &bonds.edges[start..], &strengths, &mut pulls);
        let equations = &packed[EQUATIONS * start..EQUATIONS * (start + count)];
        settle::<V, T>(equations, own, around, run, &strengths, &pulls);
        for plane in &mut pulls {
            plane[LEFT - 1] = plane[LEFT + count - 1];
        }
        start += count;
    }
}

/// The bonds from each site of a run to its right neighbour.
#[inline(always)]
fn pull<V: Lanes<Scalar = T>, T: SimdReal>(
    own: &[T],
    stride: usize,
    run: Range<usize>,
    edges: &[T],
    strengths: &Strengths<V>,
    pulls: &mut Pulls<T>,
) {
    let count = run.len().min(RUN);
    let here = lines(own, stride, run.start, count);
    let there = lines(own, stride, run.start + 1, count);
    for i in (0..count).step_by(V::LANES) {
        let bond = bond(&six::<V, T>(&here, i), &six(&there, i), (1, true), V::load(&edges[i..]), strengths);
        bond.weight.store(&mut pulls[0][LEFT + i..]);
        for c in 0..2 {
            bond.flow[c].store(&mut pulls[1 + c][LEFT + i..]);
        }
        for k in 0..4 {
            bond.jacobian[k].store(&mut pulls[3 + k][LEFT + i..]);
        }
    }
}

/// Moves each site of a run to where its equations are solved.
#[inline(always)]
fn settle<V: Lanes<Scalar = T>, T: SimdReal>(
    packed: &[T],
    own: &mut [T],
    around: Around<'_, T>,
    run: Range<usize>,
    strengths: &Strengths<V>,
    pulls: &Pulls<T>,
) {
    let (stride, count) = (around.stride, run.len().min(RUN));
    let (zero, one, half) = (V::zero(), V::constant(1.0), V::constant(HALF));
    let full = [around.above, around.below].map(|row| if row.is_some() { one } else { zero });
    // A row that is not there pulls with no weight; any row may stand in for it.
    let idle = [T::from_f64(0.0); RUN];
    let [above, below] = [around.above.or(around.below), around.below.or(around.above)]
        .map(|row| row.map_or([&idle[..count]; 6], |row| lines(row, stride, run.start, count)));
    let mut planes = own.chunks_exact_mut(stride);
    let own: [&mut [T]; 6] =
        std::array::from_fn(|_| planes.next().map_or(&mut [][..], |plane| &mut plane[run.clone()]));
    for (block, i) in packed.chunks_exact(EQUATIONS * V::LANES).zip((0..count).step_by(V::LANES)) {
        let here = each!(k in [0 1 2 3 4 5] => V::load(&own[k][i..]));
        let up = bond(&here, &six(&above, i), (2, false), full[0], strengths);
        let down = bond(&here, &six(&below, i), (2, true), full[1], strengths);
        let ahead = pulls_at::<V, T>(pulls, i, 0);
        let behind = pulls_at::<V, T>(pulls, i, 1);

        // Downhill: minus half the gradient of the energy.
        let mut step = each!(k in [0 1 2 3 4 5] =>
            less_row(block, k, &here, at(block, right(k))));
        for c in 0..2 {
            let along = [behind[1 + c] + ahead[1 + c], up.flow[c] - down.flow[c]];
            step[c] = step[c] + (behind[1 + c] - ahead[1 + c]) - (up.flow[c] + down.flow[c]);
            step[2 + c] = half.neg_mul_add(along[0], step[2 + c]);
            step[4 + c] = half.mul_add(along[1], step[4 + c]);
        }
        for k in 0..4 {
            step[2 + k] = step[2 + k] + (behind[3 + k] - ahead[3 + k]) - (up.jacobian[k] + down.jacobian[k]);
        }
        let (across, along) = (behind[0] + ahead[0], up.weight + down.weight);
        let by_jacobian = (across + along) * strengths.jacobian;
        let steep = strengths.flow * half;
        let (steep_x, steep_y) = (steep * half * across, steep * half * along);
        let bonds = [
            [(across + along) * strengths.flow, zero, zero],
            [(ahead[0] - behind[0]) * steep, steep_x + by_jacobian, zero],
            [(down.weight - up.weight) * steep, zero, steep_y + by_jacobian],
        ];
        let mut matrix = each!(k in [0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20] =>
            entry::<V, T>(block, PLACES[k].0, PLACES[k].1));
        for k in 0..3 {
            for l in 0..=k {
                for c in 0..2 {
                    let place = lower(2 * k + c, 2 * l + c);
                    matrix[place] = matrix[place] + bonds[k][l];
                }
            }
        }
        let step = solve(matrix, step, &strengths.guard);
        for k in 0..6 {
            (here[k] + step[k]).store(&mut own[k][i..]);
        }
    }
}
