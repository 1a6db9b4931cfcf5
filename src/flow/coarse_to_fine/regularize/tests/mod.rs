mod reference;

use super::*;
use reference::{affine, filled, made, motion_at, naive, rough};

const ROBUST: Smoothness = Smoothness { flow: 20.0, jacobian: 2000.0, break_strain: 0.1, sweeps: 6, reweight_every: 2 };
const QUADRATIC: Smoothness = Smoothness { break_strain: f64::INFINITY, ..ROBUST };
/// Regularises, and returns the noise that was used.
fn run<T: SimdReal>(level: Level, data: &Planes<T>, motion: &mut Planes<T>, c: &Smoothness) -> f64 {
    let floor = T::from_f64(0.05);
    let before = motion.clone();
    let change = regularize(level, data, motion, c, floor, &mut RegularizeScratch::default());
    if change < MAX_FLOW_CHANGE / 10.0 {
        let squares = (0..2).flat_map(|k| (0..motion.height).map(move |y| (k, y))).map(|(k, y)| {
            let pairs = motion.line(k, y).iter().zip(before.line(k, y));
            pairs.map(|(now, before)| (now.to_f64() - before.to_f64()).powi(2)).sum::<f64>()
        });
        let want = (squares.sum::<f64>() / (motion.width * motion.height) as f64).sqrt();
        assert!((change - want).abs() <= 1e-4 * want + 1e-6, "{change} {want}");
    }
    typical_energy(data, floor, &mut Vec::new()).to_f64()
}

fn worst<T: SimdReal>(motion: &Planes<T>, want: impl Fn(usize, usize) -> [f64; 6]) -> f64 {
    let mut worst: f64 = 0.0;
    for (x, y) in (0..motion.height).flat_map(|y| (0..motion.width).map(move |x| (x, y))) {
        let (m, want) = (motion_at(motion, x, y), want(x, y));
        assert!(m.iter().all(|v| v.is_finite()));
        worst = (0..6).map(|k| (m[k] - want[k]).abs()).fold(worst, f64::max);
    }
    worst
}

fn agrees<T: SimdReal>(tolerance: f64) {
    let some = |x, y| ((x * 7 + y * 3) % 5 != 0).then(|| rough(x, y));
    for (w, h) in [(1, 1), (2, 1), (1, 2), (5, 3), (33, 17), (150, 7)] {
        for c in [
            ROBUST,
            QUADRATIC,
            Smoothness { sweeps: 1, ..ROBUST },
            Smoothness { sweeps: 5, reweight_every: 3, flow: 5.0, ..ROBUST },
        ] {
            let data = made::<T>(w, h, some);
            let start = filled::<T>(w, h, |x, y| rough(x + 300, y));
            for level in Level::available() {
                let mut motion = start.clone();
                let noise = run(level, &data, &mut motion, &c);
                let want = naive(&data, &start, &c, noise);
                let off = worst(&motion, |x, y| want[y * w + x]);
                assert!(off < tolerance, "{w} x {h}, {level:?}, {c:?}: {off}");
            }
        }
    }
}

#[test]
fn visits_do_what_the_definition_says() {
    agrees::<f64>(1e-9);
}

#[test]
fn visits_in_single_precision_do_so_roughly() {
    agrees::<f32>(2e-3);
}

#[test]
fn noise_is_the_median_energy_of_the_sites_with_data() {
    let mut data = made::<f64>(5, 3, |x, y| Some(affine(x, y)));
    for (i, value) in [3.0, 9.0, 1.0, 4.0, 2.0].into_iter().enumerate() {
        (0..3).for_each(|y| data.line_mut(ERROR, y)[i] = value);
    }
    (0..3).for_each(|y| data.line_mut(VALID, y)[1] = 0.0);
    let noise = |data: &Planes<f64>, floor| typical_energy(data, floor, &mut Vec::new());
    assert_eq!((noise(&data, 0.5), noise(&data, 7.0)), (3.0, 7.0));
    data.data_mut().fill(0.0);
    assert_eq!(noise(&data, 0.5), 0.5);
}
