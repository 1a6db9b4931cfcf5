//! Foreground by two mixtures: over the flow of corners, and over their positions (sections 3.3.1 and 3.3.2
//! of the paper).

use super::cloud::Particle;
use super::corners::Track;
use super::geometry::distance;
use super::noise::near_radius;
use super::options::{ForegroundModel, ParticleOptions};
use crate::error::Result;
use crate::mixture::{CovariancePrior, DirichletMixture, DirichletOptions, Points, fit_dirichlet};
use crate::parallel;
use crate::segment::{Labels, felzenszwalb};
use crate::types::{ColourFrame, Frame};

/// Components of each mixture, at most.
const COMPONENTS: usize = 12;
/// Floor of the standard deviation of flow, px.
const FLOW_FLOOR: f64 = 0.05;
/// Floor of the standard deviation of positions, px at 480 rows.
const PLACE_FLOOR: f64 = 4.0;
/// Prior standard deviation of positions, px at 480 rows.
const PLACE_PRIOR: f64 = 24.0;
/// Corners with a smaller probability of being foreground do not count.
const MIN_FOREGROUND: f64 = 0.01;
/// Number of corners that a background needs.
const MIN_CORNERS: usize = 3;
/// Density over the component's greatest at which it counts as zero.
const NEGLIGIBLE: f64 = 1e-12;

/// The background's flow and, for each corner, the probability of not being background.
pub(super) struct BackgroundFlow {
    /// Mean flow of the heaviest component, px/frame.
    pub flow: [f64; 2],
    pub foreground: Vec<f64>,
}

/// Finds the background as the heaviest component of a mixture over the flow vectors.
pub(super) fn background_flow(flow: &[[f64; 2]], options: &ParticleOptions) -> Result<BackgroundFlow> {
    if flow.len() < MIN_CORNERS {
        return Ok(BackgroundFlow { flow: [0.0; 2], foreground: vec![0.0; flow.len()] });
    }
    let points = Points { dimensions: 2, values: flow.as_flattened(), weights: None };
    let mixture = fit_dirichlet(&points, &mixture_options(FLOW_FLOOR, CovariancePrior::Data, options))?;
    let background = Gaussian::of(&mixture, 0);
    let foreground = match options.foreground {
        ForegroundModel::Posterior => {
            let (_, shares) = mixture.log_densities(&points)?;
            shares.chunks_exact(mixture.components()).map(|shares| 1.0 - shares[0]).collect()
        }
        ForegroundModel::Literal => {
            flow.iter().map(|&f| (1.0 - background.peak() * background.ratio(f)).clamp(0.0, 1.0)).collect()
        }
        ForegroundModel::Ratio | ForegroundModel::Affine => flow.iter().map(|&f| 1.0 - background.ratio(f)).collect(),
    };
    Ok(BackgroundFlow { flow: background.mean, foreground })
}

