//! The derived quantities of one motion.

use crate::types::choices;

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
    /// x of the point that does not move, `p - M^-1 (u, v)` (WO2010/098160, 0104), px or pitch units.
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

choices!(Quantity, "quantity":
    Divergence "divergence",
    Curl "curl",
    ShearMagnitude "shear_magnitude",
    ShearAxis "shear_axis",
    StrainXx "strain_xx",
    StrainXy "strain_xy",
    StrainYy "strain_yy",
    AngularVelocity "angular_velocity",
    Rpm "rpm",
    RotationCentreX "rotation_centre_x",
    RotationCentreY "rotation_centre_y",
    CentreDistance "centre_distance",
    TimeToContact "time_to_contact",
    Speed "speed",
);

impl Quantity {
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
    pub(super) fn rate(self) -> i32 {
        match self {
            Self::ShearAxis | Self::RotationCentreX | Self::RotationCentreY | Self::CentreDistance => 0,
            Self::TimeToContact => -1,
            _ => 1,
        }
    }
}
