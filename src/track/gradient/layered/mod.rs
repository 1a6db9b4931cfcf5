//! The layered tracker: the target and what is behind it as two layers, and one gradient step over the whole target from the filter's prediction.
//!
//! It keeps the idea of M. Chiba and S. Ozawa (the gradient equation, a prediction in place of iterations, a stopped background, a Gauss-Markov filter) and solves the equation once for the pose
//! of the segmented target. Background, support and brightness of the target are learnt as it goes.

mod align;
mod camera;
mod find;
mod front;
mod layers;
mod learn;
mod level;
mod light;
mod look;
mod nodes;
mod outgrown;
mod outline;
mod outset;
mod patch;
mod pose;
mod reshaped;
mod resized;
mod scene;
mod search;
mod segment;
mod slanted;
mod tell;
mod uncover;

use super::gauss_markov::{Dynamics, GaussMarkovFilter, Measurement, Velocity};
use super::options::{CameraMotion, GradientOptions, Shape};
use crate::track::gradient::local_flow::shifted;
use crate::types::{Frame, TargetBox, TrackState, TrackStatus};
use align::Freedom;
use camera::Seen;
use find::{COVERED, DROP, Finding, LEAST, SEARCHED, TOUCHED, WELL, YOUNG};
use front::Front;
use layers::{Background, Target};
use look::view;
use outset::Outset;
use pose::{Increment, Pose};

/// Innovation squared up to which a measurement is not questioned when the camera moves.
const SURE: f64 = 4.0;
/// Innovation squared of a target found by looking all around from which on its velocity says nothing.
const JUMPED: f64 = 100.0;
/// Frames after a look-alike touched for which it is reckoned with.
const WARY: usize = 8;
/// What is said of a frame with NaN or infinity.
const UNUSABLE: &str = "the frame cannot be used";
/// What is said of a frame that has little to do with the one before.
const WILD: &str = "the frame is nothing like those before";
/// Least information about the rotation, of all there could be, from which on it is told; else the angle is held. Round targets are known by their outline: this bounds what errors of that may turn.
const TOLD: f64 = 0.75;
/// Least deviation of a measured position, px.
const LEAST_DEVIATION: f64 = 0.05;
/// Frames after an interruption in which what is not seen of the target may be hidden still.
const RETURNING: usize = 3;
/// Rate of the filtered change of size and angle.
const RATE: f64 = 0.3;
/// The same of the mean visibility.
const VISIBILITY_RATE: f64 = 0.1;

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

/// A frame shifted to where the scene is in the next one, if the camera moved between them; NaN where that shows nothing of it.
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
        Self {
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
        }
    }

    /// The next frame; `None`: it cannot be used.
    pub fn update(&mut self, frame: Option<&Frame<f64>>, state: &mut TrackState) {
        let was_lost = matches!(state.status, TrackStatus::Lost | TrackStatus::Out);
        self.gap += 1;
        let Some(frame) = frame else { return self.pass_over(state, UNUSABLE) };
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
        let finding = self.find_wherever_it_rides(&seen.frame, motion);
        match &finding {
            Some(found) => self.take(found, &seen.frame),
            None => self.miss(),
        }
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

    /// A measurement.
    fn take(&mut self, found: &Finding, frame: &Frame<f64>) {
        let Finding { aligned, look, occluded, .. } = *found;
        let interrupted = self.missed > 0 || self.hidden || occluded;
        let mut pose = aligned.pose;
        self.rotation_told =
            self.freedom != Freedom::Similarity || aligned.rotation_told >= TOLD || occluded && self.rotation_told;
        let at = self.position(&pose);
        if !self.rotation_told && !occluded {
            pose = self.placed(pose.turned_to(self.pose.angle()), at);
        }
        if !occluded {
            self.faintness = (self.noise / look.contrast.max(1.0)).min(1.0);
        }
        self.returning = if self.missed > 0 { RETURNING } else { self.returning.saturating_sub(1) };
        // Where a part of it is still hidden, all of it may be that much farther on.
        let behind = if self.returning > 0 { self.side() * (1.0 - look.visibility) } else { 0.0 };
        let visible = look.visibility.max(0.1);
        let variance: [f64; 2] = std::array::from_fn(|k| {
            let own = aligned.covariance[k][k].max(LEAST_DEVIATION.powi(2)) / (visible * visible);
            own + behind * behind + if occluded { (1.5 * (1.0 - look.visibility)).powi(2) } else { 0.0 }
        });
        let step = self.before.filter(|_| !interrupted).map(|before| [at[0] - before[0], at[1] - before[1]]);
        if (found.reason == SEARCHED || found.reason == resized::RESIZED) && found.nis > JUMPED {
            // Nobody moves like that: it is begun anew where it was found.
            self.filter = begun(at);
        }
        if occluded && !self.hidden {
            self.filter.x.iter_mut().for_each(|x| x[2] *= 0.3);
        }
        self.filter.update(&Measurement {
            position: Some((at, variance)),
            velocity: step.map(|step| (step, variance.map(|v| 2.0 * v))),
        });
        self.turn_to(&pose);
        if interrupted {
            self.rate = [0.0; 6];
        } else {
            (2..6).for_each(|k| self.rate[k] += RATE * aligned.moved[k]);
            if !self.rotation_told {
                let growth = 0.5 * (self.rate[2] + self.rate[5]);
                self.rate = [0.0, 0.0, growth, 0.0, 0.0, growth];
            }
        }
        self.before = (!occluded).then_some(at);
        self.front = self.front.take().filter(|front| occluded && !front.is_past(&self.target, &self.pose));
        (self.missed, self.hidden) = (0, occluded);
        self.covered = if occluded { self.covered + 1 } else { 0 };
        self.wary = if found.reason == TOUCHED { WARY } else { self.wary.saturating_sub(1) };
        self.age += 1;
        self.most_seen = if occluded { self.most_seen } else { self.most_seen.max(look.visibility) };
        if found.reason == COVERED && look.visibility > self.usual - DROP {
            // What stays hidden, though it is little, is not covered but gone.
            self.usual += VISIBILITY_RATE * (look.visibility - self.usual);
        }
        let least = if self.age <= YOUNG { LEAST[0] } else { WELL };
        if !occluded && look.visibility >= least {
            self.learn(frame, aligned.gain, look.visibility);
        } else if self.target.fresh.is_some() {
            let view = view(frame, &self.target, &self.background, &self.pose);
            learn::learn_fresh(&mut self.target, &view, aligned.gain, self.noise);
        }
        if self.front.is_some() {
            let hidden = self.hides();
            learn::learn_background(&mut self.background, frame, &hidden, self.noise);
        }
    }

    fn turn_to(&mut self, pose: &Pose) {
        let turn = pose.angle() - self.pose.angle();
        self.turned += turn.sin().atan2(turn.cos());
        self.pose = *pose;
    }

    fn learn(&mut self, frame: &Frame<f64>, gain: f64, visibility: f64) {
        let view = view(frame, &self.target, &self.background, &self.pose);
        let before = self.position(&self.pose);
        learn::learn_target(&mut self.target, &view, gain, self.noise);
        self.settle(before);
        self.gain *= gain;
        self.usual += VISIBILITY_RATE * (visibility - self.usual);
        let hidden = self.hides();
        learn::learn_background(&mut self.background, frame, &hidden, self.noise);
    }

    /// No measurement.
    fn miss(&mut self) {
        self.missed += 1;
        self.covered = 0;
        self.before = None;
        self.rate = [0.0; 6];
        self.pose = self.placed(self.pose, self.filter.position());
    }
}
