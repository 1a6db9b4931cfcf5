//! Signed distances of plain shapes.

/// A shape in a target's own coordinates, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Shape {
    /// All points within `radius` of the line from one end to the other.
    Capsule {
        /// Its ends.
        ends: [[f64; 2]; 2],
        /// Half its thickness.
        radius: f64,
    },
    /// An upright rectangle with round corners.
    Rectangle {
        /// Its centre.
        centre: [f64; 2],
        /// Half its width and height, corners included.
        half: [f64; 2],
        /// Radius of the corners.
        corner: f64,
    },
}

impl Shape {
    /// A disc: a line without length.
    pub(super) fn disc(centre: [f64; 2], radius: f64) -> Self {
        Self::Capsule { ends: [centre; 2], radius }
    }

    /// Distance of a point from the shape's edge, px; negative inside.
    pub(super) fn distance(&self, [x, y]: [f64; 2]) -> f64 {
        match *self {
            Self::Capsule { ends: [from, to], radius } => {
                let (along_x, along_y) = (to[0] - from[0], to[1] - from[1]);
                let (dx, dy) = (x - from[0], y - from[1]);
                let squared = along_x * along_x + along_y * along_y;
                let share = if squared > 0.0 { ((dx * along_x + dy * along_y) / squared).clamp(0.0, 1.0) } else { 0.0 };
                (dx - share * along_x).hypot(dy - share * along_y) - radius
            }
            Self::Rectangle { centre, half, corner } => {
                let dx = (x - centre[0]).abs() - half[0] + corner;
                let dy = (y - centre[1]).abs() - half[1] + corner;
                dx.max(0.0).hypot(dy.max(0.0)) + dx.max(dy).min(0.0) - corner
            }
        }
    }

    /// Share of a pixel that the shape covers: a straight edge is blurred over one pixel.
    pub(super) fn coverage(&self, point: [f64; 2]) -> f64 {
        (0.5 - self.distance(point)).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_adds_up_to_the_area() {
        let sum = |shape: Shape| -> f64 {
            (-20..=20).flat_map(|y| (-20..=20).map(move |x| [x as f64, y as f64])).map(|p| shape.coverage(p)).sum()
        };
        let disc = sum(Shape::disc([0.3, -0.2], 9.0));
        assert!((disc / (std::f64::consts::PI * 81.0) - 1.0).abs() < 0.01, "{disc}");
        let plate = sum(Shape::Rectangle { centre: [0.0, 0.0], half: [10.0, 6.0], corner: 0.0 });
        assert!((plate / 240.0 - 1.0).abs() < 0.01, "{plate}");
    }
}
