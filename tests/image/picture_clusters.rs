//! Numbered objects drawn over a view: their pixels in colours of their own, their numbers, their motions.

use jacoflow::image::picture::{ClusterMark, Picture, Rgb, cluster_picture, identity_colour};

#[test]
fn numbers_have_colours_that_differ() {
    let colours: Vec<Rgb> = (0..16).map(identity_colour).collect();
    let apart = |a: Rgb, b: Rgb| (0..3).map(|c| u32::from(a[c].abs_diff(b[c]))).sum::<u32>();
    for (i, &a) in colours.iter().enumerate() {
        assert!(a.iter().any(|&level| level > 150), "{a:?} is dark");
        assert!(colours[..i].iter().all(|&b| apart(a, b) > 30), "{i}: {a:?}");
    }
    assert_eq!(identity_colour(u64::MAX), identity_colour(u64::MAX));
}

#[test]
fn pixels_have_their_colour_and_motions_end_at_the_middle() {
    let view = Picture::filled(60, 40, [100; 3]);
    let mark = ClusterMark { number: 7, centre: [40.0, 20.0], motion: [12.0, 0.0] };
    let picture = cluster_picture(&view, [([2, 3], 7), ([99, 3], 7)].into_iter(), &[mark], 1);
    assert_eq!((picture.pixel(2, 3), picture.pixel(3, 3)), (identity_colour(7), [50; 3]));
    assert_eq!((picture.pixel(30, 20), picture.pixel(40, 20)), ([255; 3], [255; 3]));
    assert_eq!(picture.pixel(20, 20), [50; 3]);
    let unknown = ClusterMark { motion: [f64::NAN; 2], ..mark };
    assert_eq!(cluster_picture(&view, std::iter::empty(), &[unknown], 2).pixel(60, 41), [50; 3]);
}
