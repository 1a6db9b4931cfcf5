//! The increment of the flow over a tile: lagged weights and successive over-relaxation, pixels coloured as
//! on a chessboard.

use super::layout::{
    D, INVERSE, LOWER, Layout, OTHER, RATE, RATE_X, RATE_Y, RIGHT, RIM, SEEN, SIDE, Tile, WEIGHT, WEIGHT_LOWER,
    WEIGHT_RIGHT, X, XX, XY, Y, YY,
};
use crate::simd::{Lanes, SimdReal};

/// Weights of the residuals of brightness and of its derivatives, and of smoothness.
const BRIGHTNESS: f64 = 1.0;
const GRADIENT: f64 = 2.0;
const SMOOTHNESS: f64 = 2.0;
/// Residual, px, below which a term is quadratic.
const EPSILON: f64 = 1e-3;
/// Length of a gradient, standard deviations of the brightness per px, below which a residual counts less.
const MIN_GRADIENT: f64 = 2.5e-3;
/// Times that the weights are computed, and sweeps after each.
const REWEIGHTINGS: usize = 3;
const SWEEPS: usize = 3;
const RELAXATION: f64 = 1.6;
/// Added to the diagonal, where a pixel has neither data nor neighbours.
const MIN_DIAGONAL: f64 = 1e-6;

/// Finds the increment between frames whose brightness has the standard deviation `contrast`, starting from
/// zero, which it is beyond the tile.
#[inline(always)]
pub(super) fn solve<T: SimdReal, V: Lanes<Scalar = T>>(tile: &mut Tile<T>, contrast: f64) {
    // Above zero without contrast too: the residual of no gradient is then zero.
    let min_gradient = V::constant((MIN_GRADIENT * contrast).max(f64::from(f32::EPSILON)));
    let Tile { layout, columns, data } = tile;
    let (layout, data) = (*layout, &mut data[..]);
    for _ in 0..REWEIGHTINGS {
        weigh_neighbours::<T, V>(layout, &columns.has_right, data);
        weigh_data::<T, V>(layout, min_gradient, data);
        for _ in 0..SWEEPS {
            // From one memory to the other: a load that overlaps the last store would wait for it.
            relax::<T, V>(layout, [&columns.even, &columns.odd], [D, OTHER], data);
            relax::<T, V>(layout, [&columns.odd, &columns.even], [OTHER, D], data);
        }
    }
}

#[inline(always)]
fn load<T: SimdReal, V: Lanes<Scalar = T>>(data: &[T], at: usize) -> V {
    V::load(&data[at..])
}

/// `weight` times the derivative of `psi`, over the residual.
#[inline(always)]
fn weight<V: Lanes>(weight: f64, square: V) -> V {
    V::constant(weight) / (square + V::constant(EPSILON * EPSILON)).sqrt()
}

/// One equation `a du + b dv = -r` of a pixel.
struct Row<V> {
    coefficients: [V; 2],
    rate: V,
    /// Reciprocal square of the length of the gradient.
    scale: V,
    /// Square of the residual with the present increment, px.
    square: V,
}

impl<V: Lanes> Row<V> {
    #[inline(always)]
    fn read(data: &[V::Scalar], [a, b, r]: [usize; 3], min_gradient: V, [du, dv]: [V; 2]) -> Self {
        let (a, b, rate) = (load::<_, V>(data, a), load::<_, V>(data, b), load::<_, V>(data, r));
        let scale = V::constant(1.0) / a.mul_add(a, b.mul_add(b, min_gradient * min_gradient));
        let residual = a.mul_add(du, b.mul_add(dv, rate));
        Self { coefficients: [a, b], rate, scale, square: residual * residual * scale }
    }

    /// Adds the normal equations of the row.
    #[inline(always)]
    fn add(&self, weight: V, matrix: &mut [V; 3], side: &mut [V; 2]) {
        let ([a, b], weight) = (self.coefficients, weight * self.scale);
        let (wa, wb) = (weight * a, weight * b);
        *matrix = [wa.mul_add(a, matrix[0]), wa.mul_add(b, matrix[1]), wb.mul_add(b, matrix[2])];
        *side = [wa.neg_mul_add(self.rate, side[0]), wb.neg_mul_add(self.rate, side[1])];
    }
}

/// Weights between neighbours: the mean of both pixels'.
#[inline(always)]
fn weigh_neighbours<T: SimdReal, V: Lanes<Scalar = T>>(layout: Layout, has_right: &[T], data: &mut [T]) {
    let ((width, height), down) = (layout.size, layout.down());
    let half = V::constant(0.5);
    for y in RIM - 1..=RIM + height {
        let lower = V::constant(f64::from(u8::from(layout.has_lower(y))));
        let (d, right, below, out) =
            (layout.at(D, y) - 1, layout.at(RIGHT, y) - 1, layout.at(LOWER, y) - 1, layout.at(WEIGHT, y) - 1);
        for x in (0..width + 2).step_by(V::LANES) {
            let has_right = load::<T, V>(has_right, x);
            let mut square = V::zero();
            for k in 0..2 {
                let k = k * layout.stride + x;
                let here = load::<T, V>(data, d + k);
                let across = load::<T, V>(data, d + k + 1) - here + load(data, right + k);
                let along = load::<T, V>(data, d + k + down) - here + load(data, below + k);
                square = (across * across).mul_add(has_right, (along * along).mul_add(lower, square));
            }
            weight(SMOOTHNESS, square).store(&mut data[out + x..]);
        }
    }
    for y in RIM - 1..RIM + height {
        let lower = if layout.has_lower(y) { half } else { V::zero() };
        let [from, right, below] = [WEIGHT, WEIGHT_RIGHT, WEIGHT_LOWER].map(|k| layout.at(k, y) - 1);
        for x in (0..=width).step_by(V::LANES) {
            let here = load::<T, V>(data, from + x);
            let across = (here + load(data, from + x + 1)) * load(has_right, x) * half;
            let along = (here + load(data, from + x + down)) * lower;
            across.store(&mut data[right + x..]);
            along.store(&mut data[below + x..]);
        }
    }
}

