//! The result of an estimator: planes of motion parameters, their covariance and their status.

use super::{AffineFlow, MOTION_NAMES, SamplingGrid, Status, Units, choices};
use crate::error::{Error, Result, check_memory};
use crate::math::{Real, dense::cholesky};
use std::borrow::Cow;

/// What the flow of a field at frame `t` is, with `d(t1)` the displacement since frame `t` of the matter that
/// is at the pixel at frame `t`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Interval {
    /// `d(t + 1)`: the step to the next frame.
    #[default]
    Forward,
    /// `(d(t + 1) - d(t - 1)) / 2`: the mean of the steps before and after.
    Central,
    /// The velocity at frame `t`: the derivative of `d`.
    Instant,
}

choices!(Interval, "interval": Forward "forward", Central "central", Instant "instant");

/// What a field holds at each site and where the sites are.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldLayout {
    /// Size `(width, height)` of the frames.
    pub frame_size: (usize, usize),
    /// Where the estimates are.
    pub sites: SamplingGrid,
    /// Name of the motion model.
    pub model: String,
    /// Names of the model's parameters, in plane order. The first two are always `u`, `v`.
    pub parameters: Vec<String>,
    /// What lengths and times are measured in.
    pub units: Units,
    /// The time over which the flow is taken.
    pub interval: Interval,
    /// Index of the frame the estimate belongs to, counted from the first frame of the sequence.
    pub frame_index: usize,
    /// Length `l`, px, of the correlation of neighbouring errors: about `exp(-d^2 / (4 l^2))` at distance
    /// `d`, as for overlapping Gaussian windows of standard deviation `l`. 0: independent or unknown.
    pub correlation_length: f64,
}

/// Flow with its Jacobian at `width x height` sites (points: one row), as planes.
///
/// Plane `p` of `motion` is parameter `layout.parameters[p]`; each plane is row-major. For the affine model
/// they are `u, v, u_x, v_x, u_y, v_y` in px/frame and 1/frame, or in the [`Units`] of the layout.
#[derive(Debug, Clone, PartialEq)]
pub struct FlowField<T> {
    /// What the planes mean.
    pub layout: FieldLayout,
    /// Columns of the result.
    pub width: usize,
    /// Rows of the result.
    pub height: usize,
    /// `P` planes of `width * height` values; NaN where the status says so.
    pub motion: Vec<T>,
    /// `P (P + 1) / 2` planes: the upper triangle of the covariance, row by row (0,0), (0,1), ... (1,1) ...
    pub covariance: Option<Vec<T>>,
    /// The part of `covariance` that repeats from one time to the next (biases, misfit) and does not average
    /// out; planes in the same order. `None` unless the method separates it and
    /// `EstimatorOptions::systematic` is set.
    pub systematic: Option<Vec<T>>,
    /// Status of each site.
    pub status: Vec<Status>,
    /// Root mean square of the equations' residual, in grey levels.
    pub residual: Option<Vec<T>>,
    /// Rank of the equations.
    pub rank: Option<Vec<u8>>,
    /// Condition number of the (column-scaled) equations: largest over smallest singular value.
    pub condition: Option<Vec<T>>,
    /// Standard deviation, px, of the Gaussian window of the slopes, if the method chooses one at each site.
    pub window: Option<Vec<T>>,
}

/// Least eigenvalue of correlations that single precision may leave below zero.
const ROUNDING: f64 = 1e-5;

/// Whether the covariance at a site of `n`, out of planes of the upper triangle, has a negative eigenvalue
/// beyond rounding; not known, no.
fn is_indefinite<T: Real>(planes: &[T], (site, n): (usize, usize), p: usize) -> bool {
    let mut matrix = vec![0.0; p * p];
    let upper = (0..p).flat_map(|i| (i..p).map(move |j| (i, j)));
    for (plane, (i, j)) in upper.enumerate() {
        let value = planes[plane * n + site].to_f64();
        (matrix[i * p + j], matrix[j * p + i]) = (value, value);
    }
    let deviation: Vec<f64> = (0..p).map(|k| matrix[k * (p + 1)].sqrt()).collect();
    if !matrix.iter().all(|value| value.is_finite()) {
        return false;
    }
    for i in 0..p {
        for j in 0..p {
            let unit = deviation[i] * deviation[j];
            let raised = if i == j { ROUNDING } else { 0.0 };
            // A component without variance has no covariance.
            let value = &mut matrix[i * p + j];
            *value = raised + if unit > 0.0 { *value / unit } else { value.abs() * f64::MAX };
        }
    }
    !cholesky(&matrix, p, &mut vec![0.0; p * p])
}

