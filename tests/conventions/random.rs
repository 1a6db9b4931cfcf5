//! Seeded, counter-based random numbers: a value depends on the seed and the index alone.

use jacoflow::math::random::CounterRng;

#[test]
fn normal_numbers_have_the_right_moments() {
    let rng = CounterRng::new(7).stream(3);
    let n = 200_000u64;
    let (mut s1, mut s2, mut s4) = (0.0, 0.0, 0.0);
    for i in 0..n {
        let x = rng.normal(i);
        s1 += x;
        s2 += x * x;
        s4 += x * x * x * x;
    }
    let n = n as f64;
    assert!((s1 / n).abs() < 0.01 && (s2 / n - 1.0).abs() < 0.02 && (s4 / n - 3.0).abs() < 0.1);
}

#[test]
fn streams_and_seeds_differ() {
    let a = CounterRng::new(1);
    assert_ne!(a.bits(0), CounterRng::new(2).bits(0));
    assert_ne!(a.stream(0).bits(0), a.stream(1).bits(0));
    assert_eq!(a.bits(5), CounterRng::new(1).bits(5));
}

fn sorted(count: usize) -> Vec<f64> {
    let mut numbers = vec![0.0; count];
    CounterRng::new(11).stream(2).fill_normal(5, &mut numbers);
    numbers.sort_by(f64::total_cmp);
    numbers
}

#[test]
fn numbers_have_the_normal_distribution() {
    let numbers = sorted(1_000_000);
    let n = numbers.len() as f64;
    let cdf = |x: f64| 0.5 * libm::erfc(-x / std::f64::consts::SQRT_2);
    let distance = numbers.iter().enumerate().map(|(i, &x)| ((i as f64 + 0.5) / n - cdf(x)).abs()).fold(0.0, f64::max);
    // Kolmogorov and Smirnov: 1.63 at the level of 1 %.
    assert!(distance * n.sqrt() < 1.63, "{}", distance * n.sqrt());
    for edge in [3.654_152_885_361_009, 2.5, 4.0] {
        let expected = 2.0 * n * cdf(-edge);
        let beyond = numbers.iter().filter(|x| x.abs() > edge).count() as f64;
        assert!((beyond - expected).abs() < 4.0 * expected.sqrt() + 1.0, "{beyond} of {expected} beyond {edge}");
    }
}

#[test]
fn a_number_depends_on_its_index_alone_and_neighbours_are_uncorrelated() {
    let rng = CounterRng::new(3);
    let mut all = vec![0.0; 100_001];
    rng.fill_normal(0, &mut all);
    for at in [0, 1, 77, 99_000] {
        let mut few = [0.0; 3];
        rng.fill_normal(at as u64, &mut few);
        assert_eq!(few, all[at..at + 3]);
    }
    let product: f64 = all.windows(2).map(|pair| pair[0] * pair[1]).sum();
    assert!((product / 100_000.0).abs() < 0.013);
}
