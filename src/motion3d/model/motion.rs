//! A rigid motion: the flow it makes, its finite displacement, its essential matrix.

use super::rows::{AffineRows, Derotation, Rows, Vector5, cross_matrix};
use crate::types::Intrinsics;
use nalgebra::{Matrix2x3, Vector2, Vector3};

/// A rigid motion of the scene relative to the camera over one frame: `X_dot = u + w x X`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Direction `u` of the translation, of length 1 (NaN where there is none).
    pub translation: [f64; 3],
    /// Rotation rate `w`, rad/frame.
    pub rotation: [f64; 3],
}

impl Motion {
    /// A motion along `direction` (of any length above 0; only its direction counts) with the rotation rate
    /// `w`, rad/frame.
    pub fn new(direction: [f64; 3], rotation: [f64; 3]) -> Self {
        Self { translation: Vector3::from(direction).normalize().into(), rotation }
    }

    pub(crate) fn of(u: &Vector3<f64>, w: &Vector3<f64>) -> Self {
        Self { translation: (*u).into(), rotation: (*w).into() }
    }
    pub(crate) fn u(&self) -> Vector3<f64> {
        self.translation.into()
    }
    pub(crate) fn w(&self) -> Vector3<f64> {
        self.rotation.into()
    }

    /// What takes this motion's rotation out of displacements.
    pub(crate) fn derotation(&self) -> Derotation {
        Derotation::along(&self.w(), &self.u())
    }

    /// The same flow with all depths of the other sign.
    pub(crate) fn reversed(&self) -> Self {
        Self { translation: self.translation.map(|value| -value), rotation: self.rotation }
    }

    /// The same with a translation of length 1.
    pub(crate) fn normalized(&self) -> Self {
        Self::new(self.translation, self.rotation)
    }

    /// This motion after a small step `(psi, w)` in the tangent axes of its translation.
    pub(crate) fn stepped(&self, tangent: &Matrix2x3<f64>, step: &Vector5) -> Self {
        let u = self.u() + tangent.transpose() * Vector2::new(step[0], step[1]);
        Self::of(&u.normalize(), &(self.w() + Vector3::new(step[2], step[3], step[4])))
    }

    /// `(psi, w)` from `other`, in the axes `tangent` of its translation, to this motion: to first order.
    pub(crate) fn offset(&self, other: &Self, tangent: &Matrix2x3<f64>) -> Vector5 {
        let (along, turn) = (tangent * (self.u() - other.u()), self.w() - other.w());
        Vector5::new(along.x, along.y, turn.x, turn.y, turn.z)
    }

    /// Angle between the translation directions, rad, 0 to pi.
    pub fn angle_to(&self, other: &Self) -> f64 {
        let (a, b) = (self.u(), other.u());
        a.cross(&b).norm().atan2(a.dot(&b))
    }

    /// Flow `(u, v)` at `(x, y)` of the plane at distance 1 of a point with the inverse depth `nu`: equation
    /// (1).
    pub fn plane_flow(&self, point: [f64; 2], inverse_depth: f64) -> [f64; 2] {
        let rows = Rows::plane(point);
        (rows.g * self.u() * inverse_depth + rows.r * self.w()).into()
    }

    /// Flow at a place of the picture, px with a camera, else as [`Motion::plane_flow`].
    pub fn picture_flow(&self, point: [f64; 2], inverse_depth: f64, camera: Option<&Intrinsics>) -> [f64; 2] {
        let Some(camera) = camera else { return self.plane_flow(point, inverse_depth) };
        let flow = self.plane_flow(camera.to_plane(point), inverse_depth);
        (camera.unscale() * Vector2::from(flow)).into()
    }

    /// Displacement over the whole frame of a place of the first view, px with a camera, else on the plane at
    /// distance 1, as the steady motion has it: exact, with the inverse depth half way in time. NaN where the
    /// point is behind the camera.
    pub fn picture_displacement(&self, point: [f64; 2], inverse_depth: f64, camera: Option<&Intrinsics>) -> [f64; 2] {
        let turn = Derotation::new(&self.w());
        let Some(camera) = camera else { return turn.displacement(&self.u(), point, inverse_depth).into() };
        (camera.unscale() * turn.displacement(&self.u(), camera.to_plane(point), inverse_depth)).into()
    }

    /// Flow of a unit bearing on the sphere, a 3-vector perpendicular to it: equation (1).
    pub fn sphere_flow(&self, bearing: [f64; 3], inverse_range: f64) -> [f64; 3] {
        let eta = Vector3::from(bearing);
        let pull = (self.u().cross(&eta)) * inverse_range + self.w().cross(&eta).cross(&eta);
        eta.cross(&pull).into()
    }

