//! What the dense filter promises: precision, threads, saving, holes, sites, units and clear errors.

use super::*;

#[test]
fn all_forms_find_the_turning_ramp_in_both_precisions() {
    let frames = reference_frames(200, false);
    for form in FilterForm::ALL {
        for transition in Transition::ALL {
            let options = at_centre(FlowFilterOptions { form, transition, ..FlowFilterOptions::measured() });
            let mut double = FlowFilter::<f64>::new((65, 65), options.clone()).unwrap();
            let mut single = FlowFilter::<f32>::new((65, 65), options).unwrap();
            for frame in &frames {
                double.push(frame).unwrap();
                single.push(&frame.map(|&v| v as f32)).unwrap();
            }
            for (mean, _) in [double.state(0).unwrap(), single.state(0).unwrap()] {
                for k in 0..6 {
                    let tolerance = if k < 2 { 0.15 } else { 0.01 };
                    assert!((mean[6 + k] - TRUTH[k]).abs() < tolerance, "{form:?} {transition:?} {k} {mean:?}");
                }
            }
            assert_eq!(double.repairs() + single.repairs(), 0, "{form:?} {transition:?}");
        }
    }
}

#[test]
fn patent_constants_in_single_precision_never_give_a_silent_nan() {
    let mut filter = FlowFilter::<f32>::new((65, 65), FlowFilterOptions::patent()).unwrap();
    for frame in reference_frames(120, true) {
        let field = filter.push(&frame.map(|&v| v as f32)).unwrap();
        for (site, status) in field.status.iter().enumerate() {
            assert_eq!(field.motion[site].is_nan(), *status == Status::Border);
            assert!(matches!(status, Status::Ok | Status::Repaired | Status::Border));
        }
    }
    // The centre still agrees with the truth, as in double precision.
    let (mean, _) = filter.state(32 * 65 + 32).unwrap();
    assert!((mean[6] - TRUTH[0]).abs() < 0.25 && (mean[7] - TRUTH[1]).abs() < 0.25, "{mean:?}");
}

#[test]
fn threads_and_resuming_change_no_bit() {
    let size = (50, 40);
    let options = |threads| FlowFilterOptions {
        covariance: true,
        threads: Threads::new(Some(threads)).unwrap(),
        ..FlowFilterOptions::patent()
    };
    let mut one = FlowFilter::<f64>::new(size, options(1)).unwrap();
    let mut two = FlowFilter::<f64>::new(size, options(2)).unwrap();
    for t in 0..6 {
        let frame = texture(size.0, size.1, t);
        let (a, b) = (one.push(&frame).unwrap(), two.push(&frame).unwrap());
        assert_eq!(bits(&a.motion), bits(&b.motion));
        assert_eq!(bits(a.covariance.as_ref().unwrap()), bits(b.covariance.as_ref().unwrap()));
        assert_eq!(bits(a.residual.as_ref().unwrap()), bits(b.residual.as_ref().unwrap()));
        assert_eq!(a.status, b.status);
        if t == 2 {
            let path = std::env::temp_dir().join(format!("jacoflow-filter-{}.npz", std::process::id()));
            two.save(&path).unwrap();
            two = FlowFilter::<f64>::load(&path).unwrap().with_computation(Threads::new(Some(2)).unwrap(), None);
            std::fs::remove_file(&path).unwrap();
            assert_eq!(two.frames(), 3);
            assert_eq!(
                two.to_bytes().unwrap(),
                FlowFilter::<f64>::from_bytes(&two.to_bytes().unwrap()).unwrap().to_bytes().unwrap()
            );
        }
    }
}

#[test]
fn options_survive_saving() {
    let mask = Mask::from_fn(20, 12, |x, y| (x, y) != (7, 6));
    let options = FlowFilterOptions {
        neighbourhood: Neighbourhood::Rectangle { width: 5, height: 3, sigma: Some(1.5) },
        sites: SamplingGrid::Grid { region: Some(Rect { x: 2, y: 1, width: 15, height: 9 }), stride: 2 },
        mask: Some(mask),
        form: FilterForm::Fast,
        adaptive: false,
        transition: Transition::Exact,
        simd: Some(Level::SCALAR),
        units: Units::new((0.5, 0.25), Some("mm"), Some(0.04)),
        ..FlowFilterOptions::measured()
    };
    let mut filter = FlowFilter::<f32>::new((20, 12), options).unwrap();
    filter.push(&texture(20, 12, 0).map(|&v| v as f32)).unwrap();
    let again = FlowFilter::<f32>::from_bytes(&filter.to_bytes().unwrap()).unwrap();
    assert_eq!(again.options(), filter.options());
    assert_eq!((again.frames(), again.frame_size(), again.state(3)), (1, (20, 12), filter.state(3)));
}

