//! The tracker: targets, corners and the last frame.

use super::camera::{CameraMotion, fit_background};
use super::corners::{Corners, Track};
use super::foreground::{ForegroundMap, background_flow};
use super::geometry::{CentredBox, centred, visible_share};
use super::labels::assign;
use super::likelihood::is_inside;
use super::options::{ForegroundModel, ParticleMode, ParticleOptions};
use super::prediction::{FrameContext, Prediction, predict_targets};
use super::report::{StepCause, Tracked, report};
use super::step::ParticleStep;
use super::target::{Target, labelled};
use super::view::{View, revised};
use crate::error::{Error, Result};
use crate::flow::points::PointPyramid;
use crate::math::random::CounterRng;
use crate::parallel;
use crate::track::GreyLevels;
use crate::types::{AnyColourFrame, Frame, TargetBox};
use std::sync::Arc;

/// Growth of areas between two frames that a given camera may have.
const CAMERA_AREAS: std::ops::RangeInclusive<f64> = 0.01..=100.0;
/// Smallest side of the pictures that are tracked in, px.
const MIN_SIDE: usize = 8;
/// The stream of random numbers of the background's motion: no target's number.
const CAMERA_STREAM: u64 = u64::MAX;

/// Follows several targets in colour frames by a particle filter each.
///
/// A target's particles hold centre, velocity and size. Factors of the likelihood are banded colour
/// histograms and nearness to the constant-velocity prediction. Improved mode adds corner tracks that must
/// move with the target; paper mode the distance from other targets and a foreground map (K. Takechi, S.
/// Fukui, Y. Iwahori, "Robust tracking by a particle filter with a probabilistic background model").
///
/// Deterministic: the same frames, boxes and seed give the same results, bit for bit, on any number of
/// threads.
#[derive(Debug, Clone)]
pub struct ParticleTracker {
    pub(super) options: ParticleOptions,
    pub(super) size: (usize, usize),
    /// What samples of floats are multiplied by to be grey levels.
    pub(super) gain: f64,
    /// Factor of all lengths.
    pub(super) scale: f64,
    pub(super) frame: usize,
    pub(super) targets: Vec<Target>,
    pub(super) corners: Corners,
    /// Brightness of the last frame that showed something.
    pub(super) pyramid: PointPyramid,
    /// Colour bins of the last frame that showed something.
    pub(super) bins: Frame<u8>,
    /// The last frame, as it came.
    pub(super) last: Arc<AnyColourFrame>,
    pub(super) step: ParticleStep,
    pub(super) next_id: u64,
    /// Known motion of the background in each frame that showed nothing, since the last one that did.
    pub(super) missed: Vec<Option<[[f64; 3]; 2]>>,
}

impl ParticleTracker {
    /// Begins with a frame and the boxes of its targets, each with its number; there may be none yet.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `frame` for a picture with a side below 8 px; `boxes` for a box that is not
    /// finite, has no area or lies outside the picture; `id` for a number given twice; or an option.
    pub fn new(frame: &AnyColourFrame, targets: &[(u64, TargetBox)], options: &ParticleOptions) -> Result<Self> {
        options.check()?;
        let size = frame.size();
        if size.0.min(size.1) < MIN_SIDE {
            let expected = format!("a picture of at least {MIN_SIDE} x {MIN_SIDE} px");
            return Err(Error::argument("frame", expected, format!("{} x {} px", size.0, size.1)));
        }
        let gain = revised(GreyLevels::of_integers(), frame).float_gain();
        let scale = options.length_scale(size.1);
        let (view, pyramid, corners) = options.threads.install(|| {
            let view = View::new(frame, gain, options.uses("particle.values"));
            let mut corners = Corners::new(scale);
            corners.top_up(&view.grey)?;
            let pyramid = Corners::pyramid(view.grey.clone());
            Ok::<_, Error>((view, pyramid, corners))
        })?;
        let step = ParticleStep {
            frame: 0,
            targets: vec![],
            near: vec![],
            camera: CameraMotion::NONE.to_affine(),
            tracks: vec![],
        };
        let mut tracker = Self {
            options: options.clone(),
            size,
            gain,
            scale,
            frame: 0,
            targets: Vec::new(),
            corners,
            pyramid,
            bins: view.bins,
            last: Arc::new(frame.clone()),
            step,
            next_id: 0,
            missed: Vec::new(),
        };
        for (id, bounds) in targets {
            tracker.add(Some(*id), *bounds).map_err(|error| of_boxes(error, *id))?;
        }
        Ok(tracker)
    }

