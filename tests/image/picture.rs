//! Pictures of results: flow as colours or arrows, divergence and curl as a diverging map, frames as grey,

use jacoflow::image::picture::Picture;

#[test]
fn blending_mixes_and_ignores_the_outside() {
    let mut picture = Picture::filled(3, 2, [0, 100, 200]);
    picture.blend(1, 1, [100, 100, 0], 0.5);
    assert_eq!(picture.pixel(1, 1), [50, 100, 100]);
    for (x, y) in [(-1, 0), (0, -1), (3, 0), (0, 2)] {
        picture.blend(x, y, [255; 3], 1.0);
    }
    assert!(!picture.data().contains(&255));
}

#[test]
fn enlarging_repeats_pixels() {
    let picture = Picture::from_fn(2, 1, |x, _| [x as u8; 3]).enlarged(3);
    assert_eq!((picture.width(), picture.height()), (6, 3));
    assert_eq!((picture.pixel(2, 2), picture.pixel(3, 0)), ([0; 3], [1; 3]));
}
