//! Matches of blocks for motions that linearisation does not find: farther than a grain of the texture.
//!
//! On one coarse level each textured block whose present motion does not correlate with the next frame is
//! searched for all around, by zero-mean normalised cross-correlation (J. P. Lewis, "Fast normalized
//! cross-correlation", 1995). Sites take what was found where it leaves less residual energy
//! ([`super::comparison`]).

use crate::flow::coarse_to_fine::{data_term::View, planes::Planes, planes::SITE_SPACING};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;
use std::ops::RangeInclusive;

/// Side of a block, px of the level, and distance of their corners.
const SIDE: usize = 16;
const SPACING: usize = 8;
/// Maximum displacement, as a share of the level's width and height.
const MAX_SHARE: f64 = 0.3;
/// Correlation below which the present motion is in doubt, and minimum correlation of a match.
const DOUBTFUL: f32 = 0.5;
const MIN_CORRELATION: f32 = 0.65;
/// Minimum standard deviation of a block, scaled grey levels.
const MIN_CONTRAST: f32 = 1.0;
/// Minimum distance, px of the level, of a match from the present motion: iterations find nearer ones.
const MIN_DISTANCE: f32 = 5.0;

/// Writes what is found for whole blocks to `found`, a copy of the `motion`; returns whether anything was.
pub(super) fn block_matches<T: SimdReal>(
    simd: Level,
    views: &[View<'_, T>],
    motion: &Planes<T>,
    found: &mut Planes<T>,
) -> bool {
    let [.., from, to] = views else { return false };
    let pictures = [from, to].map(|view| picture(simd, view));
    let (width, height) = pictures[0].size();
    if width < 2 * SIDE || height < 2 * SIDE {
        return false;
    }
    let corners =
        (0..=height - SIDE).step_by(SPACING).flat_map(|y| (0..=width - SIDE).step_by(SPACING).map(move |x| (x, y)));
    let search = Search { simd, pictures: &pictures, motion, time: from.time.to_f64() as f32 };
    let mut matches: Vec<Match> = parallel::map(corners, |corner| search.block(corner)).into_iter().flatten().collect();
    // The best is written last.
    let is_empty = matches.is_empty();
    matches.sort_by(|a, b| a.correlation.total_cmp(&b.correlation));
    for Match { centre, flow, .. } in matches {
        let sites = |centre: f32, count: usize| {
            let (from, to) = (centre - 0.5 * SIDE as f32, centre + 0.5 * SIDE as f32);
            let site = |at: f32| (at / SITE_SPACING as f32).round().clamp(0.0, count as f32) as usize;
            site(from)..site(to)
        };
        for y in sites(centre[1], motion.height) {
            for k in 0..6 {
                let value = T::from_f64(flow.get(k).map_or(0.0, |flow| f64::from(*flow)));
                found.line_mut(k, y)[sites(centre[0], motion.width)].fill(value);
            }
        }
    }
    !is_empty
}

fn picture<T: SimdReal>(simd: Level, view: &View<'_, T>) -> Frame<f32> {
    let (width, height) = view.spline.size();
    let xs: Vec<T> = (0..width).map(|x| T::from_f64(x as f64)).collect();
    let (mut ys, mut out) = (vec![T::from_f64(0.0); width], vec![T::from_f64(0.0); width]);
    let mut picture = Frame::filled(width, height, 0.0);
    for y in 0..height {
        ys.fill(T::from_f64(y as f64));
        view.spline.sample_row(simd, &xs, &ys, &mut out);
        picture.row_mut(y).iter_mut().zip(&out).for_each(|(to, from)| *to = from.to_f64() as f32);
    }
    picture
}

struct Match {
    /// Of the block at the time of the motion, px.
    centre: [f32; 2],
    flow: [f32; 2],
    correlation: f32,
}

struct Search<'a, T> {
    simd: Level,
    pictures: &'a [Frame<f32>; 2],
    motion: &'a Planes<T>,
    /// Of the first picture, in frames from that of the motion.
    time: f32,
}

