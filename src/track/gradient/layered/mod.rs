//! The layered tracker: the target and what is behind it as two layers, and one gradient step over the whole
//! target from the filter's prediction.
//!
//! It keeps the idea of M. Chiba and S. Ozawa (the gradient equation, a prediction in place of iterations, a
//! stopped background, a Gauss-Markov filter) and solves the equation once for the pose of the segmented
//! target. Background, support and brightness of the target are learnt as it goes.

mod align;
mod astray;
mod camera;
mod find;
mod front;
mod layers;
mod learn;
mod level;
mod light;
mod look;
mod margin;
mod nearby;
mod nodes;
mod outgrown;
mod outline;
mod outset;
mod patch;
mod pose;
mod refit;
mod reshaped;
mod resized;
mod rest;
mod scene;
mod search;
mod segment;
mod slanted;
mod sound;
mod take;
mod tell;
mod uncover;

use super::gauss_markov::{Dynamics, GaussMarkovFilter, Velocity};
use super::options::{CameraMotion, GradientOptions, Shape};
use crate::track::gradient::local_flow::shifted;
use crate::types::{Frame, TargetBox, TrackState, TrackStatus};
use align::Freedom;
use camera::Seen;
use front::Front;
use layers::{Background, Target};
use outset::Outset;
use pose::{Increment, Pose};
use rest::Rest;
use sound::Sound;

/// Innovation squared up to which a measurement is not questioned when the camera moves.
const SURE: f64 = 4.0;
/// What is said of a frame with NaN, infinity or numbers that are no brightness.
const UNUSABLE: &str = "the frame cannot be used";
/// What is said of a frame in which the scene is gone before anything was measured.
const BLANK: &str = "the frame shows nothing of the scene";
/// What is said of a frame that has little to do with the one before.
const WILD: &str = "the frame is nothing like those before";

/// One target in the layered system.
#[derive(Debug)]
pub(super) struct Layered {
    freedom: Freedom,
    camera: CameraMotion,
    target: Target,
    background: Background,
    pose: Pose,
    filter: GaussMarkovFilter,
    /// Filtered change of size and angle from frame to frame.
    rate: Increment,
    noise: f64,
    /// Running mean of the visibility.
    usual: f64,
    /// Motion of the camera from frame to frame, at last.
    swung: [f64; 2],
    /// Frames since the previous one that said something.
    gap: usize,
    previous: Seen,
    /// Memory of the frame before that.
    spare: Vec<f64>,
    /// Measured position of the frame before, if that was seen without interruption.
    before: Option<[f64; 2]>,
    missed: usize,
    hidden: bool,
    /// Frames in a row in which something covered it.
    covered: usize,
    /// Frames for which it is still reckoned with that the target has not come out entirely.
    returning: usize,
    /// Frames for which a look-alike is still reckoned with.
    wary: usize,
    /// Angle turned, not wrapped, rad.
    turned: f64,
    gain: f64,
    rotation_told: bool,
    /// Whether the target keeps its place in the picture when the camera moves.
    with_camera: bool,
    /// Greatest visibility after the first frame, with nothing known to cover it.
    most_seen: f64,
    /// Frames measured.
    age: usize,
    /// Age up to which the support may still adapt to what the box holds; 0 once it has.
    adapts_until: usize,
    /// The picture when it last moved, unless it was not seen or the camera moved since.
    resting: Option<Rest>,
    /// The target when it was last seen whole, unless the camera moved since.
    sound: Option<Sound>,
    /// What the first box held, until that is told.
    outset: Option<Outset>,
    /// What hid part of it then, as long as it does.
    front: Option<Front>,
    /// How far the displacement since the first frame may be from what is said, until that is told, px.
    doubt: [f64; 2],
    /// How far the middle of the support may still move along x and y until it is settled, px.
    unsettled: [f64; 2],
    /// Noise over the contrast of the target, when it was last seen whole.
    faintness: f64,
}

/// A frame shifted to where the scene is in the next one, if the camera moved between them; NaN where that
/// shows nothing of it.
pub(super) fn stilled(frame: &Frame<f64>, next: &Frame<f64>) -> Option<Frame<f64>> {
    let nowhere = TargetBox::about([-1e6; 2], 0.0, 0.0);
    let seen = [frame, next].map(|frame| Seen::new(frame.clone()));
    let motion = camera::camera_motion(&seen[0], &seen[1], nowhere, learn::LEAST_NOISE, [0.0; 2]);
    (motion != [0.0; 2]).then(|| shifted(frame, motion.map(|m| -m)))
}

