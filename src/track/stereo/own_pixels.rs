//! Pixels of a cluster that show its own surface.
//!
//! Half of the edge pixels along an outline lie just beyond it, on the background. They have the object's
//! motion and disparity, but bias medians of positions. Their brightness is that of the background.

use super::{cluster_motion::middle, cluster_motion::places, clusters::Clusters};
use crate::image::Interpolation;
use crate::types::Frame;

/// Side of the squares that pixels are sorted into, px.
const CELL_SIDE: f64 = 8.0;
/// Neighbouring squares on every side.
const RINGS: i64 = 3;
/// Radius of the neighbourhood, px.
const RADIUS: f64 = CELL_SIDE * RINGS as f64;
/// Distance along the gradient above which a neighbour is off the edge, px.
const ON_EDGE: f64 = 2.0;
/// Distance along the edge over that from it, above which a neighbour may be on the edge: the gradient
/// direction is uncertain.
const MIN_ASPECT: f64 = 2.5;
/// Smallest number of neighbours on the cluster's side of an edge.
const MIN_NEIGHBOURS: usize = 3;
/// Distances from the edge at which brightness is sampled, px.
const SIDES: [f64; 3] = [2.0, 2.5, 3.0];
/// Smallest share of the contrast above the background of an own pixel: half, and a margin for noise.
const MIN_BRIGHTNESS_SHARE: f64 = 0.55;
/// Density over the median density below which a pixel is an outlier.
const MIN_DENSITY_RATIO: f64 = 0.1;

/// A view, and its slightly smoothed version for gradients.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a> {
    pub plain: &'a Frame<f32>,
    pub smooth: &'a Frame<f32>,
}

/// Medians along x and y, px, of the pixels on the cluster's own surface, without outliers; of all pixels if
/// fewer than half remain.
pub(super) fn own_middle(clusters: &Clusters, k: usize, view: View<'_>) -> [f64; 2] {
    let all = places(clusters, k);
    if !crate::ablation::keeps("stereo.own_pixels") {
        return middle(&all);
    }
    let own = own_places(&all, view);
    middle(if 2 * own.len() > all.len() { &own } else { &all })
}

fn own_places(all: &[[f64; 2]], view: View<'_>) -> Vec<[f64; 2]> {
    let squares = Squares::new(all);
    let crowds = squares.crowds(all);
    let mut sorted = crowds.clone();
    sorted.sort_unstable();
    let least = sorted.get(sorted.len() / 2).map_or(0.0, |usual| MIN_DENSITY_RATIO * *usual as f64);
    let own = |&(&place, &crowd): &(&[f64; 2], &usize)| crowd as f64 >= least && !is_beyond(place, &squares, view);
    all.iter().zip(&crowds).filter(own).map(|(place, _)| *place).collect()
}

/// Whether a pixel is of the cluster's outline and has the brightness of what is beyond.
fn is_beyond([x, y]: [f64; 2], squares: &Squares<'_>, view: View<'_>) -> bool {
    let Some(normal) = direction(view.smooth, x as usize, y as usize) else { return false };
    let Some(sign) = squares.only_side([x, y], normal) else { return false };
    let at = |distance: f64| {
        let along = sign * distance;
        f64::from(Interpolation::Bilinear.at(view.plain, x + along * normal[0], y + along * normal[1]))
    };
    let mean = |sign: f64| SIDES.iter().map(|distance| at(sign * distance)).sum::<f64>() / SIDES.len() as f64;
    let (before, beyond) = (mean(1.0), mean(-1.0));
    let contrast = before - beyond;
    (at(0.0) - beyond) * contrast < MIN_BRIGHTNESS_SHARE * contrast * contrast
}

