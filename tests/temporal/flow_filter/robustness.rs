//! The filter on frames that its model does not describe: textures that are not locally quadratic, and single
//! frames that are black, flashed, dropped or repeated.

use super::*;
use jacoflow::synth::{SceneOptions, Sensor, build};

const SIZE: usize = 56;
const SPOILT: usize = 40;

/// Errors of the six unknowns in standard deviations, and the status.
type SiteScore = ([f64; 6], Status);

/// What happens at frame [`SPOILT`].
#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    Nothing,
    Black,
    Bright,
    Flash,
    Dropped,
    Repeated,
}

/// A texture moved by `(u, v)` at its centre with a slow rotation, as an 8-bit camera with noise sees it.
struct Sequence {
    scene: Box<dyn Scene>,
    camera: Sensor,
    event: Event,
}

impl Sequence {
    fn new(carrier: &str, (u, v): (f64, f64), seed: u64, event: Event) -> Self {
        let values = [("u", u), ("v", v), ("u_x", 0.002), ("v_x", 0.004), ("u_y", -0.004), ("v_y", 0.002)];
        let options = SceneOptions {
            width: SIZE,
            height: SIZE,
            random_state: seed,
            carrier: Some(carrier.into()),
            values: values.iter().map(|&(name, value)| (name.to_string(), value)).collect(),
            ..SceneOptions::default()
        };
        Self { scene: build("affine", &options).unwrap(), camera: Sensor::eight_bit(1.0, seed), event }
    }

    fn frame(&self, t: usize) -> Frame<f64> {
        let shown = match self.event {
            Event::Dropped if t >= SPOILT => t + 1,
            Event::Repeated if t >= SPOILT => t - 1,
            _ => t,
        };
        let frame = self.camera.apply(&self.scene.frame(shown as f64), t as u64);
        match self.event {
            Event::Black if t == SPOILT => frame.map(|_| 0.0),
            Event::Bright if t == SPOILT => frame.map(|_| 255.0),
            Event::Flash if t == SPOILT => frame.map(|&v| (v + 60.0).min(255.0)),
            _ => frame,
        }
    }

    /// Errors of the six unknowns in standard deviations and the status, by site, after `frames` frames.
    fn scores(&self, profile: &str, frames: usize) -> Vec<(usize, Vec<SiteScore>)> {
        let region = Rect { x: 12, y: 12, width: SIZE - 24, height: SIZE - 24 };
        let sites = SamplingGrid::Grid { region: Some(region), stride: 4 };
        let base = FlowFilterOptions::profile(profile).unwrap();
        let options = FlowFilterOptions { sites: sites.clone(), covariance: true, ..base };
        let mut filter = FlowFilter::<f64>::new((SIZE, SIZE), options).unwrap();
        (0..frames)
            .map(|t| {
                let field = filter.push(&self.frame(t)).unwrap();
                let score = |site: usize| {
                    let (x, y) = sites.pixel(site % field.width, site / field.width);
                    let truth = self.scene.motion(x as f64, y as f64, t as f64).unwrap().to_array();
                    let covariance = field.covariance_at(site).unwrap();
                    let found = field.affine(site).to_array();
                    let error = |k: usize| (found[k] - truth[k]).abs() / covariance[k][k].sqrt();
                    (std::array::from_fn(error), field.status[site])
                };
                (t, (0..field.len()).map(score).collect())
            })
            .collect()
    }
}

/// Mean of `value` over sites.
fn share(sites: &[SiteScore], value: impl Fn(&SiteScore) -> bool) -> f64 {
    sites.iter().filter(|site| value(site)).count() as f64 / sites.len() as f64
}

#[test]
fn intervals_hold_on_textures_that_are_not_locally_quadratic() {
    for profile in ["measured", "patent"] {
        for carrier in ["noise", "speckle", "particles"] {
            let mut late = Vec::new();
            for (seed, motion) in [(101, (0.4, -0.2)), (102, (0.7, 0.6)), (103, (-1.1, 0.5))] {
                let scores = Sequence::new(carrier, motion, seed, Event::Nothing).scores(profile, 121);
                late.extend(scores.into_iter().filter(|(t, _)| *t >= 60 && t % 20 == 0).flat_map(|(_, sites)| sites));
            }
            let held: [f64; 6] = std::array::from_fn(|k| share(&late, |(error, _)| error[k] < 1.96));
            let jacobian = held[2..].iter().sum::<f64>() / 4.0;
            println!("{profile} {carrier}: {held:.2?}, Jacobian {jacobian:.2}");
            for value in [held[0], held[1], jacobian] {
                assert!((0.85..=0.995).contains(&value), "{profile} {carrier}: {held:?}");
            }
        }
    }
}

