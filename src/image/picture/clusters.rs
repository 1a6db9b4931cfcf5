//! Numbered objects drawn over a view: their pixels in colours of their own, their numbers, their motions.

use super::{Arrow, Picture, Quiver, Rgb, draw::draw_number};

/// Hues of successive numbers are this share of the wheel apart (the golden section).
const APART: f64 = 0.618_033_988_749_895;

/// The colour that a number always has, neither dark nor pale.
pub fn identity_colour(number: u64) -> Rgb {
    let hue = 6.0 * (number as f64 * APART).fract();
    // Red, green and blue stand at 0, 2 and 4 sixths of the wheel.
    [0.0, 4.0, 2.0].map(|turn: f64| {
        let share = (((hue + turn) % 6.0 - 3.0).abs() - 1.0).clamp(0.0, 1.0);
        (255.0 * (0.15 + 0.8 * share)).round() as u8
    })
}

/// A numbered cluster as it is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClusterMark {
    /// Its number, which gives the colour.
    pub number: u64,
    /// Its middle `(x, y)`, px.
    pub centre: [f64; 2],
    /// Its motion, px/step; not drawn where it is not finite.
    pub motion: [f64; 2],
}

/// The picture of a view, darkened, with pixels `(x, y)` in the colour of the number that each has, enlarged
/// `factor` times; then every mark's number and, as an arrow that ends at the middle, the motion that led
/// there. Pixels beyond the picture are left out.
pub fn cluster_picture(
    view: &Picture,
    pixels: impl Iterator<Item = ([u32; 2], u64)>,
    marks: &[ClusterMark],
    factor: usize,
) -> Picture {
    let mut picture = Picture::from_fn(view.width(), view.height(), |x, y| view.pixel(x, y).map(|level| level / 2));
    for ([x, y], number) in pixels {
        picture.blend(x as isize, y as isize, identity_colour(number), 1.0);
    }
    let factor = factor.max(1);
    let mut picture = if factor > 1 { picture.enlarged(factor) } else { picture };
    let scale = factor as f64;
    let onto = |place: f64| (place + 0.5) * scale - 0.5;
    let arrows: Vec<Arrow> = marks
        .iter()
        .map(|ClusterMark { centre: [x, y], motion: [u, v], .. }| Arrow {
            x: onto(x - u),
            y: onto(y - v),
            u: u * scale,
            v: v * scale,
        })
        .collect();
    Quiver { colour: [255; 3], ..Quiver::new(Some(1.0)) }.draw(&mut picture, &arrows);
    for mark in marks {
        let (size, [x, y]) = (factor.clamp(1, 3), mark.centre.map(onto));
        let (left, bottom) = (x + 3.0, y - 1.0);
        for (dx, dy) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)] {
            draw_number(&mut picture, mark.number as usize, left + dx, bottom + dy, size, [20; 3]);
        }
        draw_number(&mut picture, mark.number as usize, left, bottom, size, [255; 3]);
    }
    picture
}
