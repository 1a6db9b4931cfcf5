//! Tracks, graph and result of a step.

use super::super::association::{Recognition, Sighting};
use super::super::clusters::Clusters;
use super::super::graph::{Arc, Node};
use super::super::options::{ARC_THRESHOLD, MIN_COMPONENT_PIXELS};
use super::super::step::Step;
use super::StereoTracker;
use crate::error::Result;
use crate::math::median;
use crate::mixture::Posterior;

/// Variance of a uniform distribution of width 1.
const EVEN: f64 = 1.0 / 12.0;

/// Motion of a cluster since the last step.
pub(super) struct Arrival {
    /// Motion since the last step, px and disparity.
    pub motion: Option<[f64; 3]>,
    pub affine: Option<[f64; 6]>,
    pub residual: Option<f64>,
    pub coasting: bool,
}

/// Motion of a cluster of the last step to this one.
#[derive(Clone, Copy)]
pub(super) struct Departure {
    /// Motion to this step, px and disparity.
    pub motion: [f64; 3],
    pub affine: Option<[f64; 6]>,
}

impl Arrival {
    pub const UNKNOWN: Self = Self { motion: None, affine: None, residual: None, coasting: false };
}
impl StereoTracker {
    /// Paper mode: a cluster continues the track of another if each is the other's strongest arc, with a
    /// sufficient score.
    pub(super) fn associate_by_arcs(&mut self, clusters: &Clusters, arcs: &[Arc]) {
        let components = clusters.components();
        let before = std::mem::take(&mut self.association.live);
        let mut live = vec![None; components];
        let strongest = |of: &dyn Fn(&&Arc) -> bool| {
            arcs.iter().filter(of).fold(None, |best: Option<&Arc>, arc| match best {
                Some(best) if best.score() >= arc.score() => Some(best),
                _ => Some(arc),
            })
        };
        for (k, slot) in live.iter_mut().enumerate() {
            let Some(arc) = strongest(&|arc| arc.to == k) else { continue };
            let mutual = strongest(&|other| other.from == arc.from).is_some_and(|other| other.to == k);
            if mutual && arc.score() >= ARC_THRESHOLD {
                *slot = before.get(arc.from).cloned().flatten();
            }
        }
        self.association.live = live;
        let seen = sightings(clusters, |_| ([0.0; 3], [0.0; 2]));
        self.association.associate(self.clock, &seen, 0.0, None);
    }

    /// Improved mode: a component keeps its track until it is empty or `lost`.
    pub(super) fn associate_components(&mut self, clusters: &Clusters, lost: &[bool]) {
        let lost = |k: usize| lost.get(k).is_none_or(|lost| *lost) || clusters.pixels[k].is_empty();
        self.association.set_lost(self.clock.before(), lost);
        self.association.live.resize(clusters.components(), None);
        let seen = sightings(clusters, |k| middle_and_deviation(clusters, k));
        self.association.associate(self.clock, &seen, MIN_COMPONENT_PIXELS, Some(&Recognition::default()));
    }

    /// Adds the clusters to graph and tracks, and assembles the step from how each arrived and its middle,
    /// px.
    pub(super) fn record(
        &mut self,
        clusters: &Clusters,
        posterior: Option<&Posterior>,
        rounds: usize,
        (arrivals, middles): (&[Arrival], &[[f64; 2]]),
        grouped: &[usize],
    ) -> Step {
        let lattice = *clusters.lattice();
        let track = |k: usize| self.association.live.get(k).and_then(Option::as_ref).map_or(0, |track| track.id);
        // A group has the number of its oldest track.
        let mut names = vec![u64::MAX; clusters.components()];
        for (k, &group) in grouped.iter().enumerate().filter(|(k, _)| !clusters.pixels[*k].is_empty()) {
            names[group] = names[group].min(track(k));
        }
        let mut nodes = Vec::new();
        for (k, arrival) in arrivals.iter().enumerate() {
            let (Some(posterior), false) = (posterior, clusters.pixels[k].is_empty()) else { continue };
            let mean = mean(clusters, posterior, k);
            let (depth, metric_velocity) = self.metric(mean, arrival.motion, lattice.size);
            nodes.push(Node {
                time: self.time,
                index: k,
                track_id: track(k),
                group: names[grouped[k]],
                n_pixels: clusters.pixels[k].len(),
                weight: posterior.weight_concentration[k] / posterior.weight_concentration.iter().sum::<f64>(),
                mean,
                covariance: covariance(posterior, k, lattice.cell()),
                velocity: arrival.motion.map(|motion| self.clock.velocity(motion)),
                next_velocity: None,
                middle: middles[k],
                affine: arrival.affine.map(|affine| self.clock.velocity(affine)),
                next_affine: None,
                residual: arrival.residual,
                coasting: arrival.coasting,
                depth,
                metric_velocity,
            });
        }
        for node in &nodes {
            self.graph.insert(node.clone());
            let track = self.tracks.entry(node.track_id).or_default();
            track.times.push(self.time);
            track.clock.push(self.clock.elapsed());
            track.positions.push(node.mean);
            track.velocities.push(node.velocity.unwrap_or([f64::NAN; 3]));
        }
        Step {
            time: self.time,
            clock: self.clock.elapsed(),
            clusters: nodes,
            rows: clusters.points.rows.clone(),
            columns: clusters.points.columns.clone(),
            disparities: clusters.points.disparities.clone(),
            labels: clusters.of_point.clone(),
            left_out: 0,
            row_offset: None,
            rows_doubtful: false,
            rounds,
        }
    }

