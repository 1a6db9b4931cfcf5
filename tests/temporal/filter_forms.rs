//! How the forms of the flow filter differ, on the patent's ramp. `cargo test --test systems filter_forms --
//! --nocapture` prints the figures.

use jacoflow::image::{GaussianSmoother, Quantiser};
use jacoflow::synth::{RotatingRamp, Scene};
use jacoflow::temporal::{FilterForm, FlowFilter, FlowFilterOptions, SquareRoot, Transition};
use jacoflow::types::{Frame, SamplingGrid};
use std::f64::consts::PI;

type State = ([f64; 12], [[f64; 12]; 12]);

/// The ramp around (60, 80), which is pixel (32, 32), quantised; smoothed where asked. 400 frames.
fn frames(smooth: bool) -> Vec<Frame<f64>> {
    let scene = RotatingRamp::reference(65, 65).with_origin((28.0, 48.0));
    let (quantiser, smoother) = (Quantiser::default(), GaussianSmoother::new(3.0).unwrap());
    (0..400)
        .map(|t| {
            let frame = quantiser.apply(&scene.frame(f64::from(t)));
            if smooth { smoother.apply(&frame) } else { frame }
        })
        .collect()
}

/// The states after every frame.
fn run(frames: &[Frame<f64>], options: FlowFilterOptions) -> Vec<State> {
    let options = FlowFilterOptions { sites: SamplingGrid::Points(vec![(32, 32)]), ..options };
    let mut filter = FlowFilter::<f64>::new((65, 65), options).unwrap();
    let step = |frame| {
        filter.push(frame).unwrap();
        filter.state(0).unwrap()
    };
    let states = frames.iter().map(step).collect();
    assert_eq!(filter.repairs(), 0);
    states
}

/// Largest difference of the means and of the covariances, in the first one's standard deviations.
fn difference((x, p): &State, (y, q): &State) -> f64 {
    let deviation = |k: usize| p[k][k].sqrt();
    let mean = |a: usize| (x[a] - y[a]).abs() / deviation(a);
    let covariance = |a: usize, b: usize| (p[a][b] - q[a][b]).abs() / (deviation(a) * deviation(b));
    let pairs = (0..12).flat_map(|a| (0..12).map(move |b| (a, b)));
    pairs.fold(0.0, |worst, (a, b)| worst.max(mean(a)).max(covariance(a, b)))
}

fn largest(a: &[State], b: &[State]) -> f64 {
    a.iter().zip(b).map(|(a, b)| difference(a, b)).fold(0.0, f64::max)
}

/// Root mean square errors of u and v over frames 200 to 399.
fn errors(states: &[State]) -> [f64; 2] {
    let truth = [-0.8 * PI, 0.6 * PI];
    std::array::from_fn(|k| {
        (states[200..].iter().map(|(x, _)| (x[6 + k] - truth[k]).powi(2)).sum::<f64>() / 200.0).sqrt()
    })
}

const MOTION: Option<SquareRoot> = Some(SquareRoot::MotionFirst);

fn form(form: FilterForm, square_root: Option<SquareRoot>, profile: &FlowFilterOptions) -> FlowFilterOptions {
    FlowFilterOptions { form, square_root, ..profile.clone() }
}

#[test]
fn thirteen_points_are_the_twenty_five_with_the_motion_first() {
    for (name, profile, smooth) in
        [("patent", FlowFilterOptions::patent(), true), ("measured", FlowFilterOptions::measured(), false)]
    {
        let frames = frames(smooth);
        for transition in Transition::ALL {
            let profile = FlowFilterOptions { transition, ..profile.clone() };
            let fast = run(&frames, form(FilterForm::Fast, None, &profile));
            let same = run(&frames, form(FilterForm::NonAugmented, MOTION, &profile));
            let worst = largest(&same, &fast);
            println!("{name} {}: fast and 25 points, motion first: {worst:.1e} standard deviations", transition.name());
            assert!(worst < 3e-8, "{name} {transition:?} {worst}");
        }
    }
}

/// What the order of the square root does: rms errors of (u, v), and the largest distance from 25 points with
/// the brightness first, over all frames and over the last 200.
fn compare(name: &str, profile: &FlowFilterOptions, smooth: bool) -> Vec<([f64; 2], [f64; 2])> {
    let frames = frames(smooth);
    let reference = run(&frames, form(FilterForm::NonAugmented, None, profile));
    [
        (FilterForm::NonAugmented, None),
        (FilterForm::NonAugmented, MOTION),
        (FilterForm::Fast, None),
        (FilterForm::Augmented, None),
        (FilterForm::Augmented, MOTION),
    ]
    .into_iter()
    .map(|(which, order)| {
        let states = run(&frames, form(which, order, profile));
        let ([u, v], away) = (errors(&states), largest(&reference, &states));
        let late = largest(&reference[200..], &states[200..]);
        let order = order.map_or("", SquareRoot::name);
        println!("{name} {:<14}{order:<13}rms u {u:.4} v {v:.4}, {away:.1e} standard deviations away, {late:.1e} when settled", which.name());
        ([u, v], [away, late])
    })
    .collect()
}

#[test]
fn with_the_measured_constants_the_order_hardly_matters() {
    let all = compare("measured", &FlowFilterOptions::measured(), false);
    for (errors, _) in &all[1..3] {
        assert!((0..2).all(|k| (errors[k] / all[0].0[k] - 1.0).abs() < 0.003), "{all:?}");
    }
    // While the filter settles the orders are further apart.
    assert!(all[2].1[0] < 2.5 && all[2].1[1] < 0.15, "{all:?}");
}

#[test]
fn with_the_patents_constants_it_does() {
    let all = compare("patent", &FlowFilterOptions::patent(), true);
    let u: Vec<f64> = all.iter().map(|(errors, _)| errors[0]).collect();
    assert!((u[0] - 0.063).abs() < 0.002 && (u[2] - 0.300).abs() < 0.01, "{all:?}");
    assert!((u[1] - u[2]).abs() < 1e-6, "{all:?}");
}

#[test]
fn a_form_that_cannot_take_the_brightness_first_says_so() {
    let options = form(FilterForm::Fast, Some(SquareRoot::BrightnessFirst), &FlowFilterOptions::patent());
    let error = FlowFilter::<f64>::new((8, 8), options).unwrap_err().to_string();
    assert!(error.starts_with("square_root") && error.contains("non_augmented"), "{error}");
    assert!(SquareRoot::parse("upside_down").is_err());
    let options = form(FilterForm::NonAugmented, MOTION, &FlowFilterOptions::patent());
    let filter = FlowFilter::<f64>::new((8, 8), options).unwrap();
    let again = FlowFilter::<f64>::from_bytes(&filter.to_bytes().unwrap()).unwrap();
    assert_eq!(again.options(), filter.options(), "the order is saved");
}