    /// Adds a target at the last frame; without a number it gets the next one. Returns its number.
    ///
    /// A target that left the picture may be added again under its number.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `box` or `id`, as [`ParticleTracker::new`].
    pub fn add(&mut self, id: Option<u64>, bounds: TargetBox) -> Result<u64> {
        let bounds = self.check_box(bounds)?;
        let id = id.unwrap_or(self.next_id);
        if let Some(known) = self.targets.iter().find(|target| target.id == id) {
            if !known.is_out {
                return Err(Error::argument("id", "a number that is not in use", id));
            }
            self.remove(id)?;
        }
        let target = Target::new(id, bounds, (&self.bins, self.frame), &self.options);
        let at = self.targets.partition_point(|other| other.id < id);
        self.targets.insert(at, target);
        self.next_id = self.next_id.max(id.saturating_add(1));
        self.insert_into_step(at);
        Ok(id)
    }

    /// Removes a target.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `id` for a number that is not in use.
    pub fn remove(&mut self, id: u64) -> Result<()> {
        let Some(at) = self.targets.iter().position(|target| target.id == id) else {
            let known: Vec<String> = self.targets.iter().map(|target| target.id.to_string()).collect();
            return Err(Error::argument("id", format!("one of the numbers in use ({})", known.join(", ")), id));
        };
        self.targets.remove(at);
        self.step.targets.remove(at);
        let keep = |i: usize, k: usize| i / k != at && i % k != at;
        let count = self.targets.len() + 1;
        self.step.near = self.step.near.iter().enumerate().filter(|(i, _)| keep(*i, count)).map(|(_, n)| *n).collect();
        let tracks = self.corners.tracks.iter_mut().map(|track| &mut track.owner);
        for owner in tracks.chain(self.step.tracks.iter_mut().map(|track| &mut track.owner)) {
            *owner = owner.filter(|owner| *owner != id);
        }
        Ok(())
    }

    /// Adds a new target, near nothing, to the step of the last frame.
    fn insert_into_step(&mut self, at: usize) {
        let new = self.report(&CameraMotion::NONE, &[], StepCause::Begin).targets.swap_remove(at);
        let (before, count) = (self.step.targets.len(), self.targets.len());
        let place = |k: usize| k - usize::from(k > at);
        let near =
            |own: usize, other: usize| own != at && other != at && self.step.near[place(own) * before + place(other)];
        self.step.near = (0..count * count).map(|k| near(k / count, k % count)).collect();
        self.step.targets.insert(at, new);
    }

    /// The targets in the next frame.
    ///
    /// # Errors
    /// [`Error::Argument`] named `frame` for another size or sample type than the first frame's.
    pub fn update(&mut self, frame: &AnyColourFrame) -> Result<&ParticleStep> {
        self.update_with_camera(frame, None)
    }

    /// As [`ParticleTracker::update`], with the background's motion since the frame before if it is known:
    /// `(x', y') = A (x, y, 1)`, px.
    ///
    /// # Errors
    /// As [`ParticleTracker::update`]; [`Error::Argument`] named `camera` for numbers that are not finite.
    pub fn update_with_camera(
        &mut self,
        frame: &AnyColourFrame,
        camera: Option<[[f64; 3]; 2]>,
    ) -> Result<&ParticleStep> {
        if frame.size() != self.size {
            let words = |size: (usize, usize)| format!("{} x {} px", size.0, size.1);
            let expected = format!("a frame as large as the first one, {}", words(self.size));
            return Err(Error::argument("frame", expected, words(frame.size())));
        }
        if let Some(camera) = camera.filter(|camera| !is_camera(camera)) {
            let got = crate::error::numbers(camera.as_flattened());
            let expected = "an affine map (2, 3) of finite numbers that does not mirror, nor shrink or enlarge areas more than 100 times";
            return Err(Error::argument("camera", expected, got));
        }
        let threads = self.options.threads;
        threads.install(|| self.advance(frame, camera.map(CameraMotion::from_affine)))?;
        Ok(&self.step)
    }

