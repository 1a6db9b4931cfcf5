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

#[test]
fn what_outgrows_the_track_of_a_part_is_the_lost_whole() {
    let limits = Recognition::default();
    let mut all = association();
    for _ in 0..2 {
        all.carry(0, (Some(measured([2.0, 0.0, 0.0])), 1.0), CELL, &limits);
    }
    all.set_lost(0.0, |k| k == 0);
    // A glimpse too small to be named after it, which gets a track of its own.
    let part = |position, pixels| Sighting { pixels, ..at(2, position) };
    all.associate(Clock::at(2), &[part([14.0, 10.0, 30.0], 12)], MIN_PIXELS, Some(&limits));
    assert_eq!(all.live[2].as_ref().unwrap().id, 2);
    for _ in 0..2 {
        all.carry(2, (Some(measured([2.0, 0.0, 0.0])), 1.0), CELL, &limits);
    }
    // Where it is a little more, it is a part still; where it is far more, and the whole is expected there,
    // it is that.
    for (pixels, place, id) in [(17, 22.0, 2), (90, 22.0, 0), (90, 32.0, 2)] {
        let mut all = all.clone();
        all.associate(Clock::at(6), &[part([place, 10.0, 30.0], pixels)], 1.0, Some(&limits));
        assert_eq!(all.live[2].as_ref().unwrap().id, id, "{pixels} pixels at {place}");
    }
}

#[test]
fn steady_tracks_coast_through_jumps_for_three_steps() {
    let limits = Recognition::default();
    let mut all = association();
    let (good, jump) = ([2.0, 0.0, 0.0], [-3.0, 0.0, 0.0]);
    let mut carry = |motion| all.carry(0, (motion, 1.0), CELL, &limits);
    for _ in 0..3 {
        assert_eq!(carry(Some(measured(good))), Some(Carried { motion: good, coasting: false }));
    }
    for carried in [Some(measured(jump)), None, Some(measured(jump))] {
        assert_eq!(carry(carried), Some(Carried { motion: good, coasting: true }));
    }
    assert_eq!(carry(Some(measured(jump))), Some(Carried { motion: jump, coasting: false }));
}

#[test]
fn a_jump_behind_which_most_of_it_is_seen_is_believed() {
    let limits = Recognition::default();
    let (good, twice) = ([2.0, 0.0, -3.0], [4.0, 0.0, -6.0]);
    for (support, believed) in [(0.4, false), (0.8, true)] {
        let mut all = association();
        for _ in 0..3 {
            all.carry(0, (Some(measured(good)), 1.0), CELL, &limits).unwrap();
        }
        let carried = all.carry(0, (Some(Measured { motion: twice, support }), 1.0), CELL, &limits);
        let expected = if believed { twice } else { good };
        assert_eq!(carried, Some(Carried { motion: expected, coasting: !believed }));
    }
}

#[test]
fn what_is_mostly_covered_goes_on_where_it_went() {
    let limits = Recognition::default();
    let mut all = association();
    all.carry(0, (Some(measured([2.0, 0.0, 0.0])), 1.0), CELL, &limits).unwrap();
    all.associate(Clock::at(1), &[Sighting { pixels: 90, ..at(0, [11.5, 10.0, 30.0]) }], MIN_PIXELS, Some(&limits));
    assert_eq!(all.live[0].as_ref().unwrap().position, [11.5, 10.0, 30.0]);
    all.associate(Clock::at(2), &[Sighting { pixels: 30, ..at(0, [11.0, 10.0, 30.0]) }], MIN_PIXELS, Some(&limits));
    assert_eq!(all.live[0].as_ref().unwrap().position, [13.5, 10.0, 30.0]);
}

#[test]
fn what_is_covered_little_by_little_comes_to_light_on_the_other_side_as_itself() {
    let limits = Recognition::default();
    let mut all = association();
    let moved = |all: &mut TrackAssociation, component| {
        all.carry(component, (Some(measured([2.0, 0.0, 0.0])), 1.0), CELL, &limits)
    };
    // Its left part is less and less, at last at 13; the right one appears about 24, the middle of the whole
    // being at 20.
    for (time, x, pixels) in [(1, 12.0, 100), (2, 13.5, 85), (3, 14.0, 70), (4, 13.5, 35)] {
        moved(&mut all, 0);
        all.associate(Clock::at(time), &[Sighting { pixels, ..at(0, [x, 10.0, 30.0]) }], MIN_PIXELS, Some(&limits));
    }
    moved(&mut all, 0);
    let left = Sighting { pixels: 6, ..at(0, [13.0, 10.0, 30.0]) };
    let right = Sighting { pixels: 25, ..at(2, [24.2, 10.0, 30.0]) };
    all.associate(Clock::at(5), &[left, right], MIN_PIXELS, Some(&limits));
    assert_eq!(all.live[2].as_ref().unwrap().id, 0);
}
