//! The derived quantities of one motion.

use crate::types::{Units, choices};

/// A number derived from the affine motion `m = (u, v, u_x, v_x, u_y, v_y)` of a point, in the [`Units`] of
/// its field.
///
/// Everything but the speed, the centre and the time to contact is formed of the rates `L` that make the
/// field's displacements: `log(I + D)` for the Jacobian `D` of a step to the next frame, `asinh D` for the
/// mean of the steps before and after (see [`Interval`](crate::types::Interval)). They hold for motion that
/// is constant within the step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// `L_xx + L_yy`, 1/frame or 1/s: relative growth of area.
    Divergence,
    /// `L_yx - L_xy`, 1/frame or 1/s: twice the angular velocity; positive turns x towards y (clockwise on
    /// the screen).
    Curl,
    /// `sqrt((L_xx - L_yy)^2 + (L_xy + L_yx)^2)`, 1/frame or 1/s: difference of the two principal rates of
    /// strain.
    ShearMagnitude,
    /// `atan2(L_xy + L_yx, L_xx - L_yy) / 2`, rad in (-pi/2, pi/2]: direction of the greatest stretch, from x
    /// towards y.
    ShearAxis,
    /// `L_xx`, 1/frame or 1/s: normal strain rate along x.
    StrainXx,
    /// `(L_xy + L_yx) / 2`, 1/frame or 1/s: shear strain rate.
    StrainXy,
    /// `L_yy`, 1/frame or 1/s: normal strain rate along y.
    StrainYy,
    /// `(L_yx - L_xy) / 2`, rad/frame or rad/s.
    AngularVelocity,
    /// Angular velocity in revolutions per minute; needs the frame period.
    Rpm,
    /// x of the point that does not move, `p - M^-1 (u, v)` (WO2010/098160, 0104), px or the pitch's unit.
    RotationCentreX,
    /// y of that point.
    RotationCentreY,
    /// Distance `|M^-1 (u, v)|` of that point.
    CentreDistance,
    /// Frames or s from the field's frame until contact with an approaching surface parallel to the image, at
    /// constant speed; negative while it recedes. `1 + 2 / (u_x + v_y)` frames for a step to the next frame
    /// without rotation, `2 / (u_x + v_y)` for a velocity.
    TimeToContact,
    /// `sqrt(u^2 + v^2)`, px/frame or px/s: the mean over the step, along its chord.
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
    /// The unit of its values.
    pub fn unit(self, units: &Units) -> String {
        let (length, time) = (&units.length, units.time());
        match self {
            Self::ShearAxis => "rad".into(),
            Self::AngularVelocity => format!("rad/{time}"),
            Self::Rpm => "rpm".into(),
            Self::RotationCentreX | Self::RotationCentreY | Self::CentreDistance => length.clone(),
            Self::TimeToContact => time.into(),
            Self::Speed => format!("{length}/{time}"),
            _ => format!("1/{time}"),
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

    /// The linear combinations of `(u, v, u_x, v_x, u_y, v_y)` that it is formed of: a mean over a region is
    /// that of these.
    pub(super) fn combinations(self) -> &'static [[f64; 6]] {
        const U: [f64; 6] = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        const V: [f64; 6] = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        const UX: [f64; 6] = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        const VX: [f64; 6] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        const UY: [f64; 6] = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        const VY: [f64; 6] = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        const DIVERGENCE: [f64; 6] = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
        const CURL: [f64; 6] = [0.0, 0.0, 0.0, 1.0, -1.0, 0.0];
        const NORMAL: [f64; 6] = [0.0, 0.0, 1.0, 0.0, 0.0, -1.0];
        const SHEAR: [f64; 6] = [0.0, 0.0, 0.0, 1.0, 1.0, 0.0];
        match self {
            Self::Divergence | Self::TimeToContact => &[DIVERGENCE],
            Self::Curl | Self::AngularVelocity | Self::Rpm => &[CURL],
            Self::ShearMagnitude | Self::ShearAxis => &[NORMAL, SHEAR],
            Self::StrainXx => &[UX],
            Self::StrainXy => &[SHEAR],
            Self::StrainYy => &[VY],
            Self::RotationCentreX | Self::RotationCentreY | Self::CentreDistance => &[UX, VX, UY, VY],
            Self::Speed => &[U, V],
        }
    }

    /// What is expected where `name` is no quantity: a suggestion, `others` that are known there, all
    /// quantities.
    pub fn expected(name: &str, others: &[&str]) -> String {
        let names: Vec<&str> = others.iter().copied().chain(Self::ALL.iter().map(|q| q.name())).collect();
        let suggestion = Self::suggestion(name).map(|meant| format!("a name (did you mean {:?}?), ", meant.name()));
        format!("{}one of {}", suggestion.unwrap_or_default(), names.join(", "))
    }

    /// The quantity that people mean by `name`: one of another convention, or the beginning of one of ours.
    fn suggestion(name: &str) -> Option<Self> {
        const SYNONYMS: [(&str, Quantity); 14] = [
            ("vorticity", Quantity::Curl),
            ("rotation", Quantity::AngularVelocity),
            ("omega", Quantity::AngularVelocity),
            ("expansion", Quantity::Divergence),
            ("dilatation", Quantity::Divergence),
            ("magnitude", Quantity::Speed),
            ("velocity", Quantity::Speed),
            ("shear", Quantity::ShearMagnitude),
            ("ttc", Quantity::TimeToContact),
            ("tau", Quantity::TimeToContact),
            ("exx", Quantity::StrainXx),
            ("exy", Quantity::StrainXy),
            ("eyy", Quantity::StrainYy),
            ("centre", Quantity::RotationCentreX),
        ];
        let name = name.to_lowercase().replace('-', "_").replace("center", "centre");
        let synonym = SYNONYMS.iter().find(|(word, _)| *word == name).map(|&(_, quantity)| quantity);
        let begins = |quantity: &Self| name.len() > 2 && quantity.name().starts_with(name.as_str());
        let close = |quantity: &Self| name.len() > 3 && edits(quantity.name(), &name) <= 2;
        let by_name = || Self::ALL.into_iter().find(begins).or_else(|| Self::ALL.into_iter().find(close));
        synonym.or_else(by_name)
    }
}

/// Number of letters to insert, remove or replace that makes one word of the other (V. Levenshtein, 1966).
fn edits(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, left) in a.bytes().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, right) in b.bytes().enumerate() {
            let replaced = diagonal + usize::from(left != right);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
