//! The stereo tracker, step by step.

use super::cell_luminance::CellLuminance;
use super::clusters::Clusters;
use super::graph::{Arc, Node, TrackGraph};
use super::grouping::{GroupMotion, groups};
use super::identity::{Carried, Identities, Sighting};
use super::lucas_kanade::{SmoothedLevels, middle};
use super::motion::{CellMotion, FineMotion, NextView, Seen, cell_motions, fine_motions, places};
use super::options::{StereoMode, StereoTrackerOptions};
use super::overlap::{Row, moved_overlaps};
use super::step::{Step, Track};
use super::voxels::{EdgePoints, Lattice, Voxels};
use super::warm_start::{moved, reseed};
use crate::error::{Error, Result};
use crate::mixture::{CovariancePrior, MixtureOptions, Points, Posterior, Start, fit};
use crate::stereo::{EdgeDisparity, EdgeDisparityOptions, Method, edge_disparity};
use crate::types::Frame;
use std::collections::BTreeMap;

/// Follows everything that moves before a pair of cameras, which may move too.
///
/// It is deterministic: the same steps give the same result, bit for bit, on any number of threads. Memory grows with the graph only.
#[derive(Debug)]
pub struct StereoTracker {
    options: StereoTrackerOptions,
    lattice: Option<Lattice>,
    time: usize,
    /// Offset of the right view's rows, px, once it is known.
    row_offset: Option<f64>,
    last: Option<Seen>,
    posterior: Option<Posterior>,
    identities: Identities,
    graph: TrackGraph,
    tracks: BTreeMap<u64, Track>,
}

/// What clustering gave.
struct Clustered {
    clusters: Clusters,
    posterior: Option<Posterior>,
    rounds: usize,
}

/// What is known of how each cluster came to a step.
struct Arrival {
    /// Motion since the last step, px and disparity.
    velocity: Option<[f64; 3]>,
    affine: Option<[f64; 6]>,
    residual: Option<f64>,
    coasting: bool,
}

/// How a cluster of the last step goes on.
#[derive(Clone, Copy)]
struct Departure {
    /// Motion to this step, px and disparity.
    velocity: [f64; 3],
    affine: Option<[f64; 6]>,
}

impl Arrival {
    const UNKNOWN: Self = Self { velocity: None, affine: None, residual: None, coasting: false };
}

impl StereoTracker {
    /// A tracker that has seen nothing yet.
    ///
    /// # Errors
    /// [`Error::Argument`] naming an option out of range.
    pub fn new(options: StereoTrackerOptions) -> Result<Self> {
        options.check()?;
        Ok(Self {
            row_offset: options.row_offset,
            options,
            lattice: None,
            time: 0,
            last: None,
            posterior: None,
            identities: Identities::default(),
            graph: TrackGraph::default(),
            tracks: BTreeMap::new(),
        })
    }

    /// The options.
    pub fn options(&self) -> &StereoTrackerOptions {
        &self.options
    }

    /// Steps taken.
    pub fn steps(&self) -> usize {
        self.time
    }

    /// Clusters of all steps and their arcs.
    pub fn graph(&self) -> &TrackGraph {
        &self.graph
    }

    /// Tracks by their ids.
    pub fn tracks(&self) -> &BTreeMap<u64, Track> {
        &self.tracks
    }

    /// The next step from both views, grey levels 0 to 255.
    ///
    /// # Errors
    /// [`Error::Argument`] for views of different size, of less than 17 px or of another size than before (`left`, with both shapes), and for options of the matching out of range.
    pub fn update(&mut self, left: &Frame<f32>, right: &Frame<f32>) -> Result<Step> {
        self.check(left, &EdgePoints::default())?;
        let [least, greatest] = self.options.disparity_range;
        let [first_row, last_row] = self.options.row_range;
        let matching = EdgeDisparityOptions {
            method: self.options.matching,
            disparity_range: (least, greatest),
            row_range: (first_row, last_row),
            row_offset: self.row_offset,
            threads: self.options.threads,
            ..EdgeDisparityOptions::default()
        };
        let found = edge_disparity(left, right, &matching)?;
        if self.options.matching == Method::SemiGlobal && !found.values.is_empty() {
            self.row_offset = Some(found.row_offset);
        }
        let EdgeDisparity { rows, columns, values: disparities, .. } = found;
        self.update_edges(left, EdgePoints { columns, rows, disparities })
    }

