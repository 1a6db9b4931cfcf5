use super::*;

#[test]
fn noise_fills_the_blocks_of_flow_and_slopes() {
    let left = noise::Left { density: [2.0, -0.5, 1.0], flow: 0.1, slopes: [0.01, 0.03] };
    let mut place = [0.0; ENTRIES];
    add_noise(&mut place, &left, [FLOW_NOISE[0], SLOPE_NOISE]);
    assert!((place[upper(0, 1)] + FLOW_NOISE[0] * 0.05).abs() < 1e-15);
    assert!((place[upper(2, 2)] - SLOPE_NOISE * 0.02).abs() < 1e-15);
    assert!((place[upper(5, 5)] - SLOPE_NOISE * 0.03).abs() < 1e-15);
    assert_eq!(place[upper(2, 4)], 0.0);
}
