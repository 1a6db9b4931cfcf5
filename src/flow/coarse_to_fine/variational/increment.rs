//! The increment of the flow over a tile: lagged weights and successive over-relaxation, pixels coloured as
//! on a chessboard.

use super::layout::{
    INVERSE, LOWER, Line, RATE, RATE_X, RATE_Y, RIGHT, RIM, Rows, SEEN, SIDE, SYSTEM, Tile, WEIGHT_LOWER, WEIGHT_RIGHT,
    X, XX, XY, Y, YY,
};
use crate::flow::coarse_to_fine::planes::LEFT;
use crate::simd::{Lanes, SimdReal};

/// In the memory of planes that are not needed at the same time: the weights of pixels.
const WEIGHT: usize = INVERSE;

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
pub(super) fn solve<T: SimdReal, V: Lanes<Scalar = T>>(tile: &mut Tile<'_, T>, contrast: f64) {
    // Above zero without contrast too: the residual of no gradient is then zero.
    let min_gradient = V::constant((MIN_GRADIENT * contrast).max(f64::from(f32::EPSILON)));
    for _ in 0..REWEIGHTINGS {
        weigh_neighbours::<T, V>(tile);
        weigh_data::<T, V>(tile, min_gradient);
        for _ in 0..SWEEPS {
            sweep::<T, V>(tile);
        }
    }
}

/// One sweep over the pixels of both colours. Those of the second follow a row behind, while what both read
/// is in the nearest cache; from one memory to the other, since a load that overlaps the last store would
/// wait for it.
#[inline(always)]
fn sweep<T: SimdReal, V: Lanes<Scalar = T>>(tile: &mut Tile<'_, T>) {
    let Tile { layout, columns, system, weights, increment: [increment, other], .. } = tile;
    let (width, rows) = (layout.size.0, layout.inner());
    for y in rows.start..=rows.end {
        let own = if y % 2 == 0 { &columns.even } else { &columns.odd };
        if y < rows.end {
            relax::<T, V>((width, y), own, (system, weights), increment, other);
        }
        if y > rows.start {
            // The other colour has the same columns in the row above.
            relax::<T, V>((width, y - 1), own, (system, weights), other, increment);
        }
    }
}