    /// The next step from the left view (grey levels, 0 to 255) and the disparities of its edge pixels. No edge pixels give a step without clusters.
    ///
    /// # Errors
    /// [`Error::Argument`] named `left` for a view of another size than before, `points` for pixels outside of it, disparities that are not finite or lists of different length.
    pub fn update_edges(&mut self, left: &Frame<f32>, points: EdgePoints) -> Result<Step> {
        let lattice = self.check(left, &points)?;
        self.options.threads.check()?.install(|| self.advance(left, points, lattice))
    }

    fn check(&self, left: &Frame<f32>, points: &EdgePoints) -> Result<Lattice> {
        let told = |(width, height): (usize, usize)| format!("({height}, {width})");
        let lattice = Lattice { grid: self.options.grid, size: left.size() };
        if let Some(known) = self.lattice.filter(|known| known.size != lattice.size) {
            let expected = format!("a view as large as before, {}", told(known.size));
            return Err(Error::argument("left", expected, told(lattice.size)));
        }
        if left.data().is_empty() {
            return Err(Error::argument("left", "a view (H, W) with pixels", told(lattice.size)));
        }
        let count = points.len();
        if points.rows.len() != count || points.columns.len() != count {
            let got = format!("{} rows, {} columns, {count}", points.rows.len(), points.columns.len());
            return Err(Error::argument("points", "as many rows and columns as disparities", got));
        }
        let usable = |i: &usize| {
            points.disparities[*i].is_finite()
                && (points.columns[*i] as usize) < left.width()
                && (points.rows[*i] as usize) < left.height()
        };
        match (0..count).find(|i| !usable(i)) {
            Some(i) => {
                let expected = format!("pixels of the view {} with a finite disparity", told(lattice.size));
                Err(Error::argument("points", expected, format!("{:?}", points.at(i))))
            }
            None => Ok(lattice),
        }
    }

    fn advance(&mut self, left: &Frame<f32>, points: EdgePoints, lattice: Lattice) -> Result<Step> {
        let voxels = Voxels::count(&points, lattice);
        let luminance = CellLuminance::new(left, &lattice, self.options.luminance_levels);
        let (step, seen, posterior) = match self.options.mode {
            StereoMode::Paper => self.advance_as_printed(points, voxels, luminance)?,
            StereoMode::Improved => self.advance_carried(left, points, voxels, luminance)?,
        };
        self.lattice = Some(lattice);
        self.last = Some(seen);
        self.posterior = posterior;
        self.time += 1;
        Ok(step)
    }

