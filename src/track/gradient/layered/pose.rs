//! Where the target is: an affine map from its own coordinates into the picture.

/// `W(xi) = p + A xi`, px.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Pose {
    pub p: [f64; 2],
    /// Row by row.
    pub a: [[f64; 2]; 2],
}

/// Unknowns of an increment, in target coordinates: `d_x, d_y, B_xx, B_xy, B_yx, B_yy`.
pub(super) type Increment = [f64; 6];

impl Pose {
    /// Upright and as large as at first.
    pub fn at(p: [f64; 2]) -> Self {
        Self { p, a: [[1.0, 0.0], [0.0, 1.0]] }
    }

    /// A point of the target in the picture.
    #[inline(always)]
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.p[0] + self.a[0][0] * x + self.a[0][1] * y, self.p[1] + self.a[1][0] * x + self.a[1][1] * y]
    }

    /// A vector of the target in the picture.
    pub fn turn(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.a[0][0] * x + self.a[0][1] * y, self.a[1][0] * x + self.a[1][1] * y]
    }

    /// `p += A d`, `A <- A (I + B)`.
    pub fn moved(&self, by: &Increment) -> Self {
        let step = self.turn([by[0], by[1]]);
        let b = [[1.0 + by[2], by[3]], [by[4], 1.0 + by[5]]];
        Self { p: [self.p[0] + step[0], self.p[1] + step[1]], a: product(self.a, b) }
    }

    /// Size over that at first: the root of the determinant.
    pub fn scale(&self) -> f64 {
        let [[a, b], [c, d]] = self.a;
        (a * d - b * c).abs().sqrt()
    }

    /// How much longer than at first it is along the picture's axes, turning apart: the diagonal of `S` in `A
    /// = S R`, `S` being the root of `A A'`.
    pub fn stretch(&self) -> [f64; 2] {
        let square = self.a.map(|row| row[0] * row[0] + row[1] * row[1]);
        let root = self.scale().powi(2);
        let norm = (square[0] + square[1] + 2.0 * root).sqrt();
        square.map(|s| if norm > 0.0 { (s + root) / norm } else { 0.0 })
    }

    /// Angle turned, rad in (-pi, pi], from x towards y: that of the nearest similarity.
    pub fn angle(&self) -> f64 {
        let [[a, b], [c, d]] = self.a;
        (c - b).atan2(a + d)
    }

    /// The same at another angle, rad.
    pub fn turned_to(&self, angle: f64) -> Self {
        let (sin, cos) = (angle - self.angle()).sin_cos();
        Self { a: product([[cos, -sin], [sin, cos]], self.a), ..*self }
    }

    /// Half the sides of the upright box around a turned one with these half sides.
    pub fn reach(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        self.a.map(|row| row[0].abs() * x + row[1].abs() * y)
    }
}

fn product(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn increments_are_taken_in_target_coordinates() {
        let turned = Pose { p: [10.0, 5.0], a: [[0.0, -2.0], [2.0, 0.0]] };
        assert_eq!((turned.scale(), turned.angle()), (2.0, std::f64::consts::FRAC_PI_2));
        let moved = turned.moved(&[1.0, 0.0, 0.1, 0.0, 0.0, 0.1]);
        assert_eq!(moved.p, [10.0, 7.0]);
        assert!((moved.scale() - 2.2).abs() < 1e-12);
        assert_eq!(turned.apply([1.0, 3.0]), [4.0, 7.0]);
        for angle in [0.0, -0.7, 3.0] {
            let held = turned.turned_to(angle);
            assert!((held.angle() - angle).abs() < 1e-12 && (held.scale() - 2.0).abs() < 1e-12);
        }
        assert_eq!(turned.reach([3.0, 1.0]), [2.0, 6.0]);
        assert_eq!(turned.stretch(), [2.0, 2.0]);
        // Turned by a right angle and then stretched along y.
        let stretched = Pose { p: [0.0; 2], a: [[0.0, -1.0], [3.0, 0.0]] };
        assert!((stretched.stretch()[0] - 1.0).abs() < 1e-12 && (stretched.stretch()[1] - 3.0).abs() < 1e-12);
    }
}
