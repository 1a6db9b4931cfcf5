//! Data support: distances of nodes from the edge of the area that all frames show.
//!
//! Where motion leads out of a frame or there is no texture, the motion is extrapolated from the nearest
//! usable sites. Windows are truncated at that edge, not at the frame's.

use crate::flow::coarse_to_fine::data_term::{MIN_USABLE_SHARE, SEEN};
use crate::flow::coarse_to_fine::planes::{Planes, SITE_SPACING};
use crate::flow::coarse_to_fine::refine::SITES_PER_NODE;
use crate::simd::SimdReal;

pub(super) struct DataSupport {
    /// Signed distances, px, along x and y, to the outermost usable site; negative at nodes without data.
    distances: Vec<[f64; 2]>,
    along: Axis,
    across: Axis,
    width: usize,
}

/// The nearer edge of the frame along an axis.
pub(super) struct Edge {
    /// Distance, px.
    pub distance: f64,
    /// Width, px, of the strip without data at that edge.
    pub strip: f64,
}

impl DataSupport {
    pub fn new<T: SimdReal>(data: &Planes<T>, size: (usize, usize)) -> Self {
        Self::with(data, size, |_, _| true)
    }

    /// The same, counting only sites whose nearest node has texture (`textured`, row by row).
    pub fn textured<T: SimdReal>(data: &Planes<T>, size: (usize, usize), textured: &[bool]) -> Self {
        let nearest = |site: usize, count: usize| ((site + SITES_PER_NODE / 2) / SITES_PER_NODE).min(count - 1);
        Self::with(data, size, |x, y| textured[nearest(y, size.1) * size.0 + nearest(x, size.0)])
    }

    fn with<T: SimdReal>(
        data: &Planes<T>,
        (width, height): (usize, usize),
        counts: impl Fn(usize, usize) -> bool,
    ) -> Self {
        let is_usable = |x: usize, y: usize| data.at(SEEN, x, y).to_f64() >= MIN_USABLE_SHARE && counts(x, y);
        let along = Axis::new([data.width, data.height], [width, height], is_usable);
        let across = Axis::new([data.height, data.width], [height, width], |y, x| is_usable(x, y));
        let distances = (0..width * height).map(|n| {
            let (x, y) = (n % width, n / width);
            let [mut dx, mut dy] = [along.distance(x, y), across.distance(y, x)];
            // Inside a hole, motion is extrapolated from the nearer side.
            if dx < 0.0 && dy < 0.0 && along.own[y] && across.own[x] {
                if dx < dy { dx = f64::INFINITY } else { dy = f64::INFINITY }
            }
            [dx, dy]
        });
        Self { distances: distances.collect(), along, across, width }
    }

    pub fn distances(&self, x: usize, y: usize) -> [f64; 2] {
        self.distances[y * self.width + x]
    }

    pub fn edges(&self, x: usize, y: usize) -> [Edge; 2] {
        [self.along.edge(x, y), self.across.edge(y, x)]
    }

    /// Distance over which the motion of a node is extrapolated, px; 0 where there are data.
    pub fn continued_distance(&self, x: usize, y: usize) -> f64 {
        let [dx, dy] = self.distances(x, y).map(|d| (-d).max(0.0));
        dx.hypot(dy)
    }
}

struct Axis {
    distances: Vec<f64>,
    nodes: usize,
    ends: Vec<[usize; 2]>,
    sites: usize,
    /// Whether a line itself has usable sites, and not only a neighbouring one.
    own: Vec<bool>,
}

impl Axis {
    /// For `sites[1]` lines of `sites[0]` sites, the same of nodes; whether the site on a line is usable.
    fn new(sites: [usize; 2], nodes: [usize; 2], is_usable: impl Fn(usize, usize) -> bool) -> Self {
        let any: Vec<bool> = (0..sites[1]).map(|line| (0..sites[0]).any(|at| is_usable(at, line))).collect();
        let (mut distances, mut own, mut ends) = (Vec::with_capacity(nodes[0] * nodes[1]), Vec::new(), Vec::new());
        for n in 0..nodes[1] {
            let line = (SITES_PER_NODE * n).min(sites[1] - 1);
            let nearest = (0..sites[1]).filter(|l| any[*l]).min_by_key(|l| l.abs_diff(line));
            own.push(any[line]);
            if let Some(line) = nearest {
                let row: Vec<bool> = (0..sites[0]).map(|at| is_usable(at, line)).collect();
                let all = signed(&row);
                distances.extend((0..nodes[0]).map(|n| SITE_SPACING * all[(SITES_PER_NODE * n).min(sites[0] - 1)]));
                let first = row.iter().position(|is_usable| *is_usable).unwrap_or(0);
                ends.push([first, row.iter().rposition(|is_usable| *is_usable).unwrap_or(first)]);
            } else {
                distances.extend((0..nodes[0]).map(|_| -SITE_SPACING * sites[0] as f64));
                ends.push([0, sites[0] - 1]);
            }
        }
        Self { distances, nodes: nodes[0], ends, sites: sites[0], own }
    }

    fn edge(&self, at: usize, line: usize) -> Edge {
        let (last, [first_seen, last_seen]) = (self.sites - 1, self.ends[line]);
        let at = (SITES_PER_NODE * at).min(last);
        let (near, strip) = if at <= last - at { (at, first_seen) } else { (last - at, last - last_seen) };
        Edge { distance: SITE_SPACING * near as f64, strip: SITE_SPACING * strip as f64 }
    }

    fn distance(&self, at: usize, line: usize) -> f64 {
        self.distances[line * self.nodes + at]
    }
}

/// Steps from each site to the outermost usable one of its run, or back to the nearest usable one.
fn signed(is_usable: &[bool]) -> Vec<f64> {
    let steps = |order: &mut dyn Iterator<Item = usize>| {
        let mut out = vec![f64::INFINITY; is_usable.len()];
        let mut before: Option<(bool, f64)> = None;
        for at in order {
            let count = match before {
                Some((same, count)) if same == is_usable[at] => count + 1.0,
                Some(_) if !is_usable[at] => 1.0,
                // At the frame's edge there is nothing to extrapolate from on that side.
                None if !is_usable[at] => f64::INFINITY,
                _ => 0.0,
            };
            before = Some((is_usable[at], count));
            out[at] = count;
        }
        out
    };
    let (forth, back) = (steps(&mut (0..is_usable.len())), steps(&mut (0..is_usable.len()).rev()));
    is_usable
        .iter()
        .zip(forth.iter().zip(&back))
        .map(|(is_usable, (a, b))| if *is_usable { a.min(*b) } else { -a.min(*b) })
        .collect()
}
