//! One target: appearance, particles, and its estimate in one frame.

use super::appearance::{Appearance, CentredBox};
use super::camera::CameraMotion;
use super::cloud::{Cloud, Particle, Purpose, Start, stream};
use super::colour_table::ColourTable;
use super::corners::Track;
use super::evidence::{Evidence, track_evidence};
use super::foreground::ForegroundMap;
use super::geometry::distance;
use super::likelihood::{DistanceFactor, Factors, TrackFactor, VelocityFactor};
use super::noise::colour_gain;
use super::options::{Likelihoods, ParticleOptions};
use super::presence::Presence;
use super::recovery::{Recovery, recover};
use super::seeing::Seeing;
use crate::math::random::CounterRng;
use crate::types::Frame;

/// Quantile of the similarity over the particles that stands for the target.
const SIMILARITY_QUANTILE: f64 = 0.9;
/// Tracks that a quick start needs, and the probability of not being background above which they count.
const QUICK_START: (usize, f64) = (3, 0.5);

/// A target with its state.
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

/// What all targets share at one frame.
pub(super) struct Moment<'a> {
    pub options: &'a ParticleOptions,
    pub factors: Likelihoods,
    pub scale: f64,
    pub frame: usize,
    pub bins: &'a Frame<u8>,
    pub camera: CameraMotion,
    pub tracks: &'a [Track],
    pub foreground: Option<&'a ForegroundMap>,
    pub seeing: &'a [Seeing],
}

