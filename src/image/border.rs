//! What lies beyond the edge of an image.

/// How an image continues beyond its edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Border {
    /// Mirrored about the last pixel's side: `d c b a | a b c d | d c b a` (scipy's `reflect`).
    #[default]
    Reflect,
    /// The last pixel repeated: `a a a a | a b c d | d d d d` (scipy's `nearest`).
    Replicate,
    /// Periodic: `a b c d | a b c d | a b c d` (scipy's `wrap`).
    Wrap,
}

impl Border {
    /// The sample inside `0..len` that stands for position `index`, however far outside it is.
    ///
    /// `len` must not be 0.
    #[inline]
    pub fn index(self, index: isize, len: usize) -> usize {
        let n = len as isize;
        if (0..n).contains(&index) {
            return index as usize;
        }
        let inside = match self {
            Self::Replicate => index.clamp(0, n - 1),
            Self::Wrap => index.rem_euclid(n),
            Self::Reflect => {
                let folded = index.rem_euclid(2 * n);
                if folded < n { folded } else { 2 * n - 1 - folded }
            }
        };
        inside as usize
    }
}
