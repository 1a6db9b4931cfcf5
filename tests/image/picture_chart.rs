//! A graph over time: steps to the right, a lane for each component.

use jacoflow::image::picture::{ChartNode, chart_picture};

fn node(step: usize, lane: usize, number: u64) -> ChartNode {
    ChartNode { step, lane, size: 50.0, number }
}

#[test]
fn long_sequences_and_nothing_at_all_are_drawn() {
    let long: Vec<_> = (0..50_000).map(|step| node(step, 0, 1)).collect();
    assert!(chart_picture(&long, &[]).width() < 20_000);
    assert_eq!(chart_picture(&[], &[]).width(), 80);
}
