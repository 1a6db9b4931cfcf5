//! Each piece against the plainest form of its definition, in double precision.

use super::*;
use crate::flow::coarse_to_fine::refine::choose::Use;
use crate::flow::coarse_to_fine::refine::ladder::{Scale, Taps, difference_variance};
use crate::flow::coarse_to_fine::refine::regional_means::Layout;

const WIDTH: usize = 37;
const HEIGHT: usize = 26;

fn rough(k: usize, x: f64, y: f64) -> f64 {
    (x / 9.0 + k as f64).sin() * (y / 13.0).cos() + 0.3 * noise((x * 311.0 + y * 7.0) as usize + k)
}

/// A plane beyond its edges, reflected at the points on them.
fn beyond(z: &dyn Fn(isize, isize) -> f64, x: isize, y: isize) -> f64 {
    let (w, h) = (WIDTH as isize - 1, HEIGHT as isize - 1);
    if x < 0 {
        2.0 * beyond(z, 0, y) - beyond(z, -x, y)
    } else if x > w {
        2.0 * beyond(z, w, y) - beyond(z, 2 * w - x, y)
    } else if y < 0 {
        2.0 * beyond(z, x, 0) - beyond(z, x, -y)
    } else if y > h {
        2.0 * beyond(z, x, h) - beyond(z, x, 2 * h - y)
    } else {
        z(x, y)
    }
}

/// Weighted least squares by a value and two slopes (per px) in a Gaussian window about (x, y), and the
/// misfit's variance.
fn least_squares(z: &dyn Fn(isize, isize) -> f64, sigma: f64, x: isize, y: isize) -> [f64; 4] {
    let radius = (3.0 * sigma + 0.5) as isize;
    let (mut sum, mut mean, mut square, mut along, mut across, mut spread) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for j in -radius..=radius {
        for i in -radius..=radius {
            let g = (-0.5 * (i * i + j * j) as f64 / (sigma * sigma)).exp();
            let value = beyond(z, x + i, y + j);
            sum += g;
            mean += g * value;
            square += g * value * value;
            along += g * value * i as f64 * SITE_SPACING;
            across += g * value * j as f64 * SITE_SPACING;
            spread += g * (i as f64 * SITE_SPACING).powi(2);
        }
    }
    let (a, b, c) = (mean / sum, along / spread, across / spread);
    [a, b, c, square / sum - a * a - (b * b + c * c) * spread / sum]
}

fn finest(motion: &Planes<f64>) -> (Ladder<f64>, Vec<Field<f64>>) {
    let ladder = Ladder::new(seven().ladder, SITE_SPACING);
    let grids = grids(Level::detect(), &PlanePool::default(), &ladder, motion, &[0.0; 6]);
    (ladder, grids)
}

/// Means and slopes with the taps of both axes.
fn filtered(taps: &[[f64; 3]], z: &dyn Fn(isize, isize) -> f64, x: isize, y: isize) -> [f64; 3] {
    let radius = taps.len() as isize - 1;
    let tap = |k: isize| taps[k.unsigned_abs()].map(|t| if k < 0 { -t } else { t });
    let mut sums = [0.0; 3];
    for (i, j) in (-radius..=radius).flat_map(|j| (-radius..=radius).map(move |i| (i, j))) {
        let value = beyond(z, x + i, y + j);
        sums[0] += value * tap(i)[0].abs() * tap(j)[0].abs();
        sums[1] += value * tap(i)[1] * tap(j)[0].abs();
        sums[2] += value * tap(i)[0].abs() * tap(j)[1];
    }
    sums
}

fn mean_square(taps: &[[f64; 3]], z: &dyn Fn(isize, isize) -> f64, x: isize, y: isize) -> f64 {
    let radius = taps.len() as isize - 1;
    let sites = (-radius..=radius).flat_map(|j| (-radius..=radius).map(move |i| (i, j)));
    let terms =
        sites.map(|(i, j)| taps[i.unsigned_abs()][0] * taps[j.unsigned_abs()][0] * beyond(z, x + i, y + j).powi(2));
    terms.sum()
}

