//! The published cases, and a naive oracle.

use jacoflow::parallel::Threads;
use jacoflow::segment::{EdgeWeight, Labels, SegmentImage, SegmentOptions, felzenszwalb, region_means};
use jacoflow::types::{ColourFrame, Frame};
use proptest::prelude::*;

fn options(scale: f64, sigma: f64, min_size: usize) -> SegmentOptions {
    SegmentOptions { scale, sigma, min_size }
}

fn count<I: SegmentImage>(image: &I, scale: f64, sigma: f64, min_size: usize) -> usize
where
    I::Real: EdgeWeight,
{
    felzenszwalb(image, &options(scale, sigma, min_size)).unwrap().count
}

/// Sizes of the regions, largest first.
fn sizes(labels: &Labels) -> Vec<usize> {
    let mut sizes = vec![0; labels.count];
    for &label in &labels.labels {
        sizes[label as usize] += 1;
    }
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    sizes
}

#[test]
fn the_threshold_of_a_step_is_its_height_times_the_size_of_a_side() {
    let step = Frame::from_fn(6, 4, |x, _| if x < 3 { 0.0f32 } else { 100.0 });
    assert_eq!((count(&step, 1199.0, 0.0, 1), count(&step, 1200.0, 0.0, 1)), (2, 1));
}

#[test]
fn a_ramp_stays_apart_below_its_slope() {
    let ramp = Frame::from_fn(10, 1, |x, _| 10.0 * x as f32);
    assert_eq!((count(&ramp, 9.0, 0.0, 1), count(&ramp, 10.0, 0.0, 1)), (10, 1));
}

#[test]
fn small_regions_are_merged() {
    let dot = Frame::from_fn(5, 5, |x, y| if (x, y) == (2, 2) { 255.0f32 } else { 0.0 });
    assert_eq!((count(&dot, 1.0, 0.0, 1), count(&dot, 1.0, 0.0, 2)), (2, 1));
    assert_eq!(count(&dot, 0.0, 0.0, 26), 1);
}

fn tiles() -> ColourFrame<f32> {
    Frame::from_fn(32, 24, |x, y| {
        let red = (37 * (x / 4) + 61 * (y / 3)) % 256;
        let green = 55 * (x / 8) * (y / 6) % 256;
        [red as f32, green as f32, (90 + 3 * x) as f32]
    })
}

#[test]
fn tiles_give_the_published_regions() {
    let cases: [(f64, f64, usize, usize, &[usize]); 5] = [
        (50.0, 0.0, 1, 64, &[]),
        (300.0, 0.0, 1, 41, &[48, 48, 36, 36]),
        (300.0, 0.8, 1, 25, &[185, 157, 67, 47]),
        (300.0, 0.8, 20, 12, &[199, 161, 68, 62]),
        (1000.0, 0.8, 20, 4, &[359, 239, 132, 38]),
    ];
    let double = tiles().map(|pixel| pixel.map(f64::from));
    for (scale, sigma, min_size, count, largest) in cases {
        let options = options(scale, sigma, min_size);
        for found in [felzenszwalb(&tiles(), &options).unwrap(), felzenszwalb(&double, &options).unwrap()] {
            assert_eq!(found.count, count, "{options:?}");
            assert_eq!(sizes(&found)[..largest.len()], *largest, "{options:?}");
        }
    }
}

/// The definition, word by word: a list of edges, sorted by the standard library, and a label for every
/// pixel.
fn oracle(levels: &Frame<Vec<f64>>, scale: f64, min_size: usize) -> Vec<usize> {
    let (width, height) = levels.size();
    let mut edges = Vec::new();
    for (dx, dy) in [(1i32, 0i32), (0, 1), (1, 1), (1, -1)] {
        for y in 0..height as i32 {
            for x in 0..width as i32 {
                let (x2, y2) = (x + dx, y + dy);
                if x2 < width as i32 && (0..height as i32).contains(&y2) {
                    let (p, q) = (
                        levels.data()[(y as usize) * width + x as usize].clone(),
                        levels.data()[y2 as usize * width + x2 as usize].clone(),
                    );
                    let weight = p.iter().zip(&q).map(|(p, q)| (p - q).powi(2)).sum::<f64>().sqrt();
                    let weight = if weight.is_finite() { weight } else { f64::INFINITY };
                    edges.push((weight, y as usize * width + x as usize, y2 as usize * width + x2 as usize));
                }
            }
        }
    }
    edges.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut label: Vec<usize> = (0..width * height).collect();
    let mut internal = vec![0.0; width * height];
    let size = |label: &[usize], of: usize| label.iter().filter(|&&l| l == of).count();
    let unite = |label: &mut [usize], a: usize, b: usize| label.iter_mut().filter(|l| **l == b).for_each(|l| *l = a);
    for &(weight, p, q) in edges.iter().filter(|edge| edge.0 < f64::INFINITY) {
        let (a, b) = (label[p], label[q]);
        let limit = |of: usize| internal[of] + scale / size(&label, of) as f64;
        if a != b && weight <= limit(a).min(limit(b)) {
            unite(&mut label, a, b);
            internal[a] = weight;
        }
    }
    for &(_, p, q) in &edges {
        let (a, b) = (label[p], label[q]);
        if a != b && size(&label, a).min(size(&label, b)) < min_size {
            unite(&mut label, a, b);
        }
    }
    let mut seen = Vec::new();
    label
        .iter()
        .map(|l| {
            seen.iter().position(|s| s == l).unwrap_or_else(|| {
                seen.push(*l);
                seen.len() - 1
            })
        })
        .collect()
}

