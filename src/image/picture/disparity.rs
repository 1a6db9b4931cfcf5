//! Disparities of single pixels drawn over a view.

use super::{Picture, Rgb};
use crate::types::Frame;

/// Draws every pixel that has a disparity over the darkened picture of its view: blue at the lower end of
/// `range` (far), over green and yellow to red at the upper (near).
///
/// Pixels of the map beyond the picture are left out. What lies outside the range has the colour of its end.
pub fn draw_disparity(picture: &mut Picture, disparity: &Frame<f32>, (far, near): (f64, f64)) {
    let span = if near > far { near - far } else { 1.0 };
    for y in 0..disparity.height() {
        for (x, &value) in disparity.row(y).iter().enumerate() {
            let at = (x as isize, y as isize);
            if value.is_finite() {
                picture.blend(at.0, at.1, nearness_colour((f64::from(value) - far) / span), 1.0);
            } else {
                picture.blend(at.0, at.1, [0; 3], 0.5);
            }
        }
    }
}

/// Hue from blue (0) to red (1), full saturation.
fn nearness_colour(nearness: f64) -> Rgb {
    let hue = 4.0 * (1.0 - nearness.clamp(0.0, 1.0));
    // Red, green and blue stand at 0, 2 and 4 sixths of the circle of hues.
    [0.0, 2.0, 4.0].map(|centre: f64| (255.0 * (2.0 - (hue - centre).abs()).clamp(0.0, 1.0)).round() as u8)
}
