//! Displacements over a whole frame with its rotation taken out, so that what is left is exact.
//!
//! A steady motion `X_dot = u + w x X` takes `X_1` to `X_2 = exp([w]x) X_1 + V u` in one frame. Rotated to
//! the camera's orientation half way, `X_1' = exp([w]x / 2) X_1` and `X_2' = exp(-[w]x / 2) X_2`, only a
//! translation is left:
//!
//! ```text
//! X_2' = X_1' + t,    t = V' u,    V' = int exp(s [w]x) ds from -1/2 to 1/2
//! V' = I + (1 - sin(a / 2) / (a / 2)) / a^2 [w]x^2,    a = |w|
//! ```
//!
//! `V'` is symmetric and has no part of first order in `w`. The picture's points of both ends, `eta_1'` and
//! `eta_2'`, lie on a line through the epipole, and with `nu = 1 / Z_2'`
//!
//! ```text
//! eta_2' - eta_1' = nu G(eta_1') t        exactly, however long the displacement
//! ```
//!
//! A rotation that is `d` more than the one that was taken out adds `R V' d` across the line to first order,
//! with `R = (1 - nu t_z / 2) R(m)` and the middle `m` of both ends, as `exp([w + d]x) = exp([w]x / 2)
//! exp([V' d]x) exp([w]x / 2)`. So the rows `G(eta_1') V'`, `R V'` with the flow `eta_2' - eta_1' + R V' w`
//! (and `V' w = w`) have the same unknowns `(u, w)` as those of instantaneous flow, and are exact where the
//! rotation taken out is the motion's own.
//!
//! At the middle the same holds, with `nu = 2 / (Z_1' + Z_2')`; but there the noise of the second view's
//! point is in `m`, too, and the residual across the line is its distance from the epipolar line times `2
//! Z_2' / (Z_1' + Z_2')`: a motion that takes all depths far away would make any flow fit.

use super::rows::{Rows, cross_matrix};
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// Angle, rad, below which series are exact to double precision where closed forms cancel.
const SMALL: f64 = 1e-3;

/// The most, relative to the depth half way, that the depth of a point may change on half of its way.
const CHANGE: f64 = 0.5;

/// A rotation that is taken out of displacements, half of it from each end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Derotation {
    /// `w`, rad/frame.
    pub rotation: Vector3<f64>,
    /// `exp([w]x / 2)`.
    half: Matrix3<f64>,
    /// `V'`.
    pub mean: Matrix3<f64>,
    /// `(1 - cos(a / 2)) / a^2`.
    lag: f64,
    /// `t = V' u` in the direction that is known, which the rows of `w` depend on a little; 0 where none is.
    towards: Vector3<f64>,
}

/// A displacement with the rotation taken out.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DerotatedFlow {
    /// `m`, half way between both ends.
    pub middle: [f64; 2],
    /// The rows of `u` at the first of both ends, free of the flow's noise, and of `w` half way.
    pub rows: Rows,
    /// `eta_2' - eta_1'`.
    pub left: Vector2<f64>,
    /// The same with what the rows have for the rotation: what `nu G u + R w` is to be.
    pub flow: Vector2<f64>,
    /// What noise of the second view's point is multiplied with.
    pub spread: Matrix2<f64>,
    /// The slope of the first view's point by what it was.
    pub first: Matrix2<f64>,
}

/// The picture of `A (x, y, 1)` and its slope by `(x, y)`; `None` behind the camera.
fn pictured(a: &Matrix3<f64>, [x, y]: [f64; 2]) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let p = a * Vector3::new(x, y, 1.0);
    // Not a number is not before the camera either.
    let before = p.z > 0.0;
    if !before {
        return None;
    }
    let at = p.xy() / p.z;
    let slope = |i: usize, j: usize| (a[(i, j)] - at[i] * a[(2, j)]) / p.z;
    Some((at, Matrix2::from_fn(slope)))
}

impl Derotation {
    /// Takes out the rotation `w`, rad/frame.
    pub fn new(rotation: &Vector3<f64>) -> Self {
        let a = rotation.norm();
        let square = a * a;
        let (shorter, lag) = if a < SMALL {
            (1.0 / 24.0 - square / 1920.0, 0.125 - square / 384.0)
        } else {
            let half = 0.5 * a;
            ((1.0 - half.sin() / half) / square, 2.0 * ((0.5 * half).sin() / a).powi(2))
        };
        let cross = cross_matrix(rotation);
        Self {
            rotation: *rotation,
            half: *nalgebra::Rotation3::new(0.5 * rotation).matrix(),
            mean: Matrix3::identity() + shorter * cross * cross,
            lag,
            towards: Vector3::zeros(),
        }
    }

