//! Noisy values drawn to what others predict, as far as that can be trusted (empirical Bayes).

use super::regression::{Prediction, Site, regress};
use super::tree::{Neighbours, SIZES, Tree};
use crate::math::random::CounterRng;
use crate::simd::Level;

/// Which predictors may be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Smoother {
    /// The better of both on these points.
    #[default]
    Auto,
    /// One normal distribution of all values.
    Prior,
    /// Local-linear regression on the 8, 16, 32 or 64 nearest points.
    Neighbours,
}

/// Most points that predictors are compared on.
const COMPARED: usize = 4000;

/// Most that a point counts, in squared standard deviations: a step must not decide alone.
const CAP: f64 = 25.0;

/// Rounds of the excess variance of one prior.
const PRIOR_ROUNDS: usize = 50;

/// A fitted predictor with what it says about the compared points.
struct Fitted {
    /// Number of neighbours; `None`: one prior.
    nearest: Option<usize>,
    prediction: Prediction,
    excess: f64,
    /// Mean of `ln tot + min(res^2 / tot, 25)`.
    loss: f64,
}

/// Posterior means, how much of each point's own value is in them, and their variances; as many as the values
/// given.
#[derive(Debug, Clone)]
pub(crate) struct Smoothed {
    pub value: Vec<f64>,
    pub share: Vec<f64>,
    pub variance: Vec<f64>,
}

/// Smooths values at one set of places; the neighbourhoods are found once.
#[derive(Debug)]
pub(crate) struct SiteSmoother {
    tree: Tree,
    which: Smoother,
    spherical: bool,
    level: Level,
    /// Places in the tree of the points that predictors are compared on, and their neighbours.
    compared: Vec<u32>,
    lists: Neighbours,
    /// Neighbours of all points, where only some are compared.
    everyone: Option<Neighbours>,
}

impl SiteSmoother {
    /// For `(x, y, 0)` on a plane, or points of the unit sphere.
    pub fn new(places: &[[f64; 3]], spherical: bool, which: Smoother, rng: CounterRng) -> Self {
        let tree = Tree::new(places);
        let compared = rng.sample(places.len(), COMPARED);
        let most = SIZES.into_iter().rfind(|&k| k < places.len());
        let lists = most.map_or_else(Neighbours::default, |k| tree.nearest(&compared, k));
        Self { tree, which, spherical, level: Level::detect(), compared, lists, everyone: None }
    }

    /// By place in the tree.
    fn measured_sites(&self, (values, precisions): (&[f64], &[f64])) -> Vec<Site> {
        let places = self.tree.order().iter().zip(self.tree.points());
        places.map(|(&i, &at)| Site { at, value: values[i as usize], precision: precisions[i as usize] }).collect()
    }

    /// The predictor with the least loss on the compared points, and these.
    fn best(&self, sites: &[Site], which: Smoother) -> (Fitted, Vec<Site>) {
        let compared: Vec<Site> = self.compared.iter().map(|&place| sites[place as usize]).collect();
        let is_prior_allowed = which != Smoother::Neighbours || self.lists.k == 0;
        let prior = is_prior_allowed.then(|| Self::prior(sites, &compared));
        let regressions = SIZES.into_iter().filter(|&k| k <= self.lists.k && which != Smoother::Prior).map(|k| {
            let prediction = regress(sites, &self.compared, &self.lists, k, self.spherical, self.level);
            let excess = excess_variance(&compared, &prediction);
            let loss = loss(&compared, &prediction, excess, 0.0);
            Fitted { nearest: Some(k), prediction, excess, loss }
        });
        let better = |best: Fitted, other: Fitted| if other.loss < best.loss { other } else { best };
        let best = prior.into_iter().chain(regressions).reduce(better);
        (best.expect("at least one predictor is allowed"), compared)
    }

