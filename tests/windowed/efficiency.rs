//! How much of what the frames tell about the motion the estimate gets out of them.
//!
//! For a pixel with gradient `g` brightness constancy is one equation, `a . m = -d + e` with `a = (g_x, g_y,
//! g_x dx, g_y dx, g_x dy, g_y dy)`, `d` the difference of the frames over time and `e` the noise of the
//! frames in it: variance `2 s^2` for a pair, `s^2 / 2` for half the difference of the outer frames of a
//! triple (the variance that least squares leaves of a velocity from three times, so that the middle frame
//! cannot add to it). With weights `w` the weighted likelihood has the information `N = sum w a a^T /
//! var(e)`, its score the variance `S = sum w^2 a a^T / var(e)`, and the bound for estimators of that
//! weighting is `N^-1 S N^-1` (V. Godambe, 1960); for equal weights that is the Cramer-Rao bound. It knows
//! the texture's exact gradients, and takes the window of the estimate; `N^-1` alone, as if pixels far from
//! the centre were noisier, would be 2 (flow) to 4 times (Jacobian) as wide and no test.

use super::{REFERENCE, TRIPLE, estimate};
use jacoflow::flow::coarse_to_fine::CoarseToFineOptions;
use jacoflow::flow::windowed::WindowedOptions;
use jacoflow::flow::{Estimator, EstimatorOptions, Method};
use jacoflow::synth::{AffineTexture, Rounding, Scene, Sensor};
use jacoflow::types::{FlowField, Frame, Rect, SamplingGrid};
use nalgebra::{Matrix6, Vector6};

const SIDE: usize = 96;
/// Where errors are counted, and how far apart.
const REGION: (Rect, usize) = (Rect { x: 30, y: 30, width: 36, height: 36 }, 5);
const REALISATIONS: u64 = 12;
const SLOW: [f64; 6] = [0.1, 0.05, 0.003, 0.006, -0.006, 0.003];

/// The bound at pixel `(x, y)` for a Gaussian window of `sigma` px and unit variance of `e`.
fn bound(scene: &AffineTexture, sigma: f64, (x, y): (usize, usize)) -> Matrix6<f64> {
    let reach = (3.0 * sigma).round() as isize;
    let (mut n, mut s) = (Matrix6::zeros(), Matrix6::zeros());
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let (dx, dy) = (dx as f64, dy as f64);
            let (px, py) = (x as f64 + dx, y as f64 + dy);
            let step = 1e-3;
            let slope = |ex: f64, ey: f64| {
                (scene.brightness(px + ex, py + ey, 0.0) - scene.brightness(px - ex, py - ey, 0.0)) / (2.0 * step)
            };
            let (gx, gy) = (slope(step, 0.0), slope(0.0, step));
            let a = Vector6::new(gx, gy, gx * dx, gy * dx, gx * dy, gy * dy);
            let w = (-0.5 * (dx * dx + dy * dy) / (sigma * sigma)).exp();
            n += a * a.transpose() * w;
            s += a * a.transpose() * w * w;
        }
    }
    let inverse = n.try_inverse().unwrap();
    inverse * s * inverse
}

/// Mean over sites and realisations of `e^T C^-1 e / 6`, `C` the bound: by how much the mean squared error
/// exceeds it.
fn excess(
    motion: [f64; 6],
    (frames, noise, sigma): (usize, f64, f64),
    estimate: impl Fn(&[Frame<f64>], EstimatorOptions) -> FlowField<f64>,
) -> f64 {
    let scene = AffineTexture::moving((SIDE, SIDE), motion, 5).unwrap();
    let times: &[f64] = if frames == 2 { &[-0.5, 0.5] } else { &TRIPLE };
    let clean: Vec<Frame<f64>> = times.iter().map(|&t| scene.frame(t)).collect();
    let common = EstimatorOptions {
        sites: SamplingGrid::Grid { region: Some(REGION.0), stride: REGION.1 },
        ..EstimatorOptions::default()
    };
    let share = if frames == 2 { 2.0 } else { 0.5 };
    let mut inverses: Vec<Matrix6<f64>> = Vec::new();
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 0..REALISATIONS {
        let camera = Sensor { noise, rounding: Rounding::None, saturate: false, random_state: seed };
        let seen: Vec<Frame<f64>> = clean.iter().enumerate().map(|(k, f)| camera.apply(f, k as u64)).collect();
        let field = estimate(&seen, common.clone());
        for site in 0..field.len() {
            let (x, y) = field.layout.sites.pixel(site % field.width, site / field.width);
            if inverses.len() == site {
                let c = bound(&scene, sigma, (x, y)) * (share * noise * noise);
                inverses.push(c.try_inverse().unwrap());
            }
            let truth = Vector6::from(scene.motion(x as f64, y as f64, 0.0).unwrap().to_array());
            let e = Vector6::from(field.affine(site).to_array()) - truth;
            sum += (e.transpose() * inverses[site] * e)[0] / 6.0;
            count += 1.0;
        }
    }
    sum / count
}

/// Up to 0.1 px/frame, where the expansion in small motion holds, the default estimates of three frames and
/// of two are within 1.3 times the bound.
#[test]
fn the_error_is_near_the_cramer_rao_bound() {
    let (options, pair) = (WindowedOptions::default(), WindowedOptions::pair());
    for motion in [[0.0; 6], SLOW] {
        for (noise, options) in [(4.0, &options), (2.0, &options), (4.0, &pair), (2.0, &pair)] {
            let case = (options.frames, noise, options.sigma);
            let excess = excess(motion, case, |frames: &[Frame<f64>], common| estimate(frames, options, &common));
            println!("{motion:?}, {} frames, noise {noise}: {excess:.2} times the bound", options.frames);
            assert!(excess < 1.3, "{motion:?}, {} frames, noise {noise}: {excess}", options.frames);
        }
    }
}

/// At 0.4 px/frame the bias of the expansion (time differences, smoothing under strain) shows beside the
/// noise, and the estimate at one level, without warping, does not come within 1.3 times the bound. These are
/// the figures that it reaches.
#[test]
fn beyond_small_motion_the_expansion_costs_more_than_the_noise() {
    let options = WindowedOptions::default();
    for (motion, noise, most) in [(REFERENCE, 4.0, 1.55), (REFERENCE, 2.0, 2.5)] {
        let case = (3, noise, options.sigma);
        let excess = excess(motion, case, |frames: &[Frame<f64>], common| estimate(frames, &options, &common));
        println!("{motion:?}, noise {noise}: {excess:.2} times the bound");
        assert!(excess < most, "{motion:?}, noise {noise}: {excess}");
    }
}

/// Warping takes the expansion away: coarse to fine stays below the bound of a window of 4 px at any speed
/// (it averages over wider windows where the flow lets it, so that this is no figure of efficiency).
#[test]
fn coarse_to_fine_is_below_the_bound_of_a_small_window_at_any_speed() {
    for motion in [SLOW, REFERENCE, [3.3, -2.2, 0.003, 0.006, -0.006, 0.003]] {
        let estimator = |common| Estimator::new(Method::CoarseToFine(CoarseToFineOptions::default()), common).unwrap();
        let excess = excess(motion, (3, 4.0, 4.0), |frames: &[Frame<f64>], common| {
            estimator(common).estimate(&frames.iter().collect::<Vec<_>>(), 0).unwrap()
        });
        println!("coarse to fine, {motion:?}: {excess:.2} times the bound of 4 px");
        assert!(excess < 1.0, "{motion:?}: {excess}");
    }
}
