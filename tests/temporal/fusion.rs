//! Fusion of synthetic estimates with known noise and systematic error.

use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::math::Real;
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::temporal::{RecursiveFusion, RecursiveOptions};
use jacoflow::types::{FieldLayout, FlowField, Interval, SamplingGrid, Status, Units};
use nalgebra::{Matrix6, Vector6};

const SIDE: usize = 40;

const SITES: usize = SIDE * SIDE;

/// Index of the element `(i, j)`, `i <= j`, among the 21 of a symmetric matrix.
const fn upper(i: usize, j: usize) -> usize {
    i * 6 - i * (i + 1) / 2 + j
}

fn estimator(threads: usize, simd: Option<Level>) -> Estimator {
    let threads = Threads::new(Some(threads)).unwrap();
    let common = EstimatorOptions { covariance: true, systematic: true, threads, simd, ..EstimatorOptions::default() };
    Estimator::new(Method::parse("windowed").unwrap(), common).unwrap()
}

/// A fusion of estimates in the given precision.
macro_rules! fusion {
    ($real:ty, $forgetting:expr, $threads:expr, $simd:expr) => {
        RecursiveFusion::<$real>::new(&estimator($threads, $simd), RecursiveOptions { forgetting: $forgetting })
            .unwrap()
    };
}

/// Source of estimates: covariance `N + B`, `B` that of an error common to all times.
struct Estimates {
    truth: Vector6<f64>,
    noise: Matrix6<f64>,
    systematic: Matrix6<f64>,
}

impl Estimates {
    fn new(systematic: f64) -> Self {
        // Standard deviations of the size of windowed estimates, and some correlation.
        let unit = Matrix6::from_diagonal(&[2e-2, 3e-2, 3e-3, 2e-3, 4e-3, 3e-3].into());
        let mix = Matrix6::from_fn(|i, j| if i == j { 1.0 } else { 0.4 * ((i * 7 + j * 7) as f64).sin() });
        let noise = unit * mix * mix.transpose() * unit;
        Self { truth: [0.4, -0.3, 0.01, 0.02, -0.02, 0.005].into(), noise, systematic: noise * systematic }
    }

    fn root(matrix: &Matrix6<f64>) -> Matrix6<f64> {
        matrix.cholesky().map_or_else(Matrix6::zeros, |c| c.l())
    }

    fn bias(&self, site: usize) -> Vector6<f64> {
        let rng = CounterRng::new(3).stream(site as u64);
        Self::root(&self.systematic) * Vector6::from_fn(|k, _| rng.normal(k as u64))
    }

    /// The field of time `k`, whose true motion is `truth + more`.
    fn field<T: Real>(&self, k: usize, more: &Vector6<f64>) -> FlowField<T> {
        let layout = FieldLayout {
            frame_size: (SIDE, SIDE),
            sites: SamplingGrid::default(),
            model: "affine".into(),
            parameters: jacoflow::types::MOTION_NAMES.map(String::from).to_vec(),
            units: Units::default(),
            interval: Interval::Instant,
            frame_index: k,
            correlation_length: 0.0,
        };
        let mut field = FlowField::empty(layout, true).unwrap();
        let mut systematic = vec![T::default(); 21 * SITES];
        let covariance = field.covariance.as_mut().unwrap();
        let root = Self::root(&self.noise);
        for site in 0..SITES {
            let rng = CounterRng::new(11).stream((k * SITES + site) as u64);
            let m = self.truth + more + self.bias(site) + root * Vector6::from_fn(|i, _| rng.normal(i as u64));
            field.status[site] = Status::Ok;
            for i in 0..6 {
                field.motion[i * SITES + site] = T::from_f64(m[i]);
                for j in i..6 {
                    let at = upper(i, j) * SITES + site;
                    covariance[at] = T::from_f64(self.noise[(i, j)] + self.systematic[(i, j)]);
                    systematic[at] = T::from_f64(self.systematic[(i, j)]);
                }
            }
        }
        field.systematic = Some(systematic);
        field
    }

    /// Root mean square error of u and mean normalised error squared of the six.
    fn errors<T: Real>(&self, field: &FlowField<T>, more: &Vector6<f64>) -> (f64, f64) {
        let (mut square, mut normalised) = (0.0, 0.0);
        for site in 0..SITES {
            let m = Vector6::from_fn(|k, _| field.motion[k * SITES + site].to_f64());
            let c = field.covariance_at(site).unwrap();
            let e = m - self.truth - more;
            square += e[0] * e[0] / SITES as f64;
            let inverse = Matrix6::from_fn(|i, j| c[i][j]).try_inverse().unwrap();
            normalised += (e.transpose() * inverse * e)[0] / SITES as f64;
        }
        (square.sqrt(), normalised)
    }
}

fn still() -> Vector6<f64> {
    Vector6::zeros()
}

