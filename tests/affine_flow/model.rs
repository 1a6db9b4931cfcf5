//! Motion models: by name, and tests that every one of the registry passes, as does the example in
//! CONTRIBUTING.md.

mod axial;

use axial::Axial;
use jacoflow::Error;
use jacoflow::flow::model::{Axis, ModelKind, ModelVisitor, MotionModel, Parameter, Per};
use jacoflow::jet::JetRates;
use jacoflow::math::random::CounterRng;
use jacoflow::types::Units;
use nalgebra::{DMatrix, DVector};

#[test]
fn names_round_trip_and_neither_assumption_is_refused_with_its_reason() {
    for &model in ModelKind::ALL {
        assert_eq!(ModelKind::parse(model.name()).unwrap(), model);
        assert_eq!((model.parameters()[0].name, model.parameters()[1].name), ("u", "v"));
    }
    let refused = ModelKind::parse("affine_accelerating").unwrap_err();
    assert!(matches!(refused, Error::NotObservable(_)) && refused.to_string().contains("0071"));
    let unknown = ModelKind::parse("rigid").unwrap_err().to_string();
    assert!(unknown.starts_with("model") && unknown.contains("accelerating") && unknown.contains("rigid"));
}

#[test]
fn parameters_scale_with_the_pixel_pitch_and_the_period() {
    let scales = |model: ModelKind, period| -> Vec<f64> {
        let units = Units::new((2.0, 0.5), None, period);
        model.parameters().iter().map(|parameter| units.scale(parameter.name)).collect()
    };
    assert_eq!(scales(ModelKind::Affine, None), [2.0, 0.5, 1.0, 0.25, 4.0, 1.0]);
    assert_eq!(scales(ModelKind::Affine, Some(0.5)), [4.0, 1.0, 2.0, 0.5, 8.0, 2.0]);
    assert_eq!(scales(ModelKind::Accelerating, Some(0.5)), [4.0, 1.0, 8.0, 2.0]);
}

#[test]
fn the_example_of_the_guide_is_the_model_tested_here() {
    let guide = include_str!("../../CONTRIBUTING.md");
    assert!(guide.contains(include_str!("model/axial.rs")));
}

/// One of the tests below, for a model that is chosen at run time.
struct Conformance(&'static str);

impl ModelVisitor for Conformance {
    type Output = ();

    fn run<M: MotionModel<N, P>, const N: usize, const P: usize>(self) {
        match self.0 {
            "parameters" => parameters::<M, N, P>(),
            "recovery" => recovery::<M, N, P>(),
            "linearity" => linearity::<M, N, P>(),
            _ => flat::<M, N, P>(),
        }
    }
}

fn for_every_model(test: &'static str) {
    for model in ModelKind::ALL {
        model.dispatch(Conformance(test));
    }
    Conformance(test).run::<Axial, 12, 4>();
}

#[test]
fn parameters_are_what_their_names_say() {
    for_every_model("parameters");
}

#[test]
fn truth_is_recovered_from_transported_brightness() {
    for_every_model("recovery");
}

#[test]
fn equations_are_linear_in_the_jets() {
    for_every_model("linearity");
}

#[test]
fn a_flat_patch_is_not_observable() {
    for_every_model("flat");
}

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
fn parameters<M: MotionModel<N, P>, const N: usize, const P: usize>() {
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
fn recovery<M: MotionModel<N, P>, const N: usize, const P: usize>() {
    for seed in 0..20 {
        let (m, i) = (motion::<P>(seed), jet(seed));
        let (a, b) = M::equations(&rates::<M, N, P>(&m, &i));
        // Columns of unit length: parameters have different units.
        let columns = DMatrix::from_fn(N, P, |r, k| a[r][k]);
        let lengths: Vec<f64> = columns.column_iter().map(|column| column.norm()).collect();
        let scaled = DMatrix::from_fn(N, P, |r, k| a[r][k] / lengths[k]);
        let right = DVector::from_column_slice(&b);
        let decomposition = scaled.clone().svd(true, true);
        let singular = &decomposition.singular_values;
        let condition = singular.max() / singular.min();
        assert!(condition < 1e6, "seed {seed}: {condition}");
        let got = decomposition.solve(&right, 0.0).unwrap();
        for k in 0..P {
            let got = got[k] / lengths[k];
            assert!((got - m[k]).abs() < 1e-4 * condition, "seed {seed}, {k}: {got} {}", m[k]);
        }
        let left = (scaled * got - &right).norm_squared();
        assert!(left < 1e-9 * right.norm_squared(), "seed {seed}: {left} of {}", right.norm_squared());
    }
}

/// Doubling or summing jets doubles or sums the equations: the propagation of noise relies on it.
fn linearity<M: MotionModel<N, P>, const N: usize, const P: usize>() {
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
fn flat<M: MotionModel<N, P>, const N: usize, const P: usize>() {
    let still = JetRates { jet: [128.0, 0.0, 0.0, 0.0, 0.0, 0.0], first: [0.0; 6], second: [0.0; 6] };
    let (a, b) = M::equations(&still);
    assert!(a.as_flattened().iter().chain(&b).all(|&entry| entry == 0.0));
}
