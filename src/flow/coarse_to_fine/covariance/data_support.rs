//! How far places are from the edge of what all frames see.
//!
//! Where motion leads out of a frame there are no data, and the motion is that of the nearest seen sites,
//! continued. That edge, and not the frame's, is where windows see less. Areas without texture are continued
//! in the same way.

use crate::flow::coarse_to_fine::data_term::SEEN;
use crate::flow::coarse_to_fine::planes::Planes;
use crate::flow::coarse_to_fine::refine::{PITCH, SPACING};
use crate::simd::SimdReal;

/// Usable share of a window from which on a site counts as seen: the sites along the frame's edge do.
const MIN_USABLE_SHARE: f64 = 0.1;

/// Where the places of the evidence lie in what is seen.
pub(super) struct DataSupport {
    /// Signed distances, px, along x and along y, to the outermost seen site; negative where a place itself
    /// is not seen.
    distances: Vec<[f64; 2]>,
    along: Axis,
    across: Axis,
    width: usize,
}

/// The nearer edge of the frame along an axis.
pub(super) struct Edge {
    /// How far it is, px.
    pub distance: f64,
    /// How wide the strip is, px, that is not seen there.
    pub strip: f64,
}

impl DataSupport {
    /// At the `width x height` places of the evidence.
    pub fn new<T: SimdReal>(data: &Planes<T>, size: (usize, usize)) -> Self {
        Self::with(data, size, |_, _| true)
    }

    /// The same, where only those sites count as seen whose nearest place has texture (`textured`, row by
    /// row): where there is none, motion is continued as well.
    pub fn textured<T: SimdReal>(data: &Planes<T>, size: (usize, usize), textured: &[bool]) -> Self {
        let nearest = |site: usize, count: usize| ((site + SPACING / 2) / SPACING).min(count - 1);
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
            // Inside a hole the nearer side is what the motion is continued from.
            if dx < 0.0 && dy < 0.0 && along.own[y] && across.own[x] {
                if dx < dy { dx = f64::INFINITY } else { dy = f64::INFINITY }
            }
            [dx, dy]
        });
        Self { distances: distances.collect(), along, across, width }
    }

    /// Of a place, along x and along y, px: to the outermost seen site of its run, or, negative, back to the
    /// nearest seen one.
    pub fn distances(&self, x: usize, y: usize) -> [f64; 2] {
        self.distances[y * self.width + x]
    }

    /// The edges of the frame that a place is nearest to, along x and along y.
    pub fn edges(&self, x: usize, y: usize) -> [Edge; 2] {
        [self.along.edge(x, y), self.across.edge(y, x)]
    }

    /// How far the motion of a place is continued, px; 0 where it is seen.
    pub fn continued_distance(&self, x: usize, y: usize) -> f64 {
        let [dx, dy] = self.distances(x, y).map(|d| (-d).max(0.0));
        dx.hypot(dy)
    }
}

/// The distances along one axis.
struct Axis {
    /// Of every place, line by line.
    distances: Vec<f64>,
    places: usize,
    /// The first and the last seen site of every line of places.
    ends: Vec<[usize; 2]>,
    sites: usize,
    /// Whether anything is seen on a line itself and not only on a neighbouring one.
    own: Vec<bool>,
}

impl Axis {
    /// For lines of so many sites and so many lines of them; the same of places; whether the site at a
    /// position on a line is seen.
    fn new(sites: [usize; 2], places: [usize; 2], is_usable: impl Fn(usize, usize) -> bool) -> Self {
        let any: Vec<bool> = (0..sites[1]).map(|line| (0..sites[0]).any(|at| is_usable(at, line))).collect();
        let (mut distances, mut own, mut ends) = (Vec::with_capacity(places[0] * places[1]), Vec::new(), Vec::new());
        for n in 0..places[1] {
            let line = (SPACING * n).min(sites[1] - 1);
            let nearest = (0..sites[1]).filter(|l| any[*l]).min_by_key(|l| l.abs_diff(line));
            own.push(any[line]);
            if let Some(line) = nearest {
                let row: Vec<bool> = (0..sites[0]).map(|at| is_usable(at, line)).collect();
                let all = signed(&row);
                distances.extend((0..places[0]).map(|n| PITCH * all[(SPACING * n).min(sites[0] - 1)]));
                let first = row.iter().position(|is_usable| *is_usable).unwrap_or(0);
                ends.push([first, row.iter().rposition(|is_usable| *is_usable).unwrap_or(first)]);
            } else {
                distances.extend((0..places[0]).map(|_| -PITCH * sites[0] as f64));
                ends.push([0, sites[0] - 1]);
            }
        }
        Self { distances, places: places[0], ends, sites: sites[0], own }
    }

    fn edge(&self, at: usize, line: usize) -> Edge {
        let (last, [first_seen, last_seen]) = (self.sites - 1, self.ends[line]);
        let at = (SPACING * at).min(last);
        let (near, strip) = if at <= last - at { (at, first_seen) } else { (last - at, last - last_seen) };
        Edge { distance: PITCH * near as f64, strip: PITCH * strip as f64 }
    }

    fn distance(&self, at: usize, line: usize) -> f64 {
        self.distances[line * self.places + at]
    }
}

/// Steps from each site to the outermost seen one of its run, or back to the nearest seen one.
fn signed(is_usable: &[bool]) -> Vec<f64> {
    let steps = |order: &mut dyn Iterator<Item = usize>| {
        let mut out = vec![f64::INFINITY; is_usable.len()];
        let mut before: Option<(bool, f64)> = None;
        for at in order {
            let count = match before {
                Some((same, count)) if same == is_usable[at] => count + 1.0,
                Some(_) if !is_usable[at] => 1.0,
                // Unseen ones at the frame's edge have nothing to come from on that side.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_counted_from_their_ends() {
        let row = |s: &str| s.bytes().map(|b| b == b'x').collect::<Vec<_>>();
        assert_eq!(signed(&row("..xxxx.")), [-2.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0]);
        assert_eq!(signed(&row("xx...x")), [0.0, 0.0, -1.0, -2.0, -1.0, 0.0]);
    }

    #[test]
    fn strips_and_corners_are_continued_from_the_seen_rectangle_and_holes_from_the_nearer_side() {
        let (width, height) = (41, 33);
        let mut data = Planes::<f64>::new(width, height, SEEN + 1);
        for y in 3..height {
            for x in 5..width {
                let hole = (10..35).contains(&x) && (15..18).contains(&y);
                data.line_mut(SEEN, y)[x] = f64::from(u8::from(!hole));
            }
        }
        let is_usable = DataSupport::new(&data, (11, 9));
        assert_eq!(is_usable.continued_distance(0, 0), 2.0 * 5f64.hypot(3.0));
        assert_eq!((is_usable.continued_distance(0, 6), is_usable.continued_distance(5, 0)), (10.0, 6.0));
        assert_eq!(is_usable.continued_distance(5, 4), 4.0);
        assert_eq!((is_usable.continued_distance(5, 6), is_usable.distances(10, 6)), (0.0, [0.0, 16.0]));
        let edges = |x, y| is_usable.edges(x, y).map(|edge| (edge.distance, edge.strip));
        assert_eq!((edges(1, 8), edges(10, 0)), ([(8.0, 10.0), (0.0, 0.0)], [(0.0, 0.0), (0.0, 6.0)]));
    }
}
