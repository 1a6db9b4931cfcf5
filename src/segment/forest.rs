//! The regions as a forest of pixels, merged edge by edge.

use super::{edges::Edge, edges::EdgeWeight, edges::second_offsets};
use crate::parallel::checkpoint;

/// Edges between two looks for a request to stop.
pub(super) const EDGES_PER_CHECKPOINT: usize = 1 << 16;

/// Disjoint regions of pixels; each region is a tree, its root carries the region's size and threshold.
#[derive(Debug)]
pub(super) struct Forest<T> {
    /// A pixel nearer to the root, or the pixel itself.
    parent: Vec<u32>,
    /// Of roots: number of pixels.
    size: Vec<u32>,
    /// Of roots: heaviest edge that still merges the region, `Int + k / size`.
    threshold: Vec<T>,
    /// The option `scale`, `k`.
    scale: T,
    offsets: [u32; 4],
}

impl<T: EdgeWeight> Forest<T> {
    /// Every pixel is a region of its own with `Int = 0`.
    pub(super) fn new(width: usize, height: usize, scale: T) -> Self {
        let pixels = width * height;
        Self {
            parent: (0..pixels as u32).collect(),
            size: vec![1; pixels],
            threshold: vec![scale; pixels],
            scale,
            offsets: second_offsets(width),
        }
    }

    /// The root of a pixel's tree; halves the path to it.
    #[inline(always)]
    pub(super) fn root(&mut self, pixel: u32) -> u32 {
        let mut at = pixel;
        loop {
            let parent = self.parent[at as usize];
            if parent == at {
                return at;
            }
            let grandparent = self.parent[parent as usize];
            self.parent[at as usize] = grandparent;
            at = grandparent;
        }
    }

    #[inline(always)]
    fn roots(&mut self, code: u32) -> (u32, u32) {
        let first = code >> 2;
        let second = first.wrapping_add(self.offsets[(code & 3) as usize]);
        (self.root(first), self.root(second))
    }

    /// Merges two regions; returns the root of the union, which is that of the larger one.
    #[inline(always)]
    fn unite(&mut self, a: u32, b: u32) -> usize {
        let (a, b) = if self.size[a as usize] < self.size[b as usize] { (b, a) } else { (a, b) };
        self.parent[b as usize] = a;
        self.size[a as usize] += self.size[b as usize];
        a as usize
    }

    /// Merges along sorted edges while the edge is within both regions' thresholds; returns the edges between
    /// regions that stayed apart when they came.
    pub(super) fn merge_similar(&mut self, edges: &[Edge<T::Key>]) -> Vec<u32> {
        let infinite = T::from_f64(f64::INFINITY).key();
        let (finite, without_weight) = edges.split_at(edges.partition_point(|edge| edge.key < infinite));
        let mut rejected = Vec::new();
        for (k, edge) in finite.iter().enumerate() {
            if k % EDGES_PER_CHECKPOINT == 0 {
                checkpoint();
            }
            let (a, b) = self.roots(edge.code);
            if a == b {
                continue;
            }
            let weight = T::of_key(edge.key);
            if weight <= self.threshold[a as usize] && weight <= self.threshold[b as usize] {
                let root = self.unite(a, b);
                self.threshold[root] = weight + self.scale / T::from_f64(f64::from(self.size[root]));
            } else {
                rejected.push(edge.code);
            }
        }
        rejected.extend(without_weight.iter().map(|edge| edge.code));
        rejected
    }

    /// Merges along `codes` where one of the two regions has fewer than `min_size` pixels.
    pub(super) fn merge_small(&mut self, codes: &[u32], min_size: usize) {
        for (k, &code) in codes.iter().enumerate() {
            if k % EDGES_PER_CHECKPOINT == 0 {
                checkpoint();
            }
            let (a, b) = self.roots(code);
            if a != b && (self.size[a as usize].min(self.size[b as usize]) as usize) < min_size {
                self.unite(a, b);
            }
        }
    }
}
