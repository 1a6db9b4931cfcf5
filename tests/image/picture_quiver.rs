//! Flow as arrows over a picture.

use jacoflow::image::picture::{Arrow, Picture, Quiver, arrows_on_grid};

#[test]
fn arrows_sit_on_the_grid_and_carry_their_flow() {
    let u: Vec<f32> = (0..12).map(|i| i as f32).collect();
    let arrows = arrows_on_grid(&u, &[1.0; 12], (4, 3), 2, (10.0, 20.0), 4.0).unwrap();
    assert_eq!(arrows.len(), 2);
    assert_eq!(arrows[1], Arrow { x: 22.0, y: 24.0, u: 7.0, v: 1.0 });
    assert!(arrows_on_grid(&u, &u, (4, 3), 0, (0.0, 0.0), 1.0).is_err());
    assert!(arrows_on_grid(&u, &u[1..], (4, 3), 1, (0.0, 0.0), 1.0).is_err());
}

#[test]
fn automatic_scale_ignores_unknown_flow() {
    let arrow = |u| Arrow { x: 0.0, y: 0.0, u, v: 0.0 };
    let arrows = [arrow(2.0), arrow(f64::NAN), arrow(2.0)];
    assert_eq!(Quiver::default().resolve_scale(&arrows), 7.0);
    assert_eq!(Quiver::default().resolve_scale(&[arrow(0.0)]), 1.0);
}

#[test]
fn an_arrow_is_drawn_from_tail_to_tip_with_barbs() {
    let mut picture = Picture::filled(30, 21, [128; 3]);
    let quiver = Quiver::new(Some(10.0));
    quiver.draw(
        &mut picture,
        &[Arrow { x: 5.0, y: 10.0, u: 1.8, v: 0.0 }, Arrow { x: 1.0, y: 1.0, u: f64::NAN, v: 0.0 }],
    );
    assert_eq!([5, 14, 23].map(|x| picture.pixel(x, 10)), [quiver.colour; 3]);
    assert!((0..21).filter(|y| picture.pixel(20, *y) != [128; 3]).count() > 5, "the head is wider than the shaft");
    assert_eq!(picture.pixel(1, 1), [128; 3]);
    assert_eq!(picture.pixel(28, 10), [128; 3]);
}