impl<T: SimdReal> Search<'_, T> {
    fn block(&self, (x, y): (usize, usize)) -> Option<Match> {
        let (width, height) = self.pictures[0].size();
        let template = template(&self.pictures[0], (x, y))?;
        let present = self.present((x, y));
        let reach = [width, height].map(|size| (MAX_SHARE * size as f64).ceil() as isize);
        let allowed = |at: usize, from: isize, to: isize, size: usize| {
            from.max(-(at as isize))..=to.min((size - SIDE - at) as isize)
        };
        let best = |columns: RangeInclusive<isize>, rows: RangeInclusive<isize>| {
            let columns = allowed(x, *columns.start(), *columns.end(), width);
            let rows = allowed(y, *rows.start(), *rows.end(), height);
            dispatch(self.simd, Best { template: &template, picture: &self.pictures[1], corner: (x, y), columns, rows })
        };
        let [near_x, near_y] = present.map(|flow| flow.round() as isize);
        if best(near_x - 1..=near_x + 1, near_y - 1..=near_y + 1).correlation >= DOUBTFUL {
            return None;
        }
        let Place { correlation, offset: (dx, dy) } = best(-reach[0]..=reach[0], -reach[1]..=reach[1]);
        if correlation < MIN_CORRELATION {
            return None;
        }
        let flow = [dx as f32, dy as f32];
        if (flow[0] - present[0]).hypot(flow[1] - present[1]) < MIN_DISTANCE {
            return None;
        }
        // A point of the first picture is at `x - time flow` when the motion is.
        let middle = [x, y].map(|corner| corner as f32 + 0.5 * (SIDE - 1) as f32);
        Some(Match { centre: [0, 1].map(|k| middle[k] - self.time * flow[k]), flow, correlation })
    }

    /// Present flow in the middle of a block, px.
    fn present(&self, (x, y): (usize, usize)) -> [f32; 2] {
        let site = |corner: usize, count: usize| ((corner + SIDE / 2) / SITE_SPACING as usize).min(count - 1);
        let (x, y) = (site(x, self.motion.width), site(y, self.motion.height));
        [0, 1].map(|k| self.motion.at(k, x, y).to_f64() as f32)
    }
}

/// A block with mean 0 and norm 1; `None` without texture.
fn template(picture: &Frame<f32>, (x, y): (usize, usize)) -> Option<Vec<f32>> {
    let mut block: Vec<f32> = (y..y + SIDE).flat_map(|y| picture.row(y)[x..x + SIDE].to_vec()).collect();
    let mean = block.iter().sum::<f32>() / block.len() as f32;
    for value in &mut block {
        *value -= mean;
    }
    let norm = block.iter().map(|value| value * value).sum::<f32>().sqrt();
    if norm <= MIN_CONTRAST * SIDE as f32 {
        return None;
    }
    for value in &mut block {
        *value /= norm;
    }
    Some(block)
}

/// A displacement and the correlation there.
struct Place {
    correlation: f32,
    offset: (isize, isize),
}

/// The best of some displacements of a block with its corner at `corner`.
struct Best<'a> {
    template: &'a [f32],
    picture: &'a Frame<f32>,
    corner: (usize, usize),
    columns: RangeInclusive<isize>,
    rows: RangeInclusive<isize>,
}

impl Kernel<f32> for Best<'_> {
    type Output = Place;

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(self) -> Place {
        let Self { template, picture, corner, columns, rows } = self;
        let mut best = Place { correlation: -1.0, offset: (0, 0) };
        for dy in rows {
            for dx in columns.clone() {
                let (x, first) = (corner.0.wrapping_add_signed(dx), corner.1.wrapping_add_signed(dy));
                // Sums in lanes that the compiler sees.
                let (mut product, mut sum, mut squares) = ([0.0f32; SIDE], [0.0f32; SIDE], [0.0f32; SIDE]);
                for j in 0..SIDE {
                    let (row, wanted) = (&picture.row(first + j)[x..x + SIDE], &template[j * SIDE..(j + 1) * SIDE]);
                    for i in 0..SIDE {
                        product[i] += wanted[i] * row[i];
                        sum[i] += row[i];
                        squares[i] += row[i] * row[i];
                    }
                }
                let (mut totals, area) = ([0.0f32; 3], (SIDE * SIDE) as f32);
                for i in 0..SIDE {
                    totals[0] += product[i];
                    totals[1] += sum[i];
                    totals[2] += squares[i];
                }
                let spread = totals[2] - totals[1] * totals[1] / area;
                let correlation = if spread > 0.0 { totals[0] / spread.sqrt() } else { 0.0 };
                if correlation > best.correlation {
                    best = Place { correlation, offset: (dx, dy) };
                }
            }
        }
        best
    }
}
