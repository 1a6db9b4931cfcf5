//! How many estimates share one independent one.

use jacoflow::flow::derived::sharing;
use jacoflow::types::{FieldLayout, Interval, SamplingGrid, Units};

fn layout(sites: SamplingGrid, correlation_length: f64) -> FieldLayout {
    FieldLayout {
        frame_size: (9, 5),
        sites,
        model: "affine".into(),
        parameters: Vec::new(),
        units: Units::default(),
        interval: Interval::Instant,
        frame_index: 0,
        correlation_length,
    }
}

#[test]
fn independent_and_far_estimates_share_nothing() {
    assert_eq!(sharing(&layout(SamplingGrid::default(), 0.0)), 1.0);
    assert_eq!(sharing(&layout(SamplingGrid::default(), f64::NAN)), 1.0);
    assert!((sharing(&layout(SamplingGrid::Points(vec![(0, 0), (8, 4)]), 0.5)) - 1.0).abs() < 1e-12);
}
