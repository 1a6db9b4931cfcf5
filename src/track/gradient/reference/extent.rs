//! Place of a target from the ends of what moves.
//!
//! Of an even target only the outline moves, and beyond the border a part is missing: the mean of what moves
//! is not its middle. That lies between the ends, or at half their usual distance from one of them.

use super::local_flow::LocalFlow;

/// Share of the moving pixels beyond either end: few of them are not the target's.
const SHARE_BEYOND_ENDS: f64 = 0.05;
/// How fast the usual distance of the ends follows.
const RATE: f64 = 0.1;
/// Ends that are farther apart than so many times the usual distance are not the target's alone.
const MAX_EXTENT_RATIO: f64 = 1.35;
/// Share of the usual distance that may be missing where both ends are seen.
const SLACK: f64 = 0.1;
/// Local flow says nothing so near to the border of the picture, px.
const BORDER: f64 = 6.0;

/// Ends of what moves along x and along y, px.
pub(super) type Ends = [[f64; 2]; 2];

/// The ends of what moves in a field, faster than `eps` along either axis; `None` where nothing does.
pub(super) fn ends(flow: &LocalFlow, eps: f64) -> Option<Ends> {
    let (width, height) = flow.flow.size();
    let mut counts = [vec![0.0; width], vec![0.0; height]];
    let pixels = flow.flow.data().iter().zip(flow.accepted.data()).enumerate();
    for (at, _) in pixels.filter(|(_, (w, accepted))| **accepted && (w[0].abs() >= eps || w[1].abs() >= eps)) {
        counts[0][at % width] += 1.0;
        counts[1][at / width] += 1.0;
    }
    let all: f64 = counts[0].iter().sum();
    (all > 0.0).then(|| {
        counts.map(|counts| [SHARE_BEYOND_ENDS, 1.0 - SHARE_BEYOND_ENDS].map(|share| quantile(&counts, share * all)))
    })
}

fn quantile(counts: &[f64], share: f64) -> f64 {
    let mut sum = 0.0;
    for (at, count) in counts.iter().enumerate() {
        if sum + count >= share {
            return at as f64 - 0.5 + if *count > 0.0 { (share - sum) / count } else { 0.0 };
        }
        sum += count;
    }
    counts.len() as f64 - 0.5
}

/// How far apart the ends of the target usually are, px.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Extent {
    usual: [f64; 2],
}

/// Where the ends say that the middle is along an axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Middle {
    pub at: f64,
    /// Share of the usual distance that is missing, and not accounted for by the border of the picture.
    pub missing: f64,
}

impl Extent {
    /// From what is expected at first.
    pub fn new(usual: [f64; 2]) -> Self {
        Self { usual }
    }

    /// How far apart the ends usually are along x and y, px.
    pub fn mean_extent(&self) -> [f64; 2] {
        self.usual
    }

    /// The middle along x and y, where the ends are the target's; `expected` middle and `lengths` of the
    /// picture, px.
    pub fn middle(&self, ends: &Ends, expected: [f64; 2], lengths: [f64; 2]) -> [Option<Middle>; 2] {
        std::array::from_fn(|k| {
            let ([low, high], usual) = (ends[k], self.usual[k]);
            if high - low > MAX_EXTENT_RATIO * usual {
                return None;
            }
            let missing = 1.0 - (high - low) / usual;
            if missing <= SLACK {
                return Some(Middle { at: 0.5 * (low + high), missing: 0.0 });
            }
            let half = 0.5 * usual;
            // Which of the ends is the target's own.
            let cut = [expected[k] - half < BORDER, expected[k] + half > lengths[k] - 1.0 - BORDER];
            Some(match cut {
                [true, false] => Middle { at: high - half, missing: 0.0 },
                [false, true] => Middle { at: low + half, missing: 0.0 },
                _ => {
                    let (a, b) = (low + half, high - half);
                    let nearer = if (a - expected[k]).abs() < (b - expected[k]).abs() { a } else { b };
                    Middle { at: nearer, missing }
                }
            })
        })
    }

    /// Follows the ends of a target of which nothing is hidden.
    pub fn learn(&mut self, ends: &Ends) {
        for (usual, [low, high]) in self.usual.iter_mut().zip(ends) {
            let apart = high - low;
            if apart < MAX_EXTENT_RATIO * *usual {
                *usual += RATE * (apart - *usual);
            }
        }
    }
}
