//! Standard normals by the ziggurat: one multiplication and one comparison for 99 of 100.
//!
//! G. Marsaglia, W. W. Tsang, "The ziggurat method for generating random variables", 2000, with the layer and
//! the number from separate bits as in J. A. Doornik, "An improved ziggurat method to generate normal random
//! samples", 2005.

use super::random::CounterRng;
use std::sync::LazyLock;

/// Layers of equal area under `exp(-x^2 / 2)`, the lowest with the tail.
const LAYERS: usize = 256;
/// Where the tail begins, for 256 layers (Marsaglia and Tsang 2000).
const TAIL: f64 = 3.654_152_885_361_009;
/// Area of a layer, for 256 layers (Marsaglia and Tsang 2000).
const AREA: f64 = 0.00492867323399;

static EDGES: LazyLock<[f64; LAYERS + 1]> = LazyLock::new(edges);

/// Right edges of the layers from the lowest (of a rectangle of the same area) to the top, 0.
fn edges() -> [f64; LAYERS + 1] {
    let density = |x: f64| (-0.5 * x * x).exp();
    let mut edges = [0.0; LAYERS + 1];
    (edges[0], edges[1]) = (AREA / density(TAIL), TAIL);
    for i in 2..LAYERS {
        edges[i] = (-2.0 * (AREA / edges[i - 1] + density(edges[i - 1])).ln()).sqrt();
    }
    edges
}

impl CounterRng {
    /// Fills `out` with standard normals: those at the indices `first`, `first + 1`, ...
    ///
    /// Each depends on the seed and its index alone, but is not the number of [`Self::normal`].
    #[inline]
    pub fn fill_normal(&self, first: u64, out: &mut [f64]) {
        let edges = &*EDGES;
        for (index, out) in (first..).zip(out) {
            let bits = self.bits(index);
            *out = inside(edges, bits).unwrap_or_else(|| self.outside(edges, index, bits));
        }
    }

    /// The number at `index` whose first attempt `bits` lies outside its layer's rectangle.
    #[cold]
    fn outside(self, edges: &[f64; LAYERS + 1], index: u64, mut bits: u64) -> f64 {
        let rng = self.stream(index);
        let mut next = 0;
        let mut draw = || {
            next += 1;
            rng.bits(next)
        };
        loop {
            let (layer, signed) = split(bits);
            let x = signed * edges[layer];
            if layer == 0 {
                return tail(|| open_uniform(draw())).copysign(signed);
            }
            // The wedge between the rectangle and the density.
            let ratio = |edge: f64| (-0.5 * (edge * edge - x * x)).exp();
            let (low, high) = (ratio(edges[layer]), ratio(edges[layer + 1]));
            if low + open_uniform(draw()) * (high - low) < 1.0 {
                return x;
            }
            bits = draw();
            if let Some(x) = inside(edges, bits) {
                return x;
            }
        }
    }
}

/// The layer and a uniform number in [-1, 1), from bits that do not overlap.
#[inline]
fn split(bits: u64) -> (usize, f64) {
    ((bits & 0xff) as usize, ((bits as i64) >> 11) as f64 * (1.0 / (1u64 << 52) as f64))
}

/// The number of an attempt that lies in the part of its layer that is all below the density.
#[inline]
fn inside(edges: &[f64; LAYERS + 1], bits: u64) -> Option<f64> {
    let (layer, signed) = split(bits);
    let x = signed * edges[layer];
    (x.abs() < edges[layer + 1]).then_some(x)
}

/// Uniform in (0, 1).
fn open_uniform(bits: u64) -> f64 {
    ((bits >> 12) as f64 + 0.5) * (1.0 / (1u64 << 52) as f64)
}

/// A number above [`TAIL`] (G. Marsaglia 1964).
fn tail(mut uniform: impl FnMut() -> f64) -> f64 {
    loop {
        let (x, y) = (-uniform().ln() / TAIL, -uniform().ln());
        if 2.0 * y >= x * x {
            return TAIL + x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_have_equal_areas() {
        let edges = edges();
        let density = |x: f64| (-0.5 * x * x).exp();
        for i in 1..LAYERS {
            let area = edges[i] * (density(edges[i + 1]) - density(edges[i]));
            assert!((area / AREA - 1.0).abs() < 1e-9, "layer {i}: {area}");
        }
        // The lowest: a rectangle up to the tail, and the tail.
        let tail = (std::f64::consts::PI / 2.0).sqrt() * libm::erfc(TAIL / std::f64::consts::SQRT_2);
        assert!(((TAIL * density(TAIL) + tail) / AREA - 1.0).abs() < 1e-9);
    }
}