    /// The paper's step: a new mixture, matching and overlaps forwards and backwards (sections 2.5 to 2.8).
    fn advance_as_printed(
        &mut self,
        points: EdgePoints,
        voxels: Voxels,
        luminance: CellLuminance,
    ) -> Result<(Step, Seen, Option<Posterior>)> {
        let Clustered { clusters, posterior, rounds } = self.cluster(points, voxels, None)?;
        let seen = Seen { clusters, luminance, levels: None };
        let cell = seen.clusters.lattice().cell();
        let velocity =
            |motion: &CellMotion, sign: f64| std::array::from_fn(|i| sign * f64::from(motion.shift[i]) * cell[i]);
        let (forward, backward) = match &self.last {
            Some(last) => (cell_motions(last, &seen, &self.options), cell_motions(&seen, last, &self.options)),
            None => (vec![], vec![]),
        };
        let level = 256.0 / self.options.luminance_levels as f64;
        let arrivals = (0..seen.clusters.components()).map(|k| {
            let motion = backward.get(k).and_then(Option::as_ref);
            Arrival {
                velocity: motion.map(|motion| velocity(motion, -1.0)),
                residual: motion.map(|motion| motion.difference * level),
                ..Arrival::UNKNOWN
            }
        });
        let arrivals: Vec<Arrival> = arrivals.collect();
        let rows = |motions: Vec<Option<CellMotion>>| -> Vec<Row> {
            motions.into_iter().map(|motion| motion.map_or_else(Vec::new, |motion| motion.overlaps)).collect()
        };
        let departures: Vec<_> = forward
            .iter()
            .map(|motion| motion.as_ref().map(|motion| Departure { velocity: velocity(motion, 1.0), affine: None }))
            .collect();
        let arcs = arcs(self.time, &rows(forward), &rows(backward));
        self.name_by_arcs(&seen.clusters, &arcs);
        let grouped: Vec<usize> = (0..seen.clusters.components()).collect();
        let step = self.record(&seen.clusters, posterior.as_ref(), rounds, &arrivals, &grouped);
        self.connect(&departures, arcs)?;
        Ok((step, seen, posterior))
    }

    /// The improved step: motion first, the components carried along, then the rounds (sections 6.4 to 6.7).
    fn advance_carried(
        &mut self,
        left: &Frame<f32>,
        points: EdgePoints,
        voxels: Voxels,
        luminance: CellLuminance,
    ) -> Result<(Step, Seen, Option<Posterior>)> {
        let levels = SmoothedLevels::new(left);
        let mut map = Frame::filled(left.width(), left.height(), f32::NAN);
        for i in 0..points.len() {
            map.row_mut(points.rows[i] as usize)[points.columns[i] as usize] = points.disparities[i];
        }
        let view = NextView { luminance: &luminance, levels: &levels, disparity: &map };
        let motions = self.carry(view);
        let last = self.last.take();
        let carried: Vec<Option<[f64; 3]>> =
            motions.iter().map(|motion| motion.map(|(_, Carried { motion, .. })| motion)).collect();
        let start = self.posterior.as_ref().map(|posterior| moved(posterior, &carried));
        let (clustered, seeded) = self.cluster_carried(points, voxels, start)?;
        let Clustered { clusters, posterior, rounds } = clustered;
        let components = clusters.components();
        let own = |k: usize| motions.get(k).copied().flatten().filter(|_| !seeded.get(k).is_some_and(|seeded| *seeded));
        let (forward, backward) = match &last {
            Some(last) => both_ways(&last.clusters, &clusters, &motions, own),
            None => (vec![], vec![]),
        };
        let overlap = |k: usize| forward.get(k).and_then(|row: &Row| row.get(k)).copied().unwrap_or(0.0);
        self.name_by_components(&clusters, posterior.as_ref(), &seeded, overlap);
        let arrivals: Vec<Arrival> = (0..components)
            .map(|k| match own(k) {
                Some((motion, Carried { coasting, .. })) => Arrival {
                    velocity: Some(motion.velocity()),
                    affine: Some(motion.affine_after(middle(&places(&clusters, k)))),
                    residual: Some(motion.plane.residual).filter(|residual| residual.is_finite()),
                    coasting,
                },
                None => Arrival::UNKNOWN,
            })
            .collect();
        let grouped = match &self.options.grouping {
            Some(limits) => {
                let motions: Vec<_> = (0..components)
                    .map(|k| {
                        own(k).map(|(motion, _)| {
                            let (flow, [x, y]) = (motion.plane.flow, motion.plane.centre);
                            // The motion belongs to where the pixels were; the cluster is where they went.
                            GroupMotion {
                                affine: flow.to_array(),
                                centre: [x + flow.u, y + flow.v],
                                depth: motion.depth,
                            }
                        })
                    })
                    .collect();
                groups(&clusters, &motions, limits)
            }
            None => (0..components).collect(),
        };
        let step = self.record(&clusters, posterior.as_ref(), rounds, &arrivals, &grouped);
        let departures: Vec<_> = motions
            .iter()
            .map(|motion| {
                motion.map(|(motion, _)| Departure {
                    velocity: motion.velocity(),
                    affine: Some(motion.plane.flow.to_array()),
                })
            })
            .collect();
        let arcs = arcs(self.time, &forward, &backward);
        self.connect(&departures, arcs)?;
        Ok((step, Seen { clusters, luminance, levels: Some(levels) }, posterior))
    }

