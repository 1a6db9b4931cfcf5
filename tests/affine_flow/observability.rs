//! Which condition of WO2010/098160's theorem 1 makes a pixel observable.

use jacoflow::flow::{Condition, Observability, classify, observability};
use jacoflow::jet::{Neighbourhood, TimeScheme};
use jacoflow::parallel::Threads;
use jacoflow::types::Frame;

const G: [f64; 2] = [3.1, -1.7];

const H: [f64; 3] = [0.9, 0.35, -0.6];

const F: [f64; 2] = [0.7, -0.4];

const M: [f64; 4] = [0.11, -0.07, 0.05, 0.02];

const ALPHA: [f64; 4] = [0.13, 0.0, 0.0, 0.13];

const ROTATION: [f64; 4] = [0.0, 0.03, -0.03, 0.0];

/// n n^T for n = (0.8, -0.5).
const H1: [f64; 3] = [0.64, -0.4, 0.25];

fn case(g: [f64; 2], h: [f64; 3], f: [f64; 2], m: [f64; 4]) -> Observability {
    classify([100.0, g[0], g[1], h[0], h[1], h[2]], [f[0], f[1], m[0], m[1], m[2], m[3]])
}

#[test]
fn ranks_are_those_of_the_theorems_table() {
    let (z2, z3, z4) = ([0.0; 2], [0.0; 3], [0.0; 4]);
    let table = [
        ("generic", case(G, H, F, M), 5, 6),
        ("H regular, flow, M = 0", case(G, H, F, z4), 5, 6),
        ("H regular, no flow, M generic", case(G, H, z2, M), 5, 6),
        ("H regular, no flow, M generic, g = 0", case(z2, H, z2, M), 5, 6),
        ("H regular, no flow, M = alpha Id, g", case(G, H, z2, ALPHA), 5, 6),
        ("H regular, no flow, M = alpha Id, g = 0", case(z2, H, z2, ALPHA), 5, 5),
        ("H regular, no motion", case(G, H, z2, z4), 5, 5),
        ("H regular, no motion, g = 0", case(z2, H, z2, z4), 5, 5),
        ("H = 0, rotation", case(G, z3, F, ROTATION), 3, 6),
        ("H = 0, M generic", case(G, z3, F, M), 3, 6),
        ("H = 0, M = alpha Id", case(G, z3, F, ALPHA), 3, 3),
        ("H = 0, M = 0", case(G, z3, F, z4), 3, 3),
        ("H of rank 1, generic", case(G, H1, F, M), 5, 6),
        ("H of rank 1, g = 0, M = 0", case(z2, H1, F, z4), 3, 3),
    ];
    for (name, got, single, both) in table {
        assert_eq!((got.rank_single, got.rank), (single, both), "{name}");
    }
}

#[test]
fn full_rank_and_the_theorems_conditions_go_together() {
    use Condition::{Both, Neither, RegularHessian, TurningGradient};
    let (z2, z3, z4) = ([0.0; 2], [0.0; 3], [0.0; 4]);
    assert_eq!(case(G, H, F, M).condition, Both);
    assert_eq!(case(z2, H, F, M).condition, RegularHessian);
    assert_eq!(case(G, H, z2, ALPHA).condition, RegularHessian);
    assert_eq!(case(G, z3, z2, ROTATION).condition, TurningGradient);
    assert_eq!(case(G, H1, F, M).condition, TurningGradient);
    assert_eq!(case(G, z3, F, ALPHA).condition, Neither);
    assert_eq!(case(G, H, z2, z4).condition, Neither);
}

#[test]
fn intensity_gain_changes_nothing() {
    for gain in [1e-6, 1.0 / 255.0, 257.0] {
        let scaled = case(G.map(|v| v * gain), H.map(|v| v * gain), F, M);
        let (want, c) = (case(G, H, F, M), scaled.condition_number);
        assert_eq!((scaled.rank, scaled.condition), (want.rank, want.condition));
        assert!((c / want.condition_number - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_map_says_what_holds_where() {
    // A ramp turning about the origin on the left, nothing on the right.
    let frames: Vec<Frame<f32>> = (0..3)
        .map(|t| {
            let a = f64::from(t) * 0.03;
            Frame::from_fn(24, 12, |x, y| {
                if x < 12 { (100.0 + 2.0 * (x as f64 * a.cos() + y as f64 * a.sin())) as f32 } else { 0.7 }
            })
        })
        .collect();
    let three = [&frames[0], &frames[1], &frames[2]];
    let map = observability(three, TimeScheme::Central, &Neighbourhood::default(), Threads::default()).unwrap();
    let at = |x: usize, y: usize| map.pixels[y * map.width + x];
    assert!(at(0, 5).is_none());
    assert_eq!(at(5, 5).unwrap().condition, Condition::TurningGradient);
    assert_eq!((at(18, 5).unwrap().rank, at(18, 5).unwrap().condition), (0, Condition::Neither));
    let small = Frame::filled(2, 9, 0.0);
    let refused = observability([&small; 3], TimeScheme::Central, &Neighbourhood::default(), Threads::default());
    assert!(refused.unwrap_err().to_string().starts_with("frames"));
}
