//! Whitened patches and the sums over them, as those of points.

use crate::motion3d::diagnostics::rotation::RotationOnly;
use crate::motion3d::kernels::{Equations, least_squares};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::result::Moved;
use crate::motion3d::model::rows::{AffineRows, Derotation, Matrix5, Vector5, tangents};
use crate::motion3d::solver::covariance::inverse;
use crate::motion3d::solver::refine::{Minimum, StoppingCriteria, descend};
use nalgebra::{Matrix2x3, Matrix3, Matrix3x2, Matrix6, RowVector2, SMatrix, Vector3, Vector6};

type Matrix6x3 = SMatrix<f64, 6, 3>;

/// One patch: `f = A(u) lambda + R w + noise` with unit covariance, `A` linear in `u`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patch {
    rows: AffineRows,
    /// `V'` of the rotation that was taken out of displacements, else the identity.
    mean: Matrix3<f64>,
    whiten: Matrix6<f64>,
    pub r: Matrix6x3,
    pub f: Vector6<f64>,
}

/// A patch seen with one motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeenPatch {
    /// `lambda^ = (nu, nu_x, nu_y)` by least squares, and its covariance.
    pub surface: Vector3<f64>,
    pub covariance: Matrix3<f64>,
    /// `I - A (A^t A)^-1 A^t`.
    pub across: Matrix6<f64>,
    /// `f - R w`.
    pub rest: Vector6<f64>,
    /// What no surface explains of it.
    pub cost: f64,
}

/// Usable patches and where they come from.
#[derive(Debug, Clone)]
pub(crate) struct System {
    pub patches: Vec<Patch>,
    pub source: Vec<u32>,
}

impl Patch {
    /// From `(u, v, u_x, v_x, u_y, v_y)` at a place on the plane at distance 1; `None` unless all is finite
    /// and the covariance positive definite.
    ///
    /// With a `turn`, that rotation was taken out of them: its part is put back as the rows have it.
    pub fn new(
        point: [f64; 2],
        m: &Vector6<f64>,
        covariance: &Matrix6<f64>,
        turn: Option<&Derotation>,
    ) -> Option<Self> {
        let symmetric = covariance.symmetric_part();
        let whiten = symmetric.cholesky()?.l().try_inverse()?;
        let rows = AffineRows::new(point);
        let mean = turn.map_or_else(Matrix3::identity, |turn| turn.mean);
        let m = turn.map_or(*m, |turn| m + rows.rotation * turn.rotation);
        let patch = Self { rows, mean, whiten, r: whiten * rows.rotation * mean, f: whiten * m };
        let finite = patch.r.iter().chain(patch.f.iter()).chain(whiten.iter()).all(|value| value.is_finite());
        finite.then_some(patch)
    }

    /// `A(u)`, whitened.
    fn depth(&self, u: &Vector3<f64>) -> Matrix6x3 {
        self.whiten * self.rows.depth(&(self.mean * u))
    }

    /// What a surface shows under a motion, in units of noise.
    pub fn predicted(&self, motion: &Motion, surface: &Vector3<f64>) -> Vector6<f64> {
        self.depth(&motion.u()) * surface + self.r * motion.w()
    }

    pub fn seen(&self, motion: &Motion) -> SeenPatch {
        self.explained(motion, self.depth(&motion.u()))
    }

    /// The same with a surface that is not behind the camera.
    pub fn seen_in_front(&self, motion: &Motion) -> SeenPatch {
        let free = self.seen(motion);
        if free.surface[0] >= 0.0 {
            return free;
        }
        // The best of those with nu = 0.
        let mut slopes = self.depth(&motion.u());
        slopes.set_column(0, &Vector6::zeros());
        self.explained(motion, slopes)
    }

    fn explained(&self, motion: &Motion, a: Matrix6x3) -> SeenPatch {
        let mut normal = a.transpose() * a;
        // Invertible where the translation points at the patch, too.
        normal += Matrix3::identity() * (1e-12 * normal.trace()).max(f64::MIN_POSITIVE);
        let covariance = normal.try_inverse().unwrap_or_else(Matrix3::zeros);
        let rest = self.f - self.r * motion.w();
        let surface = covariance * a.transpose() * rest;
        let across = Matrix6::identity() - a * covariance * a.transpose();
        let cost = rest.dot(&(across * rest)).max(0.0);
        SeenPatch { surface, covariance, across, rest, cost }
    }

    /// `[sum_j lambda_j G_j E_u, R]`.
    fn slopes(&self, tangent: &Matrix2x3<f64>, surface: &Vector3<f64>) -> SMatrix<f64, 6, 5> {
        let mut slopes = SMatrix::<f64, 6, 5>::zeros();
        for axis in 0..2 {
            slopes.set_column(axis, &(self.depth(&tangent.row(axis).transpose()) * surface));
        }
        slopes.fixed_columns_mut::<3>(2).copy_from(&self.r);
        slopes
    }

    /// Slopes of the inverse depth along `(psi, w)` and along one displacement of the flow.
    pub fn depth_slopes(
        &self,
        tangent: &Matrix2x3<f64>,
        motion: &Motion,
        seen: &SeenPatch,
    ) -> (Vector5, RowVector2<f64>) {
        let along = (seen.covariance * self.depth(&motion.u()).transpose()).fixed_rows::<1>(0).into_owned();
        let of_motion = -(along * self.slopes(tangent, &seen.surface)).transpose();
        (of_motion, along * self.whiten.fixed_columns::<2>(0))
    }