#[inline(always)]
fn load<T: SimdReal, V: Lanes<Scalar = T>>(line: &Line<T>, at: usize) -> V {
    V::load(&line[at..])
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
    fn new([a, b, rate]: [V; 3], min_gradient: V, [du, dv]: [V; 2]) -> Self {
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
fn weigh_neighbours<T: SimdReal, V: Lanes<Scalar = T>>(tile: &mut Tile<'_, T>) {
    let Tile { layout, columns, fields, system, weights, increment: [increment, _], .. } = tile;
    let (width, height) = layout.size;
    let half = V::constant(0.5);
    for y in RIM - 1..=RIM + height {
        let lower = V::constant(f64::from(u8::from(layout.has_lower(y))));
        let ([here, below], fields, out) = ([&increment[y], &increment[y + 1]], &fields[y], &mut system[y][WEIGHT]);
        for x in (LEFT - 1..=LEFT + width).step_by(V::LANES) {
            let has_right = load::<T, V>(&columns.has_right, x);
            let mut square = V::zero();
            for k in 0..2 {
                let d = load::<T, V>(&here[k], x);
                let across = load::<T, V>(&here[k], x + 1) - d + load(&fields[RIGHT + k], x);
                let along = load::<T, V>(&below[k], x) - d + load(&fields[LOWER + k], x);
                square = (across * across).mul_add(has_right, (along * along).mul_add(lower, square));
            }
            weight(SMOOTHNESS, square).store(&mut out[x..]);
        }
    }
    for y in RIM - 1..RIM + height {
        let lower = if layout.has_lower(y) { half } else { V::zero() };
        let ([here, below], out) = ([&system[y][WEIGHT], &system[y + 1][WEIGHT]], &mut weights[y]);
        for x in (LEFT - 1..LEFT + width).step_by(V::LANES) {
            let weight = load::<T, V>(here, x);
            let across = (weight + load(here, x + 1)) * load(&columns.has_right, x) * half;
            across.store(&mut out[WEIGHT_RIGHT][x..]);
            ((weight + load(below, x)) * lower).store(&mut out[WEIGHT_LOWER][x..]);
        }
    }
}

/// Matrices of all terms, inverted, and right sides without the neighbours' increments.
#[inline(always)]
fn weigh_data<T: SimdReal, V: Lanes<Scalar = T>>(tile: &mut Tile<'_, T>, min_gradient: V) {
    let Tile { layout, fields, system, weights, increment: [increment, _], .. } = tile;
    for y in layout.inner() {
        let (above, here, out) = (&fields[y - 1], &fields[y], &mut system[y]);
        let (weights, increment) = ([&weights[y - 1], &weights[y]], &increment[y]);
        for x in (LEFT..LEFT + layout.size.0).step_by(V::LANES) {
            let at = |k: usize| load::<T, V>(&here[k], x);
            let d = [load(&increment[0], x), load(&increment[1], x)];
            let plain = Row::new([at(X), at(Y), at(RATE)], min_gradient, d);
            let across = Row::new([at(XX), at(XY), at(RATE_X)], min_gradient, d);
            let along = Row::new([at(XY), at(YY), at(RATE_Y)], min_gradient, d);
            let brightness = weight(BRIGHTNESS, plain.square) * at(SEEN);
            let gradient = weight(GRADIENT, across.square + along.square) * at(SEEN);
            let mut matrix = [V::constant(MIN_DIAGONAL), V::zero(), V::constant(MIN_DIAGONAL)];
            let mut side = [V::zero(); 2];
            plain.add(brightness, &mut matrix, &mut side);
            across.add(gradient, &mut matrix, &mut side);
            along.add(gradient, &mut matrix, &mut side);
            let edges = edges::<T, V>(weights, x);
            let sum = edges[0] + edges[1] + (edges[2] + edges[3]);
            for (k, side) in side.iter_mut().enumerate() {
                let ahead = edges[0].mul_add(at(RIGHT + k), edges[2] * at(LOWER + k));
                let behind = load::<T, V>(&here[RIGHT + k], x - 1);
                let behind = edges[1].mul_add(behind, edges[3] * load(&above[LOWER + k], x));
                *side = *side + ahead - behind;
            }
            let [a, b, c] = [matrix[0] + sum, matrix[1], matrix[2] + sum];
            let per = V::constant(1.0) / b.neg_mul_add(b, a * c);
            let values = [c * per, -(b * per), a * per, side[0], side[1]];
            for (k, value) in [INVERSE, INVERSE + 1, INVERSE + 2, SIDE, SIDE + 1].into_iter().zip(values) {
                value.store(&mut out[k][x..]);
            }
        }
    }
}

/// Weights to the right, left, lower and upper neighbour, from those of the row above and of the pixels' own.
#[inline(always)]
fn edges<T: SimdReal, V: Lanes<Scalar = T>>([above, here]: [&[Line<T>; 2]; 2], x: usize) -> [V; 4] {
    let (right, lower) = (&here[WEIGHT_RIGHT], &here[WEIGHT_LOWER]);
    [load(right, x), load(right, x - 1), load(lower, x), load(&above[WEIGHT_LOWER], x)]
}

/// One sweep over the pixels of a row on columns `own`, from the increment `from` to the increment `to`.
#[inline(always)]
fn relax<T: SimdReal, V: Lanes<Scalar = T>>(
    (width, y): (usize, usize),
    own: &Line<T>,
    (system, weights): (&Rows<T, SYSTEM>, &Rows<T, 2>),
    from: &Rows<T, 2>,
    to: &mut Rows<T, 2>,
) {
    let relaxation = V::constant(RELAXATION);
    let (system, weights, to) = (&system[y], [&weights[y - 1], &weights[y]], &mut to[y]);
    let (above, here, below) = (&from[y - 1], &from[y], &from[y + 1]);
    for x in (LEFT..LEFT + width).step_by(V::LANES) {
        let own = V::zero().lt(load::<T, V>(own, x));
        let edges = edges::<T, V>(weights, x);
        let mut side = [V::zero(); 2];
        for (k, side) in side.iter_mut().enumerate() {
            let across = edges[0].mul_add(load(&here[k], x + 1), edges[1] * load(&here[k], x - 1));
            let along = edges[2].mul_add(load(&below[k], x), edges[3] * load(&above[k], x));
            *side = load::<T, V>(&system[SIDE + k], x) + across + along;
        }
        let [a, b, c] = [INVERSE, INVERSE + 1, INVERSE + 2];
        let inverse: [V; 3] = [load(&system[a], x), load(&system[b], x), load(&system[c], x)];
        let solved =
            [inverse[0].mul_add(side[0], inverse[1] * side[1]), inverse[1].mul_add(side[0], inverse[2] * side[1])];
        for (k, solved) in solved.into_iter().enumerate() {
            let old = load::<T, V>(&here[k], x);
            let moved = (solved - old).mul_add(relaxation, old);
            V::select(own, moved, old).store(&mut to[k][x..]);
        }
    }
}
