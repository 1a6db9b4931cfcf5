//! Advances one target by a frame: particles, weights, estimate.

use super::cloud::{Cloud, Purpose, Start, stream};
use super::colour_table::ColourTable;
use super::corners::Track;
use super::evidence::{Evidence, track_evidence};
use super::geometry::{CentredBox, distance, holds};
use super::likelihood::{DistanceFactor, Factors, TrackFactor, VelocityFactor};
use super::noise::{Noise, colour_gain};
use super::prediction::FrameContext;
use super::recovery::{Recovery, recover};
use super::target::Target;
use crate::math::{quantile, random::CounterRng};

/// Quantile of the similarity over the particles that stands for the target.
const SIMILARITY_QUANTILE: f64 = 0.9;
/// Tracks that a quick start needs, and the probability of not being background above which they count.
const QUICK_START: (usize, f64) = (3, 0.5);

impl Target {
    /// Selection, prediction, weights and estimate of one frame. `own`: index of the target in the context.
    pub fn advance(&mut self, own: usize, context: &FrameContext<'_>) {
        let prediction = &context.predictions[own];
        let id = self.id;
        let rng = |purpose| stream(context.options.random_state, id, context.frame, purpose);
        let (selection, transition) = (rng(Purpose::Selection), rng(Purpose::Transition));
        let count = if prediction.near.is_empty() || !crate::ablation::keeps("particle.near_particles") {
            context.options.n_particles
        } else {
            context.options.n_near
        };
        self.cloud.select(context.options.resampling, context.options.ess_threshold, count, selection);
        if self.is_new && context.factors.tracks && context.options.uses("particle.quick_start") {
            self.quick_start(context.tracks, rng(Purpose::QuickStart));
        }
        let noise = Noise::of_options(context.options, context.scale).times(self.presence.noise());
        self.cloud.predict(&context.camera, &noise, self.first_size, transition);
        let mut place = prediction.place;
        if prediction.entered_low && crate::ablation::keeps("particle.clear_place") {
            place = self.return_to_clear_place(context);
        }
        if let Some(found) = recover(self, own, context) {
            let [_, _, w, h] = prediction.bounds;
            let Recovery { place: [x, y], velocity: [u, v] } = found;
            let mean = [x, y, u, v, w, h];
            let start = Start { mean, noise: Noise::of_options(context.options, context.scale), scale: context.scale };
            self.cloud = Cloud::begin(&start, count, rng(Purpose::Start));
            self.presence.show();
            self.estimate = mean;
            place = found.place;
        }
        let mut similarities = self.similarities(context);
        let logs = self.log_likelihoods(own, context, place, &similarities);
        self.degenerate = !self.cloud.weigh(&logs);
        self.effective_sample_size = self.cloud.effective_sample_size();
        self.estimate = self.cloud.mean();
        self.is_new = false;
        self.similarity = quantile(&mut similarities, SIMILARITY_QUANTILE).unwrap_or(self.similarity);
    }

    /// Half of the particles take the motion of a track in the box: fast targets would be lost at the start.
    fn quick_start(&mut self, tracks: &[Track], rng: CounterRng) {
        let bounds = self.bounds();
        let inside = |track: &&Track| track.foreground > QUICK_START.1 && holds(bounds, track.previous(), 1.0, 0.0);
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

    /// Returns to the last clear place, moved on to this frame: estimates near the occluder are unreliable.
    fn return_to_clear_place(&mut self, context: &FrameContext<'_>) -> [f64; 2] {
        let mean = self.cloud.mean();
        let place = self.presence.moved_on(&context.camera);
        let usual = self.presence.velocity;
        self.cloud.shift([place[0] - mean[0], place[1] - mean[1], usual[0] - mean[2], usual[1] - mean[3]]);
        (self.estimate[2], self.estimate[3]) = (usual[0], usual[1]);
        place
    }

    /// Similarity of the colours of each particle's box; empty where colour does not count.
    fn similarities(&self, context: &FrameContext<'_>) -> Vec<f64> {
        if !context.factors.colour {
            return Vec::new();
        }
        let (low, high, size) = self.cloud.reach();
        let span = |i: usize| [low[i] - 0.5 * size[i] - 1.0, high[i] + 0.5 * size[i] + 2.0];
        let table = ColourTable::new(&self.appearance, context.bins, span(0), span(1));
        let boxes: Vec<CentredBox> = self.cloud.particles.iter().map(|p| [p[0], p[1], p[4], p[5]]).collect();
        let mut similarities = vec![0.0; boxes.len()];
        table.similarities(&boxes, &mut similarities);
        similarities
    }

    fn log_likelihoods(
        &self,
        own: usize,
        context: &FrameContext<'_>,
        place: [f64; 2],
        similarities: &[f64],
    ) -> Vec<f64> {
        let prediction = &context.predictions[own];
        let particles = &self.cloud.particles;
        let on = &context.factors;
        let velocity = on.velocity.then(|| VelocityFactor::new(place, self.velocity(), context.scale));
        if self.presence.is_hidden() {
            let factors = Factors { velocity, ..Factors::none(context.bins.size()) };
            return factors.log_likelihoods(particles);
        }
        let gain = colour_gain(context.options.mode) * (1.0 - prediction.likeness);
        let distances = prediction.near.iter().filter(|_| on.distance).map(|&other| {
            let other = context.predictions[other].place;
            DistanceFactor { other, square: distance(place, other).powi(2) }
        });
        let tracks = on.tracks.then(|| {
            let evidence = track_evidence(&Evidence { own, target: self, place, context });
            TrackFactor::new(evidence, prediction.labelled, context.scale)
        });
        let map = context.foreground.and_then(|map| map.at(particles, place));
        Factors {
            picture: context.bins.size(),
            colour: on.colour.then_some((similarities, gain)),
            velocity,
            distance: distances.collect(),
            tracks,
            foreground: map.as_deref(),
        }
        .log_likelihoods(particles)
    }
}
