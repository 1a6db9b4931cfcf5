//! Sums over measurements of patches, as the kernels have them for points.

use crate::math::tangents;
use crate::motion3d::diagnostics::rotation::RotationOnly;
use crate::motion3d::kernels::{Equations, least_squares};
use crate::motion3d::model::measurement::{Explained, Measurement};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::rows::{AffineRows, Derotation, Matrix5};
use crate::motion3d::solver::{refine::Minimum, refine::StoppingCriteria, refine::descend};
use nalgebra::{Matrix2x3, Matrix3, Matrix6, SVector, Vector3, Vector6};

/// A patch: `(u, v, u_x, v_x, u_y, v_y)` of a surface `(nu, nu_x, nu_y)`.
pub(crate) type Patch = Measurement<6, 3>;

/// Patches.
pub(crate) type PatchSystem = System<6, 3>;

impl Patch {
    /// At a place on the plane at distance 1; `None` unless all is finite and the covariance positive
    /// definite.
    ///
    /// With a `turn`, that rotation was taken out of the six numbers: its part is put back as the rows have
    /// it.
    pub fn of(point: [f64; 2], m: &Vector6<f64>, covariance: &Matrix6<f64>, turn: Option<&Derotation>) -> Option<Self> {
        let whiten = covariance.symmetric_part().cholesky()?.l().try_inverse()?;
        let rows = AffineRows::new(point);
        let mean = turn.map_or_else(Matrix3::identity, |turn| turn.mean);
        let m = turn.map_or(*m, |turn| m + rows.rotation * turn.rotation);
        let depth = [0, 1, 2].map(|axis| whiten * rows.depth(&mean.column(axis).into_owned()));
        let shift = whiten.fixed_columns::<2>(0).into_owned();
        let patch = Self { depth, r: whiten * rows.rotation * mean, f: whiten * m, shift };
        let finite = patch.r.iter().chain(patch.f.iter()).chain(whiten.iter()).all(|value| value.is_finite());
        finite.then_some(patch)
    }
}

/// Usable measurements and where they come from.
#[derive(Debug, Clone)]
pub(crate) struct System<const N: usize, const L: usize> {
    pub all: Vec<Measurement<N, L>>,
    pub source: Vec<u32>,
}

impl<const N: usize, const L: usize> System<N, L> {
    pub fn subset(&self, chosen: &[u32]) -> Self {
        Self {
            all: chosen.iter().map(|&k| self.all[k as usize]).collect(),
            source: chosen.iter().map(|&k| self.source[k as usize]).collect(),
        }
    }

    /// The sums at a motion, with the surfaces' own estimates or with `surfaces` in the weights.
    pub fn equations(
        &self,
        motion: &Motion,
        tangent: &Matrix2x3<f64>,
        surfaces: Option<&[SVector<f64, L>]>,
    ) -> Equations {
        self.sums(motion, tangent, surfaces, Measurement::seen)
    }

    fn sums(
        &self,
        motion: &Motion,
        tangent: &Matrix2x3<f64>,
        surfaces: Option<&[SVector<f64, L>]>,
        see: impl Fn(&Measurement<N, L>, &Motion) -> Explained<N, L>,
    ) -> Equations {
        let mut sums = Equations::default();
        for (k, one) in self.all.iter().enumerate() {
            let seen = see(one, motion);
            let slopes = one.slopes(tangent, &surfaces.map_or(seen.surface, |surfaces| surfaces[k]));
            let weighted = slopes.transpose() * seen.across;
            sums.h += weighted * slopes;
            sums.gradient += weighted * seen.rest;
            sums.p += one.surface_noise(tangent, &seen.covariance, &seen.across);
            sums.cost += seen.cost;
            sums.behind += seen.surface[0].min(0.0).powi(2) / seen.covariance[(0, 0)].max(f64::MIN_POSITIVE);
        }
        sums
    }

    /// How the equations with these surfaces respond to more rotation and to a displacement of all flow.
    pub fn response(&self, motion: &Motion, surfaces: &[SVector<f64, L>]) -> Matrix5 {
        let tangent = tangents(&motion.u());
        self.all.iter().zip(surfaces).map(|(one, surface)| one.response(Some((motion, &tangent)), surface)).sum()
    }

    /// The best rotation for a direction, and what it leaves.
    pub fn best_rotation(&self, direction: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
        let still = Motion::of(direction, &Vector3::zeros());
        let (mut normal, mut right, mut square) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
        for one in &self.all {
            let across = one.seen(&still).across;
            let weighted = one.r.transpose() * across;
            normal += weighted * one.r;
            right += weighted * one.f;
            square += one.f.dot(&(across * one.f));
        }
        least_squares(&normal, &right, square)
    }

    /// The rotation that explains the flow best without a translation.
    pub fn rotation_only(&self) -> Option<RotationOnly> {
        RotationOnly::of_rows(self.all.iter().map(|one| (one.r, one.f)), None)
    }

    /// The minimum that is reached from `start`.
    pub fn refine(&self, start: &Motion) -> Minimum {
        self.descend(start, Measurement::seen)
    }

    /// The same with no surface behind the camera.
    pub fn refine_in_front(&self, start: &Motion) -> Minimum {
        self.descend(start, Measurement::seen_in_front)
    }

    fn descend(&self, start: &Motion, see: impl Fn(&Measurement<N, L>, &Motion) -> Explained<N, L>) -> Minimum {
        let sums = |motion: &Motion, tangent: &Matrix2x3<f64>| self.sums(motion, tangent, None, &see);
        descend(*start, StoppingCriteria::FULL, self.all.len(), sums)
    }

    /// `sum (Pi A_i E)^t B M^-1 B^t (Pi A_j E) C_ij`: the noise that is left with ideal weights (25), of
    /// points `sum c_kk P_k`.
    pub fn weighted_noise(
        &self,
        motion: &Motion,
        tangent: &Matrix2x3<f64>,
        surfaces: &[SVector<f64, L>],
        bound: &Matrix5,
    ) -> Matrix5 {
        let noise = |(one, surface): (&Measurement<N, L>, &SVector<f64, L>)| {
            let seen = one.seen(motion);
            let across = seen.across * one.slopes(tangent, surface);
            one.surface_noise(tangent, &seen.covariance, &(across * bound * across.transpose()))
        };
        self.all.iter().zip(surfaces).map(noise).sum()
    }
}
