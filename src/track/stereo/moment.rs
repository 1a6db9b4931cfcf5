//! When a step is: frames may be missing between two of them, or come at uneven times.

use std::ops::RangeInclusive;

/// Times between steps, in ordinary steps: beyond, velocities and clocks would be no numbers any more.
pub(super) const GAPS: RangeInclusive<f64> = 1e-6..=1e6;
/// Ordinary steps, in the unit that times are told in.
pub(super) const STEP_TIMES: RangeInclusive<f64> = 1e-12..=1e12;

/// When the step that is being taken is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moment {
    /// Time since the first step, in ordinary steps.
    pub now: f64,
    /// Time since the last step, in ordinary steps: 2 where one is missing.
    pub gap: f64,
    /// Time between ordinary steps, in the unit that times are told in.
    pub step_time: f64,
}

impl Moment {
    /// When the last step was, in ordinary steps.
    pub fn before(self) -> f64 {
        self.now - self.gap
    }

    /// Time since the first step, in the unit that times are told in.
    pub fn clock(self) -> f64 {
        self.now * self.step_time
    }

    /// A change since the last step as a velocity, for each unit of time.
    pub fn velocity<const N: usize>(self, change: [f64; N]) -> [f64; N] {
        change.map(|change| change / (self.gap * self.step_time))
    }

    /// How far, in cells, to search what is searched `ordinary` cells far from one ordinary step to the next.
    /// Nothing is searched less far for being seen sooner: there is little to gain.
    pub fn reach(self, ordinary: usize) -> i32 {
        (ordinary as f64 * self.gap.max(1.0)).ceil().min(MOST_REACH as f64).max(ordinary as f64) as i32
    }
}

/// Farthest search, cells.
pub(super) const MOST_REACH: usize = 64;

#[cfg(test)]
impl Moment {
    /// At a whole step, the last one being the one before it.
    pub fn at(step: usize) -> Self {
        Self { now: step as f64, gap: 1.0, step_time: 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_for_the_unit_of_time_and_searches_reach_over_gaps() {
        let late = Moment { now: 5.0, gap: 2.0, step_time: 0.04 };
        assert_eq!((late.before(), late.clock()), (3.0, 0.2));
        assert_eq!(late.velocity([4.0, -8.0]), [50.0, -100.0]);
        assert_eq!([0.5, 1.0, 1.1, 2.0, 1e9].map(|gap| Moment { gap, ..late }.reach(8)), [8, 8, 9, 16, 64]);
    }
}
