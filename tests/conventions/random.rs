//! Seeded, counter-based random numbers: the value at an index depends on the seed and the index alone,

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
