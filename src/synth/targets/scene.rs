//! A scene of targets: what is where in each frame.

use super::camera::Pose;
use super::list::TargetSceneKind;
use super::options::TargetSceneOptions;
use super::path::Place;
use super::sprite::{Figure, Sprite, Stance};
use super::world::World;
use crate::error::Result;
use crate::math::random::CounterRng;
use crate::types::TargetBox;
use std::f64::consts::TAU;

/// Width and height of a frame at scale 1, px.
const WINDOW: (f64, f64) = (720.0, 480.0);
/// A person's stride, both legs, over the height of its nominal box.
const STRIDE: f64 = 0.62;
/// A car points along its way up to this slope, rad.
const MAX_SLOPE: f64 = 0.6;
/// Added to a size per px that a target stands lower, to order targets of one size from far to near.
const LOWER_IS_NEARER: f64 = 1e-3;

/// Streams of random numbers, so that no part of a scene depends on how many numbers another uses.
#[derive(Debug, Clone, Copy)]
enum Stream {
    World = 1,
    Texture = 2,
    Shake = 3,
    Gait = 4,
    Noise = 5,
}

/// A scene of targets that look alike, with exact boxes. Frame t is the same however many frames are
/// rendered, in any order and on any number of threads.
#[derive(Debug, Clone)]
pub struct TargetScene {
    pub(super) kind: &'static TargetSceneKind,
    pub(super) options: TargetSceneOptions,
    pub(super) world: World,
    sprite: Sprite,
    poses: Vec<Pose>,
    /// By target and frame.
    places: Vec<Vec<Place>>,
    /// Phase of each target's gait in frame 0, rad.
    phases: Vec<f64>,
    /// Targets from far to near.
    order: Vec<usize>,
}

impl TargetScene {
    /// The scene of a name in [`SCENES`](super::SCENES).
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) naming an unknown scene or an unusable option.
    pub fn new(name: &str, options: TargetSceneOptions) -> Result<Self> {
        let kind = options.check(name)?;
        let frames = options.frames.unwrap_or(kind.frames);
        let rng = |stream: Stream| CounterRng::new(options.random_state).stream(stream as u64);
        let depth = |&k: &usize| kind.courses[k].mean_size() + LOWER_IS_NEARER * kind.courses[k].start[1];
        let mut order: Vec<usize> = (0..kind.courses.len()).collect();
        order.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        Ok(Self {
            kind,
            options,
            world: World::new(rng(Stream::World), options.scale),
            sprite: Sprite::new(kind.figure, rng(Stream::Texture)),
            poses: kind.camera.poses(rng(Stream::Shake), frames, options.scale),
            places: kind.courses.iter().map(|course| course.places(frames, options.scale)).collect(),
            phases: (0..kind.courses.len() as u64).map(|k| TAU * rng(Stream::Gait).uniform(k)).collect(),
            order,
        })
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        self.kind.name
    }

    /// Its options.
    pub fn options(&self) -> TargetSceneOptions {
        self.options
    }

    /// Width and height of its frames, px.
    pub fn size(&self) -> (usize, usize) {
        ((WINDOW.0 * self.options.scale) as usize, (WINDOW.1 * self.options.scale) as usize)
    }

    /// Number of frames.
    pub fn frame_count(&self) -> usize {
        self.poses.len()
    }

    /// Number of targets.
    pub fn target_count(&self) -> usize {
        self.places.len()
    }

    /// The targets from the farthest to the nearest, which is drawn last.
    pub fn drawing_order(&self) -> &[usize] {
        &self.order
    }

    /// The exact box of a target in a frame, px: its nominal size about its centre, seen or not.
    pub fn target_box(&self, frame: usize, target: usize) -> TargetBox {
        let Stance { centre, size: [width, height], .. } = self.stance(frame, target);
        TargetBox::about(centre, width, height)
    }

    /// Motion of the still world in the picture from a frame to the next: `[[a, b, c], [d, e, f]]`. A point
    /// at (x, y) px is then at `(a x + b y + c, d x + e y + f)`.
    pub fn camera_motion(&self, frame: usize) -> [[f64; 3]; 2] {
        let next = |x: f64, y: f64| self.window_place(frame + 1, self.world_place(frame, [x, y]));
        let (origin, right, down) = (next(0.0, 0.0), next(1.0, 0.0), next(0.0, 1.0));
        [0, 1].map(|axis| [right[axis] - origin[axis], down[axis] - origin[axis], origin[axis]])
    }

    /// The picture of the targets.
    pub(super) fn sprite(&self) -> &Sprite {
        &self.sprite
    }

    /// The random numbers of the noise in a frame.
    pub(super) fn noise_of(&self, frame: usize) -> CounterRng {
        CounterRng::new(self.options.random_state).stream(Stream::Noise as u64).stream(frame as u64)
    }

    /// The world point relative to the world's centre that a place in the window shows, px.
    pub(super) fn world_place(&self, frame: usize, [x, y]: [f64; 2]) -> [f64; 2] {
        let middle = self.middle();
        self.poses[frame].to_world([x - middle[0], y - middle[1]])
    }

    /// The place in the window at which a world point is seen, px.
    pub(super) fn window_place(&self, frame: usize, point: [f64; 2]) -> [f64; 2] {
        let (middle, [x, y]) = (self.middle(), self.poses[frame].to_window(point));
        [x + middle[0], y + middle[1]]
    }

    /// The window's middle, px.
    fn middle(&self) -> [f64; 2] {
        let (width, height) = self.size();
        [(width - 1) as f64 / 2.0, (height - 1) as f64 / 2.0]
    }

    /// How a target stands in the window of a frame.
    pub(super) fn stance(&self, frame: usize, target: usize) -> Stance {
        let (place, pose) = (self.places[target][frame], self.poses[frame]);
        let nominal = self.kind.figure.size().map(|side| side * self.options.scale);
        let [u, v] = place.velocity;
        let slope = match self.kind.figure {
            // A standing car keeps level.
            Figure::Car if u != 0.0 => v.atan2(u.abs()).clamp(-MAX_SLOPE, MAX_SLOPE) * u.signum(),
            _ => 0.0,
        };
        Stance {
            centre: self.window_place(frame, place.position),
            size: nominal.map(|side| side * place.size * pose.zoom),
            phase: self.phases[target] + TAU * place.walked / (STRIDE * nominal[1]),
            angle: pose.angle() + slope,
            mirrored: self.places[target][0].velocity[0] < 0.0,
        }
    }
}