    /// Affine flow `(u, v, u_x, v_x, u_y, v_y)` at `(x, y)` of the plane at distance 1 of a surface with
    /// inverse depth and slopes `(nu, nu_x, nu_y)` there.
    pub fn affine_flow(&self, point: [f64; 2], surface: [f64; 3]) -> [f64; 6] {
        let rows = AffineRows::new(point);
        let m = rows.depth(&self.u()) * Vector3::from(surface) + rows.rotation * self.w();
        m.into()
    }

    /// The rotation matrix of the whole frame, `exp([w]x)`, row by row.
    pub fn rotation_matrix(&self) -> [[f64; 3]; 3] {
        let matrix = *nalgebra::Rotation3::new(self.w()).matrix();
        std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
    }

    /// The displacement of the whole frame in units of the path's length: `t`, so that `X' = Rot X + t / nu`
    /// for a point with `|u| = 1`.
    pub fn displacement(&self) -> [f64; 3] {
        Derotation::new(&self.w()).frame_translation(&self.u()).into()
    }

    /// The essential matrix `[t]x Rot` of the frame, row by row: `eta'^t E eta = 0` for the two views'
    /// points.
    pub fn essential_matrix(&self) -> [[f64; 3]; 3] {
        let rotation = *nalgebra::Rotation3::new(self.w()).matrix();
        let matrix = cross_matrix(&Vector3::from(self.displacement())) * rotation;
        std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::model::rows::tangents;
    use nalgebra::Matrix3;

    fn oblique() -> Motion {
        Motion::new([0.6, 0.2, 0.75], [0.02, -0.03, 0.01])
    }

    fn near(got: &[f64], want: &[f64], tolerance: f64) {
        for (got, want) in got.iter().zip(want) {
            assert!((got - want).abs() < tolerance, "{got} is not {want}");
        }
    }

    #[test]
    fn published_values_of_six_numbers_and_of_the_sphere() {
        let six = oblique().affine_flow([0.2, -0.1], [0.8, 0.3, -0.4]);
        near(&six, &[0.337146, 0.206645, -0.483972, 0.097092, -0.197473, -0.725699], 5e-7);
        near(&six[..2], &oblique().plane_flow([0.2, -0.1], 0.8), 1e-15);
        near(&oblique().sphere_flow([0.48, -0.6, 0.64], 0.8), &[0.222428, 0.472128, 0.275799], 5e-7);
    }

    #[test]
    fn screen_rows_are_the_flow_of_the_sphere() {
        let eta = Vector3::new(0.48, -0.6, 0.64);
        let (rows, axes, motion) = (Rows::sphere(&eta), tangents(&eta), oblique());
        let flow = Vector3::from(motion.sphere_flow(eta.into(), 0.8));
        let model = rows.g * motion.u() * 0.8 + rows.r * motion.w();
        near((axes * flow).as_slice(), model.as_slice(), 1e-15);
        near((axes.row(0).transpose().cross(&axes.row(1).transpose())).as_slice(), eta.as_slice(), 1e-15);
    }

    #[test]
    fn affine_flow_is_the_slope_of_flow() {
        let (motion, at, surface, h) = (oblique(), [0.3, -0.2], [0.8, 0.3, -0.4], 1e-6);
        let flow = |x: f64, y: f64| motion.plane_flow([x, y], 0.8 + 0.3 * (x - at[0]) - 0.4 * (y - at[1]));
        let six = motion.affine_flow(at, surface);
        for i in 0..2 {
            let along_x = (flow(at[0] + h, at[1])[i] - flow(at[0] - h, at[1])[i]) / (2.0 * h);
            let along_y = (flow(at[0], at[1] + h)[i] - flow(at[0], at[1] - h)[i]) / (2.0 * h);
            near(&[six[2 + i], six[4 + i]], &[along_x, along_y], 1e-9);
        }
    }

    #[test]
    fn the_essential_matrix_holds_for_two_views() {
        for rotation in [[0.02, -0.03, 0.01], [1e-6, 0.0, 2e-6], [0.4, 0.3, -0.2]] {
            let motion = Motion::new([0.6, 0.2, 0.75], rotation);
            let (essential, t) = (Matrix3::from_fn(|i, j| motion.essential_matrix()[i][j]), motion.displacement());
            let turn = Matrix3::from_fn(|i, j| motion.rotation_matrix()[i][j]);
            let before = Vector3::new(0.4, -0.7, 3.0);
            let after = turn * before + Vector3::from(t) * 0.3;
            assert!((after.transpose() * essential * before)[0].abs() < 1e-14);
        }
    }
}
