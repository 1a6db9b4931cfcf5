//! Scenes by name, for the binary and for Python.
//!
//! A scene is a motion and what it carries, or something of its own. A new one is a constant
//! in `scenes` or `carriers`, and its name in the list there.

mod carriers;
mod scenes;

pub use carriers::CARRIERS;
pub use scenes::SCENES;

use super::{Scene, carried::Carried, motion::Motion, texture::Texture};
use crate::error::{Error, Result};

/// Largest size of such a number: positions beyond it are not exact to a millionth of a pixel.
const MAX_PARAMETER: f64 = 1e9;

/// A number that a scene or carrier can be given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// Its default; `None`: taken from the frame, as the meaning says.
    pub default: Option<f64>,
    /// What it is, and its unit.
    pub meaning: &'static str,
}

/// A parameter.
const fn number(name: &'static str, default: Option<f64>, meaning: &'static str) -> Parameter {
    Parameter { name, default, meaning }
}

type AnyScene = Result<Box<dyn Scene>>;
type AnyTexture = Result<Box<dyn Texture>>;
type Carry = fn(&Settings, Box<dyn Motion>) -> AnyScene;

/// How a scene is made.
#[derive(Debug, Clone, Copy)]
enum Make {
    /// From its parameters alone.
    Whole(fn(&Settings) -> AnyScene),
    /// From its parameters and one texture, or two from neighbouring seeds.
    Textured(fn(&Settings, &dyn Fn(u64) -> AnyTexture) -> AnyScene),
    /// A motion, to be given something to carry.
    Motion(fn(&Settings) -> Result<Box<dyn Motion>>),
}

/// A scene that can be had by name.
#[derive(Debug, Clone, Copy)]
pub struct SceneKind {
    /// Its name.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// What it can be given.
    pub parameters: &'static [Parameter],
    make: Make,
}

impl SceneKind {
    /// Whether it takes a carrier.
    pub fn takes_carrier(&self) -> bool {
        !matches!(self.make, Make::Whole(_))
    }
}

/// A carrier that can be had by name.
#[derive(Debug, Clone, Copy)]
pub struct CarrierKind {
    /// Its name.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// What it can be given.
    pub parameters: &'static [Parameter],
    /// As a texture that deforms with the flow; `None` where it is not one.
    texture: Option<fn(&Settings, u64) -> AnyTexture>,
    /// As a scene of its own, where it is no texture.
    carry: Option<Carry>,
}

/// What a scene is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneOptions {
    /// Columns of a frame, px.
    pub width: usize,
    /// Rows of a frame, px.
    pub height: usize,
    /// Scene coordinates of pixel (0, 0), px.
    pub origin: (f64, f64),
    /// Seed of everything random.
    pub random_state: u64,
    /// Name of the carrier; `None`: the first of [`CARRIERS`].
    pub carrier: Option<String>,
    /// Parameters of the scene and its carrier that differ from their defaults.
    pub values: Vec<(String, f64)>,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self { width: 256, height: 256, origin: (0.0, 0.0), random_state: 0, carrier: None, values: Vec::new() }
    }
}

/// The scene called `name`.
///
/// # Errors
/// [`Error::Argument`] naming `scene`, `carrier`, `size`, `origin` or the parameter that is unknown or
/// unusable.
pub fn build(name: &str, options: &SceneOptions) -> Result<Box<dyn Scene>> {
    let kind = find(SCENES, "scene", name, |kind| kind.name)?;
    let carrier = match (&options.carrier, kind.takes_carrier()) {
        (Some(name), true) => Some(find(CARRIERS, "carrier", name, |kind| kind.name)?),
        (None, true) => Some(&CARRIERS[0]),
        (Some(name), false) => {
            return Err(Error::argument("carrier", format!("none: the scene {} has its own picture", kind.name), name));
        }
        (None, false) => None,
    };
    let settings = Settings::new(kind, carrier, options)?;
    match (kind.make, carrier) {
        (Make::Textured(make), Some(carrier)) => {
            let texture = carrier.texture.ok_or_else(|| {
                Error::argument("carrier", format!("a texture for the scene {}", kind.name), carrier.name)
            })?;
            make(&settings, &|seed| texture(&settings, seed))
        }
        (Make::Motion(make), Some(carrier)) => {
            let motion = make(&settings)?;
            match (carrier.texture, carrier.carry) {
                (Some(texture), _) => {
                    let texture = texture(&settings, options.random_state)?;
                    let carried = Carried::new(settings.size(), texture, motion);
                    Ok(Box::new(Carried { origin: options.origin, ..carried }))
                }
                (None, Some(carry)) => carry(&settings, motion),
                (None, None) => Err(Error::argument("carrier", "one that makes pictures", carrier.name)),
            }
        }
        (Make::Whole(make), _) => make(&settings),
        (Make::Textured(_) | Make::Motion(_), None) => Err(Error::argument("carrier", "a name", "none")),
    }
}

