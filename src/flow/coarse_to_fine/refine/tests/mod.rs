//! Whole refinements; the oracles of the pieces are in [`pieces`].

mod pieces;

use super::*;
use crate::flow::coarse_to_fine::data_term::{ENERGY, SEEN, SUMMARY, UU, VV};
use std::f64::consts::PI;

/// Evenly distributed between -1 and 1, the same for the same number.
pub(super) fn noise(n: usize) -> f64 {
    let mut z = (n as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as f64 / u64::MAX as f64 * 2.0 - 1.0
}

/// White noise of unit variance at site (x, y) of component k.
fn white(x: usize, y: usize, k: usize) -> f64 {
    noise((y * 4096 + x) * 2 + k) * 3f64.sqrt()
}

/// Motion (px) from its value at (x, y) px.
pub(super) fn field<T: SimdReal>(width: usize, height: usize, f: impl Fn(usize, f64, f64) -> f64) -> Planes<T> {
    let mut m = Planes::new(width, height, 6);
    for k in 0..2 {
        for y in 0..height {
            for (x, value) in m.line_mut(k, y).iter_mut().enumerate() {
                *value = T::from_f64(f(k, SITE_SPACING * x as f64, SITE_SPACING * y as f64));
            }
        }
    }
    m
}

/// Seven windows, for which the figures below were worked out.
pub(super) fn seven() -> RefineOptions {
    RefineOptions { ladder: &[1.5, 2.5, 4.0, 6.0, 9.0, 13.0, 18.0], kappa: 7.0, ..RefineOptions::default() }
}

/// A data term with the same information everywhere, whose noise density is `density`.
pub(super) fn statistics<T: SimdReal>(width: usize, height: usize, density: f64) -> Planes<T> {
    let mut d = Planes::new(width, height, SUMMARY);
    for (k, value) in [(UU, 100.0), (VV, 100.0), (ENERGY, density * 50.0), (SEEN, 1.0)] {
        for y in 0..height {
            d.line_mut(k, y).fill(T::from_f64(value));
        }
    }
    d
}

/// Density of white noise of standard deviation `deviation` at each site.
fn density(deviation: f64) -> f64 {
    (deviation * SITE_SPACING).powi(2)
}

fn refined<T: SimdReal>(motion: &Planes<T>, data: &Planes<T>) -> Planes<T> {
    refine(Level::detect(), &PlanePool::default(), &seven(), motion, data).0
}

/// Root of the mean square over the sites `keep`, of some planes, against the truth `f(plane, x px, y px)`.
fn rms<T: SimdReal>(
    m: &Planes<T>,
    planes: std::ops::Range<usize>,
    keep: impl Fn(usize, usize) -> bool,
    f: impl Fn(usize, f64, f64) -> f64,
) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0f64);
    for k in planes {
        for y in 0..m.height {
            for x in (0..m.width).filter(|x| keep(*x, y)) {
                sum += (m.at(k, x, y).to_f64() - f(k, SITE_SPACING * x as f64, SITE_SPACING * y as f64)).powi(2);
                n += 1.0;
            }
        }
    }
    (sum / n.max(1.0)).sqrt()
}

const AFFINE: [f64; 6] = [3.0, -12.0, 0.05, -0.02, 0.01, 0.1];

fn affine(k: usize, x: f64, y: f64) -> f64 {
    if k < 2 { AFFINE[k] + AFFINE[2 + k] * x + AFFINE[4 + k] * y } else { AFFINE[k] }
}

#[test]
fn affine_motion_comes_back_up_to_the_borders_of_any_frame() {
    for (width, height) in [(1, 1), (2, 3), (20, 7), (65, 40), (100, 67)] {
        for density in [1e-6, 1e3] {
            let got = refined(&field::<f64>(width, height, affine), &statistics(width, height, density));
            let truth = |k: usize, x: f64, y: f64| match k {
                2 | 3 if width == 1 => 0.0,
                4 | 5 if height == 1 => 0.0,
                _ => affine(k, x, y),
            };
            let error = rms(&got, 0..6, |_, _| true, truth);
            assert!(error < 1e-11, "{width} {height}: {error}");
            let got = refined(&field::<f32>(width, height, affine), &statistics(width, height, density));
            let error = rms(&got, 0..6, |_, _| true, truth);
            assert!(error < 1e-5, "{width} {height}: {error}");
            assert!((0..height).all(|y| got.line(SIGMA, y).iter().all(|s| (1.4..=18.1).contains(s))));
        }
    }
}

