//! Advances one target by a frame: particles, weights, estimate.

use super::appearance::CentredBox;
use super::cloud::{Cloud, Purpose, Start, stream};
use super::colour_table::ColourTable;
use super::evidence::{Evidence, track_evidence};
use super::geometry::distance;
use super::likelihood::{DistanceFactor, Factors, TrackFactor, VelocityFactor};
use super::noise::{Noise, colour_gain};
use super::prediction::FrameContext;
use super::recovery::{Recovery, recover};
use super::target::Target;
use crate::math::quantile;

/// Quantile of the similarity over the particles that stands for the target.
const SIMILARITY_QUANTILE: f64 = 0.9;

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
        self.similarity = quantile(&mut similarities, SIMILARITY_QUANTILE).unwrap_or(self.similarity);
    }

    /// Returns to where the target was last clear, moved on to this frame: estimates made while the occluder
    /// came in are not reliable.
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
        let velocity = (on.velocity && crate::ablation::keeps("particle.velocity_factor"))
            .then(|| VelocityFactor::new(place, self.velocity(), context.scale));
        if self.presence.is_hidden() {
            let factors = Factors { velocity, ..Factors::none(context.bins.size()) };
            return factors.log_likelihoods(particles);
        }
        let gain = colour_gain(context.options.mode)
            * (1.0 - if crate::ablation::keeps("particle.likeness") { prediction.likeness } else { 0.0 });
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