    /// `sum_ij C_ij (G_i E)^t X (G_j E)`, what noise of the surface adds to products of slopes.
    fn surface_noise(&self, tangent: &Matrix2x3<f64>, covariance: &Matrix3<f64>, x: &Matrix6<f64>) -> Matrix5 {
        let along = [0, 1].map(|axis| self.depth(&tangent.row(axis).transpose()));
        let mut noise = Matrix5::zeros();
        for i in 0..2 {
            for j in 0..2 {
                noise[(i, j)] = (covariance * along[i].transpose() * x * along[j]).trace();
            }
        }
        noise
    }
}

impl System {
    pub fn subset(&self, chosen: &[u32]) -> Self {
        Self {
            patches: chosen.iter().map(|&k| self.patches[k as usize]).collect(),
            source: chosen.iter().map(|&k| self.source[k as usize]).collect(),
        }
    }

    /// The sums at a motion, with the surfaces' own estimates or with `surfaces` in the weights.
    pub fn equations(&self, motion: &Motion, tangent: &Matrix2x3<f64>, surfaces: Option<&[Vector3<f64>]>) -> Equations {
        self.sums(motion, tangent, surfaces, Patch::seen)
    }

    fn sums(
        &self,
        motion: &Motion,
        tangent: &Matrix2x3<f64>,
        surfaces: Option<&[Vector3<f64>]>,
        see: impl Fn(&Patch, &Motion) -> SeenPatch,
    ) -> Equations {
        let mut sums = Equations::default();
        for (k, patch) in self.patches.iter().enumerate() {
            let seen = see(patch, motion);
            let slopes = patch.slopes(tangent, &surfaces.map_or(seen.surface, |surfaces| surfaces[k]));
            let weighted = slopes.transpose() * seen.across;
            sums.h += weighted * slopes;
            sums.gradient += weighted * seen.rest;
            sums.p += patch.surface_noise(tangent, &seen.covariance, &seen.across);
            sums.cost += seen.cost;
            sums.behind += seen.surface[0].min(0.0).powi(2) / seen.covariance[(0, 0)];
        }
        sums
    }

    /// What one displacement of all flow does to the motion, with these surfaces in the weights.
    pub fn moved(&self, motion: &Motion, surfaces: &[Vector3<f64>]) -> Moved {
        let tangent = tangents(&motion.u());
        let information = self.equations(motion, &tangent, Some(surfaces)).h;
        let mut sum = Moved::zeros();
        for (patch, surface) in self.patches.iter().zip(surfaces) {
            let weighted = patch.slopes(&tangent, surface).transpose() * patch.seen(motion).across;
            sum += weighted * patch.whiten.fixed_columns::<2>(0);
        }
        inverse(&information).map_or(Moved::zeros(), |inverse| inverse * sum)
    }

    /// `sum R_k^t L_k^-1` of one displacement of all flow.
    pub fn translation_to_rotation(&self) -> Matrix3x2<f64> {
        self.patches.iter().map(|patch| patch.r.transpose() * patch.whiten.fixed_columns::<2>(0)).sum()
    }

    /// The best rotation for a direction, and what it leaves.
    pub fn best_rotation(&self, direction: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
        let still = Motion::of(direction, &Vector3::zeros());
        let (mut normal, mut right, mut square) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
        for patch in &self.patches {
            let across = patch.seen(&still).across;
            let weighted = patch.r.transpose() * across;
            normal += weighted * patch.r;
            right += weighted * patch.f;
            square += patch.f.dot(&(across * patch.f));
        }
        least_squares(&normal, &right, square)
    }

    /// The rotation that explains the flow best without a translation.
    pub fn rotation_only(&self) -> Option<RotationOnly> {
        RotationOnly::of_rows(self.patches.iter().map(|patch| (patch.r, patch.f)), None)
    }

    /// The minimum that is reached from `start`.
    pub fn refine(&self, start: &Motion) -> Minimum {
        self.descend(start, Patch::seen)
    }

    /// The same with no patch behind the camera.
    pub fn refine_in_front(&self, start: &Motion) -> Minimum {
        self.descend(start, Patch::seen_in_front)
    }

    fn descend(&self, start: &Motion, see: fn(&Patch, &Motion) -> SeenPatch) -> Minimum {
        let sums = |motion: &Motion, tangent: &Matrix2x3<f64>| self.sums(motion, tangent, None, see);
        descend(*start, StoppingCriteria::FULL, self.patches.len(), sums)
    }

    /// `sum (Pi G_i E)^t B M^-1 B^t (Pi G_j E) C_ij`: the noise that is left with ideal weights (25).
    pub fn weighted_noise(
        &self,
        motion: &Motion,
        tangent: &Matrix2x3<f64>,
        surfaces: &[Vector3<f64>],
        bound: &Matrix5,
    ) -> Matrix5 {
        let mut sum = Matrix5::zeros();
        for (patch, surface) in self.patches.iter().zip(surfaces) {
            let seen = patch.seen(motion);
            let across = seen.across * patch.slopes(tangent, surface);
            sum += patch.surface_noise(tangent, &seen.covariance, &(across * bound * across.transpose()));
        }
        sum
    }
}
