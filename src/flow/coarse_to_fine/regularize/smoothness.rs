//! Robust smoothness terms: strain between neighbours, weights, and contributions to a site's matrix.

use super::{HALF_SPACING, Smoothness, solve::ENTRIES, solve::Guard, solve::lower};
use crate::flow::coarse_to_fine::{planes::LEFT, planes::Planes};
use crate::simd::{Lanes, SimdReal};

/// The values of an expression for each index in a list, written out: no optimiser unrolls these.
macro_rules! each {
    ($index:ident in [$($value:literal)*] => $expression:expr) => {
        [$({ let $index: usize = $value; $expression }),*]
    };
}
pub(super) use each;

pub(super) struct SmoothnessProblem<'a, T> {
    pub data: &'a Planes<T>,
    /// `s^2`, positive.
    pub noise: T,
    pub smoothness: &'a Smoothness,
}

/// Lines of a row's weights `omega`: of the edges from each site to the next in its row, to the row above and
/// to the row below; 0 without an edge, and beside the sites.
pub(super) const WEIGHTS: usize = 3;
pub(super) const ALONG: usize = 0;
pub(super) const UP: usize = 1;
pub(super) const DOWN: usize = 2;

/// Updates the weights of the row `own` from the present strain.
#[inline(always)]
pub(super) fn update_weights<V: Lanes<Scalar = T>, T: SimdReal>(
    problem: &SmoothnessProblem<'_, T>,
    own: &[T],
    neighbours: NeighbourRows<'_, T>,
    weights: &mut [T],
) {
    let strengths = Strengths::<V>::new(problem.smoothness);
    let (stride, width) = (neighbours.stride, problem.data.width);
    let count = stride - 2 * LEFT;
    let there = [Some((own, 1)), neighbours.above.map(|row| (row, 0)), neighbours.below.map(|row| (row, 0))];
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

/// Adds the smoothness terms of the edges (behind, ahead, up, down) to the site's matrix.
#[inline(always)]
pub(super) fn add_smoothness<V: Lanes>(
    matrix: &mut [V; ENTRIES],
    [behind, ahead, up, down]: [V; 4],
    strengths: &Strengths<V>,
) {
    let half = V::constant(HALF_SPACING);
    let (across, along) = (behind + ahead, up + down);
    let by_jacobian = (across + along) * strengths.jacobian;
    let steep = strengths.flow * half;
    let problem = [
        [(across + along) * strengths.flow, V::zero(), V::zero()],
        [(ahead - behind) * steep, (steep * half).mul_add(across, by_jacobian), V::zero()],
        [(down - up) * steep, V::zero(), (steep * half).mul_add(along, by_jacobian)],
    ];
    for k in 0..3 {
        for l in 0..=k {
            for c in 0..2 {
                let place = lower(2 * k + c, 2 * l + c);
                matrix[place] = matrix[place] + problem[k][l];
            }
        }
    }
}

#[derive(Clone, Copy)]
pub(super) struct NeighbourRows<'a, T> {
    /// `None` above the first row.
    pub above: Option<&'a [T]>,
    /// `None` below the last row.
    pub below: Option<&'a [T]>,
    pub stride: usize,
}

/// Weights of the smoothness terms, in vectors.
pub(super) struct Strengths<V> {
    flow: V,
    jacobian: V,
    /// The same over the break strain.
    flow_strain: V,
    jacobian_strain: V,
    pub guard: Guard<V>,
}

impl<V: Lanes> Strengths<V> {
    pub fn new(smoothness: &Smoothness) -> Self {
        let Smoothness { flow, jacobian, break_strain, .. } = *smoothness;
        Self {
            flow: V::constant(flow),
            jacobian: V::constant(jacobian),
            flow_strain: V::constant(flow / break_strain),
            jacobian_strain: V::constant(jacobian / break_strain),
            guard: Guard::new(),
        }
    }
}

/// Difference of the affine motions of two neighbours.
pub(super) struct Strain<V> {
    /// `du`: the difference of the flows midway between them.
    pub flow: [V; 2],
    /// `dJ`.
    pub jacobian: [V; 4],
}

/// Strain between `here` and the neighbour `there`, forwards or backwards along axis 1 (x) or 2 (y).
#[inline(always)]
pub(super) fn strain<V: Lanes>(here: &[V; 6], there: &[V; 6], (axis, forwards): (usize, bool)) -> Strain<V> {
    let half = V::constant(if forwards { HALF_SPACING } else { -HALF_SPACING });
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
    /// Weight of an edge with this strain, 1 without any.
    #[inline(always)]
    fn weight(&self, strengths: &Strengths<V>) -> V {
        let [du, dv] = self.flow;
        let [a, b, c, d] = self.jacobian;
        let flow = dv.mul_add(dv, du * du);
        let jacobian = b.mul_add(b, a * a) + d.mul_add(d, c * c);
        let strain = jacobian.mul_add(strengths.jacobian_strain, flow.mul_add(strengths.flow_strain, V::constant(1.0)));
        V::constant(1.0) / strain
    }

    /// Gradient terms of an edge at its first site, `omega flow du` and `omega jacobian dJ`. At the other end
    /// they have the opposite sign, except that of the flow on the derivative along the edge.
    #[inline(always)]
    pub fn edge_term(mut self, weight: V, strengths: &Strengths<V>) -> Self {
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
pub(super) fn six<V: Lanes<Scalar = T>, T: SimdReal>(planes: &[&[T]; 6], i: usize) -> [V; 6] {
    each!(k in [0 1 2 3 4 5] => V::load(&planes[k][i..]))
}

/// `len` samples of each plane, from sample `first` of its row on.
#[inline(always)]
pub(super) fn lines<T>(row: &[T], stride: usize, first: usize, len: usize) -> [&[T]; 6] {
    std::array::from_fn(|k| &row[k * stride + first..][..len])
}
