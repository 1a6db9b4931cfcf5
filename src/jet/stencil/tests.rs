use super::*;

#[test]
fn quadratics_are_recovered_exactly_in_units_of_the_pitch() {
    let jet = [90.0, 3.0, -2.0, 0.7, -0.4, 0.3];
    let (dx, dy) = (0.5, 2.0);
    let value = |x: usize, y: usize| {
        let row = design_row((x as f64 - 8.0) * dx, (y as f64 - 7.0) * dy);
        row.iter().zip(jet).map(|(b, i)| b * i).sum::<f64>()
    };
    let frame = Frame::from_fn(18, 17, value);
    let rectangle = |width, height, sigma| Neighbourhood::Rectangle { width, height, sigma };
    let ring = (0..8).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_4);
    let mut offsets: Vec<_> = ring.map(|a| ((3.0 * a.cos()).round() as i32, (3.0 * a.sin()).round() as i32)).collect();
    offsets.push((1, 0));
    let shapes = [
        rectangle(3, 3, None),
        rectangle(4, 4, None),
        rectangle(9, 5, Some(1.5)),
        rectangle(8, 7, Some(2.5)),
        Neighbourhood::Points { offsets, sigma: None },
    ];
    for shape in shapes {
        let stencil = JetStencil::new(&shape, (dx, dy)).unwrap();
        for (got, want) in stencil.at(&frame, 8, 7).into_iter().zip(jet) {
            assert!((got - want).abs() < 1e-10, "{shape:?}: {got} {want}");
        }
        assert!(stencil.noise_variance(&frame, 8, 7).unwrap() < 1e-20);
    }
}
