//! Tracks drawn over a frame: box, path, centre with its error ellipse, window.

use jacoflow::image::picture::{PathPoint, Picture, Rgb, TrackColours, TrackOverlay, identity_colour, status_colour};
use jacoflow::types::{TargetBox, TrackState, TrackStatus};

const GREY: Rgb = [90; 3];

fn state() -> TrackState {
    TrackState::at([30.0, 20.0], TargetBox::about([30.0, 20.0], 20.0, 10.0))
}

fn drawn(overlay: TrackOverlay, state: &TrackState, path: &[PathPoint]) -> Picture {
    let mut picture = Picture::filled(64, 48, GREY);
    overlay.draw(&mut picture, 1, state, path);
    picture
}

#[test]
fn the_box_is_drawn_on_its_sides_and_turned_where_that_is_known() {
    let upright = drawn(TrackOverlay::default(), &state(), &[]);
    let green = status_colour(TrackStatus::Tracking);
    for (x, y) in [(20, 18), (40, 22), (25, 15), (35, 25)] {
        assert_eq!(upright.pixel(x, y), green, "{x} {y}");
    }
    let turned = TrackState { rotation: std::f64::consts::FRAC_PI_2, ..state() };
    let picture = drawn(TrackOverlay::default(), &turned, &[]);
    for (x, y) in [(25, 12), (35, 28), (30, 10), (30, 30)] {
        assert_eq!(picture.pixel(x, y), green, "{x} {y}");
    }
    assert_eq!(picture.pixel(40, 22), GREY);
    let blind = TrackState { rotation_observable: false, ..turned };
    assert_eq!(drawn(TrackOverlay::default(), &blind, &[]), upright);
}

#[test]
fn path_and_status_have_their_colours() {
    let lost = TrackState { status: TrackStatus::Lost, ..state() };
    let path = [([5.0, 40.0], TrackStatus::Tracking), ([15.0, 40.0], TrackStatus::Coasting)];
    let overlay = TrackOverlay::default();
    let picture = drawn(overlay, &lost, &path);
    assert_eq!(picture.pixel(10, 40), status_colour(TrackStatus::Coasting));
    assert_eq!(picture.pixel(30, 15), status_colour(TrackStatus::Lost));
}

#[test]
fn targets_may_have_colours_of_their_own() {
    let overlay = TrackOverlay { colours: TrackColours::Target, ..TrackOverlay::default() };
    let colour = identity_colour(1);
    let on_left_side = |picture: &Picture| (15..26).filter(|y| picture.pixel(20, *y) == colour).count();
    assert_eq!(on_left_side(&drawn(overlay, &state(), &[])), 11);
    let hidden = TrackState { status: TrackStatus::Coasting, ..state() };
    let dashes = on_left_side(&drawn(overlay, &hidden, &[]));
    assert!((4..9).contains(&dashes), "{dashes}");
    let path = [([5.0, 40.0], TrackStatus::Tracking), ([15.0, 40.0], TrackStatus::Lost)];
    for status in [TrackStatus::Out, TrackStatus::Lost] {
        let gone = drawn(overlay, &TrackState { status, ..state() }, &path);
        assert_eq!((gone.pixel(10, 40), on_left_side(&gone)), (colour, 0));
    }
}

#[test]
fn an_enlarged_picture_has_everything_in_its_place() {
    let overlay = TrackOverlay { enlargement: 3, ..TrackOverlay::default() };
    let mut picture = Picture::filled(64, 48, GREY).enlarged(3);
    overlay.draw(&mut picture, 12, &state(), &[]);
    // Pixel 20 covers 60 to 62; its centre is 61.
    assert_eq!(picture.pixel(61, 55), status_colour(TrackStatus::Tracking));
}

#[test]
fn what_is_not_known_is_left_out() {
    let mut unknown = state();
    unknown.bounds.x = f64::NAN;
    unknown.position = [f64::NAN; 2];
    unknown.covariance[0][0][0] = f64::NAN;
    let overlay = TrackOverlay::default();
    assert_eq!(drawn(overlay, &unknown, &[]), Picture::filled(64, 48, GREY));
    unknown = state();
    unknown.covariance[1][0][0] = f64::INFINITY;
    unknown.bounds = TargetBox::about([1e300, -1e300], 3.0, 3.0);
    drawn(overlay, &unknown, &[([f64::NAN; 2], TrackStatus::Out), ([1e300; 2], TrackStatus::Out)]);
}

#[test]
fn the_ellipse_has_the_axes_of_the_covariance() {
    // The 0.95 quantile with two degrees of freedom.
    let chi_squared = 5.991_464_547_107_979;
    let mut state = state();
    state.covariance[0][0][0] = 36.0 / chi_squared;
    state.covariance[1][0][0] = 144.0 / chi_squared;
    let picture = drawn(TrackOverlay::default(), &state, &[]);
    for (x, y) in [(24, 20), (36, 20), (30, 8), (30, 32)] {
        assert_ne!(picture.pixel(x, y), GREY, "{x} {y}");
    }
    assert_eq!(picture.pixel(18, 20), GREY);
}