/// The filter of a target that is at rest, as far as is known.
fn begun(at: [f64; 2]) -> GaussMarkovFilter {
    let dynamics = Dynamics { start: [0.25, 9.0, 1.0], ..Dynamics::default() };
    GaussMarkovFilter::new(at, dynamics, Velocity::Mean)
}

impl Layered {
    pub fn new(frame: Frame<f64>, bounds: TargetBox, options: &GradientOptions) -> Self {
        let target = Target::new(&frame, bounds, learn::PRIOR);
        let mut this = Self {
            resting: None,
            sound: None,
            front: None,
            doubt: [0.0; 2],
            unsettled: [0.0; 2],
            faintness: 0.0,
            outset: Some(Outset::new(&frame, bounds, target.clone())),
            freedom: match options.shape {
                Shape::Similarity => Freedom::Similarity,
                Shape::Affine => Freedom::Affine,
            },
            camera: options.camera,
            target,
            background: Background::new(&frame, bounds),
            pose: Pose::at(bounds.centre()),
            filter: begun(bounds.centre()),
            rate: [0.0; 6],
            noise: learn::LEAST_NOISE,
            usual: 1.0,
            before: Some(bounds.centre()),
            swung: [0.0; 2],
            gap: 0,
            previous: Seen::new(frame),
            spare: Vec::new(),
            missed: 0,
            hidden: false,
            covered: 0,
            returning: 0,
            wary: 0,
            turned: 0.0,
            gain: 1.0,
            rotation_told: true,
            with_camera: false,
            most_seen: 0.0,
            age: 0,
            adapts_until: find::ADAPTED,
        };
        this.resting = Some(this.rest(&this.previous.frame));
        this
    }

    /// The next frame; `None`: it cannot be used.
    pub fn update(&mut self, frame: Option<&Frame<f64>>, state: &mut TrackState) {
        let was_lost = matches!(state.status, TrackStatus::Lost | TrackStatus::Out);
        self.gap += 1;
        let Some(frame) = frame else { return self.pass_over(state, UNUSABLE) };
        if self.is_blank(frame) {
            return self.pass_over(state, BLANK);
        }
        let bounds = self.reached(&self.pose);
        let light = light::light(frame, &self.background, bounds);
        let seen = Seen::new(self.in_usual_light(frame, light));
        let motion = self.camera_motion(&seen, bounds);
        if self.is_wild(&seen.frame, bounds, motion) {
            self.spare = seen.frame.into_data();
            return self.pass_over(state, WILD);
        }
        self.swung = motion.map(|m| m / self.gap as f64);
        self.gap = 0;
        self.follow_camera(motion, &seen.frame);
        self.filter.predict();
        self.look_back(&seen.frame, motion);
        if motion != [0.0; 2] {
            (self.resting, self.sound) = (None, None);
        }
        let finding = self.find_wherever_it_rides(&seen.frame, motion);
        let finding = finding.map(|found| self.unless_at_rest(found, &seen.frame));
        if let Some((found, _)) = &finding {
            self.take(found, &seen.frame);
        } else {
            self.recall();
            self.miss();
        }
        match &finding {
            Some((found, false)) => self.resting = (!found.occluded).then(|| self.rest(&seen.frame)),
            Some(_) => {}
            None => self.resting = None,
        }
        let finding = finding.map(|(found, _)| found);
        self.look_at_the_whole_way();
        self.tell(state, finding.as_ref(), motion);
        state.gain = self.gain * light.gain;
        state.reacquired = was_lost && finding.is_some();
        self.hold_beyond_the_border(state, frame.size());
        self.spare = std::mem::replace(&mut self.previous, seen).frame.into_data();
    }

    /// A frame that says nothing.
    fn pass_over(&mut self, state: &mut TrackState, reason: &'static str) {
        self.outset.iter_mut().for_each(Outset::skip);
        self.filter.predict();
        self.miss();
        self.tell(state, None, [0.0; 2]);
        (state.reason, state.reacquired) = (reason, false);
        let size = self.previous.frame.size();
        self.hold_beyond_the_border(state, size);
    }

    /// Where the filter expects the target.
    fn expected(&self, freely: bool) -> Pose {
        let pose = if freely { self.pose.moved(&self.rate) } else { self.pose };
        self.placed(pose, self.filter.position())
    }

    /// The pose whose centroid is at a position.
    fn placed(&self, pose: Pose, position: [f64; 2]) -> Pose {
        let offset = pose.turn(self.target.centroid());
        Pose { p: [position[0] - offset[0], position[1] - offset[1]], ..pose }
    }

    /// Centroid of the support at a pose.
    fn position(&self, pose: &Pose) -> [f64; 2] {
        pose.apply(self.target.centroid())
    }
}
