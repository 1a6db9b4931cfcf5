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

    /// Combines the frames in a rectangle that may reach over their edges, where the result is zero.
    ///
    /// The rectangle has its corner at column `x`, row `y` and rows of `width` samples; `out` holds the three
    /// images one after the other.
    #[inline(always)]
    pub fn apply<T: SimdReal>(
        self,
        frames: &[&Frame<T>],
        (x, y): (isize, isize),
        width: usize,
        second: bool,
        out: [&mut [T]; 3],
    ) {
        let (w, h) = frames[0].size();
        let from = (-x).clamp(0, width as isize) as usize;
        let to = (w as isize - x).clamp(from as isize, width as isize) as usize;
        let [coefficient, first, other] = out;
        let rows = coefficient.chunks_exact_mut(width).zip(first.chunks_exact_mut(width));
        for (r, ((c, f), s)) in rows.zip(other.chunks_exact_mut(width)).enumerate() {
            let at = y + r as isize;
            if at < 0 || at >= h as isize || from == to {
                c.fill(T::default());
                f.fill(T::default());
                s.fill(T::default());
                continue;
            }
            for row in [&mut *c, &mut *f, &mut *s] {
                row[..from].fill(T::default());
                row[to..].fill(T::default());
            }
            let start = (x + from as isize) as usize;
            let source = |k: usize| &frames[k].row(at as usize)[start..start + to - from];
            let (c, f, s) = (&mut c[from..to], &mut f[from..to], &mut s[from..to]);
            let half = T::from_f64(0.5);
            match self {
                Self::Pair => {
                    let (a, b) = (source(0), source(1));
                    for i in 0..c.len() {
                        c[i] = half * (a[i] + b[i]);
                        f[i] = b[i] - a[i];
                    }
                }
                Self::Triple(scheme) => {
                    let (old, middle, new) = (source(0), source(1), source(2));
                    match scheme {
                        TimeScheme::Central => {
                            c.copy_from_slice(middle);
                            for i in 0..f.len() {
                                f[i] = half * (new[i] - old[i]);
                            }
                        }
                        TimeScheme::Backward => {
                            c.copy_from_slice(new);
                            for i in 0..f.len() {
                                f[i] = new[i] - middle[i];
                            }
                        }
                    }
                    if second {
                        for i in 0..s.len() {
                            s[i] = (new[i] - middle[i]) - (middle[i] - old[i]);
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_follow_their_weights_and_are_zero_outside() {
        let frames: Vec<Frame<f64>> =
            (0..3).map(|k| Frame::from_fn(4, 3, |x, y| ((5 * k + 3 * x + 7 * y) as f64).sin())).collect();
        for (n, scheme) in [(2, TimeScheme::Central), (3, TimeScheme::Central), (3, TimeScheme::Backward)] {
            let refs: Vec<&Frame<f64>> = frames.iter().take(n).collect();
            let combination = Combination::of(n, scheme);
            let mut out = vec![9.0; 3 * 35];
            let (a, rest) = out.split_at_mut(35);
            let (b, c) = rest.split_at_mut(35);
            combination.apply(&refs, (-2, -1), 7, n == 3, [a, b, c]);
            for k in 0..if n == 3 { 3 } else { 2 } {
                for y in 0..5 {
                    for x in 0..7 {
                        let inside = (2..6).contains(&x) && (1..4).contains(&y);
                        let want: f64 = if inside {
                            (0..n).map(|f| combination.weights()[k][f] * frames[f].get(x - 2, y - 1)).sum()
                        } else {
                            0.0
                        };
                        assert!((out[k * 35 + y * 7 + x] - want).abs() < 1e-14);
                    }
                }
            }
        }
    }
}