    /// Takes out the rotation of a motion along `translation`, by which its rows change a little.
    pub fn along(rotation: &Vector3<f64>, translation: &Vector3<f64>) -> Self {
        let turn = Self::new(rotation);
        let towards = turn.mean * translation;
        if towards.iter().all(|value| value.is_finite()) { Self { towards, ..turn } } else { turn }
    }

    /// The rows of `w` for a displacement `left` from `from` with the rows `g` of `u`: at its middle, times
    /// `(Z_1' + Z_2') / (2 Z_2') = 1 - nu t_z / 2`, by which its depth changes them.
    ///
    /// Of the displacement only what lies along the epipolar line of the direction that is known counts: what
    /// is across is the noise of the residual, and rows that go with it would not leave the sum of their
    /// products zero. Depths that noise has change the rows rather by less than by far too much.
    fn rotation_rows(&self, from: &Vector2<f64>, g: &Matrix2x3<f64>, left: &Vector2<f64>) -> Matrix2x3<f64> {
        let t = g * self.towards;
        let square = t.norm_squared();
        let known = square > 0.0;
        let along = if known { t.dot(left) / square } else { 0.0 };
        let way = if known { t * along } else { *left };
        let change = (0.5 * self.towards.z * along).clamp(-CHANGE, CHANGE);
        Rows::plane((from + 0.5 * way).into()).r * (1.0 - change)
    }

    /// The displacement from `first` to `second`, places on the plane at distance 1, without the rotation;
    /// `None` where that leads behind the camera.
    pub fn out_of(&self, first: [f64; 2], second: [f64; 2]) -> Option<DerotatedFlow> {
        let (from, at_first) = pictured(&self.half, first)?;
        let (to, spread) = pictured(&self.half.transpose(), second)?;
        let middle: [f64; 2] = (0.5 * (from + to)).into();
        let (left, g) = (to - from, Rows::plane(from.into()).g);
        let turning = self.rotation_rows(&from, &g, &left);
        let rows = Rows { g: g * self.mean, r: turning * self.mean };
        let flow = left + turning * self.rotation;
        Some(DerotatedFlow { middle, rows, left, flow, spread, first: at_first })
    }

    /// The displacement over the whole frame of a point of the first view, on the plane at distance 1, whose
    /// inverse depth half way in time is `nu`, under the translation `u`; NaN behind the camera.
    ///
    /// With `c = int exp(s [w]x) u ds` from 0 to 1/2 the depth half way is `Z (exp([w]x / 2) eta)_z + c_z`.
    pub fn displacement(&self, u: &Vector3<f64>, [x, y]: [f64; 2], nu: f64) -> Vector2<f64> {
        let turned = self.half * Vector3::new(x, y, 1.0);
        let (t, reached) = (self.mean * u, 0.5 * self.mean * u + self.lag * self.rotation.cross(u));
        let first = nu * turned.z / (1.0 - nu * reached.z);
        // From the orientation half way on to that of the second view.
        let after = self.half * (turned + first * t);
        if after.z > 0.0 && turned.z > 0.0 {
            after.xy() / after.z - Vector2::new(x, y)
        } else {
            Vector2::repeat(f64::NAN)
        }
    }

    /// Inverse depths half way in time from those in the rows, for the translation `u`.
    pub fn half_way(&self, u: &Vector3<f64>) -> MidpointDepth {
        MidpointDepth { ahead: self.lag * self.rotation.cross(u).z + self.middle(u).ahead }
    }

    /// Those half way between both ends.
    pub fn middle(&self, u: &Vector3<f64>) -> MidpointDepth {
        MidpointDepth { ahead: -0.5 * (self.mean * u).z }
    }
}

/// From inverse depths in rows that a rotation was taken out of to those half way in time.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MidpointDepth {
    /// How much farther along the optical axis a point is there than at the second end, in units of `|u|`:
    /// `(X_1' + X_2') / 2 = X_2' - t / 2` half way between both ends, and half way in time `(X_1' + X_2') / 2
    /// + (1 - cos(a / 2)) / a^2 (w x u)`.
    ahead: f64,
}

impl MidpointDepth {
    /// `1 / (1 / nu + ahead)`.
    pub fn depth(self, nu: f64) -> f64 {
        nu / (1.0 + nu * self.ahead)
    }

