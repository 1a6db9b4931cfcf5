//! The derived quantities of one motion.

use super::gradient;
use crate::error::{Error, Result};

/// A number derived from the affine motion `m = (u, v, u_x, v_x, u_y, v_y)` of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// `u_x + v_y`, 1/frame or 1/s: relative growth of area.
    Divergence,
    /// `v_x - u_y`, 1/frame or 1/s: twice the angular velocity; positive turns x towards y (clockwise on the
    /// screen).
    Curl,
    /// `sqrt((u_x - v_y)^2 + (u_y + v_x)^2)`, 1/frame or 1/s: difference of the two principal rates of
    /// strain.
    ShearMagnitude,
    /// `atan2(u_y + v_x, u_x - v_y) / 2`, rad in (-pi/2, pi/2]: direction of the greatest stretch, from x
    /// towards y.
    ShearAxis,
    /// `u_x`, 1/frame or 1/s: normal strain rate along x.
    StrainXx,
    /// `(u_y + v_x) / 2`, 1/frame or 1/s: shear strain rate.
    StrainXy,
    /// `v_y`, 1/frame or 1/s: normal strain rate along y.
    StrainYy,
    /// `(v_x - u_y) / 2`, rad/frame or rad/s.
    AngularVelocity,
    /// Angular velocity in revolutions per minute; needs the frame period.
    Rpm,
    /// x of the point that does not move, `p - M^-1 (u, v)` (WO2010/098160, 0104); it need not be in the
    /// picture. px or units of the pitch.
    RotationCentreX,
    /// y of that point.
    RotationCentreY,
    /// Distance `|M^-1 (u, v)|` of that point.
    CentreDistance,
    /// `2 / (u_x + v_y)`, frames or s: until contact with an approaching surface parallel to the image;
    /// negative while it recedes.
    TimeToContact,
    /// `sqrt(u^2 + v^2)`, px/frame or px/s.
    Speed,
}

impl Quantity {
    /// Every quantity.
    pub const ALL: [Self; 14] = [
        Self::Divergence,
        Self::Curl,
        Self::ShearMagnitude,
        Self::ShearAxis,
        Self::StrainXx,
        Self::StrainXy,
        Self::StrainYy,
        Self::AngularVelocity,
        Self::Rpm,
        Self::RotationCentreX,
        Self::RotationCentreY,
        Self::CentreDistance,
        Self::TimeToContact,
        Self::Speed,
    ];

