//! A flow field cut into windows, each of them one patch with six numbers.

use super::{MIN_SPACING, is_within, site_pixels, systematic_errors};
use crate::error::Result;
use crate::math::Real;
use crate::motion3d::diagnostics::correlated_noise::area;
use crate::motion3d::model::{input::check_field, input::refuse_if, options::SystematicErrors};
use crate::motion3d::patches::AffinePatches;
use crate::parallel::{self, Threads};
use crate::types::{FieldLayout, FlowField, Intrinsics, MOTION_NAMES, Rect, SamplingGrid};
use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

/// Patches of a field, as [`AffinePatches`] takes them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FieldPatches {
    /// Middles of the windows, px.
    pub points: Vec<[f64; 2]>,
    /// `(u, v, u_x, v_x, u_y, v_y)` there, px/frame and 1/frame.
    pub motion: Vec<[f64; 6]>,
    /// Covariances of the six numbers, 36 values a patch, row by row.
    pub covariances: Vec<f64>,
    /// What the flow of the whole field may have in common, estimated from its covariances.
    pub systematic_errors: SystematicErrors,
}

impl FieldPatches {
    /// With the camera that saw them.
    pub fn seen_by<'a>(&'a self, camera: &'a Intrinsics) -> AffinePatches<'a> {
        AffinePatches {
            points: &self.points,
            motion: &self.motion,
            covariances: &self.covariances,
            camera: Some(camera),
        }
    }
}

/// Cuts the field, or a region of it, into squares of `size` px that do not overlap, and fits one flow of
/// second order to the flow and the Jacobian of the pixels of each, by least squares with the pixels'
/// covariances: its six numbers at the middle. What bends would shift those of an affine flow by more than
/// their noise. Windows of which less than half is valid are left out.
///
/// The covariance of a patch is that of independent pixels times the number of pixels on the area `58 l^2`
/// over which errors of the correlation length `l` are one (see
/// [`MotionOptions::correlation_length`](crate::motion3d::MotionOptions)), and grows by as much as residuals
/// are larger than the pixels' covariances allow, as over an edge in depth.
///
/// # Errors
/// [`Error::Argument`](crate::error::Error::Argument) naming `field` for one without covariance or
/// Jacobian, and `patches` for a size below 8 px.
pub fn field_patches<T: Real>(field: &FlowField<T>, size: usize, region: Option<Rect>) -> Result<FieldPatches> {
    check_field(field)?;
    let field = &*field.in_pixels_and_frames();
    let missing = MOTION_NAMES.iter().find(|&&name| !field.layout.parameters.iter().any(|own| own == name));
    let got = format!("a field without {}", missing.unwrap_or(&""));
    refuse_if(missing.is_some(), "field", "flow with its Jacobian", got)?;
    let is_small = (size as f64) < MIN_SPACING;
    refuse_if(is_small, "patches", format!("windows of at least {MIN_SPACING} px"), size)?;
    let windows = Windows::new(&field.layout, region, size);
    let sites = windows.pixels_of_windows(field, region);
    let fitted = Threads::default()
        .install(|| parallel::map(sites.iter().enumerate(), |(k, sites)| windows.fit(field, k, sites)));
    let mut out = FieldPatches { systematic_errors: systematic_errors(field), ..FieldPatches::default() };
    for (k, (motion, covariance)) in fitted.into_iter().enumerate().filter_map(|(k, fit)| Some((k, fit?))) {
        out.points.push(windows.middle(k));
        out.motion.push(motion.into());
        out.covariances.extend_from_slice(covariance.as_slice());
    }
    Ok(out)
}

/// Squares side by side in the middle of a rectangle.
struct Windows {
    left: usize,
    top: usize,
    size: usize,
    columns: usize,
    rows: usize,
}

impl Windows {
    /// In what both the field's own region and `region` have of the frame.
    fn new(layout: &FieldLayout, region: Option<Rect>, size: usize) -> Self {
        let (mut left, mut top, (mut right, mut bottom)) = (0, 0, layout.frame_size);
        let own = if let SamplingGrid::Grid { region, .. } = layout.sites { region } else { None };
        for r in [own, region].into_iter().flatten() {
            (left, top) = (left.max(r.x), top.max(r.y));
            (right, bottom) = (right.min(r.x.saturating_add(r.width)), bottom.min(r.y.saturating_add(r.height)));
        }
        let (width, height) = (right.saturating_sub(left), bottom.saturating_sub(top));
        let (columns, rows) = (width / size, height / size);
        Self { left: left + (width - columns * size) / 2, top: top + (height - rows * size) / 2, size, columns, rows }
    }

    /// The window of a pixel.
    fn of(&self, (x, y): (usize, usize)) -> Option<usize> {
        let column = x.checked_sub(self.left)? / self.size;
        let row = y.checked_sub(self.top)? / self.size;
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }

