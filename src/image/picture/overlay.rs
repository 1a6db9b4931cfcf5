//! Tracks drawn over a frame: box, path, centre with its error ellipse, window.

use super::{Picture, Rgb, clusters::identity_colour, draw::draw_number, draw::draw_stroke};
use crate::types::{TrackState, TrackStatus};

/// Squared radius of the ellipse that holds 95 % of a two-dimensional Gaussian: the 0.95 quantile of
/// chi-squared with two degrees of freedom, -2 ln 0.05.
const CHI_SQUARED_95: f64 = 5.991_464_547_107_979;

/// Strokes that an ellipse is drawn of.
const ELLIPSE_STROKES: usize = 48;

/// Half of the cross at the centre, px on the screen.
const CROSS: f64 = 3.0;

/// Longest side and length that are drawn, px: a target that ran away must not cost strokes without end.
const LONGEST: f64 = 1e5;

/// Colour of a target by how well it is in hand, told apart by people with any kind of colour vision: green
/// tracking, orange occluded, blue coasting, grey out, red lost.
///
/// Source: M. Okabe, K. Ito, "Color Universal Design", 2008.
pub fn status_colour(status: TrackStatus) -> Rgb {
    match status {
        TrackStatus::Tracking => [0, 200, 140],
        TrackStatus::Occluded => [240, 170, 20],
        TrackStatus::Coasting => [86, 180, 233],
        TrackStatus::Out => [170, 170, 170],
        TrackStatus::Lost => [224, 80, 40],
    }
}

/// What a target's colour says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TrackColours {
    /// How well it is in hand, as [`status_colour`].
    #[default]
    Status,
    /// Which one it is, as [`identity_colour`]. The box is dashed where the target was not measured, and left
    /// out once it is out of the picture or lost.
    Target,
}

/// How a target is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackOverlay {
    /// What colours say; default: the status.
    pub colours: TrackColours,
    /// By how much the picture is larger than the frame ([`Picture::enlarged`]); default 1.
    pub enlargement: usize,
    /// Width of the strokes, px of the picture; default 1.3.
    pub thickness: f64,
}

impl Default for TrackOverlay {
    fn default() -> Self {
        Self { colours: TrackColours::Status, enlargement: 1, thickness: 1.3 }
    }
}

/// A place on a path: where the target's centre was, px, and how well it was in hand.
pub type PathPoint = ([f64; 2], TrackStatus);

/// Draws a side of a polygon.
type DrawSide = fn(&TrackOverlay, &mut Picture, [f64; 2], [f64; 2], Rgb);

impl TrackOverlay {
    /// Draws target number `target` over `picture`: its box, turned by its rotation where that is observable;
    /// the path that it came, in the colours of its status; its centre as a cross, with the ellipse that
    /// holds the true centre with 95 % certainty if the covariance is right; the number at the box. What is
    /// not finite is left out.
    pub fn draw(&self, picture: &mut Picture, target: usize, state: &TrackState, path: &[PathPoint]) {
        let by_target = self.colours == TrackColours::Target;
        let colour_of = |status| if by_target { identity_colour(target as u64) } else { status_colour(status) };
        let colour = colour_of(state.status);
        for pair in path.windows(2) {
            self.stroke(picture, pair[0].0, pair[1].0, colour_of(pair[1].1));
        }
        if by_target && matches!(state.status, TrackStatus::Out | TrackStatus::Lost) {
            return;
        }
        let corners = box_corners(state);
        let side = if by_target && !state.status.is_measured() { Self::dashed } else { Self::stroke };
        self.polygon(picture, &corners, colour, side);
        self.polygon(picture, &ellipse(state), colour, Self::stroke);
        self.draw_cross(picture, state.position, colour);
        if let Some(label) = corners.iter().copied().reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1])]) {
            let [x, y] = self.on_picture(label);
            // The number identifies the target, so it is larger there.
            let size = if by_target { 2 * self.enlargement } else { self.enlargement };
            draw_number(picture, target, x, y, size.clamp(1, if by_target { 4 } else { 3 }), colour);
        }
    }

    /// A place in the frame on the enlarged picture: pixel `x` covers `factor` pixels from `factor x` on, so
    /// its centre lies half a factor further, less half a pixel.
    fn on_picture(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let factor = self.enlargement.max(1) as f64;
        [x, y].map(|c| (c + 0.5) * factor - 0.5)
    }

    fn stroke(&self, picture: &mut Picture, from: [f64; 2], to: [f64; 2], colour: Rgb) {
        let ([x0, y0], [x1, y1]) = (self.on_picture(from), self.on_picture(to));
        draw_stroke(picture, (x0, y0), (x1, y1), self.thickness, colour);
    }

    fn polygon(&self, picture: &mut Picture, corners: &[[f64; 2]], colour: Rgb, side: DrawSide) {
        for (k, corner) in corners.iter().enumerate() {
            side(self, picture, *corner, corners[(k + 1) % corners.len()], colour);
        }
    }

    /// A cross of one size on the screen, whatever the enlargement.
    fn draw_cross(&self, picture: &mut Picture, centre: [f64; 2], colour: Rgb) {
        let [x, y] = self.on_picture(centre);
        draw_stroke(picture, (x - CROSS, y), (x + CROSS, y), self.thickness, colour);
        draw_stroke(picture, (x, y - CROSS), (x, y + CROSS), self.thickness, colour);
    }

    fn dashed(&self, picture: &mut Picture, from: [f64; 2], to: [f64; 2], colour: Rgb) {
        // An odd number of equal parts, so that corners are inked.
        let parts = 2 * ((to[0] - from[0]).hypot(to[1] - from[1]) / 12.0).round() as usize + 1;
        let at = |k: usize| -> [f64; 2] {
            let share = k as f64 / parts as f64;
            std::array::from_fn(|c| from[c] + share * (to[c] - from[c]))
        };
        for k in (0..parts).step_by(2) {
            self.stroke(picture, at(k), at(k + 1), colour);
        }
    }
}

/// Corners of the box about its centre, turned where the rotation is observable; none if unknown.
fn box_corners(state: &TrackState) -> Vec<[f64; 2]> {
    let (bounds, [x, y]) = (state.bounds, state.bounds.centre());
    let angle = if state.rotation_observable && state.rotation.is_finite() { state.rotation } else { 0.0 };
    let (sin, cos) = angle.sin_cos();
    let (a, b) = (bounds.width / 2.0, bounds.height / 2.0);
    if !(a.abs() < LONGEST && b.abs() < LONGEST && x.is_finite() && y.is_finite()) {
        return Vec::new();
    }
    [[-a, -b], [a, -b], [a, b], [-a, b]].map(|[dx, dy]| [x + cos * dx - sin * dy, y + sin * dx + cos * dy]).to_vec()
}

/// The ellipse of 95 % about the position; its axes are those of the picture, since errors along x and y are
/// taken as independent. None where the variance is not known.
fn ellipse(state: &TrackState) -> Vec<[f64; 2]> {
    let radius = |axis: usize| (CHI_SQUARED_95 * state.covariance[axis][0][0]).sqrt();
    let (rx, ry, [x, y]) = (radius(0), radius(1), state.position);
    if !(rx < LONGEST && ry < LONGEST && x.is_finite() && y.is_finite()) {
        return Vec::new();
    }
    let angle = |k: usize| std::f64::consts::TAU * k as f64 / ELLIPSE_STROKES as f64;
    (0..ELLIPSE_STROKES).map(|k| [x + rx * angle(k).cos(), y + ry * angle(k).sin()]).collect()
}
