//! Which track each component is: kept while it covers its moved self, rested when lost, recognised; section
//! 6.6 of the stereo tracker's design.

use super::moment::Moment;
use super::options::Recognition;

/// What is known of the track of a component.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Identity {
    pub id: u64,
    /// When it began, ordinary steps.
    pub born: f64,
    /// Last good motion, cells along x, y and disparity per ordinary step: measured ones as far as the
    /// component was seen where they lead.
    pub velocity: Option<[f64; 3]>,
    /// Steps of like motion.
    pub steady: usize,
    /// Time coasted without a break, ordinary steps.
    pub coasted: f64,
    /// Where it is, cells: its middle, or where it went since while it is mostly covered, which shifts the
    /// middle.
    pub position: [f64; 3],
    /// Most edge pixels of late.
    pub peak: f64,
    /// Median deviations along x, y and in depth when it was last mostly seen, cells and layers.
    pub spread: [f64; 3],
}

/// A component that is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sighting {
    pub component: usize,
    /// Medians, cells.
    pub position: [f64; 3],
    /// Edge pixels.
    pub pixels: usize,
    /// Median deviations from these along x, y and in depth, cells and layers. Wrong matches that are in
    /// every component change neither much.
    pub spread: [f64; 3],
}

/// Share of the most pixels of late below which a track counts as partly covered: its middle is then that of
/// what is left.
const COVERED: f64 = 0.8;
/// By how much a thing may be thicker or thinner than a lost one that it is taken for: a factor, and layers.
/// What covers part of a thing does not change its extent in depth.
const AS_THICK: (f64, f64) = (2.0, 0.5);
/// How many times as many pixels as the lost one had a thing that is taken for it may have.
const AS_LARGE: f64 = 1.5;
/// Half the extent of something even, over its median deviation.
const HALF_EXTENT: f64 = 2.0;
/// What the memory of the most pixels keeps for each ordinary step: little enough to forget what shrinks as
/// it goes away, and so much that what is being covered over several steps is not taken for that.
const FORGET: f64 = 0.95;

/// Times differ by more than this, ordinary steps, unless they are the same one summed up otherwise.
const SAME_TIME: f64 = 1e-6;

/// Share of a component's pixels that must be seen where a measured motion leads for it to be believed
/// although it is a jump. What is being hidden jumps onto what hides it, where few of them meet anything.
/// What stops, or moves twice as far because a frame is missing, is seen nearly whole.
const SEEN_THERE: f64 = 0.6;

/// A motion that was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    /// Cells per ordinary step.
    pub motion: [f64; 3],
    /// Share of the component's pixels that are seen where it leads, in the depth that it leads to.
    pub support: f64,
}

/// What a component does from one step to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Carried {
    /// Motion, cells per ordinary step.
    pub motion: [f64; 3],
    /// Whether it is an extrapolation.
    pub coasting: bool,
}

/// A lost track.
#[derive(Debug, Clone, PartialEq)]
struct Resting {
    identity: Identity,
    /// When it was last where its position says, ordinary steps.
    since: f64,
}

/// All tracks: those of the components, and the lost ones.
#[derive(Debug, Clone, Default)]
pub(super) struct Identities {
    pub live: Vec<Option<Identity>>,
    resting: Vec<Resting>,
    next: u64,
}

/// Whether two motions differ by a jump; both in cells per ordinary step.
fn jumps(a: [f64; 3], b: [f64; 3], cell: [f64; 3], limits: &Recognition) -> bool {
    let plane = ((a[0] - b[0]) * cell[0]).hypot((a[1] - b[1]) * cell[1]);
    plane > limits.jump || (a[2] - b[2]).abs() > limits.jump_disparity
}

impl Identities {
    /// A new track's name.
    fn name(&mut self) -> u64 {
        self.next += 1;
        self.next - 1
    }

