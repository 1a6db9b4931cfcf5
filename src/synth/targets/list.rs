//! The scenes.

use super::{camera::CameraMotion, path::Course, sprite::Figure};

/// A scene by name.
#[derive(Debug, Clone, Copy)]
pub struct TargetSceneKind {
    /// Its name.
    pub name: &'static str,
    /// What happens in it, in a line.
    pub summary: &'static str,
    /// Its usual number of frames.
    pub frames: usize,
    /// What its targets are.
    pub(super) figure: Figure,
    /// How its camera moves.
    pub(super) camera: CameraMotion,
    /// A post before everything, if there is one.
    pub(super) pillar: Option<Pillar>,
    /// Its targets.
    pub(super) courses: &'static [Course],
}

/// A post in front of the targets, without end up and down. Lengths at scale 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pillar {
    /// Its middle relative to the world's centre, px.
    pub x: f64,
    /// Its width, px.
    pub width: f64,
}

/// A target of constant size with one velocity.
macro_rules! straight {
    ($start:expr, $size:expr, $velocity:expr) => {
        Course { start: $start, size: [$size, $size], velocities: &[(0.0, $velocity)] }
    };
}

/// Two people, seen by a steady camera.
const PEOPLE: TargetSceneKind = TargetSceneKind {
    name: "",
    summary: "",
    frames: 110,
    figure: Figure::Person,
    camera: CameraMotion::CALM,
    pillar: None,
    courses: &[],
};

/// Every scene. A walker of 132 px who goes 1.3 m/s moves 3.4 px a frame at 30 frames/s.
pub const SCENES: &[TargetSceneKind] = &[
    TargetSceneKind {
        name: "people_handheld",
        summary: "two people walk past each other, camera in the hand",
        camera: CameraMotion::HANDHELD,
        courses: &[straight!([-185.0, -8.0], 1.0, [3.4, 0.0]), straight!([195.0, 8.0], 1.06, [-3.2, 0.0])],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "cars_handheld",
        summary: "two cars pass each other and turn, camera in the hand",
        frames: 80,
        figure: Figure::Car,
        camera: CameraMotion { pan: (50.0, 20.0), pan_period: 90.0, ..CameraMotion::HANDHELD },
        courses: &[
            Course { start: [-190.0, -6.0], size: [1.0; 2], velocities: &[(0.0, [5.0, 0.0]), (44.0, [4.4, 1.4])] },
            Course { start: [185.0, 14.0], size: [1.06; 2], velocities: &[(0.0, [-4.6, 0.0]), (50.0, [-3.8, 1.6])] },
        ],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "people_static",
        summary: "two people walk past each other, camera at rest",
        camera: CameraMotion::STATIC,
        courses: &[straight!([-175.0, -10.0], 1.0, [3.2, 0.12]), straight!([190.0, 12.0], 1.08, [-3.4, -0.15])],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "slow_cross",
        summary: "two people pass each other slowly: one is hidden for long",
        frames: 150,
        camera: CameraMotion::HANDHELD,
        courses: &[straight!([-150.0, -8.0], 1.0, [2.1, 0.0]), straight!([155.0, 8.0], 1.06, [-1.8, 0.0])],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "zoom_roll",
        summary: "two people walk past each other, the camera zooms and rolls",
        frames: 100,
        camera: CameraMotion { zoom: (0.85, 1.25), roll: 6.0, roll_period: 60.0, ..CameraMotion::CALM },
        courses: &[straight!([-150.0, -8.0], 0.9, [3.2, 0.0]), straight!([150.0, 8.0], 0.95, [-3.0, 0.0])],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "stop_and_go",
        summary: "a person stands still while another passes, then walks on",
        frames: 120,
        courses: &[
            Course {
                start: [-150.0, -8.0],
                size: [1.0; 2],
                velocities: &[(0.0, [3.2, 0.0]), (40.0, [0.0, 0.0]), (85.0, [3.2, 0.0])],
            },
            straight!([190.0, 8.0], 1.06, [-3.2, 0.0]),
        ],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "meet_and_return",
        summary: "two people meet, turn round and go back",
        frames: 96,
        courses: &[
            Course { start: [-150.0, -8.0], size: [1.0; 2], velocities: &[(0.0, [3.2, 0.0]), (44.0, [-3.2, 0.0])] },
            Course { start: [150.0, 8.0], size: [1.06; 2], velocities: &[(0.0, [-3.0, 0.0]), (46.0, [3.2, 0.0])] },
        ],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "approach",
        summary: "a person who comes nearer walks past another",
        frames: 100,
        courses: &[
            Course { start: [-150.0, -8.0], size: [0.8, 1.6], velocities: &[(0.0, [3.0, 0.3])] },
            straight!([160.0, 8.0], 1.0, [-3.0, 0.0]),
        ],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "pillar",
        summary: "two people walk past each other behind a post that hides them",
        frames: 105,
        pillar: Some(Pillar { x: 70.0, width: 60.0 }),
        courses: &[straight!([-170.0, -8.0], 1.0, [3.3, 0.0]), straight!([175.0, 8.0], 1.06, [-3.0, 0.0])],
        ..PEOPLE
    },
    TargetSceneKind {
        name: "three_people",
        summary: "one person walks past two who follow each other",
        courses: &[
            straight!([-190.0, -14.0], 1.0, [3.4, 0.0]),
            straight!([170.0, 0.0], 1.04, [-3.0, 0.0]),
            straight!([250.0, 14.0], 1.08, [-3.6, 0.0]),
        ],
        ..PEOPLE
    },
];
