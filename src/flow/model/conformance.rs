//! Tests that every motion model passes; instantiated by the registry.
#![cfg(test)]

use super::{Axis, MotionModel, Per};
use crate::flow::least_squares::solve;
use crate::jet::JetRates;
use crate::math::random::CounterRng;

fn motion<const P: usize>(seed: u64) -> [f64; P] {
    let rng = CounterRng::new(seed);
    std::array::from_fn(|k| rng.normal(k as u64) * if k < 2 { 0.5 } else { 0.1 })
}

fn jet(seed: u64) -> [f64; 6] {
    let rng = CounterRng::new(seed).stream(1);
    std::array::from_fn(|k| rng.normal(k as u64) * [100.0, 8.0, 8.0, 3.0, 3.0, 3.0][k])
}

/// Where the brightness now at offset `x` px was `t` frames ago: the flow followed back by Runge-Kutta steps.
fn origin<M: MotionModel<N, P>, const N: usize, const P: usize>(m: &[f64; P], x: (f64, f64), t: f64) -> (f64, f64) {
    let steps = 4;
    let h = -t / f64::from(steps);
    let f = |p: (f64, f64), t: f64| M::velocity(m, p.0, p.1, t);
    let (mut p, mut now) = (x, t);
    for _ in 0..steps {
        let k1 = f(p, now);
        let k2 = f((p.0 + 0.5 * h * k1.0, p.1 + 0.5 * h * k1.1), now + 0.5 * h);
        let k3 = f((p.0 + 0.5 * h * k2.0, p.1 + 0.5 * h * k2.1), now + 0.5 * h);
        let k4 = f((p.0 + h * k3.0, p.1 + h * k3.1), now + h);
        p.0 += h / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
        p.1 += h / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
        now += h;
    }
    p
}

/// The jet at the pixel `t` frames from now, of a quadratic carried along by the model's flow.
fn carried<M: MotionModel<N, P>, const N: usize, const P: usize>(m: &[f64; P], i: &[f64; 6], t: f64) -> [f64; 6] {
    let value = |x: f64, y: f64| {
        let (a, b) = origin::<M, N, P>(m, (x, y), t);
        i[0] + i[1] * a + i[2] * b + 0.5 * i[3] * a * a + i[4] * a * b + 0.5 * i[5] * b * b
    };
    let z = |x: i32, y: i32| value(f64::from(x), f64::from(y));
    let (centre, right, left, down, up) = (z(0, 0), z(1, 0), z(-1, 0), z(0, 1), z(0, -1));
    let cross = (z(1, 1) + z(-1, -1) - z(1, -1) - z(-1, 1)) / 4.0;
    let halves = ((right - left) / 2.0, (down - up) / 2.0);
    [centre, halves.0, halves.1, right - 2.0 * centre + left, cross, down - 2.0 * centre + up]
}

/// A jet with its time derivatives, by central differences over a short time.
fn rates<M: MotionModel<N, P>, const N: usize, const P: usize>(m: &[f64; P], i: &[f64; 6]) -> JetRates<f64> {
    let h = 1e-3;
    let (late, early) = (carried::<M, N, P>(m, i, h), carried::<M, N, P>(m, i, -h));
    let now = carried::<M, N, P>(m, i, 0.0);
    JetRates {
        jet: now,
        first: std::array::from_fn(|k| (late[k] - early[k]) / (2.0 * h)),
        second: std::array::from_fn(|k| (late[k] - 2.0 * now[k] + early[k]) / (h * h)),
    }
}

/// Each parameter is the derivative of the model's velocity that its description says.
pub fn parameters<M: MotionModel<N, P>, const N: usize, const P: usize>() {
    let m: [f64; P] = motion(2);
    let at = |d: [f64; 3]| M::velocity(&m, d[0], d[1], d[2]);
    let h = 1e-4;
    for (k, p) in M::PARAMETERS.iter().enumerate() {
        let component = |v: (f64, f64)| if p.of == Axis::X { v.0 } else { v.1 };
        let axis = match p.per {
            Per::Nothing => None,
            Per::X => Some(0),
            Per::Y => Some(1),
            Per::Frame => Some(2),
        };
        let got = axis.map_or_else(
            || component(at([0.0; 3])),
            |a| {
                let step = |s: f64| std::array::from_fn(|j| if j == a { s } else { 0.0 });
                (component(at(step(h))) - component(at(step(-h)))) / (2.0 * h)
            },
        );
        assert!((got - m[k]).abs() < 1e-9, "{}: {got} is not {}", p.name, m[k]);
    }
}

/// Brightness carried by the model's own flow satisfies its equations, which give the motion back.
pub fn recovery<M: MotionModel<N, P>, const N: usize, const P: usize>() {
    for seed in 0..20 {
        let (m, i) = (motion::<P>(seed), jet(seed));
        let (a, b) = M::equations(&rates::<M, N, P>(&m, &i));
        let got = solve(&a, &b, 0.0);
        assert_eq!(got.rank, P, "seed {seed}");
        for k in 0..P {
            assert!((got.x[k] - m[k]).abs() < 1e-4 * got.condition, "seed {seed}, {k}: {} {}", got.x[k], m[k]);
        }
        let size: f64 = b.iter().map(|v| v * v).sum();
        assert!(got.residual_square < 1e-9 * size, "seed {seed}: {} of {size}", got.residual_square);
    }
}

/// Doubling or summing jets doubles or sums the equations: the propagation of noise relies on it.
pub fn linearity<M: MotionModel<N, P>, const N: usize, const P: usize>() {
    let of = |s: u64| JetRates { jet: jet(s), first: jet(s + 10), second: jet(s + 20) };
    let (p, q) = (of(1), of(2));
    let sum = |a: [f64; 6], b: [f64; 6]| std::array::from_fn(|k| 2.0 * a[k] + b[k]);
    let both = JetRates { jet: sum(p.jet, q.jet), first: sum(p.first, q.first), second: sum(p.second, q.second) };
    let ((ap, bp), (aq, bq), (a, b)) = (M::equations(&p), M::equations(&q), M::equations(&both));
    for r in 0..N {
        assert!((b[r] - 2.0 * bp[r] - bq[r]).abs() < 1e-9);
        for k in 0..P {
            assert!((a[r][k] - 2.0 * ap[r][k] - aq[r][k]).abs() < 1e-9);
        }
    }
}

/// A patch without any brightness derivative determines nothing.
pub fn flat<M: MotionModel<N, P>, const N: usize, const P: usize>() {
    let still = JetRates { jet: [128.0, 0.0, 0.0, 0.0, 0.0, 0.0], first: [0.0; 6], second: [0.0; 6] };
    let (a, b) = M::equations(&still);
    let got = solve(&a, &b, 128.0 * f64::EPSILON);
    assert!(got.rank == 0 && got.x == [0.0; P]);
}
