//! The background layer under a camera that moves: shifted with the scene.

use super::layers::Background;
use crate::track::gradient::shift::shifted_into;
use crate::types::Frame;
use std::ops::Range;

struct Sources {
    to: Range<usize>,
    /// How much farther on the nearest pixel is that each comes from.
    by: isize,
}

fn sources(length: usize, back: f64) -> Sources {
    let inside = |at: &usize| (0.0..=length as f64 - 1.0).contains(&(*at as f64 + back));
    let first = (0..length).find(inside).unwrap_or(length);
    let end = (first..length).rev().find(inside).map_or(first, |last| last + 1);
    Sources { to: first..end, by: (back + 0.5).floor() as isize }
}

impl Sources {
    fn from(&self) -> Range<usize> {
        let on = |at: usize| (at as isize + self.by) as usize;
        on(self.to.start)..on(self.to.end)
    }

    fn of(&self, at: usize) -> Option<usize> {
        self.to.contains(&at).then(|| (at as isize + self.by) as usize)
    }
}

impl Background {
    /// Moves the scene by some px; pixels that come into view are stored, but do not count as known.
    pub(super) fn moved(&mut self, by: [f64; 2], frame: &Frame<f64>) {
        let back = by.map(|b| -b);
        let (width, height) = self.known.size();
        let picture = shifted_into(std::mem::take(&mut self.spare), &self.picture, back);
        let picture = Frame::new(width, height, picture).unwrap_or_default();
        self.spare = std::mem::replace(&mut self.picture, picture).into_data();
        // Pixels come from the nearest to where they were, if that is in the picture.
        let [columns, rows] = [(width, back[0]), (height, back[1])].map(|(length, back)| sources(length, back));
        let mut known = Frame::filled(width, height, false);
        for y in 0..height {
            if let Some(row) = rows.of(y).map(|j| self.known.row(j)) {
                known.row_mut(y)[columns.to.clone()].copy_from_slice(&row[columns.from()]);
            }
            let pixels = known.row_mut(y).iter_mut().zip(self.picture.row_mut(y)).zip(frame.row(y));
            for ((known, value), seen) in pixels.filter(|((_, value), _)| !value.is_finite()) {
                (*known, *value) = (false, *seen);
            }
        }
        self.known = known;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_of_a_shifted_row_come_from_the_nearest_that_there_are() {
        for back in [0.0, 0.3, 0.5, 0.7, 2.0, 2.6, -0.4, -0.5, -3.0, -3.2, 9.0, 12.0, -12.0] {
            let found = sources(10, back);
            for at in 0..10 {
                let place = at as f64 + back;
                let want = (0.0..=9.0).contains(&place).then(|| (place + 0.5).floor() as usize);
                assert_eq!(found.of(at), want, "{at} {back}");
            }
            assert!(found.to.is_empty() || found.from().end <= 10, "{back}");
        }
    }
}