    /// What samples of floats are taken for so far.
    pub fn grey_levels(&self) -> GreyLevels {
        GreyLevels::of_floats(self.gain)
    }

    /// The targets at the last frame.
    pub fn step(&self) -> &ParticleStep {
        &self.step
    }

    fn check_box(&self, bounds: TargetBox) -> Result<CentredBox> {
        let TargetBox { x, y, width, height } = bounds;
        let finite = [x, y, width, height].iter().all(|value| value.is_finite());
        let inside = finite && width > 0.0 && height > 0.0 && visible_share(centred(bounds), self.size) > 0.0;
        if inside {
            return Ok(centred(bounds));
        }
        let (w, h) = self.size;
        let expected = format!("left, top, width and height of a box with an area inside the {w} x {h} picture");
        Err(Error::argument("bbox", expected, crate::error::numbers(&[x, y, width, height])))
    }

    fn report(&self, camera: &CameraMotion, predictions: &[Prediction], cause: StepCause) -> ParticleStep {
        let (targets, tracks) = (&self.targets[..], &self.corners.tracks[..]);
        let tracked = Tracked { frame: self.frame, targets, tracks, before: &self.step.targets };
        report(&tracked, camera, predictions, cause)
    }

    fn advance(&mut self, frame: &AnyColourFrame, known: Option<CameraMotion>) -> Result<()> {
        self.gain = revised(self.grey_levels(), frame).float_gain();
        let view = View::new(frame, self.gain, self.options.uses("particle.values"));
        if view.is_empty {
            self.frame += 1;
            self.missed.push(known.map(CameraMotion::to_affine));
            self.coast();
            return Ok(());
        }
        // Corners are followed from the last frame that showed something: the camera must cover the same
        // time.
        let missed = std::mem::take(&mut self.missed).into_iter().map(|camera| camera.map(CameraMotion::from_affine));
        let known = missed.chain([known]).reduce(|first, next| Some(first?.then(&next?))).flatten();
        let pyramid = Corners::pyramid(view.grey.clone());
        let was_cut = self.corners.follow(&self.pyramid, &pyramid)? && crate::ablation::keeps("particle.cut");
        // The corners that a cut leaves are chance, or the targets' own: they say nothing of the camera.
        let camera = self.measure_background(known.or(was_cut.then_some(CameraMotion::NONE)))?;
        let map = self.foreground_map(&view)?;
        self.frame += 1;
        if was_cut {
            self.corners.tracks.iter_mut().for_each(|track| track.owner = None);
        }
        let predictions =
            predict_targets(&mut self.targets, &mut self.corners.tracks, &camera, (&self.options, self.scale));
        if was_cut {
            self.targets
                .iter_mut()
                .filter(|target| !target.presence.is_hidden())
                .for_each(|target| target.presence.hide());
        }
        let context = FrameContext {
            options: &self.options,
            factors: self.options.factors(),
            scale: self.scale,
            frame: self.frame,
            bins: &view.bins,
            camera,
            tracks: &self.corners.tracks,
            foreground: map.as_ref(),
            predictions: &predictions,
        };
        let active = self.targets.iter_mut().enumerate().filter(|(_, target)| !target.is_out);
        parallel::for_each(active, |(own, target)| target.advance(own, &context));
        self.learn(&predictions, &camera, was_cut);
        self.step = self.report(&camera, &predictions, if was_cut { StepCause::Cut } else { StepCause::Frame });
        self.corners.top_up(&view.grey)?;
        self.pyramid = pyramid;
        self.bins = view.bins;
        self.last = Arc::new(frame.clone());
        Ok(())
    }

