//! Associates components with tracks. A component keeps its track while it covers its moved self; a lost
//! track is kept for a while and recognised by its position.

use super::clock::Clock;
use super::warm_start::WholeObject;

/// Recognition of lost tracks (`improved`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Recognition {
    /// Overlap of a component with its moved self below which it loses its track; default 0.2.
    pub least_overlap: f64,
    /// Ordinary steps that a lost track is kept; default 10.
    pub patience: usize,
    /// Tolerance of the position of a recognised track, cells along x, y and disparity; default (3, 4, 1).
    pub tolerance: [f64; 3],
    /// Growth of the tolerance per ordinary step; default (0.5, 0.5, 0.2).
    pub tolerance_per_step: [f64; 3],
    /// Steps without a jump after which a track is steady; default 2.
    pub steady: usize,
    /// Largest number of ordinary steps that a steady track coasts through a jump with a support below 0.6;
    /// default 3.
    pub coast: usize,
    /// A jump in the picture: change of the motion, px per ordinary step; default 24.
    pub jump: f64,
    /// A jump in disparity, per ordinary step; default 1.5.
    pub jump_disparity: f64,
}

impl Default for Recognition {
    fn default() -> Self {
        Self {
            least_overlap: 0.2,
            patience: 10,
            tolerance: [3.0, 4.0, 1.0],
            tolerance_per_step: [0.5, 0.5, 0.2],
            steady: 2,
            coast: 3,
            jump: 24.0,
            jump_disparity: 1.5,
        }
    }
}

#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct ComponentTrack {
    pub id: u64,
    /// Begin, ordinary steps.
    pub born: f64,
    /// Last reliable motion, cells along x, y and disparity per ordinary step; measurements are weighted by
    /// their support.
    pub velocity: Option<[f64; 3]>,
    /// Number of steps without a jump.
    pub steady: usize,
    /// Time coasted without interruption, ordinary steps.
    pub coasted: f64,
    /// Position, cells: its middle, or an extrapolation while it is mostly covered, which shifts the middle.
    pub position: [f64; 3],
    /// Decaying maximum of the number of edge pixels.
    pub peak: f64,
    /// Median absolute deviations along x and y when it was last mostly visible, cells.
    pub spread: [f64; 2],
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sighting {
    pub component: usize,
    /// Medians, cells.
    pub position: [f64; 3],
    /// Edge pixels.
    pub pixels: usize,
    /// Median absolute deviations along x and y, cells; robust against wrong matches.
    pub spread: [f64; 2],
}

/// Share of the peak number of pixels below which a track counts as partly covered.
const COVERED_SHARE: f64 = 0.8;
/// Number of pixels over that of a track beyond which it is a part of what is seen.
const MAX_GROWTH: f64 = 1.5;
/// Half the extent of a uniform distribution over its median absolute deviation.
const HALF_EXTENT: f64 = 2.0;
/// Decay of the peak number of pixels per ordinary step: follows an object that shrinks with distance, not
/// one that is covered over several steps.
const PEAK_DECAY: f64 = 0.95;

/// Rounding tolerance of times, ordinary steps.
const TIME_TOLERANCE: f64 = 1e-6;

/// Support (share of pixels seen where the motion leads) from which a jump is accepted: little for one onto
/// an occluder, nearly full for an object that stops, or moves twice as far over a missing frame.
const FULL_SUPPORT: f64 = 0.6;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    /// Cells per ordinary step.
    pub motion: [f64; 3],
    /// Support: share of the component's pixels seen at the predicted place and depth.
    pub support: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Carried {
    /// Motion, cells per ordinary step.
    pub motion: [f64; 3],
    /// Whether it is an extrapolation.
    pub coasting: bool,
}

#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
struct LostTrack {
    track: ComponentTrack,
    /// Time of its position, ordinary steps.
    since: f64,
}

#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct TrackAssociation {
    pub live: Vec<Option<ComponentTrack>>,
    lost: Vec<LostTrack>,
    next: u64,
}

/// Whether two motions, cells per ordinary step, differ by a jump.
fn jumps(a: [f64; 3], b: [f64; 3], cell: [f64; 3], limits: &Recognition) -> bool {
    let plane = ((a[0] - b[0]) * cell[0]).hypot((a[1] - b[1]) * cell[1]);
    plane > limits.jump || (a[2] - b[2]).abs() > limits.jump_disparity
}

impl TrackAssociation {
    fn new_id(&mut self) -> u64 {
        self.next += 1;
        self.next - 1
    }

