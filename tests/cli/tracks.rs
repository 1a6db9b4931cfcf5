//! `jacoflow track`: rows, boxes, pictures, mistakes, streams.

use super::support::{Ended, Place, temporary};
use jacoflow::io::{Colour, read_image, read_mot};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::Stdio;
use std::time::{Duration, Instant};

const WIDTH: usize = 96;
const HEIGHT: usize = 64;
/// Side of the square, px.
const SIDE: usize = 13;

fn header() -> Vec<u8> {
    format!("YUV4MPEG2 W{WIDTH} H{HEIGHT} F25:1 Ip A1:1 Cmono\n").into_bytes()
}

/// Where the square's first pixel is in a frame.
fn corner(index: usize) -> (usize, usize) {
    (20 + 2 * index, 24 + index)
}

/// A bright square that moves over a soft background.
fn frame(index: usize) -> Vec<u8> {
    let (left, top) = corner(index);
    let mut bytes = b"FRAME\n".to_vec();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let inside = (left..left + SIDE).contains(&x) && (top..top + SIDE).contains(&y);
            let ground = 90.0 + 15.0 * (0.21 * x as f64).sin() * (0.17 * y as f64).cos();
            bytes.push(if inside { 200 } else { ground as u8 });
        }
    }
    bytes
}

fn recording(frames: usize) -> Vec<u8> {
    header().into_iter().chain((0..frames).flat_map(frame)).collect()
}

/// A place with a recording `s.y4m`.
fn recorded(frames: usize) -> Place {
    let place = Place::new();
    fs::write(place.path("s.y4m"), recording(frames)).unwrap();
    place
}

/// The square's box in the first frame: pixels 20 to 32 and 24 to 36.
const BOX: &str = "--bbox 19.5,23.5,13,13";

/// Rows of a table, by the names of its columns.
fn rows(text: &str) -> Vec<std::collections::HashMap<String, String>> {
    let mut lines = text.lines().map(|line| line.split(',').map(String::from).collect::<Vec<_>>());
    let names = lines.next().unwrap();
    lines
        .map(|cells| {
            assert_eq!(cells.len(), names.len());
            names.iter().cloned().zip(cells).collect()
        })
        .collect()
}

#[test]
fn several_targets_become_rows_boxes_and_a_summary() {
    let place = recorded(6);
    let ended = place.good(&format!("track s.y4m {BOX} --bbox 60,10,8,8 -o out --format csv,mot --json"));
    let summary = ended.json();
    assert_eq!((summary["frames"].as_u64(), summary["files"].as_u64()), (Some(6), Some(2)));
    assert_eq!(summary["method"].as_str(), Some("gradient"));
    let targets = summary["targets"].as_array().unwrap();
    assert_eq!(targets.len(), 2);
    for (index, target) in targets.iter().enumerate() {
        assert_eq!(target["target"].as_u64(), Some(index as u64 + 1));
        let counts: u64 = target["frames"].as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum();
        assert_eq!(counts, 6);
    }
    assert_eq!(place.names("out"), ["tracks.csv", "tracks.txt"]);
    let table = rows(&fs::read_to_string(place.path("out/tracks.csv")).unwrap());
    assert_eq!(table.len(), 12);
    for (index, row) in table.iter().enumerate() {
        let (frame, target) = ((index / 2).to_string(), (index % 2 + 1).to_string());
        assert_eq!((&row["frame"], &row["target"]), (&frame, &target));
        assert!(row["cov_x_pp"].parse::<f64>().unwrap() >= 0.0);
    }
    let boxes = read_mot(place.path("out/tracks.txt")).unwrap();
    let first = boxes.iter().find(|b| b.target == 1).unwrap();
    assert_eq!(first.frame, 0);
    assert!((first.bounds.centre()[0] - 26.0).abs() < 1.0, "{first:?}");
    let text = fs::read_to_string(place.path("out/tracks.txt")).unwrap();
    assert!(text.starts_with("1,1,") && text.lines().next().unwrap().ends_with(",-1,-1,-1"), "{text}");
}

#[test]
fn a_moving_square_is_followed() {
    let place = recorded(20);
    for start in [BOX, "--center 26,30", ""] {
        let ended = place.good(&format!("track s.y4m {start} --quiet"));
        let table = rows(&ended.out);
        assert_eq!(table.len(), 20);
        for (index, row) in table.iter().enumerate().skip(3) {
            let (left, top) = corner(index);
            let centre = [left, top].map(|side| side as f64 + (SIDE / 2) as f64);
            for (name, want) in ["x", "y"].into_iter().zip(centre) {
                let got: f64 = row[name].parse().unwrap();
                assert!((got - want).abs() < 2.0, "{start} frame {index} {name}: {got} {want}");
            }
        }
    }
}

