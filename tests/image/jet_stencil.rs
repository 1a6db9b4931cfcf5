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

#[test]
fn quadratics_are_recovered_exactly_in_units_of_the_pitch() {
    let jet = [90.0, 3.0, -2.0, 0.7, -0.4, 0.3];
    let (dx, dy) = (0.5, 2.0);
    let design_row = |x: f64, y: f64| [1.0, x, y, 0.5 * x * x, x * y, 0.5 * y * y];
    let value = |x: usize, y: usize| {
        let row = design_row((x as f64 - 8.0) * dx, (y as f64 - 7.0) * dy);
        row.iter().zip(jet).map(|(b, i)| b * i).sum::<f64>()
    };
    let frame = Frame::from_fn(18, 17, value);
    let rectangle = |width, height, sigma| Neighbourhood::Rectangle { width, height, sigma };
    let ring = (0..8).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_4);
    let mut offsets: Vec<_> = ring.map(|a| ((3.0 * a.cos()).round() as i32, (3.0 * a.sin()).round() as i32)).collect();
    offsets.push((1, 0));
    let shapes = [
        rectangle(3, 3, None),
        rectangle(4, 4, None),
        rectangle(9, 5, Some(1.5)),
        rectangle(8, 7, Some(2.5)),
        Neighbourhood::Points { offsets, sigma: None },
    ];
    for shape in shapes {
        let stencil = JetStencil::new(&shape, (dx, dy)).unwrap();
        for (got, want) in stencil.at(&frame, 8, 7).into_iter().zip(jet) {
            assert!((got - want).abs() < 1e-10, "{shape:?}: {got} {want}");
        }
        assert!(stencil.noise_variance(&frame, 8, 7).unwrap() < 1e-20);
    }
}

#[test]
fn odd_sides_are_centred_and_even_ones_reach_one_further_right() {
    let offsets = |width| Neighbourhood::Rectangle { width, height: 3, sigma: None }.offsets();
    let row = |width: usize| offsets(width)[..width].iter().map(|(x, _)| *x).collect::<Vec<_>>();
    assert_eq!((row(5), row(4)), (vec![-2, -1, 0, 1, 2], vec![-1, 0, 1, 2]));
    assert_eq!(Neighbourhood::default().offsets().len(), 9);
}

#[test]
fn unusable_neighbourhoods_are_refused_by_name() {
    let rectangle = |width, height, sigma| Neighbourhood::Rectangle { width, height, sigma };
    for bad in [
        rectangle(2, 3, None),
        rectangle(3, 100_000, None),
        rectangle(3, 3, Some(0.0)),
        rectangle(3, 3, Some(f64::NAN)),
        Neighbourhood::Points { offsets: vec![(0, 0), (1, 0), (0, 0)], sigma: None },
        Neighbourhood::Points { offsets: vec![(i32::MIN, 0)], sigma: None },
    ] {
        let message = JetStencil::new(&bad, (1.0, 1.0)).unwrap_err().to_string();
        assert!(message.starts_with("neighbourhood"), "{bad:?}: {message}");
    }
}
