//! The affine motion that most of a region follows.

use crate::ablation::keeps;
use crate::math::{MAD_TO_STD, central_median, random::CounterRng};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};

/// Maximum number of sites that candidates are compared on.
const COMPARED_SITES: usize = 2000;
/// Number of candidates: with a third of the sites on one motion, all three of one come from it once at least
/// with a probability of .9999.
const CANDIDATES: u64 = 256;
/// Chi-square with two degrees of freedom that 99 % of the sites of a motion stay below.
const CHI2_LIMIT: f64 = 9.21;
/// Maximum standard deviation, px/frame, of what sites of one motion may differ by beyond their covariance:
/// the field is smooth where the objects are not.
const MAX_DEVIATION: f64 = 0.1;
/// Maximum variance of a site over the median of the region's: uncertain ones would follow every motion.
const MAX_VARIANCE: f64 = 4.0;
/// Refits to the sites that follow.
const REFITS: usize = 5;
/// Sites around a given point that candidates are drawn from, as a share of all.
const NEAR_SHARE: f64 = 0.1;
/// Minimum number of them.
const MIN_NEAR: usize = 30;

/// The flow of a site in px/frame, at its place from the centre in px.
#[derive(Debug, Clone, Copy)]
pub(super) struct Site {
    /// Its index in the field.
    pub(super) index: usize,
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) flow: Vector2<f64>,
    pub(super) covariance: Matrix2<f64>,
}

impl Site {
    fn place(&self) -> Vector3<f64> {
        Vector3::new(1.0, self.x, self.y)
    }
}

/// Affine flow `f(p) = A (1, x, y)^T` about the region's centre, with the deviation of its sites.
#[derive(Debug, Clone, Copy)]
pub(super) struct AffineMotion {
    matrix: SMatrix<f64, 2, 3>,
    /// Standard deviation, px/frame, of its sites beyond their covariance.
    deviation: f64,
}

impl AffineMotion {
    fn residual(&self, site: &Site) -> Vector2<f64> {
        site.flow - self.matrix * site.place()
    }

    /// Squared distance of a site's flow from the motion, in units of its covariance and a deviation.
    fn distance(&self, site: &Site, deviation: f64) -> f64 {
        let residual = self.residual(site);
        let covariance = site.covariance + SMatrix::identity() * (deviation * deviation);
        covariance.try_inverse().map_or(f64::INFINITY, |inverse| residual.dot(&(inverse * residual)))
    }

    /// Whether a site follows the motion.
    pub(super) fn holds(&self, site: &Site) -> bool {
        self.distance(site, self.deviation) < CHI2_LIMIT
    }

    /// Whether a site may belong to the motion: it follows it, or differs by what is allowed at most.
    pub(super) fn may_hold(&self, site: &Site) -> bool {
        self.distance(site, MAX_DEVIATION) < CHI2_LIMIT
    }
}

/// Limits the variances of sites that are far less certain than the others, as beside motion boundaries: a
/// tilted motion between those of both sides would hold them all.
pub(super) fn limit_variances(sites: &mut [Site]) {
    let mut variances: Vec<f64> = sites.iter().map(|site| site.covariance.trace()).collect();
    let Some(median) = central_median(&mut variances).filter(|_| keeps("measure.uncertain_sites")) else { return };
    for site in sites {
        site.covariance *= (MAX_VARIANCE * median / site.covariance.trace()).min(1.0);
    }
}

/// The motion that the largest number of `sites` follow, or with `wanted` the site (by its place in the list)
/// whose motion is requested: of candidates through three sites each the one with the least truncated sum of
/// squares (P. Torr, A. Zisserman, "MLESAC", CVIU 2000), refitted to the sites that follow it.
pub(super) fn dominant_motion(sites: &[Site], wanted: Option<usize>) -> Option<AffineMotion> {
    let step = sites.len().div_ceil(COMPARED_SITES).max(1);
    let mut compared: Vec<&Site> = sites.iter().step_by(step).collect();
    let drawn = match wanted {
        None => compared.len(),
        Some(wanted) => {
            let from = |site: &&Site| (site.x - sites[wanted].x).hypot(site.y - sites[wanted].y);
            compared.sort_by(|a, b| from(a).total_cmp(&from(b)));
            ((NEAR_SHARE * compared.len() as f64) as usize).max(MIN_NEAR).min(compared.len())
        }
    };
    // The motion around a site is judged by the sites near it.
    let judged = &compared[..drawn];
    let random = CounterRng::new(0);
    let cost = |motion: &AffineMotion| {
        judged.iter().map(|site| motion.distance(site, motion.deviation).min(CHI2_LIMIT)).sum::<f64>()
    };
    let candidates = (0..CANDIDATES).filter_map(|k| {
        let three = random.stream(k).three(drawn).map(|index| judged[index]);
        let motion = fit(&three, MAX_DEVIATION)?;
        Some((cost(&motion), motion))
    });
    let best = if drawn < 3 { None } else { candidates.min_by(|a, b| a.0.total_cmp(&b.0)) };
    let mut motion = best?.1;
    for _ in 0..REFITS {
        let inliers: Vec<&Site> = compared.iter().copied().filter(|site| motion.holds(site)).collect();
        let mut residuals: Vec<f64> = inliers.iter().flat_map(|site| motion.residual(site).abs().data.0[0]).collect();
        let deviation = MAD_TO_STD * central_median(&mut residuals)?;
        motion = fit(&inliers, if keeps("measure.scatter") { deviation.min(MAX_DEVIATION) } else { 0.0 })?;
    }
    Some(motion)
}

/// Weighted least squares for both components of the flow.
fn fit(sites: &[&Site], deviation: f64) -> Option<AffineMotion> {
    let (mut normal, mut right) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
    for site in sites {
        let weight = (site.covariance + SMatrix::identity() * (deviation * deviation)).try_inverse()?;
        let design = site.place().transpose().kronecker(&SMatrix::<f64, 2, 2>::identity());
        normal += design.transpose() * weight * design;
        right += design.transpose() * (weight * site.flow);
    }
    let solved = normal.cholesky()?.solve(&right);
    Some(AffineMotion { matrix: SMatrix::from_column_slice(solved.as_slice()), deviation })
}
