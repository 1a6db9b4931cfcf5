//! The pinhole camera: from pixels to the plane at distance 1 and back.

use crate::error::{Error, Result, number, numbers};
use nalgebra::{Matrix2, Matrix3, Matrix6, Vector3};

/// The intrinsics matrix `K` of a pinhole camera: `(px, py, 1) = K (x, y, 1)`, skew and unequal focal lengths
/// included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    matrix: Matrix3<f64>,
    inverse: Matrix3<f64>,
}

impl Intrinsics {
    /// From `K`, row by row, px.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `K` unless it is an upper triangle with the last row `(0, 0, 1)`, finite
    /// and with positive focal lengths.
    pub fn new(matrix: [[f64; 3]; 3]) -> Result<Self> {
        let k = Matrix3::from_fn(|i, j| matrix[i][j]);
        let refuse =
            |got: String| Err(Error::argument("K", "a camera matrix [[fx, s, cx], [0, fy, cy], [0, 0, 1]]", got));
        if k.iter().any(|value| !value.is_finite()) {
            return refuse("entries that are not finite".into());
        }
        if matrix[2] != [0.0, 0.0, 1.0] {
            return refuse(format!("the last row {}", numbers(&matrix[2])));
        }
        if matrix[1][0] != 0.0 {
            return refuse(format!("K[1][0] = {}", number(matrix[1][0])));
        }
        if !(matrix[0][0] > 0.0 && matrix[1][1] > 0.0) {
            return refuse(format!("the focal lengths {} and {}", number(matrix[0][0]), number(matrix[1][1])));
        }
        match k.try_inverse() {
            Some(inverse) if inverse.iter().all(|value| value.is_finite()) => Ok(Self { matrix: k, inverse }),
            _ => refuse("one without an inverse".into()),
        }
    }

    /// A camera without skew: focal lengths and principal point, px.
    ///
    /// # Errors
    /// As [`Intrinsics::new`].
    pub fn pinhole(focal: (f64, f64), centre: (f64, f64)) -> Result<Self> {
        Self::new([[focal.0, 0.0, centre.0], [0.0, focal.1, centre.1], [0.0, 0.0, 1.0]])
    }

    /// `K`, row by row.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        std::array::from_fn(|i| std::array::from_fn(|j| self.matrix[(i, j)]))
    }

    /// A pixel's place `(x, y)` on the plane at distance 1: `K^-1 (px, py, 1)`.
    pub fn to_plane(&self, pixel: [f64; 2]) -> [f64; 2] {
        let at = self.inverse * Vector3::new(pixel[0], pixel[1], 1.0);
        [at.x, at.y]
    }

    /// The pixel of a place on the plane: `K (x, y, 1)`.
    pub fn to_pixel(&self, plane: [f64; 2]) -> [f64; 2] {
        let at = self.matrix * Vector3::new(plane[0], plane[1], 1.0);
        [at.x, at.y]
    }

    /// `A = (K^-1)[:2, :2]`, which maps flow: `f = A f_px`; covariances map as `A S A^t`.
    pub(crate) fn scale(&self) -> Matrix2<f64> {
        self.inverse.fixed_view::<2, 2>(0, 0).into_owned()
    }

    /// `K[:2, :2]`, the inverse of [`Intrinsics::scale`].
    pub(crate) fn unscale(&self) -> Matrix2<f64> {
        self.matrix.fixed_view::<2, 2>(0, 0).into_owned()
    }

    /// `B = blockdiag(A, kron(A^-T, A))`, which maps `(u, v, u_x, v_x, u_y, v_y)`; covariances map as `B C
    /// B^t`.
    pub(crate) fn affine_scale(&self) -> Matrix6<f64> {
        kronecker(&self.scale(), &self.unscale())
    }
}

/// What maps flow to the plane at distance 1, where it lies already without a camera.
pub(crate) fn to_plane(camera: Option<&Intrinsics>) -> Matrix2<f64> {
    camera.map_or_else(Matrix2::identity, Intrinsics::scale)
}

/// `blockdiag(D_2, kron(D_1^-T, D_2))`, which maps `(u, v, u_x, v_x, u_y, v_y)` where flow is mapped by `D_2`
/// and its place by `D_1`, that is invertible: what noise of the six numbers is multiplied with.
pub(crate) fn affine_map(flow: &Matrix2<f64>, place: &Matrix2<f64>) -> Matrix6<f64> {
    kronecker(flow, &place.try_inverse().unwrap_or_else(Matrix2::zeros))
}

/// `blockdiag(A, kron(B^T, A))`.
fn kronecker(a: &Matrix2<f64>, b: &Matrix2<f64>) -> Matrix6<f64> {
    let mut map = Matrix6::zeros();
    map.fixed_view_mut::<2, 2>(0, 0).copy_from(a);
    // vec(A M B) = kron(B^T, A) vec(M), columns first: (u_x, v_x), (u_y, v_y).
    for i in 0..2 {
        for j in 0..2 {
            map.fixed_view_mut::<2, 2>(2 + 2 * i, 2 + 2 * j).copy_from(&(a * b[(j, i)]));
        }
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    #[test]
    fn affine_flow_maps_as_its_parts_do() {
        let camera = Intrinsics::new([[500.0, 3.0, 310.0], [0.0, 420.0, 245.0], [0.0, 0.0, 1.0]]).unwrap();
        let jacobian = Matrix2::new(0.01, -0.02, 0.03, 0.005);
        let m = Vector6::new(1.5, -0.7, 0.01, 0.03, -0.02, 0.005);
        let mapped = camera.affine_scale() * m;
        let flow = camera.scale() * nalgebra::Vector2::new(1.5, -0.7);
        let slopes = camera.scale() * jacobian * camera.unscale();
        let want = [flow.x, flow.y, slopes[(0, 0)], slopes[(1, 0)], slopes[(0, 1)], slopes[(1, 1)]];
        for (got, want) in mapped.iter().zip(want) {
            assert!((got - want).abs() < 1e-15, "{got} {want}");
        }
        let there = camera.to_pixel(camera.to_plane([17.0, 400.0]));
        assert!((there[0] - 17.0).abs() < 1e-10 && (there[1] - 400.0).abs() < 1e-10);
    }

    #[test]
    fn matrices_that_are_no_camera_are_refused() {
        for wrong in [
            [[500.0, 0.0, 0.0], [0.0, 500.0, 0.0], [0.0, 0.0, 2.0]],
            [[500.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
            [[f64::NAN, 0.0, 0.0], [0.0, 500.0, 0.0], [0.0, 0.0, 1.0]],
            [[-500.0, 0.0, 0.0], [0.0, 500.0, 0.0], [0.0, 0.0, 1.0]],
            [[-500.0, 0.0, 0.0], [0.0, -500.0, 0.0], [0.0, 0.0, 1.0]],
            [[500.0, 0.0, 0.0], [10.0, 500.0, 0.0], [0.0, 0.0, 1.0]],
        ] {
            let message = Intrinsics::new(wrong).unwrap_err().to_string();
            assert!(message.starts_with("K: expected a camera matrix"), "{message}");
        }
    }
}
