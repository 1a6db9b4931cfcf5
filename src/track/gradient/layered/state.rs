//! The state of the tracker: plain data that the stages read and write, and what follows from it directly.

use super::camera::FramePyramid;
use super::initial::InitialSegmentation;
use super::layers::{Background, PRIOR, Target};
use super::oriented_box::OrientedBox;
use super::pose::Pose;
use super::task::MotionModel;
use crate::track::gradient::gauss_markov::{Dynamics, GaussMarkovFilter, Velocity};
use crate::track::gradient::options::{CameraMotion, GradientOptions, Shape};
use crate::types::{Frame, TargetBox};

/// Around the box, the scene may be hidden: share of its sides, and px. Limbs and what else is not in the
/// support must not be learned as background, for the target would look like that a moment later.
const HIDES: (f64, f64) = (0.1, 4.0);
/// Standard deviation of the middle of the learned support about that of the target, px: it stays from frame
/// to frame, and no filter takes it away.
const OUTLINE: f64 = 0.07;
/// What noise adds to the deviation of the middle, over noise by contrast, px: what is learned of an edge
/// from noisy frames stays wrong for as long as it is remembered.
const OUTLINE_IN_NOISE: f64 = 1.4;
/// Frames after which it is done with that, in any case.
pub(super) const MAX_SETTLING_FRAMES: usize = 20;
/// Change of size from one frame to the next that a look-alike makes, or cover.
pub(super) const MIN_SCALE_CHANGE: f64 = 0.04;
/// Least noise, grey levels.
pub(super) const MIN_NOISE: f64 = 1.5;

#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(crate) struct State {
    pub motion_model: MotionModel,
    pub camera: CameraMotion,
    pub target: Target,
    pub background: Background,
    pub motion: Motion,
    pub scene: Scene,
    pub history: History,
    pub uncertainty: Uncertainty,
    /// Brightness over that in the first frame.
    pub gain: f64,
    /// What the first box held, until that is decided.
    pub initial: Option<InitialSegmentation>,
    /// The target when it was last seen whole, unless the camera moved since.
    pub last_good: Option<LastGood>,
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Motion {
    pub pose: Pose,
    pub filter: GaussMarkovFilter,
    /// Rotation since the first frame, not wrapped, rad.
    pub rotation: f64,
    pub rotation_observable: bool,
    /// Measured position of the frame before, if that was seen without interruption.
    pub last_position: Option<[f64; 2]>,
    /// Whether the target keeps its place in the picture when the camera moves.
    pub rides_camera: bool,
}

/// The frame before, and what the still scene did.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Scene {
    pub previous: FramePyramid,
    /// Standard deviation, grey levels.
    pub noise: f64,
    /// Last motion of the camera from frame to frame, px.
    pub camera_velocity: [f64; 2],
    /// Frames since the previous one that could be used.
    pub gap: usize,
    /// Memory of the frame before that.
    pub buffer: Vec<f64>,
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct History {
    /// Frames measured.
    pub age: usize,
    /// Age up to which the support may still adapt to what the box holds; 0 once it has.
    pub adapts_until: usize,
    /// Running mean of the visibility.
    pub mean_visibility: f64,
    /// Maximum visibility after the first frame, with nothing known to cover it.
    pub max_visibility: f64,
    /// Frames in a row without a measurement.
    pub missed: usize,
    pub occluded: bool,
    /// Frames in a row in which an object covered it.
    pub occluded_frames: usize,
    /// Frames in which the target may still not have come out entirely.
    pub reappearing: usize,
    /// Frames in which an adjacent similar object may still disturb.
    pub look_alike_cooldown: usize,
}

/// Standard deviations that the filter's covariance does not hold.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Uncertainty {
    /// Of the displacement since the first frame, until the first box is decided, px.
    pub displacement: [f64; 2],
    /// How far the middle of the support may still move along x and y until it is settled, px.
    pub outline: [f64; 2],
    /// Noise over the contrast of the target, when it was last seen whole.
    pub noise_to_contrast: f64,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct LastGood {
    pub filter: GaussMarkovFilter,
    pub pose: Pose,
    /// Rotation since the first frame, not wrapped, rad.
    pub turned: f64,
    /// Frames since then.
    pub frames: usize,
    /// Whether what was measured since was taken for all of the target.
    pub followed: bool,
}

/// The filter of a target whose velocity is not known.
pub(super) fn start_filter(at: [f64; 2]) -> GaussMarkovFilter {
    let dynamics = Dynamics { start: [0.25, 9.0, 1.0], ..Dynamics::default() };
    GaussMarkovFilter::new(at, dynamics, Velocity::Mean)
}

