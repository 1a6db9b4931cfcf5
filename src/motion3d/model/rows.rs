//! The rows of `f = nu G u + R w` at one point, of its affine form, and of displacements over a frame.
//!
//! A steady motion takes `X_1` to `X_2` in one frame. Rotated to the camera's orientation half way, `X_1' =
//! exp([w]x / 2) X_1` and `X_2' = exp(-[w]x / 2) X_2`, only a translation is left:
//!
//! ```text
//! X_2' = X_1' + t,    t = V' u,    V' = I + (1 - sin(a / 2) / (a / 2)) / a^2 [w]x^2,    a = |w|
//! eta_2' - eta_1' = nu G(eta_1') t,    nu = 1 / Z_2',    exactly, however long the displacement
//! ```
//!
//! A rotation that is `d` more than the one that was taken out adds `R V' d` across the line to first order,
//! with `R = (1 - nu t_z / 2) R(m)` and the middle `m` of both ends. So the rows `G(eta_1') V'`, `R V'` with
//! the flow `eta_2' - eta_1' + R V' w` (and `V' w = w`) have the unknowns `(u, w)` of instantaneous flow.

use crate::math::tangents;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Rotation3, SMatrix, Vector2, Vector3};

/// The two rows of `G` and of `R` at one point: `f = nu G u + R w`, in screen axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows {
    pub g: Matrix2x3<f64>,
    pub r: Matrix2x3<f64>,
}

/// A matrix row by row.
pub(crate) fn nested<const R: usize, const C: usize>(matrix: &SMatrix<f64, R, C>) -> [[f64; C]; R] {
    matrix.transpose().into()
}

impl Rows {
    /// On the plane at distance 1, axes x and y.
    pub fn plane([x, y]: [f64; 2]) -> Self {
        Self {
            g: Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y),
            r: Matrix2x3::new(-x * y, 1.0 + x * x, -y, -(1.0 + y * y), x * y, x),
        }
    }

    /// On the sphere at the bearing `eta`, axes `e1`, `e2` of [`tangents`]: `G = E (I - eta eta^t) = E`, `R =
    /// -G [eta]x`.
    pub fn sphere(eta: &Vector3<f64>) -> Self {
        let g = tangents(eta);
        Self { g, r: -g * eta.cross_matrix() }
    }
}

/// The six rows of affine flow at a point: `f6 = sum_j lambda_j G_j u + R6 w`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AffineRows {
    point: [f64; 2],
    pub rotation: SMatrix<f64, 6, 3>,
}

impl AffineRows {
    /// At `(x, y)` of the plane at distance 1.
    pub fn new([x, y]: [f64; 2]) -> Self {
        #[rustfmt::skip]
        let rotation = SMatrix::<f64, 6, 3>::from_row_slice(&[
            -x * y, 1.0 + x * x, -y,
            -(1.0 + y * y), x * y, x,
            -y, 2.0 * x, 0.0,
            0.0, y, 1.0,
            -x, 0.0, -1.0,
            -2.0 * y, x, 0.0,
        ]);
        Self { point: [x, y], rotation }
    }

    /// The matrix with the columns `G_0 u`, `G_1 u`, `G_2 u` of `(nu, nu_x, nu_y)`; linear in `u`.
    pub fn depth(&self, u: &Vector3<f64>) -> SMatrix<f64, 6, 3> {
        let [x, y] = self.point;
        let (tx, ty) = (u.x - x * u.z, u.y - y * u.z);
        SMatrix::<f64, 6, 3>::from_row_slice(&[
            tx, 0.0, 0.0, //
            ty, 0.0, 0.0, //
            -u.z, tx, 0.0, //
            0.0, ty, 0.0, //
            0.0, 0.0, tx, //
            -u.z, 0.0, ty,
        ])
    }
}

/// Covariance of `(psi, w)`.
pub(crate) type Matrix5 = SMatrix<f64, 5, 5>;

pub(crate) type Vector5 = SMatrix<f64, 5, 1>;

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
    /// The first end, free of the flow's noise.
    pub from: [f64; 2],
    /// `m`, half way between both ends.
    pub middle: [f64; 2],
    /// The rows of `u` at the first of both ends and of `w` half way.
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
        // Below a thousandth of a radian series are exact to double precision where closed forms cancel.
        let (shorter, lag) = if a < 1e-3 {
            (1.0 / 24.0 - square / 1920.0, 0.125 - square / 384.0)
        } else {
            let half = 0.5 * a;
            ((1.0 - half.sin() / half) / square, 2.0 * ((0.5 * half).sin() / a).powi(2))
        };
        let cross = rotation.cross_matrix();
        Self {
            rotation: *rotation,
            half: *Rotation3::new(0.5 * rotation).matrix(),
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
    /// `(Z_1' + Z_2') / (2 Z_2') = 1 - nu t_z / 2`. Only the part along the known epipolar line counts: the
    /// part across is the residual's noise, which may not correlate with the rows.
    fn rotation_rows(&self, from: &Vector2<f64>, g: &Matrix2x3<f64>, left: &Vector2<f64>) -> Matrix2x3<f64> {
        let t = g * self.towards;
        let square = t.norm_squared();
        let known = square > 0.0;
        let along = if known { t.dot(left) / square } else { 0.0 };
        let way = if known { t * along } else { *left };
        // No more than half of the depth half way.
        let change = (0.5 * self.towards.z * along).clamp(-0.5, 0.5);
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
        Some(DerotatedFlow { from: from.into(), middle, rows, left, flow, spread, first: at_first })
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

    /// The displacement of the whole frame under the translation `u`: `exp([w]x / 2) V' u`.
    pub fn frame_translation(&self, u: &Vector3<f64>) -> Vector3<f64> {
        self.half * (self.mean * u)
    }

    /// Inverse depths half way in time from those in the rows, for the translation `u`.
    pub fn half_way(&self, u: &Vector3<f64>) -> MidpointDepth {
        MidpointDepth { ahead: self.lag * self.rotation.cross(u).z - 0.5 * (self.mean * u).z }
    }

    /// Those at the first end.
    pub fn first_end(&self, u: &Vector3<f64>) -> MidpointDepth {
        MidpointDepth { ahead: -(self.mean * u).z }
    }
}

/// From inverse depths in rows that a rotation was taken out of to those at another time.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MidpointDepth {
    /// How much farther along the optical axis a point is then than at the second end, in units of `|u|`:
    /// `X_1' = X_2' - t`, and half way in time `X_2' - t / 2 + (1 - cos(a / 2)) / a^2 (w x u)`.
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

    /// A rotation that is a little more shows as the rows of `w` have it.
    #[test]
    fn the_rows_of_the_rotation_are_its_slope() {
        let rotation = Vector3::new(0.1, -0.2, 0.15);
        let motion = Motion::new([0.6, 0.2, 0.75], rotation.into());
        let first = [0.4, -0.3];
        let turn = Matrix3::from_fn(|i, j| motion.rotation_matrix()[i][j]);
        let after = turn * Vector3::new(first[0], first[1], 1.0) / 0.02 + Vector3::from(motion.displacement());
        let second = (after.xy() / after.z).into();
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