#[test]
fn broken_states_are_refused_with_words() {
    let mut filter = FlowFilter::<f64>::new((8, 8), FlowFilterOptions::patent()).unwrap();
    filter.push(&texture(8, 8, 0)).unwrap();
    let good = filter.to_bytes().unwrap();
    let message = |bytes: &[u8]| FlowFilter::<f64>::from_bytes(bytes).unwrap_err().to_string();
    assert!(message(b"PK nothing").contains("filter state"));
    assert!(message(&[]).contains("filter state"));
    for at in (0..good.len()).step_by(7) {
        let mut bytes = good.clone();
        bytes[at] ^= 0x20;
        if let Ok(filter) = FlowFilter::<f64>::from_bytes(&bytes) {
            assert_eq!(filter.to_bytes().unwrap(), good, "byte {at} is wrong and not noticed");
        }
    }
    for cut in [10, good.len() / 2, good.len() - 3] {
        assert!(FlowFilter::<f64>::from_bytes(&good[..cut]).is_err());
    }
    let error = FlowFilter::<f32>::from_bytes(&good).unwrap_err().to_string();
    assert!(error.contains("float32") && error.contains("float64"), "{error}");
}

#[test]
fn bad_pixels_damage_only_what_they_touch_and_only_for_a_while() {
    let options = FlowFilterOptions::patent();
    let mut clean = FlowFilter::<f64>::new((40, 30), options.clone()).unwrap();
    let mut spoilt = FlowFilter::<f64>::new((40, 30), options).unwrap();
    for t in 0..5 {
        let frame = texture(40, 30, t);
        let mut bad = frame.clone();
        if t == 2 {
            bad.row_mut(10)[12] = f64::NAN;
            bad.row_mut(20)[30] = f64::INFINITY;
        }
        let (a, b) = (clean.push(&frame).unwrap(), spoilt.push(&bad).unwrap());
        for y in 0..30usize {
            for x in 0..40usize {
                let near = |cx: usize, cy: usize| x.abs_diff(cx) <= 1 && y.abs_diff(cy) <= 1;
                let (site, touched) = (y * 40 + x, near(12, 10) || near(30, 20));
                if touched && t == 2 {
                    assert_eq!(b.status[site], Status::NonFinite);
                    assert!(b.motion[site].is_nan());
                    // It has predicted: its uncertainty grew.
                    let (p, q) = (spoilt.state(site).unwrap(), clean.state(site).unwrap());
                    assert!(p.1[6][6] > q.1[6][6] && p.0.iter().all(|v| v.is_finite()));
                } else if !(touched && t > 2) {
                    assert_eq!((a.status[site], a.motion[site].to_bits()), (b.status[site], b.motion[site].to_bits()));
                } else {
                    assert_eq!(b.status[site], Status::Ok);
                }
            }
        }
    }
}

#[test]
fn points_regions_and_masks_compute_the_same_pixels() {
    let size = (40, 30);
    let points = vec![(5, 5), (20, 11), (0, 0), (39, 29), (20, 11)];
    let with =
        |sites: SamplingGrid, mask: Option<Mask>| FlowFilterOptions { sites, mask, ..FlowFilterOptions::patent() };
    let mask = Mask::from_fn(size.0, size.1, |x, y| (x, y) != (10, 10));
    let grid = SamplingGrid::Grid { region: Some(Rect { x: 4, y: 3, width: 20, height: 18 }), stride: 3 };
    let mut dense = FlowFilter::<f64>::new(size, with(SamplingGrid::default(), None)).unwrap();
    let mut at_points = FlowFilter::<f64>::new(size, with(SamplingGrid::Points(points.clone()), None)).unwrap();
    let mut on_grid = FlowFilter::<f64>::new(size, with(grid.clone(), None)).unwrap();
    let mut masked = FlowFilter::<f64>::new(size, with(SamplingGrid::default(), Some(mask))).unwrap();
    for t in 0..3 {
        let frame = texture(size.0, size.1, t);
        let all = dense.push(&frame).unwrap();
        let p = at_points.push(&frame).unwrap();
        for (k, &(x, y)) in points.iter().enumerate() {
            assert_eq!(p.motion[k].to_bits(), all.motion[y * size.0 + x].to_bits());
            assert_eq!(p.status[k], all.status[y * size.0 + x]);
        }
        let g = on_grid.push(&frame).unwrap();
        for row in 0..g.height {
            for col in 0..g.width {
                let (x, y) = grid.pixel(col, row);
                assert_eq!(g.motion[row * g.width + col].to_bits(), all.motion[y * size.0 + x].to_bits());
            }
        }
        let m = masked.push(&frame).unwrap();
        for y in 1..size.1 - 1 {
            for x in 1..size.0 - 1 {
                let site = y * size.0 + x;
                if x.abs_diff(10) <= 1 && y.abs_diff(10) <= 1 {
                    assert_eq!(m.status[site], Status::Masked);
                    assert!(m.motion[site].is_nan() && masked.state(site).is_none());
                } else {
                    assert_eq!(m.motion[site].to_bits(), all.motion[site].to_bits());
                }
            }
        }
    }
    assert_eq!(p_status(&mut at_points, 2), Status::Border);
}

