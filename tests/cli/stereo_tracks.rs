//! `jacoflow track --method stereo`: pairs in every layout, tables, the graph, pictures, mistakes,
//! interruption.

use super::stereo::{HEIGHT, WIDTH, cell, header, recorded_as};
use super::support::{Place, temporary};
use jacoflow::io::{Colour, read_image};
use jacoflow::track::stereo::TrackGraph;
use std::fs;
use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// The views of a wall that goes 2 px to the right a step, at a disparity of 3 px.
fn moving(index: usize) -> [Vec<u8>; 2] {
    [200, 203].map(|from| (0..WIDTH * HEIGHT).map(|i| cell(i % WIDTH + from - 2 * index, i / WIDTH)).collect())
}

/// Options for views as small as these.
const SMALL: &str = "--method stereo --disparity-range -8,8 --n-components 4";

#[test]
fn every_layout_gives_the_same_tracks() {
    let place = recorded_as(4, moving);
    for (folder, input) in [
        ("a", "left right"),
        ("b", "beside.y4m --layout side-by-side"),
        ("c", "above.y4m --layout top-bottom"),
        ("d", "left.y4m right.y4m --threads 1"),
        ("e", "right.y4m left.y4m --swap"),
    ] {
        let line = format!("track {input} {SMALL} --fps 25 -o {folder} --format csv,json --json");
        let summary = place.good(&line).json();
        assert_eq!((summary["frames"].as_u64(), summary["files"].as_u64()), (Some(4), Some(2)), "{summary}");
        assert_eq!((summary["method"].as_str(), summary["mode"].as_str()), (Some("stereo"), Some("improved")));
        assert!(summary["edge_pixels"].as_u64() > Some(1000) && summary["tracks"].as_u64() >= Some(1), "{summary}");
        assert_eq!(place.names(folder), ["tracks.csv", "tracks.json"]);
        for name in place.names(folder) {
            let read = |folder: &str| fs::read_to_string(place.path(folder).join(&name)).unwrap();
            assert_eq!(read(folder), read("a"), "{folder}/{name}");
        }
    }
    let graph = TrackGraph::from_json(&fs::read_to_string(place.path("a/tracks.json")).unwrap()).unwrap();
    let wall = graph.nodes().filter(|node| node.time == 3).max_by_key(|node| node.n_pixels).unwrap();
    let [u, v, w] = wall.velocity.unwrap();
    assert!((u - 2.0).abs() < 0.1 && v.abs() < 0.1 && w.abs() < 0.1 && (wall.mean[2] - 3.0).abs() < 0.5, "{wall:?}");
}

#[test]
fn missing_frames_are_found_by_their_times() {
    // The views 3 and 5 of a sequence.
    let shown: [usize; 6] = [0, 1, 2, 4, 6, 7];
    let place = recorded_as(6, |index| moving(shown[index]));
    let lines = shown.map(|frame| format!("{},further columns", 7.0 + 0.04 * frame as f64));
    let text = lines.join("\n");
    fs::write(place.path("times.csv"), text).unwrap();
    let speeds = |options: &str| -> Vec<f64> {
        let out = place.good(&format!("track left right {SMALL} --format json --quiet {options}")).out;
        let graph = TrackGraph::from_json(&out).unwrap();
        let wall = |t: usize| graph.nodes().filter(|node| node.time == t).max_by_key(|node| node.n_pixels).unwrap();
        (1..6).map(|t| wall(t).velocity.unwrap()[0]).collect()
    };
    for (options, want) in [("", [2.0, 2.0, 4.0, 4.0, 2.0]), ("--times times.csv", [2.0; 5])] {
        let speeds = speeds(options);
        assert!(speeds.iter().zip(want).all(|(u, want)| (u - want).abs() < 0.1), "{options}: {speeds:?}");
    }
    place.good(&format!("track left right {SMALL} --times times.csv --quiet -o timed"));
    let rows = fs::read_to_string(place.path("timed/tracks.csv")).unwrap();
    let last: Vec<&str> = rows.lines().next_back().unwrap().split(',').collect();
    assert_eq!(last[1], "5");
    assert!((last[2].parse::<f64>().unwrap() - 0.28).abs() < 1e-9, "{last:?}");
    for (text, told) in [("1\n2\n", "times: "), ("1\n1\n", "times: "), ("soon\n", "line 1"), ("0\n\n1\n", "line 2")] {
        fs::write(place.path("wrong.txt"), text).unwrap();
        let ended = place.line(&format!("track left right {SMALL} --times wrong.txt"));
        assert!(ended.code != 0 && ended.err.contains(told), "{}", ended.err);
    }
}

#[test]
fn every_option_of_the_tracker_changes_what_it_is_said_to() {
    let place = recorded_as(3, moving);
    let graph = |options: &str| {
        let out = place.good(&format!("track left right {SMALL} --format json --quiet {options}")).out;
        TrackGraph::from_json(&out).unwrap()
    };
    let usual = graph("");
    // The defaults.
    assert_eq!(graph("--grid 60,80,16 --search 8"), usual);
    assert_ne!(graph("--grid 30,40"), usual);
    // What goes 2 px, in cells of 1.2 px by 1.07 px, is within two cells.
    let moved = |graph: &TrackGraph| graph.nodes().filter(|node| node.velocity.is_some()).count();
    assert!(moved(&graph("--search 2")) > 0);
}

