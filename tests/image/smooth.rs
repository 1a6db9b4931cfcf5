//! Gaussian smoothing: a symmetric separable convolution, vectorised along rows and parallel over row bands.

use jacoflow::image::{Border, GaussianSmoother};
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::types::Frame;
use proptest::prelude::*;

fn noise(width: usize, height: usize, seed: u64) -> Frame<f64> {
    let rng = CounterRng::new(seed);
    Frame::from_fn(width, height, |x, y| 100.0 * rng.uniform((y * width + x) as u64))
}

/// The double sum of the definition.
fn naive(smoother: &GaussianSmoother, frame: &Frame<f64>) -> Frame<f64> {
    let (kernel, radius) = (smoother.kernel(), smoother.radius() as isize);
    let (w, h) = frame.size();
    Frame::from_fn(w, h, |x, y| {
        let mut sum = 0.0;
        for j in -radius..=radius {
            for i in -radius..=radius {
                let weight = kernel[(i + radius) as usize] * kernel[(j + radius) as usize];
                let (px, py) = (x as isize + i, y as isize + j);
                sum += weight * frame.get(smoother.border.index(px, w), smoother.border.index(py, h));
            }
        }
        sum
    })
}

fn worst(a: &Frame<f64>, b: &Frame<f64>) -> f64 {
    assert_eq!(a.size(), b.size());
    a.data().iter().zip(b.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn kernel_has_the_usual_radius_and_sums_to_one() {
    for (sigma, radius) in [(0.0, 0), (0.1, 0), (1.0, 4), (1.5, 6), (3.0, 12), (0.375, 2)] {
        let smoother = GaussianSmoother::new(sigma).unwrap();
        assert_eq!(smoother.radius(), radius, "sigma {sigma}");
        assert_eq!(smoother.kernel().len(), 2 * radius + 1);
        assert!((smoother.kernel().iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }
}

/// `scipy.ndimage.gaussian_filter` (1.17) of a unit impulse at column 1, row 0 of a 3 x 4 frame, sigma 1: its
/// first and last row.
#[test]
fn impulse_matches_the_reference() {
    let mut frame = Frame::filled(4, 3, 0.0);
    frame.row_mut(0)[1] = 1.0;
    let out = GaussianSmoother::new(1.0).unwrap().apply(&frame);
    for (got, want) in out.row(0).iter().zip(IMPULSE_FIRST).chain(out.row(2).iter().zip(IMPULSE_LAST)) {
        assert!((got - want).abs() < 1e-15, "{got} {want}");
    }
}

const IMPULSE_FIRST: [f64; 4] = [0.18968682737078058, 0.25852926597078485, 0.15525465661530216, 0.037444165055830925];

const IMPULSE_LAST: [f64; 4] = [0.018642292187967858, 0.02540808016124074, 0.01525832189974684, 0.003679987036426246];

#[test]
fn useless_sigmas_are_refused_by_name() {
    for sigma in [-1.0, f64::NAN, f64::INFINITY, 1e9] {
        assert!(GaussianSmoother::new(sigma).unwrap_err().to_string().starts_with("smooth"));
    }
    assert!(GaussianSmoother::with(1.0, f64::NAN, Border::Wrap).is_err());
}

#[test]
fn every_level_agrees_with_the_scalar_twin() {
    let frame = noise(77, 40, 5);
    let single = frame.map(|&x| x as f32);
    let smoother = GaussianSmoother::new(1.5).unwrap();
    let (want, want32) = (smoother.apply_at(Level::SCALAR, &frame), smoother.apply_at(Level::SCALAR, &single));
    for level in Level::available() {
        assert!(worst(&smoother.apply_at(level, &frame), &want) < 1e-12, "{level:?}");
        let got = smoother.apply_at(level, &single);
        assert!(got.data().iter().zip(want32.data()).all(|(a, b)| (a - b).abs() < 1e-4), "{level:?}");
    }
}

#[test]
fn bits_do_not_depend_on_the_number_of_threads() {
    let frame = noise(65, 50, 9).map(|&x| x as f32);
    let smoother = GaussianSmoother::new(2.0).unwrap();
    let run = |n| Threads::new(Some(n)).unwrap().install(|| smoother.apply(&frame));
    let one: Vec<u32> = run(1).data().iter().map(|x| x.to_bits()).collect();
    for n in [2, 3] {
        assert_eq!(one, run(n).data().iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    }
}

#[test]
fn nan_damages_exactly_the_kernel_reach() {
    let clean = noise(40, 30, 2);
    let mut hurt = clean.clone();
    hurt.row_mut(12)[17] = f64::NAN;
    hurt.row_mut(13)[17] = f64::INFINITY;
    let smoother = GaussianSmoother::new(1.0).unwrap();
    let (clean, hurt) = (smoother.apply(&clean), smoother.apply(&hurt));
    let radius = smoother.radius();
    for y in 0..30usize {
        for x in 0..40usize {
            let near = x.abs_diff(17) <= radius && (y.abs_diff(12) <= radius || y.abs_diff(13) <= radius);
            assert_eq!(!hurt.get(x, y).is_finite(), near, "{x}, {y}");
            assert!(near || hurt.get(x, y) == clean.get(x, y));
        }
    }
}

#[test]
fn empty_and_constant_frames_survive() {
    let smoother = GaussianSmoother::new(5.0).unwrap();
    assert_eq!(smoother.apply(&Frame::<f32>::new(0, 4, vec![]).unwrap()).size(), (0, 4));
    assert_eq!(smoother.apply(&Frame::<f32>::new(4, 0, vec![]).unwrap()).size(), (4, 0));
    let flat = smoother.apply(&Frame::filled(3, 2, 7.0f64));
    assert!(flat.data().iter().all(|x| (x - 7.0).abs() < 1e-13));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn agrees_with_the_double_sum(
        width in 1usize..40, height in 1usize..24, sigma in 0.0..2.5f64, seed: u64,
        border in prop_oneof![Just(Border::Reflect), Just(Border::Replicate), Just(Border::Wrap)],
    ) {
        let smoother = GaussianSmoother::with(sigma, 3.0, border).unwrap();
        let frame = noise(width, height, seed);
        prop_assert!(worst(&smoother.apply(&frame), &naive(&smoother, &frame)) < 1e-11);
    }
}
