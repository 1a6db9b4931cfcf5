//! A graph over time: steps to the right, a lane for each component.

use super::{Picture, Rgb, clusters::identity_colour, draw::draw_number, draw::draw_stroke};

/// Distance of steps where there is room, and of lanes, px.
const PITCH: [f64; 2] = [36.0, 28.0];
/// Widest picture, px: of very long sequences the steps are drawn closer together.
const WIDEST: f64 = 16_000.0;
/// Room about the outermost nodes, px.
const MARGIN: f64 = 40.0;
/// Radius of a node of the mean size, and the greatest, px.
const RADIUS: [f64; 2] = [5.0, 12.0];
/// Colour of numbers and of the ground.
const INK: Rgb = [40; 3];
const GROUND: Rgb = [255; 3];
/// Numbers under the steps stand at least so far apart, px.
const TICKS: f64 = 30.0;

/// A node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartNode {
    /// Step, from 0.
    pub step: usize,
    /// Lane, from 0 at the top.
    pub lane: usize,
    /// What its area is to show, in any unit.
    pub size: f64,
    /// Its number, which gives the colour and is written where it first appears.
    pub number: u64,
}

/// Between two nodes of a list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartArc {
    /// Index of the earlier node.
    pub from: usize,
    /// Index of the later one.
    pub to: usize,
    /// Width, px.
    pub width: f64,
}

/// Draws nodes, as large as their sizes beside the mean, and the arcs between them; numbers of lanes on the
/// left, of steps below, and of each node's own number above the first that has it.
///
/// Arcs that name no node are left out.
pub fn chart_picture(nodes: &[ChartNode], arcs: &[ChartArc]) -> Picture {
    let steps = nodes.iter().map(|node| node.step).max().unwrap_or(0);
    let lanes = nodes.iter().map(|node| node.lane).max().unwrap_or(0);
    let across = PITCH[0].min(WIDEST / steps.max(1) as f64);
    let place = |node: &ChartNode| (MARGIN + across * node.step as f64, MARGIN + PITCH[1] * node.lane as f64);
    let (right, bottom) = (2.0 * MARGIN + across * steps as f64, 2.0 * MARGIN + PITCH[1] * lanes as f64);
    let mut picture = Picture::filled(right.ceil() as usize, bottom.ceil() as usize, GROUND);
    for arc in arcs {
        if let (Some(from), Some(to)) = (nodes.get(arc.from), nodes.get(arc.to)) {
            draw_stroke(&mut picture, place(from), place(to), arc.width, identity_colour(from.number));
        }
    }
    let mean = nodes.iter().map(|node| node.size).sum::<f64>() / nodes.len().max(1) as f64;
    let mut named = std::collections::BTreeSet::new();
    for node in nodes {
        let (x, y) = place(node);
        let share = if mean > 0.0 { (node.size / mean).max(0.0) } else { 1.0 };
        let radius = (RADIUS[0] * share.sqrt()).clamp(1.0, RADIUS[1]);
        draw_stroke(&mut picture, (x, y), (x, y), 2.0 * radius + 2.0, INK);
        draw_stroke(&mut picture, (x, y), (x, y), 2.0 * radius, identity_colour(node.number));
        if named.insert(node.number) {
            draw_number(&mut picture, node.number as usize, x - 2.0, y - radius, 1, INK);
        }
    }
    let every = (TICKS / across).ceil() as usize;
    for step in (0..=steps).step_by(every.max(1)) {
        draw_number(&mut picture, step, MARGIN + across * step as f64 - 3.0, bottom - 8.0, 2, INK);
    }
    for lane in 0..=lanes {
        draw_number(&mut picture, lane, 4.0, MARGIN + PITCH[1] * lane as f64 + 8.0, 2, INK);
    }
    picture
}