#[test]
fn noise_on_smooth_motion_falls_and_wide_windows_are_chosen() {
    let truth = |k: usize, x: f64, y: f64| {
        let w = 2.0 * PI / 400.0;
        match k {
            0 => 5.0 * (w * x).sin() * (w * y).cos(),
            1 => 5.0 * (w * y).sin(),
            2 => 5.0 * w * (w * x).cos() * (w * y).cos(),
            4 => -5.0 * w * (w * x).sin() * (w * y).sin(),
            5 => 5.0 * w * (w * y).cos(),
            _ => 0.0,
        }
    };
    let motion = field::<f32>(120, 90, |k, x, y| {
        truth(k, x, y) + 0.1 * white((x / SITE_SPACING) as usize, (y / SITE_SPACING) as usize, k)
    });
    let got = refined(&motion, &statistics(120, 90, density(0.1)));
    let (before, after) = (rms(&motion, 0..2, |_, _| true, truth), rms(&got, 0..2, |_, _| true, truth));
    assert!(after < before / 5.0, "{before} {after}");
    assert!(rms(&got, 2..6, |_, _| true, truth) < 0.004);
    assert!(rms(&got, SIGMA..SIGMA + 1, |_, _| true, |_, _, _| 0.0) > 6.0);
}

#[test]
fn fine_waves_stay() {
    // Seven hundredths have been lost to the windows of the data: 1 px^2 times the square of the wave number.
    let wave = |k: usize, x: f64, y: f64| (2.0 * PI / 24.0 * if k == 0 { y + 0.2 * x } else { x - 0.3 * y }).sin();
    let motion = field::<f32>(100, 80, |k, x, y| {
        0.93 * wave(k, x, y) + 0.02 * white((x / SITE_SPACING) as usize, (y / SITE_SPACING) as usize, k)
    });
    let got = refined(&motion, &statistics(100, 80, density(0.02)));
    let error = rms(&got, 0..2, |_, _| true, wave);
    assert!(error < 0.05 / 2f64.sqrt(), "{error}");
}

#[test]
fn motion_boundaries_stay_sharp() {
    let side = |x: f64, y: f64| 0.9 * (x - 100.3) + 0.3 * (y - 75.2) > 0.0;
    let truth = |k: usize, x: f64, y: f64| {
        let [left, right] = [[1.0, -0.5, 0.02, 0.0, 0.0, -0.01], [-2.0, 1.0, 0.0, 0.01, -0.02, 0.0]];
        let m = if side(x, y) { right } else { left };
        if k < 2 { m[k] + m[2 + k] * (x - 100.0) + m[4 + k] * (y - 75.0) } else { m[k] }
    };
    let motion = field::<f32>(100, 75, |k, x, y| {
        truth(k, x, y) + 0.03 * white((x / SITE_SPACING) as usize, (y / SITE_SPACING) as usize, k)
    });
    let data = statistics(100, 75, density(0.03));
    let near = |x: usize, y: usize| {
        let (x, y) = (SITE_SPACING * x as f64, SITE_SPACING * y as f64);
        let distance = (0.9 * (x - 100.3) + 0.3 * (y - 75.2)) / 0.9f64.hypot(0.3);
        (2.0..16.0).contains(&distance.abs()) && (10.0..140.0).contains(&y)
    };
    let mixed = refined(&motion, &data);
    let plain =
        refine(Level::detect(), &PlanePool::default(), &RefineOptions { edge_misfit: 1e9, ..seven() }, &motion, &data)
            .0;
    let (with, without) = (rms(&mixed, 2..6, near, truth), rms(&plain, 2..6, near, truth));
    assert!(with < 0.5 * without, "{with} {without}");
    // Of the flow itself the narrow plain windows lose little.
    let (with, without) = (rms(&mixed, 0..2, near, truth), rms(&plain, 0..2, near, truth));
    assert!(with < 1.3 * without, "{with} {without}");
}

fn busy<T: SimdReal>() -> Planes<T> {
    field(83, 70, |k, x, y| {
        (x / 31.0 + k as f64).sin() + if x > y { 3.0 } else { 0.0 } + 0.05 * noise((x * 777.0 + y) as usize)
    })
}

#[test]
fn every_instruction_set_agrees() {
    let (motion, data) = (busy::<f64>(), statistics(83, 70, density(0.03)));
    let want = refine(Level::SCALAR, &PlanePool::default(), &seven(), &motion, &data).0;
    for level in Level::available() {
        let got = refine(level, &PlanePool::default(), &seven(), &motion, &data).0;
        for (k, y) in (0..8).flat_map(|k| (0..70).map(move |y| (k, y))) {
            for (a, b) in got.line(k, y).iter().zip(want.line(k, y)) {
                assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{level:?} {k} {a} {b}");
            }
        }
    }
}

#[test]
fn nothing_comes_of_nothing_and_missing_data_stay_finite() {
    assert_eq!(refined(&Planes::<f32>::new(0, 0, 6), &Planes::new(0, 0, 26)).width, 0);
    let motion = field::<f32>(40, 30, |k, x, y| (x * y * 0.001).sin() + k as f64);
    let got = refined(&motion, &Planes::new(40, 30, 26));
    assert!((0..8).all(|k| (0..30).all(|y| got.line(k, y).iter().all(|v| v.is_finite()))));
}
