//! The structure tensor of a window: sums or means of products of brightness gradients.

/// `(xx, xy; xy, yy)`, the normal matrix of a translation (B. Lucas and T. Kanade, 1981).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StructureTensor {
    pub xx: f64,
    pub xy: f64,
    pub yy: f64,
}

impl StructureTensor {
    /// Determinant.
    pub fn determinant(self) -> f64 {
        self.xx * self.yy - self.xy * self.xy
    }

    /// The larger eigenvalue; NaN where an entry is.
    pub fn larger_eigenvalue(self) -> f64 {
        0.5 * (self.xx + self.yy + self.eigenvalue_difference())
    }

    /// The smaller eigenvalue; NaN where an entry is.
    pub fn smaller_eigenvalue(self) -> f64 {
        0.5 * (self.xx + self.yy - self.eigenvalue_difference())
    }

    fn eigenvalue_difference(self) -> f64 {
        ((self.xx - self.yy).powi(2) + 4.0 * self.xy * self.xy).sqrt()
    }

    /// The step that solves `tensor step = right`; not finite where the tensor is singular.
    pub fn solve(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let determinant = self.determinant();
        [(self.yy * x - self.xy * y) / determinant, (self.xx * y - self.xy * x) / determinant]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvalues_and_steps_are_those_of_the_matrix() {
        let tensor = StructureTensor { xx: 3.0, xy: -1.2, yy: 0.9 };
        let matrix = nalgebra::Matrix2::new(3.0, -1.2, -1.2, 0.9);
        let eigenvalues: nalgebra::Vector2<f64> = matrix.symmetric_eigenvalues();
        assert!((tensor.smaller_eigenvalue() - eigenvalues.min()).abs() < 1e-14);
        assert!((tensor.larger_eigenvalue() - eigenvalues.max()).abs() < 1e-14);
        let step = tensor.solve([0.7, -2.0]);
        let right = matrix * nalgebra::Vector2::from(step);
        assert!((right[0] - 0.7).abs() < 1e-14 && (right[1] + 2.0).abs() < 1e-14);
        assert!(!StructureTensor { xx: 1.0, xy: 1.0, yy: 1.0 }.solve([1.0, 0.0])[0].is_finite());
    }
}