    /// The slope of that by `nu`.
    pub fn slope(self, nu: f64) -> f64 {
        (1.0 + nu * self.ahead).powi(-2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::Motion;

    /// `(first, second, depth half way)` of a point under a motion over a whole frame.
    fn seen(motion: &Motion, first: [f64; 2], nu: f64) -> ([f64; 2], [f64; 2], f64) {
        let turn = Matrix3::from_fn(|i, j| motion.rotation_matrix()[i][j]);
        let before = Vector3::new(first[0], first[1], 1.0) / nu;
        let after = turn * before + Vector3::from(motion.displacement());
        let half = Motion { translation: motion.translation, rotation: motion.rotation.map(|w| 0.5 * w) };
        let turn = Matrix3::from_fn(|i, j| half.rotation_matrix()[i][j]);
        let middle = turn * before + 0.5 * Vector3::from(half.displacement());
        (first, (after.xy() / after.z).into(), middle.z)
    }

    #[test]
    fn rows_are_exact_for_the_rotation_that_was_taken_out() {
        for rotation in [[0.0; 3], [1e-4, -2e-4, 1e-4], [0.1, -0.2, 0.15], [0.4, 0.3, -0.2]] {
            let motion = Motion::new([0.6, 0.2, 0.75], rotation);
            let turn = Derotation::new(&motion.w());
            for (first, nu) in [([0.4, -0.3], 0.2), ([-0.5, 0.1], 0.05), ([0.0, 0.0], 1e-3)] {
                let (first, second, depth) = seen(&motion, first, nu);
                let turned = turn.out_of(first, second).unwrap();
                let (t, d) = (turned.rows.g * motion.u(), turned.flow - turned.rows.r * motion.w());
                let across = (t.y * d.x - t.x * d.y) / t.norm();
                assert!(across.abs() < 1e-14, "{rotation:?}: {across}");
                let got = turn.half_way(&motion.u()).depth(t.dot(&d) / t.norm_squared());
                assert!((got * depth - 1.0).abs() < 1e-6, "{rotation:?}: {got} {depth}");
                let moved = turn.displacement(&motion.u(), first, 1.0 / depth);
                assert!((moved - (Vector2::from(second) - Vector2::from(first))).norm() < 1e-14, "{rotation:?}");
            }
        }
    }

    /// A rotation that is a little more shows as the rows of `w` have it.
    #[test]
    fn the_rows_of_the_rotation_are_its_slope() {
        let rotation = Vector3::new(0.1, -0.2, 0.15);
        let motion = Motion::new([0.6, 0.2, 0.75], rotation.into());
        let (first, second, _) = seen(&motion, [0.4, -0.3], 0.02);
        let here = Derotation::new(&rotation).out_of(first, second).unwrap();
        for axis in 0..3 {
            let by = Vector3::ith(axis, 1e-6);
            let left = |w: Vector3<f64>| {
                let turned = Derotation::new(&w).out_of(first, second).unwrap();
                turned.flow - Rows::plane(turned.middle).r * w
            };
            let slope = (left(rotation + by) - left(rotation - by)) / 2e-6;
            let off = (slope + here.rows.r.column(axis)).norm();
            // The displacement that is left moves the middle, too.
            assert!(off < 0.03, "{axis}: {off}");
        }
    }

    #[test]
    fn series_join_the_closed_forms() {
        let axis = Vector3::new(0.6, -0.48, 0.64);
        let (below, above) = (Derotation::new(&(axis * 0.999e-3)), Derotation::new(&(axis * 1.001e-3)));
        assert!((below.lag - above.lag).abs() < 1e-9 && (below.mean - above.mean).norm() < 1e-9);
        assert!((above.lag - 0.125).abs() < 1e-8);
    }

    #[test]
    fn noise_of_the_second_view_is_multiplied_by_the_slope() {
        let turn = Derotation::new(&Vector3::new(0.2, -0.1, 0.3));
        let (first, second, h) = ([0.3, -0.2], [0.35, -0.1], 1e-6);
        let here = turn.out_of(first, second).unwrap();
        let ends = |second: [f64; 2]| pictured(&turn.half.transpose(), second).unwrap().0;
        for axis in 0..2 {
            let moved = |by: f64| ends(std::array::from_fn(|i| second[i] + if i == axis { by } else { 0.0 }));
            let slope = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((slope - here.spread.column(axis)).norm() < 1e-9);
        }
    }
}