    fn middle(&self, window: usize) -> [f64; 2] {
        let half = 0.5 * (self.size - 1) as f64;
        let (column, row) = (window % self.columns, window / self.columns);
        [(self.left + column * self.size) as f64 + half, (self.top + row * self.size) as f64 + half]
    }

    /// Valid sites of each window.
    fn pixels_of_windows<T: Real>(&self, field: &FlowField<T>, region: Option<Rect>) -> Vec<Vec<usize>> {
        let mut out = vec![Vec::new(); self.columns * self.rows];
        for (site, at) in site_pixels(field, 1).filter(|(_, at)| is_within(region, *at)) {
            if let Some(window) = self.of(at).filter(|_| field.status[site].is_valid()) {
                out[window].push(site);
            }
        }
        out
    }

    /// The six numbers of a window and their covariance.
    fn fit<T: Real>(
        &self,
        field: &FlowField<T>,
        window: usize,
        sites: &[usize],
    ) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        let [x, y] = self.middle(window);
        let mut sums = Sums::default();
        for &site in sites {
            let (column, row) = field.layout.sites.pixel(site % field.width, site / field.width);
            let covariance = field.covariance_at(site)?;
            let six = Vector6::from(field.affine(site).to_array().map(Real::to_f64));
            sums.add(&six, &Matrix6::from_fn(|i, j| covariance[i][j]), [column as f64 - x, row as f64 - y]);
        }
        let whole = (self.size * self.size) as f64;
        // Pixels that one site stands for.
        let each = match field.layout.sites {
            SamplingGrid::Grid { stride, .. } => (stride * stride) as f64,
            SamplingGrid::Points(_) => whole / sums.count as f64,
        };
        // Of less than half the middle may lie beside what is seen.
        if (sums.count as f64) * each < 0.5 * whole {
            return None;
        }
        let length = field.layout.correlation_length;
        let sharing = (area() * length * length / each).max(1.0);
        sums.solve().map(|(motion, covariance, misfit)| (motion, covariance * (sharing * misfit)))
    }
}

/// Six numbers and six second derivatives: of `(u, v)` by xx, xy, yy.
const UNKNOWN: usize = 12;

/// Normal equations of one flow of second order.
#[derive(Default)]
struct Sums {
    normal: SMatrix<f64, UNKNOWN, UNKNOWN>,
    right: SVector<f64, UNKNOWN>,
    square: f64,
    count: usize,
}

impl Sums {
    /// The six numbers of a pixel at a distance from the middle; `None` without a usable covariance.
    fn add(&mut self, six: &Vector6<f64>, covariance: &Matrix6<f64>, distance: [f64; 2]) {
        let Some(factor) = covariance.cholesky() else { return };
        let l = factor.l();
        // The square of a pivot, in shares of its own variance, that rounding of single precision made.
        let rounded = |i: usize| l[(i, i)].powi(2) < 1e-6 * covariance[(i, i)];
        if !six.iter().all(|value| value.is_finite()) || (0..6).any(rounded) {
            return;
        }
        let Some(rows) = l.solve_lower_triangular(&transport(distance)) else { return };
        let Some(values) = l.solve_lower_triangular(six) else { return };
        self.normal += rows.transpose() * rows;
        self.right += rows.transpose() * values;
        self.square += values.norm_squared();
        self.count += 1;
    }

    /// The solution, its covariance for independent pixels, and how many times larger its residuals are than
    /// these allow, at least 1.
    fn solve(&self) -> Option<(Vector6<f64>, Matrix6<f64>, f64)> {
        let factor = self.normal.cholesky()?;
        let motion = factor.solve(&self.right);
        let freedom = (6 * self.count).saturating_sub(UNKNOWN);
        let rest = self.square - motion.dot(&self.right);
        let misfit = if freedom > 0 { (rest / freedom as f64).max(1.0) } else { 1.0 };
        let covariance = factor.inverse().fixed_view::<6, 6>(0, 0).into_owned();
        let six = motion.fixed_rows::<6>(0).into_owned();
        misfit.is_finite().then(|| (six, covariance.symmetric_part(), misfit))
    }
}

/// From the unknowns at the middle to the six numbers at a distance from it: `u + u_x dx + u_y dy + (u_xx
/// dx^2 + 2 u_xy dx dy + u_yy dy^2) / 2, ...`, `u_x + u_xx dx + u_xy dy, ...`.
fn transport([dx, dy]: [f64; 2]) -> SMatrix<f64, 6, UNKNOWN> {
    let mut out = SMatrix::zeros();
    for i in 0..2 {
        for (k, value) in [1.0, dx, dy, 0.5 * dx * dx, dx * dy, 0.5 * dy * dy].into_iter().enumerate() {
            out[(i, 2 * k + i)] = value;
        }
        for (k, value) in [(1, 1.0), (3, dx), (4, dy)] {
            out[(2 + i, 2 * k + i)] = value;
        }
        for (k, value) in [(2, 1.0), (4, dx), (5, dy)] {
            out[(4 + i, 2 * k + i)] = value;
        }
    }
    out
}
