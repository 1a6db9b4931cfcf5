//! The layered tracker: the target and what is behind it as two layers, and one gradient step over the whole target from the filter's prediction.
//!
//! It keeps the idea of M. Chiba and S. Ozawa (the gradient equation, a prediction in place of iterations, a stopped background, a Gauss-Markov filter) and solves the equation once for the pose
//! of the segmented target. Background, support and brightness of the target are learnt as it goes.

mod align;
mod camera;
mod layers;
mod learn;
mod level;
mod look;
mod nodes;
mod patch;
mod pose;
mod search;

use super::gauss_markov::{Dynamics, GaussMarkovFilter, Measurement, Velocity};
use super::options::{CameraMotion, GradientOptions, Shape};
use crate::types::{Frame, TargetBox, TrackState, TrackStatus};
use align::{Aligned, Freedom, Silence, Task, align};
use camera::Seen;
use layers::{Background, Target};
use look::{Look, look, view};
use pose::{Increment, Pose};

/// Deviations of the increment from the prediction: of the position, px, and of size and angle.
const PRIOR: [f64; 2] = [3.0, 0.02];
/// Levels of a frame like the one before, and of one after an interruption; px.
const LEVELS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];
/// Least visibility of a target that is seen well.
const WELL: f64 = 0.75;
/// Below this visibility it is looked for all around.
const BADLY: f64 = 0.6;
/// Least visibility that is measured; and after a miss.
const LEAST: [f64; 2] = [0.35, 0.5];
/// Innovation squared from which on a measurement is doubted.
const DOUBT: f64 = 12.0;
/// Innovation squared up to which a measurement is not questioned when the camera moves.
const SURE: f64 = 4.0;
/// Frames in which the support is still adapting to what the box holds.
const YOUNG: usize = 6;
/// Part of the target's area that may look like it beside it.
const LEAK: f64 = 0.06;
/// The same from which on, on one side, a look-alike touches.
const TOUCH: (f64, f64) = (0.08, 0.6);
/// Loss of visibility that is one.
const DROP: f64 = 0.08;
/// Least information about the rotation, of all there could be.
const TOLD: f64 = 0.88;
/// Reach of the search, px: at first, and at most.
const REACH: (usize, usize) = (12, 36);
/// Frames without a measurement after which the target is lost.
const LOST_AFTER: usize = 15;
/// Least deviation of a measured position, px.
const LEAST_DEVIATION: f64 = 0.05;
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
    previous: Seen,
    /// Memory of the frame before that.
    spare: Vec<f64>,
    /// Measured position of the frame before, if that was seen without interruption.
    before: Option<[f64; 2]>,
    missed: usize,
    hidden: bool,
    /// Angle turned, not wrapped, rad.
    turned: f64,
    gain: f64,
    rotation_told: bool,
    /// Whether the target keeps its place in the picture when the camera moves.
    with_camera: bool,
    /// Frames measured.
    age: usize,
}

/// What a frame says of the target.
#[derive(Debug, Clone, Copy)]
struct Finding {
    aligned: Aligned,
    look: Look,
    /// Normalised innovation squared.
    nis: f64,
    occluded: bool,
    reason: &'static str,
}

impl Layered {
    pub fn new(frame: Frame<f64>, bounds: TargetBox, options: &GradientOptions) -> Self {
        let dynamics = Dynamics { start: [0.25, 9.0, 1.0], ..Dynamics::default() };
        Self {
            freedom: match options.shape {
                Shape::Similarity => Freedom::Similarity,
                Shape::Affine => Freedom::Affine,
            },
            camera: options.camera,
            target: Target::new(&frame, bounds, learn::PRIOR),
            background: Background::new(&frame, bounds),
            pose: Pose::at(bounds.centre()),
            filter: GaussMarkovFilter::new(bounds.centre(), dynamics, Velocity::Mean),
            rate: [0.0; 6],
            noise: learn::LEAST_NOISE,
            usual: 1.0,
            before: Some(bounds.centre()),
            previous: Seen::new(frame),
            spare: Vec::new(),
            missed: 0,
            hidden: false,
            turned: 0.0,
            gain: 1.0,
            rotation_told: true,
            with_camera: false,
            age: 0,
        }
    }

