//! A rigid motion: the flow it makes, its finite displacement, its essential matrix.

use super::{rows::AffineRows, rows::Derotation, rows::Rows, rows::Vector5, rows::nested};
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
        nested(nalgebra::Rotation3::new(self.w()).matrix())
    }

    /// The displacement of the whole frame in units of the path's length: `t`, so that `X' = Rot X + t / nu`
    /// for a point with `|u| = 1`.
    pub fn displacement(&self) -> [f64; 3] {
        Derotation::new(&self.w()).frame_translation(&self.u()).into()
    }

    /// The essential matrix `[t]x Rot` of the frame, row by row: `eta'^t E eta = 0` for the two views'
    /// points.
    pub fn essential_matrix(&self) -> [[f64; 3]; 3] {
        nested(&(Vector3::from(self.displacement()).cross_matrix() * nalgebra::Rotation3::new(self.w()).matrix()))
    }
}
