//! Logarithms of the factors of a particle's likelihood.

use super::cloud::Particle;
use crate::parallel;

/// Log-likelihood of a particle whose centre is outside the picture.
const OUTSIDE: f64 = -50.0;
/// Particles that one task weighs: fixed, so that results do not depend on the number of threads.
const TASK: usize = 256;
/// Weight of a track, since neighbouring tracks are not independent.
const TRACK_GAIN: f64 = 0.2;
/// A larger number of own tracks has the same weight, so that a box does not grow to hold more.
const FULL_TRACKS: f64 = 20.0;
/// Half sides of the part of a box whose tracks count, over its sides.
const INNER: [f64; 2] = [0.45, 0.48];
/// Standard deviation of a track's motion about its target's, px/frame in a picture of 480 rows.
const TRACK_NOISE_STD: f64 = 1.2;
/// Density of motions that belong to no target, 1/(px/frame)^2 in a picture of 480 rows.
const CLUTTER_DENSITY: f64 = 0.012;
/// Added to the foreground map, so that an empty region does not end a filter.
const FOREGROUND_FLOOR: f64 = 1e-3;

/// Near the constant-velocity prediction: `-|(x, y) - p| / (2 sigma^2)`, `sigma = |(u, v)| + 1`, lengths in
/// px of a picture of 480 rows (equations (8) and (9) of the paper).
#[derive(Debug, Clone, Copy)]
pub(super) struct VelocityFactor {
    pub prediction: [f64; 2],
    /// 1 / (2 sigma^2), per px of this picture.
    pub rate: f64,
}

impl VelocityFactor {
    pub fn new(prediction: [f64; 2], velocity: [f64; 2], scale: f64) -> Self {
        let sigma = velocity[0].hypot(velocity[1]) / scale + 1.0;
        Self { prediction, rate: 1.0 / (2.0 * sigma * sigma * scale) }
    }

    fn log(&self, [x, y, ..]: &Particle) -> f64 {
        -self.rate * (x - self.prediction[0]).hypot(y - self.prediction[1])
    }
}

/// Away from a near target's prediction: `1 - exp(-|(x, y) - p_l|^2 / (2 |p - p_l|^2))` (equation (10) of the
/// paper).
#[derive(Debug, Clone, Copy)]
pub(super) struct DistanceFactor {
    pub other: [f64; 2],
    /// `|p - p_l|^2`.
    pub square: f64,
}

impl DistanceFactor {
    fn log(&self, [x, y, ..]: &Particle) -> f64 {
        let square = (x - self.other[0]).powi(2) + (y - self.other[1]).powi(2);
        // Targets with the same prediction do not repel each other.
        if self.square > 0.0 { (-(-square / (2.0 * self.square)).exp_m1()).ln() } else { 0.0 }
    }
}

/// A corner track as evidence for one target.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrackEvidence {
    pub position: [f64; 2],
    /// Motion relative to the background, px/frame.
    pub residual: [f64; 2],
    /// Probability that it is the target's, `P_j`.
    pub probability: f64,
    /// Evidence against the target, `B_j`.
    pub penalty: f64,
}

/// Density of a track's motion given a target's velocity, 1/(px/frame)^2.
pub(super) fn motion_density(residual: [f64; 2], velocity: [f64; 2], scale: f64) -> f64 {
    let variance = (TRACK_NOISE_STD * scale).powi(2);
    motion_ratio(residual, velocity, variance) / (std::f64::consts::TAU * variance)
}

fn motion_ratio(residual: [f64; 2], velocity: [f64; 2], variance: f64) -> f64 {
    let square = (residual[0] - velocity[0]).powi(2) + (residual[1] - velocity[1]).powi(2);
    (-0.5 * square / variance).exp()
}

/// Density of motions that belong to no target, 1/(px/frame)^2.
pub(super) fn clutter_density(scale: f64) -> f64 {
    CLUTTER_DENSITY / (scale * scale)
}

/// Tracks in the box move with the particle. The logarithm is a sum over the tracks in the inner box:
/// `gain sum_j { P_j max(log(1/2 + N(r_j; (u, v)) / (2 tau)), 0) - B_j }`. A track with another motion is
/// neutral: it may lie on a swinging leg, and a box that excludes it does not explain it better.
#[derive(Debug, Clone)]
pub(super) struct TrackFactor {
    pub evidence: Vec<TrackEvidence>,
    pub scale: f64,
    /// Weight of the sum.
    pub gain: f64,
}

impl TrackFactor {
    /// The factor of some tracks, of which `own` belong to the target.
    pub fn new(evidence: Vec<TrackEvidence>, own: usize, scale: f64) -> Self {
        let own = if crate::ablation::keeps("particle.full_tracks") { own as f64 } else { 0.0 };
        let gain = TRACK_GAIN * (FULL_TRACKS / own.max(FULL_TRACKS));
        Self { evidence, scale, gain }
    }