    /// Covariance of the filter along x and y.
    pub fn covariance(&self) -> [[[f64; 3]; 3]; 2] {
        self.filter.covariance()
    }

    /// The next frame; `None`: it cannot be used.
    pub fn update(&mut self, frame: Option<&Frame<f64>>, state: &mut TrackState) {
        let was_lost = matches!(state.status, TrackStatus::Lost | TrackStatus::Out);
        let Some(frame) = frame else {
            self.filter.predict();
            self.miss();
            self.tell(state, None, [0.0; 2]);
            state.reason = "the frame cannot be used";
            return;
        };
        let bounds = self.bounds(&self.pose);
        let light = camera::light(frame, &self.background, bounds);
        let seen = Seen::new(self.in_usual_light(frame, light));
        let motion = match self.camera {
            CameraMotion::Auto => camera::camera_motion(&self.previous, &seen, bounds, self.noise),
            CameraMotion::None => [0.0; 2],
        };
        self.follow_camera(motion, &seen.frame);
        self.filter.predict();
        let finding = self.find_wherever_it_rides(&seen.frame, motion);
        match &finding {
            Some(found) => self.take(found, &seen.frame),
            None => self.miss(),
        }
        self.tell(state, finding.as_ref(), motion);
        state.gain = self.gain * light;
        state.reacquired = was_lost && finding.is_some();
        self.hold_beyond_the_border(state, frame.size());
        self.spare = std::mem::replace(&mut self.previous, seen).frame.into_data();
    }

    /// The frame, so bright as if the light were what it was at first.
    fn in_usual_light(&mut self, frame: &Frame<f64>, light: f64) -> Frame<f64> {
        let mut data = std::mem::take(&mut self.spare);
        data.clear();
        if light == 1.0 {
            data.extend_from_slice(frame.data());
        } else {
            data.extend(frame.data().iter().map(|value| value / light));
        }
        Frame::new(frame.width(), frame.height(), data).unwrap_or_default()
    }

    fn follow_camera(&mut self, motion: [f64; 2], frame: &Frame<f64>) {
        if motion == [0.0; 2] {
            if self.age > 0 {
                self.noise = learn::learn_noise(self.noise, &self.previous.frame, frame);
            }
            return;
        }
        self.background.moved(motion, frame);
        self.shift(motion);
    }

    fn shift(&mut self, motion: [f64; 2]) {
        self.filter.shift(motion);
        let shifted = |at: [f64; 2]| [at[0] + motion[0], at[1] + motion[1]];
        self.before = self.before.map(shifted);
        self.pose.p = shifted(self.pose.p);
    }