#[test]
fn frames_are_numbered_as_in_the_input() {
    let place = recorded(9);
    let ended = place.good(&format!("track s.y4m {BOX} --start 1 --step 3 --stop 10 --overlay o -o - --quiet"));
    let table = rows(&ended.out);
    assert_eq!(table.iter().map(|row| row["frame"].as_str()).collect::<Vec<_>>(), ["1", "4", "7"]);
    assert_eq!(place.names("o"), ["track_000001.png", "track_000004.png", "track_000007.png"]);
    let mot = place.good(&format!("track s.y4m {BOX} --start 1 --stop 3 --format mot"));
    assert!(mot.out.starts_with("2,1,") && mot.err.contains("2 frames"), "{} {}", mot.out, mot.err);
}

#[test]
fn pictures_show_the_box_and_may_be_enlarged() {
    let place = recorded(3);
    let ended = place.good(&format!("track s.y4m {BOX} --overlay boxes --enlarge 2"));
    assert!(ended.out.is_empty(), "pictures alone are wanted");
    let picture = read_image(place.path("boxes").join("track_000000.png"), Colour::Luminance).unwrap();
    assert_eq!(picture.size(), (2 * WIDTH, 2 * HEIGHT));
    let plain = read_image(place.path("boxes").join("track_000000.png"), Colour::Error);
    assert!(plain.is_err(), "colours tell the status");
    let again = place.line(&format!("track s.y4m {BOX} --overlay boxes"));
    assert!(again.code == 2 && again.err.contains("overlay") && again.err.contains("--force"), "{}", again.err);
    place.good(&format!("track s.y4m {BOX} --overlay boxes --force"));
    place.good(&format!("track s.y4m {BOX} --stop 2 --overlay boxes --force"));
    assert_eq!(place.names("boxes"), ["track_000000.png", "track_000001.png"], "nothing of the longer run is left");
    // A sequence instead, which is not replaced unasked; what is in it, the writer's own tests read back.
    let before = std::fs::read(place.path("s.y4m")).unwrap();
    let onto_itself = place.line(&format!("track s.y4m {BOX} --overlay ./s.y4m --force"));
    assert!(onto_itself.code == 2 && onto_itself.err.contains("overlay"), "{}", onto_itself.err);
    assert_eq!(std::fs::read(place.path("s.y4m")).unwrap(), before);
    let sequence = format!("track s.y4m {BOX} --overlay sequence.y4m --enlarge 2");
    place.good(&sequence);
    let again = place.line(&sequence);
    assert!(again.code == 2 && again.err.contains("overlay"), "{}", again.err);
    place.good(&format!("{sequence} --force"));
    assert!(std::fs::read(place.path("sequence.y4m")).unwrap().starts_with(b"YUV4MPEG2 W"));
}

#[test]
fn a_sequence_may_lie_in_the_new_folder_of_the_texts() {
    let place = recorded(3);
    place.good(&format!("track s.y4m {BOX} -o new/ --overlay new/sequence.y4m"));
    assert_eq!(place.names("new"), ["sequence.y4m", "tracks.csv"]);
    // What is in the way is still named, and other folders are not made.
    let again = place.line(&format!("track s.y4m {BOX} -o new/ --format mot --overlay new/sequence.y4m"));
    assert!(again.code == 2 && again.err.contains("overlay"), "{}", again.err);
    let other = place.line(&format!("track s.y4m {BOX} -o new/ --format mot --overlay other/sequence.y4m"));
    assert!(other.code != 0 && other.err.contains("other"), "{}", other.err);
    assert!(!place.path("other").exists());
}

#[test]
fn mistakes_are_named_and_leave_nothing() {
    let place = recorded(4);
    fs::write(place.path("old.csv"), "mine").unwrap();
    for (line, words) in [
        ("track", &["INPUT"][..]),
        ("track s.y4m --method magic", &["method", "gradient"]),
        ("track s.y4m --mode best", &["--mode", "improved"]),
        ("track s.y4m --mode improved", &["mode", "stereo and particle"]),
        ("track s.y4m --bbox 1,2,3", &["--bbox"]),
        ("track s.y4m --bbox 1,2,0,4", &["--bbox"]),
        ("track s.y4m --center 1", &["--center"]),
        ("track s.y4m --camera shaky", &["--camera"]),
        ("track s.y4m --model cubic", &["--model", "affine"]),
        ("track s.y4m -o out --format xml", &["format", "one of csv, mot"]),
        ("track s.y4m -o t.mp4", &["output", ".csv"]),
        ("track s.y4m -o t.csv --format csv,mot", &["output", "folder"]),
        ("track s.y4m --format csv,mot", &["output", "folder"]),
        ("track s.y4m -o - --json", &["output", "--json"]),
        ("track s.y4m -o old.csv", &["output", "--force"]),
        ("track s.y4m --overlay old.csv", &["overlay", "folder"]),
        ("track s.y4m --overlay sequence.mp4", &["overlay", "*.y4m", "sequence.mp4/"]),
        ("track s.y4m --overlay sequence.mp4 --force", &["overlay", "*.y4m"]),
        ("track s.y4m --overlay -", &["overlay", "*.y4m", "standard output"]),
        ("track s.y4m --enlarge 2", &["--overlay"]),
        ("track s.y4m --stop 1 --json", &["frames", "at least 2"]),
        ("track s.y4m --threads 0", &["--threads"]),
    ] {
        let ended = place.line(line);
        assert_eq!(ended.code, 2, "{line}: {}", ended.err);
        for word in words {
            assert!(ended.err.contains(word), "{line}: no {word:?} in {}", ended.err);
        }
    }
    assert_eq!(place.names("."), ["old.csv", "s.y4m"]);
    assert_eq!(fs::read_to_string(place.path("old.csv")).unwrap(), "mine");
}

