//! Axes across a direction, and Newton's method for a few unknowns.

use nalgebra::{Matrix2x3, SMatrix, SVector, Vector3};

/// Two unit vectors `e1`, `e2` with `e1 x e2 = direction` (of length 1), as rows; the same for the same
/// direction.
pub fn tangents(direction: &Vector3<f64>) -> Matrix2x3<f64> {
    // The axis least along the direction keeps the cross product well away from zero.
    let axis = direction.iamin();
    let first = Vector3::ith(axis, 1.0).cross(direction).normalize();
    let second = direction.cross(&first);
    Matrix2x3::from_rows(&[first.transpose(), second.transpose()])
}

/// Tangent axes of another direction `u`, each on the side where it was.
pub fn carried(axes: &Matrix2x3<f64>, u: &Vector3<f64>) -> Matrix2x3<f64> {
    let [first, second] = [0, 1].map(|row| axes.row(row).transpose());
    let first = (first - u * u.dot(&first)).normalize();
    let across = u.cross(&first);
    let second = across * second.dot(&across).signum();
    Matrix2x3::from_rows(&[first.transpose(), second.transpose()])
}

/// Most Newton steps, and the length of one that is the last.
const STEPS: usize = 30;
const STEP: f64 = 1e-11;

/// Newton's method: where the value that `at` gives with its slopes is zero, near `here`.
pub fn root<const N: usize, S>(
    mut here: S,
    at: impl Fn(&S) -> (SVector<f64, N>, SMatrix<f64, N, N>),
    moved: impl Fn(&S, &SVector<f64, N>) -> S,
) -> Option<S> {
    for _ in 0..STEPS {
        let (value, slopes) = at(&here);
        let step = slopes.try_inverse()? * -value;
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        here = moved(&here, &step);
        if step.norm() < STEP {
            return Some(here);
        }
    }
    None
}