    /// Usually the target stands in the scene and goes with it when the camera moves. It may also be that the camera follows the target: where one of the two is doubtful, the other is tried.
    fn find_wherever_it_rides(&mut self, frame: &Frame<f64>, motion: [f64; 2]) -> Option<Finding> {
        let against = motion.map(|m| -m);
        if motion != [0.0; 2] && self.with_camera {
            self.shift(against);
        }
        let first = self.find(frame);
        let nis = |found: &Option<Finding>| found.map_or(f64::INFINITY, |f| if f.occluded { DOUBT } else { f.nis });
        if motion == [0.0; 2] || nis(&first) < SURE {
            return first;
        }
        let (there, back) = if self.with_camera { (motion, against) } else { (against, motion) };
        self.shift(there);
        let second = self.find(frame);
        if nis(&second) < nis(&first) {
            self.with_camera = !self.with_camera;
            return second;
        }
        self.shift(back);
        first
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

    fn nis(&self, pose: &Pose) -> f64 {
        let (at, expected) = (self.position(pose), self.filter.position());
        (0..2).map(|k| (at[k] - expected[k]).powi(2) / (self.filter.p[k][(0, 0)] + 0.02)).sum()
    }

    /// Aligns and judges.
    fn try_at(&self, frame: &Frame<f64>, guess: &Pose, how: (Freedom, Silence, [f64; 2], &[f64])) -> Option<Finding> {
        let (freedom, silence, prior, levels) = how;
        let task = Task {
            frame,
            target: &self.target,
            background: &self.background,
            noise: self.noise,
            freedom,
            silence,
            prior,
            levels,
        };
        let aligned = align(task, guess, 1.0)?;
        let view = view(frame, &self.target, &self.background, &aligned.pose);
        let look = look(&self.target, &view, aligned.gain, self.noise);
        Some(Finding { nis: self.nis(&aligned.pose), aligned, look, occluded: false, reason: "" })
    }

    /// The target in the frame, if it is seen well enough to be measured.
    fn find(&self, frame: &Frame<f64>) -> Option<Finding> {
        let interrupted = self.hidden || self.missed > 0;
        let levels = if self.age > 0 && self.missed == 0 { &LEVELS[1..] } else { &LEVELS[..] };
        let plain = self.try_at(frame, &self.expected(!interrupted), (self.freedom, Silence::None, PRIOR, levels));
        let mut best = plain;
        let doubted = plain.is_none_or(|found| found.look.visibility < WELL || found.nis > DOUBT);
        if (doubted || interrupted) && self.age >= YOUNG {
            best = self.covered(frame, plain, levels).or(best);
        }
        let touched = |found: &Finding| found.look.leak > TOUCH.0 && found.look.one_sided > TOUCH.1;
        if best.is_some_and(|found| !found.occluded && touched(&found)) {
            best = self.touched(frame, levels).or(best);
        }
        if best.is_none_or(|found| found.look.visibility < BADLY && !found.occluded) {
            best = self.searched(frame).or(best);
        }
        let least = LEAST[usize::from(self.missed > 0)];
        best.filter(|found| found.look.visibility >= least)
    }

    /// Something known covers the target: only its position is looked for, where it is not covered.
    fn covered(&self, frame: &Frame<f64>, plain: Option<Finding>, levels: &[f64]) -> Option<Finding> {
        let how = (Freedom::Translation, Silence::Covered, [self.spread(), PRIOR[1]], levels);
        let found = self.try_at(frame, &self.expected(false), how)?;
        let dropped = |look: &Look| look.visibility < self.usual - DROP;
        let also = plain.is_none_or(|plain| dropped(&plain.look) || plain.nis > DOUBT);
        let taken = found.look.leak < LEAK && dropped(&found.look) && also;
        taken.then_some(Finding { occluded: true, reason: "something covers the target", ..found })
    }

    /// Something that looks like the target touches it.
    fn touched(&self, frame: &Frame<f64>, levels: &[f64]) -> Option<Finding> {
        let how = (Freedom::Translation, Silence::Lookalike, [self.spread(), PRIOR[1]], levels);
        let found = self.try_at(frame, &self.expected(false), how)?;
        Some(Finding { occluded: true, reason: "something like the target touches it", ..found })
    }

    /// All around, in whole pixels, and then as usual.
    fn searched(&self, frame: &Frame<f64>) -> Option<Finding> {
        let reach = (REACH.0 + self.missed).min(REACH.1);
        let guess = self.expected(false);
        let place = search::search(frame, &self.target, &self.background, (&guess, 1.0), reach)?;
        let how = (Freedom::Translation, Silence::None, PRIOR, &LEVELS[1..]);
        let found = self.try_at(frame, &place, how)?;
        (found.look.visibility >= WELL).then_some(Finding { reason: "found by looking all around", ..found })
    }

    /// Deviation of the expected position, px.
    fn spread(&self) -> f64 {
        (0.5 * (self.filter.p[0][(0, 0)] + self.filter.p[1][(0, 0)])).sqrt().clamp(0.2, 3.0)
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
            pose = self.placed(pose.upright(), at);
        }
        let visible = look.visibility.max(0.1);
        let variance: [f64; 2] = std::array::from_fn(|k| {
            let own = aligned.covariance[k][k].max(LEAST_DEVIATION.powi(2)) / (visible * visible);
            own + if occluded { (1.5 * (1.0 - look.visibility)).powi(2) } else { 0.0 }
        });
        let step = self.before.filter(|_| !interrupted).map(|before| [at[0] - before[0], at[1] - before[1]]);
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
        (self.missed, self.hidden) = (0, occluded);
        self.age += 1;
        let least = if self.age <= YOUNG { LEAST[0] } else { WELL };
        if !occluded && look.visibility >= least {
            self.learn(frame, aligned.gain, look.visibility);
        }
    }