#[test]
fn fits_are_affine_in_their_windows_and_samples_are_repeated_fits() {
    let motion = field::<f64>(WIDTH, HEIGHT, rough);
    let (ladder, grids) = finest(&motion);
    for scale in &ladder.scales[..3] {
        let fits = fit::fits(Level::detect(), &PlanePool::default(), &grids[0], scale);
        let samples = fit::samples(Level::detect(), &PlanePool::default(), &fits, scale, 2);
        for (x, y) in [(0, 0), (3, 1), (18, 12), (36, 25), (20, 24)] {
            let mut misfit = 0.0;
            for k in 0..2 {
                let z = |x: isize, y: isize| motion.at(k, x as usize, y as usize);
                let got = [0, 2, 4].map(|n| fits.at(k + n, x, y));
                for (got, want) in got.iter().zip(filtered(&scale.first.taps, &z, x as isize, y as isize)) {
                    assert!((got - want).abs() < 1e-12, "{} {x} {y}", scale.sigma);
                }
                // Near a least-squares fit in the same window: slopes differ by the truncation of the
                // Gaussian.
                let want = least_squares(&z, scale.sigma / SITE_SPACING, x as isize, y as isize);
                assert!((got[0] - want[0]).abs() < 1e-12);
                assert!((got[1] - want[1]).abs() < 0.01 && (got[2] - want[2]).abs() < 0.01, "{got:?} {want:?}");
                misfit += mean_square(&scale.first.taps, &z, x as isize, y as isize)
                    - got[0] * got[0]
                    - scale.variance * (got[1] * got[1] + got[2] * got[2]);
                let once = |x: isize, y: isize| fits.at(k, x as usize, y as usize);
                let (x, y) = (x & !1, y & !1);
                let again = scale.again.iter().zip(&TERMS[1..]);
                let again = again.map(|(taps, c)| c * filtered(&taps.taps, &once, x as isize, y as isize)[0]);
                let want = TERMS[0] * fits.at(k, x, y) + again.sum::<f64>();
                assert!((samples.at(k, x / 2, y / 2) - want).abs() < 1e-12);
            }
            assert!((fits.at(6, x, y) - misfit.max(fit::MIN_MISFIT)).abs() < 1e-12, "{} {x} {y}", scale.sigma);
        }
    }
}

#[test]
fn grids_grow_back_without_bending_cubics() {
    let cubic = |x: f64, y: f64| 1.0 + x - 0.2 * y + 0.01 * x * x - 0.002 * x * y * y + 0.001 * x * x * x;
    let mut coarse = Field::<f64>::new(20, 14, 2);
    for y in -4..18 {
        for x in -4..24 {
            let at = coarse.start(0, y) + (LEFT as isize + x) as usize;
            coarse.data_mut()[at] = cubic(2.0 * x as f64, 2.0 * y as f64);
        }
    }
    let fine = upsample::grow(Level::detect(), &PlanePool::default(), &coarse, 2, &Field::new(39, 28, 1));
    for (x, y) in (0..39).flat_map(|x| (0..28).map(move |y| (x, y))) {
        assert!((fine.at(0, x, y) - cubic(x as f64, y as f64)).abs() < 1e-11, "{x} {y}");
    }
}