/// Slope of the logarithm of the error over the logarithm of the number of estimates, 1 to 32, and normalised
/// errors squared that average six.
fn law<T: Real>(mut fuse: impl FnMut(&mut FlowField<T>)) {
    let made = Estimates::new(0.0);
    let mut points = Vec::new();
    for k in 0..32 {
        let mut field = made.field::<T>(k, &still());
        fuse(&mut field);
        let (error, normalised) = made.errors(&field, &still());
        assert!((5.6..6.5).contains(&normalised), "{k}: {normalised}");
        if (k + 1).is_power_of_two() {
            points.push((((k + 1) as f64).ln(), error.ln()));
        }
    }
    let n = points.len() as f64;
    let (x, y) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
        / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>();
    assert!((slope + 0.5).abs() < 0.03, "{slope}");
}

#[test]
fn independent_noise_falls_with_the_root_of_the_frames() {
    let mut double = fusion!(f64, 1.0, 1, None);
    law::<f64>(|field| double.fuse(field).unwrap());
    let mut single = fusion!(f32, 1.0, 1, None);
    law::<f32>(|field| single.fuse(field).unwrap());
}

#[test]
fn forgetting_stops_the_fall_where_its_memory_ends() {
    let made = Estimates::new(0.0);
    let mut fusion = fusion!(f64, 0.9, 1, None);
    let (mut first, mut last) = (0.0, (0.0, 0.0));
    for k in 0..50 {
        let mut field = made.field(k, &still());
        fusion.fuse(&mut field).unwrap();
        last = made.errors(&field, &still());
        if k == 0 {
            first = last.0;
        }
    }
    // (1 - f) / (1 + f) of the variance; a little more, as chance sometimes looks like change.
    let ratio = (last.0 / first).powi(2) / (0.1 / 1.9);
    assert!((0.85..1.35).contains(&ratio), "{ratio}");
    assert!((5.0..6.6).contains(&last.1), "{}", last.1);
}

#[test]
fn what_every_estimate_has_does_not_average_out_and_the_covariance_says_so() {
    let made = Estimates::new(0.25);
    let mut fusion = fusion!(f64, 1.0, 1, None);
    let mut last = (0.0, 0.0);
    let mut deviation = 0.0;
    for k in 0..40 {
        let mut field = made.field(k, &still());
        fusion.fuse(&mut field).unwrap();
        last = made.errors(&field, &still());
        assert!((5.4..6.6).contains(&last.1), "{k}: {}", last.1);
        deviation = field.standard_deviation("u").unwrap()[0];
    }
    let floor = made.systematic[(0, 0)].sqrt();
    assert!((1.0..1.15).contains(&(deviation / floor)) && (0.9..1.2).contains(&(last.0 / floor)), "{}", last.0 / floor);
}