/// Waits for a condition, for at most a minute.
fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn an_interrupted_run_leaves_no_half_file() {
    let place = Place::new();
    let line = format!("track - {BOX} -o t.csv --overlay o --json");
    let mut command = place.command(&line.split_whitespace().collect::<Vec<_>>());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&recording(4)).unwrap();
    pipe.flush().unwrap();
    wait_until("four pictures", || place.path("o/track_000003.png").exists());
    // Pictures are written before the rows of the frame; the pipe stays open, so that the run waits for a
    // frame when the signal comes.
    std::thread::sleep(Duration::from_millis(200));
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    wait_until("the end", || child.try_wait().unwrap().is_some());
    let output = child.wait_with_output().unwrap();
    drop(pipe);
    assert_eq!(output.status.code(), Some(130));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((summary["interrupted"].as_bool(), summary["output"].as_str()), (Some(true), Some("t.partial.csv")));
    assert_eq!(place.names("."), ["o", "t.partial.csv"]);
    assert_eq!(rows(&fs::read_to_string(place.path("t.partial.csv")).unwrap()).len(), 4);
    assert!(temporary(&place.path("o")).is_empty());
}

#[test]
fn an_interrupted_sequence_is_reported_by_the_name_that_it_has() {
    let place = Place::new();
    let line = format!("track - {BOX} --overlay sequence.y4m -o - --format mot");
    let mut command = place.command(&line.split_whitespace().collect::<Vec<_>>());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&recording(3)).unwrap();
    pipe.flush().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    for _ in 0..3 {
        out.read_line(&mut String::new()).unwrap();
    }
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    wait_until("the end", || child.try_wait().unwrap().is_some());
    drop(pipe);
    let output = child.wait_with_output().unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!(place.names("."), ["sequence.partial.y4m"]);
    assert!(!words.contains("sequence.y4m"), "{words}");
}

#[cfg(target_os = "linux")]
#[test]
fn devices_are_written_and_a_full_one_says_so() {
    let place = recorded(3);
    let full = place.line(&format!("track s.y4m {BOX} -o /dev/full"));
    assert!(full.code != 0 && full.err.contains("/dev/full: no storage space"), "{}", full.err);
    place.good(&format!("track s.y4m {BOX} -o /dev/null --format mot"));
    let two = place.line(&format!("track s.y4m {BOX} -o /dev/null --format mot,csv"));
    assert!(two.code == 2 && two.err.contains("folder for several formats"), "{}", two.err);
}

#[test]
fn coloured_sequences_need_luminance() {
    let place = Place::new();
    let mono = recording(3);
    let mut sequence = String::from_utf8(header()).unwrap().replace("Cmono", "C420").into_bytes();
    for frame in mono[header().len()..].chunks(6 + WIDTH * HEIGHT) {
        sequence.extend_from_slice(frame);
        sequence.extend(std::iter::repeat_n(90, WIDTH * HEIGHT / 2));
    }
    fs::write(place.path("s.y4m"), sequence).unwrap();
    let refused = place.line(&format!("track s.y4m {BOX}"));
    assert!(refused.code != 0 && refused.err.contains("--luminance"), "{}", refused.err);
    place.good(&format!("track s.y4m {BOX} --luminance"));
}

#[test]
fn rows_come_frame_by_frame_and_a_closed_pipe_ends_quietly() {
    let place = Place::new();
    let line = format!("track - {BOX} --quiet");
    let mut command = place.command(&line.split_whitespace().collect::<Vec<_>>());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&recording(2)).unwrap();
    pipe.flush().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    assert!(line.starts_with("target,frame,time,status"));
    line.clear();
    // The first row is there although the input is not at its end.
    out.read_line(&mut line).unwrap();
    assert!(line.starts_with("1,0,"), "{line}");
    drop(out);
    let mut index = 2;
    while index < 2000 && pipe.write_all(&frame(index % 20)).is_ok() {
        index += 1;
    }
    drop(pipe);
    let mut words = String::new();
    child.stderr.take().unwrap().read_to_string(&mut words).unwrap();
    assert!(child.wait().unwrap().success() && words.is_empty() && index < 2000, "{words} {index}");
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let place = recorded(5);
    let run = |threads: usize| -> Ended {
        place.good(&format!("track s.y4m {BOX} --bbox 60,10,8,8 --center 40,40 --threads {threads} --quiet"))
    };
    assert_eq!(run(1).out, run(2).out);
}
