//! `jacoflow track --method particle`: boxes, files, pictures, foreground maps, mistakes, interruption.

use super::support::{Place, temporary};
use jacoflow::io::{Colour, Grey, OpenOptions, open_colour, open_colour_sink, open_sink, read_image, read_mot};
use jacoflow::synth::targets::{TargetScene, TargetSceneOptions};
use jacoflow::types::{AnyColourFrame, AnyFrame, Frame, TargetBox};
use std::fmt::Write as _;
use std::fs;
use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Two people who walk towards each other before a camera at rest.
fn scene(frames: usize) -> TargetScene {
    let options =
        TargetSceneOptions { random_state: 3, scale: 0.3, frames: Some(frames), ..TargetSceneOptions::default() };
    TargetScene::new("people_static", options).unwrap()
}

/// A place with the frames as `frames/*.png`.
fn recorded(scene: &TargetScene) -> Place {
    let place = Place::new();
    let mut sink = open_colour_sink(&place.path("frames").to_string_lossy(), 25.0).unwrap();
    (0..scene.frame_count()).for_each(|t| sink.write(&AnyColourFrame::U8(scene.frame(t))).unwrap());
    sink.finish().unwrap();
    place
}

/// The boxes of both targets at a frame, as options.
fn boxes(scene: &TargetScene, frame: usize) -> String {
    (0..scene.target_count()).fold(String::new(), |mut options, target| {
        let TargetBox { x, y, width, height } = scene.target_box(frame, target);
        write!(options, " --bbox {x},{y},{width},{height}").unwrap();
        options
    })
}

/// A target's line in a MOT file at a frame from 0, with a number of its own.
fn mot_line(scene: &TargetScene, frame: usize, target: usize, id: i64) -> String {
    let TargetBox { x, y, width, height } = scene.target_box(frame, target);
    format!("{},{id},{},{},{width},{height},1,-1,-1,-1\n", frame + 1, x + 1.5, y + 1.5)
}

const QUICK: &str = "--method particle --n-particles 200 --quiet";

#[test]
fn boxes_are_followed_into_every_kind_of_file() {
    let scene = scene(8);
    let place = recorded(&scene);
    let line = format!(
        "track frames {QUICK}{} --fps 25 --mot out.txt --csv out.csv --overlay out.y4m --foreground maps --json",
        boxes(&scene, 0)
    );
    let summary = place.good(&line).json();
    assert_eq!((summary["frames"].as_u64(), summary["files"].as_u64()), (Some(8), Some(11)), "{summary}");
    assert_eq!((summary["method"].as_str(), summary["mode"].as_str()), (Some("particle"), Some("improved")));
    assert_eq!(summary["particles"].as_u64(), Some(200));
    let found = read_mot(place.path("out.txt")).unwrap();
    assert_eq!(found.len(), 16);
    for one in &found {
        let truth = scene.target_box(one.frame, one.target as usize - 1);
        assert!(one.bounds.overlap(&truth) > 0.5, "{one:?} {truth:?}");
    }
    let table = fs::read_to_string(place.path("out.csv")).unwrap();
    let mut rows = csv_rows(&table);
    assert_eq!(rows.len(), 16);
    let last = rows.pop().unwrap();
    assert_eq!((last["target"].as_str(), last["frame"].as_str(), last["time"].as_str()), ("2", "7", "0.28"));
    let number = |name: &str| last[name].parse::<f64>().unwrap();
    assert!((1.0..=400.0).contains(&number("effective_sample_size")), "{last:?}");
    assert!((0.0..=1.0).contains(&number("similarity")) && number("n_tracks") >= 0.0, "{last:?}");
    let mut sequence = open_colour(&place.path("out.y4m").to_string_lossy(), &OpenOptions::default()).unwrap();
    assert_eq!((sequence.next_frame().unwrap().unwrap().size(), sequence.frame_rate()), (scene.size(), Some(25.0)));
    assert_eq!(sequence.skip(10).unwrap(), 7);
    assert_eq!(place.names("maps").len(), 8);
    let map = read_image(place.path("maps/foreground_000007.png"), Colour::Error).unwrap();
    assert_eq!((map.size(), map.dtype()), (scene.size(), "uint8"));
    assert_eq!(temporary(&place.path(".")), Vec::<String>::new());
}

fn csv_rows(text: &str) -> Vec<std::collections::HashMap<String, String>> {
    let mut lines = text.lines().map(|line| line.split(',').map(String::from).collect::<Vec<_>>());
    let names = lines.next().unwrap();
    lines.map(|cells| names.iter().cloned().zip(cells).collect()).collect()
}

