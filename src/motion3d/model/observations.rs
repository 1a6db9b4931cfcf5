//! What was measured, whitened once: two rows of `G`, `R` and `f` for every usable point, as planes.

use super::{measurement::Measurement, rows::Derotation, rows::Matrix5, rows::Rows, rows::Vector5};
use crate::math::{median, quantile};
use crate::parallel;
use crate::simd::Level;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, SymmetricEigen, Vector2, Vector3};
use std::ops::AddAssign;

/// Unknowns of a motion, and the fewest points that determine them.
pub(crate) const UNKNOWNS: usize = 5;

/// Fewest points whose distribution is estimated from them.
pub(crate) const SAMPLE: usize = 30;

/// Points of one chunk. Chunks never share a sum, so that sums do not depend on the number of threads. A
/// multiple of every lane count.
pub(crate) const CHUNK: usize = 4096;

/// Lanes are filled up with points of weight 0 to a multiple of this, the most lanes.
pub(crate) const ALIGN: usize = 16;

/// Planes of an [`Observations`].
pub(crate) const PLANES: usize = 14;

/// Residuals below this share of the flow are rounding.
pub(crate) const ROUNDING: f64 = 1e-11;

/// Ratio of a point's standard deviations along its axes up to which noise counts as round.
pub(crate) const ROUND: f64 = 6.0;

/// By how much that ratio grows from one search of minima to the next, and residuals may: the smaller the
/// noise along one axis, the narrower the minimum.
pub(crate) const LESS_ROUND: f64 = 4.0;

/// One point: `f = nu G u + R w + noise` with unit covariance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub g: Matrix2x3<f64>,
    pub r: Matrix2x3<f64>,
    pub f: Vector2<f64>,
}

/// Whitened points as planes: `g` (6), `r` (6), `f` (2), each of `stride` values, of which those after `n`
/// are zero.
#[derive(Debug, Clone)]
pub(crate) struct Observations {
    pub n: usize,
    pub stride: usize,
    planes: Vec<f64>,
    /// `eta`: `(x, y, 1)` on the plane, of displacements without their rotation at the first end; the bearing
    /// on the sphere.
    pub eta: Vec<[f64; 3]>,
    /// Where the points were given, free of the flow's noise: predictions from neighbourhoods are independent
    /// of a point's residual.
    pub site: Vec<[f64; 3]>,
    /// Whether `eta` and sites are bearings.
    pub spherical: bool,
    /// Index of each point in what was given.
    pub source: Vec<u32>,
    /// `|G u|^2` below which a point gets weight 0.
    pub floor: f64,
    /// The instruction set of the kernels.
    pub level: Level,
    /// What is known of the rotation beforehand.
    pub prior: Option<KnownRotation>,
    /// Number of given points per statistically independent one: their own variance is one over it.
    pub points_per_independent_sample: f64,
    /// Whether errors of neighbours are independent.
    pub independent: bool,
    /// Whether flow is a displacement over a whole frame.
    pub displaced: bool,
    /// The rotation that was taken out of displacements.
    pub turn: Option<Derotation>,
    /// What everything was multiplied with since it was whitened.
    units: f64,
}

impl Row {
    /// From screen rows and flow with the noise covariance `S`: everything times `L^-1`, `S = L L^t`. `None`
    /// unless all is finite and `S` positive definite.
    pub fn whitened(rows: &Rows, flow: Vector2<f64>, covariance: &Matrix2<f64>) -> Option<Self> {
        let whiten = covariance.cholesky()?.l().try_inverse()?;
        let row = Self { g: whiten * rows.g, r: whiten * rows.r, f: whiten * flow };
        (0..PLANES).all(|p| row.value(p).is_finite()).then_some(row)
    }

    /// The same with the depth as the one unknown. The first columns of `G` are those of the identity: they
    /// whiten. (On the sphere flow at different places has no common displacement.)
    pub fn measurement(&self) -> Measurement<2, 1> {
        let depth = [0, 1, 2].map(|axis| self.g.column(axis).into_owned());
        Measurement { depth, r: self.r, f: self.f, shift: self.g.fixed_columns::<2>(0).into_owned() }
    }

    fn value(&self, p: usize) -> f64 {
        match p {
            0..6 => self.g[(p / 3, p % 3)],
            6..12 => self.r[((p - 6) / 3, p % 3)],
            _ => self.f[p - 12],
        }
    }
}

impl Observations {
    /// What a rotation costs for not being the one that is known.
    pub fn pulled(&self, w: &Vector3<f64>) -> f64 {
        self.prior.map_or(0.0, |known| known.pull(w).1)
    }

    /// The same points where nothing is known of the rotation.
    pub fn without_prior(&self) -> Self {
        Self { prior: None, ..self.clone() }
    }

