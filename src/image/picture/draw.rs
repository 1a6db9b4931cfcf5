//! Numbers and anti-aliased strokes, drawn into a picture.

use super::{Picture, Rgb};

/// The digits 0 to 9 in 3 x 5 dots: rows from the top, the left dot in the highest of three bits.
const DOTS: [[u8; 5]; 10] = [
    [7, 5, 5, 5, 7],
    [2, 6, 2, 2, 7],
    [7, 1, 7, 4, 7],
    [7, 1, 7, 1, 7],
    [5, 5, 7, 1, 1],
    [7, 4, 7, 1, 7],
    [7, 4, 7, 5, 7],
    [7, 1, 2, 2, 2],
    [7, 5, 7, 5, 7],
    [7, 5, 7, 1, 7],
];

/// Writes `number`, ending 2 dots above `(left, bottom)`, in dots of `size x size` px.
pub(super) fn draw_number(picture: &mut Picture, number: usize, left: f64, bottom: f64, size: usize, colour: Rgb) {
    if !(left.is_finite() && bottom.is_finite()) {
        return;
    }
    let size = size as isize;
    let (left, top) = (left.round() as isize, (bottom.round() as isize).saturating_sub(7 * size));
    for (place, digit) in number.to_string().bytes().enumerate() {
        let first = left.saturating_add(4 * size * place as isize);
        for (row, bits) in DOTS[usize::from(digit - b'0')].into_iter().enumerate() {
            for column in (0..3).filter(|column| bits & (4 >> column) != 0) {
                dot(
                    picture,
                    first.saturating_add(column * size),
                    top.saturating_add(row as isize * size),
                    size,
                    colour,
                );
            }
        }
    }
}

fn dot(picture: &mut Picture, x: isize, y: isize, size: isize, colour: Rgb) {
    for dy in 0..size {
        for dx in 0..size {
            picture.blend(x.saturating_add(dx), y.saturating_add(dy), colour, 1.0);
        }
    }
}

/// Draws a straight stroke `thickness` px wide with round ends, covering pixels partly at its edge.
pub(super) fn draw_stroke(picture: &mut Picture, from: (f64, f64), to: (f64, f64), thickness: f64, colour: Rgb) {
    if ![from.0, from.1, to.0, to.1].iter().all(|c| c.is_finite()) {
        return;
    }
    let reach = thickness / 2.0 + 1.0;
    let columns = clipped(from.0.min(to.0) - reach, from.0.max(to.0) + reach, picture.width());
    for y in clipped(from.1.min(to.1) - reach, from.1.max(to.1) + reach, picture.height()) {
        for x in columns.clone() {
            let distance = distance_to_segment((x as f64, y as f64), from, to);
            let coverage = (thickness / 2.0 + 0.5 - distance).clamp(0.0, 1.0);
            if coverage > 0.0 {
                picture.blend(x as isize, y as isize, colour, coverage);
            }
        }
    }
}

/// The pixels from `low` to `high` that exist.
fn clipped(low: f64, high: f64, len: usize) -> std::ops::Range<usize> {
    let low = low.floor().max(0.0) as usize;
    low..(high.ceil().max(-1.0) + 1.0).min(len as f64) as usize
}

fn distance_to_segment(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (px, py) = (point.0 - from.0, point.1 - from.1);
    let length2 = dx * dx + dy * dy;
    let along = if length2 > 0.0 { ((px * dx + py * dy) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (px - along * dx).hypot(py - along * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(number: usize) -> Vec<String> {
        let mut picture = Picture::filled(7, 7, [0; 3]);
        draw_number(&mut picture, number, 0.0, 7.0, 1, [255; 3]);
        let ink = |x, y| if picture.pixel(x, y)[0] > 0 { '#' } else { '.' };
        (0..5).map(|y| (0..7).map(|x| ink(x, y)).collect()).collect()
    }

    #[test]
    fn digits_can_be_read() {
        assert_eq!(shape(14), [".#..#.#", "##..#.#", ".#..###", ".#....#", "###...#"]);
        assert_eq!(shape(7), ["###....", "..#....", ".#.....", ".#.....", ".#....."]);
    }
}