    /// Motion of the background. Sets each track's residual motion and its probability of foreground.
    fn measure_background(&mut self, known: Option<CameraMotion>) -> Result<CameraMotion> {
        let points: Vec<[f64; 2]> = self.corners.tracks.iter().map(Track::previous).collect();
        let flow: Vec<[f64; 2]> = self.corners.tracks.iter().map(|track| track.flow).collect();
        let by_mixture = self.options.mode == ParticleMode::Paper && self.options.foreground != ForegroundModel::Affine;
        let (camera, foreground, relative) = if by_mixture && known.is_none() {
            let background = background_flow(&flow, &self.options)?;
            let relative = CameraMotion { shift: background.flow, ..CameraMotion::NONE };
            (CameraMotion::NONE, background.foreground, relative)
        } else {
            let rng = CounterRng::new(self.options.random_state).stream(CAMERA_STREAM).stream(self.frame as u64);
            let background = fit_background(&points, &flow, known, rng);
            let foreground = background.probability.iter().map(|q| 1.0 - q).collect();
            let rides = self.options.uses("particle.camera") || known.is_some();
            (if rides { background.motion } else { CameraMotion::NONE }, foreground, background.motion)
        };
        for ((track, point), foreground) in self.corners.tracks.iter_mut().zip(points).zip(foreground) {
            let c = relative.at(point);
            track.residual = Some([0, 1].map(|i| track.flow[i] - c[i]));
            track.foreground = foreground;
        }
        Ok(camera)
    }

    /// The foreground map, where it is a factor of the likelihood.
    fn foreground_map(&self, view: &View) -> Result<Option<ForegroundMap>> {
        if !self.options.factors().foreground || self.targets.is_empty() {
            return Ok(None);
        }
        ForegroundMap::of_frame(&self.corners.tracks, &view.colour, self.scale, &self.options).map(Some)
    }

    /// The frame shows nothing: targets move on, nothing is learned.
    fn coast(&mut self) {
        for target in self.targets.iter_mut().filter(|target| !target.is_out) {
            target.coast(&self.options, self.scale, self.frame);
            target.is_out = !is_inside(target.place(), self.size);
        }
        self.step = self.report(&CameraMotion::NONE, &[], StepCause::Nothing);
    }

    /// Updates usual values, labels of tracks and who has left.
    fn learn(&mut self, predictions: &[Prediction], camera: &CameraMotion, was_cut: bool) {
        for (target, prediction) in self.targets.iter_mut().zip(predictions).filter(|(target, _)| !target.is_out) {
            if self.options.factors().colour {
                target.presence.judge(target.similarity);
            }
            let is_alone = prediction.near.is_empty() && !target.presence.is_hidden() && !was_cut;
            if !(is_alone && target.presence.learn(target.similarity, prediction.labelled, &target.estimate)) {
                target.presence.clear_place = target.presence.moved_on(camera);
            }
            // The particles stay inside: only where they are going shows that the target leaves.
            let next = camera.carry(target.place(), target.velocity());
            target.is_out = !is_inside(next, self.size);
        }
        if !(self.options.factors().tracks && self.options.uses("particle.labels")) || was_cut {
            return;
        }
        let targets = labelled(&self.targets, |_, target| target.bounds());
        assign(&mut self.corners.tracks, &targets, self.scale);
    }
}

/// The error of one of the boxes given at the beginning.
fn of_boxes(error: Error, id: u64) -> Error {
    match error {
        Error::Argument { argument: "bbox", expected, got } => {
            Error::Argument { argument: "boxes", expected, got: format!("{got} for target {id}") }
        }
        other => other,
    }
}

/// Whether an affine map can be a camera's motion between two frames.
fn is_camera(map: &[[f64; 3]; 2]) -> bool {
    let [[a, b, _], [c, d, _]] = *map;
    map.as_flattened().iter().all(|value| value.is_finite()) && CAMERA_AREAS.contains(&(a * d - b * c))
}