#[test]
fn choices_follow_the_formulas() {
    let options = seven();
    let ladder = Ladder::<f64>::new(options.ladder, SITE_SPACING);
    let layout = Layout::new(&seven());
    let mut means = Planes::<f64>::new(9, 1, layout.count());
    let roots = |l: usize, x: usize| 0.02 + 0.02 * x as f64 - 0.002 * l as f64;
    for x in 0..9 {
        for (k, value) in [(0, 50.0), (1, 10.0), (2, 80.0), (3, 0.4)] {
            means.line_mut(k, 0)[x] = value;
        }
        for l in 0..6 {
            means.line_mut(Layout::change(l), 0)[x] = roots(l, x);
            means.line_mut(layout.calm(l), 0)[x] = 1.2 / roots(l, x);
        }
        (0..7).for_each(|l| means.line_mut(layout.misfit(l), 0)[x] = 2.0 + l as f64);
    }
    let choice = choose::choose(Level::detect(), &PlanePool::default(), &options, &ladder, &means);
    let order = choice.order;
    let a = 0.4f64.powi(4) * 130.0 / (4000.0 - 100.0 + 1e-6);
    for x in 0..9 {
        assert!((choice.planes.at(order.density(), x, 0) / a - 1.0).abs() < 1e-12);
        // Change from the third window to the fourth, over that of white noise.
        let max_unrest = roots(2, x).powi(4) / (difference_variance(options.ladder[2], options.ladder[3]) * a);
        let slopes = 4.0 * (0.8 * max_unrest).clamp(1.0, 3.1);
        for (of, kappa, root) in [(Use::Flow, 7.0, 1.0), (Use::Slopes, slopes, 1.0), (Use::Edges, 6.0, 1.0 / 1.2)] {
            let (mut accepted, mut weights) = (1.0, Vec::new());
            for l in 0..7 {
                let next = if l == 6 {
                    0.0
                } else {
                    let d = difference_variance(options.ladder[l], options.ladder[l + 1]);
                    let ratio = (roots(l, x) * root).powi(4) / (d * a);
                    accepted / (1.0 + (ratio / kappa).powi(4))
                };
                weights.push((accepted - next - 1e-2f64).max(0.0));
                accepted = next;
            }
            let sum: f64 = weights.iter().sum();
            let (mut sigma, mut coarser) = (0.0, [0.0; 2]);
            for (l, weight) in weights.iter().enumerate() {
                assert!((choice.planes.at(order.weight(of, l), x, 0) - weight / sum).abs() < 1e-12, "{x} {l}");
                if of == Use::Flow {
                    let misfit = weight / sum * (2.0 + l as f64).powi(4);
                    assert!((choice.planes.at(order.misfit(l), x, 0) - misfit).abs() < 1e-9);
                }
                sigma += weight / sum * options.ladder[l];
                coarser[..ladder.scales[l].octave].iter_mut().for_each(|c| *c += weight / sum);
            }
            assert!((choice.planes.at(order.sigma(of), x, 0) - sigma).abs() < 1e-12);
            for (octave, want) in coarser.into_iter().enumerate() {
                assert!((choice.planes.at(order.coarser(of, octave), x, 0) - want).abs() < 1e-12);
            }
        }
    }
    // The ladder was climbed to different heights.
    assert!(
        choice.planes.at(order.sigma(Use::Flow), 0, 0) > 10.0 && choice.planes.at(order.sigma(Use::Flow), 8, 0) < 2.5
    );
}

