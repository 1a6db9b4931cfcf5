//! The structure tensor of a window: sums or means of products of brightness gradients.

/// `(xx, xy; xy, yy)`, the normal matrix of a translation (B. Lucas and T. Kanade, 1981).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StructureTensor {
    /// Of the derivatives along x, squared.
    pub xx: f64,
    /// Of both derivatives.
    pub xy: f64,
    /// Of the derivatives along y, squared.
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
