//! People and cars, drawn part by part, and the colours of the parts.

use super::shape::Shape;
use super::value_noise::value_noise;
use crate::math::random::CounterRng;
use crate::types::Frame;

/// Side of a texture, texels.
const TEXTURE_SIDE: usize = 128;
/// Its lattices, texels, and their weights.
const TEXTURE_OCTAVES: [(f64, f64); 3] = [(24.0, 0.4), (10.0, 0.35), (5.0, 0.35)];
/// Share of brightness that a texture of unit amplitude changes.
const TEXTURE_CONTRAST: f64 = 0.45;
/// Share of brightness that stripes change, up and down.
const STRIPE_CONTRAST: f64 = 0.25;
/// Amplitude of the arms' swing, rad.
const ARM_SWING: f64 = 0.55;
/// Amplitude of the legs' swing, rad.
const LEG_SWING: f64 = 0.42;
/// Half the square outside of which nothing of a target lies, over the box's longer side.
const REACH: f64 = 0.75;

/// Hue (0 to 1, a turn), saturation (0 to 1) and value (0 to 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hsv(pub f64, pub f64, pub f64);

/// A red shirt.
pub(super) const SHIRT: Hsv = Hsv(0.02, 0.75, 0.75);
/// Blue trousers.
pub(super) const TROUSERS: Hsv = Hsv(0.61, 0.55, 0.45);
/// Skin.
pub(super) const SKIN: Hsv = Hsv(0.06, 0.40, 0.85);
/// Dark hair.
pub(super) const HAIR: Hsv = Hsv(0.08, 0.45, 0.18);
/// An orange car.
pub(super) const CAR_BODY: Hsv = Hsv(0.10, 0.85, 0.85);
/// Its windows.
pub(super) const WINDOW: Hsv = Hsv(0.55, 0.30, 0.35);
/// Its wheels.
pub(super) const WHEEL: Hsv = Hsv(0.0, 0.02, 0.12);

impl Hsv {
    /// Red, green and blue, 0 to 255 (A. R. Smith, "Color gamut transform pairs", 1978).
    pub(super) fn to_rgb(self) -> [f64; 3] {
        let Self(hue, saturation, value) = self;
        // Each channel falls to `value (1 - saturation)` over the two sixths of a turn next to its own third.
        [5.0, 3.0, 1.0].map(|offset| {
            let sector = (offset + 6.0 * hue).rem_euclid(6.0);
            let fall = sector.min(4.0 - sector).clamp(0.0, 1.0);
            255.0 * value * (1.0 - saturation * fall)
        })
    }
}

/// The colour at `share` of the way from one to another.
pub(super) fn blend(from: [f64; 3], to: [f64; 3], share: f64) -> [f64; 3] {
    std::array::from_fn(|c| from[c] + share * (to[c] - from[c]))
}

/// What the targets of a scene are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Figure {
    /// A walking person with swinging limbs.
    Person,
    /// A rigid car.
    Car,
}

impl Figure {
    /// Width and height of the nominal box at scale 1, px.
    pub(super) fn size(self) -> [f64; 2] {
        match self {
            Self::Person => [54.0, 132.0],
            Self::Car => [76.0, 42.0],
        }
    }
}

/// A figure with its texture, which all targets of a scene share: they look alike.
#[derive(Debug, Clone)]
pub(super) struct Sprite {
    pub figure: Figure,
    textures: [Frame<f64>; 3],
}

/// How a target stands in the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stance {
    /// The box's centre, px.
    pub centre: [f64; 2],
    /// The box's width and height, px.
    pub size: [f64; 2],
    /// Phase of the gait, rad.
    pub phase: f64,
    /// Turn from x towards y, rad.
    pub angle: f64,
    /// Whether it looks to the left.
    pub mirrored: bool,
}

/// A shape and its paint.
struct Part {
    shape: Shape,
    paint: Paint,
}

/// A colour with a texture fixed to a part.
struct Paint {
    colour: [f64; 3],
    /// The row above which another colour holds, and that colour.
    above: Option<(f64, [f64; 3])>,
    texture: usize,
    /// The texture's middle, px.
    origin: [f64; 2],
    /// Unit vector along which the texture's rows follow one another.
    axis: [f64; 2],
    /// Side of the texture, px.
    side: f64,
    /// Phase of the stripes along `side`, rad; 0 for none.
    stripes: f64,
}

/// A target that is ready to be drawn, from any pixel on.
pub(super) struct Drawing<'a> {
    sprite: &'a Sprite,
    stance: Stance,
    parts: Vec<Part>,
    sin: f64,
    cos: f64,
}

impl Sprite {
    /// The figure with textures of its own.
    pub(super) fn new(figure: Figure, rng: CounterRng) -> Self {
        let texture = |k| value_noise(rng.stream(k), (TEXTURE_SIDE, TEXTURE_SIDE), &TEXTURE_OCTAVES);
        Self { figure, textures: [texture(0), texture(1), texture(2)] }
    }

