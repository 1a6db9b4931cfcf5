//! A box that turns with the target: corners of a large target leave an upright box of its size.

use super::pose::Pose;

#[derive(Debug, Clone, Copy)]
pub(super) struct OrientedBox {
    middle: [f64; 2],
    /// The inverse of the pose's map, row by row.
    inverse: [[f64; 2]; 2],
    /// Half the sides, px of the target.
    half: [f64; 2],
}

impl OrientedBox {
    /// About a place of the picture; the sides in px of the target, with a margin all around: a share of the
    /// side, and px of the picture.
    pub fn about(middle: [f64; 2], pose: &Pose, sides: [f64; 2], (share, more): (f64, f64)) -> Self {
        let [[a, b], [c, d]] = if crate::ablation::keeps("gradient.oriented_box") {
            pose.a
        } else {
            [[pose.scale(), 0.0], [0.0, pose.scale()]]
        };
        let determinant = a * d - b * c;
        let inverse = [[d, -b], [-c, a]].map(|row| row.map(|value| value / determinant));
        let lengths = [a.hypot(c), b.hypot(d)];
        let half = std::array::from_fn(|k| (0.5 + share) * sides[k] + more / lengths[k].max(0.1));
        Self { middle, inverse, half }
    }

    /// Whether it contains a place of the picture.
    pub fn contains(&self, place: [f64; 2]) -> bool {
        let [x, y] = [place[0] - self.middle[0], place[1] - self.middle[1]];
        self.inverse.iter().zip(self.half).all(|([across, along], half)| (across * x + along * y).abs() <= half)
    }

    /// Columns of a row of pixels inside the box: the first, and the one after the last.
    pub fn columns(&self, y: usize, width: usize) -> [usize; 2] {
        let down = y as f64 - self.middle[1];
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for ([across, along], half) in self.inverse.into_iter().zip(self.half) {
            let shift = along * down;
            if across.abs() < 1e-9 {
                if shift.abs() > half {
                    return [0, 0];
                }
                continue;
            }
            let ends = [(-half - shift) / across, (half - shift) / across];
            (low, high) = (low.max(ends[0].min(ends[1])), high.min(ends[0].max(ends[1])));
        }
        if low > high {
            return [0, 0];
        }
        let pixel = |at: f64| at.clamp(0.0, width as f64) as usize;
        [pixel((self.middle[0] + low).ceil()), pixel((self.middle[0] + high).floor() + 1.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_contains_what_the_target_covers() {
        for (angle, scale) in [(0.0, 1.0), (0.3, 1.2), (1.4, 0.7), (std::f64::consts::FRAC_PI_2, 1.0), (-2.5, 1.0)] {
            let pose = Pose { a: [[scale, 0.0], [0.0, scale]], p: [0.0; 2] }.turned_to(angle);
            let (middle, sides) = ([20.3, 18.7], [13.0, 7.0]);
            let oriented = OrientedBox::about(middle, &pose, sides, (0.1, 2.0));
            for y in 0..40 {
                let [first, end] = oriented.columns(y, 33);
                for x in 0..33 {
                    let [dx, dy] = [x as f64 - middle[0], y as f64 - middle[1]];
                    let (sin, cos) = angle.sin_cos();
                    let [u, v] = [(cos * dx + sin * dy) / scale, (cos * dy - sin * dx) / scale];
                    let inside = u.abs() <= 7.8 + 2.0 / scale && v.abs() <= 4.2 + 2.0 / scale;
                    assert_eq!((first..end).contains(&x), inside, "{angle} {x} {y}");
                }
            }
        }
    }
}