    /// Depth and velocity in units of the baseline, where the cameras are known.
    fn metric(
        &self,
        mean: [f64; 3],
        motion: Option<[f64; 3]>,
        (width, height): (usize, usize),
    ) -> (Option<f64>, Option<[f64; 3]>) {
        let Some(camera) = self.options.camera else { return (None, None) };
        let middle = [0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0)];
        let speed = motion.map(|motion| {
            let before = camera.place(std::array::from_fn(|i| mean[i] - motion[i]), middle);
            let now = camera.place(mean, middle);
            self.clock.velocity(std::array::from_fn(|i| now[i] - before[i]))
        });
        let finite = |speed: &[f64; 3]| speed.iter().all(|value| value.is_finite());
        (Some(camera.depth(mean[2])).filter(|depth| depth.is_finite()), speed.filter(finite))
    }

    /// Adds arcs between the last step and this one, and the motions of the last step's clusters.
    pub(super) fn connect(&mut self, departures: &[Option<Departure>], arcs: Vec<Arc>) -> Result<()> {
        if let Some(before) = self.time.checked_sub(1) {
            for (k, &departure) in departures.iter().enumerate() {
                if let Some(node) = self.graph.node_mut(before, k) {
                    node.next_velocity = departure.map(|departure| self.clock.velocity(departure.motion));
                    let affine = departure.and_then(|departure| departure.affine);
                    node.next_affine = affine.map(|affine| self.clock.velocity(affine));
                }
            }
        }
        arcs.into_iter().try_for_each(|arc| self.graph.connect(arc))
    }
}

/// All components that have edge pixels; `place`: position and spread of each, cells.
fn sightings(clusters: &Clusters, place: impl Fn(usize) -> ([f64; 3], [f64; 2])) -> Vec<Sighting> {
    let pixels = clusters.pixels.iter().map(Vec::len).enumerate().filter(|(_, pixels)| *pixels > 0);
    let sighting = |(component, pixels)| {
        let (position, spread) = place(component);
        Sighting { component, position, pixels, spread }
    };
    pixels.map(sighting).collect()
}

/// Medians of a cluster's pixels along x, y and depth, and their median absolute deviations along x and y,
/// cells and layers.
fn middle_and_deviation(clusters: &Clusters, k: usize) -> ([f64; 3], [f64; 2]) {
    let places: Vec<[f64; 3]> =
        clusters.pixels[k].iter().map(|&i| clusters.lattice().cells_of(clusters.points.at(i as usize))).collect();
    let median = |along: &mut dyn Iterator<Item = f64>| median(&mut along.collect::<Vec<_>>()).unwrap_or(f64::NAN);
    let middle: [f64; 3] = std::array::from_fn(|i| median(&mut places.iter().map(|place| place[i])));
    let off = |i: usize| median(&mut places.iter().map(|place| (place[i] - middle[i]).abs()));
    (middle, std::array::from_fn(off))
}

/// Mean of a component along x and y, px, and the median disparity of its pixels, which layers do not
/// quantise.
fn mean(clusters: &Clusters, posterior: &Posterior, k: usize) -> [f64; 3] {
    let [x, y, d] = clusters.lattice().pixels_of(std::array::from_fn(|i| posterior.means[3 * k + i]));
    [x, y, clusters.disparity(k).unwrap_or(d)]
}

/// Covariance `W_k^-1 / nu_k` of a component in px and disparity, with the quantisation variance of a cell.
fn covariance(posterior: &Posterior, k: usize, cell: [f64; 3]) -> [[f64; 3]; 3] {
    let matrix = &posterior.scale_inverses[9 * k..9 * k + 9];
    let nu = posterior.degrees_of_freedom[k];
    let within = |i: usize, j: usize| if i == j { EVEN } else { 0.0 };
    std::array::from_fn(|i| std::array::from_fn(|j| (matrix[3 * i + j] / nu + within(i, j)) * cell[i] * cell[j]))
}
