//! Short vectors of lanes. Plain loops, because closures and the standard library's array methods do not
//! inherit target features: where one of them is not inlined, every operation inside becomes a function call.

use crate::simd::Lanes;

#[inline(always)]
pub(super) fn times<V: Lanes, const K: usize>(y: &[V; K], factor: V) -> [V; K] {
    let mut out = *y;
    for v in &mut out {
        *v = *v * factor;
    }
    out
}

#[inline(always)]
pub(super) fn plus<V: Lanes, const K: usize>(a: &[V; K], b: &[V; K]) -> [V; K] {
    let mut out = *a;
    for k in 0..K {
        out[k] = out[k] + b[k];
    }
    out
}

#[inline(always)]
pub(super) fn minus<V: Lanes, const K: usize>(a: &[V; K], b: &[V; K]) -> [V; K] {
    let mut out = *a;
    for k in 0..K {
        out[k] = out[k] - b[k];
    }
    out
}

#[inline(always)]
pub(super) fn plus_times<V: Lanes, const K: usize>(a: &[V; K], factor: V, b: &[V; K]) -> [V; K] {
    let mut out = *a;
    for k in 0..K {
        out[k] = b[k].mul_add(factor, out[k]);
    }
    out
}

/// Entries `from .. from + 6`.
#[inline(always)]
pub(super) fn six<V: Lanes, const K: usize>(all: &[V; K], from: usize) -> [V; 6] {
    let mut out = [V::zero(); 6];
    out.copy_from_slice(&all[from..from + 6]);
    out
}

/// Repeats a block for `K = 0, 1, ... 5`, as constants, so that arrays stay in registers.
macro_rules! for_six {
    ($k:ident => $body:block) => {
        for_six!(@each $k $body 0 1 2 3 4 5)
    };
    (@each $k:ident $body:block $($value:literal)*) => {$({
        const $k: usize = $value;
        $body
    })*};
}
pub(super) use for_six;