    /// The name on the command line, in files and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Self::Divergence => "divergence",
            Self::Curl => "curl",
            Self::ShearMagnitude => "shear_magnitude",
            Self::ShearAxis => "shear_axis",
            Self::StrainXx => "strain_xx",
            Self::StrainXy => "strain_xy",
            Self::StrainYy => "strain_yy",
            Self::AngularVelocity => "angular_velocity",
            Self::Rpm => "rpm",
            Self::RotationCentreX => "rotation_centre_x",
            Self::RotationCentreY => "rotation_centre_y",
            Self::CentreDistance => "centre_distance",
            Self::TimeToContact => "time_to_contact",
            Self::Speed => "speed",
        }
    }

    /// The quantity called `name`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `quantity` for another word.
    pub fn parse(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|q| q.name() == name).ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|q| q.name()).collect();
            Error::argument("quantity", format!("one of {}", names.join(", ")), name)
        })
    }

    /// The unit of its values, with or without a frame period, for a pixel pitch of 1 px.
    pub fn unit(self, per_second: bool) -> &'static str {
        match (self, per_second) {
            (Self::ShearAxis, _) => "rad",
            (Self::AngularVelocity, false) => "rad/frame",
            (Self::AngularVelocity, true) => "rad/s",
            (Self::Rpm, _) => "rpm",
            (Self::RotationCentreX | Self::RotationCentreY | Self::CentreDistance, _) => "px",
            (Self::TimeToContact, false) => "frame",
            (Self::TimeToContact, true) => "s",
            (Self::Speed, false) => "px/frame",
            (Self::Speed, true) => "px/s",
            (_, false) => "1/frame",
            (_, true) => "1/s",
        }
    }

    /// Whether it has no meaning without the frame period.
    pub fn needs_fps(self) -> bool {
        self == Self::Rpm
    }

    /// Whether it needs the flow Jacobian (and not just the flow).
    pub fn needs_jacobian(self) -> bool {
        self != Self::Speed
    }

    /// Power of 1/time in its unit: how it changes from per frame to per second.
    fn rate(self) -> i32 {
        match self {
            Self::ShearAxis | Self::RotationCentreX | Self::RotationCentreY | Self::CentreDistance => 0,
            Self::TimeToContact => -1,
            _ => 1,
        }
    }
}

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
    let (value, gradient) = gradient::value_and_gradient(quantity, &m, at);
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_4, PI};

    fn value(q: Quantity, m: [f64; 6]) -> f64 {
        value_and_std(q, m, None, (10.0, 20.0), None).0
    }

    #[test]
    fn names_round_trip() {
        for q in Quantity::ALL {
            assert_eq!(Quantity::parse(q.name()).unwrap(), q);
        }
        assert!(Quantity::parse("vorticity").unwrap_err().to_string().contains("curl"));
    }

    #[test]
    fn textbook_motions_have_their_values() {
        // Rotation by 0.1 rad/frame about (13, 16): (u, v) = w (-(y - cy), x - cx).
        let w = 0.1;
        let rotation = [-w * 4.0, w * -3.0, 0.0, w, -w, 0.0];
        for (q, want) in [
            (Quantity::Divergence, 0.0),
            (Quantity::Curl, 0.2),
            (Quantity::AngularVelocity, 0.1),
            (Quantity::ShearMagnitude, 0.0),
            (Quantity::RotationCentreX, 13.0),
            (Quantity::RotationCentreY, 16.0),
            (Quantity::CentreDistance, 5.0),
            (Quantity::Speed, 0.5),
        ] {
            assert!((value(q, rotation) - want).abs() < 1e-12, "{q:?} {}", value(q, rotation));
        }
        let approach = [1.0, -2.0, 0.05, 0.0, 0.0, 0.05];
        assert!((value(Quantity::TimeToContact, approach) - 20.0).abs() < 1e-12);
        let diagonal = [0.0, 0.0, 0.0, 0.1, 0.1, 0.0];
        assert!((value(Quantity::ShearAxis, diagonal) - FRAC_PI_4).abs() < 1e-12);
        assert!((value(Quantity::ShearMagnitude, diagonal) - 0.2).abs() < 1e-12);
        assert!((value(Quantity::StrainXy, diagonal) - 0.1).abs() < 1e-12);
        let stretch = [0.0, 0.0, 0.1, 0.0, 0.0, 0.0];
        assert_eq!((value(Quantity::ShearAxis, stretch), value(Quantity::StrainXx, stretch)), (0.0, 0.1));
    }

    #[test]
    fn the_frame_period_turns_frames_into_seconds() {
        let m = [3.0, 4.0, 0.0, PI / 50.0, -PI / 50.0, 0.02];
        let with = |q| value_and_std(q, m, None, (0.0, 0.0), Some(0.02)).0;
        assert!((with(Quantity::Rpm) - 30.0).abs() < 1e-9);
        assert!((with(Quantity::AngularVelocity) - PI).abs() < 1e-9);
        assert!((with(Quantity::TimeToContact) - 2.0).abs() < 1e-9);
        assert!((with(Quantity::Speed) - 250.0).abs() < 1e-9);
        assert!(value(Quantity::Rpm, m).is_nan());
        assert_eq!(Quantity::TimeToContact.unit(true), "s");
    }

    #[test]
    fn standard_deviations_agree_with_simulation() {
        let rng = crate::math::random::CounterRng::new(4);
        let m = [1.0, -0.7, 0.05, 0.04, -0.06, 0.03];
        let sd = [0.02, 0.03, 0.0005, 0.0007, 0.0006, 0.0004];
        // Correlated: each parameter shares a common factor.
        let mut covariance = [[0.0; 6]; 6];
        for i in 0..6 {
            for j in 0..6 {
                covariance[i][j] = sd[i] * sd[j] * if i == j { 1.0 } else { 0.5 };
            }
        }
        for q in Quantity::ALL {
            let want = value_and_std(q, m, Some(covariance), (5.0, 6.0), Some(0.5)).1.unwrap();
            let n = 20_000u64;
            let values: Vec<f64> = (0..n)
                .map(|k| {
                    let common = rng.normal(10 * k);
                    let draw: [f64; 6] = std::array::from_fn(|i| {
                        m[i] + sd[i] * (0.5f64.sqrt() * common + 0.5f64.sqrt() * rng.normal(10 * k + 1 + i as u64))
                    });
                    value_and_std(q, draw, None, (5.0, 6.0), Some(0.5)).0
                })
                .collect();
            let mean = values.iter().sum::<f64>() / n as f64;
            let got = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64).sqrt();
            assert!((got / want - 1.0).abs() < 0.04, "{q:?}: simulated {got}, propagated {want}");
        }
    }
}