impl<T: Real> FlowField<T> {
    /// A field at every pixel of a frame of `size = (width, height)` from given planes: `u, v`, or all of
    /// `MOTION_NAMES`, and the upper triangle of their covariance, in px and frames. Status `Unobservable`
    /// where a plane is not finite.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `motion` or `covariance` for another number of values; the latter also
    /// where values of a known flow are not finite, a variance is negative, or correlations have a negative
    /// eigenvalue.
    pub fn from_planes(size: (usize, usize), motion: Vec<T>, covariance: Option<Vec<T>>) -> Result<Self> {
        let (n, count) = (size.0 * size.1, motion.len());
        let (model, p) = if count == 2 * n { ("translational", 2) } else { ("affine", MOTION_NAMES.len()) };
        if count != p * n {
            return Err(Error::argument("motion", format!("2 or 6 planes of {n} values"), format!("{count} values")));
        }
        let layout = FieldLayout {
            frame_size: size,
            sites: SamplingGrid::default(),
            model: model.into(),
            parameters: MOTION_NAMES[..p].iter().map(|&name| name.into()).collect(),
            units: Units::default(),
            interval: Interval::Forward,
            frame_index: 0,
            correlation_length: 0.0,
        };
        let is_known = |site: usize| (0..p).all(|k| motion[k * n + site].finite());
        if let Some(planes) = &covariance {
            let (entries, found) = (p * (p + 1) / 2, planes.len());
            if found != entries * n {
                let expected = format!("{entries} planes of {n} values");
                return Err(Error::argument("covariance", expected, format!("{found} values")));
            }
            let values = |site: usize| (0..entries).map(move |k| planes[k * n + site].to_f64());
            // Row k of the upper triangle begins with a variance.
            let variances = |site: usize| (0..p).map(move |k| planes[(k * p - k * k.saturating_sub(1) / 2) * n + site]);
            for site in 0..n {
                let (expected, got) = if is_known(site) && !values(site).all(f64::is_finite) {
                    ("finite values where the flow is known", "another")
                } else if variances(site).any(|v| v.to_f64() < 0.0) {
                    ("variances of at least 0", "a negative one")
                } else if is_indefinite(planes, (site, n), p) {
                    ("positive semi-definite matrices", "an indefinite one")
                } else {
                    continue;
                };
                let got = format!("{got} at pixel ({}, {})", site % size.0, site / size.0);
                return Err(Error::argument("covariance", expected, got));
            }
        }
        let status = |site| if is_known(site) { Status::Ok } else { Status::Unobservable };
        let status = (0..n).map(status).collect();
        Ok(Self { motion, covariance, status, ..Self::empty(layout, false)? })
    }

    /// A field of NaN with status `Border`, to be filled by an estimator.
    pub fn empty(layout: FieldLayout, covariance: bool) -> Result<Self> {
        Self::of(layout, covariance, T::nan())
    }

    /// The same of zeros, for an estimator that writes every site: memory is allocated but not touched.
    pub(crate) fn unwritten(layout: FieldLayout, covariance: bool) -> Result<Self> {
        Self::of(layout, covariance, T::from_f64(0.0))
    }

    fn of(layout: FieldLayout, covariance: bool, value: T) -> Result<Self> {
        let (width, height) = layout.sites.shape(layout.frame_size)?;
        let (n, p) = (width * height, layout.parameters.len());
        // The covariance is the largest part of all that an estimator holds.
        let values = if covariance { p * (p + 1) / 2 } else { p };
        check_memory("frames", n.checked_mul(values * size_of::<T>()))?;
        Ok(Self {
            width,
            height,
            motion: vec![value; p * n],
            covariance: covariance.then(|| vec![value; p * (p + 1) / 2 * n]),
            systematic: None,
            status: vec![Status::Border; n],
            residual: None,
            rank: None,
            condition: None,
            window: None,
            layout,
        })
    }

    /// The field of frame `frame_index` of the same sequence, at which there is no estimate: NaN with status
    /// `MissingFrame`.
    pub fn missing(&self, frame_index: usize) -> Self {
        let unknown = |planes: &Vec<T>| vec![T::nan(); planes.len()];
        Self {
            layout: FieldLayout { frame_index, ..self.layout.clone() },
            width: self.width,
            height: self.height,
            motion: unknown(&self.motion),
            covariance: self.covariance.as_ref().map(unknown),
            systematic: self.systematic.as_ref().map(unknown),
            status: vec![Status::MissingFrame; self.status.len()],
            residual: self.residual.as_ref().map(unknown),
            rank: self.rank.as_ref().map(|rank| vec![0; rank.len()]),
            condition: self.condition.as_ref().map(unknown),
            window: self.window.as_ref().map(unknown),
        }
    }