    /// How each cluster of the last step gets to the next view.
    fn carry(&mut self, view: NextView<'_>) -> Vec<Option<(FineMotion, Carried)>> {
        let Some(last) = &self.last else { return vec![] };
        let cell = last.clusters.lattice().cell();
        let before: Vec<Option<[f64; 3]>> = (0..last.clusters.components())
            .map(|k| {
                let identity = self.identities.live.get(k)?.as_ref()?;
                identity.velocity.map(|velocity| std::array::from_fn(|i| velocity[i] * cell[i]))
            })
            .collect();
        let measured = fine_motions(last, view, &before, &self.options);
        let limits = self.options.recognition.as_ref();
        let mut out = Vec::with_capacity(measured.len());
        for (k, measured) in measured.into_iter().enumerate() {
            if last.clusters.pixels[k].is_empty() {
                out.push(None);
                continue;
            }
            let in_cells = measured.map(|m| std::array::from_fn(|i| m.velocity()[i] / cell[i]));
            let carried = self.identities.carry(k, in_cells, cell, limits);
            out.push(carried.and_then(|carried| {
                let motion = if carried.coasting {
                    let velocity = std::array::from_fn(|i| carried.motion[i] * cell[i]);
                    FineMotion::translation(velocity, middle(&places(&last.clusters, k)))
                } else {
                    measured?
                };
                Some((motion, carried))
            }));
        }
        out
    }

    /// Clusters voxels from where the components were carried to; which of them were seeded anew.
    fn cluster_carried(
        &self,
        points: EdgePoints,
        voxels: Voxels,
        start: Option<Posterior>,
    ) -> Result<(Clustered, Vec<bool>)> {
        let Some(mut start) = start.filter(|_| !voxels.is_empty()) else {
            return Ok((self.cluster(points, voxels, None)?, vec![]));
        };
        let (values, weights) = (voxels.centres(), voxels.weights());
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let seeded = reseed(&mut start, &voxels, &weighted, &self.options)?;
        Ok((self.cluster(points, voxels, Some(start))?, seeded))
    }

    /// Fits the mixture to the voxels, from seeds or from components, and gives each voxel to one.
    fn cluster(&self, points: EdgePoints, voxels: Voxels, start: Option<Posterior>) -> Result<Clustered> {
        if voxels.is_empty() {
            return Ok(Clustered { clusters: Clusters::new(points, voxels, &[], 0), posterior: None, rounds: 0 });
        }
        let options = MixtureOptions {
            components: self.options.components,
            weight_concentration_prior: self.options.weight_concentration_prior,
            mean_precision_prior: self.options.mean_precision_prior,
            mean_prior: None,
            degrees_of_freedom_prior: Some(self.options.degrees_of_freedom_prior),
            covariance_prior: CovariancePrior::Isotropic(self.options.covariance_prior),
            max_iter: if start.is_some() { self.options.warm_max_iter } else { self.options.max_iter },
            tol: self.options.tol,
            n_init: self.options.n_init,
            // Components that are carried along must keep their numbers.
            prune_weight: if start.is_some() { 0.0 } else { self.options.prune_weight },
            seed: self.options.seed.wrapping_add(self.time as u64),
            threads: self.options.threads,
            ..MixtureOptions::default()
        };
        let (values, weights) = (voxels.centres(), voxels.weights());
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let fitted = fit(&weighted, &options, start.as_ref().map_or(Start::Seeds, Start::Components))?;
        let labels = fitted.posterior.labels(&weighted)?;
        let clusters = Clusters::new(points, voxels, &labels, fitted.posterior.components());
        Ok(Clustered { clusters, rounds: fitted.lower_bounds.len(), posterior: Some(fitted.posterior) })
    }

