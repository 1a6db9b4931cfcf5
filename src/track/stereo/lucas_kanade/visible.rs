//! Motion of what is still visible of a cluster: where more than half of it is being covered, a deviation
//! taken from its own residuals makes all of it look sound.

use super::task::{Task, Voter};
use super::{AFFINE_PIXELS, FINE, FINE_STEPS, PlaneMotion, SETTLED, SmoothedLevels};

/// Deviations over the noise, one after another: from what lets an expectation be a pixel wrong to what is
/// left at the end.
const NARROWING: [f64; 4] = [8.0, 4.0, 2.0, 1.0];
/// Steps with a translation at each.
const STEPS_EACH: usize = 2;
/// Most that a pixel which agrees with a motion leaves, over the noise.
const AGREEING: f64 = 3.0;
/// Least share of a cluster's pixels that agree with its motion; some do with any.
const LEAST_AGREEING: f64 = 0.15;

/// Of a motion that was found and those found from what is `expected` of the translation (px), the one with
/// which most of the pixels agree, that is, leave no more than the noise explains. `noise` is the deviation
/// of what the picture's motions leave in general, grey levels. `None` where hardly more pixels agree than do
/// by chance.
pub(in super::super) fn visible_motion(
    before: &SmoothedLevels,
    after: &SmoothedLevels,
    pixels: &[[f64; 2]],
    (found, expected): (PlaneMotion, &[[f64; 2]]),
    noise: f64,
) -> Option<PlaneMotion> {
    let task = Task::new(before, after, pixels)?;
    let voters = task.voters(FINE);
    let mut best = (found, task.agreeing(&voters, &task.map_of(&found), noise));
    for start in expected {
        let Some(map) = task.narrowed(&voters, start, noise) else { continue };
        let (Some(other), agreeing) = (task.told(&map), task.agreeing(&voters, &map, noise)) else { continue };
        if agreeing > best.1 {
            best = (other, agreeing);
        }
    }
    (best.1 as f64 >= LEAST_AGREEING * voters.len() as f64).then_some(best.0)
}

impl Task<'_> {
    /// A motion about the centre as a map.
    fn map_of(&self, motion: &PlaneMotion) -> [f64; 6] {
        let [u, v, derivatives @ ..] = motion.flow.to_array();
        let [u_x, v_x, u_y, v_y] = derivatives.map(|derivative| derivative * self.radius);
        [u, v, u_x, v_x, u_y, v_y]
    }

    /// From a translation, at the finest level, with deviations that end at the noise: what differs by more
    /// counts the less the better the motion is known.
    fn narrowed(&self, voters: &[Voter], start: &[f64; 2], noise: f64) -> Option<[f64; 6]> {
        let after = &self.after.0[FINE];
        let mut map = [start[0], start[1], 0.0, 0.0, 0.0, 0.0];
        let mut residuals = Vec::with_capacity(voters.len());
        for deviation in NARROWING.map(|times| times * noise) {
            for _ in 0..STEPS_EACH {
                self.residuals(voters, after, &map, &mut residuals)?;
                self.step::<2>(voters, (&residuals, deviation), &mut map, start)?;
            }
        }
        if self.agreeing(voters, &map, noise) >= AFFINE_PIXELS {
            for _ in 0..FINE_STEPS[1] {
                self.residuals(voters, after, &map, &mut residuals)?;
                if self.step::<6>(voters, (&residuals, noise), &mut map, start)? < SETTLED {
                    break;
                }
            }
        }
        map.iter().all(|value| value.is_finite()).then_some(map)
    }

    /// How many pixels agree with a map.
    fn agreeing(&self, voters: &[Voter], map: &[f64; 6], noise: f64) -> usize {
        let mut residuals = Vec::with_capacity(voters.len());
        if self.residuals(voters, &self.after.0[FINE], map, &mut residuals).is_none() {
            return 0;
        }
        residuals.iter().filter(|residual| f64::from(residual.abs()) <= AGREEING * noise).count()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{pair, pixels};
    use super::super::{LEAST_DEVIATION, affine_motion};
    use super::*;

    /// Waves that move by (1.5, 0.5) and are covered, from a column on, by others that move by (-6, 0).
    fn covered(from: usize) -> (SmoothedLevels, SmoothedLevels) {
        let (first, mut second) = pair([1.5, 0.5], [0.0; 4]);
        let (_, others) = pair([-6.0, 0.0], [0.0; 4]);
        for (frame, other) in second.0.iter_mut().zip(&others.0) {
            for y in 0..100 {
                frame.row_mut(y)[from..].copy_from_slice(&other.row(y)[from..]);
            }
        }
        (first, second)
    }

    /// Of the pixels from column 40 to 80 two thirds are covered.
    #[test]
    fn a_third_that_is_visible_is_enough_where_it_is_expected() {
        let (first, second) = covered(55);
        let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
        let wrong = (found.flow.u - 1.5).hypot(found.flow.v - 0.5);
        assert!(wrong > 2.0 && found.deviation > 2.0 * LEAST_DEVIATION, "{found:?}");
        let expected = [[9.0, -9.0], [2.0, 0.0]];
        let seen = visible_motion(&first, &second, &pixels(), (found, &expected), LEAST_DEVIATION).unwrap();
        let [x, y] = seen.moved(45.0, 50.0);
        assert!((x - 46.5).abs() < 0.1 && (y - 50.5).abs() < 0.1, "{seen:?}");
        // Without an expectation nothing is said: hardly a pixel agrees with what was found.
        assert_eq!(visible_motion(&first, &second, &pixels(), (found, &[]), LEAST_DEVIATION), None);
    }

    #[test]
    fn what_explains_more_than_any_expectation_stays() {
        let (first, second) = pair([1.5, 0.5], [0.02, 0.0, 0.0, 0.02]);
        let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
        let seen = visible_motion(&first, &second, &pixels(), (found, &[[-20.0, 11.0]]), LEAST_DEVIATION);
        assert_eq!(seen, Some(found));
    }

    #[test]
    fn a_motion_with_which_nothing_agrees_is_none() {
        let (first, second) = pair([1.5, 0.5], [0.0; 4]);
        let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
        let mut other = second.clone();
        other.0.iter_mut().for_each(|frame| *frame = frame.map(|value| value + 90.0));
        assert_eq!(visible_motion(&first, &other, &pixels(), (found, &[[1.5, 0.5]]), LEAST_DEVIATION), None);
        let blind = SmoothedLevels(second.0.clone().map(|frame| frame.map(|_| f32::NAN)));
        assert_eq!(visible_motion(&first, &blind, &pixels(), (found, &[[1.5, 0.5]]), LEAST_DEVIATION), None);
    }
}
