//! What comes near, over a frame: points coloured by rate of approach, and the focus of expansion.

use super::{Picture, Rgb, diverging::SignedMap, diverging::symmetric_range};

/// A point and how fast it comes nearer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactMark {
    /// Where, px.
    pub at: [f64; 2],
    /// `nu u_z`, 1/frame: negative where it comes nearer.
    pub rate: f64,
}

/// How much of the frame the colours hide.
const COVERAGE: f64 = 0.55;

/// Percentile of the rates that has the strongest colour.
const STRONGEST: f64 = 95.0;

/// The focus of expansion's colour, half of its cross, px, and the strokes of its ellipse.
const FOCUS: Rgb = [255, 220, 0];
const CROSS: isize = 9;
const STROKES: usize = 720;

/// Largest half axis of an ellipse that is drawn, px.
const LARGEST: f64 = 4000.0;

/// Draws squares of half size `half` px, red where a point comes nearer and blue where it recedes, and the
/// focus of expansion as a cross with its 95 % ellipse from `(place, covariance)`.
pub fn draw_contacts(
    picture: &mut Picture,
    marks: &[ContactMark],
    half: f64,
    focus: Option<([f64; 2], [[f64; 2]; 2])>,
) {
    let rates: Vec<f64> = marks.iter().map(|mark| -mark.rate).collect();
    let map = SignedMap::new(Some(symmetric_range(&rates, STRONGEST)));
    let half = half.max(1.0);
    for (mark, &rate) in marks.iter().zip(&rates) {
        let Some(colour) = map.colour_of(rate) else { continue };
        let range = |c: f64| (c - half).ceil() as isize..(c + half).ceil() as isize;
        for y in range(mark.at[1]) {
            for x in range(mark.at[0]) {
                picture.blend(x, y, colour, COVERAGE);
            }
        }
    }
    if let Some((at, covariance)) = focus.filter(|(at, _)| at.iter().all(|c| c.is_finite() && c.abs() < 1e6)) {
        draw_focus(picture, at, &covariance);
    }
}

fn draw_focus(picture: &mut Picture, at: [f64; 2], covariance: &[[f64; 2]; 2]) {
    let (cx, cy) = (at[0].round() as isize, at[1].round() as isize);
    for d in -CROSS..=CROSS {
        picture.blend(cx + d, cy, FOCUS, 1.0);
        picture.blend(cx, cy + d, FOCUS, 1.0);
    }
    // The lower factor turns a circle into the ellipse; 5.99 is chi-squared's 95 % for two numbers.
    let first = covariance[0][0].sqrt();
    let second = covariance[0][1] / first;
    let third = (covariance[1][1] - second * second).max(0.0).sqrt();
    let scale = 5.991_464_547_107_979f64.sqrt();
    if !(first > 0.0 && first.is_finite() && scale * first.max(third) < LARGEST) {
        return;
    }
    for k in 0..STROKES {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / STROKES as f64).sin_cos();
        let x = at[0] + scale * first * cos;
        let y = at[1] + scale * (second * cos + third * sin);
        picture.blend(x.round() as isize, y.round() as isize, FOCUS, 1.0);
    }
}
