//! Times of steps: frames may be missing or uneven.

use std::ops::RangeInclusive;

/// Valid times between steps, ordinary steps.
pub(super) const GAP_RANGE: RangeInclusive<f64> = 1e-6..=1e6;
/// Valid durations of an ordinary step, in the unit of times.
pub(super) const STEP_TIME_RANGE: RangeInclusive<f64> = 1e-12..=1e12;

/// Time of the current step.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Clock {
    /// Time since the first step, in ordinary steps.
    pub now: f64,
    /// Time since the last step, in ordinary steps: 2 where one is missing.
    pub gap: f64,
    /// Duration of an ordinary step, in the unit of times.
    pub step_time: f64,
}

impl Clock {
    /// Time of the last step, ordinary steps.
    pub fn before(self) -> f64 {
        self.now - self.gap
    }

    /// Time since the first step, in the unit of times.
    pub fn elapsed(self) -> f64 {
        self.now * self.step_time
    }

    /// Velocity of a change since the last step, per unit of time.
    pub fn velocity<const N: usize>(self, change: [f64; N]) -> [f64; N] {
        change.map(|change| change / (self.gap * self.step_time))
    }

    /// Search reach in cells over the gap, given that of an ordinary step; never less than that.
    pub fn reach(self, ordinary: usize) -> i32 {
        (ordinary as f64 * self.gap.max(1.0)).ceil().min(MAX_REACH as f64).max(ordinary as f64) as i32
    }
}

/// Farthest search, cells.
pub(super) const MAX_REACH: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_for_the_unit_of_time_and_searches_reach_over_gaps() {
        let late = Clock { now: 5.0, gap: 2.0, step_time: 0.04 };
        assert_eq!((late.before(), late.elapsed()), (3.0, 0.2));
        assert_eq!(late.velocity([4.0, -8.0]), [50.0, -100.0]);
        assert_eq!([0.5, 1.0, 1.1, 2.0, 1e9].map(|gap| Clock { gap, ..late }.reach(8)), [8, 8, 9, 16, 64]);
    }
}
