//! Flow stretched along the picture's axes, constant in time.

use super::{Axis, MotionModel, Parameter, Per};
use crate::jet::JetRates;

/// Flow with a diagonal Jacobian: (34) with `v_x = u_y = 0`.
#[derive(Debug, Clone, Copy)]
pub struct Axial;

/// `J(i)` of (21) without the columns of `v_x` and `u_y`.
fn rows([_, x, y, xx, xy, yy]: [f64; 6]) -> [[f64; 4]; 6] {
    [
        [-x, -y, 0.0, 0.0],
        [-xx, -xy, -x, 0.0],
        [-xy, -yy, 0.0, -y],
        [0.0, 0.0, -2.0 * xx, 0.0],
        [0.0, 0.0, -xy, -xy],
        [0.0, 0.0, 0.0, -2.0 * yy],
    ]
}

impl MotionModel<12, 4> for Axial {
    const NAME: &'static str = "axial";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("u", Axis::X, Per::Nothing),
        Parameter::new("v", Axis::Y, Per::Nothing),
        Parameter::new("u_x", Axis::X, Per::X),
        Parameter::new("v_y", Axis::Y, Per::Y),
    ];

    fn equations(rates: &JetRates<f64>) -> ([[f64; 4]; 12], [f64; 12]) {
        let (upper, lower) = (rows(rates.jet), rows(rates.first));
        let a = std::array::from_fn(|r| if r < 6 { upper[r] } else { lower[r - 6] });
        let b = std::array::from_fn(|r| if r < 6 { rates.first[r] } else { rates.second[r - 6] });
        (a, b)
    }

    fn velocity(m: &[f64; 4], dx: f64, dy: f64, _t: f64) -> (f64, f64) {
        (m[0] + m[2] * dx, m[1] + m[3] * dy)
    }
}
