//! From a scene to its frames.

use super::{list::Pillar, scene::TargetScene, sprite::Drawing, sprite::blend};
use crate::parallel::for_each_band;
use crate::types::ColourFrame;
use std::ops::Range;

/// Mean colour of the post.
const POST: [f64; 3] = [96.0, 92.0, 88.0];
/// Waves of brightness on the post, along it and across: grey levels, and px per radian at scale 1.
const POST_WAVES: [(f64, f64); 2] = [(14.0, 9.0), (12.0, 5.0)];

impl TargetScene {
    /// A frame as the camera delivers it.
    pub fn frame(&self, frame: usize) -> ColourFrame<u8> {
        self.frame_with(frame, |_| true)
    }

    /// As [`TargetScene::frame`], with only those targets that `drawn` says; noise is the same.
    pub fn frame_with(&self, frame: usize, drawn: impl Fn(usize) -> bool) -> ColourFrame<u8> {
        let (width, height) = self.size();
        let visible = self.drawing_order().iter().filter(|&&target| drawn(target));
        let drawings: Vec<Drawing<'_>> =
            visible.map(|&target| self.sprite().drawing(self.stance(frame, target))).collect();
        let mut picture = ColourFrame::filled(width, height, [0u8; 3]);
        for_each_band(picture.data_mut(), width, |_, rows, band| {
            for (line, row) in band.chunks_mut(width).zip(rows) {
                let mut colours: Vec<[f64; 3]> =
                    (0..width).map(|column| self.world_colour(frame, column, row)).collect();
                for drawing in &drawings {
                    draw_row(drawing, row, &mut colours);
                }
                self.finish_row(frame, row, &mut colours);
                for (pixel, colour) in line.iter_mut().zip(&colours) {
                    *pixel = colour.map(|level| level.round_ties_even().clamp(0.0, 255.0) as u8);
                }
            }
        });
        picture
    }

    /// The world's colour at a pixel.
    fn world_colour(&self, frame: usize, column: usize, row: usize) -> [f64; 3] {
        let [x, y] = self.world_place(frame, [column as f64, row as f64]);
        self.world.colour(x, y)
    }

    /// The post, the colour cast and the noise over a row.
    fn finish_row(&self, frame: usize, row: usize, colours: &mut [[f64; 3]]) {
        if let Some(pillar) = &self.kind.pillar {
            for (column, colour) in colours.iter_mut().enumerate() {
                draw_pillar(pillar, self.world_place(frame, [column as f64, row as f64]), self.options.scale, colour);
            }
        }
        let last = (self.frame_count() - 1).max(1) as f64;
        let cast = self.options.colour_cast * frame as f64 / last;
        let gains = [1.0 - cast, 1.0, 1.0 + 0.5 * cast];
        let (noise, rng) = (self.options.noise, self.noise_of(frame));
        let start = 3 * (row * colours.len()) as u64;
        for (index, level) in colours.as_flattened_mut().iter_mut().enumerate() {
            *level *= gains[index % 3];
            if noise > 0.0 {
                *level += noise * rng.normal(start + index as u64);
            }
        }
    }
}

/// Draws what of a target is in a row.
fn draw_row(drawing: &Drawing<'_>, row: usize, colours: &mut [[f64; 3]]) {
    let ([x, y], reach) = (drawing.centre(), drawing.reach());
    if (row as f64 - y).abs() > reach {
        return;
    }
    let inside = |value: f64| (value.max(0.0) as usize).min(colours.len());
    let columns: Range<usize> = inside((x - reach).ceil())..inside((x + reach).floor() + 1.0);
    for column in columns {
        drawing.draw([column as f64, row as f64], &mut colours[column]);
    }
}

/// Draws the post over a pixel that shows a world point.
fn draw_pillar(pillar: &Pillar, [x, y]: [f64; 2], scale: f64, colour: &mut [f64; 3]) {
    let distance = (x - pillar.x * scale).abs() - pillar.width * scale / 2.0;
    let coverage = (0.5 - distance).clamp(0.0, 1.0);
    if coverage > 0.0 {
        let [along, across] = POST_WAVES;
        let wave = |(levels, length): (f64, f64), way: f64| levels * (way / (length * scale)).sin();
        let light = wave(along, y) + wave(across, x);
        *colour = blend(*colour, POST.map(|level| level + light), coverage);
    }
}