    /// Tracks of the paper's mode: a cluster goes on the track of another if each is the other's strongest arc, and that is strong enough.
    fn name_by_arcs(&mut self, clusters: &Clusters, arcs: &[Arc]) {
        let components = clusters.components();
        let before = std::mem::take(&mut self.identities.live);
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
            if mutual && arc.score() >= self.options.arc_threshold {
                *slot = before.get(arc.from).cloned().flatten();
            }
        }
        self.identities.live = live;
        let seen = sightings(clusters, |_| [0.0; 3]);
        self.identities.name_all(self.time, &seen, 0.0, None);
    }

    /// Tracks of the improved mode: a component is its track, as long as it covers its moved self.
    fn name_by_components(
        &mut self,
        clusters: &Clusters,
        posterior: Option<&Posterior>,
        seeded: &[bool],
        overlap: impl Fn(usize) -> f64,
    ) {
        let limits = self.options.recognition.as_ref();
        let least = limits.map_or(0.0, |limits| limits.least_overlap);
        let lost = |k: usize| {
            let empty = clusters.pixels.get(k).is_none_or(Vec::is_empty);
            empty || seeded.is_empty() || seeded[k] || overlap(k) < least
        };
        self.identities.rest(self.time.saturating_sub(1), lost);
        self.identities.live.resize(clusters.components(), None);
        let Some(posterior) = posterior else { return };
        let seen = sightings(clusters, |k| std::array::from_fn(|i| posterior.means[3 * k + i]));
        self.identities.name_all(self.time, &seen, self.options.reseed_below, limits);
    }

    /// Puts the clusters into the graph and the tracks, and tells of them.
    fn record(
        &mut self,
        clusters: &Clusters,
        posterior: Option<&Posterior>,
        rounds: usize,
        arrivals: &[Arrival],
        grouped: &[usize],
    ) -> Step {
        let lattice = *clusters.lattice();
        let track = |k: usize| self.identities.live.get(k).and_then(Option::as_ref).map_or(0, |identity| identity.id);
        // A group is called after its oldest track.
        let mut names = vec![u64::MAX; clusters.components()];
        for (k, &group) in grouped.iter().enumerate().filter(|(k, _)| !clusters.pixels[*k].is_empty()) {
            names[group] = names[group].min(track(k));
        }
        let mut nodes = Vec::new();
        for (k, arrival) in arrivals.iter().enumerate() {
            let (Some(posterior), false) = (posterior, clusters.pixels[k].is_empty()) else { continue };
            let mean = lattice.from_cells(std::array::from_fn(|i| posterior.means[3 * k + i]));
            let (depth, metric_velocity) = self.metric(mean, arrival.velocity, lattice.size);
            nodes.push(Node {
                time: self.time,
                index: k,
                track_id: track(k),
                group: names[grouped[k]],
                n_pixels: clusters.pixels[k].len(),
                weight: posterior.weight_concentration[k] / posterior.weight_concentration.iter().sum::<f64>(),
                mean,
                covariance: covariance(posterior, k, lattice.cell()),
                velocity: arrival.velocity,
                next_velocity: None,
                middle: middle(&places(clusters, k)),
                affine: arrival.affine,
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
            track.positions.push(node.mean);
            track.velocities.push(node.velocity.unwrap_or([f64::NAN; 3]));
        }
        Step {
            time: self.time,
            clusters: nodes,
            rows: clusters.points.rows.clone(),
            columns: clusters.points.columns.clone(),
            disparities: clusters.points.disparities.clone(),
            labels: clusters.of_point.clone(),
            rounds,
        }
    }

    /// Depth and velocity in units of the baseline, where the cameras are known.
    fn metric(
        &self,
        mean: [f64; 3],
        velocity: Option<[f64; 3]>,
        (width, height): (usize, usize),
    ) -> (Option<f64>, Option<[f64; 3]>) {
        let Some(camera) = self.options.camera else { return (None, None) };
        let middle = [0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0)];
        let speed = velocity.map(|velocity| {
            let before = camera.place(std::array::from_fn(|i| mean[i] - velocity[i]), middle);
            let now = camera.place(mean, middle);
            std::array::from_fn(|i| now[i] - before[i])
        });
        let finite = |speed: &[f64; 3]| speed.iter().all(|value| value.is_finite());
        (Some(camera.depth(mean[2])).filter(|depth| depth.is_finite()), speed.filter(finite))
    }

    /// Puts arcs between the last step and this one into the graph, and tells the last one's clusters where they went.
    fn connect(&mut self, departures: &[Option<Departure>], arcs: Vec<Arc>) -> Result<()> {
        if let Some(before) = self.time.checked_sub(1) {
            for (k, &departure) in departures.iter().enumerate() {
                if let Some(node) = self.graph.node_mut(before, k) {
                    node.next_velocity = departure.map(|departure| departure.velocity);
                    node.next_affine = departure.and_then(|departure| departure.affine);
                }
            }
        }
        arcs.into_iter().try_for_each(|arc| self.graph.connect(arc))
    }
}

