//! Jets of every pixel.

use jacoflow::jet::{JetPlanes, JetStencil, Neighbourhood};
use jacoflow::math::random::CounterRng;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::types::Frame;

fn noise(width: usize, height: usize) -> Frame<f64> {
    let rng = CounterRng::new(5);
    Frame::from_fn(width, height, |x, y| 100.0 + 20.0 * rng.normal((y * width + x) as u64))
}

fn rectangle(width: usize, height: usize, sigma: Option<f64>) -> Neighbourhood {
    Neighbourhood::Rectangle { width, height, sigma }
}

fn shapes() -> Vec<Neighbourhood> {
    let cross = (-2..=2).flat_map(|k| [(k, 0), (0, k), (k, k)]).filter(|&p| p != (0, 0));
    vec![
        rectangle(3, 3, None),
        rectangle(5, 3, None),
        rectangle(4, 6, None),
        rectangle(7, 9, Some(1.7)),
        rectangle(6, 5, Some(2.0)),
        Neighbourhood::Points { offsets: cross.collect(), sigma: Some(1.2) },
    ]
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a.is_nan() && b.is_nan()) || (a - b).abs() <= tolerance
}

#[test]
fn planes_equal_the_jet_at_each_pixel_at_every_level() {
    let frame = noise(41, 37);
    let single = frame.map(|&v| v as f32);
    for shape in shapes() {
        let stencil = JetStencil::new(&shape, (2.0, 0.5)).unwrap();
        assert_eq!(stencil.is_separable(), matches!(shape, Neighbourhood::Rectangle { .. }));
        for level in Level::available() {
            let f64s = stencil.planes_with(&frame, Threads::default(), level);
            let f32s = stencil.planes_with(&single, Threads::default(), level);
            for (x, y) in [(0, 0), (4, 4), (20, 11), (33, 31), (36, 32), (40, 36), (3, 15), (39, 1)] {
                let want = stencil.at(&frame, x, y);
                for k in 0..6 {
                    assert!(close(f64s.get(x, y)[k], want[k], 1e-11), "{shape:?} {level:?} {x} {y} {k}");
                    assert!(close(f32s.get(x, y)[k].into(), want[k], 2e-3), "{shape:?} {level:?} {x} {y} {k}");
                }
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let frame = noise(33, 70);
    let stencil = JetStencil::new(&rectangle(5, 5, Some(1.0)), (1.0, 1.0)).unwrap();
    let run = |n| stencil.planes(&frame, Threads::new(Some(n)).unwrap());
    let bits = |p: &JetPlanes<f64>| p.planes.iter().flat_map(Frame::data).map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&run(1)), bits(&run(2)));
}

#[test]
fn small_and_empty_frames_have_no_jets() {
    let stencil = JetStencil::new(&Neighbourhood::default(), (1.0, 1.0)).unwrap();
    for (w, h) in [(0, 0), (2, 2), (2, 40), (40, 2)] {
        let planes = stencil.planes(&Frame::filled(w, h, 1.0f32), Threads::default());
        assert!(planes.planes[0].data().iter().all(|v| v.is_nan()));
    }
    let planes = stencil.planes(&Frame::filled(3, 3, 1.0f32), Threads::default());
    assert_eq!(planes.planes[0].data().iter().filter(|v| v.is_finite()).count(), 1);
}

#[test]
fn a_bad_sample_damages_only_what_touches_it() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut frame = noise(20, 20).map(|&v| v as f32);
        frame.row_mut(9)[10] = bad;
        let stencil = JetStencil::new(&rectangle(5, 3, None), (1.0, 1.0)).unwrap();
        let planes = stencil.planes(&frame, Threads::default());
        for y in 1..19usize {
            for x in 2..18usize {
                let touched = x.abs_diff(10) <= 2 && y.abs_diff(9) <= 1;
                assert_eq!(planes.get(x, y)[0].is_finite(), !touched, "{x} {y}");
                assert_eq!(stencil.at(&frame, x, y)[1].is_finite(), !touched);
            }
        }
    }
}
