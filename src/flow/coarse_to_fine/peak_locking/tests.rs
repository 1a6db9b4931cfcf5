use super::*;

#[test]
fn correction_undoes_the_pull_and_its_derivative() {
    let locking = PeakLocking { amplitude: [0.02, 0.01], variance: [0.0; 2], cycles: 0.5 };
    let mut motion = Planes::<f64>::new(40, 3, 6);
    let truth = |k: usize, x: usize| 0.3 + 0.11 * x as f64 - 2.0 * k as f64;
    for k in 0..2 {
        for x in 0..40 {
            let (sine, slope) = locking.phase(truth(k, x));
            motion.line_mut(k, 1)[x] = truth(k, x) + locking.amplitude[k] * sine;
            motion.line_mut(2 + k, 1)[x] = 0.05 * (1.0 + locking.amplitude[k] * slope);
        }
    }
    locking.correct(Level::detect(), &mut motion);
    for k in 0..2 {
        for x in 0..40 {
            // To first order in the amplitude.
            assert!((motion.at(k, x, 1) - truth(k, x)).abs() < 1.5e-3, "{k} {x}");
            assert!((motion.at(2 + k, x, 1) - 0.05).abs() < 0.05 * 0.008);
        }
    }
}
