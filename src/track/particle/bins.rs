//! Colour bins: hue and saturation jointly, and value where there is no hue.

use crate::parallel::for_each_band;
use crate::types::{ColourFrame, Frame};

/// Bins of hue, of saturation and of value.
const STEPS: usize = 10;
/// Bins of hue and saturation.
const CHROMATIC: usize = STEPS * STEPS;
/// All bins: those of value follow those of hue and saturation.
pub(super) const BINS: usize = CHROMATIC + STEPS;
/// The bin of pixels that are not finite: they are not counted.
pub(super) const NO_BIN: u8 = u8::MAX;
/// Below this saturation a pixel has no hue.
const MIN_SATURATION: f32 = 0.1;
/// Below this value a pixel has no hue, grey levels (0.2 of white).
const MIN_VALUE: f32 = 51.0;
/// White, grey levels.
const WHITE: f32 = 255.0;

/// The bin of each pixel of a frame in grey levels 0 to 255. `values`: pixels without hue have bins of value.
///
/// `floor(10 hue) 10 + floor(10 saturation)`, each at most 9, with hue 0 for grey and saturation 0 for black.
pub(super) fn colour_bins(frame: &ColourFrame<f32>, values: bool) -> Frame<u8> {
    let (width, height) = frame.size();
    let mut bins = Frame::filled(width, height, 0u8);
    for_each_band(bins.data_mut(), width, |_, rows, out| {
        let pixels = &frame.data()[rows.start * width..rows.end * width];
        for (bin, &pixel) in out.iter_mut().zip(pixels) {
            *bin = bin_of(pixel, values);
        }
    });
    bins
}

#[inline]
fn bin_of([r, g, b]: [f32; 3], values: bool) -> u8 {
    let max = r.max(g).max(b);
    let chroma = max - r.min(g).min(b);
    if !(r + g + b).is_finite() {
        return NO_BIN;
    }
    if values && (chroma < MIN_SATURATION * max || max < MIN_VALUE) {
        return CHROMATIC as u8 + step(max / WHITE);
    }
    if chroma <= 0.0 || max <= 0.0 {
        return 0;
    }
    // Sixths of the circle, from red over green to blue.
    let sector = if max == r {
        let sixth = (g - b) / chroma;
        if sixth < 0.0 { sixth + 6.0 } else { sixth }
    } else if max == g {
        (b - r) / chroma + 2.0
    } else {
        (r - g) / chroma + 4.0
    };
    step(sector / 6.0) * STEPS as u8 + step(chroma / max)
}

/// Which tenth of 0..1 a share is in.
#[inline]
fn step(share: f32) -> u8 {
    ((share * STEPS as f32) as u8).min(STEPS as u8 - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hue_saturation_and_value_have_their_bins() {
        for (pixel, values, bin) in [
            ([255.0, 0.0, 0.0], true, 9),
            ([0.0, 255.0, 0.0], true, 39),
            ([0.0, 0.0, 255.0], true, 69),
            ([255.0, 0.0, 128.0], false, 99),
            ([200.0, 150.0, 100.0], false, 5),
            ([100.0, 100.0, 100.0], false, 0),
            ([100.0, 100.0, 100.0], true, 103),
            ([255.0, 255.0, 255.0], true, 109),
            ([0.0, 0.0, 0.0], false, 0),
            ([0.0, 0.0, 40.0], true, 101),
            ([0.0, 0.0, 40.0], false, 69),
            ([f32::NAN, 0.0, 0.0], false, NO_BIN),
        ] {
            assert_eq!(bin_of(pixel, values), bin, "{pixel:?} {values}");
        }
    }
}