    /// Multiplies motion and covariance so that they come in `units` instead of those of the layout.
    pub fn convert(&mut self, units: Units) {
        let n = self.len().max(1);
        let factor = |name: &String| units.scale(name) / self.layout.units.scale(name);
        let scale: Vec<f64> = self.layout.parameters.iter().map(factor).collect();
        let by = |plane: &mut [T], factor: f64| {
            if factor != 1.0 {
                for value in plane {
                    *value *= T::from_f64(factor);
                }
            }
        };
        self.motion.chunks_mut(n).zip(&scale).for_each(|(plane, &factor)| by(plane, factor));
        for covariance in [&mut self.covariance, &mut self.systematic].into_iter().flatten() {
            let pairs = (0..scale.len()).flat_map(|i| (i..scale.len()).map(move |j| (i, j)));
            covariance.chunks_mut(n).zip(pairs).for_each(|(plane, (i, j))| by(plane, scale[i] * scale[j]));
        }
        self.layout.units = units;
    }

    /// The field in px and frames.
    pub fn in_pixels_and_frames(&self) -> Cow<'_, Self> {
        if self.layout.units.are_pixels_and_frames() {
            return Cow::Borrowed(self);
        }
        let mut field = self.clone();
        field.convert(Units::default());
        Cow::Owned(field)
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        self.width * self.height
    }
    /// No site at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The plane of the parameter called `name`.
    pub fn plane(&self, name: &str) -> Option<&[T]> {
        let n = self.len();
        let p = self.layout.parameters.iter().position(|q| q == name)?;
        Some(&self.motion[p * n..(p + 1) * n])
    }
    /// Flow and Jacobian at site `index`; parameters that the model lacks are zero, as the model assumes.
    pub fn affine(&self, index: usize) -> AffineFlow<T> {
        let n = self.len();
        let mut m = [T::from_f64(0.0); 6];
        for (p, name) in self.layout.parameters.iter().enumerate() {
            if let Some(k) = super::MOTION_NAMES.iter().position(|known| known == name) {
                m[k] = self.motion[p * n + index];
            }
        }
        if m[0].finite() { AffineFlow::from_array(m) } else { AffineFlow::from_array([T::nan(); 6]) }
    }
    /// Standard deviation of the parameter `name` at every site; `None` without covariance or parameter.
    pub fn standard_deviation(&self, name: &str) -> Option<Vec<T>> {
        let (planes, n, p) = (self.covariance.as_ref()?, self.len(), self.layout.parameters.len());
        let k = self.layout.parameters.iter().position(|q| q == name)?;
        // Row k of the upper triangle begins after k rows of p, p - 1, ... planes.
        let plane = k * p - k * k.saturating_sub(1) / 2;
        Some(planes[plane * n..(plane + 1) * n].iter().map(|v| T::from_f64(v.to_f64().sqrt())).collect())
    }
    /// The six planes `u, v, u_x, v_x, u_y, v_y`, one after the other; parameters that the model lacks are
    /// zero where the flow is known and NaN elsewhere.
    pub fn affine_planes(&self) -> Vec<T> {
        let n = self.len();
        let mut planes = vec![T::nan(); 6 * n];
        for site in 0..n {
            for (p, value) in self.affine(site).to_array().into_iter().enumerate() {
                planes[p * n + site] = value;
            }
        }
        planes
    }
    /// Covariance matrices, 36 values a site, as [`FlowField::covariance_at`] gives them.
    pub fn covariance_matrices(&self) -> Option<Vec<T>> {
        self.covariance.as_ref()?;
        let matrices = (0..self.len()).filter_map(|site| self.covariance_at(site));
        Some(matrices.flatten().flatten().map(T::from_f64).collect())
    }
    /// Covariance of `(u, v, u_x, v_x, u_y, v_y)` at site `index`; parameters not in the model: zero.
    pub fn covariance_at(&self, index: usize) -> Option<[[f64; 6]; 6]> {
        let planes = self.covariance.as_ref()?;
        let (n, p) = (self.len(), self.layout.parameters.len());
        let place: Vec<Option<usize>> = self
            .layout
            .parameters
            .iter()
            .map(|name| super::MOTION_NAMES.iter().position(|known| known == name))
            .collect();
        let mut out = [[0.0; 6]; 6];
        let mut plane = 0;
        for i in 0..p {
            for j in i..p {
                if let (Some(a), Some(b)) = (place[i], place[j]) {
                    let value = planes[plane * n + index].to_f64();
                    out[a][b] = value;
                    out[b][a] = value;
                }
                plane += 1;
            }
        }
        Some(out)
    }
}