    fn turn_to(&mut self, pose: &Pose) {
        let turn = pose.angle() - self.pose.angle();
        self.turned += turn.sin().atan2(turn.cos());
        self.pose = *pose;
    }

    fn learn(&mut self, frame: &Frame<f64>, gain: f64, visibility: f64) {
        let view = view(frame, &self.target, &self.background, &self.pose);
        learn::learn_target(&mut self.target, &view, gain, self.noise);
        self.gain *= gain;
        self.usual += VISIBILITY_RATE * (visibility - self.usual);
        let bounds = self.bounds(&self.pose);
        learn::learn_background(&mut self.background, frame, bounds, self.noise);
    }

    /// No measurement.
    fn miss(&mut self) {
        self.missed += 1;
        self.before = None;
        self.rate = [0.0; 6];
        self.pose = self.placed(self.pose, self.filter.position());
    }

    /// Upright box of the target at a pose.
    fn bounds(&self, pose: &Pose) -> TargetBox {
        let [width, height] = self.target.extent();
        let columns = [pose.a[0][0].hypot(pose.a[1][0]), pose.a[0][1].hypot(pose.a[1][1])];
        TargetBox::about(self.position(pose), width * columns[0], height * columns[1])
    }

    /// A target that has left the picture waits at its border.
    fn hold_beyond_the_border(&mut self, state: &mut TrackState, (width, height): (usize, usize)) {
        if self.missed == 0 {
            return;
        }
        let bounds = self.bounds(&self.pose);
        let half = [0.5 * bounds.width, 0.5 * bounds.height];
        let lengths = [width as f64, height as f64];
        let position = self.filter.position();
        let outside = (0..2).any(|k| position[k] < -half[k] || position[k] > lengths[k] - 1.0 + half[k]);
        if !outside {
            return;
        }
        for k in 0..2 {
            self.filter.x[k][0] = position[k].clamp(-half[k], lengths[k] - 1.0 + half[k]);
            (self.filter.x[k][1], self.filter.x[k][2]) = (0.0, 0.0);
        }
        self.pose = self.placed(self.pose, self.filter.position());
        state.position = self.filter.position();
        (state.status, state.reason) = if self.missed >= LOST_AFTER {
            (TrackStatus::Lost, "out of the picture for long")
        } else {
            (TrackStatus::Out, "out of the picture")
        };
    }

    fn tell(&self, state: &mut TrackState, found: Option<&Finding>, motion: [f64; 2]) {
        (state.status, state.reason) = match found {
            Some(found) if found.occluded => (TrackStatus::Occluded, found.reason),
            Some(found) => (TrackStatus::Tracking, found.reason),
            None if self.missed >= LOST_AFTER => (TrackStatus::Lost, "not seen for long"),
            None => (TrackStatus::Coasting, "the target is not seen"),
        };
        state.position = self.filter.position();
        state.scene_velocity = self.filter.speed();
        state.velocity = [0, 1].map(|k| state.scene_velocity[k] + motion[k]);
        state.acceleration = self.filter.acceleration();
        state.camera_motion = motion;
        let measured = self.position(&self.pose);
        let before = state.bounds.centre();
        state.displacement = if found.is_some() { [0, 1].map(|k| measured[k] - before[k]) } else { [f64::NAN; 2] };
        state.covariance = self.filter.covariance();
        state.bounds = self.bounds(&self.pose);
        (state.scale, state.rotation) = (self.pose.scale(), self.turned);
        state.rotation_observable = self.rotation_told;
        state.visibility = found.map_or(0.0, |found| found.look.visibility);
        state.innovation = found.map_or(f64::NAN, |found| found.nis);
        state.line_of_sight = state.position;
        state.flow_count = 0;
    }
}