impl State {
    pub fn new(frame: Frame<f64>, bounds: TargetBox, options: &GradientOptions) -> Self {
        let target = Target::new(&frame, bounds, PRIOR);
        Self {
            motion_model: match options.shape {
                Shape::Similarity => MotionModel::Similarity,
                Shape::Affine => MotionModel::Affine,
            },
            camera: options.camera,
            initial: Some(InitialSegmentation::new(&frame, bounds, target.clone())),
            target,
            background: Background::new(&frame, bounds),
            motion: Motion {
                pose: Pose::at(bounds.centre()),
                filter: start_filter(bounds.centre()),
                rotation: 0.0,
                rotation_observable: true,
                last_position: Some(bounds.centre()),
                rides_camera: false,
            },
            scene: Scene {
                previous: FramePyramid::new(frame),
                noise: MIN_NOISE,
                camera_velocity: [0.0; 2],
                gap: 0,
                buffer: Vec::new(),
            },
            history: History {
                age: 0,
                adapts_until: MAX_SETTLING_FRAMES,
                mean_visibility: 1.0,
                max_visibility: 0.0,
                missed: 0,
                occluded: false,
                occluded_frames: 0,
                reappearing: 0,
                look_alike_cooldown: 0,
            },
            uncertainty: Uncertainty { displacement: [0.0; 2], outline: [0.0; 2], noise_to_contrast: 0.0 },
            gain: 1.0,
            last_good: None,
        }
    }

    /// Where the filter expects the target.
    pub fn expected(&self) -> Pose {
        self.placed(self.motion.pose, self.motion.filter.position())
    }

    /// The pose whose centroid is at a position.
    pub fn placed(&self, pose: Pose, position: [f64; 2]) -> Pose {
        let offset = pose.turn(self.target.centroid());
        Pose { p: [position[0] - offset[0], position[1] - offset[1]], ..pose }
    }

    /// Centroid of the support at a pose.
    pub fn position(&self, pose: &Pose) -> [f64; 2] {
        pose.apply(self.target.centroid())
    }

    pub fn nis(&self, pose: &Pose) -> f64 {
        let (at, expected) = (self.position(pose), self.motion.filter.position());
        (0..2).map(|k| (at[k] - expected[k]).powi(2) / (self.motion.filter.p[k][(0, 0)] + 0.02)).sum()
    }

    /// Upright box of the target at a pose.
    pub fn bounds(&self, pose: &Pose) -> TargetBox {
        let [width, height] = self.target.extent();
        let [across, down] = pose.stretch();
        TargetBox::about(self.position(pose), width * across, height * down)
    }

    /// Where it hides the scene, with a margin.
    pub fn hides(&self) -> OrientedBox {
        OrientedBox::about(self.position(&self.motion.pose), &self.motion.pose, self.target.extent(), HIDES)
    }

    /// Upright box around the target at a pose, its corners included.
    pub fn reached(&self, pose: &Pose) -> TargetBox {
        let half = pose.reach(self.target.extent().map(|side| 0.5 * side));
        TargetBox::about(self.position(pose), 2.0 * half[0], 2.0 * half[1])
    }

    /// Shorter side, px of the target.
    pub fn side(&self) -> f64 {
        let [width, height] = self.target.extent();
        width.min(height).max(1.0)
    }

    /// Whether the target is smaller than in the frame before by what cover makes of it.
    pub fn has_shrunk(&self, pose: &Pose) -> bool {
        pose.scale() < (1.0 - MIN_SCALE_CHANGE) * self.motion.pose.scale()
    }

    /// Whether the support is still adapting to what the box holds: a target of which much was never seen had
    /// a box with much else in it.
    pub fn is_adapting(&self) -> bool {
        self.history.age < self.history.adapts_until && crate::ablation::keeps("gradient.adapting")
    }

    /// From the centroid of the support as learned to that of the support that the target is expected to
    /// have, px.
    pub fn undetermined(&self) -> [f64; 2] {
        if !crate::ablation::keeps("gradient.opposite") {
            return [0.0; 2];
        }
        let (learned, expected) = (self.target.centroid(), self.target.expected_centroid());
        self.motion.pose.turn([0, 1].map(|k| expected[k] - learned[k]))
    }

    /// Covariance of position, velocity and acceleration along x and y: the filter's, and how well the
    /// target's middle is known at all.
    pub fn covariance(&self) -> [[[f64; 3]; 3]; 2] {
        let mut covariance = self.motion.filter.covariance();
        let outline = if crate::ablation::keeps("gradient.outline_variance") {
            OUTLINE.hypot(OUTLINE_IN_NOISE * self.uncertainty.noise_to_contrast)
        } else {
            0.0
        };
        let undetermined = self.undetermined();
        for (k, axis) in covariance.iter_mut().enumerate() {
            let own = [undetermined[k], self.uncertainty.displacement[k], self.uncertainty.outline[k]];
            axis[0][0] += outline * outline + own.iter().map(|deviation| deviation * deviation).sum::<f64>();
        }
        covariance
    }
}
