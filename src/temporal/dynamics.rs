//! The dynamical system of one pixel (WO2010/098160, (11)), its step over a frame, and Jacobians.
//!
//! State `q = (I, Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y)`; the motion stands still, the brightness
//! follows it: `i' = J(i) m = A(m) i`.

use super::kernel::transition::{Exact, Rk4, Step};

/// A state: brightness 2-jet, then motion.
pub type State = [f64; 12];
/// A 12 x 12 matrix, row by row.
pub type Matrix = [[f64; 12]; 12];

/// `q' = f(q)` of (11): time derivative of the 2-jet under affine flow; the motion's is zero.
///
/// ```
/// use jacoflow::temporal::dynamics::rate;
/// // A ramp of slope 2 along x, moving right by 3 px/frame, darkens by 6 grey levels a frame.
/// assert_eq!(rate(&[128.0, 2.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0])[0], -6.0);
/// ```
pub fn rate(q: &State) -> State {
    let [_, ix, iy, ixx, ixy, iyy, u, v, u_x, v_x, u_y, v_y] = *q;
    [
        -(ix * u + iy * v),
        -(ixx * u + ixy * v + ix * u_x + iy * v_x),
        -(ixy * u + iyy * v + ix * u_y + iy * v_y),
        -(2.0 * ixx * u_x + 2.0 * ixy * v_x),
        -(ixx * u_y + ixy * (u_x + v_y) + iyy * v_x),
        -(2.0 * ixy * u_y + 2.0 * iyy * v_y),
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    ]
}

/// `df/dq` of (11): columns of brightness are `A(m)`, columns of motion are `J(i)`, (21).
pub fn rate_jacobian(q: &State) -> Matrix {
    let [_, ix, iy, ixx, ixy, iyy, u, v, u_x, v_x, u_y, v_y] = *q;
    let mut f = [[0.0; 12]; 12];
    f[0] = [0.0, -u, -v, 0.0, 0.0, 0.0, -ix, -iy, 0.0, 0.0, 0.0, 0.0];
    f[1] = [0.0, -u_x, -v_x, -u, -v, 0.0, -ixx, -ixy, -ix, -iy, 0.0, 0.0];
    f[2] = [0.0, -u_y, -v_y, 0.0, -u, -v, -ixy, -iyy, 0.0, 0.0, -ix, -iy];
    f[3] = [0.0, 0.0, 0.0, -2.0 * u_x, -2.0 * v_x, 0.0, 0.0, 0.0, -2.0 * ixx, -2.0 * ixy, 0.0, 0.0];
    f[4] = [0.0, 0.0, 0.0, -u_y, -(u_x + v_y), -v_x, 0.0, 0.0, -ixy, -iyy, -ixx, -ixy];
    f[5] = [0.0, 0.0, 0.0, 0.0, -2.0 * u_y, -2.0 * v_y, 0.0, 0.0, 0.0, 0.0, -2.0 * ixy, -2.0 * iyy];
    f
}

/// One frame of `q' = f(q) + w` by one classical Runge-Kutta step, the drift `w` constant, (54).
pub fn rk4(q: &State, w: &State) -> State {
    let add = |a: &State, s: f64, b: &State| -> State { std::array::from_fn(|k| a[k] + s * b[k]) };
    let slope = |q: &State| add(&rate(q), 1.0, w);
    let k1 = slope(q);
    let k2 = slope(&add(q, 0.5, &k1));
    let k3 = slope(&add(q, 0.5, &k2));
    let k4 = slope(&add(q, 1.0, &k3));
    std::array::from_fn(|k| q[k] + (k1[k] + 2.0 * k2[k] + 2.0 * k3[k] + k4[k]) / 6.0)
}

/// `d rk4 / dq` at drift zero.
pub fn rk4_jacobian(q: &State) -> Matrix {
    step_jacobian::<Rk4>(q)
}

/// One frame of `q' = f(q)` in closed form.
///
/// With `[E e; 0 1] = expm(-[[M, (u, v)^T], [0, 0]])`, `g = (Ix, Iy)` and `H` the Hessian: `H <- E^T H E`, `g
/// <- E^T (g + H e)`, `I <- I + g.e + e^T H e / 2`, right sides with the old values.
pub fn exact(q: &State) -> State {
    step::<Exact>(q)
}

/// `d exact / dq`.
pub fn exact_jacobian(q: &State) -> Matrix {
    step_jacobian::<Exact>(q)
}

fn halves(q: &State) -> ([f64; 6], [f64; 6]) {
    (std::array::from_fn(|k| q[k]), std::array::from_fn(|k| q[6 + k]))
}

fn step<S: Step>(q: &State) -> State {
    let (i, m) = halves(q);
    let moved = S::advance(&i, &m);
    std::array::from_fn(|k| if k < 6 { moved[k] } else { q[k] })
}

fn step_jacobian<S: Step>(q: &State) -> Matrix {
    let (i, m) = halves(q);
    let mut f = [[0.0; 12]; 12];
    for column in 0..6 {
        let unit: [f64; 6] = std::array::from_fn(|k| f64::from(u8::from(k == column)));
        let along_i = S::advance(&unit, &m);
        let along_m = S::tangent(&i, &m, column);
        for row in 0..6 {
            f[row][column] = along_i[row];
            f[row][6 + column] = along_m[row];
        }
        f[6 + column][6 + column] = 1.0;
    }
    f
}
