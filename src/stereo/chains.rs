//! Costs summed along chains of edge pixels: sparse semi-global matching.
//!
//! For each of 8 directions r let q be the nearest edge pixel behind p along r, at most 16 px away, g its
//! distance: `L_r(p, d) = C(p, d) + min{L_r(q, d), L_r(q, d +- 1) + P1 e^{-g/16}, min L_r(q, .) + P2
//! e^{-g/16}} - min L_r(q, .)`, and `C(p, d)` where there is none. Two sweeps, one from above and one from
//! below, carry four directions each. Only the last rows of `L_r` are kept: they stay in the processor's
//! caches.

use super::{cost::CHUNK, cost::UNIT, edges::EdgeMap};
use crate::parallel::checkpoint;
use crate::simd::{Kernel, Lanes, Level, dispatch};

/// Largest distance of the edge pixel behind, px.
const MAX_GAP: usize = 16;
/// Cost of a change by one candidate, and of any larger one, grey levels/px.
const PENALTIES: [f64; 2] = [1.0, 6.0];
/// Directions of one sweep: along the row, down the column, and both diagonals.
const DIRECTIONS: usize = 4;
/// Cost beyond the first and the last candidate.
const WALL: u16 = 60000;
/// Edge pixels between two looks for a request to stop.
const EDGES_PER_CHECKPOINT: usize = 1 << 10;
/// No edge pixel yet.
const NONE: u32 = u32::MAX;

/// Direction of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum From {
    Above,
    Below,
}

/// `sum_r L_r` over the four directions of a sweep, as `costs` is laid out, `padded` candidates for each edge
/// pixel.
pub(super) fn sweep(edges: &EdgeMap, costs: &[u16], padded: usize, from: From) -> Vec<u16> {
    let mut total = vec![0u16; costs.len()];
    dispatch(Level::detect(), Sweep { edges, costs, padded, from, total: &mut total });
    total
}

struct Sweep<'a> {
    edges: &'a EdgeMap,
    costs: &'a [u16],
    padded: usize,
    from: From,
    total: &'a mut [u16],
}

/// Penalties at every distance, in units of cost.
fn penalties() -> [[u16; 2]; MAX_GAP + 1] {
    std::array::from_fn(|gap| {
        PENALTIES.map(|p| (p * f64::from(UNIT) * (-(gap as f64) / MAX_GAP as f64).exp()).round() as u16)
    })
}

/// Most edge pixels in any `MAX_GAP + 1` rows that follow one another, at least 1.
fn most_in_reach(rows: &[u32]) -> usize {
    let mut first = 0;
    let mut most = 1;
    for (i, &row) in rows.iter().enumerate() {
        while (row - rows[first]) as usize > MAX_GAP {
            first += 1;
        }
        most = most.max(i - first + 1);
    }
    most
}

/// Last edge pixel on each row, column and diagonal.
struct Last {
    row: u32,
    column: Vec<u32>,
    falling: Vec<u32>,
    rising: Vec<u32>,
}

impl Last {
    fn new(width: usize, height: usize) -> Self {
        let diagonals = vec![NONE; width + height];
        Self { row: NONE, column: vec![NONE; width], falling: diagonals.clone(), rising: diagonals }
    }

    /// Edge pixels behind a pixel, one for each direction; the pixel replaces them.
    #[inline(always)]
    fn replace(&mut self, x: usize, y: usize, step: u32) -> [u32; DIRECTIONS] {
        let (falling, rising) = (x + self.falling.len() - self.column.len() - 1 - y, x + y);
        let behind = [self.row, self.column[x], self.falling[falling], self.rising[rising]];
        self.row = step;
        self.column[x] = step;
        self.falling[falling] = step;
        self.rising[rising] = step;
        behind
    }
}

/// Small integers: the compiler vectorises the loops with the instructions of the level.
impl Kernel<f32> for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(self) {
        let Self { edges, costs, padded, from, total } = self;
        let (width, height) = edges.class.size();
        let (count, penalties) = (edges.len(), penalties());
        let kept = most_in_reach(&edges.rows);
        let block = padded + 2 * CHUNK;
        let mut paths = vec![WALL; DIRECTIONS * kept * block];
        let mut least = vec![0u16; DIRECTIONS * kept];
        let mut last = Last::new(width, height);
        for step in 0..count {
            if step % EDGES_PER_CHECKPOINT == 0 {
                checkpoint();
            }
            let of = |step: usize| if from == From::Above { step } else { count - 1 - step };
            let edge = of(step);
            let (x, y) = (edges.columns[edge] as usize, edges.rows[edge] as usize);
            let behind = last.replace(x, y, step as u32);
            let cost = &costs[edge * padded..(edge + 1) * padded];
            let sum = &mut total[edge * padded..(edge + 1) * padded];
            for r in 0..DIRECTIONS {
                let slot = r * kept + step % kept;
                let mut gap = usize::MAX;
                if behind[r] != NONE {
                    let q = of(behind[r] as usize);
                    let (dx, dy) = (x.abs_diff(edges.columns[q] as usize), y.abs_diff(edges.rows[q] as usize));
                    // The last edge pixel may be in a row above.
                    gap = if r == 0 && dy > 0 { usize::MAX } else { dx.max(dy) };
                }
                least[slot] = if gap <= MAX_GAP {
                    let q = r * kept + behind[r] as usize % kept;
                    let ranges = [q * block..(q + 1) * block, slot * block..(slot + 1) * block];
                    let [before, path] = paths.get_disjoint_mut(ranges).expect("blocks of two pixels");
                    continue_path(before, least[q], penalties[gap], cost, path, sum)
                } else {
                    begin_path(cost, &mut paths[slot * block..(slot + 1) * block], sum)
                };
            }
        }
    }
}