fn mixture_options(floor: f64, prior: CovariancePrior, options: &ParticleOptions) -> DirichletOptions {
    DirichletOptions {
        n_components: COMPONENTS,
        covariance_floor: floor * floor,
        covariance_prior: prior,
        random_state: options.random_state,
        threads: options.threads,
        ..DirichletOptions::default()
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Gaussian {
    mean: [f64; 2],
    /// Inverse covariance: xx, xy, yy.
    precision: [f64; 3],
    weight: f64,
}

impl Gaussian {
    fn of(mixture: &DirichletMixture, k: usize) -> Self {
        let [xx, xy, _, yy]: [f64; 4] = std::array::from_fn(|i| mixture.covariances[4 * k + i]);
        let determinant = xx * yy - xy * xy;
        Self {
            mean: std::array::from_fn(|i| mixture.means[2 * k + i]),
            precision: [yy / determinant, -xy / determinant, xx / determinant],
            weight: mixture.weights[k],
        }
    }

    fn peak(&self) -> f64 {
        let [xx, xy, yy] = self.precision;
        (xx * yy - xy * xy).sqrt() / std::f64::consts::TAU
    }

    fn ratio(&self, [x, y]: [f64; 2]) -> f64 {
        let (dx, dy) = (x - self.mean[0], y - self.mean[1]);
        let [xx, xy, yy] = self.precision;
        (-0.5 * (xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy)).exp()
    }

    /// Calls `take(x, ratio)` for the pixels of a row where the ratio counts.
    ///
    /// From one pixel to the next a Gaussian changes by a factor that itself changes by a constant factor.
    fn along_row(&self, y: usize, width: usize, mut take: impl FnMut(usize, f64)) {
        let [xx, xy, _] = self.precision;
        let dy = y as f64 - self.mean[1];
        let middle = (self.mean[0] - xy / xx * dy).round().clamp(0.0, (width - 1) as f64);
        let first = self.ratio([middle, y as f64]);
        let slope = -(xx * (middle - self.mean[0]) + xy * dy);
        let bend = (-xx).exp();
        let middle = middle as usize;
        let (mut value, mut factor) = (first, (slope - 0.5 * xx).exp());
        for x in middle..width {
            if value < NEGLIGIBLE {
                break;
            }
            take(x, value);
            value *= factor;
            factor *= bend;
        }
        let (mut value, mut factor) = (first, (-slope - 0.5 * xx).exp());
        for x in (0..middle).rev() {
            value *= factor;
            factor *= bend;
            if value < NEGLIGIBLE {
                break;
            }
            take(x, value);
        }
    }
}

/// Density of the corners that are not background, averaged over segments, component by component.
#[derive(Debug, Clone)]
pub(super) struct ForegroundMap {
    labels: Labels,
    components: Vec<Gaussian>,
    /// Mean of each component's weighted density in each segment: component by component.
    means: Vec<Vec<f64>>,
    /// Components farther from a target's predicted place do not count for it, px.
    radius: f64,
}

impl ForegroundMap {
    /// The map of the tracks' foreground probabilities on a frame in grey levels.
    pub fn of_frame(
        tracks: &[Track],
        colour: &ColourFrame<f32>,
        scale: f64,
        options: &ParticleOptions,
    ) -> Result<Self> {
        Self::new(tracks, felzenszwalb(colour, &options.segmentation(scale))?, scale, options)
    }

    /// The map on a segmented frame.
    fn new(tracks: &[Track], labels: Labels, scale: f64, options: &ParticleOptions) -> Result<Self> {
        let (mut places, mut weights) = (Vec::new(), Vec::new());
        for track in tracks.iter().filter(|track| track.residual.is_some() && track.foreground > MIN_FOREGROUND) {
            places.extend(track.position);
            weights.push(track.foreground);
        }
        let radius = near_radius(scale);
        if weights.is_empty() {
            return Ok(Self { labels, components: Vec::new(), means: Vec::new(), radius });
        }
        let points = Points { dimensions: 2, values: &places, weights: Some(&weights) };
        let prior = CovariancePrior::Isotropic((PLACE_PRIOR * scale).powi(2));
        let mixture = fit_dirichlet(&points, &mixture_options(PLACE_FLOOR * scale, prior, options))?;
        let used = (0..mixture.components()).filter(|&k| mixture.weights[k] > 0.0);
        let components: Vec<Gaussian> = used.map(|k| Gaussian::of(&mixture, k)).collect();
        let mut areas = vec![0u32; labels.count];
        labels.labels.iter().for_each(|&label| areas[label as usize] += 1);
        let means = parallel::map(&components, |component| region_means(component, &labels, &areas));
        Ok(Self { labels, components, means, radius })
    }

    /// The map at each particle's centre for a target predicted at `place`; `None` if no component is near.
    pub fn at(&self, particles: &[Particle], place: [f64; 2]) -> Option<Vec<f64>> {
        let near: Vec<&Vec<f64>> = self
            .components
            .iter()
            .zip(&self.means)
            .filter(|(component, _)| distance(component.mean, place) <= self.radius)
            .map(|(_, means)| means)
            .collect();
        let value = |particle: &Particle| {
            let (x, y) = ((particle[0] + 0.5).floor(), (particle[1] + 0.5).floor());
            if x < 0.0 || y < 0.0 || x >= self.labels.width as f64 || y >= self.labels.height as f64 {
                return 0.0;
            }
            let label = self.labels.labels[y as usize * self.labels.width + x as usize] as usize;
            near.iter().map(|means| means[label]).sum()
        };
        (!near.is_empty()).then(|| particles.iter().map(value).collect())
    }

    /// The map of all components over its maximum, (H, W) in 0 to 1.
    pub fn picture(&self) -> Frame<f32> {
        let sum = |label: usize| self.means.iter().map(|means| means[label]).sum::<f64>();
        let sums: Vec<f64> = (0..self.labels.count).map(sum).collect();
        let greatest = sums.iter().copied().fold(0.0, f64::max);
        let value = |x: usize, y: usize| {
            let label = self.labels.labels[y * self.labels.width + x] as usize;
            if greatest > 0.0 { (sums[label] / greatest) as f32 } else { 0.0 }
        };
        Frame::from_fn(self.labels.width, self.labels.height, value)
    }
}

/// Mean weighted density of a component in each segment.
fn region_means(component: &Gaussian, labels: &Labels, areas: &[u32]) -> Vec<f64> {
    let mut sums = vec![0.0; labels.count];
    for y in 0..labels.height {
        let row = &labels.labels[y * labels.width..][..labels.width];
        component.along_row(y, labels.width, |x, ratio| sums[row[x] as usize] += ratio);
    }
    let peak = component.weight * component.peak();
    sums.iter().zip(areas).map(|(sum, &area)| peak * sum / f64::from(area)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_follow_the_formula() {
        let gaussian = Gaussian { mean: [20.3, 11.8], precision: [0.02, -0.011, 0.05], weight: 0.5 };
        for y in [0, 11, 30] {
            let mut row = vec![0.0; 60];
            gaussian.along_row(y, 60, |x, ratio| row[x] = ratio);
            for (x, got) in row.into_iter().enumerate() {
                let want = gaussian.ratio([x as f64, y as f64]);
                assert!((got - want).abs() <= 1e-12 + 1e-9 * want, "{x} {y}: {got} {want}");
            }
        }
        let mut beyond = 0.0;
        Gaussian { mean: [-500.0, 5.0], ..gaussian }.along_row(5, 60, |_, ratio| beyond += ratio);
        assert!(beyond < 60.0 * NEGLIGIBLE);
    }
}