#[test]
fn one_spoilt_frame_is_reported_and_forgotten_within_ten() {
    for profile in ["measured", "patent"] {
        for event in [Event::Black, Event::Bright, Event::Flash, Event::Dropped, Event::Repeated] {
            for (seed, carrier) in [(111, "noise"), (112, "speckle"), (113, "particles")] {
                let scores = Sequence::new(carrier, (0.5, -0.4), seed, event).scores(profile, SPOILT + 14);
                let is_lost = |(error, _): &SiteScore| error[..2].iter().any(|&e| e >= 3.0);
                let usual = share(&scores[SPOILT - 1].1, is_lost) + 0.05;
                for (t, sites) in &scores[SPOILT..] {
                    let silent = share(sites, |site| site.1 == Status::Ok && is_lost(site));
                    let lost = share(sites, is_lost);
                    println!("{profile} {event:?} {carrier} {t}: silent {silent:.3} lost {lost:.3}");
                    assert!(*t < SPOILT + 10 || lost <= usual, "{profile} {event:?} {carrier} frame {t}: {lost}");
                    // With the patent's process noise a dropped frame is a motion that changes for one frame.
                    let at_once = profile == "measured" || matches!(event, Event::Black | Event::Bright | Event::Flash);
                    let reported = SPOILT + usize::from(!at_once);
                    assert!(*t < reported || silent <= usual + 0.1, "{profile} {event:?} {carrier} {t}: {silent}");
                }
            }
        }
    }
}

#[test]
fn the_ramp_survives_one_spoilt_frame() {
    let clean = reference_frames(140, false);
    for (name, spoil) in [
        ("black", (|frames: &mut Vec<Frame<f64>>| frames[100] = frames[100].map(|_| 0.0)) as fn(&mut Vec<_>)),
        ("flash", |frames| frames[100] = frames[100].map(|v| (v + 60.0).min(255.0))),
        ("dropped", |frames| drop(frames.remove(100))),
        ("repeated", |frames| frames.insert(100, frames[99].clone())),
    ] {
        let mut frames = clean.clone();
        spoil(&mut frames);
        let options = FlowFilterOptions { covariance: true, ..at_centre(FlowFilterOptions::measured()) };
        let mut filter = FlowFilter::<f64>::new((65, 65), options).unwrap();
        for (t, frame) in frames.iter().enumerate() {
            let field = filter.push(frame).unwrap();
            let (found, covariance) = (field.affine(0).to_array(), field.covariance_at(0).unwrap());
            let error = |k: usize| (found[k] - TRUTH[k]).abs() / covariance[k][k].sqrt();
            let is_near = (0..2).all(|k| error(k) < 3.0);
            if (99..103).contains(&t) {
                println!("{name} {t}: u {} v {}, {:?}", error(0), error(1), field.status[0]);
            }
            assert!(t < 80 || is_near || field.status[0] != Status::Ok, "{name} frame {t}: silent");
            assert!(t < 110 || is_near, "{name} frame {t}: {} {}", error(0), error(1));
        }
    }
}

#[test]
fn a_motion_that_changes_at_once_is_found_again() {
    // The texture moves on with another motion after frame 40: every prediction of it fails at first.
    let moved = |t: usize, x: usize, y: usize| {
        let late = t.saturating_sub(40) as f64;
        let (x, y) = (x as f64 - 0.3 * t as f64 + 1.0 * late, y as f64 + 0.2 * t as f64 - 0.8 * late);
        128.0 + 20.0 * (x * 0.31 + y * 0.15).sin() + 15.0 * (y * 0.23 - x * 0.13).cos()
    };
    let options = FlowFilterOptions {
        sites: SamplingGrid::Points(vec![(20, 20), (30, 25)]),
        covariance: true,
        ..FlowFilterOptions::measured()
    };
    let mut filter = FlowFilter::<f64>::new((48, 48), options).unwrap();
    for t in 0..90 {
        let field = filter.push(&Frame::from_fn(48, 48, |x, y| moved(t, x, y))).unwrap();
        for site in 0..2 {
            let (found, covariance) = (field.affine(site).to_array(), field.covariance_at(site).unwrap());
            let truth = if t <= 40 { [0.3, -0.2] } else { [-0.7, 0.6] };
            let is_near = (0..2).all(|k| (found[k] - truth[k]).abs() < 3.0 * covariance[k][k].sqrt() + 0.02);
            println!("{t} {site} {:.3?} sd {:.3} {:?}", &found[..2], covariance[0][0].sqrt(), field.status[site]);
            assert!(t < 20 || (41..55).contains(&t) || is_near, "frame {t} site {site}: {found:?}");
            assert!(t < 80 || (0..2).all(|k| (found[k] - truth[k]).abs() < 0.1), "frame {t} site {site}: {found:?}");
        }
    }
}
