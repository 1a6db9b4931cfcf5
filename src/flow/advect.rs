//! Points carried along by a field, with their covariance.

use crate::error::{Error, Result};
use crate::math::Real;
use crate::types::{FlowField, MOTION_NAMES, Rect, SamplingGrid};

/// A covariance matrix of a point, px^2, rows and columns x, y.
pub type PointCovariance = [[f64; 2]; 2];

/// Moved points.
#[derive(Debug, Clone, PartialEq)]
pub struct Advected {
    /// The points one frame later, `(x, y)` px; NaN where the field has no estimate.
    pub points: Vec<[f64; 2]>,
    /// Their covariance, px^2, if the points have one; NaN with the point.
    pub covariances: Option<Vec<PointCovariance>>,
}

/// Flow between the sites.
struct Between {
    /// The flow, px/frame.
    flow: [f64; 2],
    /// Its Jacobian, 1/frame, `[[u_x, u_y], [v_x, v_y]]`.
    jacobian: [[f64; 2]; 2],
    /// The flow's covariance, (px/frame)^2; zero where the field has none.
    covariance: PointCovariance,
}

/// Moves points by a field: `p' = p + f(p)`, the motion of one frame.
///
/// Between sites the flow is the bilinear mean of the affine motions of the four sites around the point,
/// `f(p) = sum_k w_k (f_k + M_k (p - s_k))` with bilinear weights `w_k`; at a site it is the site's flow, and
/// an affine field is exact everywhere.
///
/// A covariance `C` becomes `(I + M) C (I + M)^T + C_f`: the error of the point, deformed by the flow, and
/// that of the flow itself, taken as independent. `M = sum_k w_k M_k`, or the slope of the interpolated flow
/// for a model without derivatives. `C_f = sum_k w_k A_k C_k A_k^T` with the sites' covariances `C_k` of `(u,
/// v, u_x, v_x, u_y, v_y)` and `A_k` the derivative of `f_k + M_k (p - s_k)` by them: exact if the four sites
/// have the same error, as neighbours with overlapping windows do, else an upper bound. It is zero for a
/// field without covariance.
///
/// A point is NaN if it is outside the rectangle of sites (nothing is extrapolated), if a site with a weight
/// has no valid estimate, and if it was NaN.
///
/// A field in other units is converted to px and frames first. A field of velocities (`Interval::Instant`)
/// is taken for steps.
///
/// # Errors [`Error::Argument`] naming `field` for a list of points instead of a grid, `covariance` for
/// another number of matrices than of points.
pub fn advect<T: Real>(
    field: &FlowField<T>,
    points: &[[f64; 2]],
    covariances: Option<&[PointCovariance]>,
) -> Result<Advected> {
    let field = field.in_pixels_and_frames();
    let lattice = Lattice::of(&field)?;
    if let Some(matrices) = covariances.filter(|matrices| matrices.len() != points.len()) {
        return Err(Error::argument("covariance", format!("{} matrices, one a point", points.len()), matrices.len()));
    }
    let found: Vec<Option<Between>> = points.iter().map(|point| lattice.at(&field, *point)).collect();
    let moved = |(point, between): (&[f64; 2], &Option<Between>)| match between {
        Some(there) => [point[0] + there.flow[0], point[1] + there.flow[1]],
        None => [f64::NAN; 2],
    };
    let spread = |(matrix, between): (&PointCovariance, &Option<Between>)| match between {
        Some(there) => deformed(matrix, there),
        None => [[f64::NAN; 2]; 2],
    };
    Ok(Advected {
        points: points.iter().zip(&found).map(moved).collect(),
        covariances: covariances.map(|matrices| matrices.iter().zip(&found).map(spread).collect()),
    })
}

/// `(I + M) C (I + M)^T + C_f`.
fn deformed(matrix: &PointCovariance, there: &Between) -> PointCovariance {
    let [[a, b], [c, d]] = there.jacobian;
    let step = [[1.0 + a, b], [c, 1.0 + d]];
    let left: PointCovariance =
        std::array::from_fn(|i| std::array::from_fn(|j| step[i][0] * matrix[0][j] + step[i][1] * matrix[1][j]));
    std::array::from_fn(|i| {
        std::array::from_fn(|j| left[i][0] * step[j][0] + left[i][1] * step[j][1] + there.covariance[i][j])
    })
}

struct Lattice {
    origin: [f64; 2],
    stride: f64,
    /// Whether the model has derivatives of its own.
    has_slopes: bool,
}