impl Target {
    /// A target in a box of a frame.
    pub fn new(id: u64, bounds: CentredBox, moment: (&Frame<u8>, usize), options: &ParticleOptions) -> Self {
        let (bins, frame) = moment;
        let scale = options.length_scale(bins.height());
        let [x, y, w, h] = bounds;
        let start = Start { mean: [x, y, 0.0, 0.0, w, h], noise: options.noise(scale), scale };
        let cloud = Cloud::begin(&start, options.n_particles, stream(options.random_state, id, frame, Purpose::Start));
        Self {
            id,
            first_size: [w, h],
            appearance: Appearance::learn(bins, bounds, options.used_parts().contrast),
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

    /// Selection, prediction, weights and estimate of one frame. `own`: index of the target in the moment.
    pub fn advance(&mut self, own: usize, moment: &Moment<'_>) {
        let seeing = &moment.seeing[own];
        let id = self.id;
        let rng = |purpose| stream(moment.options.random_state, id, moment.frame, purpose);
        let (selection, transition) = (rng(Purpose::Selection), rng(Purpose::Transition));
        let count = if seeing.near.is_empty() || !crate::ablation::keeps("particle.near_particles") {
            moment.options.n_particles
        } else {
            moment.options.n_near
        };
        self.cloud.select(moment.options.resampling, moment.options.ess_threshold, count, selection);
        if self.is_new && moment.factors.tracks && moment.options.used_parts().quick_start {
            self.quick_start(moment.tracks, rng(Purpose::QuickStart));
        }
        let noise = moment.options.noise(moment.scale).times(self.presence.noise());
        self.cloud.predict(&moment.camera, &noise, self.first_size, transition);
        let mut prediction = seeing.place;
        if seeing.entered_low && crate::ablation::keeps("particle.clear_place") {
            prediction = self.return_to_clear_place(moment);
        }
        if let Some(Recovery { place, velocity }) = recover(self, own, moment) {
            let [_, _, w, h] = seeing.bounds;
            let mean = [place[0], place[1], velocity[0], velocity[1], w, h];
            let start = Start { mean, noise: moment.options.noise(moment.scale), scale: moment.scale };
            self.cloud = Cloud::begin(&start, count, rng(Purpose::Start));
            self.presence.hidden = 0;
            self.estimate = mean;
            prediction = place;
        }
        let similarities = self.similarities(moment);
        let logs = self.log_likelihoods(own, moment, prediction, &similarities);
        self.degenerate = !self.cloud.weigh(&logs);
        self.effective_sample_size = self.cloud.effective_sample_size();
        self.estimate = self.cloud.mean();
        self.is_new = false;
        self.similarity = quantile(similarities, SIMILARITY_QUANTILE).unwrap_or(self.similarity);
    }

    /// The frame shows nothing: particles move on without being weighed.
    pub fn coast(&mut self, options: &ParticleOptions, scale: f64, frame: usize) {
        let rng = stream(options.random_state, self.id, frame, Purpose::Transition);
        self.presence.hide();
        let noise = options.noise(scale).times(self.presence.noise());
        self.cloud.predict(&CameraMotion::NONE, &noise, self.first_size, rng);
        self.estimate = self.cloud.mean();
        self.effective_sample_size = self.cloud.effective_sample_size();
        self.degenerate = false;
    }

    /// Half of the particles take the motion of a track in the box, drawn by the probability of foreground.
    fn quick_start(&mut self, tracks: &[Track], rng: CounterRng) {
        let bounds = self.bounds();
        let inside = |track: &&Track| {
            track.foreground > QUICK_START.1 && super::geometry::holds(bounds, track.previous(), 1.0, 0.0)
        };
        let candidates: Vec<(f64, [f64; 2])> =
            tracks.iter().filter(inside).filter_map(|track| Some((track.foreground, track.residual?))).collect();
        if candidates.len() < QUICK_START.0 {
            return;
        }
        let total: f64 = candidates.iter().map(|(p, _)| p).sum();
        for (i, particle) in self.cloud.particles.iter_mut().enumerate().step_by(2) {
            let mut left = rng.uniform(i as u64) * total;
            let chosen = candidates.iter().find(|(p, _)| {
                left -= p;
                left < 0.0
            });
            let [u, v] = chosen.unwrap_or(&candidates[candidates.len() - 1]).1;
            (particle[2], particle[3]) = (u, v);
        }
    }

    /// Returns to where the target was last clear, moved on to this frame: estimates made while the occluder
    /// came in are not reliable.
    fn return_to_clear_place(&mut self, moment: &Moment<'_>) -> [f64; 2] {
        let mean = self.cloud.mean();
        let place = self.presence.moved_on(&moment.camera);
        let usual = self.presence.velocity;
        self.cloud.shift([place[0] - mean[0], place[1] - mean[1], usual[0] - mean[2], usual[1] - mean[3]]);
        (self.estimate[2], self.estimate[3]) = (usual[0], usual[1]);
        place
    }

    /// Similarity of the colours of each particle's box; empty where colour does not count.
    fn similarities(&self, moment: &Moment<'_>) -> Vec<f64> {
        if !moment.factors.colour {
            return Vec::new();
        }
        let (low, high, size) = self.cloud.reach();
        let span = |i: usize| [low[i] - 0.5 * size[i] - 1.0, high[i] + 0.5 * size[i] + 2.0];
        let table = ColourTable::new(&self.appearance, moment.bins, span(0), span(1));
        let boxes: Vec<CentredBox> = self.cloud.particles.iter().map(|p| [p[0], p[1], p[4], p[5]]).collect();
        let mut similarities = vec![0.0; boxes.len()];
        table.similarities(&boxes, &mut similarities);
        similarities
    }

    fn log_likelihoods(&self, own: usize, moment: &Moment<'_>, prediction: [f64; 2], similarities: &[f64]) -> Vec<f64> {
        let seeing = &moment.seeing[own];
        let particles = &self.cloud.particles;
        let on = &moment.factors;
        let velocity = (on.velocity && crate::ablation::keeps("particle.velocity_factor"))
            .then(|| VelocityFactor::new(prediction, self.velocity(), moment.scale));
        if self.presence.is_hidden() {
            let factors = Factors { velocity, ..Factors::none(moment.bins.size()) };
            return factors.log_likelihoods(particles);
        }
        let gain = colour_gain(moment.options.mode)
            * (1.0 - if crate::ablation::keeps("particle.likeness") { seeing.likeness } else { 0.0 });
        let distances = seeing.near.iter().filter(|_| on.distance).map(|&other| {
            let place = moment.seeing[other].place;
            DistanceFactor { other: place, square: distance(prediction, place).powi(2) }
        });
        let tracks = on.tracks.then(|| {
            let evidence = track_evidence(&Evidence { own, target: self, prediction, moment });
            TrackFactor::new(evidence, seeing.labelled, moment.scale)
        });
        let map = moment.foreground.and_then(|map| map.at(particles, prediction));
        Factors {
            picture: moment.bins.size(),
            colour: on.colour.then_some((similarities, gain)),
            velocity,
            distance: distances.collect(),
            tracks,
            foreground: map.as_deref(),
        }
        .log_likelihoods(particles)
    }
}

/// The value that this share of some values does not exceed.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    let at = (share * values.len() as f64) as usize;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(at, f64::total_cmp).1)
}