#[test]
fn a_sudden_change_starts_anew_and_a_slow_one_shortens_the_memory() {
    let made = Estimates::new(0.0);
    let deviation = made.noise[(0, 0)].sqrt();
    let jump = Vector6::from([10.0 * deviation, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let mut sudden = fusion!(f64, 0.95, 1, None);
    for k in 0..20 {
        let more = if k < 16 { still() } else { jump };
        let mut field = made.field(k, &more);
        sudden.fuse(&mut field).unwrap();
        let (error, normalised) = made.errors(&field, &more);
        assert!(k < 16 || (error < 1.2 * deviation && normalised < 7.5), "{k}: {error} {normalised}");
    }
    for rate in [0.05, 0.2, 0.5] {
        let mut slow = fusion!(f64, 0.95, 1, None);
        for k in 0..60 {
            let more = jump * (0.1 * rate * k as f64);
            let mut field = made.field(k, &more);
            slow.fuse(&mut field).unwrap();
            let (error, normalised) = made.errors(&field, &more);
            // Never worse than one estimate, and its standard deviation right to within a factor of two.
            assert!(error < 1.05 * deviation && normalised < 4.0 * 6.0, "{rate} {k}: {error} {normalised}");
        }
    }
}

#[test]
fn a_time_without_estimate_gets_the_prediction_with_a_growing_covariance() {
    let made = Estimates::new(0.1);
    let mut one = fusion!(f64, 0.9, 1, None);
    let mut before = made.field::<f64>(0, &still());
    let never = 77;
    let bury = |field: &mut FlowField<f64>, site: usize, status: Status| {
        field.status[site] = status;
        field.motion.iter_mut().skip(site).step_by(SITES).for_each(|v| *v = f64::NAN);
        field.covariance.iter_mut().flatten().skip(site).step_by(SITES).for_each(|v| *v = f64::NAN);
    };
    bury(&mut before, never, Status::Masked);
    one.fuse(&mut before).unwrap();
    let mut variance = before.covariance_at(5).unwrap()[0][0];
    for k in 1..5 {
        let mut field = made.field(k, &still());
        bury(&mut field, 5, Status::NonFinite);
        bury(&mut field, never, Status::Masked);
        one.fuse(&mut field).unwrap();
        assert_eq!((field.status[5], field.status[6]), (Status::Predicted, Status::Ok));
        assert_eq!(field.affine(5), before.affine(5));
        let grown = field.covariance_at(5).unwrap()[0][0];
        assert!((grown / variance - 1.0 / 0.9).abs() < 1e-9, "{grown} {variance}");
        variance = grown;
        assert!(field.status[never] == Status::Masked && field.affine(never).u.is_nan());
    }
    let mut field = made.field(5, &still());
    one.fuse(&mut field).unwrap();
    assert_eq!((field.status[5], field.status[never]), (Status::Ok, Status::Ok));
    assert!(field.covariance_at(5).unwrap()[0][0] < variance && field.affine(never).u.is_finite());
}

/// The same filter in words: full matrices, inverses, no lanes.
#[test]
fn the_kernel_is_the_information_filter() {
    let made = Estimates::new(0.0);
    let mut one = fusion!(f64, 0.95, 1, Some(Level::SCALAR));
    let mut oracle: Vec<(Vector6<f64>, Matrix6<f64>)> = Vec::new();
    for k in 0..6 {
        let mut field = made.field::<f64>(k, &still());
        let m: Vec<Vector6<f64>> =
            (0..SITES).map(|site| Vector6::from_fn(|i, _| field.motion[i * SITES + site])).collect();
        let information = made.noise.try_inverse().unwrap();
        one.fuse(&mut field).unwrap();
        if k == 0 {
            oracle = m.iter().map(|m| (information * m, information)).collect();
            continue;
        }
        let mut agree = 0;
        for (site, (vector, matrix)) in oracle.iter_mut().enumerate() {
            *vector = *vector * 0.95 + information * m[site];
            *matrix = *matrix * 0.95 + information;
            let want = matrix.try_inverse().unwrap() * *vector;
            let got = Vector6::from_fn(|i, _| field.motion[i * SITES + site]);
            agree += usize::from((want - got).norm() < 1e-10);
        }
        // The rest are the few where chance looked like change.
        assert!(agree * 100 > 75 * SITES, "{k}: {agree}");
    }
}

#[test]
fn results_do_not_depend_on_threads_nor_much_on_lanes_and_go_on_from_a_state() {
    let made = Estimates::new(0.2);
    let (mut one, mut two) = (fusion!(f32, 0.95, 1, None), fusion!(f32, 0.95, 2, None));
    let mut plain = fusion!(f32, 0.95, 1, Some(Level::SCALAR));
    for k in 0..6 {
        let [mut a, mut b, mut c] = [0; 3].map(|_| made.field::<f32>(k, &still()));
        one.fuse(&mut a).unwrap();
        two.fuse(&mut b).unwrap();
        plain.fuse(&mut c).unwrap();
        assert_eq!(a, b);
        let deviation = made.noise[(0, 0)].sqrt() as f32;
        let far = (0..SITES).filter(|&site| (a.motion[site] - c.motion[site]).abs() > 1e-3 * deviation).count();
        assert!(far * 1000 < SITES, "{far}");
        let (sites, state) = two.state();
        let state = state.to_vec();
        two = fusion!(f32, 0.95, 2, None);
        two.restore(sites, state).unwrap();
    }
    assert!(two.restore(3, vec![0.0; 5]).unwrap_err().to_string().contains("state"));
    let other = FieldLayout { frame_size: (8, 8), ..made.field::<f32>(0, &still()).layout };
    let message = one.fuse(&mut FlowField::empty(other, true).unwrap()).unwrap_err().to_string();
    assert!(message.contains("1600 sites"), "{message}");
}

#[test]
fn options_and_methods_that_cannot_be_fused_are_named() {
    let parse = RecursiveOptions::parse;
    assert_eq!(parse(None, None).unwrap(), None);
    assert_eq!(parse(Some("recursive"), None).unwrap(), Some(RecursiveOptions::default()));
    for (temporal, forgetting, word) in [
        (Some("kalman"), None, "temporal"),
        (None, Some(0.9), "forgetting"),
        (Some("recursive"), Some(0.0), "forgetting"),
    ] {
        assert!(parse(temporal, forgetting).unwrap_err().to_string().contains(word));
    }
    for (method, covariance, word) in [("lucas_kanade", true, "method"), ("windowed", false, "covariance")] {
        let common = EstimatorOptions { covariance, ..EstimatorOptions::default() };
        let estimator = Estimator::new(Method::parse(method).unwrap(), common).unwrap();
        let message = RecursiveFusion::<f32>::new(&estimator, RecursiveOptions::default()).unwrap_err().to_string();
        assert!(message.starts_with(word), "{message}");
    }
}
