//! Colour to grey.

use jacoflow::image::luminance;
use proptest::prelude::*;

#[test]
fn known_colours_have_the_standard_luma() {
    let rgb = [255u8, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
    assert_eq!(luminance(4, 1, 3, &rgb).unwrap().data(), &[76, 150, 29, 255]);
    assert_eq!(luminance(1, 1, 4, &[0u16, 65535, 0, 7]).unwrap().data(), &[38469]);
    assert_eq!(luminance(2, 1, 2, &[0.25f32, 0.0, 0.5, 1.0]).unwrap().data(), &[0.25, 0.5]);
}

#[test]
fn wrong_shapes_are_refused_by_name() {
    assert!(luminance(1, 1, 5, &[0u8; 5]).unwrap_err().to_string().starts_with("channels"));
    assert!(luminance(2, 1, 3, &[0u8; 5]).unwrap_err().to_string().starts_with("data"));
    assert!(luminance(usize::MAX, 2, 3, &[0u8; 6]).is_err());
}

proptest! {
    #[test]
    fn grey_colours_keep_their_level(level: u16) {
        prop_assert_eq!(luminance(1, 1, 3, &[level; 3]).unwrap().data()[0], level);
        prop_assert_eq!(luminance(1, 1, 4, &[level; 4]).unwrap().data()[0], level);
    }
}
