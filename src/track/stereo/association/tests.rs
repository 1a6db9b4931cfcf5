use super::*;

const CELL: [f64; 3] = [8.0, 8.0, 1.0];

const MIN_PIXELS: f64 = 20.0;

fn at(component: usize, position: [f64; 3]) -> Sighting {
    Sighting { component, position, pixels: 100, spread: [2.0, 4.0, 0.3] }
}

/// A motion behind which two fifths of it are seen.
fn measured(motion: [f64; 3]) -> Measured {
    Measured { motion, support: 0.4 }
}

fn association() -> TrackAssociation {
    let mut all = TrackAssociation { live: vec![None; 3], ..TrackAssociation::default() };
    all.associate(
        Clock::at(0),
        &[at(0, [10.0, 10.0, 30.0]), at(1, [40.0, 10.0, 20.0])],
        MIN_PIXELS,
        Some(&Recognition::default()),
    );
    all
}

#[test]
fn a_hidden_track_is_recognised_where_it_is_expected() {
    let limits = Recognition::default();
    let mut all = association();
    all.carry(0, (Some(measured([2.0, 0.0, 0.5])), 1.0), CELL, &limits).unwrap();
    all.carry(0, (Some(measured([2.0, 0.0, 0.5])), 1.0), CELL, &limits).unwrap();
    all.associate(Clock::at(1), &[at(0, [12.0, 10.0, 30.5])], MIN_PIXELS, Some(&limits));
    // Gone at steps 2 to 4.
    all.set_lost(1.0, |k| k == 0);
    for time in 2..5 {
        all.associate(Clock::at(time), &[at(1, [40.0, 10.0, 20.0])], MIN_PIXELS, Some(&limits));
        assert_eq!(all.live[0], None);
    }
    let (mut elsewhere, mut small) = (all.clone(), all.clone());
    small.associate(Clock::at(5), &[Sighting { pixels: 9, ..at(2, [20.5, 11.0, 32.6]) }], MIN_PIXELS, Some(&limits));
    assert_eq!(small.live[2].as_ref().unwrap().id, 2);
    // Half of it, whose middle is farther from the expected one than that of all of it may be.
    let upper = at(2, [20.5, 1.0, 32.6]);
    for (pixels, id) in [(100, 2), (40, 0)] {
        let mut part = all.clone();
        part.associate(Clock::at(5), &[Sighting { pixels, ..upper }], MIN_PIXELS, Some(&limits));
        assert_eq!(part.live[2].as_ref().unwrap().id, id);
    }
    all.associate(Clock::at(5), &[at(2, [20.5, 11.0, 32.6])], MIN_PIXELS, Some(&limits));
    assert_eq!(all.live[2].as_ref().unwrap().id, 0);
    elsewhere.associate(Clock::at(5), &[at(2, [29.0, 11.0, 32.6])], MIN_PIXELS, Some(&limits));
    assert_eq!(elsewhere.live[2].as_ref().unwrap().id, 2);
}

#[test]
fn who_does_not_resemble_a_hidden_track_is_not_taken_for_it() {
    let limits = Recognition::default();
    let mut all = association();
    for _ in 0..2 {
        all.carry(0, (Some(measured([2.0, 0.0, 0.0])), 1.0), CELL, &limits);
    }
    all.set_lost(0.0, |k| k == 0);
    let there = at(2, [16.0, 10.0, 30.0]);
    for (seen, known) in [
        (there, true),
        (Sighting { pixels: 40, ..there }, true),
        (Sighting { pixels: 160, ..there }, false),
        (Sighting { spread: [2.0, 4.0, 1.0], ..there }, true),
        (Sighting { spread: [2.0, 4.0, 4.0], ..there }, false),
    ] {
        let mut all = all.clone();
        all.associate(Clock::at(3), &[seen], MIN_PIXELS, Some(&limits));
        assert_eq!(all.live[2].as_ref().unwrap().id == 0, known, "{seen:?}");
    }
}

#[test]
fn of_the_parts_that_come_to_light_the_largest_is_it() {
    let limits = Recognition::default();
    let mut all = association();
    for _ in 0..2 {
        all.carry(0, (Some(measured([2.0, 0.0, 0.0])), 1.0), CELL, &limits);
    }
    all.set_lost(0.0, |k| k == 0);
    // At step 2 two parts of it, at step 3 another one that is larger; at last it is whole.
    let part = |component, position, pixels| Sighting { pixels, ..at(component, position) };
    let ids =
        |all: &TrackAssociation| all.live.iter().map(|live| live.as_ref().map(|live| live.id)).collect::<Vec<_>>();
    all.associate(
        Clock::at(2),
        &[part(0, [14.5, 5.0, 30.0], 20), part(2, [14.5, 14.0, 30.0], 30)],
        MIN_PIXELS,
        Some(&limits),
    );
    assert_eq!(ids(&all), [Some(2), Some(1), Some(0)]);
    all.live[0] = None;
    all.associate(
        Clock::at(3),
        &[part(0, [16.5, 5.0, 30.0], 60), part(2, [16.5, 14.0, 30.0], 30)],
        MIN_PIXELS,
        Some(&limits),
    );
    assert_eq!(ids(&all), [Some(0), Some(1), Some(3)]);
    assert_eq!(all.live[0].as_ref().unwrap().position, [16.0, 10.0, 30.0]);
    // The one that it was taken for is larger after all.
    let mut other = all.clone();
    other.associate(
        Clock::at(4),
        &[part(0, [18.5, 5.0, 30.0], 40), part(2, [18.5, 14.0, 30.0], 50)],
        MIN_PIXELS,
        Some(&limits),
    );
    assert_eq!(ids(&other), [Some(3), Some(1), Some(0)]);
    all.live[2] = None;
    all.associate(
        Clock::at(4),
        &[part(0, [18.5, 10.0, 30.0], 95), part(2, [18.0, 5.0, 30.0], 98)],
        MIN_PIXELS,
        Some(&limits),
    );
    assert_eq!(ids(&all), [Some(0), Some(1), Some(4)]);
}