/// All components that have edge pixels.
fn sightings(clusters: &Clusters, position: impl Fn(usize) -> [f64; 3]) -> Vec<Sighting> {
    let pixels = clusters.pixels.iter().map(Vec::len).enumerate().filter(|(_, pixels)| *pixels > 0);
    pixels.map(|(component, pixels)| Sighting { component, position: position(component), pixels }).collect()
}

/// Overlaps of moved clusters forwards, and backwards by the same motions: a cluster's own or, where it has none, that of the cluster which covers it most.
fn both_ways(
    before: &Clusters,
    after: &Clusters,
    motions: &[Option<(FineMotion, Carried)>],
    own: impl Fn(usize) -> Option<(FineMotion, Carried)>,
) -> (Vec<Row>, Vec<Row>) {
    let forward: Vec<Row> = (0..before.components())
        .map(|k| match motions[k] {
            Some((motion, _)) => moved_overlaps(before, k, after, |i| motion.moved(before.points.at(i))),
            None => vec![0.0; after.components()],
        })
        .collect();
    let backward = (0..after.components())
        .map(|k| {
            let covering = (0..before.components())
                .filter(|&j| forward[j][k] > 0.0)
                .max_by(|&i, &j| forward[i][k].total_cmp(&forward[j][k]).then(j.cmp(&i)));
            let motion = own(k).or_else(|| covering.and_then(|j| motions[j]));
            match motion {
                Some((motion, _)) => moved_overlaps(after, k, before, |i| motion.moved_back(after.points.at(i))),
                None => vec![0.0; before.components()],
            }
        })
        .collect();
    (forward, backward)
}

/// Arcs (33) from the rows of overlaps in both directions, those that touch at all.
fn arcs(time: usize, forward: &[Row], backward: &[Row]) -> Vec<Arc> {
    let share = |rows: &[Row], i: usize, j: usize| rows[i].get(j).copied().unwrap_or(0.0);
    let mut out = Vec::new();
    for from in 0..forward.len() {
        for to in 0..backward.len() {
            let (forward, backward) = (share(forward, from, to), share(backward, to, from));
            if forward + backward > 0.0 {
                out.push(Arc { time: time - 1, from, to, forward, backward });
            }
        }
    }
    out
}

/// Covariance `W_k^-1 / nu_k` of a component in px and disparity.
fn covariance(posterior: &Posterior, k: usize, cell: [f64; 3]) -> [[f64; 3]; 3] {
    let matrix = &posterior.scale_inverses[9 * k..9 * k + 9];
    let nu = posterior.degrees_of_freedom[k];
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[3 * i + j] / nu * cell[i] * cell[j]))
}