#[test]
fn targets_of_a_file_start_at_their_first_line_under_their_own_numbers() {
    let scene = scene(7);
    let place = recorded(&scene);
    let lines = [mot_line(&scene, 5, 0, 12), mot_line(&scene, 2, 0, 12), mot_line(&scene, 4, 1, 3)].concat();
    fs::write(place.path("first.csv"), lines).unwrap();
    place.good(&format!("track frames {QUICK} --boxes first.csv -o out/ --format csv,mot --overlay out/"));
    let found = read_mot(place.path("out/tracks.txt")).unwrap();
    let frames = |id: i64| found.iter().filter(|b| b.target == id).map(|b| b.frame).collect::<Vec<_>>();
    assert_eq!((frames(12), frames(3)), (vec![2, 3, 4, 5, 6], vec![4, 5, 6]));
    let first = found.iter().find(|b| b.target == 3).unwrap();
    assert!(first.bounds.overlap(&scene.target_box(4, 1)) > 0.9, "{first:?}");
    let picture = read_image(place.path("out/track_000006.png"), Grey::Error).unwrap();
    assert_eq!(picture.size(), scene.size());
    // Frames are numbered as in the input, whichever of them are read.
    place.good(&format!("track frames {QUICK} --boxes first.csv --start 1 --step 3 --mot part.txt"));
    let part: Vec<_> = read_mot(place.path("part.txt")).unwrap().iter().map(|b| (b.target, b.frame)).collect();
    assert_eq!(part, [(3, 4)], "the line of 12 at frame 4 is not there, and frame 4 is the last that is read");
}

#[test]
fn one_seed_gives_one_result_on_any_number_of_threads() {
    let scene = scene(5);
    let place = recorded(&scene);
    let table = |options: &str| place.good(&format!("track frames {QUICK}{} {options}", boxes(&scene, 0))).out;
    let plain = table("--threads 1");
    assert_eq!(plain, table("--threads 3 --random-state 0"));
    assert_ne!(plain, table("--random-state 1"));
    assert_ne!(plain, table("--mode paper"));
}

#[test]
fn mistakes_are_named() {
    let scene = scene(3);
    let place = recorded(&scene);
    fs::write(place.path("first.csv"), mot_line(&scene, 0, 0, 1)).unwrap();
    fs::write(place.path("late.csv"), mot_line(&scene, 2, 0, 1).replace("3,1,", "9,1,")).unwrap();
    let one = boxes(&scene, 0);
    for (options, words) in [
        ("--method particle".to_string(), vec!["bbox: expected", "--boxes"]),
        (format!("--method particle --boxes first.csv{one}"), vec!["boxes: expected either"]),
        ("--method particle --boxes late.csv".into(), vec!["boxes: expected", "late.csv"]),
        (format!("--method particle{one} --center 3,4"), vec!["center: expected", "--method gradient"]),
        (format!("--method particle{one} --model affine"), vec!["model: expected", "--method gradient"]),
        (format!("--method particle{one} --cameras 800,1"), vec!["cameras: expected", "--method stereo"]),
        (format!("--method particle{one} --luminance"), vec!["luminance: expected", "colour is needed"]),
        (format!("--method particle{one} --smooth 1"), vec!["smooth: expected", "colour is needed"]),
        (format!("--method particle{one} --n-particles 3"), vec!["n_particles: expected at least"]),
        (format!("--method particle{one} --mot a.txt --csv a.txt"), vec!["csv: expected a file of its own"]),
        (format!("--method particle{one} --mot first.csv"), vec!["mot: expected", "first.csv"]),
        (format!("--method particle{one} --foreground maps.png"), vec!["foreground: expected a folder"]),
        ("--method particle --bbox 900,5,20,30".into(), vec!["bbox: expected", "target 1"]),
        (format!("--luminance{one} --foreground maps"), vec!["foreground: expected", "--method particle"]),
        (format!("--luminance{one} --random-state 3"), vec!["random_state: expected", "stereo or particle"]),
    ] {
        let ended = place.line(&format!("track frames {options}"));
        assert_eq!(ended.code, 2, "{options}: {}", ended.err);
        assert!(words.iter().all(|word| ended.err.contains(word)), "{options}: {}", ended.err);
    }
    assert_eq!(place.names("."), ["first.csv", "frames", "late.csv"]);
}

#[test]
fn grey_frames_say_that_colour_is_needed() {
    let place = Place::new();
    let mut sink = open_sink(&place.path("grey").to_string_lossy(), 25.0).unwrap();
    (0..2).for_each(|level| sink.write(&AnyFrame::U8(Frame::filled(64, 48, level))).unwrap());
    sink.finish().unwrap();
    let ended = place.line("track grey --method particle --bbox 4,4,20,20");
    assert!(ended.code != 0 && ended.err.contains("colour is needed"), "{}", ended.err);
}

#[test]
#[cfg(unix)]
fn a_run_that_is_interrupted_keeps_what_it_has_under_other_names() {
    let scene = scene(3);
    let place = recorded(&scene);
    let mut sink = open_colour_sink(&place.path("s.y4m").to_string_lossy(), 25.0).unwrap();
    (0..3).for_each(|t| sink.write(&AnyColourFrame::U8(scene.frame(t))).unwrap());
    sink.finish().unwrap();
    let options = format!("track - {QUICK}{} --mot out.txt --overlay out.y4m", boxes(&scene, 0));
    let mut command = place.command(&options.split_whitespace().collect::<Vec<_>>());
    let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&fs::read(place.path("s.y4m")).unwrap()).unwrap();
    pipe.flush().unwrap();
    // The stream stays open, so that the run waits for a fourth frame once it has begun its files.
    let patience = Instant::now();
    while temporary(&place.path(".")).len() < 2 && patience.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let ended = child.wait_with_output().unwrap();
    drop(pipe);
    assert_eq!(ended.status.code(), Some(130), "{}", String::from_utf8_lossy(&ended.stderr));
    assert_eq!(place.names("."), ["frames", "out.partial.txt", "out.partial.y4m", "s.y4m"]);
}
