//! The nearest points of every point, by a k-d tree (J. Bentley 1975). Points are named by their place in the
//! tree, where neighbours are near each other in memory too. Which of several points at the same distance are
//! kept depends on the points alone.

use crate::parallel;

/// Points of a leaf.
const LEAF: usize = 12;

/// Points whose neighbours one task looks for.
const BAND: usize = 256;

/// Numbers of neighbours that are kept apart: the first 8 in a list are the 8 nearest, the first 16 the 16
/// nearest, ...
pub const SIZES: [usize; 4] = [8, 16, 32, 64];

#[derive(Debug, Clone, Copy)]
struct Node {
    least: [f64; 3],
    greatest: [f64; 3],
    range: (u32, u32),
    /// The two halves; 0: a leaf.
    children: (u32, u32),
}

/// A tree over points in space.
#[derive(Debug, Clone)]
pub struct Tree {
    nodes: Vec<Node>,
    points: Vec<[f64; 3]>,
    order: Vec<u32>,
}

/// The nearest points of some points, `k` each, by their places in the tree.
#[derive(Debug, Clone, Default)]
pub struct Neighbours {
    /// How many of each.
    pub k: usize,
    places: Vec<u32>,
}

impl Neighbours {
    /// The nearest of the `i`-th requested point, nested as [`SIZES`] says.
    pub fn of(&self, i: usize) -> &[u32] {
        &self.places[i * self.k..(i + 1) * self.k]
    }
}

/// A square distance that single precision can hold: beyond its largest number, that.
fn in_single(square: f64) -> f64 {
    square.min(f64::from(f32::MAX))
}

fn square_distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    in_single(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
}

impl Node {
    fn square_distance(&self, p: &[f64; 3]) -> f64 {
        let mut sum = 0.0;
        for axis in 0..3 {
            let outside = (self.least[axis] - p[axis]).max(p[axis] - self.greatest[axis]).max(0.0);
            sum += outside * outside;
        }
        in_single(sum)
    }
}

impl Tree {
    /// Over finite points.
    pub fn new(positions: &[[f64; 3]]) -> Self {
        let mut order: Vec<u32> = (0..positions.len() as u32).collect();
        let mut nodes = Vec::with_capacity(4 * positions.len() / LEAF + 4);
        split(positions, &mut order, 0, &mut nodes);
        Self { nodes, points: order.iter().map(|&i| positions[i as usize]).collect(), order }
    }

    /// Index of the point at each place, among those given.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The points by place.
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The places split into cells of at most `most` points that lie together.
    pub fn cells(&self, most: usize) -> Vec<std::ops::Range<usize>> {
        let mut cells = Vec::new();
        let mut waiting = vec![0u32];
        while let Some(node) = waiting.pop() {
            let Node { range, children, .. } = self.nodes[node as usize];
            if children.0 == 0 || (range.1 - range.0) as usize <= most {
                cells.push(range.0 as usize..range.1 as usize);
            } else {
                waiting.extend([children.1, children.0]);
            }
        }
        cells
    }

    /// The places of all halves, halves of halves and so on that have at least `least` points.
    pub fn halves(&self, least: usize) -> Vec<std::ops::Range<usize>> {
        let ranges = self.nodes.iter().skip(1).map(|node| node.range.0 as usize..node.range.1 as usize);
        ranges.filter(|places| places.len() >= least).collect()
    }

    /// The `k` nearest of the points at the places `queries`, themselves left out; `k` is less than the
    /// number of points.
    pub fn nearest(&self, queries: &[u32], k: usize) -> Neighbours {
        let mut places = vec![0u32; queries.len() * k];
        parallel::for_each(places.chunks_mut(BAND * k).zip(queries.chunks(BAND)), |(out, queries)| {
            let mut found = Vec::with_capacity(6 * k + LEAF);
            for (out, &place) in out.chunks_exact_mut(k).zip(queries) {
                self.search(place, k, &mut found);
                nest(&mut found, k);
                out.iter_mut().zip(&found).for_each(|(to, &key)| *to = key as u32);
            }
        });
        Neighbours { k, places }
    }

