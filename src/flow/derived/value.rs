//! Values of derived quantities, with their standard deviations by propagation.

use super::Quantity;

/// Value of `quantity` for the motion `m = (u, v, u_x, v_x, u_y, v_y)` at the point `at = (x, y)`, with its
/// standard deviation where the covariance of m is given.
///
/// Per second where `frame_period` (seconds) is given, else per frame; positions and speed in the unit of `m`
/// and `at` (px, or units of the pitch). [`Quantity::Rpm`] without a frame period is NaN. Quantities that do
/// not exist for this motion (the centre of a motion without one, the shear axis of no shear) are NaN or
/// infinite. The standard deviation is first-order: `sqrt(grad^T Cov(m) grad)`.
pub fn value_and_std(
    quantity: Quantity,
    m: [f64; 6],
    covariance: Option<[[f64; 6]; 6]>,
    at: (f64, f64),
    frame_period: Option<f64>,
) -> (f64, Option<f64>) {
    let (value, gradient) = value_and_gradient(quantity, &m, at);
    let per_second = frame_period.map_or(1.0, |dt| dt.powi(-quantity.rate()));
    let scale = match quantity {
        // rad/frame -> revolutions per minute.
        Quantity::Rpm => frame_period.map_or(f64::NAN, |dt| 60.0 / (std::f64::consts::TAU * dt)),
        _ => per_second,
    };
    let sd = covariance.map(|c| {
        let variance: f64 = (0..6).map(|i| gradient[i] * (0..6).map(|j| c[i][j] * gradient[j]).sum::<f64>()).sum();
        // Rounding may leave a variance of zero slightly negative.
        (if variance < 0.0 { 0.0 } else { variance }).sqrt() * scale.abs()
    });
    (value * scale, sd)
}

/// Value per frame and its derivative with respect to `m`.
fn value_and_gradient(quantity: Quantity, m: &[f64; 6], at: (f64, f64)) -> (f64, [f64; 6]) {
    let [u, v, ux, vx, uy, vy] = *m;
    match quantity {
        Quantity::Divergence => (ux + vy, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]),
        Quantity::Curl => (vx - uy, [0.0, 0.0, 0.0, 1.0, -1.0, 0.0]),
        Quantity::AngularVelocity | Quantity::Rpm => (0.5 * (vx - uy), [0.0, 0.0, 0.0, 0.5, -0.5, 0.0]),
        Quantity::StrainXx => (ux, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        Quantity::StrainXy => (0.5 * (uy + vx), [0.0, 0.0, 0.0, 0.5, 0.5, 0.0]),
        Quantity::StrainYy => (vy, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        Quantity::ShearMagnitude => {
            let (normal, shear) = (ux - vy, uy + vx);
            let size = normal.hypot(shear);
            let (c, s) = (normal / size, shear / size);
            (size, [0.0, 0.0, c, s, s, -c])
        }
        Quantity::ShearAxis => {
            let (normal, shear) = (ux - vy, uy + vx);
            let square = normal * normal + shear * shear;
            let (c, s) = (0.5 * normal / square, 0.5 * shear / square);
            let angle = if square > 0.0 { 0.5 * shear.atan2(normal) } else { f64::NAN };
            (angle, [0.0, 0.0, -s, c, c, s])
        }
        Quantity::RotationCentreX => {
            let (offset, rows) = centre_offset(m);
            (at.0 - offset[0], rows[0].map(|d| -d))
        }
        Quantity::RotationCentreY => {
            let (offset, rows) = centre_offset(m);
            (at.1 - offset[1], rows[1].map(|d| -d))
        }
        Quantity::CentreDistance => {
            let (offset, rows) = centre_offset(m);
            let distance = offset[0].hypot(offset[1]);
            let (c, s) = (offset[0] / distance, offset[1] / distance);
            (distance, std::array::from_fn(|k| c * rows[0][k] + s * rows[1][k]))
        }
        Quantity::TimeToContact => {
            let divergence = ux + vy;
            let slope = -2.0 / (divergence * divergence);
            (2.0 / divergence, [0.0, 0.0, slope, 0.0, 0.0, slope])
        }
        Quantity::Speed => {
            let speed = u.hypot(v);
            (speed, [u / speed, v / speed, 0.0, 0.0, 0.0, 0.0])
        }
    }
}

/// `d = M^-1 (u, v)` and the rows of its derivative: from `M d = (u, v)`, `M dd = d(u, v) - dM d`.
fn centre_offset(m: &[f64; 6]) -> ([f64; 2], [[f64; 6]; 2]) {
    let [u, v, ux, vx, uy, vy] = *m;
    let det = ux * vy - uy * vx;
    let inverse = [[vy / det, -uy / det], [-vx / det, ux / det]];
    let apply = |r: usize, a: f64, b: f64| inverse[r][0] * a + inverse[r][1] * b;
    let d = [apply(0, u, v), apply(1, u, v)];
    let row = |r: usize| {
        [
            inverse[r][0],
            inverse[r][1],
            -inverse[r][0] * d[0],
            -inverse[r][1] * d[0],
            -inverse[r][0] * d[1],
            -inverse[r][1] * d[1],
        ]
    };
    (d, [row(0), row(1)])
}