    /// The motion that carries component `k` on over a gap of so many ordinary steps: what was measured, or
    /// the last good motion of a steady track for a while after that jumped, with little to be seen there, or
    /// was not measured.
    pub fn carry(
        &mut self,
        k: usize,
        (measured, gap): (Option<Measured>, f64),
        cell: [f64; 3],
        limits: Option<&Recognition>,
    ) -> Option<Carried> {
        let trust = measured.map_or(0.0, |measured| (measured.support / SEEN_THERE).min(1.0));
        let sure = trust >= 1.0 && crate::ablation::keeps("stereo.sure_jump");
        let measured = measured.map(|measured| measured.motion);
        let Some(identity) = self.live.get_mut(k).and_then(Option::as_mut) else {
            return measured.map(|motion| Carried { motion, coasting: false });
        };
        let Some(limits) = limits else {
            identity.velocity = measured.or(identity.velocity);
            return measured.map(|motion| Carried { motion, coasting: false });
        };
        let like = match (identity.velocity, measured) {
            (Some(last), Some(now)) => !jumps(last, now, cell, limits),
            _ => false,
        };
        if let Some(last) = identity.velocity.filter(|_| !like && !sure) {
            let steady = identity.steady >= limits.steady || measured.is_none();
            let coasted = identity.coasted + gap;
            if crate::ablation::keeps("stereo.coast") && steady && coasted <= limits.coast as f64 + SAME_TIME {
                identity.coasted = coasted;
                return Some(Carried { motion: last, coasting: true });
            }
        }
        identity.coasted = 0.0;
        identity.steady = if like { identity.steady + 1 } else { usize::from(measured.is_some()) };
        // Of who is nearly hidden little is left to measure, and where it is waited for depends on it.
        identity.velocity = match (identity.velocity, measured) {
            (Some(last), Some(now)) if like => {
                let trust = if crate::ablation::keeps("stereo.trusted_velocity") { trust } else { 1.0 };
                Some(std::array::from_fn(|i| last[i] + trust * (now[i] - last[i])))
            }
            (last, now) => now.or(last),
        };
        measured.map(|motion| Carried { motion, coasting: false })
    }

    /// Takes the tracks of the components for which `lost` holds, to be waited for; they were last seen at
    /// `since`, ordinary steps.
    pub fn rest(&mut self, since: f64, lost: impl Fn(usize) -> bool) {
        for k in 0..self.live.len() {
            if lost(k)
                && let Some(identity) = self.live[k].take()
            {
                // Who never moved steadily is not known well enough to be recognised.
                if identity.steady > 0 || !crate::ablation::keeps("stereo.never_steady") {
                    self.resting.push(Resting { identity, since });
                }
            }
        }
    }

    /// What comes to light is first seen in parts: a track that is mostly covered goes over to a component
    /// that is larger than its own, may be it as well, and has no track, one that has only just begun, or a
    /// younger one that it outgrows; which its own component gets in exchange.
    fn pass_to_larger_parts(&mut self, at: Moment, seen: &[Sighting], least: f64, limits: &Recognition) {
        for own in seen {
            let Some(identity) = self.live[own.component].as_ref() else { continue };
            if own.pixels as f64 >= COVERED * identity.peak {
                continue;
            }
            let begun = |other: &Identity| at.now <= other.born + limits.coast as f64 + SAME_TIME;
            let larger = seen.iter().filter(|new| {
                let gives_way =
                    |other: &Identity| other.born > identity.born && (begun(other) || other.is_outgrown(new));
                self.live[new.component].as_ref().is_none_or(gives_way)
                    && new.pixels > own.pixels
                    && new.pixels as f64 >= least
                    && identity.distance(at.gap, new, limits).is_some()
            });
            if let Some(new) = larger.max_by_key(|new| (new.pixels, std::cmp::Reverse(new.component))) {
                self.live.swap(own.component, new.component);
            }
        }
    }