#[test]
fn tracks_are_drawn_and_reported() {
    let place = recorded_as(3, moving);
    let line = format!(
        "track left right {SMALL} --mode paper --overlay p --disparity-overlay p --enlarge 2 --graph g.png --cameras 200,0.1,-10"
    );
    let ended = place.good(&line);
    assert!(ended.out.is_empty() && ended.err.contains("3 pairs") && ended.err.contains("7 files"), "{}", ended.err);
    assert_eq!(place.names("p").len(), 6);
    for name in ["p/track_000002.png", "p/stereo_000002.png"] {
        assert!(read_image(place.path(name), Colour::Error).is_err(), "{name} is in colours");
        assert_eq!(read_image(place.path(name), Colour::Luminance).unwrap().size(), (2 * WIDTH, 2 * HEIGHT));
    }
    assert!(read_image(place.path("g.png"), Colour::Luminance).unwrap().size().0 > 100);
    for wanted in ["graph", "overlay"] {
        let again = place.line(&line.replace(if wanted == "graph" { "--overlay p" } else { "--graph g.png" }, ""));
        assert!(again.code == 2 && again.err.contains("--force"), "{}", again.err);
    }
    place.good(&format!("{line} --force"));
    let rows = place.good(&format!("track left right {SMALL} --cameras 200,0.1,-10 --start 1")).out;
    assert!(rows.starts_with("step,frame,time,cluster,track") && rows.contains("\n1,2,nan,"), "{rows}");
    let depth = rows.lines().nth(1).unwrap().split(',').nth(28).unwrap();
    assert!((depth.parse::<f64>().unwrap() - 20.0 / 13.0).abs() < 0.1, "{depth}");
    let graph = place.good(&format!("track left right {SMALL} --format json --quiet")).out;
    assert!(TrackGraph::from_json(&graph).unwrap().nodes().next().is_some());
}

#[test]
fn mistakes_about_tracks_of_views_are_named_and_leave_nothing() {
    let place = recorded_as(2, moving);
    fs::write(place.path("old.csv"), "mine").unwrap();
    fs::write(place.path("old.png"), "mine").unwrap();
    let before = place.names(".");
    for (options, words) in [
        ("left --method stereo", &["input", "--layout"][..]),
        ("left right --method stereo --bbox 1,2,3,4", &["bbox", "gradient"]),
        ("left right --method stereo --model affine", &["model", "gradient"]),
        ("left.y4m --mode improved", &["mode", "stereo and particle"]),
        ("left.y4m --graph g.png", &["graph", "stereo"]),
        ("left.y4m --layout side-by-side", &["layout", "stereo"]),
        ("left right --method stereo --n-components 0", &["n_components"]),
        ("left right --method stereo --disparity-range -4000,4000", &["disparity_range"]),
        ("left right --method stereo --cameras 3", &["--cameras"]),
        ("left right --method stereo --grid 30", &["--grid", "ROWS,COLUMNS"]),
        ("left right --method stereo --grid 0,40", &["grid", "1 to 4096"]),
        ("left right --method stereo --grid 10,10,10", &["grid", "-40 to 24, at least 64"]),
        ("left right --method stereo --search 65", &["search", "1 to 64"]),
        ("left.y4m --search 3", &["search", "stereo"]),
        ("left right --method stereo --graph g.svg", &["graph", ".png"]),
        ("left right --method stereo --graph old.png", &["graph", "--force"]),
        ("left right --method stereo --format mot", &["format", "one of csv, json"]),
        ("left right --method stereo -o t.txt", &["output", ".csv or .json"]),
        ("left right --method stereo -o old.csv", &["output", "--force"]),
        ("left right --method stereo -o - --json", &["output", "--json"]),
        ("left right --method stereo --stop 1 -o t.csv --disparity-range -8,8", &["stop", "at least 2"]),
        ("left beside.y4m --method stereo -o t.csv", &["right", "(64, 96)", "(64, 192)"]),
    ] {
        let ended = place.line(&format!("track {options}"));
        assert_eq!(ended.code, 2, "{options}: {}", ended.err);
        for word in words {
            assert!(ended.err.contains(word), "{options}: no {word:?} in {}", ended.err);
        }
        fs::remove_file(place.path("t.partial.csv")).ok();
    }
    assert_eq!(place.names("."), before);
    assert_eq!(place.line("track left nowhere --method stereo -o t.csv").code, 1);
}

#[test]
fn an_interrupted_run_of_pairs_leaves_no_half_file() {
    let place = Place::new();
    let line = format!("track - {SMALL} --layout top-bottom -o out --format csv,json --graph g.png --overlay p --json");
    let mut command = place.command(&line.split_whitespace().collect::<Vec<_>>());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&header(WIDTH, 2 * HEIGHT)).unwrap();
    for index in 0..3 {
        let [left, right] = moving(index);
        pipe.write_all(&[b"FRAME\n".to_vec(), left, right].concat()).unwrap();
    }
    pipe.flush().unwrap();
    let start = Instant::now();
    while !place.path("p/track_000002.png").exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited in vain for three pictures");
        std::thread::sleep(Duration::from_millis(10));
    }
    // Pictures are written before the rows of the pair; the pipe stays open, so that the run waits for a pair
    // when the signal comes.
    std::thread::sleep(Duration::from_millis(200));
    assert!(std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    drop(pipe);
    assert_eq!(output.status.code(), Some(130));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((summary["interrupted"].as_bool(), summary["frames"].as_u64()), (Some(true), Some(3)));
    assert_eq!(place.names("."), ["g.partial.png", "out", "p"]);
    assert_eq!(place.names("out"), ["tracks.partial.csv", "tracks.partial.json"]);
    assert!(temporary(&place.path("p")).is_empty());
}
