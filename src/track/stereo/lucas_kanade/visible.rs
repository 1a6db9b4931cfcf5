//! Motion of the visible part of a cluster. Where more than half is being covered, a noise scale from the
//! cluster's own residuals accepts every pixel; here the scale comes from the other clusters.

use super::super::cluster_motion::PlaneMotion;
use super::task::{Task, Voter};
use super::{FINE, FINE_STEPS, MIN_AFFINE_PIXELS, MIN_STEP, SmoothedLevels};

/// Annealed noise scales over the noise: the first one allows a start that is 1 px wrong.
const ANNEALED_SCALES: [f64; 4] = [8.0, 4.0, 2.0, 1.0];
/// Translation steps at each scale.
const STEPS_EACH: usize = 2;
/// Largest residual of a pixel that agrees with a motion, over the noise.
const AGREEING: f64 = 3.0;
/// Smallest share of agreeing pixels; a few agree with any motion by chance.
const MIN_AGREEING_SHARE: f64 = 0.15;

/// Returns the motion with most agreeing pixels: `found`, or one annealed from an `expected` translation
/// (px). `noise`: standard deviation of residuals of all clusters, grey levels. `None` if no more pixels
/// agree than by chance.
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
        let (Some(other), agreeing) = (task.motion_of(&map), task.agreeing(&voters, &map, noise)) else { continue };
        if agreeing > best.1 {
            best = (other, agreeing);
        }
    }
    (best.1 as f64 >= MIN_AGREEING_SHARE * voters.len() as f64).then_some(best.0)
}

impl Task<'_> {
    /// The map of a motion.
    fn map_of(&self, motion: &PlaneMotion) -> [f64; 6] {
        let [u, v, derivatives @ ..] = motion.flow.to_array();
        let [u_x, v_x, u_y, v_y] = derivatives.map(|derivative| derivative * self.radius);
        [u, v, u_x, v_x, u_y, v_y]
    }

    /// Anneals from a translation at the finest level: outliers count less as the motion gets better known.
    fn narrowed(&self, voters: &[Voter], start: &[f64; 2], noise: f64) -> Option<[f64; 6]> {
        let after = &self.after.0[FINE];
        let mut map = [start[0], start[1], 0.0, 0.0, 0.0, 0.0];
        let mut residuals = Vec::with_capacity(voters.len());
        for deviation in ANNEALED_SCALES.map(|times| times * noise) {
            for _ in 0..STEPS_EACH {
                self.residuals(voters, after, &map, &mut residuals)?;
                self.step::<2>(voters, (&residuals, deviation), &mut map, start)?;
            }
        }
        if self.agreeing(voters, &map, noise) >= MIN_AFFINE_PIXELS {
            for _ in 0..FINE_STEPS[1] {
                self.residuals(voters, after, &map, &mut residuals)?;
                if self.step::<6>(voters, (&residuals, noise), &mut map, start)? < MIN_STEP {
                    break;
                }
            }
        }
        map.iter().all(|value| value.is_finite()).then_some(map)
    }

    /// Number of pixels that agree with a map.
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
    use super::super::{MIN_NOISE_STD, affine_motion};
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
        assert!(wrong > 2.0 && found.deviation > 2.0 * MIN_NOISE_STD, "{found:?}");
        let expected = [[9.0, -9.0], [2.0, 0.0]];
        let seen = visible_motion(&first, &second, &pixels(), (found, &expected), MIN_NOISE_STD).unwrap();
        let [x, y] = seen.moved(45.0, 50.0);
        assert!((x - 46.5).abs() < 0.1 && (y - 50.5).abs() < 0.1, "{seen:?}");
        // Without an expectation there is no answer: too few pixels agree with what was found.
        assert_eq!(visible_motion(&first, &second, &pixels(), (found, &[]), MIN_NOISE_STD), None);
    }

    #[test]
    fn what_explains_more_than_any_expectation_stays() {
        let (first, second) = pair([1.5, 0.5], [0.02, 0.0, 0.0, 0.02]);
        let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
        let seen = visible_motion(&first, &second, &pixels(), (found, &[[-20.0, 11.0]]), MIN_NOISE_STD);
        assert_eq!(seen, Some(found));
    }

    #[test]
    fn a_motion_with_which_nothing_agrees_is_none() {
        let (first, second) = pair([1.5, 0.5], [0.0; 4]);
        let found = affine_motion(&first, &second, &pixels(), &[[0.0, 0.0]]).unwrap();
        let mut other = second.clone();
        other.0.iter_mut().for_each(|frame| *frame = frame.map(|value| value + 90.0));
        assert_eq!(visible_motion(&first, &other, &pixels(), (found, &[[1.5, 0.5]]), MIN_NOISE_STD), None);
        let blind = SmoothedLevels(second.0.clone().map(|frame| frame.map(|_| f32::NAN)));
        assert_eq!(visible_motion(&first, &blind, &pixels(), (found, &[[1.5, 0.5]]), MIN_NOISE_STD), None);
    }
}