    /// Gives every component that is seen and has no track one: a lost track that is expected there, the
    /// largest component first and of its tracks the nearest, if there are at least `least` pixels, or a new
    /// one. A component whose track is of a part that was seen of something, which more and more of comes to
    /// light, is called after the lost whole instead. Then all are where they were seen.
    pub fn name_all(&mut self, at: Moment, seen: &[Sighting], least: f64, limits: Option<&Recognition>) {
        self.resting.retain(|resting| {
            limits.is_some_and(|limits| at.now - resting.since <= limits.patience as f64 + SAME_TIME)
        });
        if let Some(limits) = limits {
            let mut pairs = Vec::new();
            for (r, resting) in self.resting.iter().enumerate() {
                let waits_for = |new: &&Sighting| {
                    let part = |own: &Identity| {
                        crate::ablation::keeps("stereo.part_renamed")
                            && own.born > resting.identity.born
                            && own.is_outgrown(new)
                    };
                    new.pixels as f64 >= least && self.live[new.component].as_ref().is_none_or(part)
                };
                for new in seen.iter().filter(waits_for) {
                    if let Some(distance) = resting.identity.distance(at.now - resting.since, new, limits) {
                        pairs.push((new.pixels, distance, r, new.component));
                    }
                }
            }
            pairs.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)).then((a.2, a.3).cmp(&(b.2, b.3))));
            let mut taken = vec![false; self.resting.len()];
            let mut named = vec![false; self.live.len()];
            for (_, _, r, k) in pairs {
                if !taken[r] && !named[k] {
                    (taken[r], named[k]) = (true, true);
                    self.live[k] = Some(self.resting[r].awake(at));
                }
            }
            let mut left = taken.into_iter();
            self.resting.retain(|_| !left.next().unwrap_or(false));
            if crate::ablation::keeps("stereo.larger_parts") {
                self.pass_to_larger_parts(at, seen, least, limits);
            }
        }
        for &Sighting { component, position, pixels, spread } in seen {
            if self.live[component].is_none() {
                let id = self.name();
                let (born, velocity) = (at.now, None);
                let unknown = Identity { id, born, velocity, steady: 0, coasted: 0.0, position, peak: 0.0, spread };
                self.live[component] = Some(unknown);
            }
            if let Some(identity) = &mut self.live[component] {
                identity.see((position, pixels as f64, spread), at.gap);
            }
        }
    }
}

impl Identity {
    /// Takes over where it is seen, with how many pixels and how far spread, so many ordinary steps after it
    /// was last.
    fn see(&mut self, (position, pixels, spread): ([f64; 3], f64, [f64; 3]), gap: f64) {
        self.peak = pixels.max(FORGET.powf(gap) * self.peak);
        self.position = match self.velocity {
            Some(velocity) if crate::ablation::keeps("stereo.covered_position") && pixels < COVERED * self.peak => {
                std::array::from_fn(|i| self.position[i] + gap * velocity[i])
            }
            _ => {
                self.spread = spread;
                position
            }
        };
    }

    /// How far a component is from where the track is expected after so many ordinary steps, in tolerances;
    /// `None` beyond them, and for one that does not resemble it.
    fn distance(&self, steps: f64, seen: &Sighting, limits: &Recognition) -> Option<f64> {
        let velocity = self.velocity.filter(|_| self.resembles(seen))?;
        // The middle of what is not covered is as far from that of the whole as the other part allows.
        let covered = 1.0 - (seen.pixels as f64 / self.peak.max(1.0)).min(1.0);
        let mut sum = 0.0;
        for i in 0..3 {
            let expected = self.position[i] + steps * velocity[i];
            let part = if i < 2 && crate::ablation::keeps("stereo.covered_tolerance") {
                covered * HALF_EXTENT * self.spread[i]
            } else {
                0.0
            };
            let tolerance = limits.tolerance[i] + steps * limits.tolerance_per_step[i] + part;
            let off = (seen.position[i] - expected).abs() / tolerance;
            if off > 1.0 {
                return None;
            }
            sum += off * off;
        }
        Some(sum)
    }

    /// Whether a thing is larger than anything that has been seen of this one.
    fn is_outgrown(&self, seen: &Sighting) -> bool {
        seen.pixels as f64 > AS_LARGE * self.peak
    }

    /// Whether a thing may be this one, seen wholly or in part.
    fn resembles(&self, seen: &Sighting) -> bool {
        let (factor, layers) = AS_THICK;
        let (thinner, thicker) = (self.spread[2].min(seen.spread[2]), self.spread[2].max(seen.spread[2]));
        (thicker <= factor * thinner + layers || !crate::ablation::keeps("stereo.thickness"))
            && !(self.is_outgrown(seen) && crate::ablation::keeps("stereo.size"))
    }
}

impl Resting {
    /// The track as it goes on where it is expected; how much there is of it is remembered.
    fn awake(&self, at: Moment) -> Identity {
        let mut identity = Identity { coasted: 0.0, ..self.identity.clone() };
        if let Some(velocity) = identity.velocity {
            let steps = (at.before() - self.since).max(0.0);
            (0..3).for_each(|i| identity.position[i] += steps * velocity[i]);
        }
        identity
    }
}

#[cfg(test)]
mod tests;
