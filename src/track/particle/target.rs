//! One target: appearance, particles and estimate.

use super::appearance::Appearance;
use super::camera::CameraMotion;
use super::cloud::{Cloud, Particle, Purpose, Start, stream};
use super::geometry::CentredBox;
use super::labels::Labelled;
use super::noise::Noise;
use super::options::ParticleOptions;
use super::presence::Presence;
use crate::types::Frame;

#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Target {
    pub id: u64,
    /// Width and height at the start, px.
    pub first_size: [f64; 2],
    pub appearance: Appearance,
    pub cloud: Cloud,
    pub estimate: Particle,
    pub presence: Presence,
    /// Whether its centre, carried on by one frame, leaves the picture: it is no longer followed.
    pub is_out: bool,
    /// Whether no frame has come since it was added.
    pub is_new: bool,
    /// Similarity of its colours in the last frame, 0 to 1.
    pub similarity: f64,
    pub effective_sample_size: f64,
    pub degenerate: bool,
}

impl Target {
    /// A target in a box of a frame.
    pub fn new(id: u64, bounds: CentredBox, (bins, frame): (&Frame<u8>, usize), options: &ParticleOptions) -> Self {
        let scale = options.length_scale(bins.height());
        let [x, y, w, h] = bounds;
        let start = Start { mean: [x, y, 0.0, 0.0, w, h], noise: Noise::of_options(options, scale), scale };
        let cloud = Cloud::begin(&start, options.n_particles, stream(options.random_state, id, frame, Purpose::Start));
        Self {
            id,
            first_size: [w, h],
            appearance: Appearance::learn(bins, bounds, options.uses("particle.contrast")),
            effective_sample_size: options.n_particles as f64,
            cloud,
            estimate: start.mean,
            presence: Presence::new([x, y]),
            is_out: false,
            is_new: true,
            similarity: 1.0,
            degenerate: false,
        }
    }

    /// Centre of the estimate, px.
    pub fn place(&self) -> [f64; 2] {
        [self.estimate[0], self.estimate[1]]
    }

    /// Velocity of the estimate, px/frame.
    pub fn velocity(&self) -> [f64; 2] {
        [self.estimate[2], self.estimate[3]]
    }

    /// Box of the estimate.
    pub fn bounds(&self) -> CentredBox {
        let [x, y, _, _, w, h] = self.estimate;
        [x, y, w, h]
    }

    /// The frame shows nothing: particles move on without being weighed.
    pub fn coast(&mut self, options: &ParticleOptions, scale: f64, frame: usize) {
        let rng = stream(options.random_state, self.id, frame, Purpose::Transition);
        self.presence.hide();
        let noise = Noise::of_options(options, scale).times(self.presence.noise());
        self.cloud.predict(&CameraMotion::NONE, &noise, self.first_size, rng);
        self.estimate = self.cloud.mean();
        self.effective_sample_size = self.cloud.effective_sample_size();
        self.degenerate = false;
    }
}

/// The targets in the picture as labels of tracks need them, each with the box that `bounds` gives.
pub(super) fn labelled(targets: &[Target], bounds: impl Fn(usize, &Target) -> CentredBox) -> Vec<Labelled> {
    let in_picture = targets.iter().enumerate().filter(|(_, target)| !target.is_out);
    let one = |(own, target): (usize, &Target)| Labelled {
        id: target.id,
        bounds: bounds(own, target),
        velocity: target.velocity(),
        is_hidden: target.presence.is_hidden(),
        is_unlike: target.presence.is_low,
    };
    in_picture.map(one).collect()
}
