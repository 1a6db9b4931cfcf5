//! Values of derived quantities, with their standard deviations by propagation.

use super::{Quantity, rate::rate};
use crate::math::Real;
use crate::types::{FlowField, Interval, Units};

/// An affine motion `(u, v, u_x, v_x, u_y, v_y)` at a point of a field.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// The parameters, in the units.
    pub parameters: [f64; 6],
    /// Their covariance, if it is known.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// The point `(x, y)`, in the unit of length.
    pub at: (f64, f64),
    /// The time over which the motion is taken.
    pub interval: Interval,
    /// What lengths and times are measured in.
    pub units: &'a Units,
}

impl<'a> Motion<'a> {
    /// The motion of site `index` of a field.
    pub fn at_site<T: Real>(field: &'a FlowField<T>, index: usize) -> Self {
        let (x, y) = field.layout.sites.pixel(index % field.width, index / field.width);
        let (dx, dy) = field.layout.units.pixel_pitch;
        Self {
            parameters: field.affine(index).to_array().map(Real::to_f64),
            covariance: field.covariance_at(index),
            at: (x as f64 * dx, y as f64 * dy),
            interval: field.layout.interval,
            units: &field.layout.units,
        }
    }
}

/// A number with its derivative by the parameters, or the length of a vector.
enum Form {
    Number(f64, [f64; 6]),
    Length([f64; 2], [[f64; 6]; 2]),
}

/// Value of `quantity` for a motion, with its standard deviation where the covariance is known.
///
/// [`Quantity::Rpm`] without a frame period is NaN. Quantities that do not exist for this motion (the centre
/// of a motion without one, the shear axis of no shear) are NaN or infinite. The standard deviation is
/// first-order: `sqrt(grad^T Cov(m) grad)`.
pub fn value_and_std(quantity: Quantity, motion: &Motion<'_>) -> (f64, Option<f64>) {
    evaluate(quantity, motion, false)
}

/// As [`value_and_std`], without what noise adds to the length of a vector: `|d|^2 - trace(Cov d)` in place
/// of the square, not below 0.
pub fn unbiased_value_and_std(quantity: Quantity, motion: &Motion<'_>) -> (f64, Option<f64>) {
    evaluate(quantity, motion, true)
}

fn evaluate(quantity: Quantity, motion: &Motion<'_>, is_unbiased: bool) -> (f64, Option<f64>) {
    let product = |a: &[f64; 6], b: &[f64; 6]| {
        motion.covariance.map(|c| (0..6).map(|i| a[i] * (0..6).map(|j| c[i][j] * b[j]).sum::<f64>()).sum::<f64>())
    };
    // Rounding may leave a variance of zero slightly negative; NaN stays NaN.
    let not_negative = |value: f64| if value < 0.0 { 0.0 } else { value };
    let (value, gradient) = match form(quantity, motion) {
        Form::Number(value, gradient) => (value, gradient),
        Form::Length([x, y], rows) => {
            let length = x.hypot(y);
            let bias = rows.iter().filter_map(|row| product(row, row)).sum::<f64>();
            let value = if is_unbiased { not_negative(length * length - bias).sqrt() } else { length };
            (value, std::array::from_fn(|k| (x * rows[0][k] + y * rows[1][k]) / length))
        }
    };
    (value, product(&gradient, &gradient).map(|variance| not_negative(variance).sqrt()))
}

fn form(quantity: Quantity, motion: &Motion<'_>) -> Form {
    let [u, v, ux, vx, uy, vy] = motion.parameters;
    let period = motion.units.period();
    let per_frame = [ux, vx, uy, vy].map(|value| value * period);
    let (rates, rows) = rate(motion.interval, per_frame);
    // Rates per unit of time; their derivatives by the Jacobian, per the same unit, are those per frame.
    let combined = |weights: [f64; 4]| {
        let value = weights.iter().zip(rates).map(|(weight, rate)| weight * rate).sum::<f64>() / period;
        let by = |j: usize| (0..4).map(|i| weights[i] * rows[i][j]).sum();
        (value, [0.0, 0.0, by(0), by(1), by(2), by(3)])
    };
    let number = |weights| {
        let (value, gradient) = combined(weights);
        Form::Number(value, gradient)
    };
    let strain = || {
        let (normal, shear) = (combined([1.0, 0.0, 0.0, -1.0]), combined([0.0, 1.0, 1.0, 0.0]));
        ([normal.0, shear.0], [normal.1, shear.1])
    };
    match quantity {
        Quantity::Divergence => number([1.0, 0.0, 0.0, 1.0]),
        Quantity::Curl => number([0.0, 1.0, -1.0, 0.0]),
        Quantity::AngularVelocity => number([0.0, 0.5, -0.5, 0.0]),
        Quantity::Rpm => {
            let per_minute = motion.units.frame_period.map_or(f64::NAN, |_| 60.0 / std::f64::consts::TAU);
            number([0.0, 0.5 * per_minute, -0.5 * per_minute, 0.0])
        }
        Quantity::StrainXx => number([1.0, 0.0, 0.0, 0.0]),
        Quantity::StrainXy => number([0.0, 0.5, 0.5, 0.0]),
        Quantity::StrainYy => number([0.0, 0.0, 0.0, 1.0]),
        Quantity::ShearMagnitude => {
            let (vector, rows) = strain();
            Form::Length(vector, rows)
        }
        Quantity::ShearAxis => {
            let ([normal, shear], rows) = strain();
            let square = normal * normal + shear * shear;
            let angle = if square > 0.0 { 0.5 * shear.atan2(normal) } else { f64::NAN };
            Form::Number(angle, std::array::from_fn(|k| 0.5 * (normal * rows[1][k] - shear * rows[0][k]) / square))
        }
        Quantity::RotationCentreX => {
            let (offset, rows) = centre_offset(&motion.parameters);
            Form::Number(motion.at.0 - offset[0], rows[0].map(|d| -d))
        }
        Quantity::RotationCentreY => {
            let (offset, rows) = centre_offset(&motion.parameters);
            Form::Number(motion.at.1 - offset[1], rows[1].map(|d| -d))
        }
        Quantity::CentreDistance => {
            let (offset, rows) = centre_offset(&motion.parameters);
            Form::Length(offset, rows)
        }
        Quantity::TimeToContact => {
            let (divergence, gradient) = combined([1.0, 0.0, 0.0, 1.0]);
            let (frames, slope) = time_to_contact(motion.interval, 0.5 * divergence * period);
            Form::Number(frames * period, gradient.map(|by| 0.5 * by * slope * period * period))
        }
        Quantity::Speed => Form::Length([u, v], [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]),
    }
}

/// Frames until contact for the mean rate `growth` of lengths, and its derivative. At constant speed the
/// distance `z` at the field's frame becomes `z (1 - 1 / T)` at the next: lengths grow by `1 / (1 - 1 / T)`.
fn time_to_contact(interval: Interval, growth: f64) -> (f64, f64) {
    match interval {
        Interval::Forward => {
            let gone = -(-growth).exp_m1();
            (gone.recip(), (gone - 1.0) / (gone * gone))
        }
        // The mean of the steps before and after is T / (T^2 - 1).
        Interval::Central => {
            let step = growth.sinh();
            let root = (1.0 + 4.0 * step * step).sqrt();
            (0.5 * (1.0 + root) / step, (2.0 / root - 0.5 * (1.0 + root) / (step * step)) * growth.cosh())
        }
        Interval::Instant => (growth.recip(), -(growth * growth).recip()),
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
