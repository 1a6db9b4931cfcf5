//! The time over which the flow of a field is taken.

use super::choices;

/// What the flow of a field at frame `t` is, with `d(t1)` the displacement since frame `t` of the matter that
/// is at the pixel at frame `t`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Interval {
    /// `d(t + 1)`: the step to the next frame.
    #[default]
    Forward,
    /// `(d(t + 1) - d(t - 1)) / 2`: the mean of the steps before and after.
    Central,
    /// The velocity at frame `t`: the derivative of `d`.
    Instant,
}

choices!(Interval, "interval": Forward "forward", Central "central", Instant "instant");