fn same(found: &Labels, expected: &[usize]) -> bool {
    found.labels.iter().map(|&l| l as usize).eq(expected.iter().copied())
}

proptest! {
    #[test]
    fn agrees_with_the_naive_definition(
        (width, height) in (1usize..40, 1usize..9),
        values in prop::collection::vec(prop_oneof![9 => 0u8..60, 1 => 60u8..255], 360),
        scale in prop_oneof![Just(0.0), 1.0..400.0],
        min_size in 0usize..30,
        holes in prop::collection::vec(0usize..360, 0..6),
    ) {
        // Levels that many pixels share: equal weights are frequent, and their order decides.
        let level = |i: usize| if holes.contains(&i) { f64::NAN } else { f64::from(values[i]) };
        let grey = Frame::from_fn(width, height, |x, y| level(y * width + x));
        let found = felzenszwalb(&grey, &options(scale, 0.0, min_size)).unwrap();
        prop_assert!(same(&found, &oracle(&grey.map(|v| vec![*v]), scale, min_size)));
        let colour = Frame::from_fn(width, height, |x, y| [level(y * width + x), f64::from(values[x]), f64::from(values[y])]);
        let found = felzenszwalb(&colour, &options(scale, 0.0, min_size)).unwrap();
        prop_assert!(same(&found, &oracle(&colour.map(|v| v.to_vec()), scale, min_size)));
    }

    #[test]
    fn regions_are_connected_numbered_and_large_enough(
        values in prop::collection::vec(any::<[u8; 3]>(), 24 * 17), min_size in 0usize..50,
    ) {
        let image = Frame::new(24, 17, values).unwrap().map(|v| v.map(f32::from));
        let found = felzenszwalb(&image, &options(60.0, 0.8, min_size)).unwrap();
        let mut next = 0;
        for &label in &found.labels {
            prop_assert!(label <= next);
            next = next.max(label + 1);
        }
        prop_assert_eq!(next as usize, found.count);
        prop_assert!(found.count == 1 || sizes(&found).iter().all(|&size| size >= min_size));
    }
}

#[test]
fn a_pixel_that_is_not_finite_stays_alone_until_regions_must_grow() {
    for bad in [f32::NAN, f32::INFINITY] {
        let image = Frame::from_fn(20, 20, |x, y| if (x, y) == (10, 10) { [7.0, bad, 7.0] } else { [7.0; 3] });
        let found = felzenszwalb(&image, &options(300.0, 0.8, 1)).unwrap();
        assert_eq!((found.count, found.labels[10 * 20 + 10]), (2, 1));
        assert_eq!(count(&image, 300.0, 0.8, 2), 1);
    }
    let nothing = Frame::filled(4, 3, f32::NAN);
    assert_eq!((count(&nothing, 1e300, 0.8, 1), count(&nothing, 1.0, 0.8, 13)), (12, 1));
}

#[test]
fn one_pixel_is_one_region_and_large_minima_leave_one() {
    assert_eq!(felzenszwalb(&Frame::filled(1, 1, 3.0f32), &SegmentOptions::default()).unwrap().labels, [0]);
    assert_eq!(count(&tiles(), 1.0, 0.8, 24 * 32 + 1), 1);
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let image = Frame::from_fn(301, 203, |x, y| ((x * x + 7 * y * y) % 251) as f32);
    let of = |n| Threads::new(Some(n)).unwrap().install(|| felzenszwalb(&image, &options(100.0, 0.8, 5)).unwrap());
    assert_eq!(of(1), of(3));
}

#[test]
fn mistakes_are_named() {
    let image = Frame::filled(3, 3, 0.0f32);
    let message =
        |image: &Frame<f32>, scale, sigma| felzenszwalb(image, &options(scale, sigma, 1)).unwrap_err().to_string();
    assert_eq!(message(&image, -1.0, 0.0), "scale: expected a finite number, at least 0, got -1");
    assert!(message(&image, f64::NAN, 0.0).starts_with("scale: "));
    assert_eq!(message(&image, 1.0, -0.5), "sigma: expected a finite number, at least 0, got -0.5");
    assert!(message(&image, 1.0, 1e6).starts_with("sigma: "));
    assert!(message(&Frame::filled(0, 3, 0.0), 1.0, 0.0).starts_with("image: "));
}

#[test]
fn means_skip_what_is_no_number() {
    let values = [1.0, 10.0, f64::NAN, 30.0, 5.0, f64::NAN];
    let means = region_means(&[0, 0, 1], 3, &values, 2).unwrap();
    assert_eq!(means[..3], [1.0, 20.0, 5.0]);
    assert!(means[3..].iter().all(|mean| mean.is_nan()));
    assert!(region_means(&[0, 3], 3, &[0.0, 0.0], 1).unwrap_err().to_string().starts_with("labels: "));
    assert!(region_means(&[0, 1], 3, &[0.0], 1).unwrap_err().to_string().starts_with("values: "));
    let beyond = region_means::<f64>(&[], usize::MAX / 16, &[], 1).unwrap_err().to_string();
    assert!(beyond.starts_with("labels: expected what fits into memory, got "), "{beyond}");
}