/// `L_r = C`; returns the least.
#[inline(always)]
fn begin_path(cost: &[u16], path: &mut [u16], sum: &mut [u16]) -> u16 {
    let mut least = [WALL; CHUNK];
    for k in (0..cost.len()).step_by(CHUNK) {
        let (cost, path, sum) = (chunk(cost, k), chunk_mut(path, k + CHUNK), chunk_mut(sum, k));
        for i in 0..CHUNK {
            path[i] = cost[i];
            sum[i] += cost[i];
            least[i] = least[i].min(cost[i]);
        }
    }
    smallest(&least)
}

/// `L_r` from that of the pixel behind, whose least value is `least`; returns the least.
#[inline(always)]
fn continue_path(
    before: &[u16],
    least: u16,
    [near, far]: [u16; 2],
    cost: &[u16],
    path: &mut [u16],
    sum: &mut [u16],
) -> u16 {
    let jump = least + far;
    let mut lowest = [WALL; CHUNK];
    for k in (0..cost.len()).step_by(CHUNK) {
        let (same, below, above) =
            (chunk(before, k + CHUNK), chunk(before, k + CHUNK - 1), chunk(before, k + CHUNK + 1));
        let (cost, path, sum) = (chunk(cost, k), chunk_mut(path, k + CHUNK), chunk_mut(sum, k));
        for i in 0..CHUNK {
            let beside = below[i].min(above[i]).saturating_add(near);
            let value = cost[i] + (same[i].min(beside).min(jump) - least);
            path[i] = value;
            sum[i] += value;
            lowest[i] = lowest[i].min(value);
        }
    }
    smallest(&lowest)
}

#[inline(always)]
fn smallest(values: &[u16; CHUNK]) -> u16 {
    let mut least = values[0];
    for value in values {
        least = least.min(*value);
    }
    least
}

#[inline(always)]
fn chunk(values: &[u16], at: usize) -> &[u16; CHUNK] {
    values[at..].first_chunk().expect("whole chunks")
}

#[inline(always)]
fn chunk_mut(values: &mut [u16], at: usize) -> &mut [u16; CHUNK] {
    values[at..].first_chunk_mut().expect("whole chunks")
}

#[cfg(test)]
mod tests {
    use super::super::cost::MAX_COST;
    use super::super::edges::NO_CLASS;
    use super::*;
    use crate::math::random::CounterRng;
    use crate::types::Frame;

    /// Edge pixels strewn over a view; nothing else of the map is looked at.
    fn strewn(width: usize, height: usize, share: f64) -> EdgeMap {
        let rng = CounterRng::new(2);
        let plane = Frame::filled(width, height, 0.0f32);
        let class = Frame::filled(width, height, NO_CLASS);
        let (gradient_x, gradient_y, magnitude) = (plane.clone(), plane.clone(), plane);
        let mut map = EdgeMap { gradient_x, gradient_y, magnitude, class, rows: vec![], columns: vec![] };
        for at in 0..width * height {
            if rng.uniform(at as u64) < share {
                map.rows.push((at / width) as u32);
                map.columns.push((at % width) as u32);
            }
        }
        map
    }

    /// `L_r` by the definition: one direction, every edge pixel in an order in which those behind come first.
    fn path(edges: &EdgeMap, costs: &[u16], padded: usize, (dx, dy): (i64, i64)) -> Vec<u16> {
        let index = |x: i64, y: i64| {
            (0..edges.len()).find(|&i| (i64::from(edges.columns[i]), i64::from(edges.rows[i])) == (x, y))
        };
        let mut order: Vec<usize> = (0..edges.len()).collect();
        order.sort_by_key(|&i| dx * i64::from(edges.columns[i]) + dy * i64::from(edges.rows[i]));
        let mut paths = vec![0u16; costs.len()];
        for p in order {
            let (x, y) = (i64::from(edges.columns[p]), i64::from(edges.rows[p]));
            let behind = (1..=MAX_GAP as i64).find_map(|g| Some((g as usize, index(x - g * dx, y - g * dy)?)));
            for k in 0..padded {
                let mut value = costs[p * padded + k];
                if let Some((gap, q)) = behind {
                    let before = &paths[q * padded..(q + 1) * padded];
                    let least = *before.iter().min().unwrap();
                    let [near, far] = penalties()[gap];
                    let mut best = before[k].min(least + far);
                    for beside in [k.checked_sub(1), (k + 1 < padded).then_some(k + 1)].into_iter().flatten() {
                        best = best.min(before[beside] + near);
                    }
                    value += best - least;
                }
                paths[p * padded + k] = value;
            }
        }
        paths
    }

    #[test]
    fn both_sweeps_are_the_eight_directions_at_every_level() {
        let edges = strewn(41, 37, 0.1);
        let padded = 2 * CHUNK;
        let rng = CounterRng::new(9);
        let costs: Vec<u16> =
            (0..edges.len() * padded).map(|i| (rng.uniform(i as u64) * f64::from(MAX_COST)) as u16).collect();
        for (from, directions) in
            [(From::Above, [(1, 0), (0, 1), (1, 1), (-1, 1)]), (From::Below, [(-1, 0), (0, -1), (1, -1), (-1, -1)])]
        {
            let mut want = vec![0u16; costs.len()];
            for direction in directions {
                for (sum, value) in want.iter_mut().zip(path(&edges, &costs, padded, direction)) {
                    *sum += value;
                }
            }
            assert_eq!(sweep(&edges, &costs, padded, from), want);
            for level in Level::available() {
                let mut total = vec![0u16; costs.len()];
                dispatch(level, Sweep { edges: &edges, costs: &costs, padded, from, total: &mut total });
                assert_eq!(total, want, "{level:?}");
            }
        }
    }
}
