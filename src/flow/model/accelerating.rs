//! Flow constant in space, linear in time.

use super::{Axis, MotionModel, Parameter, Per};
use crate::jet::JetRates;

/// WO2010/098160, (36)-(39): six equations in `(u, v, u_t, v_t)`; observable where det H is not 0.
#[derive(Debug, Clone, Copy)]
pub struct Accelerating;

impl MotionModel<6, 4> for Accelerating {
    const NAME: &'static str = "accelerating";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("u", Axis::X, Per::Nothing),
        Parameter::new("v", Axis::Y, Per::Nothing),
        Parameter::new("u_t", Axis::X, Per::Frame),
        Parameter::new("v_t", Axis::Y, Per::Frame),
    ];

    fn equations(rates: &JetRates<f64>) -> ([[f64; 4]; 6], [f64; 6]) {
        let [_, ix, iy, ixx, ixy, iyy] = rates.jet;
        let [it, itx, ity, ..] = rates.first;
        let [itt, ittx, itty, ..] = rates.second;
        let a = [
            [-ix, -iy, 0.0, 0.0],
            [-ixx, -ixy, 0.0, 0.0],
            [-ixy, -iyy, 0.0, 0.0],
            [-itx, -ity, -ix, -iy],
            // Ixx' = Ixy' = Iyy' = 0 under pure translation of a quadratic, hence the zeros.
            [0.0, 0.0, -ixx, -ixy],
            [0.0, 0.0, -ixy, -iyy],
        ];
        (a, [it, itx, ity, itt, ittx, itty])
    }

    fn velocity(m: &[f64; 4], _dx: f64, _dy: f64, t: f64) -> (f64, f64) {
        (m[0] + m[2] * t, m[1] + m[3] * t)
    }
}
