//! A first box that is too large, too small or off: in the first frames that move, what moves is found
//! without the box ([`detect_moving_target`]). It is the target if it has clearly other sides, the rest of
//! the box stayed and looks different, and what the box leaves out moved along.

use super::{initial::Changes, initial::InitialSegmentation, layers::grown, layers::holds};
use crate::track::gradient::{detect::MovingTarget, detect::detect_moving_target};
use crate::types::{Frame, TargetBox};

/// Frames in which that may be seen: what turns or grows leaves its box later.
const MAX_FRAMES: usize = 8;
/// Least and greatest displacement along the axis it is greater on, px.
const MOVED: [f64; 2] = [2.0, 7.0];
/// The same as measured on what the box holds, which its other content may blur.
const NEARLY: [f64; 2] = [1.0, 8.0];
/// How far the middles must be apart: share of the box's side, and px. What moves is known in whole pixels,
/// and its extent is up to 2 px too long, on either end: its middle is off by 1 px at most.
const MIN_CENTER_DISTANCE: (f64, f64) = (0.1, 1.3);
/// The same of the sides' difference.
const MIN_SIDE_DIFFERENCE: (f64, f64) = (0.15, 2.5);
/// How far what moves may go beyond a box that holds all of it, px.
const MAX_BEYOND_BOX: f64 = 1.5;
/// Angle, rad, from which on changes since the first frame no longer determine the outline.
pub(super) const TURNED: f64 = 0.05;
/// Sides of what moves over those of the box, at least and at most.
const SIDES: [f64; 2] = [0.55, 2.5];
/// Distance of the middles of the two, share of the box's sides.
const MAX_CENTER_OFFSET: f64 = 0.4;
/// The same, and px, where the box holds all of what moves: of a target that an object hides in part the box
/// holds the hidden part, on one side.
const CENTRED: (f64, f64) = (0.08, 0.75);
/// Width of the rim around what moved in which it must stand out, px.
const RIM: f64 = 2.0;
/// Share of the pixels there that may look like it.
const MAX_ALIKE_SHARE: f64 = 0.35;
/// Share of the pixels between the two that may not do as they should.
const MAX_OUTLIER_SHARE: f64 = 0.25;
/// Fewest of them.
const MIN_PIXELS: usize = 12;
/// The 10th and the 90th percentile of a part's brightness: its usual range.
const USUAL: [f64; 2] = [0.1, 0.9];

impl InitialSegmentation {
    /// What moved, where that has clearly other sides than the box.
    pub fn refitted(&self, frame: &Frame<f64>, noise: f64) -> Option<MovingTarget> {
        // Where what the box holds determines its displacement, that spares looking in vain.
        let promising = self.moved().is_none_or(|moved| (NEARLY[0]..=NEARLY[1]).contains(&greater(moved)));
        if self.frames() > MAX_FRAMES || !promising {
            return None;
        }
        let changes = self.changes(frame, noise);
        let corner = self.first.corner.map(|at| at as f64);
        let centre = self.bounds.centre();
        let found = detect_moving_target(&self.first.frame, &changes.now, Some([0, 1].map(|k| centre[k] - corner[k])))?;
        let first = TargetBox {
            x: found.bounds.x + corner[0] - found.displacement[0],
            y: found.bounds.y + corner[1] - found.displacement[1],
            ..found.bounds
        };
        let told = (MOVED[0]..=MOVED[1]).contains(&greater(found.displacement)) && is_another(&self.bounds, &first);
        let bounds = TargetBox { x: first.x + found.displacement[0], y: first.y + found.displacement[1], ..first };
        let found = MovingTarget { bounds, ..found };
        (told && changes.are_explained(&first, &found)).then_some(found)
    }
}

fn greater(displacement: [f64; 2]) -> f64 {
    displacement[0].abs().max(displacement[1].abs())
}

fn ends(bounds: &TargetBox) -> [[f64; 2]; 2] {
    [[bounds.x, bounds.x + bounds.width], [bounds.y, bounds.y + bounds.height]]
}

