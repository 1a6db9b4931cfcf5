//! How far what moves reaches: where a target is whose middle does not show it.
//!
//! Of an even target only the outline moves, some of it more plainly than the rest, and the mean of that is
//! not its middle; of one that is partly beyond the border, the mean of what is left is not either. Its two
//! ends along either axis are: the middle between them, or, where one is missing, the other one and how far
//! apart they usually are.

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

/// Place up to which so many lie, where each pixel's are spread evenly over it.
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
#[derive(Debug, Clone)]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Frame;

    fn field(moving: impl Fn(usize, usize) -> bool) -> LocalFlow {
        LocalFlow {
            flow: Frame::from_fn(60, 40, |x, y| if moving(x, y) { [2.0, 0.0] } else { [0.0; 2] }),
            accepted: Frame::filled(60, 40, true),
        }
    }

    #[test]
    fn ends_do_not_depend_on_how_much_moves_between_them() {
        // The left side of an outline moves three times as plainly as the right one: the mean is 5 px off.
        let flow = field(|x, y| (10..30).contains(&y) && ((20..26).contains(&x) || (38..40).contains(&x)));
        let found = ends(&flow, 0.5).unwrap();
        let middle = Extent::new([20.0, 20.0]).middle(&found, [29.5, 19.5], [60.0, 40.0]);
        assert!((middle[0].unwrap().at - 29.5).abs() < 0.3 && (middle[1].unwrap().at - 19.5).abs() < 1e-9);
        assert!((flow.mean(0.5).centroid[0] - 29.5).abs() > 2.0);
        assert_eq!(ends(&field(|_, _| false), 0.5), None);
    }

    #[test]
    fn the_end_that_is_seen_shows_where_the_target_is() {
        let extent = Extent::new([20.0, 20.0]);
        let ends = [[40.0, 50.0], [10.0, 30.0]];
        // Half of it is beyond the right border, then beyond the left one, then behind an object in the
        // picture.
        let at = |expected: f64, length: f64| extent.middle(&ends, [expected, 20.0], [length, 80.0])[0].unwrap();
        assert_eq!((at(51.0, 54.0).at, at(51.0, 54.0).missing), (50.0, 0.0));
        let left = extent.middle(&[[6.0, 14.0], [10.0, 30.0]], [5.0, 20.0], [60.0, 80.0])[0].unwrap();
        assert_eq!((left.at, left.missing), (4.0, 0.0));
        let hidden = at(42.0, 200.0);
        assert_eq!((hidden.at, hidden.missing), (40.0, 0.5));
        // What is much longer than the target is not the target alone.
        assert!(extent.middle(&[[0.0, 40.0], [10.0, 30.0]], [20.0; 2], [60.0, 80.0])[0].is_none());
    }

    #[test]
    fn the_usual_distance_follows_growth_and_nothing_else() {
        let mut extent = Extent::new([20.0, 20.0]);
        for k in 0..40 {
            let apart = 20.0 + 0.25 * f64::from(k);
            extent.learn(&[[0.0, apart], [0.0, 50.0]]);
        }
        assert!((extent.usual[0] - 29.75).abs() < 3.0);
        assert_eq!(extent.usual[1], 20.0);
    }
}