    fn log(&self, [x, y, u, v, w, h]: &Particle) -> f64 {
        let (across, down) = (INNER[0] * w, INNER[1] * h);
        let variance = (TRACK_NOISE_STD * self.scale).powi(2);
        let peak = 0.5 / (std::f64::consts::TAU * variance * clutter_density(self.scale));
        let mut sum = 0.0;
        for track in &self.evidence {
            if (track.position[0] - x).abs() < across && (track.position[1] - y).abs() < down {
                let ratio = 0.5 + peak * motion_ratio(track.residual, [*u, *v], variance);
                sum += track.probability * ratio.ln().max(0.0) - track.penalty;
            }
        }
        self.gain * sum
    }
}

/// The factors in use for one target at one frame; what is `None` or empty does not count.
#[derive(Debug, Clone)]
pub(super) struct Factors<'a> {
    pub picture: (usize, usize),
    /// Similarity of each particle's colours, and what it is multiplied by.
    pub colour: Option<(&'a [f64], f64)>,
    pub velocity: Option<VelocityFactor>,
    pub distance: Vec<DistanceFactor>,
    pub tracks: Option<TrackFactor>,
    /// Foreground at each particle's centre.
    pub foreground: Option<&'a [f64]>,
}

pub(super) fn is_inside([x, y]: [f64; 2], (width, height): (usize, usize)) -> bool {
    x >= -0.5 && y >= -0.5 && x < width as f64 - 0.5 && y < height as f64 - 0.5
}

impl Factors<'_> {
    /// No factor but the border.
    pub fn none(picture: (usize, usize)) -> Self {
        Self { picture, colour: None, velocity: None, distance: Vec::new(), tracks: None, foreground: None }
    }

    /// Log-likelihood of each particle (equation (3) of the paper).
    pub fn log_likelihoods(&self, particles: &[Particle]) -> Vec<f64> {
        let greatest = self.foreground.map_or(0.0, |values| values.iter().copied().fold(0.0, f64::max));
        let mut logs = vec![0.0; particles.len()];
        parallel::for_each(logs.chunks_mut(TASK).enumerate(), |(task, logs)| {
            for (k, log) in logs.iter_mut().enumerate() {
                let at = task * TASK + k;
                let particle = &particles[at];
                if !is_inside([particle[0], particle[1]], self.picture) {
                    *log += OUTSIDE;
                }
                if let Some((similarity, gain)) = self.colour {
                    *log += gain * similarity[at];
                }
                if let Some(velocity) = &self.velocity {
                    *log += velocity.log(particle);
                }
                *log += self.distance.iter().map(|distance| distance.log(particle)).sum::<f64>();
                if let Some(tracks) = &self.tracks {
                    *log += tracks.log(particle);
                }
                if let Some(foreground) = self.foreground.filter(|_| greatest > 0.0) {
                    *log += (foreground[at] / greatest + FOREGROUND_FLOOR).ln();
                }
            }
        });
        logs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factors(picture: (usize, usize)) -> Factors<'static> {
        Factors::none(picture)
    }

    #[test]
    fn each_factor_has_its_formula() {
        let particle = [30.0, 40.0, 1.0, 0.5, 20.0, 40.0];
        let at = |factors: Factors<'_>| factors.log_likelihoods(&[particle])[0];
        let empty = || factors((100, 100));
        assert_eq!(at(empty()), 0.0);
        assert_eq!(at(factors((30, 100))), OUTSIDE);
        assert_eq!(at(Factors { colour: Some((&[0.25], 12.0)), ..empty() }), 3.0);
        let velocity = VelocityFactor::new([33.0, 44.0], [1.5, 2.0], 0.5);
        // 10 px at 480 rows, sigma = 5 + 1.
        assert!((at(Factors { velocity: Some(velocity), ..empty() }) + 10.0 / 72.0).abs() < 1e-12);
        let distance = vec![DistanceFactor { other: [30.0, 50.0], square: 50.0 }];
        assert!((at(Factors { distance, ..empty() }) - (1.0 - (-1.0f64).exp()).ln()).abs() < 1e-12);
        assert!((at(Factors { foreground: Some(&[0.3]), ..empty() }) - 1.001f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn tracks_count_inside_the_inner_box_by_their_motion() {
        let particle = [30.0, 40.0, 1.0, 0.5, 20.0, 40.0];
        let one = |position, residual| {
            let evidence = vec![TrackEvidence { position, residual, probability: 0.5, penalty: 0.1 }];
            let factors =
                Factors { tracks: Some(TrackFactor { evidence, scale: 0.5, gain: 0.2 }), ..factors((100, 100)) };
            factors.log_likelihoods(&[particle])[0]
        };
        let ratio = motion_density([1.0, 0.5], [1.0, 0.5], 0.5) / clutter_density(0.5);
        let want = 0.2 * (0.5 * (0.5 + 0.5 * ratio).ln() - 0.1);
        assert!((one([33.0, 50.0], [1.0, 0.5]) - want).abs() < 1e-12);
        assert!((one([33.0, 50.0], [4.0, 0.5]) + 0.02).abs() < 1e-12);
        assert_eq!(one([39.5, 50.0], [1.0, 0.5]), 0.0);
    }
}
