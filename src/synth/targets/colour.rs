//! Colours of the targets' parts.

/// Hue (0 to 1, a turn), saturation (0 to 1) and value (0 to 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hsv(pub f64, pub f64, pub f64);

/// A red shirt.
pub(super) const SHIRT: Hsv = Hsv(0.02, 0.75, 0.75);
/// Blue trousers.
pub(super) const TROUSERS: Hsv = Hsv(0.61, 0.55, 0.45);
/// Skin.
pub(super) const SKIN: Hsv = Hsv(0.06, 0.40, 0.85);
/// Dark hair.
pub(super) const HAIR: Hsv = Hsv(0.08, 0.45, 0.18);
/// An orange car.
pub(super) const CAR_BODY: Hsv = Hsv(0.10, 0.85, 0.85);
/// Its windows.
pub(super) const WINDOW: Hsv = Hsv(0.55, 0.30, 0.35);
/// Its wheels.
pub(super) const WHEEL: Hsv = Hsv(0.0, 0.02, 0.12);

impl Hsv {
    /// Red, green and blue, 0 to 255 (A. R. Smith, "Color gamut transform pairs", 1978).
    pub(super) fn to_rgb(self) -> [f64; 3] {
        let Self(hue, saturation, value) = self;
        // Each channel falls to `value (1 - saturation)` over the two sixths of a turn next to its own third.
        [5.0, 3.0, 1.0].map(|offset| {
            let sector = (offset + 6.0 * hue).rem_euclid(6.0);
            let fall = sector.min(4.0 - sector).clamp(0.0, 1.0);
            255.0 * value * (1.0 - saturation * fall)
        })
    }
}

/// The colour at `share` of the way from one to another.
pub(super) fn blend(from: [f64; 3], to: [f64; 3], share: f64) -> [f64; 3] {
    std::array::from_fn(|c| from[c] + share * (to[c] - from[c]))
}