    /// Usable points in the order given; `source` says where they come from. Their sites are left empty.
    pub fn new(rows: &[Row], eta: Vec<[f64; 3]>, spherical: bool, source: Vec<u32>) -> Self {
        let n = rows.len();
        let stride = n.next_multiple_of(ALIGN);
        let mut planes = vec![0.0; PLANES * stride];
        parallel::for_each(planes.chunks_exact_mut(stride.max(1)).enumerate(), |(p, plane)| {
            plane.iter_mut().zip(rows).for_each(|(to, row)| *to = row.value(p));
        });
        let size: f64 = planes[..6 * stride].iter().map(|value| value * value).sum();
        // Where `|G u| / |G|` is below 1e-9 a point sits on the epipole.
        let floor = 1e-18 * size / (2 * n.max(1)) as f64;
        Self {
            n,
            stride,
            planes,
            site: Vec::new(),
            eta,
            spherical,
            source,
            floor,
            level: Level::detect(),
            prior: None,
            points_per_independent_sample: 1.0,
            independent: true,
            displaced: false,
            turn: None,
            units: 1.0,
        }
    }

    /// The same points in the same units with other rows, from which a rotation was taken out.
    pub fn derotated(&self, rows: &[Row], eta: Vec<[f64; 3]>, turn: Derotation) -> Self {
        let Self { planes, floor, eta, .. } = Self::new(rows, eta, false, Vec::new());
        let mut out = Self { planes, floor, eta, turn: Some(turn), units: 1.0, ..self.clone() };
        out.rescale(self.units);
        out
    }

    /// The points `chosen`, by index among these.
    pub fn subset(&self, chosen: &[u32]) -> Self {
        let (n, stride) = (chosen.len(), chosen.len().next_multiple_of(ALIGN));
        let mut planes = vec![0.0; PLANES * stride];
        for (p, plane) in planes.chunks_exact_mut(stride.max(1)).enumerate() {
            let from = self.plane(p);
            for (to, &k) in plane.iter_mut().zip(chosen) {
                *to = from[k as usize];
            }
        }
        let pick = |k: &u32| *k as usize;
        Self {
            n,
            stride,
            planes,
            eta: chosen.iter().map(|k| self.eta[pick(k)]).collect(),
            site: chosen.iter().map(|k| self.site[pick(k)]).collect(),
            source: chosen.iter().map(|k| self.source[pick(k)]).collect(),
            ..*self
        }
    }

    /// Which points are `chosen`, by index among these.
    pub fn mask(&self, chosen: &[u32]) -> Vec<bool> {
        let mut mask = vec![false; self.n];
        for &k in chosen {
            mask[k as usize] = true;
        }
        mask
    }

    /// The points that are not `chosen`.
    pub fn others(&self, chosen: &[u32]) -> Vec<u32> {
        let mask = self.mask(chosen);
        (0..self.n as u32).filter(|&k| !mask[k as usize]).collect()
    }

    /// Every point times the root of its weight.
    pub fn weighted(&self, weight: impl Fn(usize) -> f64) -> Self {
        let (mut out, n, stride) = (self.clone(), self.n, self.stride);
        let roots: Vec<f64> = (0..n).map(|k| weight(k).sqrt()).collect();
        for plane in out.planes.chunks_exact_mut(stride.max(1)) {
            plane.iter_mut().zip(&roots).for_each(|(value, root)| *value *= root);
        }
        out
    }

    /// Ratio of the noise of point `k` along both axes, and the axis with little of it.
    fn stretch(&self, k: usize) -> (f64, Vector2<f64>) {
        let g = self.row(k).g;
        // Rows of whitened points are stretched along the axis with little noise.
        let eigen = SymmetricEigen::new(g * g.transpose());
        let most = eigen.eigenvalues.imax();
        let stretch = (eigen.eigenvalues[most] / eigen.eigenvalues[1 - most]).sqrt();
        (stretch, eigen.eigenvectors.column(most).into_owned())
    }

    /// The 0.9 quantile of the ratio of noise along both axes, from a thousand points.
    pub fn longest(&self) -> f64 {
        let few = (0..self.n).step_by(self.n.div_ceil(1000).max(1));
        let mut stretches: Vec<f64> = few.map(|k| self.stretch(k).0).collect();
        quantile(&mut stretches, 0.9).unwrap_or(0.0)
    }

