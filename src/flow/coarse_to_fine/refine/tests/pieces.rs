//! Each piece against the plainest form of its definition, in double precision.

use super::*;
use crate::flow::coarse_to_fine::refine::ladder::Scale;

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

/// Weighted least squares by value and slopes (per px) in a Gaussian window, and the misfit's variance.
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

fn fits_of(grid: &Field<f64>, scale: &Scale<f64>) -> Field<f64> {
    let mut fits = Field::new(grid.width, grid.height, FIT);
    fit::fits(Level::detect(), grid, scale, &mut fits);
    fits
}

#[test]
fn fits_are_affine_in_their_windows_and_samples_are_repeated_fits() {
    let motion = field::<f64>(WIDTH, HEIGHT, rough);
    let (ladder, grids) = finest(&motion);
    for scale in &ladder.scales[..3] {
        let fits = fits_of(&grids[0], scale);
        let mut samples = Field::new(fits.width.div_ceil(2), fits.height.div_ceil(2), 2);
        fit::samples(Level::detect(), &fits, scale, 2, &mut samples);
        for (x, y) in [(0, 0), (3, 1), (18, 12), (36, 25), (20, 24)] {
            let mut misfit = 0.0;
            for k in 0..2 {
                let z = |x: isize, y: isize| motion.at(k, x as usize, y as usize);
                let got = [0, 2, 4].map(|n| fits.at(k + n, x, y));
                for (got, want) in got.iter().zip(filtered(&scale.first.taps, &z, x as isize, y as isize)) {
                    assert!((got - want).abs() < 1e-12, "{} {x} {y}", scale.sigma);
                }
                // Near a least-squares fit; slopes differ by the truncation of the Gaussian.
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
fn edge_fits_are_the_mixture_of_nine_windows() {
    let motion = field::<f64>(WIDTH, HEIGHT, |k, x, y| if x > 30.0 { 2.0 } else { rough(k, x, y) });
    let data = statistics::<f64>(WIDTH, HEIGHT, 1e6);
    let options = RefineOptions { ladder: &[2.5], edge_misfit: 1e-9, ..seven() };
    let got = refine(Level::detect(), &PlanePool::default(), &options, &motion, &data).0;
    let base = mean_motion(&motion);
    let ladder = Ladder::<f64>::new(options.ladder, SITE_SPACING);
    let grids = grids(Level::detect(), &PlanePool::default(), &ladder, &motion, &base);
    let scale: &Scale<f64> = &ladder.scales[0];
    let fits = fits_of(&grids[0], scale);
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
