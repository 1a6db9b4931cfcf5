//! Flow constant in space and time.

use super::{Axis, MotionModel, Parameter, Per};
use crate::jet::JetRates;

/// The classical Hessian method, WO2010/098160, (2): `-H (u, v) = (I_tx, I_ty)`; its confidence is det H.
#[derive(Debug, Clone, Copy)]
pub struct Translational;

impl MotionModel<2, 2> for Translational {
    const NAME: &'static str = "translational";
    const PARAMETERS: [Parameter; 2] =
        [Parameter::new("u", Axis::X, Per::Nothing), Parameter::new("v", Axis::Y, Per::Nothing)];

    fn equations(rates: &JetRates<f64>) -> ([[f64; 2]; 2], [f64; 2]) {
        let [_, _, _, ixx, ixy, iyy] = rates.jet;
        ([[-ixx, -ixy], [-ixy, -iyy]], [rates.first[1], rates.first[2]])
    }

    fn velocity(m: &[f64; 2], _dx: f64, _dy: f64, _t: f64) -> (f64, f64) {
        (m[0], m[1])
    }
}