impl Lattice {
    fn of<T: Real>(field: &FlowField<T>) -> Result<Self> {
        let layout = &field.layout;
        let SamplingGrid::Grid { region, stride } = &layout.sites else {
            let got = format!("a list of {} points", field.len());
            return Err(Error::argument("field", "one on a grid of pixels, to interpolate in", got));
        };
        let Rect { x, y, .. } = region.unwrap_or(Rect { x: 0, y: 0, width: 0, height: 0 });
        let has_slopes = MOTION_NAMES[2..].iter().any(|name| layout.parameters.iter().any(|known| known == name));
        Ok(Self { origin: [x as f64, y as f64], stride: *stride as f64, has_slopes })
    }

    /// The flow at a point; `None` outside the sites or if a needed site is not valid.
    fn at<T: Real>(&self, field: &FlowField<T>, point: [f64; 2]) -> Option<Between> {
        let place: [f64; 2] = std::array::from_fn(|c| (point[c] - self.origin[c]) / self.stride);
        let (column, fx) = cell(place[0], field.width)?;
        let (row, fy) = cell(place[1], field.height)?;
        let mut sum = Between { flow: [0.0; 2], jacobian: [[0.0; 2]; 2], covariance: [[0.0; 2]; 2] };
        for (dy, wy) in [(0, 1.0 - fy), (1, fy)] {
            for (dx, wx) in [(0, 1.0 - fx), (1, fx)] {
                let weight = wx * wy;
                // A site beside or below the last one has no weight when the point is on the edge.
                if weight == 0.0 {
                    continue;
                }
                let site = (row + dy) * field.width + column + dx;
                let offset = [(fx - dx as f64) * self.stride, (fy - dy as f64) * self.stride];
                sum.add(field, site, offset, weight)?;
            }
        }
        if !self.has_slopes {
            sum.jacobian = self.slope(field, (column, row), (fx, fy));
        }
        Some(sum)
    }

    /// The slope of bilinear flow in a cell; along an axis with one site only, zero. Sites without a
    /// weight for the flow itself count only where they are valid.
    fn slope<T: Real>(
        &self,
        field: &FlowField<T>,
        (column, row): (usize, usize),
        (fx, fy): (f64, f64),
    ) -> [[f64; 2]; 2] {
        let flow = |dx: usize, dy: usize| -> Option<[f64; 2]> {
            let (x, y) = (column + dx, row + dy);
            let site = y * field.width + x;
            let there = x < field.width && y < field.height && field.status[site].has_estimate();
            there.then(|| field.affine(site).to_array()).map(|m| [m[0].to_f64(), m[1].to_f64()])
        };
        let step = |after: Option<[f64; 2]>, before: Option<[f64; 2]>, weight: f64| -> [f64; 2] {
            match (after, before) {
                (Some(after), Some(before)) => std::array::from_fn(|c| weight * (after[c] - before[c]) / self.stride),
                _ => [0.0; 2],
            }
        };
        let x = [step(flow(1, 0), flow(0, 0), 1.0 - fy), step(flow(1, 1), flow(0, 1), fy)];
        let y = [step(flow(0, 1), flow(0, 0), 1.0 - fx), step(flow(1, 1), flow(1, 0), fx)];
        std::array::from_fn(|c| [x[0][c] + x[1][c], y[0][c] + y[1][c]])
    }
}

impl Between {
    /// Adds the affine motion of one site at an `offset` from it, px; `None` if it has no valid estimate.
    fn add<T: Real>(&mut self, field: &FlowField<T>, site: usize, offset: [f64; 2], weight: f64) -> Option<()> {
        let m = field.affine(site).to_array().map(T::to_f64);
        if !field.status[site].has_estimate() || !m.iter().all(|value| value.is_finite()) {
            return None;
        }
        let [dx, dy] = offset;
        for c in 0..2 {
            self.flow[c] += weight * (m[c] + m[2 + c] * dx + m[4 + c] * dy);
            self.jacobian[c][0] += weight * m[2 + c];
            self.jacobian[c][1] += weight * m[4 + c];
        }
        if let Some(covariance) = field.covariance_at(site) {
            // Row c of A: 1 at the flow, dx at its derivative along x, dy at that along y.
            let row = |c: usize| [(c, 1.0), (2 + c, dx), (4 + c, dy)];
            for (i, line) in self.covariance.iter_mut().enumerate() {
                for (j, entry) in line.iter_mut().enumerate() {
                    for (p, a) in row(i) {
                        *entry += weight * row(j).iter().map(|&(q, b)| a * covariance[p][q] * b).sum::<f64>();
                    }
                }
            }
        }
        Some(())
    }
}

/// The cell of a position on an axis of `count` sites, and the remainder.
fn cell(place: f64, count: usize) -> Option<(usize, f64)> {
    if count == 0 || !(place >= 0.0 && place <= (count - 1) as f64) {
        return None;
    }
    let first = (place.floor() as usize).min(count.saturating_sub(2));
    Some((first, place - first as f64))
}