/// Matrices of all terms, inverted, and right sides without the neighbours' increments.
#[inline(always)]
fn weigh_data<T: SimdReal, V: Lanes<Scalar = T>>(layout: Layout, min_gradient: V, data: &mut [T]) {
    let ((width, _), down, stride) = (layout.size, layout.down(), layout.stride);
    for y in layout.inner() {
        let row = layout.at(0, y);
        for x in (row..row + width).step_by(V::LANES) {
            let at = |k: usize| x + k * stride;
            let (d, seen) = ([load::<T, V>(data, at(D)), load(data, at(D + 1))], load::<T, V>(data, at(SEEN)));
            let plain = Row::<V>::read(data, [at(X), at(Y), at(RATE)], min_gradient, d);
            let across = Row::<V>::read(data, [at(XX), at(XY), at(RATE_X)], min_gradient, d);
            let along = Row::<V>::read(data, [at(XY), at(YY), at(RATE_Y)], min_gradient, d);
            let brightness = weight(BRIGHTNESS, plain.square) * seen;
            let gradient = weight(GRADIENT, across.square + along.square) * seen;
            let mut matrix = [V::constant(MIN_DIAGONAL), V::zero(), V::constant(MIN_DIAGONAL)];
            let mut side = [V::zero(); 2];
            plain.add(brightness, &mut matrix, &mut side);
            across.add(gradient, &mut matrix, &mut side);
            along.add(gradient, &mut matrix, &mut side);
            let edges = edges::<T, V>(data, at(WEIGHT_RIGHT), at(WEIGHT_LOWER), down);
            let sum = edges[0] + edges[1] + (edges[2] + edges[3]);
            for (k, side) in side.iter_mut().enumerate() {
                let (right, lower) = (at(RIGHT + k), at(LOWER + k));
                let ahead = edges[0].mul_add(load(data, right), edges[2] * load(data, lower));
                let behind = edges[1].mul_add(load(data, right - 1), edges[3] * load(data, lower - down));
                *side = *side + ahead - behind;
            }
            let [a, b, c] = [matrix[0] + sum, matrix[1], matrix[2] + sum];
            let per = V::constant(1.0) / b.neg_mul_add(b, a * c);
            let values = [c * per, -(b * per), a * per, side[0], side[1]];
            for (k, value) in [INVERSE, INVERSE + 1, INVERSE + 2, SIDE, SIDE + 1].into_iter().zip(values) {
                value.store(&mut data[x + k * stride..]);
            }
        }
    }
}

/// Weights to the right, left, lower and upper neighbour.
#[inline(always)]
fn edges<T: SimdReal, V: Lanes<Scalar = T>>(data: &[T], right: usize, lower: usize, down: usize) -> [V; 4] {
    [load(data, right), load(data, right - 1), load(data, lower), load(data, lower - down)]
}

/// One sweep over the pixels of a colour, those on columns `own` of even and of odd rows; the increment is
/// read from the planes `from` and written to the planes `to`.
#[inline(always)]
fn relax<T: SimdReal, V: Lanes<Scalar = T>>(layout: Layout, own: [&[T]; 2], [from, to]: [usize; 2], data: &mut [T]) {
    let ((width, _), down, stride) = (layout.size, layout.down(), layout.stride);
    let relaxation = V::constant(RELAXATION);
    for y in layout.inner() {
        let (row, own) = (layout.at(0, y), own[y % 2]);
        for x in (0..width).step_by(V::LANES) {
            let own = V::zero().lt(load::<T, V>(own, x));
            let at = |k: usize| row + x + k * stride;
            let edges = edges::<T, V>(data, at(WEIGHT_RIGHT), at(WEIGHT_LOWER), down);
            let mut side = [V::zero(); 2];
            for (k, side) in side.iter_mut().enumerate() {
                let d = at(from + k);
                let across = edges[0].mul_add(load(data, d + 1), edges[1] * load(data, d - 1));
                let along = edges[2].mul_add(load(data, d + down), edges[3] * load(data, d - down));
                *side = load::<T, V>(data, at(SIDE + k)) + across + along;
            }
            let inverse: [V; 3] = [load(data, at(INVERSE)), load(data, at(INVERSE + 1)), load(data, at(INVERSE + 2))];
            let solved =
                [inverse[0].mul_add(side[0], inverse[1] * side[1]), inverse[1].mul_add(side[0], inverse[2] * side[1])];
            for (k, solved) in solved.into_iter().enumerate() {
                let old = load::<T, V>(data, at(from + k));
                let moved = (solved - old).mul_add(relaxation, old);
                V::select(own, moved, old).store(&mut data[row + x + (to + k) * stride..]);
            }
        }
    }
}
