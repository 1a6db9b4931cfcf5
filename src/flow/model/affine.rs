//! Flow affine in space, constant in time.

use super::{Axis, MotionModel, Parameter, Per};
use crate::jet::JetRates;

/// WO2010/098160, (34): `[J(i); J(i')] m = [i'; i'']`, twelve equations in `m = (u, v, u_x, v_x, u_y, v_y)`.
#[derive(Debug, Clone, Copy)]
pub struct Affine;

impl Affine {
    /// The 6x6 matrix (21), `i' = J(i) m`; rows `I', Ix', Iy', Ixx', Ixy', Iyy'`, columns in the order of m.
    pub fn brightness_jacobian(i: &[f64; 6]) -> [[f64; 6]; 6] {
        let [_, ix, iy, ixx, ixy, iyy] = *i;
        [
            [-ix, -iy, 0.0, 0.0, 0.0, 0.0],
            [-ixx, -ixy, -ix, -iy, 0.0, 0.0],
            [-ixy, -iyy, 0.0, 0.0, -ix, -iy],
            [0.0, 0.0, -2.0 * ixx, -2.0 * ixy, 0.0, 0.0],
            [0.0, 0.0, -ixy, -iyy, -ixx, -ixy],
            [0.0, 0.0, 0.0, 0.0, -2.0 * ixy, -2.0 * iyy],
        ]
    }
}

impl MotionModel<12, 6> for Affine {
    const NAME: &'static str = "affine";
    const PARAMETERS: [Parameter; 6] = [
        Parameter::new("u", Axis::X, Per::Nothing),
        Parameter::new("v", Axis::Y, Per::Nothing),
        Parameter::new("u_x", Axis::X, Per::X),
        Parameter::new("v_x", Axis::Y, Per::X),
        Parameter::new("u_y", Axis::X, Per::Y),
        Parameter::new("v_y", Axis::Y, Per::Y),
    ];

    fn equations(rates: &JetRates<f64>) -> ([[f64; 6]; 12], [f64; 12]) {
        let (upper, lower) = (Self::brightness_jacobian(&rates.jet), Self::brightness_jacobian(&rates.first));
        let a = std::array::from_fn(|r| if r < 6 { upper[r] } else { lower[r - 6] });
        let b = std::array::from_fn(|r| if r < 6 { rates.first[r] } else { rates.second[r - 6] });
        (a, b)
    }

    fn velocity(m: &[f64; 6], dx: f64, dy: f64, _t: f64) -> (f64, f64) {
        (m[0] + m[2] * dx + m[4] * dy, m[1] + m[3] * dx + m[5] * dy)
    }
}