    /// The same points with the smaller standard deviation of each raised to the larger over `ratio`.
    fn rounded(&self, ratio: f64) -> Self {
        let mut out = self.clone();
        for k in 0..self.n {
            let (stretch, axis) = self.stretch(k);
            if stretch > ratio {
                let row = self.row(k);
                let less = Matrix2::identity() - axis * axis.transpose() * (1.0 - ratio / stretch);
                let rounder = Row { g: less * row.g, r: less * row.r, f: less * row.f };
                (0..PLANES).for_each(|p| out.planes[p * self.stride + k] = rounder.value(p));
            }
        }
        out
    }

    /// The same points in rounder noise, the roundest first; none where their own is round.
    pub fn rounder(&self) -> Vec<Self> {
        let longest = self.longest();
        let ratios = std::iter::successors(Some(ROUND), |ratio| Some(ratio * LESS_ROUND));
        ratios.take_while(|ratio| *ratio < longest).map(|ratio| self.rounded(ratio)).collect()
    }

    /// Measures in other units of noise: everything times `factor`.
    pub fn rescale(&mut self, factor: f64) {
        self.planes.iter_mut().for_each(|value| *value *= factor);
        self.floor *= factor * factor;
        self.units *= factor;
    }

    /// The standard deviation of a point's own error, in units of noise.
    pub fn own(&self) -> f64 {
        self.points_per_independent_sample.sqrt().recip()
    }

    /// One plane, `stride` values.
    pub fn plane(&self, p: usize) -> &[f64] {
        &self.planes[p * self.stride..(p + 1) * self.stride]
    }

    /// The planes of the points `range`, whose start is a multiple of the lane count.
    pub fn slices(&self, range: &std::ops::Range<usize>) -> [&[f64]; PLANES] {
        std::array::from_fn(|p| &self.plane(p)[range.clone()])
    }

    /// The chunks, the last one up to the filling points.
    pub fn chunks(&self) -> impl ExactSizeIterator<Item = std::ops::Range<usize>> + Clone + '_ {
        let stride = self.stride;
        (0..stride.div_ceil(CHUNK)).map(move |c| c * CHUNK..((c + 1) * CHUNK).min(stride))
    }

    /// Point `k`.
    #[inline]
    pub fn row(&self, k: usize) -> Row {
        let at = |p: usize| self.planes[p * self.stride + k];
        Row {
            g: Matrix2x3::from_fn(|i, j| at(3 * i + j)),
            r: Matrix2x3::from_fn(|i, j| at(6 + 3 * i + j)),
            f: Vector2::new(at(12), at(13)),
        }
    }

    /// How many points count nothing, as another rotation leads them behind the camera.
    pub fn unseen(&self) -> usize {
        let along = |p: usize| &self.plane(p)[..self.n];
        along(0).iter().zip(along(4)).filter(|(first, second)| **first == 0.0 && **second == 0.0).count()
    }

    /// The median of `|f|`, in units of noise.
    pub fn median_flow(&self) -> f64 {
        let mut lengths: Vec<f64> = (0..self.n).map(|k| self.plane(12)[k].hypot(self.plane(13)[k])).collect();
        median(&mut lengths).unwrap_or(0.0)
    }
}

/// A rotation known beforehand, with the inverse of its covariance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KnownRotation {
    pub rotation: Vector3<f64>,
    pub information: Matrix3<f64>,
}

impl KnownRotation {
    /// `(w0 - w)` times the information, and the square of the difference in its units.
    pub fn pull(&self, w: &Vector3<f64>) -> (Vector3<f64>, f64) {
        let off = self.rotation - w;
        let pull = self.information * off;
        (pull, off.dot(&pull))
    }

    /// Adds what is known to the sums of a step at the rotation `w`.
    pub fn add(&self, w: &Vector3<f64>, h: &mut Matrix5, gradient: &mut Vector5, cost: &mut f64) {
        let (pull, square) = self.pull(w);
        h.fixed_view_mut::<3, 3>(2, 2).add_assign(self.information);
        gradient.fixed_rows_mut::<3>(2).add_assign(pull);
        *cost += square;
    }
}

/// Points in units of their noise, and that in the flow's unit.
pub(crate) struct Scaled {
    pub observations: Observations,
    pub noise_std: f64,
    /// Whether `noise_std` has to be estimated.
    pub unknown: bool,
    /// Whether the flow may be that of a rotation alone.
    pub may_turn: bool,
}

impl Scaled {
    /// Takes `noise_std` in units of the present noise to be the noise; returns what the points are
    /// multiplied with.
    pub fn take(&mut self, noise_std: f64) -> f64 {
        // Flow that is exactly zero has some noise, too.
        let noise_std = noise_std.max(ROUNDING * self.observations.median_flow()).max(1e-100);
        if !noise_std.is_finite() {
            return 1.0;
        }
        self.observations.rescale(1.0 / noise_std);
        self.noise_std *= noise_std;
        1.0 / noise_std
    }
}