    /// The motion of component `k` over `gap` ordinary steps: the measured one, or the last reliable motion
    /// of a steady track, for a limited time, after a jump with little support or without a measurement.
    pub fn carry(
        &mut self,
        k: usize,
        (measured, gap): (Option<Measured>, f64),
        cell: [f64; 3],
        limits: &Recognition,
    ) -> Option<Carried> {
        let trust = measured.map_or(0.0, |measured| (measured.support / FULL_SUPPORT).min(1.0));
        let sure = trust >= 1.0 && crate::ablation::keeps("stereo.sure_jump");
        let measured = measured.map(|measured| measured.motion);
        let Some(track) = self.live.get_mut(k).and_then(Option::as_mut) else {
            return measured.map(|motion| Carried { motion, coasting: false });
        };
        let like = match (track.velocity, measured) {
            (Some(last), Some(now)) => !jumps(last, now, cell, limits),
            _ => false,
        };
        if let Some(last) = track.velocity.filter(|_| !like && !sure) {
            let steady = track.steady >= limits.steady || measured.is_none();
            let coasted = track.coasted + gap;
            if crate::ablation::keeps("stereo.coast") && steady && coasted <= limits.coast as f64 + TIME_TOLERANCE {
                track.coasted = coasted;
                return Some(Carried { motion: last, coasting: true });
            }
        }
        track.coasted = 0.0;
        track.steady = if like { track.steady + 1 } else { usize::from(measured.is_some()) };
        // The visible rest of a nearly hidden object gives poor measurements, and its predicted position
        // depends on them.
        track.velocity = match (track.velocity, measured) {
            (Some(last), Some(now)) if like => {
                let trust = if crate::ablation::keeps("stereo.trusted_velocity") { trust } else { 1.0 };
                Some(std::array::from_fn(|i| last[i] + trust * (now[i] - last[i])))
            }
            (last, now) => now.or(last),
        };
        measured.map(|motion| Carried { motion, coasting: false })
    }

    /// Marks the tracks of components for which `lost` holds as lost since `since`, ordinary steps.
    pub fn set_lost(&mut self, since: f64, lost: impl Fn(usize) -> bool) {
        for k in 0..self.live.len() {
            if lost(k)
                && let Some(track) = self.live[k].take()
            {
                self.lost.push(LostTrack { track, since });
            }
        }
    }

    /// A reappearing object is first seen in parts: a mostly covered track passes to a larger matching
    /// component without a track, with a recent one, or with a younger one that it outgrows.
    fn pass_to_larger_parts(&mut self, at: Clock, seen: &[Sighting], least: f64, limits: &Recognition) {
        for own in seen {
            let Some(track) = self.live[own.component].as_ref() else { continue };
            if !track.is_covered(own.pixels as f64) {
                continue;
            }
            let begun = |other: &ComponentTrack| at.now <= other.born + limits.coast as f64 + TIME_TOLERANCE;
            let larger = seen.iter().filter(|new| {
                let gives_way =
                    |other: &ComponentTrack| other.born > track.born && (begun(other) || other.is_outgrown(new));
                self.live[new.component].as_ref().is_none_or(gives_way)
                    && new.pixels > own.pixels
                    && new.pixels as f64 >= least
                    && track.fits(at.gap, (new.position, new.pixels as f64), limits)
            });
            if let Some(new) = larger.max_by_key(|new| (new.pixels, std::cmp::Reverse(new.component))) {
                self.live.swap(own.component, new.component);
            }
        }
    }

    /// The largest partly covered object, as it was when visible, that edge pixels `gap` ordinary steps after
    /// its last ones may be a part of. `shown`: pixels of a component at the last step.
    pub fn reappeared(
        &self,
        gap: f64,
        seen: ([f64; 3], f64),
        shown: impl Fn(usize) -> usize,
    ) -> Option<(usize, WholeObject)> {
        let fits = |(k, track): (usize, &Option<ComponentTrack>)| {
            let track = track.as_ref().filter(|track| track.is_covered(shown(k) as f64))?;
            track.fits(gap, seen, &Recognition::default()).then(|| (k, track.whole(gap)))
        };
        let covered = self.live.iter().enumerate().filter_map(fits);
        covered.max_by(|(_, a), (_, b)| a.pixels.total_cmp(&b.pixels))
    }

