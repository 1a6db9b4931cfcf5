//! The three images that equations are made of: coefficients, first and second time difference.
//!
//! Jets are linear in the image, so `i`, `i'` and `i''` are the jets of these combinations of the frames.

use crate::jet::TimeScheme;
use crate::simd::SimdReal;
use crate::types::Frame;

/// How frames are combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Combination {
    /// Two frames: their mean and their difference; no second difference.
    Pair,
    /// Three frames in one of the two schemes.
    Triple(TimeScheme),
}

impl Combination {
    /// For this many frames (2 or 3).
    pub fn of(frames: usize, scheme: TimeScheme) -> Self {
        if frames == 2 { Self::Pair } else { Self::Triple(scheme) }
    }

    /// `[i, i', i'']` as weights of the frames, oldest first.
    pub fn weights(self) -> [[f64; 3]; 3] {
        let second = [1.0, -2.0, 1.0];
        match self {
            Self::Pair => [[0.5, 0.5, 0.0], [-1.0, 1.0, 0.0], [0.0; 3]],
            Self::Triple(TimeScheme::Central) => [[0.0, 1.0, 0.0], [-0.5, 0.0, 0.5], second],
            Self::Triple(TimeScheme::Backward) => [[0.0, 0.0, 1.0], [0.0, -1.0, 1.0], second],
        }
    }

    /// Times of the frames, in frames from the moment of the estimate.
    pub fn times(self) -> &'static [f64] {
        match self {
            Self::Pair => &[-0.5, 0.5],
            Self::Triple(TimeScheme::Central) => &[-1.0, 0.0, 1.0],
            Self::Triple(TimeScheme::Backward) => &[-2.0, -1.0, 0.0],
        }
    }

    /// Combines the frames in a rectangle that may reach over their edges, where the result is zero.
    ///
    /// Its corner is at column `x`, row `y`, its rows have `width` samples; `out` yields two images or three.
    pub fn apply<T: SimdReal>(
        self,
        frames: &[&Frame<T>],
        (x, y): (isize, isize),
        width: usize,
        out: std::slice::ChunksExactMut<'_, T>,
    ) {
        let (w, h) = frames[0].size();
        let from = (-x).clamp(0, width as isize) as usize;
        let to = (w as isize - x).clamp(from as isize, width as isize) as usize;
        for (image, weights) in out.zip(self.weights()) {
            image.fill(T::default());
            for (r, row) in image.chunks_exact_mut(width).enumerate() {
                let at = y + r as isize;
                if at < 0 || at >= h as isize || from == to {
                    continue;
                }
                let start = (x + from as isize) as usize;
                for (frame, weight) in frames.iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
                    let weight = T::from_f64(weight);
                    let source = &frame.row(at as usize)[start..start + to - from];
                    row[from..to].iter_mut().zip(source).for_each(|(sum, value)| *sum += weight * *value);
                }
            }
        }
    }
}
