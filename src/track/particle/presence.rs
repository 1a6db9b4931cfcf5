//! Whether a target is hidden; running means of its similarity, velocity and number of tracks.

use super::{camera::CameraMotion, cloud::Particle};

/// Similarity below this share of the usual one is low.
const LOW: f64 = 0.75;
/// Gain of the running mean of the similarity.
const SIMILARITY_GAIN: f64 = 0.05;
/// Smallest gains of the running means of velocity and number of tracks: plain means at first.
const GAINS: [f64; 2] = [0.2, 0.1];
/// Share of the usual number of tracks below which a target may be hidden.
const HIDDEN_SHARE: f64 = 0.25;
/// Share of a box that another one covers when it may hide it.
pub(super) const COVER: f64 = 0.5;
/// Number of tracks, and share of the usual number, that make a hidden target seen again.
const SEEN_AGAIN: (f64, f64) = (4.0, 0.3);
/// Noise of a hidden target: share at first, and what it grows by in each frame, up to 1.
const HIDDEN_NOISE: (f64, f64) = (0.4, 0.04);
/// Frames after which a hidden target counts as lost.
const LOST_AFTER: usize = 30;

/// What the tracker remembers of how a target is seen.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Presence {
    /// Usual similarity; `None` before the first one.
    pub similarity: Option<f64>,
    /// Usual velocity relative to the background, px/frame.
    pub velocity: [f64; 2],
    /// Usual number of labelled tracks.
    pub tracks: f64,
    /// Frames that the running means are of.
    count: usize,
    /// Frames since the target became hidden; 0: it is not.
    hidden: usize,
    /// Whether the last similarity was low.
    pub is_low: bool,
    /// Where the target was last clear, moved on by the camera and the usual velocity, px.
    pub clear_place: [f64; 2],
}

impl Presence {
    pub fn new(place: [f64; 2]) -> Self {
        Self {
            similarity: None,
            velocity: [0.0; 2],
            tracks: 0.0,
            count: 0,
            hidden: 0,
            is_low: false,
            clear_place: place,
        }
    }

    /// Frames since it became hidden; 0: it is not.
    pub fn hidden_frames(&self) -> usize {
        self.hidden
    }

    /// Whether it is hidden.
    pub fn is_hidden(&self) -> bool {
        self.hidden > 0
    }

    /// Whether it was hidden for so long that it counts as lost.
    pub fn is_lost(&self) -> bool {
        self.hidden > LOST_AFTER
    }

    /// Factor of the transition's noise.
    pub fn noise(&self) -> f64 {
        if self.is_hidden() && crate::ablation::keeps("particle.hidden_noise") {
            (HIDDEN_NOISE.0 + HIDDEN_NOISE.1 * self.hidden as f64).min(1.0)
        } else {
            1.0
        }
    }

    /// How many tracks that move with a hidden target make it seen again.
    pub fn tracks_to_return(&self) -> f64 {
        SEEN_AGAIN.0.max(SEEN_AGAIN.1 * self.tracks)
    }

    /// Decides whether the target is hidden in this frame. Returns whether it was not before.
    pub fn decide(&mut self, labelled: usize, is_covered: bool, returning: usize) -> bool {
        let few = (labelled as f64) < HIDDEN_SHARE * self.tracks;
        let hidden = few
            && (self.is_low || is_covered && crate::ablation::keeps("particle.covered"))
            && (!crate::ablation::keeps("particle.returning") || (returning as f64) < self.tracks_to_return());
        let entered = hidden && self.hidden == 0;
        self.hidden = if hidden { self.hidden + 1 } else { 0 };
        entered
    }

    /// Hides the target without a decision by its tracks, as after a cut.
    pub fn hide(&mut self) {
        self.hidden += 1;
    }

    /// The target is not hidden any more, or nobody judges it.
    pub fn show(&mut self) {
        self.hidden = 0;
    }

    /// The place where it was last clear, one frame on.
    pub fn moved_on(&self, camera: &CameraMotion) -> [f64; 2] {
        camera.carry(self.clear_place, self.velocity)
    }

    /// Compares a similarity with the usual one.
    pub fn judge(&mut self, similarity: f64) {
        let usual = *self.similarity.get_or_insert(similarity);
        self.is_low = similarity < LOW * usual;
    }

    /// Updates the usual values by a frame in which the target is seen and nothing is near. Returns whether
    /// the target is clear there.
    pub fn learn(&mut self, similarity: f64, labelled: usize, estimate: &Particle) -> bool {
        if self.is_low {
            return false;
        }
        let usual = self.similarity.unwrap_or(similarity);
        self.similarity = Some(usual + SIMILARITY_GAIN * (similarity - usual));
        self.count += 1;
        let gain = |least: f64| least.max(1.0 / self.count as f64);
        for i in 0..2 {
            self.velocity[i] += gain(GAINS[0]) * (estimate[2 + i] - self.velocity[i]);
        }
        self.tracks += gain(GAINS[1]) * (labelled as f64 - self.tracks);
        self.clear_place = [estimate[0], estimate[1]];
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ESTIMATE: Particle = [10.0, 20.0, 2.0, 0.0, 5.0, 10.0];

    fn settled() -> Presence {
        let mut presence = Presence::new([0.0; 2]);
        for _ in 0..20 {
            presence.judge(0.8);
            presence.learn(0.8, 20, &ESTIMATE);
        }
        presence
    }

    #[test]
    fn hidden_needs_few_tracks_and_a_reason() {
        for (labelled, similarity, covered, returning, hidden) in [
            (4, 0.3, false, 0, true),
            (4, 0.8, true, 0, true),
            (4, 0.8, false, 0, false),
            (5, 0.3, true, 0, false),
            (0, 0.3, true, 6, false),
            (0, 0.3, true, 5, true),
        ] {
            let mut presence = settled();
            presence.judge(similarity);
            assert_eq!(presence.decide(labelled, covered, returning), hidden);
            assert_eq!(presence.is_hidden(), hidden);
        }
    }
}