    /// Gives components of at least `least` pixels without a track a matching lost one (largest components
    /// first, the largest track of each) or a new one. Updates all positions.
    pub fn associate(&mut self, at: Clock, seen: &[Sighting], least: f64, limits: Option<&Recognition>) {
        self.lost.retain(|track| {
            limits.is_some_and(|limits| at.now - track.since <= limits.patience as f64 + TIME_TOLERANCE)
        });
        if let Some(limits) = limits {
            let mut pairs = Vec::new();
            for (r, track) in self.lost.iter().enumerate() {
                let unnamed = |new: &&Sighting| new.pixels as f64 >= least && self.live[new.component].is_none();
                for new in seen.iter().filter(unnamed) {
                    if track.track.fits(at.now - track.since, (new.position, new.pixels as f64), limits) {
                        pairs.push((new.pixels, track.track.peak, r, new.component));
                    }
                }
            }
            pairs.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)).then((a.2, a.3).cmp(&(b.2, b.3))));
            let mut taken = vec![false; self.lost.len()];
            let mut named = vec![false; self.live.len()];
            for (_, _, r, k) in pairs {
                if !taken[r] && !named[k] {
                    (taken[r], named[k]) = (true, true);
                    self.live[k] = Some(self.lost[r].resumed(at));
                }
            }
            let mut left = taken.into_iter();
            self.lost.retain(|_| !left.next().unwrap_or(false));
            if crate::ablation::keeps("stereo.larger_parts") {
                self.pass_to_larger_parts(at, seen, least, limits);
            }
        }
        for &Sighting { component, position, pixels, spread } in seen {
            if self.live[component].is_none() {
                let id = self.new_id();
                let (born, velocity) = (at.now, None);
                let unknown =
                    ComponentTrack { id, born, velocity, steady: 0, coasted: 0.0, position, peak: 0.0, spread };
                self.live[component] = Some(unknown);
            }
            if let Some(track) = &mut self.live[component] {
                track.see((position, pixels as f64, spread), at.gap);
            }
        }
    }
}

impl ComponentTrack {
    /// Updates position, number of pixels and spread, `gap` ordinary steps after the last update.
    fn see(&mut self, (position, pixels, spread): ([f64; 3], f64, [f64; 2]), gap: f64) {
        self.peak = pixels.max(PEAK_DECAY.powf(gap) * self.peak);
        self.position = match self.velocity {
            Some(velocity) if crate::ablation::keeps("stereo.covered_position") && self.is_covered(pixels) => {
                std::array::from_fn(|i| self.position[i] + gap * velocity[i])
            }
            _ => {
                self.spread = spread;
                position
            }
        };
    }

    /// Whether it is partly covered where it shows this many edge pixels.
    fn is_covered(&self, pixels: f64) -> bool {
        pixels < COVERED_SHARE * self.peak
    }

    /// As it was when visible, `gap` ordinary steps after the last one.
    fn whole(&self, gap: f64) -> WholeObject {
        let velocity = self.velocity.unwrap_or_default();
        WholeObject {
            middle: std::array::from_fn(|i| self.position[i] + gap * velocity[i]),
            variance: self.spread.map(|spread| (HALF_EXTENT * spread).powi(2) / 3.0),
            pixels: self.peak,
        }
    }

    /// Whether edge pixels at a position, `steps` ordinary steps after the last ones, may be of this object.
    fn fits(&self, steps: f64, (position, pixels): ([f64; 3], f64), limits: &Recognition) -> bool {
        let Some(velocity) = self.velocity else { return false };
        // The middle of the visible part differs from that of the whole by up to the covered part.
        let covered = 1.0 - (pixels / self.peak.max(1.0)).min(1.0);
        (0..3).all(|i| {
            let expected = self.position[i] + steps * velocity[i];
            let part = if i < 2 && crate::ablation::keeps("stereo.covered_tolerance") {
                covered * HALF_EXTENT * self.spread[i]
            } else {
                0.0
            };
            let tolerance = limits.tolerance[i] + steps * limits.tolerance_per_step[i] + part;
            (position[i] - expected).abs() <= tolerance
        })
    }

    fn is_outgrown(&self, seen: &Sighting) -> bool {
        seen.pixels as f64 > MAX_GROWTH * self.peak
    }
}

impl LostTrack {
    /// The track continued at its predicted position; its peak size is kept.
    fn resumed(&self, at: Clock) -> ComponentTrack {
        let mut track = ComponentTrack { coasted: 0.0, ..self.track.clone() };
        if let Some(velocity) = track.velocity {
            let steps = (at.before() - self.since).max(0.0);
            (0..3).for_each(|i| track.position[i] += steps * velocity[i]);
        }
        track
    }
}
