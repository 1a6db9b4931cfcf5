//! The stencil of a neighbourhood: weights, covariance, and the jet at one pixel.

use jacoflow::jet::{JetStencil, Neighbourhood};
use jacoflow::math::random::CounterRng;
use jacoflow::types::Frame;

fn square(n: usize) -> JetStencil {
    JetStencil::new(&Neighbourhood::square(n), (1.0, 1.0)).unwrap()
}

#[test]
fn three_by_three_is_the_patents_stencil() {
    // (32), (33): weights over a[y][x], y, x in -1..1, row by row.
    let want: [([f64; 9], f64); 6] = [
        ([-1.0, 2.0, -1.0, 2.0, 5.0, 2.0, -1.0, 2.0, -1.0], 9.0),
        ([-1.0, 0.0, 1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0], 6.0),
        ([-1.0, -1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0], 6.0),
        ([1.0, -2.0, 1.0, 1.0, -2.0, 1.0, 1.0, -2.0, 1.0], 3.0),
        ([1.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0], 4.0),
        ([1.0, 1.0, 1.0, -2.0, -2.0, -2.0, 1.0, 1.0, 1.0], 3.0),
    ];
    let stencil = square(3);
    for (k, (row, divisor)) in want.iter().enumerate() {
        for (o, w) in row.iter().enumerate() {
            assert!((stencil.weights()[o][k] - w / divisor).abs() < 1e-14, "component {k}, pixel {o}");
        }
    }
    let variances = [5.0 / 9.0, 1.0 / 6.0, 1.0 / 6.0, 2.0, 0.25, 2.0];
    for (k, v) in variances.into_iter().enumerate() {
        assert!((stencil.covariance()[k][k] - v).abs() < 1e-14);
    }
}

#[test]
fn designs_of_low_rank_are_refused_by_name() {
    let points = |offsets: &[(i32, i32)]| Neighbourhood::Points { offsets: offsets.to_vec(), sigma: None };
    let circle = [(5, 0), (-5, 0), (0, 5), (0, -5), (3, 4), (-3, 4), (3, -4), (-3, -4), (4, 3)];
    for bad in [points(&[(0, 0), (1, 0), (0, 1)]), points(&circle), points(&[])] {
        let message = JetStencil::new(&bad, (1.0, 1.0)).unwrap_err().to_string();
        assert!(message.starts_with("neighbourhood") && message.contains("rank"), "{message}");
    }
    let pitch = JetStencil::new(&Neighbourhood::default(), (0.0, 1.0)).unwrap_err().to_string();
    assert!(pitch.starts_with("pixel_pitch"));
}

#[test]
fn covariance_and_noise_variance_agree_with_simulation() {
    let shapes = [
        Neighbourhood::Rectangle { width: 5, height: 4, sigma: None },
        Neighbourhood::Rectangle { width: 5, height: 5, sigma: Some(1.2) },
    ];
    for shape in shapes {
        let stencil = JetStencil::new(&shape, (1.0, 1.0)).unwrap();
        let (n, sd) = (20_000u64, 1.5);
        let rng = CounterRng::new(11);
        let (mut sums, mut variance) = ([[0.0; 6]; 6], 0.0);
        for i in 0..n {
            let stream = rng.stream(i);
            let frame = Frame::from_fn(5, 5, |x, y| 50.0 + sd * stream.normal((5 * y + x) as u64));
            let mut jet = stencil.at(&frame, 2, 2);
            jet[0] -= 50.0;
            for a in 0..6 {
                for b in 0..6 {
                    sums[a][b] += jet[a] * jet[b] / n as f64;
                }
            }
            variance += stencil.noise_variance(&frame, 2, 2).unwrap() / n as f64;
        }
        let cov = stencil.covariance();
        for a in 0..6 {
            for b in 0..6 {
                let want = sd * sd * cov[a][b];
                let scale = sd * sd * (cov[a][a] * cov[b][b]).sqrt();
                assert!((sums[a][b] - want).abs() < 0.04 * scale, "{a} {b}");
            }
        }
        assert!((variance / (sd * sd) - 1.0).abs() < 0.02, "{variance}");
    }
}

#[test]
fn six_pixels_leave_no_residual() {
    let offsets = vec![(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1)];
    let stencil = JetStencil::new(&Neighbourhood::Points { offsets, sigma: None }, (1.0, 1.0)).unwrap();
    assert!(stencil.noise_variance(&Frame::filled(5, 5, 1.0), 2, 2).is_none());
    assert!(square(3).noise_variance(&Frame::filled(5, 5, 1.0), 0, 2).unwrap().is_nan());
}