/// The entry called `name`, or an error that lists every name.
fn find<'a, K>(kinds: &'a [K], argument: &'static str, name: &str, name_of: impl Fn(&K) -> &str) -> Result<&'a K> {
    kinds.iter().find(|kind| name_of(kind) == name).ok_or_else(|| {
        let names: Vec<_> = kinds.iter().map(&name_of).collect();
        Error::argument(argument, format!("one of {}", names.join(", ")), name)
    })
}

/// Options that have been checked against what a scene knows.
struct Settings<'a> {
    options: &'a SceneOptions,
    known: Vec<Parameter>,
}

impl<'a> Settings<'a> {
    fn new(kind: &SceneKind, carrier: Option<&CarrierKind>, options: &'a SceneOptions) -> Result<Self> {
        let known: Vec<Parameter> =
            kind.parameters.iter().chain(carrier.map_or(&[][..], |c| c.parameters)).copied().collect();
        let (width, height) = (options.width, options.height);
        if width == 0 || height == 0 || width.checked_mul(height).is_none_or(|n| n > 1 << 30) {
            return Err(Error::argument("size", "1 to 2^30 pixels", format!("{width} x {height}")));
        }
        if !(options.origin.0.is_finite() && options.origin.1.is_finite()) {
            return Err(Error::argument("origin", "finite coordinates", format!("{:?}", options.origin)));
        }
        for (name, value) in &options.values {
            let Some(parameter) = known.iter().find(|p| p.name == name) else {
                let names: Vec<_> = known.iter().map(|p| p.name).collect();
                return Err(Error::argument("parameter", format!("one of {}", names.join(", ")), name));
            };
            if value.is_nan() || value.abs() > MAX_PARAMETER {
                return Err(Error::argument(parameter.name, "a number from -1e9 to 1e9", format!("{value:e}")));
            }
        }
        Ok(Self { options, known })
    }

    fn size(&self) -> (usize, usize) {
        (self.options.width, self.options.height)
    }

    /// The value given for `name` (the last one counts), its default, or NaN where it has none.
    fn value(&self, name: &str) -> f64 {
        let given = self.options.values.iter().rev().find(|(n, _)| n == name).map(|(_, value)| *value);
        let default = || self.known.iter().find(|p| p.name == name).and_then(|p| p.default);
        given.or_else(default).unwrap_or(f64::NAN)
    }

    /// As [`Settings::value`], refusing zero and less.
    fn positive(&self, name: &'static str) -> Result<f64> {
        let value = self.value(name);
        if value > 0.0 { Ok(value) } else { Err(Error::argument(name, "a positive number", value)) }
    }

    /// The point `(x, y)` of these names; by default the middle of the frame, `origin + (size - 1) / 2`.
    fn point(&self, x: &str, y: &str) -> (f64, f64) {
        let or_middle = |value: f64, origin: f64, size: usize| {
            if value.is_nan() { origin + (size as f64 - 1.0) / 2.0 } else { value }
        };
        let (origin, (width, height)) = (self.options.origin, self.size());
        (or_middle(self.value(x), origin.0, width), or_middle(self.value(y), origin.1, height))
    }
}
