//! When pairs of views were recorded, where that is not evenly.

use crate::error::{Error, Result};
use crate::math::median;
use crate::pipeline::run::Numbering;

/// When every pair of the input was recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct PairTimes {
    /// s, ascending, from the first pair of the input.
    times: Vec<f64>,
    /// Usual time between pairs that are used, s.
    ordinary: f64,
}

impl PairTimes {
    /// From the times of all pairs of the input, s, those of `numbering`; the ordinary step is the median.
    ///
    /// # Errors
    /// [`Error::Argument`] named `times` for fewer than two that are used, and for those that do not ascend.
    pub fn new(times: &[f64], numbering: Numbering) -> Result<Self> {
        if let Some(i) = (0..times.len()).find(|&i| !times[i].is_finite() || i > 0 && times[i] <= times[i - 1]) {
            let got = format!("{} in line {}", times[i], i + 1);
            return Err(Error::argument("times", "seconds that ascend", got));
        }
        let used: Vec<f64> = times.iter().copied().skip(numbering.start).step_by(numbering.step.max(1)).collect();
        let mut steps: Vec<f64> = used.windows(2).map(|pair| pair[1] - pair[0]).collect();
        match median(&mut steps) {
            Some(ordinary) => Ok(Self { times: times.iter().map(|time| time - times[0]).collect(), ordinary }),
            None => Err(Error::argument("times", "times of at least 2 pairs that are used", used.len())),
        }
    }

    /// When pair `index` of the input was recorded, s from the first.
    ///
    /// # Errors
    /// [`Error::Argument`] named `times` for a pair beyond them.
    pub fn at(&self, index: usize) -> Result<f64> {
        let expected = || format!("a time for every pair, {} or more", index + 1);
        self.times.get(index).copied().ok_or_else(|| Error::argument("times", expected(), self.times.len()))
    }

    /// Time from one pair of the input to another, in ordinary steps.
    pub fn steps(&self, from: usize, to: usize) -> Result<f64> {
        Ok((self.at(to)? - self.at(from)?) / self.ordinary)
    }
}
