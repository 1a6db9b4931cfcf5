//! A pinhole camera.

use crate::error::{Error, Result, number, numbers};
use nalgebra::{Matrix2, Matrix3, Vector3};

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
}

#[cfg(test)]
mod tests {
    use super::*;

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