    /// The `k` nearest as keys (square distance, place), in any order.
    fn search(&self, own: u32, k: usize, found: &mut Vec<u64>) {
        let at = &self.points[own as usize];
        found.clear();
        let mut bound = f64::INFINITY;
        let mut waiting = [(0u32, 0.0f64); 64];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (node, distance) = waiting[depth];
            if distance >= bound {
                continue;
            }
            let node = &self.nodes[node as usize];
            if node.children.0 == 0 {
                for place in node.range.0..node.range.1 {
                    let distance = square_distance(at, &self.points[place as usize]) as f32;
                    if f64::from(distance) < bound && place != own {
                        // Distances are not negative: their bits are in their order.
                        found.push((u64::from(distance.to_bits()) << 32) | u64::from(place));
                    }
                }
                if found.len() >= 2 * k {
                    found.select_nth_unstable(k - 1);
                    found.truncate(k);
                    bound = f64::from(f32::from_bits((found[k - 1] >> 32) as u32));
                }
                continue;
            }
            let (a, b) = node.children;
            let of = |child: u32| (child, self.nodes[child as usize].square_distance(at));
            let (a, b) = (of(a), of(b));
            // The nearer half is taken from the stack first.
            let (near, far) = if a.1 <= b.1 { (a, b) } else { (b, a) };
            waiting[depth] = far;
            waiting[depth + 1] = near;
            depth += 2;
        }
        if found.len() > k {
            found.select_nth_unstable(k - 1);
            found.truncate(k);
        }
    }
}

/// Puts the keys so that the first of each of [`SIZES`] are the nearest, the last of them the farthest of
/// these.
fn nest(keys: &mut [u64], k: usize) {
    let mut end = k;
    for &size in SIZES.iter().rev().filter(|&&size| size <= k) {
        keys[..end].select_nth_unstable(size - 1);
        end = size;
    }
}

/// Splits the points `index`, which begin at `first` of all, at the middle of their widest side; returns the
/// node.
fn split(positions: &[[f64; 3]], index: &mut [u32], first: u32, nodes: &mut Vec<Node>) -> u32 {
    let (mut least, mut greatest) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for &i in index.iter() {
        for axis in 0..3 {
            least[axis] = least[axis].min(positions[i as usize][axis]);
            greatest[axis] = greatest[axis].max(positions[i as usize][axis]);
        }
    }
    let node = nodes.len();
    nodes.push(Node { least, greatest, range: (first, first + index.len() as u32), children: (0, 0) });
    if index.len() > LEAF {
        let width = |axis: usize| greatest[axis] - least[axis];
        let axis = (1..3).fold(0, |widest, axis| if width(axis) > width(widest) { axis } else { widest });
        let middle = index.len() / 2;
        index.select_nth_unstable_by(middle, |&a, &b| {
            positions[a as usize][axis].total_cmp(&positions[b as usize][axis]).then(a.cmp(&b))
        });
        let (lower, upper) = index.split_at_mut(middle);
        let lower = split(positions, lower, first, nodes);
        let upper = split(positions, upper, first + middle as u32, nodes);
        nodes[node].children = (lower, upper);
    }
    node as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;

    fn check(positions: &[[f64; 3]], k: usize) {
        let tree = Tree::new(positions);
        let queries: Vec<u32> = (0..positions.len() as u32).rev().step_by(2).collect();
        let found = tree.nearest(&queries, k);
        for (i, &place) in queries.iter().enumerate() {
            let at = positions[tree.order()[place as usize] as usize];
            let own = |j: &usize| *j != tree.order()[place as usize] as usize;
            let mut all: Vec<f32> =
                (0..positions.len()).filter(own).map(|j| square_distance(&at, &positions[j]) as f32).collect();
            all.sort_by(f32::total_cmp);
            for size in SIZES.into_iter().filter(|&size| size <= k) {
                let distance = |&j: &u32| square_distance(&at, &tree.points()[j as usize]) as f32;
                let mut got: Vec<f32> = found.of(i)[..size].iter().map(distance).collect();
                assert_eq!(got[size - 1], all[size - 1], "the last of {size} is the farthest");
                got.sort_by(f32::total_cmp);
                assert_eq!(got, all[..size]);
            }
            assert!(!found.of(i).contains(&place));
        }
    }

    #[test]
    fn halves_are_halves_of_halves() {
        let positions: Vec<[f64; 3]> = (0..100).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        let tree = Tree::new(&positions);
        let mut halves = tree.halves(25);
        halves.sort_by_key(|places| (usize::MAX - places.len(), places.start));
        assert_eq!(halves, [0..50, 50..100, 0..25, 25..50, 50..75, 75..100]);
    }

    #[test]
    fn nearest_points_are_those_of_the_plain_search() {
        let rng = CounterRng::new(2);
        let at = |k: u64| [rng.uniform(3 * k), rng.uniform(3 * k + 1), 0.2 * rng.uniform(3 * k + 2)];
        check(&(0..300).map(at).collect::<Vec<_>>(), 64);
        check(&(0..20).map(at).collect::<Vec<_>>(), 16);
        let line: Vec<[f64; 3]> = (0..100).map(|k| [f64::from(k % 10), 0.0, 0.0]).collect();
        check(&line, 32);
        let distant: Vec<[f64; 3]> = (0..100).map(|k| [f64::from(k), if k == 7 { 1e200 } else { 0.0 }, 0.0]).collect();
        check(&distant, 32);
    }
}