#[test]
fn regional_levels_are_power_means() {
    let (options, level) = (seven(), Level::detect());
    let motion = field::<f64>(WIDTH, HEIGHT, rough);
    let data = {
        let mut data = statistics::<f64>(WIDTH, HEIGHT, 1.0);
        (0..HEIGHT).for_each(|y| (0..WIDTH).for_each(|x| data.line_mut(ENERGY, y)[x] = 1.0 + (x * y % 7) as f64));
        data
    };
    let (ladder, grids) = finest(&motion);
    let fits: Vec<_> =
        ladder.scales.iter().map(|s| fit::fits(level, &PlanePool::default(), &grids[s.octave], s)).collect();
    let samples = ladder.scales.iter().zip(&fits);
    let samples = samples
        .map(|(s, f)| fit::samples(level, &PlanePool::default(), f, s, if s.octave == 0 { 2 } else { 1 }))
        .collect();
    let fitted = Fitted { fits: &fits, samples };
    let means = regional_means::regional_means(level, &PlanePool::default(), &options, &ladder, &fitted, &data);
    let (half_width, half_height) = (WIDTH.div_ceil(2), HEIGHT.div_ceil(2));
    let mean = |sigma: f64, x: usize, y: usize, f: &dyn Fn(usize, usize) -> f64| {
        let taps = Taps::<f64>::gaussian(sigma / 4.0, 1.0);
        let radius = taps.radius() as isize;
        let mirror = |i: isize, n: usize| {
            let m = i.rem_euclid(2 * (n as isize - 1));
            m.min(2 * (n as isize - 1) - m) as usize
        };
        let mut sum = 0.0;
        for j in -radius..=radius {
            for i in -radius..=radius {
                let g = taps.taps[i.unsigned_abs()][0] * taps.taps[j.unsigned_abs()][0];
                sum += g * f(mirror(2 * x as isize + i, half_width), mirror(2 * y as isize + j, half_height));
            }
        }
        sum
    };
    let root = |v: f64| (v + 1e-12).powf(0.25);
    let layout = Layout::new(&seven());
    for (x, y) in [(0, 0), (4, 3), (9, 6)] {
        let want = mean(8.0, x, y, &|i, j| root(data.at(ENERGY, 2 * i, 2 * j)));
        assert!((means.at(Layout::ENERGY, x, y) - want).abs() < 1e-10);
        let change = |i: usize, j: usize| {
            let at = |l: usize, k: usize| fitted.samples[l].at(k, i, j);
            (at(1, 0) - at(2, 0)).powi(2) + (at(1, 1) - at(2, 1)).powi(2)
        };
        let want = mean(20.0, x, y, &|i, j| root(change(i, j)));
        assert!((means.at(Layout::change(1), x, y) - want).abs() < 1e-10);
        let want = mean(20.0, x, y, &|i, j| 1.0 / root(change(i, j)));
        assert!((means.at(layout.calm(1), x, y) - want).abs() < 1e-9);
        let want = mean(14.0, x, y, &|i, j| 1.0 / root(fitted.fits[0].at(6, 2 * i, 2 * j)));
        assert!((means.at(layout.misfit(0), x, y) - want).abs() < 1e-9);
    }
}

#[test]
fn edge_fits_are_the_mixture_of_nine_windows() {
    let motion = field::<f64>(WIDTH, HEIGHT, |k, x, y| if x > 30.0 { 2.0 } else { rough(k, x, y) });
    let data = statistics::<f64>(WIDTH, HEIGHT, 1e6);
    let options = RefineOptions { ladder: &[2.5], edge_misfit: 1e-9, ..seven() };
    let got = refine(Level::detect(), &PlanePool::default(), &options, &motion, &data).0;
    let base = mean_motion(&motion);
    let ladder = Ladder::<f64>::new(options.ladder, SITE_SPACING);
    let grids = grids(Level::detect(), &PlanePool::default(), &ladder, &motion, &base);
    let scale: &Scale<f64> = &ladder.scales[0];
    let fits = fit::fits(Level::detect(), &PlanePool::default(), &grids[0], scale);
    for (x, y) in [(5, 5), (15, 12), (16, 12), (30, 20)] {
        // For the flow, and for its slopes, which have sharper weights.
        let (mut sum, mut total) = ([0.0; 6], [0.0; 2]);
        // 1.5 sigma is 1.9 sites, and 1.3 along the diagonals.
        for (dx, dy) in [(0, 0), (2, 0), (-2, 0), (0, 2), (0, -2), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
            let (i, j) = ((x as isize + dx) as usize, (y as isize + dy) as usize);
            let mut m: [f64; 6] = std::array::from_fn(|k| fits.at(k, i, j));
            (0..2).for_each(|k| m[k] -= SITE_SPACING * (m[2 + k] * dx as f64 + m[4 + k] * dy as f64));
            let own: f64 = (0..2).map(|k| (m[k] - grids[0].at(k, x, y)).powi(2)).sum();
            let weight = (fits.at(6, i, j) + own + 1e-4).powi(-2);
            let weights = [weight, weight * weight];
            (0..2).for_each(|n| total[n] += weights[n]);
            (0..6).for_each(|k| sum[k] += weights[usize::from(k > 1)] * m[k]);
        }
        for k in 0..6 {
            let mut want = sum[k] / total[usize::from(k > 1)] + base[k];
            if k < 2 {
                want += SITE_SPACING * (base[2 + k] * x as f64 + base[4 + k] * y as f64);
            }
            assert!((got.at(k, x, y) - want).abs() < 1e-9, "{x} {y} {k}: {} {want}", got.at(k, x, y));
        }
    }
}
