//! Stable sorting of edges by weight: least significant digit first.

use super::{edges::Edge, edges::EdgeKey, forest::EDGES_PER_CHECKPOINT};
use crate::parallel::checkpoint;

/// Bits of a digit: the counters of 2^11 digits stay in the first-level cache.
const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Sorts edges by increasing key; edges of equal key keep their order.
pub(super) fn sort_by_weight<K: EdgeKey>(edges: &mut Vec<Edge<K>>) {
    let passes = K::BITS.div_ceil(DIGIT_BITS) as usize;
    let mut counts = vec![[0u32; DIGITS]; passes];
    for edge in edges.iter() {
        for (pass, counts) in counts.iter_mut().enumerate() {
            counts[digit(edge, pass)] += 1;
        }
    }
    let mut sorted = vec![Edge::default(); edges.len()];
    for (pass, counts) in counts.iter_mut().enumerate() {
        // All edges share this digit: nothing to do.
        if counts.iter().any(|&count| count as usize == edges.len()) {
            continue;
        }
        let mut next = 0;
        for count in counts.iter_mut() {
            next += std::mem::replace(count, next);
        }
        for edges in edges.chunks(EDGES_PER_CHECKPOINT) {
            checkpoint();
            for edge in edges {
                let place = &mut counts[digit(edge, pass)];
                sorted[*place as usize] = *edge;
                *place += 1;
            }
        }
        std::mem::swap(edges, &mut sorted);
    }
}

#[inline(always)]
fn digit<K: EdgeKey>(edge: &Edge<K>, pass: usize) -> usize {
    edge.key.digit(pass as u32 * DIGIT_BITS, DIGITS - 1)
}