    /// The figure in a stance.
    pub(super) fn drawing(&self, stance: Stance) -> Drawing<'_> {
        let parts = match self.figure {
            Figure::Person => person(stance.size[1], stance.phase),
            Figure::Car => car(stance.size),
        };
        let (sin, cos) = stance.angle.sin_cos();
        Drawing { sprite: self, stance, parts, sin, cos }
    }

    /// The colour of a paint at a point of the target's own coordinates.
    fn colour(&self, paint: &Paint, [x, y]: [f64; 2]) -> [f64; 3] {
        let (dx, dy) = (x - paint.origin[0], y - paint.origin[1]);
        let along = (dx * paint.axis[0] + dy * paint.axis[1]) / paint.side;
        let across = (dy * paint.axis[0] - dx * paint.axis[1]) / paint.side;
        let texel = |share: f64| ((share + 0.5).clamp(0.0, 1.0) * (TEXTURE_SIDE - 1) as f64) as usize;
        let mut gain = 1.0 + TEXTURE_CONTRAST * self.textures[paint.texture].get(texel(across), texel(along));
        if paint.stripes > 0.0 {
            gain *= 1.0 + STRIPE_CONTRAST * (along * paint.stripes).sin().signum();
        }
        let colour = paint.above.filter(|&(row, _)| y < row).map_or(paint.colour, |(_, colour)| colour);
        colour.map(|level| gain * level)
    }
}

impl Drawing<'_> {
    /// Half the side of the square about the centre that holds everything drawn, px.
    pub(super) fn reach(&self) -> f64 {
        REACH * self.stance.size[0].max(self.stance.size[1]) + 1.0
    }

    /// The centre of that square, px.
    pub(super) fn centre(&self) -> [f64; 2] {
        self.stance.centre
    }

    /// Draws over a pixel at a place in the window.
    pub(super) fn draw(&self, [x, y]: [f64; 2], pixel: &mut [f64; 3]) {
        let (dx, dy) = (x - self.stance.centre[0], y - self.stance.centre[1]);
        let (across, down) = (self.cos * dx + self.sin * dy, self.cos * dy - self.sin * dx);
        let point = [if self.stance.mirrored { -across } else { across }, down];
        for part in &self.parts {
            let coverage = part.shape.coverage(point);
            if coverage > 0.0 {
                *pixel = blend(*pixel, self.sprite.colour(&part.paint, point), coverage);
            }
        }
    }
}

/// A paint whose texture lies upright.
fn upright(colour: Hsv, texture: usize, side: f64) -> Paint {
    let (origin, axis) = ([0.0; 2], [1.0, 0.0]);
    Paint { colour: colour.to_rgb(), above: None, texture, origin, axis, side, stripes: 0.0 }
}

/// A person of a height, px, from back to front.
fn person(h: f64, phase: f64) -> Vec<Part> {
    let limb = |joint: f64, angle: f64, length: f64, radius: f64, colour: Hsv, texture: usize| {
        let (axis, length) = ([angle.sin(), angle.cos()], length * h);
        let from = [0.0, joint * h];
        let at = |way: f64| [from[0] + way * axis[0], from[1] + way * axis[1]];
        Part {
            shape: Shape::Capsule { ends: [from, at(length)], radius: radius * h },
            paint: Paint { origin: at(0.5 * length), axis, ..upright(colour, texture, 0.6 * h) },
        }
    };
    let arm = |angle| limb(-0.31, angle, 0.27, 0.030, SHIRT, 1);
    let leg = |angle| limb(0.02, angle, 0.42, 0.045, TROUSERS, 2);
    let (swing, stride) = (ARM_SWING * phase.sin(), LEG_SWING * phase.sin());
    let middle = [0.0, -0.17 * h];
    let body = Part {
        shape: Shape::Rectangle { centre: middle, half: [0.095 * h, 0.20 * h], corner: 0.04 * h },
        paint: Paint { origin: middle, axis: [0.0, 1.0], stripes: 60.0, ..upright(SHIRT, 0, 0.5 * h) },
    };
    let head = Part {
        shape: Shape::disc([0.0, -0.435 * h], 0.065 * h),
        paint: Paint { above: Some((-0.44 * h, HAIR.to_rgb())), ..upright(SKIN, 1, 0.5 * h) },
    };
    vec![arm(-swing), leg(-stride), leg(stride), body, head, arm(swing)]
}

/// A car of a width and height, px.
fn car([w, h]: [f64; 2]) -> Vec<Part> {
    let side = 1.1 * w;
    let body = Part {
        shape: Shape::Rectangle { centre: [0.0, 0.08 * h], half: [0.48 * w, 0.27 * h], corner: 0.12 * h },
        paint: Paint { stripes: 22.0, ..upright(CAR_BODY, 0, side) },
    };
    let cabin = Part {
        shape: Shape::Rectangle { centre: [-0.05 * w, -0.28 * h], half: [0.24 * w, 0.20 * h], corner: 0.10 * h },
        paint: upright(WINDOW, 1, side),
    };
    let wheel = |x: f64| Part { shape: Shape::disc([x * w, 0.33 * h], 0.17 * h), paint: upright(WHEEL, 2, side) };
    vec![body, cabin, wheel(-0.28), wheel(0.28)]
}
