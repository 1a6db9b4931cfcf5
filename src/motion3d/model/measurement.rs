//! What is measured at one place, of points and patches alike.

use super::{motion::Motion, rows::Matrix5, rows::Vector5};
use nalgebra::{Matrix2, Matrix2x3, RowVector2, SMatrix, SVector, Vector3};

/// `f = A(u) lambda + R w + noise` of unit covariance: N numbers, whose L unknowns `lambda` are the inverse
/// depth and, of a patch, its slopes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measurement<const N: usize, const L: usize> {
    /// `A`, which is linear in `u`, of each axis.
    pub depth: [SMatrix<f64, N, L>; 3],
    pub r: SMatrix<f64, N, 3>,
    pub f: SVector<f64, N>,
    /// What displacements along both axes of the plane at distance 1 add to `f`.
    pub shift: SMatrix<f64, N, 2>,
}

/// A measurement seen with one motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Explained<const N: usize, const L: usize> {
    /// `lambda^` by least squares, and its covariance.
    pub surface: SVector<f64, L>,
    pub covariance: SMatrix<f64, L, L>,
    /// `I - A (A^t A)^-1 A^t`; 0 at the epipole, where a point says nothing.
    pub across: SMatrix<f64, N, N>,
    /// `f - R w`.
    pub rest: SVector<f64, N>,
    /// What no surface explains of it.
    pub cost: f64,
}

impl<const N: usize, const L: usize> Measurement<N, L> {
    /// `A(u)`.
    fn along(&self, u: &Vector3<f64>) -> SMatrix<f64, N, L> {
        self.depth[0] * u.x + self.depth[1] * u.y + self.depth[2] * u.z
    }

    /// What a surface shows under a motion.
    pub fn predicted(&self, motion: &Motion, surface: &SVector<f64, L>) -> SVector<f64, N> {
        self.along(&motion.u()) * surface + self.r * motion.w()
    }

    pub fn seen(&self, motion: &Motion) -> Explained<N, L> {
        self.explained(motion, self.along(&motion.u()))
    }

    /// The same with a surface that is not behind the camera.
    pub fn seen_in_front(&self, motion: &Motion) -> Explained<N, L> {
        let free = self.seen(motion);
        if free.surface[0] >= 0.0 {
            return free;
        }
        // The best of those with nu = 0.
        let mut slopes = self.along(&motion.u());
        slopes.column_mut(0).fill(0.0);
        self.explained(motion, slopes)
    }

    fn explained(&self, motion: &Motion, a: SMatrix<f64, N, L>) -> Explained<N, L> {
        let rest = self.f - self.r * motion.w();
        let mut normal = a.transpose() * a;
        let size: f64 = self.depth.iter().map(SMatrix::norm_squared).sum();
        let is_at_epipole = normal.trace() <= 1e-18 * size;
        // Invertible where the translation points at a patch, too.
        normal += SMatrix::identity() * (f64::EPSILON * normal.trace());
        let inverse = normal.try_inverse().filter(|_| !is_at_epipole);
        let covariance = inverse.unwrap_or_else(SMatrix::zeros);
        let known = if inverse.is_some() { SMatrix::identity() } else { SMatrix::zeros() };
        let across: SMatrix<f64, N, N> = known - a * covariance * a.transpose();
        let cost = rest.dot(&(across * rest)).max(0.0);
        Explained { surface: covariance * (a.transpose() * rest), covariance, across, rest, cost }
    }

    /// `[A(E_u) lambda, R]`: slopes by `(psi, w)`.
    pub fn slopes(&self, tangent: &Matrix2x3<f64>, surface: &SVector<f64, L>) -> SMatrix<f64, N, 5> {
        let mut slopes = SMatrix::<f64, N, 5>::zeros();
        for axis in 0..2 {
            slopes.set_column(axis, &(self.along(&tangent.row(axis).transpose()) * surface));
        }
        slopes.fixed_columns_mut::<3>(2).copy_from(&self.r);
        slopes
    }

    /// Slopes of the inverse depth along `(psi, w)` and by a displacement of the flow.
    pub fn depth_slopes(
        &self,
        tangent: &Matrix2x3<f64>,
        motion: &Motion,
        surface: &SVector<f64, L>,
    ) -> (Vector5, RowVector2<f64>) {
        let along = self.seen(motion).covariance * self.along(&motion.u()).transpose();
        let along = along.fixed_rows::<1>(0).into_owned();
        (-(along * self.slopes(tangent, surface)).transpose(), along * self.shift)
    }

    /// `sum_ij C_ij (A_i E)^t X (A_j E)`, what noise of the surface adds to products of slopes.
    pub fn surface_noise(
        &self,
        tangent: &Matrix2x3<f64>,
        covariance: &SMatrix<f64, L, L>,
        x: &SMatrix<f64, N, N>,
    ) -> Matrix5 {
        let along = [0, 1].map(|axis| self.along(&tangent.row(axis).transpose()));
        let weighted = along.map(|along| x * along);
        let of = |i: usize, j: usize| covariance.dot(&(along[i].transpose() * weighted[j]));
        let (across, mut noise) = (of(0, 1), Matrix5::zeros());
        noise.fixed_view_mut::<2, 2>(0, 0).copy_from(&Matrix2::new(of(0, 0), across, across, of(1, 1)));
        noise
    }

    /// `W^t [R, shift]`: how the equations respond to more rotation and to a displacement of all flow;
    /// without a motion those of a rotation alone.
    pub fn response(&self, motion: Option<(&Motion, &Matrix2x3<f64>)>, surface: &SVector<f64, L>) -> Matrix5 {
        let weights = motion.map_or_else(
            || self.slopes(&Matrix2x3::zeros(), surface),
            |(motion, tangent)| self.seen(motion).across * self.slopes(tangent, surface),
        );
        let mut changes = SMatrix::<f64, N, 5>::zeros();
        changes.fixed_columns_mut::<3>(0).copy_from(&self.r);
        changes.fixed_columns_mut::<2>(3).copy_from(&self.shift);
        weights.transpose() * changes
    }
}