fn p_status(filter: &mut FlowFilter<f64>, site: usize) -> Status {
    filter.push(&texture(40, 30, 9)).unwrap().status[site]
}

#[test]
fn grey_scale_pitch_and_covariance_are_in_their_units() {
    let frames: Vec<_> = (0..4).map(|t| texture(16, 16, t)).collect();
    let sites = SamplingGrid::Points(vec![(8, 8)]);
    let options = FlowFilterOptions { sites, covariance: true, adaptive: false, ..FlowFilterOptions::patent() };
    let scaled = FlowFilterOptions { full_scale: 1.0, units: Units::new((2.0, 0.5), None, None), ..options.clone() };
    let mut a = FlowFilter::<f64>::new((16, 16), options).unwrap();
    let mut b = FlowFilter::<f64>::new((16, 16), scaled).unwrap();
    let mut last = None;
    for frame in &frames {
        last = Some((a.push(frame).unwrap(), b.push(&frame.map(|v| v / 255.0)).unwrap()));
    }
    let (fa, fb) = last.unwrap();
    let unit = [2.0, 0.5, 1.0, 0.25, 4.0, 1.0];
    let (ca, cb) = (fa.covariance_at(0).unwrap(), fb.covariance_at(0).unwrap());
    let (_, full) = a.state(0).unwrap();
    for k in 0..6 {
        assert!((fb.motion[k] - unit[k] * fa.motion[k]).abs() < 1e-10 * (1.0 + fa.motion[k].abs()));
        for j in 0..6 {
            assert!((cb[k][j] - unit[k] * unit[j] * ca[k][j]).abs() < 1e-9);
            assert_eq!(ca[k][j], full[6 + k][6 + j]);
        }
    }
}

#[test]
fn residual_estimates_the_pixel_noise() {
    use jacoflow::math::random::CounterRng;
    let rng = CounterRng::new(11);
    let frame = Frame::from_fn(64, 64, |x, y| 100.0 + 0.5 * x as f64 + 3.0 * rng.normal((y * 64 + x) as u64));
    for (neighbourhood, tolerance) in [
        (Neighbourhood::square(3), 0.15),
        (Neighbourhood::square(7), 0.1),
        (Neighbourhood::Rectangle { width: 7, height: 7, sigma: Some(2.0) }, 0.1),
    ] {
        let options = FlowFilterOptions { neighbourhood, ..FlowFilterOptions::patent() };
        let field = FlowFilter::<f64>::new((64, 64), options).unwrap().push(&frame).unwrap();
        let values: Vec<f64> = field.residual.unwrap().into_iter().filter(|v| v.is_finite()).collect();
        let variance = values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        assert!((variance.sqrt() / 3.0 - 1.0).abs() < tolerance, "{}", variance.sqrt());
    }
}

#[test]
fn unusable_options_and_frames_are_named() {
    let message = |size, options| FlowFilter::<f64>::new(size, options).unwrap_err().to_string();
    let patent = FlowFilterOptions::patent;
    let mut noise = patent();
    noise.process_noise[3] = -1.0;
    let mut start = patent();
    start.initial_covariance[7] = 0.0;
    for (options, name) in [
        (noise, "process_noise"),
        (start, "initial_covariance"),
        (FlowFilterOptions { measurement_noise: 0.0, ..patent() }, "measurement_noise"),
        (FlowFilterOptions { full_scale: f64::NAN, ..patent() }, "full_scale"),
        (FlowFilterOptions { mask: Some(Mask::filled(3, 3, true)), ..patent() }, "mask"),
        (FlowFilterOptions { sites: SamplingGrid::Points(vec![(9, 0)]), ..patent() }, "points"),
        (FlowFilterOptions { units: Units::new((0.0, 1.0), None, None), ..patent() }, "pixel_pitch"),
    ] {
        let text = message((8, 8), options);
        assert!(text.starts_with(name), "{text}");
    }
    assert!(message((2, 8), patent()).contains("frame_size"));
    let mut filter = FlowFilter::<f64>::new((8, 8), patent()).unwrap();
    assert!(filter.push(&texture(8, 9, 0)).unwrap_err().to_string().contains("8 x 9"));
    assert_eq!(filter.frames(), 0);
}

#[test]
fn constant_pictures_and_empty_site_lists_are_no_errors() {
    let mut filter = FlowFilter::<f32>::new((8, 8), FlowFilterOptions::patent()).unwrap();
    for _ in 0..300 {
        let field = filter.push(&Frame::filled(8, 8, 77.0f32)).unwrap();
        assert!(field.affine(27).to_array().iter().all(|v| v.is_finite()));
    }
    let none = FlowFilterOptions { sites: SamplingGrid::Points(Vec::new()), ..FlowFilterOptions::patent() };
    let mut filter = FlowFilter::<f32>::new((8, 8), none).unwrap();
    assert!(filter.push(&Frame::filled(8, 8, 1.0)).unwrap().is_empty());
    assert!(FlowFilter::<f32>::from_bytes(&filter.to_bytes().unwrap()).unwrap().is_empty());
}
