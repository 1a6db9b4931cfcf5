//! Derived quantities over a field, and their mean over a region.

use jacoflow::flow::derived::{Aggregate, Quantity, parameter_mean, plane, planes, region_mean};
use jacoflow::types::{
    FieldLayout, FlowField, Frame, Interval, MOTION_NAMES, Rect, Region, SamplingGrid, Status, Units,
};

/// 3 x 2 sites with divergence 0.1, 0.2, ... 0.6 and standard deviation sd each of u_x, none of the
/// others.
fn field(sd: Option<f64>, period: Option<f64>) -> FlowField<f64> {
    let layout = FieldLayout {
        frame_size: (6, 4),
        sites: SamplingGrid::Grid { region: None, stride: 2 },
        model: "affine".into(),
        parameters: MOTION_NAMES.map(String::from).to_vec(),
        units: Units::new((1.0, 1.0), None, period),
        interval: Interval::Instant,
        frame_index: 0,
        correlation_length: 0.0,
    };
    let mut field = FlowField::empty(layout, sd.is_some()).unwrap();
    field.motion.fill(0.0);
    field.status.fill(Status::Ok);
    for i in 0..6 {
        field.motion[2 * 6 + i] = 0.1 * (i + 1) as f64;
    }
    if let (Some(sd), Some(c)) = (sd, &mut field.covariance) {
        c.fill(0.0);
        // Plane of (2, 2) in the upper triangle: 6 + 5.
        c[11 * 6..12 * 6].fill(sd * sd);
    }
    field
}

#[test]
fn planes_hold_value_and_standard_deviation() {
    let (value, std) = planes(&field(Some(0.02), Some(0.5)), Quantity::Divergence).unwrap();
    assert!((value[3] - 0.4).abs() < 1e-12 && (std.unwrap()[3] - 0.02).abs() < 1e-12);
    assert!(plane(&field(None, None), Quantity::Rpm).unwrap_err().to_string().starts_with("quantity"));
}

#[test]
fn a_region_has_one_value() {
    let region = Region::Rect(Rect { x: 0, y: 0, width: 6, height: 2 });
    let region = Some(&region);
    let f = field(Some(0.1), None);
    let mean = region_mean(&f, Quantity::Divergence, region, Aggregate::InverseVariance).unwrap();
    assert!((mean.value - 0.2).abs() < 1e-12 && mean.count == 3);
    assert!((mean.std - 0.1 / 3f64.sqrt()).abs() < 1e-12);
    // Estimates that share their pixels are worth one.
    let mut overlapping = f.clone();
    overlapping.layout.correlation_length = 1e4;
    let mean = region_mean(&overlapping, Quantity::Divergence, region, Aggregate::InverseVariance).unwrap();
    assert!((mean.std - 0.1).abs() < 1e-6);
    // Claimed errors far below the scatter are not believed.
    let tight = region_mean(&field(Some(1e-6), None), Quantity::Divergence, None, Aggregate::InverseVariance).unwrap();
    assert!((tight.value - 0.35).abs() < 1e-9 && tight.std > 0.05);
    let mean = parameter_mean(&f, "u_x", region, Aggregate::InverseVariance).unwrap();
    assert!((mean.value - 0.2).abs() < 1e-12 && (mean.std - 0.1 / 3f64.sqrt()).abs() < 1e-12);
    let unknown = parameter_mean(&f, "w", None, Aggregate::Median).unwrap_err().to_string();
    assert!(unknown.starts_with("name"), "{unknown}");
    let median = region_mean(&field(None, None), Quantity::Divergence, None, Aggregate::Median).unwrap();
    assert!((median.value - 0.35).abs() < 1e-12 && median.std > 0.0);
    assert!(region_mean(&field(None, None), Quantity::Divergence, None, Aggregate::InverseVariance).is_err());
}

#[test]
fn sites_without_an_estimate_do_not_take_part() {
    let mut f = field(Some(0.3), None);
    f.status[0] = Status::Masked;
    f.motion[2 * 6] = f64::NAN;
    let mean = region_mean(&f, Quantity::Divergence, None, Aggregate::InverseVariance).unwrap();
    assert!(mean.count == 5 && (mean.value - 0.4).abs() < 1e-12);
    f.status.fill(Status::Border);
    assert!(region_mean(&f, Quantity::Divergence, None, Aggregate::Median).unwrap().value.is_nan());
}

#[test]
fn ratios_are_formed_of_means() {
    // The mean of 2 / divergence would be 8.2; the divergence of the whole is 0.35.
    let f = field(Some(0.1), None);
    let mean = region_mean(&f, Quantity::TimeToContact, None, Aggregate::InverseVariance).unwrap();
    assert!((mean.value - 2.0 / 0.35).abs() < 1e-12, "{}", mean.value);
}

#[test]
fn regions_hold_the_pixels_that_their_outline_does() {
    let inside = |region: Region| -> usize {
        region.check((6, 4)).unwrap();
        (0..24).filter(|k| region.contains(k % 6, k / 6)).count()
    };
    assert_eq!(inside(Region::Rect(Rect { x: 1, y: 1, width: 3, height: 2 })), 6);
    assert_eq!(inside(Region::Disc { centre: (2.0, 2.0), radius: 1.0 }), 5);
    // A triangle, its corners in either order.
    let corners = vec![(-0.5, -0.5), (3.5, -0.5), (-0.5, 3.5)];
    assert_eq!(inside(Region::Polygon(corners.clone())), 6);
    assert_eq!(inside(Region::Polygon(corners.into_iter().rev().collect())), 6);
    assert_eq!(inside(Region::Mask(Frame::from_fn(6, 4, |x, y| x == y))), 4);
    for (wrong, part) in [
        (Region::Rect(Rect { x: 4, y: 0, width: 3, height: 1 }), "rectangle"),
        (Region::Disc { centre: (2.0, f64::NAN), radius: 1.0 }, "disc"),
        (Region::Disc { centre: (2.0, 2.0), radius: 0.0 }, "disc"),
        (Region::Polygon(vec![(0.0, 0.0), (1.0, 1.0)]), "3 corners"),
        (Region::Polygon(vec![(0.0, 0.0), (1.0, 1.0), (f64::INFINITY, 0.0)]), "finite"),
        (Region::Mask(Frame::from_fn(4, 6, |_, _| true)), "(4, 6)"),
    ] {
        let message = wrong.check((6, 4)).unwrap_err().to_string();
        assert!(message.starts_with("region: ") && message.contains(part), "{message}");
    }
}
