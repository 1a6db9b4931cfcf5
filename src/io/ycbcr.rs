//! Red, green and blue to luma and chroma and back, by the matrix of ITU-R BT.601.
//!
//! With components in 0..1: `Y = 0.299 R + 0.587 G + 0.114 B`, `Cb = (B - Y) / 1.772`, `Cr = (R - Y) /
//! 1.402`, so that chroma lies in -0.5..0.5 (ITU-R BT.601-7, 2011, section 2.5.1; JFIF 1.02 uses the same).

/// Weights of red, green and blue in luma.
const LUMA: [f64; 3] = [0.299, 0.587, 0.114];
/// Range of `B - Y` and of `R - Y` for components in 0..1: `2 (1 - weight)`.
const CHROMA_RANGE: [f64; 2] = [1.772, 1.402];

/// `[Y, Cb, Cr]` of `[R, G, B]`.
fn from_rgb([r, g, b]: [f64; 3]) -> [f64; 3] {
    let y = LUMA[0] * r + LUMA[1] * g + LUMA[2] * b;
    [y, (b - y) / CHROMA_RANGE[0], (r - y) / CHROMA_RANGE[1]]
}

/// `[R, G, B]` of `[Y, Cb, Cr]`.
fn to_rgb([y, cb, cr]: [f64; 3]) -> [f64; 3] {
    let (r, b) = (y + CHROMA_RANGE[1] * cr, y + CHROMA_RANGE[0] * cb);
    [r, (y - LUMA[0] * r - LUMA[2] * b) / LUMA[1], b]
}

/// Code values of luma and chroma: how many bits, and which of the codes stand for black and white.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Coding {
    bits: u32,
    full_range: bool,
}

impl Coding {
    /// Codes of `bits` bits. Full range uses all for 0..1; limited range 16..235 (luma) and 16..240 (chroma),
    /// times `2^(bits - 8)`.
    pub(crate) fn new(bits: u32, full_range: bool) -> Self {
        Self { bits, full_range }
    }

    fn top(self) -> f64 {
        f64::from((1_u32 << self.bits) - 1)
    }

    /// Offset and scale of luma, then of chroma: `code = offset + scale * value`.
    fn lines(self) -> [(f64, f64); 2] {
        let unit = f64::from(1_u32 << (self.bits - 8));
        if self.full_range {
            [(0.0, self.top()), (128.0 * unit, self.top())]
        } else {
            [(16.0 * unit, 219.0 * unit), (128.0 * unit, 224.0 * unit)]
        }
    }

    /// Codes of `[R, G, B]` in 0..1, rounded to the nearest.
    pub(crate) fn encode(self, rgb: [f64; 3]) -> [u16; 3] {
        let [luma, chroma] = self.lines();
        let [y, cb, cr] = from_rgb(rgb);
        [(y, luma), (cb, chroma), (cr, chroma)]
            .map(|(value, (offset, scale))| (offset + scale * value).round().clamp(0.0, self.top()) as u16)
    }

    /// `[R, G, B]` in 0..1 (beyond it for codes that no colour has).
    pub(crate) fn decode(self, codes: [u16; 3]) -> [f64; 3] {
        let [luma, chroma] = self.lines();
        let value = |code: u16, (offset, scale): (f64, f64)| (f64::from(code) - offset) / scale;
        to_rgb([value(codes[0], luma), value(codes[1], chroma), value(codes[2], chroma)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn limited_range_has_the_levels_of_the_standard() {
        // Colour bars of 100 %, ITU-R BT.601-7: white, yellow, cyan, green, magenta, red, blue, black.
        for (rgb, codes) in [
            ([1.0, 1.0, 1.0], [235, 128, 128]),
            ([1.0, 1.0, 0.0], [210, 16, 146]),
            ([0.0, 1.0, 1.0], [170, 166, 16]),
            ([0.0, 1.0, 0.0], [145, 54, 34]),
            ([1.0, 0.0, 1.0], [106, 202, 222]),
            ([1.0, 0.0, 0.0], [81, 90, 240]),
            ([0.0, 0.0, 1.0], [41, 240, 110]),
            ([0.0, 0.0, 0.0], [16, 128, 128]),
        ] {
            assert_eq!(Coding::new(8, false).encode(rgb), codes, "{rgb:?}");
            let deep = Coding::new(10, false).decode(codes.map(|code| 4 * code));
            assert!(deep.iter().zip(rgb).all(|(got, want)| (got - want).abs() < 0.006), "{rgb:?}: {deep:?}");
        }
    }

    proptest! {
        /// Rounding of luma and chroma moves a component by at most `(1 + 1.772) / 2` codes.
        #[test]
        fn colours_survive_within_their_rounding(rgb: [u16; 3], bits in 8_u32..=16, full_range: bool) {
            let coding = Coding::new(bits, full_range);
            let want = rgb.map(|v| f64::from(v) / 65535.0);
            let back = coding.decode(coding.encode(want));
            let step = 1.0 / coding.lines()[0].1;
            for (got, want) in back.iter().zip(want) {
                prop_assert!((got - want).abs() <= 1.4 * step, "{got} {want}");
            }
        }
    }
}