/// Direction of the gradient at a pixel; `None` beside the border and where there is none.
fn direction(frame: &Frame<f32>, x: usize, y: usize) -> Option<[f64; 2]> {
    if x == 0 || y == 0 || x + 1 >= frame.width() || y + 1 >= frame.height() {
        return None;
    }
    let along_x = f64::from(frame.get(x + 1, y) - frame.get(x - 1, y));
    let along_y = f64::from(frame.get(x, y + 1) - frame.get(x, y - 1));
    let size = along_x.hypot(along_y);
    (size > 0.0 && size.is_finite()).then(|| [along_x / size, along_y / size])
}

struct Squares<'a> {
    first: [i64; 2],
    size: [i64; 2],
    places: Vec<Vec<&'a [f64; 2]>>,
    /// Offsets to neighbouring squares, nearest rings first: these usually decide.
    rings: Vec<[i64; 2]>,
}

impl<'a> Squares<'a> {
    fn new(all: &'a [[f64; 2]]) -> Self {
        let bounds = |i: usize| {
            let along = || all.iter().map(|place| square_of(place[i]));
            let first = along().min().unwrap_or(0);
            (first, along().max().unwrap_or(0) - first + 1)
        };
        let ((left, width), (top, height)) = (bounds(0), bounds(1));
        let mut rings: Vec<[i64; 2]> =
            (-RINGS..=RINGS).flat_map(|dy| (-RINGS..=RINGS).map(move |dx| [dx, dy])).collect();
        rings.sort_by_key(|[dx, dy]| dx.abs().max(dy.abs()));
        let mut squares = Self { first: [left, top], size: [width, height], places: vec![], rings };
        squares.places.resize((width * height) as usize, vec![]);
        for place in all {
            if let Some(index) = squares.index(square_of(place[0]), square_of(place[1])) {
                squares.places[index].push(place);
            }
        }
        squares
    }

    fn index(&self, column: i64, row: i64) -> Option<usize> {
        let (column, row) = (column - self.first[0], row - self.first[1]);
        let inside = (0..self.size[0]).contains(&column) && (0..self.size[1]).contains(&row);
        inside.then_some((row * self.size[0] + column) as usize)
    }

    fn about(&self, column: i64, row: i64) -> impl Iterator<Item = &Vec<&'a [f64; 2]>> {
        let square = move |[dx, dy]: &[i64; 2]| self.index(column + dx, row + dy);
        self.rings.iter().filter_map(square).map(|index| &self.places[index])
    }

    fn crowds(&self, all: &[[f64; 2]]) -> Vec<usize> {
        let [left, top] = self.first;
        let crowd = |i: i64| self.about(left + i % self.size[0], top + i / self.size[0]).map(Vec::len).sum();
        let crowds: Vec<usize> = (0..self.size[0] * self.size[1]).map(crowd).collect();
        all.iter().filter_map(|place| self.index(square_of(place[0]), square_of(place[1]))).map(|i| crowds[i]).collect()
    }

    /// Side of the edge, 1 or -1 along the normal, of all other pixels; `None` if on both, or too few.
    fn only_side(&self, [x, y]: [f64; 2], normal: [f64; 2]) -> Option<f64> {
        let mut counts = [0, 0];
        for other in self.about(square_of(x), square_of(y)).flatten() {
            let (dx, dy) = (other[0] - x, other[1] - y);
            let (from, along) = (dx * normal[0] + dy * normal[1], dy * normal[0] - dx * normal[1]);
            let aside = from.abs() > ON_EDGE && along.abs() <= MIN_ASPECT * from.abs();
            if !aside || dx * dx + dy * dy > RADIUS * RADIUS {
                continue;
            }
            counts[usize::from(from < 0.0)] += 1;
            if counts[0] > 0 && counts[1] > 0 {
                return None;
            }
        }
        match counts {
            [before, 0] if before >= MIN_NEIGHBOURS => Some(1.0),
            [0, before] if before >= MIN_NEIGHBOURS => Some(-1.0),
            _ => None,
        }
    }
}

fn square_of(along: f64) -> i64 {
    (along / CELL_SIDE) as i64
}
