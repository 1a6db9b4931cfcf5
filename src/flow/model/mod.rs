//! Motion models: what the flow around a pixel is assumed to be, and the equations that follow.
//!
//! A new model is one file beside this one, with a type that implements [`MotionModel`], and one line in the
//! registry below. The registry makes the [`ModelKind`] and its name for the command line and Python; the
//! tests that every model must pass (`tests/affine_flow/model.rs`) run through it.

use crate::error::{Error, Result};
use crate::jet::JetRates;

/// Along which axis a parameter is a velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// x, to the right.
    X,
    /// y, down.
    Y,
}

/// What a parameter is the derivative with respect to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Per {
    /// The flow itself.
    Nothing,
    /// Its derivative along x.
    X,
    /// Its derivative along y.
    Y,
    /// Its derivative in time.
    Frame,
}

/// One unknown of a motion model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter {
    /// Its name, such as `u_x`.
    pub name: &'static str,
    /// The component of the flow.
    pub of: Axis,
    /// The derivative taken.
    pub per: Per,
}

impl Parameter {
    /// A parameter called `name`.
    pub const fn new(name: &'static str, of: Axis, per: Per) -> Self {
        Self { name, of, per }
    }
}

/// A motion model with P unknowns and N equations linear in the jet and its time derivatives.
pub trait MotionModel<const N: usize, const P: usize> {
    /// Name on the command line and in Python.
    const NAME: &'static str;
    /// The unknowns, `u` and `v` first.
    const PARAMETERS: [Parameter; P];

    /// The equations `A m = b`, both sides linear in `(i, i', i'')`, so that noise can be propagated.
    fn equations(rates: &JetRates<f64>) -> ([[f64; P]; N], [f64; N]);

    /// The flow at offset `(dx, dy)` px from the pixel and `t` frames from the estimate.
    fn velocity(m: &[f64; P], dx: f64, dy: f64, t: f64) -> (f64, f64);
}

/// Declares the models: module, type, number of equations, number of unknowns.
macro_rules! motion_models {
    ($($(#[$doc:meta])* $module:ident => $model:ident($n:literal, $p:literal);)*) => {
        $(mod $module; pub use $module::$model;)*

        /// The motion models by name.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        pub enum ModelKind {
            $($(#[$doc])* $model,)*
        }

        impl ModelKind {
            /// Every model.
            pub const ALL: &'static [Self] = &[$(Self::$model,)*];

            /// The model's name, as [`ModelKind::parse`] takes it.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$model => <$model as MotionModel<$n, $p>>::NAME,)*
                }
            }

            /// The model's unknowns, in the order of their planes.
            pub fn parameters(self) -> &'static [Parameter] {
                match self {
                    $(Self::$model => &<$model as MotionModel<$n, $p>>::PARAMETERS,)*
                }
            }

            /// Calls `visitor` with the model's type.
            pub fn dispatch<V: ModelVisitor>(self, visitor: V) -> V::Output {
                match self {
                    $(Self::$model => visitor.run::<$model, $n, $p>(),)*
                }
            }
        }
    };
}

motion_models! {
    /// Flow affine in space and constant in time (34): `u, v, u_x, v_x, u_y, v_y`.
    #[default]
    affine => Affine(12, 6);
    /// Flow constant in space and time (2): `u, v`.
    translational => Translational(2, 2);
    /// Flow constant in space and linear in time (36)-(39): `u, v, u_t, v_t`.
    accelerating => Accelerating(6, 4);
}

/// Operation on a model type that is chosen at run time by [`ModelKind::dispatch`].
pub trait ModelVisitor {
    /// What comes of it.
    type Output;
    /// Does it.
    fn run<M: MotionModel<N, P>, const N: usize, const P: usize>(self) -> Self::Output;
}

impl ModelKind {
    /// The model called `name`.
    ///
    /// # Errors
    /// [`Error::NotObservable`] for `affine_accelerating`: flow that varies in space and in time at once
    /// cannot be told from brightness (0071). [`Error::Argument`] naming `model` for any other unknown word.
    pub fn parse(name: &str) -> Result<Self> {
        if matches!(name, "affine_accelerating" | "accelerating_affine" | "affine+accelerating") {
            return Err(Error::NotObservable(format!(
                "model: {name} assumes neither that the flow is constant in time nor that it is constant in space; brightness alone does not determine \
                 such motion even in the basic case of uniform expansion (WO2010/098160, 0071). Choose affine (constant in time) or accelerating \
                 (constant in space)"
            )));
        }
        let found = Self::ALL.iter().copied().find(|m| m.name() == name);
        found.ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|m| m.name()).collect();
            Error::argument("model", format!("one of {}", names.join(", ")), name)
        })
    }
}
