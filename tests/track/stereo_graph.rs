//! The graph of the stereo tracker.

use jacoflow::track::stereo::{Arc, Node, TrackGraph};

fn node(time: usize, index: usize) -> Node {
    Node {
        time,
        index,
        track_id: 7,
        group: 7,
        n_pixels: 100,
        weight: 0.1 + 0.2,
        mean: [1.0 / 3.0, 2.0, -3.5],
        covariance: [[1.0, 0.0, 0.1], [0.0, 1.0, 0.0], [0.1, 0.0, 1.0]],
        velocity: None,
        next_velocity: Some([0.1, -0.2, 0.3]),
        middle: [5.5, 7.0],
        affine: None,
        next_affine: Some([0.0, 0.5, 1.0 / 7.0, 0.0, 0.0, 0.0]),
        residual: Some(1e-300),
        coasting: false,
        depth: None,
        metric_velocity: None,
    }
}

/// 0 - 1 - 2 by strong arcs, and a weak one to another cluster from which a strong one goes on.
fn graph() -> TrackGraph {
    let mut graph = TrackGraph::default();
    for (time, index) in [(0, 0), (1, 1), (1, 2), (2, 3), (2, 4)] {
        graph.insert(node(time, index));
    }
    for (time, from, to, forward, backward) in
        [(0, 0, 1, 0.3, 0.1), (0, 0, 2, 0.2, 0.19), (1, 1, 3, 1.0, 1.0), (1, 2, 4, 0.5, 0.5)]
    {
        graph.connect(Arc { time, from, to, forward, backward }).unwrap();
    }
    graph
}

#[test]
fn tracks_follow_arcs_of_the_sum_that_reaches_the_threshold() {
    let graph = graph();
    assert_eq!(graph.follow(0, 0, 0.4, false).unwrap(), [(0, 0), (1, 1), (2, 3)]);
    assert_eq!(graph.follow(0, 0, 0.3, false).unwrap(), [(0, 0), (1, 1), (1, 2), (2, 3), (2, 4)]);
    assert_eq!(graph.follow(2, 3, 0.4, true).unwrap(), [(0, 0), (1, 1), (2, 3)]);
    assert_eq!(graph.follow(2, 4, 0.4, true).unwrap(), [(1, 2), (2, 4)]);
    assert_eq!(graph.entering(1, 2).count(), 1);
}

#[test]
fn what_is_not_there_is_refused_by_name() {
    let mut graph = graph();
    assert!(graph.follow(5, 0, 0.4, false).unwrap_err().to_string().starts_with("node: "));
    for threshold in [f64::NAN, -0.1, 2.1, f64::INFINITY] {
        let message = graph.follow(0, 0, threshold, false).unwrap_err().to_string();
        assert!(message.starts_with("threshold: ") && message.contains("0 to 2"), "{message}");
    }
    assert_eq!(graph.follow(1, 1, 2.0, false).unwrap(), [(1, 1), (2, 3)]);
    let arc = Arc { time: 0, from: 0, to: 9, forward: 0.5, backward: 0.5 };
    assert!(graph.connect(arc).unwrap_err().to_string().starts_with("arc: "));
    assert!(graph.connect(Arc { to: 1, forward: 1.5, ..arc }).unwrap_err().to_string().starts_with("arc: "));
    for part in ["nodes", "arcs"] {
        let mut doubled: serde_json::Value = serde_json::from_str(&graph.to_json().unwrap()).unwrap();
        let first = doubled[part][0].clone();
        doubled[part].as_array_mut().unwrap().push(first);
        let message = TrackGraph::from_json(&doubled.to_string()).unwrap_err().to_string();
        assert!(message.starts_with("json: ") && message.contains("twice"), "{message}");
    }
    assert!(TrackGraph::from_json("{}").unwrap_err().to_string().starts_with("json: "));
    let other = graph.to_json().unwrap().replace("graph 1", "graph 2");
    assert!(TrackGraph::from_json(&other).unwrap_err().to_string().contains("graph 2"));
}

#[test]
fn json_gives_back_every_number() {
    let graph = graph();
    assert_eq!(TrackGraph::from_json(&graph.to_json().unwrap()).unwrap(), graph);
}
