//! Where the targets go.

/// A change of velocity takes this many frames.
const TRANSITION: f64 = 6.0;

/// A target's start, size and velocities. Lengths at scale 1, relative to the world's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Course {
    /// Position in frame 0, px.
    pub start: [f64; 2],
    /// Size in the first and the last frame over the nominal one; linear between them.
    pub size: [f64; 2],
    /// The frame from which a velocity holds, and the velocity, px/frame. The first holds from frame 0.
    pub velocities: &'static [(f64, [f64; 2])],
}

/// A target in one frame, at the scene's scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Its centre relative to the world's, px.
    pub position: [f64; 2],
    /// Its velocity in the world, px/frame.
    pub velocity: [f64; 2],
    /// Its size over the nominal one.
    pub size: f64,
    /// The way that its legs have gone since frame 0, px.
    pub walked: f64,
}

impl Course {
    /// Its velocity in a frame at scale 1, px/frame: from one to the next in a straight line.
    fn velocity(&self, t: f64) -> [f64; 2] {
        let mut velocity = self.velocities[0].1;
        for &(from, next) in &self.velocities[1..] {
            let share = ((t - from) / TRANSITION).clamp(0.0, 1.0);
            velocity = std::array::from_fn(|axis| velocity[axis] + share * (next[axis] - velocity[axis]));
        }
        velocity
    }

    /// The mean of its sizes over the scene.
    pub(super) fn mean_size(&self) -> f64 {
        f64::midpoint(self.size[0], self.size[1])
    }

    /// The target in each of `frames` frames.
    pub(super) fn places(&self, frames: usize, scale: f64) -> Vec<Place> {
        let last = frames.saturating_sub(1).max(1) as f64;
        let (mut position, mut walked) = (self.start.map(|value| scale * value), 0.0);
        let place = |frame: usize| {
            let t = frame as f64;
            let velocity = self.velocity(t).map(|value| scale * value);
            if frame > 0 {
                position = std::array::from_fn(|axis| position[axis] + velocity[axis]);
                walked += velocity[0].hypot(velocity[1]);
            }
            let size = self.size[0] + (self.size[1] - self.size[0]) * t / last;
            Place { position, velocity, size, walked }
        };
        (0..frames).map(place).collect()
    }
}
