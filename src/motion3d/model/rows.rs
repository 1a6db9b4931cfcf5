//! The rows of `f = nu G u + R w` at one point, and of its affine form.

use nalgebra::{Matrix2x3, Matrix3, SMatrix, Vector3};

/// The two rows of `G` and of `R` at one point: `f = nu G u + R w`, in screen axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows {
    pub g: Matrix2x3<f64>,
    pub r: Matrix2x3<f64>,
}

pub(crate) fn cross_matrix(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// Two unit vectors `e1`, `e2` with `e1 x e2 = direction` (of length 1), as rows; the same for the same
/// direction.
pub(crate) fn tangents(direction: &Vector3<f64>) -> Matrix2x3<f64> {
    // The axis least along the direction keeps the cross product well away from zero.
    let axis = direction.iamin();
    let first = Vector3::ith(axis, 1.0).cross(direction).normalize();
    let second = direction.cross(&first);
    Matrix2x3::from_rows(&[first.transpose(), second.transpose()])
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
        Self { g, r: -g * cross_matrix(eta) }
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