/// Whether what moves clearly differs from the box in sides or middle, but may still be its target.
fn is_another(bounds: &TargetBox, first: &TargetBox) -> bool {
    let (held, found) = (ends(bounds), ends(first));
    let (mut apart, mut longer, mut within, mut centred) = (0.0, false, true, true);
    for k in 0..2 {
        let (side, other) = (held[k][1] - held[k][0], found[k][1] - found[k][0]);
        let aside = (0.5 * (held[k][0] + held[k][1] - found[k][0] - found[k][1])).abs();
        if !(SIDES[0]..SIDES[1]).contains(&(other / side)) || aside > MAX_CENTER_OFFSET * side {
            return false;
        }
        apart = f64::hypot(apart, aside / (MIN_CENTER_DISTANCE.0 * side).max(MIN_CENTER_DISTANCE.1));
        longer |= (side - other).abs() >= (MIN_SIDE_DIFFERENCE.0 * side).max(MIN_SIDE_DIFFERENCE.1);
        within &= found[k][0] > held[k][0] - MAX_BEYOND_BOX && found[k][1] < held[k][1] + MAX_BEYOND_BOX;
        centred &= aside <= CENTRED.0 * side + CENTRED.1;
    }
    (apart >= 1.0 || longer) && (!within || centred)
}

impl Changes<'_> {
    /// Whether what is only in the box stayed and looks different, and what is only in the outline moved.
    fn are_explained(&self, first: &TargetBox, found: &MovingTarget) -> bool {
        let corner = self.segmentation.first.corner;
        let d = found.displacement.map(|d| d as isize);
        let (outline, core, now) =
            (grown(*first, (0.0, 1.0)), grown(*first, (0.0, -1.0)), grown(found.bounds, (0.0, 1.0)));
        let usual = self.brightness_range(&core);
        let is_usual = |value: f64| value > usual[0] - self.bar && value < usual[1] + self.bar;
        let rim = grown(*first, (0.0, 1.0 + RIM));
        let (mut counts, mut strays) = ([0; 2], [0; 2]);
        let (mut around, mut alike) = (0, 0);
        let (width, height) = self.now.size();
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let at = (x + corner[0], y + corner[1]);
            let in_box = self.segmentation.inside.get(x, y);
            let like = is_usual(self.segmentation.first.frame.get(x, y));
            if holds(&rim, at.0, at.1) && !holds(&outline, at.0, at.1) {
                around += 1;
                alike += usize::from(like);
            }
            if in_box && !holds(&outline, at.0, at.1) && !holds(&now, at.0, at.1) {
                counts[0] += 1;
                // What looks like the target is its own if it may have moved with it; on an even background
                // both hold.
                let along = self.on([x, y], d).is_none_or(|to| self.along([x, y], to) <= self.bar);
                strays[0] += usize::from(self.at_rest([x, y]) > self.bar || like && along);
            } else if !in_box && holds(&core, at.0, at.1) {
                counts[1] += 1;
                let along = self.on([x, y], d).is_some_and(|to| self.along([x, y], to) <= self.bar);
                strays[1] += usize::from(!along || !like && self.at_rest([x, y]) <= self.bar);
            }
        }
        let stands_out = alike as f64 <= MAX_ALIKE_SHARE * around as f64;
        stands_out
            && counts[0] + counts[1] >= MIN_PIXELS
            && (0..2).all(|k| strays[k] as f64 <= MAX_OUTLIER_SHARE * counts[k] as f64)
    }

    fn brightness_range(&self, part: &TargetBox) -> [f64; 2] {
        let corner = self.segmentation.first.corner;
        let (width, height) = self.now.size();
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let inside = pixels.filter(|(x, y)| holds(part, x + corner[0], y + corner[1]));
        let mut values: Vec<f64> = inside.map(|(x, y)| self.segmentation.first.frame.get(x, y)).collect();
        values.sort_by(f64::total_cmp);
        let last = values.len().saturating_sub(1) as f64;
        USUAL.map(|share| values.get((share * last).round() as usize).copied().unwrap_or(f64::NAN))
    }
}
