//! Sparse semi-global matching of two views whose rows are aligned, checked from both sides.

use super::chains::{From, sweep};
use super::cost::{Candidates, Coded, MAX_COST, Side, costs};
use super::edges::{EdgeMap, EdgeSettings};
use super::options::EdgeDisparityOptions;
use crate::image::gaussian_gradient;
use crate::parallel;
use crate::simd::Level;
use crate::types::Frame;
use std::ops::Range;

/// Largest cost of a match over the highest cost.
const MAX_COST_SHARE: f32 = 0.8;
/// Tolerance of the left-right check, px.
const DISPARITY_TOLERANCE: f32 = 1.0;
/// Standard deviation of the Gaussian behind the gradients that are compared, px, and where it is cut off.
const COMPARED: (f64, usize) = (1.0, 4);
/// Edge pixels of one task.
const TASK: usize = 256;

/// One view ready to be matched.
pub(super) struct View {
    /// Its edges.
    pub edges: EdgeMap,
    /// Slope along x with a Gaussian of 1 px.
    pub along_x: Frame<f32>,
    /// Slope along y with a Gaussian of 1 px.
    pub along_y: Frame<f32>,
}

impl View {
    /// Edges and gradients of a view.
    pub(super) fn new(view: &Frame<f32>, settings: &EdgeSettings) -> Self {
        let (along_x, along_y) = gaussian_gradient(Level::detect(), view, COMPARED.0, COMPARED.1);
        Self { edges: EdgeMap::new(view, settings), along_x, along_y }
    }

    /// Edges and gradients with the settings of the options.
    pub(super) fn of(view: &Frame<f32>, options: &EdgeDisparityOptions) -> Self {
        Self::new(view, &EdgeSettings::of(options))
    }
}

/// The match of an edge pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Match {
    /// px, fitted between the candidates unless whole ones are wanted.
    pub disparity: f32,
    /// Matching cost of the winner over its truncation, 0 to 1.
    pub cost: f32,
}

/// Disparity of every edge pixel of `left`, `None` where none is accepted.
pub(super) fn match_views(left: &View, right: &View, options: &EdgeDisparityOptions) -> Vec<Option<Match>> {
    let (least, greatest) = options.disparity_range;
    let count = (greatest - least + 1) as usize;
    // Columns ascend with falling disparity in the left view, with rising disparity in the right view.
    let from_left = Candidates { first: -greatest, count };
    let from_right = Candidates { first: least, count };
    let reach = from_left.reach().max(from_right.reach());
    let (own, other) = parallel::join(
        || Coded::new(&left.along_x, &left.along_y, Side::Left, reach),
        || Coded::new(&right.along_x, &right.along_y, Side::Right, reach),
    );
    let width = left.edges.class.width();
    let allowed = |edge: usize| {
        let (x, y) = (left.edges.columns[edge], left.edges.rows[edge]);
        let Some((low, high)) = options.candidates(x as usize, y as usize) else { return 0..0 };
        let inside = from_left.inside(x, width);
        let (first, end) = ((greatest - high) as usize, (greatest - low + 1) as usize);
        inside.start.max(first)..inside.end.min(end)
    };
    let place = if options.subpixel { fitted } else { whole };
    let find_left = || winners(&left.edges, [&own, &other], from_left, allowed, place, |k| greatest as f32 - k);
    if !options.left_right_check {
        return find_left();
    }
    let everywhere = |edge: usize| from_right.inside(right.edges.columns[edge], width);
    let find_right = || winners(&right.edges, [&other, &own], from_right, everywhere, place, |k| least as f32 + k);
    let (mut matches, confirming) = parallel::join(find_left, find_right);
    keep_confirmed(&left.edges, &mut matches, &right.edges, &confirming);
    matches
}

/// The candidate with the least `sum_r L_r` of every edge pixel, as a disparity.
fn winners(
    edges: &EdgeMap,
    [own, other]: [&Coded; 2],
    candidates: Candidates,
    allowed: impl Fn(usize) -> Range<usize> + Sync,
    place: Place,
    disparity: impl Fn(f32) -> f32 + Sync,
) -> Vec<Option<Match>> {
    let padded = candidates.padded();
    let costs = costs(edges, own, other, candidates, &allowed);
    let (above, below) =
        parallel::join(|| sweep(edges, &costs, padded, From::Above), || sweep(edges, &costs, padded, From::Below));
    let mut matches = vec![None; edges.len()];
    parallel::for_each(matches.chunks_mut(TASK).enumerate(), |(task, out)| {
        let mut sums = vec![0u16; padded];
        for (i, out) in out.iter_mut().enumerate() {
            let edge = task * TASK + i;
            let span = edge * padded..(edge + 1) * padded;
            for (sum, (a, b)) in sums.iter_mut().zip(above[span.clone()].iter().zip(&below[span.clone()])) {
                *sum = a + b;
            }
            let lowest = lowest(&sums, &costs[span], allowed(edge));
            *out = lowest.map(|(k, cost)| Match { disparity: disparity(place(&sums, k, allowed(edge))), cost });
        }
    });
    matches
}

/// The candidate with the least sum, and its cost over the highest; none above the limit.
fn lowest(sums: &[u16], costs: &[u16], allowed: Range<usize>) -> Option<(usize, f32)> {
    let best = allowed.min_by_key(|&k| sums[k])?;
    let cost = f32::from(costs[best]) / f32::from(MAX_COST);
    (cost <= MAX_COST_SHARE || !crate::ablation::keeps("edges.refused_cost")).then_some((best, cost))
}

/// Where the least sum is: beside, or at, the candidate that has it.
type Place = fn(&[u16], usize, Range<usize>) -> f32;

/// Between candidates: where two lines of equal slope through the lowest and its neighbours meet.
fn fitted(sums: &[u16], best: usize, allowed: Range<usize>) -> f32 {
    let inner = best > allowed.start && best + 1 < allowed.end;
    let (before, own, after) = if inner { (sums[best - 1], sums[best], sums[best + 1]) } else { (1, 0, 1) };
    let slope = 2.0 * f32::from(before.max(after) - own);
    let shift = if slope > 0.0 { (f32::from(before) - f32::from(after)) / slope } else { 0.0 };
    best as f32 + shift
}

/// At the candidate itself.
fn whole(_: &[u16], best: usize, _: Range<usize>) -> f32 {
    best as f32
}

/// Drops every match that none of the 3 x 3 edge pixels of the other view round its place confirms.
fn keep_confirmed(edges: &EdgeMap, matches: &mut [Option<Match>], others: &EdgeMap, confirming: &[Option<Match>]) {
    let (width, height) = edges.class.size();
    let mut found = Frame::filled(width, height, f32::NAN);
    for ((&row, &column), other) in others.rows.iter().zip(&others.columns).zip(confirming) {
        if let Some(other) = other {
            found.row_mut(row as usize)[column as usize] = other.disparity;
        }
    }
    for ((&row, &column), own) in edges.rows.iter().zip(&edges.columns).zip(matches) {
        let Some(disparity) = own.map(|own| own.disparity) else { continue };
        let (x, y) = ((column as f32 - disparity).round() as i64, i64::from(row));
        let near = |(x, y): (i64, i64)| {
            (0..width as i64).contains(&x)
                && (0..height as i64).contains(&y)
                && (found.get(x as usize, y as usize) - disparity).abs() <= DISPARITY_TOLERANCE
        };
        if !(-1..=1).any(|j| (-1..=1).any(|i| near((x + i, y + j)))) {
            *own = None;
        }
    }
}
