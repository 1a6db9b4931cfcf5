//! The world that the camera looks at.

use super::sprite::{CAR_BODY, Hsv, SHIRT, SKIN, TROUSERS, blend};
use super::value_noise::value_noise;
use crate::math::random::CounterRng;
use crate::types::ColourFrame;

/// Width and height of the world at scale 1, px.
const WORLD_SIZE: (f64, f64) = (1300.0, 900.0);
/// Mean colour: grey-green.
const GROUND: [f64; 3] = [118.0, 122.0, 104.0];
/// Distances of the lattice points at scale 1, px, and their weights.
const OCTAVES: [(f64, f64); 5] = [(96.0, 0.30), (40.0, 0.25), (16.0, 0.25), (7.0, 0.25), (3.0, 0.2)];
/// The finest lattice, px: a finer one would be noise from pixel to pixel.
const FINEST_CELL: f64 = 1.5;
/// Grey levels that the noise of unit amplitude changes brightness by.
const BRIGHTNESS: f64 = 62.0;
/// Grey levels that the second noise of unit amplitude changes each channel by.
const TINT: [f64; 3] = [22.0, -4.4, -22.0];
/// Rectangles strewn over the world.
const RECTANGLES: u64 = 90;
/// Shortest and longest side of a rectangle at scale 1, px.
const SIDES: (f64, f64) = (18.0, 80.0);
/// Every so-manieth rectangle has a colour of a target, so that colour alone does not decide.
const LIKE_A_TARGET: u64 = 4;
/// Share of the texture that shows through a rectangle.
const THROUGH: f64 = 0.3;

/// A textured plane.
#[derive(Debug, Clone)]
pub(super) struct World {
    picture: ColourFrame<f64>,
}

impl World {
    /// The world of a seed, at a scale.
    pub(super) fn new(rng: CounterRng, scale: f64) -> Self {
        let (width, height) = ((WORLD_SIZE.0 * scale) as usize, (WORLD_SIZE.1 * scale) as usize);
        let octaves = OCTAVES.map(|(cell, amplitude)| ((cell * scale).max(FINEST_CELL), amplitude));
        let [light, tint] = [0, 1].map(|k| value_noise(rng.stream(k), (width, height), &octaves));
        let mut picture = ColourFrame::from_fn(width, height, |x, y| {
            std::array::from_fn(|c| GROUND[c] + BRIGHTNESS * light.get(x, y) + TINT[c] * tint.get(x, y))
        });
        for k in 0..RECTANGLES {
            draw_rectangle(&mut picture, rng.stream(2 + k), k, scale);
        }
        Self { picture: picture.map(|pixel| pixel.map(|level| level.clamp(0.0, 255.0))) }
    }

    /// The colour at a point relative to the world's centre, px: bilinear, replicated at the border.
    pub(super) fn colour(&self, x: f64, y: f64) -> [f64; 3] {
        let (width, height) = self.picture.size();
        let place = |value: f64, length: usize| {
            let value = (value + length as f64 / 2.0).clamp(0.0, (length - 1) as f64);
            let low = (value as usize).min(length - 2);
            (low, value - low as f64)
        };
        let ((left, right_share), (top, lower_share)) = (place(x, width), place(y, height));
        let row = |y: usize| blend(self.picture.get(left, y), self.picture.get(left + 1, y), right_share);
        blend(row(top), row(top + 1), lower_share)
    }
}

/// Draws the k-th rectangle: in a colour of a target or a muted one.
fn draw_rectangle(picture: &mut ColourFrame<f64>, rng: CounterRng, k: u64, scale: f64) {
    let side = |index| scale * (SIDES.0 + (SIDES.1 - SIDES.0) * rng.uniform(index));
    let (width, height) = (side(0), side(1));
    let range = |index, length: usize, side: f64| {
        let start = rng.uniform(index) * (length as f64 - side);
        start as usize..((start + side) as usize).min(length)
    };
    let (columns, rows) = (range(2, picture.width(), width), range(3, picture.height(), height));
    let colour = if k.is_multiple_of(LIKE_A_TARGET) {
        [SHIRT, TROUSERS, CAR_BODY, SKIN][(k / LIKE_A_TARGET % 4) as usize]
    } else {
        Hsv(rng.uniform(4), 0.1 + 0.4 * rng.uniform(5), 0.3 + 0.6 * rng.uniform(6))
    }
    .to_rgb();
    for row in rows {
        for pixel in &mut picture.row_mut(row)[columns.clone()] {
            *pixel = std::array::from_fn(|c| colour[c] + THROUGH * (pixel[c] - GROUND[c]));
        }
    }
}
