//! How well the target's outline is known, and with it where its middle is.

use super::Layered;

/// Deviation of the middle of the learnt support from that of the target, px: it stays from frame to frame,
/// and no filter takes it away.
const OUTLINE: f64 = 0.07;
/// How much farther the middle of the support may move than it did in a frame, and how much of that is
/// remembered in the next one: a box that is too large or beside the target takes a while to settle.
const SETTLING: (f64, f64) = (3.0, 0.8);
/// What it moves in a frame at rest, px.
const SETTLED: f64 = 0.02;
/// What noise adds to the deviation of the middle, over noise by contrast, px: what is learnt of an edge from
/// noisy frames stays wrong for as long as it is remembered.
const OUTLINE_IN_NOISE: f64 = 1.4;

impl Layered {
    /// Covariance of position, velocity and acceleration along x and y: the filter's, and how well the
    /// target's middle is known at all.
    pub fn covariance(&self) -> [[[f64; 3]; 3]; 2] {
        let mut covariance = self.filter.covariance();
        let outline = OUTLINE.hypot(OUTLINE_IN_NOISE * self.faintness);
        for (k, axis) in covariance.iter_mut().enumerate() {
            axis[0][0] += outline * outline + self.doubt[k].powi(2) + self.unsettled[k].powi(2);
        }
        covariance
    }

    /// The middle of the support was at a place before it was learnt.
    pub(super) fn settle(&mut self, before: [f64; 2]) {
        let after = self.position(&self.pose);
        for (k, unsettled) in self.unsettled.iter_mut().enumerate() {
            let moved = ((after[k] - before[k]).abs() - SETTLED).max(0.0);
            *unsettled = (SETTLING.1 * *unsettled).max(SETTLING.0 * moved);
        }
    }
}