    /// One normal prior: mean with weights `1 / (v + t2)`, `t2` the scatter beyond the noise.
    fn prior(sites: &[Site], compared: &[Site]) -> Fitted {
        let (mut mean, mut excess) = (0.0, 0.0);
        for _ in 0..PRIOR_ROUNDS {
            let (mut sum, mut total) = (0.0, 0.0);
            for site in sites {
                let weight = site.precision / (1.0 + excess * site.precision);
                sum += weight * site.value;
                total += weight;
            }
            mean = if total > 0.0 { sum / total } else { 0.0 };
            let (mut scatter, mut squares) = (0.0, 0.0);
            for site in sites.iter().filter(|site| site.precision > 0.0) {
                let weight = site.precision / (1.0 + excess * site.precision);
                scatter += weight * weight * ((site.value - mean) * (site.value - mean) - 1.0 / site.precision);
                squares += weight * weight;
            }
            let next = if squares > 0.0 { (scatter / squares).max(0.0) } else { 0.0 };
            let settled = (next - excess).abs() <= 1e-6 * next;
            excess = next;
            if settled {
                break;
            }
        }
        let prediction = Prediction { q: vec![mean; compared.len()], c: vec![0.0; compared.len()] };
        let loss = loss(compared, &prediction, excess, 0.0);
        Fitted { nearest: None, prediction, excess, loss }
    }

    /// How unlikely values of these precisions are, given their neighbours: twice the negative logarithm of
    /// the likelihood, `sum [ln(tot / v) + min(res^2 / tot, 25)]`. Always uses the better predictor.
    pub fn cost(&self, measured: (&[f64], &[f64])) -> f64 {
        let sites = self.measured_sites(measured);
        let (fitted, compared) = self.best(&sites, Smoother::Auto);
        loss(&compared, &fitted.prediction, fitted.excess, 1.0) * sites.len() as f64
    }

    /// The posterior means `q + (t2 + c) / tot (value - q)` of values of these precisions.
    pub fn smooth(&mut self, measured: (&[f64], &[f64])) -> Smoothed {
        let sites = self.measured_sites(measured);
        let (Fitted { nearest, prediction, excess, .. }, _) = self.best(&sites, self.which);
        let all = match nearest {
            None => {
                let mean = prediction.q.first().copied().unwrap_or(0.0);
                Prediction { q: vec![mean; sites.len()], c: vec![0.0; sites.len()] }
            }
            Some(_) if self.compared.len() == sites.len() => prediction,
            Some(k) => {
                let everyone: Vec<u32> = (0..sites.len() as u32).collect();
                if self.everyone.as_ref().is_none_or(|lists| lists.k < k) {
                    self.everyone = Some(self.tree.nearest(&everyone, k));
                }
                let lists = self.everyone.as_ref().expect("made just before");
                regress(&sites, &everyone, lists, k, self.spherical, self.level)
            }
        };
        let none = vec![0.0; measured.0.len()];
        let mut out = Smoothed { value: none.clone(), share: none.clone(), variance: none };
        for (place, (site, &i)) in sites.iter().zip(self.tree.order()).enumerate() {
            // (t2 + c) / (t2 + c + 1 / precision), which is 0 at the epipole.
            let (q, spread) = (all.q[place], excess + all.c[place]);
            let wide = spread * site.precision;
            let share = wide / (wide + 1.0);
            out.share[i as usize] = share;
            out.variance[i as usize] = spread / (wide + 1.0);
            out.value[i as usize] = q + share * (site.value - q);
        }
        out
    }
}

/// The scatter of values about their predictions beyond both noises, `t2`.
fn excess_variance(sites: &[Site], prediction: &Prediction) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (site, (q, c)) in
        sites.iter().zip(prediction.q.iter().zip(&prediction.c)).filter(|(site, _)| site.precision > 0.0)
    {
        let noise = 1.0 / site.precision + c;
        let weight = 1.0 / (noise * noise);
        let square = (site.value - q) * (site.value - q);
        sum += weight * (square.min(CAP * noise) - noise);
        total += weight;
    }
    if total > 0.0 { (sum / total).max(0.0) } else { 0.0 }
}

/// Mean of `ln tot + min(res^2 / tot, 25)`, `tot = t2 + v + c`; with `relative` 1, of `ln(tot s^2)`.
fn loss(sites: &[Site], prediction: &Prediction, excess: f64, relative: f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for (site, (q, c)) in
        sites.iter().zip(prediction.q.iter().zip(&prediction.c)).filter(|(site, _)| site.precision > 0.0)
    {
        let total = excess + 1.0 / site.precision + c;
        let square = (site.value - q) * (site.value - q);
        sum += total.ln() + relative * site.precision.ln() + (square / total).min(CAP);
        count += 1;
    }
    if count > 0 { sum / count as f64 } else { f64::INFINITY }
}
