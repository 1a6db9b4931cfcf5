//! Standard input, long runs, interruption.

use super::support::{Place, temporary};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

fn header() -> Vec<u8> {
    format!("YUV4MPEG2 W{WIDTH} H{HEIGHT} F25:1 Ip A1:1 Cmono\n").into_bytes()
}

/// A frame of moving texture.
fn frame(index: usize) -> Vec<u8> {
    let mut bytes = b"FRAME\n".to_vec();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let phase = (x as f64 - 0.3 * index as f64) * 0.5;
            bytes.push((128.0 + 50.0 * phase.sin() + 40.0 * (y as f64 * 0.4 + 0.2 * phase).cos()) as u8);
        }
    }
    bytes
}

/// Waits for a condition, for at most a minute.
fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn interrupt(child: &Child) {
    let status = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(status.success());
}

fn start(place: &Place, line: &str) -> Child {
    let arguments: Vec<&str> = line.split_whitespace().collect();
    let mut command = place.command(&arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

#[test]
fn y4m_on_standard_input_is_the_same_as_from_a_file() {
    let place = Place::new();
    let mut bytes = header();
    (0..5).for_each(|index| bytes.extend(frame(index)));
    fs::write(place.path("s.y4m"), &bytes).unwrap();
    place.good("flow s.y4m -o a --format flo");
    let ended = place.fed("flow - -o b --format flo --json", &bytes);
    assert_eq!((ended.code, ended.json()["fields"].as_u64()), (0, Some(3)), "{}", ended.err);
    for name in ["000001.flo", "000002.flo", "000003.flo"] {
        assert_eq!(fs::read(place.path("a").join(name)).unwrap(), fs::read(place.path("b").join(name)).unwrap());
    }
}

#[test]
fn a_stream_that_breaks_off_keeps_what_was_complete() {
    let place = Place::new();
    let mut bytes = header();
    (0..6).for_each(|index| bytes.extend(frame(index)));
    bytes.truncate(bytes.len() - 100);
    let ended = place.fed("flow - -o out --format npz,csv --stride 4", &bytes);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert_eq!(place.names("out"), ["000001.npz", "000002.npz", "000003.npz", "points.partial.csv"]);
}

#[test]
fn an_interrupted_run_leaves_no_half_file_and_loses_nothing() {
    let place = Place::new();
    let mut child = start(&place, "flow - -o out --format npz,csv --stride 2 --json");
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&header()).unwrap();
    (0..6).for_each(|index| pipe.write_all(&frame(index)).unwrap());
    pipe.flush().unwrap();
    wait_until("four fields", || place.path("out/000004.npz").exists());
    // The pipe stays open: the run is waiting for a frame when the signal comes.
    interrupt(&child);
    wait_until("the end", || child.try_wait().unwrap().is_some());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let mut out = String::new();
    child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((summary["interrupted"].as_bool(), summary["fields"].as_u64()), (Some(true), Some(4)));
    let want = ["000001.npz", "000002.npz", "000003.npz", "000004.npz", "points.partial.csv"];
    assert_eq!(place.names("out"), want);
    for index in 1..=4 {
        jacoflow::io::read_npz::<f64>(place.path(&format!("out/{index:06}.npz"))).unwrap();
    }
    let rows = fs::read_to_string(place.path("out/points.partial.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 4 * (WIDTH / 2) * (HEIGHT / 2));
    drop(pipe);
}

#[test]
fn an_interrupted_single_file_does_not_appear() {
    let place = Place::new();
    let mut child = start(&place, "flow - -o one.npz");
    let mut pipe = child.stdin.take().unwrap();
    // Two frames are more than a pipe holds: once they are written, the run is reading them, and a signal
    // finds it at work.
    let (width, height) = (512, 512);
    pipe.write_all(format!("YUV4MPEG2 W{width} H{height} F25:1 Ip A1:1 Cmono\n").as_bytes()).unwrap();
    for _ in 0..2 {
        pipe.write_all(b"FRAME\n").unwrap();
        pipe.write_all(&vec![128; width * height]).unwrap();
    }
    interrupt(&child);
    wait_until("the end", || child.try_wait().unwrap().is_some());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(place.names(".").is_empty());
}

#[test]
fn rows_of_an_interrupted_run_are_reported_by_the_name_they_have() {
    for tell in ["", " --json"] {
        let place = Place::new();
        let mut child = start(&place, &format!("flow - -o t.csv --points 20,20{tell}"));
        let mut pipe = child.stdin.take().unwrap();
        pipe.write_all(&header()).unwrap();
        (0..4).for_each(|index| pipe.write_all(&frame(index)).unwrap());
        pipe.flush().unwrap();
        wait_until("the table", || !temporary(&place.path(".")).is_empty());
        interrupt(&child);
        let output = child.wait_with_output().unwrap();
        drop(pipe);
        assert_eq!((output.status.code(), place.names(".")), (Some(130), vec!["t.partial.csv".to_string()]));
        let words = String::from_utf8(output.stderr).unwrap();
        assert!(words.contains("1 file: t.partial.csv"), "{words}");
        if !tell.is_empty() {
            let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(summary["output"], "t.partial.csv");
        }
    }
}

/// With pictures beside it, and before there is any row.
#[test]
fn a_table_of_motions_that_was_interrupted_is_reported_by_the_name_it_has() {
    let line = "egomotion - --intrinsics 60,60,32,24 --method windowed --time-scheme pair --spacing 6 --no-robust --picture pictures --alternatives others.csv -o motion.csv --json";
    for frames in [1, 4] {
        let place = Place::new();
        let mut child = start(&place, line);
        let mut pipe = child.stdin.take().unwrap();
        pipe.write_all(&header()).unwrap();
        (0..frames).for_each(|index| pipe.write_all(&frame(index)).unwrap());
        pipe.flush().unwrap();
        let pictures = || fs::read_dir(place.path("pictures")).map_or(0, Iterator::count);
        wait_until("the tables and pictures", || temporary(&place.path(".")).len() == 2 && pictures() >= frames - 1);
        interrupt(&child);
        let output = child.wait_with_output().unwrap();
        drop(pipe);
        assert_eq!(output.status.code(), Some(130));
        let words = String::from_utf8(output.stderr).unwrap();
        let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(!place.path("motion.csv").exists() && temporary(&place.path(".")).is_empty());
        if frames == 1 {
            assert_eq!((&summary["output"], &summary["files"]), (&serde_json::Value::Null, &0.into()), "{words}");
            assert!(!words.contains("motion.csv") && place.names(".").is_empty(), "{words}");
        } else {
            assert_eq!(summary["output"], "motion.partial.csv");
            assert!(words.contains("files, among them motion.partial.csv"), "{words}");
            assert_eq!(fs::read_to_string(place.path("motion.partial.csv")).unwrap().lines().count(), frames);
        }
    }
}

#[test]
fn a_second_interrupt_ends_at_once_and_leaves_no_temporary_file() {
    for line in [
        "synth turbulence -o s.npy --size 1500x1500 --frames 2",
        "synth turbulence -o s.y4m --size 1500x1500 --frames 2",
    ] {
        let place = Place::new();
        let mut child = start(&place, line);
        wait_until("the file", || !temporary(&place.path(".")).is_empty());
        // A frame takes long enough for many signals.
        wait_until("the end", || {
            interrupt(&child);
            child.try_wait().unwrap().is_some()
        });
        assert_eq!(child.wait().unwrap().code(), Some(130));
        assert!(place.names(".").is_empty(), "{:?}", place.names("."));
    }
}

/// Waits until the process handles signals itself; SIGTERM is the last that it does.
#[cfg(target_os = "linux")]
fn wait_for_handlers(child: &Child) {
    wait_until("signal handlers", || {
        let text = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let caught = text.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        caught.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() >> 14 & 1 == 1)
    });
}

#[cfg(target_os = "linux")]
#[test]
fn the_first_interrupt_ends_the_opening_of_a_silent_pipe() {
    for line in [
        "info pipe.y4m",
        "flow pipe.y4m -o out",
        "measure pipe.y4m --quantity u -o out.csv",
        "filter pipe.y4m -o out",
        "track pipe.y4m --bbox 5,5,9,9 -o out.csv",
        "track pipe.y4m pipe.y4m --method stereo -o out.csv",
        "stereo pipe.y4m pipe.y4m -o out",
        "egomotion pipe.y4m --intrinsics 60,60,32,24 -o out.csv",
        "flow - -o out",
        "info -",
    ] {
        let place = Place::new();
        assert!(std::process::Command::new("mkfifo").arg(place.path("pipe.y4m")).status().unwrap().success());
        let mut child = start(&place, line);
        wait_for_handlers(&child);
        interrupt(&child);
        wait_until(line, || child.try_wait().unwrap().is_some());
        assert_eq!(child.wait().unwrap().code(), Some(130), "{line}");
        assert_eq!(place.names("."), ["pipe.y4m"], "{line}");
    }
}

#[test]
fn an_interrupted_scene_says_that_nothing_is_left_of_it() {
    let place = Place::new();
    let mut child = start(&place, "synth vortex -o frames/ --truth truth --frames 3000 --size 96x96");
    wait_until("truth of a frame", || place.path("truth/000001.npz").exists());
    interrupt(&child);
    wait_until("the end", || child.try_wait().unwrap().is_some());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(said.contains("0 of 3000 frames written"), "{said}");
    assert!(place.names(".").is_empty());
}

#[cfg(target_os = "linux")]
#[test]
fn the_first_interrupt_ends_the_opening_of_what_is_read_beside_the_frames() {
    for line in [
        "flow s.npy --mask pipe.png -o out.npz",
        "flow s.npy --points pipe.csv -o out.csv",
        "flow s.npy --initial pipe.flo -o out.npz",
        "filter s.npy --resume pipe.npz -o out.npz",
    ] {
        let place = Place::new();
        place.good("synth affine -o s.npy --frames 3 --size 48x40");
        let pipe = line.split(' ').find(|word| word.starts_with("pipe")).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(place.path(pipe)).status().unwrap().success());
        let mut child = start(&place, line);
        wait_for_handlers(&child);
        // The frames come first.
        std::thread::sleep(std::time::Duration::from_millis(300));
        interrupt(&child);
        wait_until(line, || child.try_wait().unwrap().is_some());
        assert_eq!(child.wait().unwrap().code(), Some(130), "{line}");
        assert_eq!(place.names("."), [pipe, "s.npy"], "{line}");
    }
}

#[test]
fn rows_on_standard_output_come_frame_by_frame_and_a_closed_pipe_ends_quietly() {
    // Few rows a frame, which are flushed; and more than any buffer holds.
    follow("flow - --points 20,20 --quiet", "1,0.04,20,20,ok");
    follow("flow - -o - --quiet", "1,0.04,0,0,ok");
}

fn follow(command: &str, first: &str) {
    let place = Place::new();
    let mut child = start(&place, command);
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&header()).unwrap();
    (0..3).for_each(|index| pipe.write_all(&frame(index)).unwrap());
    pipe.flush().unwrap();
    let mut rows = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    rows.read_line(&mut line).unwrap();
    assert!(line.starts_with("frame,time_s,x,y,status"));
    line.clear();
    // The first row is there although the input is not at its end.
    rows.read_line(&mut line).unwrap();
    assert!(line.starts_with(first), "{line}");
    drop(rows);
    let mut index = 3;
    while index < 2000 && pipe.write_all(&frame(index)).is_ok() {
        index += 1;
    }
    drop(pipe);
    let status = child.wait().unwrap();
    let mut words = String::new();
    child.stderr.take().unwrap().read_to_string(&mut words).unwrap();
    assert!(status.code() == Some(0) && words.is_empty() && index < 2000, "{status:?} {words} {index}");
}

/// Peak memory of a process, kB; from the system's own account.
#[cfg(target_os = "linux")]
fn peak_memory(child: &Child) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = text.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_with_the_stream() {
    let place = Place::new();
    let mut child = start(&place, "flow - --points 20,20 --points 40,30 -o rows.csv --preset fast --threads 2 --quiet");
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&header()).unwrap();
    let (mut early, mut late) = (0, 0);
    // 450 frames of 64 x 48 would be 1.4 MB as bytes and 5.5 MB as floats.
    for index in 0..600 {
        pipe.write_all(&frame(index % 50)).unwrap();
        if index == 150 {
            early = peak_memory(&child).unwrap();
        }
    }
    wait_until("a reading", || {
        late = peak_memory(&child).unwrap_or(late);
        late > 0
    });
    drop(pipe);
    assert!(child.wait().unwrap().success());
    let rows = fs::read_to_string(place.path("rows.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 2 * 598);
    assert!(temporary(&place.path(".")).is_empty());
    assert!(late < early + 1024, "{early} kB after 150 frames, {late} kB after 600");
    assert!(late < 64 * 1024, "{late} kB");
}
