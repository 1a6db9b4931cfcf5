//! `jacoflow stereo`: pairs in every layout, formats, pictures, mistakes, interruption.

use super::support::{Place, temporary};
use jacoflow::io::{Colour, DisparityFormat, read_image};
use std::fs;
use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

pub const WIDTH: usize = 96;
pub const HEIGHT: usize = 64;
/// Disparity of the pair `index`, px.
fn disparity(index: usize) -> usize {
    3 + index
}

/// Level of a cell of 8 px.
pub fn cell(x: usize, y: usize) -> u8 {
    let mut bits = ((x / 8) * 7919 + (y / 8) * 104_729 + 12_345) as u32;
    for _ in 0..3 {
        bits = (bits ^ (bits >> 7)).wrapping_mul(2_654_435_761);
    }
    20 + (bits >> 16) as u8 % 200
}

/// The views of a pair: what the left one shows at `x`, the right one shows at `x - disparity`.
fn views(index: usize) -> [Vec<u8>; 2] {
    [200, 200 + disparity(index)].map(|from| (0..WIDTH * HEIGHT).map(|i| cell(i % WIDTH + from, i / WIDTH)).collect())
}

/// The beginning of a sequence.
pub fn header(w: usize, h: usize) -> Vec<u8> {
    format!("YUV4MPEG2 W{w} H{h} F25:1 Ip A1:1 Cmono\n").into_bytes()
}

/// A place with `left/`, `right/`, `left.y4m`, `right.y4m`, `beside.y4m` and `above.y4m` of some pairs.
fn recorded(pairs: usize) -> Place {
    recorded_as(pairs, views)
}

pub fn recorded_as(pairs: usize, views: impl Fn(usize) -> [Vec<u8>; 2]) -> Place {
    let place = Place::new();
    let (mut beside, mut above) = (header(2 * WIDTH, HEIGHT), header(WIDTH, 2 * HEIGHT));
    for (side, folder) in ["left", "right"].into_iter().enumerate() {
        fs::create_dir(place.path(folder)).unwrap();
        let mut sequence = header(WIDTH, HEIGHT);
        for index in 0..pairs {
            let bytes = [format!("P5\n{WIDTH} {HEIGHT}\n255\n").into_bytes(), views(index)[side].clone()].concat();
            fs::write(place.path(folder).join(format!("{index}.pgm")), bytes).unwrap();
            sequence.extend(b"FRAME\n".iter().chain(&views(index)[side]));
        }
        fs::write(place.path(&format!("{folder}.y4m")), sequence).unwrap();
    }
    for index in 0..pairs {
        let [left, right] = views(index);
        for sequence in [&mut beside, &mut above] {
            sequence.extend(b"FRAME\n");
        }
        for (a, b) in left.chunks(WIDTH).zip(right.chunks(WIDTH)) {
            beside.extend([a, b].concat());
        }
        above.extend([left, right].concat());
    }
    fs::write(place.path("beside.y4m"), beside).unwrap();
    fs::write(place.path("above.y4m"), above).unwrap();
    place
}

/// Median of the disparities in a file.
fn median(place: &Place, name: &str, format: DisparityFormat) -> f32 {
    let map = format.read(&place.path(name)).unwrap();
    assert_eq!(map.disparity.size(), (WIDTH, HEIGHT));
    let mut values: Vec<f32> = map.disparity.data().iter().copied().filter(|d| d.is_finite()).collect();
    assert!(values.len() > 300, "{name}: {}", values.len());
    values.sort_by(f32::total_cmp);
    values[values.len() / 2]
}

#[test]
fn every_layout_gives_the_same_disparities() {
    let place = recorded(3);
    let common = "--disparity-range -8,12 --format npz,pfm,kitti --json";
    for (folder, line) in [
        ("a", "stereo left right"),
        ("b", "stereo beside.y4m --layout side-by-side"),
        ("c", "stereo above.y4m --layout top-bottom"),
        ("d", "stereo left.y4m right.y4m"),
        ("e", "stereo right left.y4m --swap"),
    ] {
        let summary = place.good(&format!("{line} {common} -o {folder}")).json();
        assert_eq!((summary["pairs"].as_u64(), summary["files"].as_u64()), (Some(3), Some(9)));
        assert!(summary["row_offset"].as_f64().unwrap().abs() < 0.05, "{summary}");
        assert_eq!(place.names(folder).len(), 9);
        for format in DisparityFormat::ALL {
            for index in 0..3 {
                let name = format!("{folder}/disparity_{index:06}.{}", format.extension());
                assert!((median(&place, &name, format) - disparity(index) as f32).abs() < 0.1, "{name}");
                assert_eq!(
                    fs::read(place.path(&name)).unwrap(),
                    fs::read(place.path(&name.replacen(folder, "a", 1))).unwrap()
                );
            }
        }
    }
    let map = DisparityFormat::Npz.read(&place.path("a/disparity_000000.npz")).unwrap();
    assert!(map.score.is_some() && map.row_offset.is_some());
}

/// A view squeezed to half its width or height, as players store it: means of two samples.
fn squeezed(view: &[u8], wide: bool) -> Vec<u8> {
    let mean = u8::midpoint;
    if wide {
        return view.chunks(2).map(|two| mean(two[0], two[1])).collect();
    }
    view.chunks(2 * WIDTH)
        .flat_map(|two| (0..WIDTH).map(|x| mean(two[x], two[WIDTH + x])).collect::<Vec<_>>())
        .collect()
}

#[test]
fn squeezed_sequences_have_the_disparities_of_whole_ones() {
    let place = Place::new();
    for (name, wide) in [("half-side-by-side", true), ("half-top-bottom", false)] {
        let mut sequence = header(WIDTH, HEIGHT);
        for index in 0..2 {
            sequence.extend(b"FRAME\n");
            let [left, right] = views(index).map(|view| squeezed(&view, wide));
            if wide {
                sequence.extend(left.chunks(WIDTH / 2).zip(right.chunks(WIDTH / 2)).flat_map(|(a, b)| [a, b].concat()));
            } else {
                sequence.extend([left, right].concat());
            }
        }
        fs::write(place.path("sequence.y4m"), sequence).unwrap();
        place.good(&format!("stereo sequence.y4m --layout {name} --disparity-range -8,12 -o {name}"));
        for index in 0..2 {
            let file = format!("{name}/disparity_{index:06}.npz");
            let found = median(&place, &file, DisparityFormat::Npz);
            assert!((found - disparity(index) as f32).abs() < 0.2, "{file}: {found}");
        }
    }
}

/// A sequence may begin with black, or with a title that both views show alike.
#[test]
fn rows_are_found_however_a_sequence_begins() {
    let card = |_: usize| -> Vec<u8> {
        let bar = |i: usize| {
            (20..26).contains(&(i / WIDTH)) || (30..50).contains(&(i / WIDTH)) && (i % WIDTH / 6).is_multiple_of(3)
        };
        (0..WIDTH * HEIGHT).map(|i| if bar(i) && (8..88).contains(&(i % WIDTH)) { 230 } else { 20 }).collect()
    };
    for title in [false, true] {
        let place = recorded_as(4, |index| match index {
            0 if title => [card(0), card(0)],
            0 => [vec![16; WIDTH * HEIGHT], vec![16; WIDTH * HEIGHT]],
            // The right view is two rows lower.
            _ => {
                let [left, right] = views(index);
                let lower =
                    (0..WIDTH * HEIGHT).map(|i| right[(i / WIDTH).max(2) * WIDTH - 2 * WIDTH + i % WIDTH]).collect();
                [left, lower]
            }
        });
        for command in ["stereo left right -o o", "track left right --method stereo --n-components 4 -o t.csv"] {
            let summary = place.good(&format!("{command} --disparity-range -8,12 --json")).json();
            assert!((summary["row_offset"].as_f64().unwrap() - 2.0).abs() < 0.05, "{command}: {summary}");
        }
        for index in 1..4 {
            let file = format!("o/disparity_{index:06}.npz");
            assert!((median(&place, &file, DisparityFormat::Npz) - disparity(index) as f32).abs() < 0.1, "{file}");
        }
    }
    let place = recorded_as(1, |_| [vec![16; WIDTH * HEIGHT], vec![16; WIDTH * HEIGHT]]);
    let ended = place.good("stereo left right -o o");
    assert!(ended.err.contains("no pair shows enough to estimate the row offset"), "{}", ended.err);
}

/// The right view ten rows lower, which is farther than is searched.
#[test]
fn rows_beyond_those_that_are_searched_are_reported() {
    let lower = |index: usize| {
        let [left, right] = views(index);
        [left, (0..WIDTH * HEIGHT).map(|i| right[(i / WIDTH).max(10) * WIDTH - 10 * WIDTH + i % WIDTH]).collect()]
    };
    let place = recorded_as(2, lower);
    for command in [
        "stereo left right -o a",
        "stereo left right --method classes -o b",
        "track left right --method stereo -o t.csv",
    ] {
        let line = format!("{command} --disparity-range -8,12");
        let ended = place.good(&line);
        assert!(
            ended.err.contains("the views of 2 pairs agree poorly with every row offset"),
            "{command}: {}",
            ended.err
        );
        let summary = place.good(&format!("{line} --force --json")).json();
        assert_eq!(summary["rows_doubtful"].as_u64(), Some(2), "{summary}");
        let wide = place.good(&format!("{line} --force --row-range -12,12"));
        assert!(!wide.err.contains("agree poorly"), "{command}: {}", wide.err);
    }
}

#[test]
fn classes_give_whole_pixels_and_pictures_show_them() {
    let place = recorded(3);
    let line = "stereo left right --method classes --disparity-range -8,12 --start 1 --stop 2 -o d.pfm --picture p";
    let ended = place.good(line);
    assert!(ended.err.contains("1 pairs") && ended.out.is_empty(), "{}", ended.err);
    let map = DisparityFormat::Pfm.read(&place.path("d.pfm")).unwrap();
    assert!(map.disparity.data().iter().all(|d| d.is_nan() || d.fract() == 0.0));
    assert_eq!(median(&place, "d.pfm", DisparityFormat::Pfm), 4.0);
    assert_eq!(place.names("p"), ["stereo_000001.png"]);
    assert!(read_image(place.path("p/stereo_000001.png"), Colour::Error).is_err(), "disparities are colours");
    let picture = read_image(place.path("p/stereo_000001.png"), Colour::Luminance).unwrap();
    assert_eq!(picture.size(), (WIDTH, HEIGHT));
    let again = place.line(line);
    assert!(again.code == 2 && again.err.contains("--force"), "{}", again.err);
    place.good(&format!("{line} --force --threads 1"));
}

#[test]
fn semi_global_matching_gives_whole_pixels_when_asked() {
    let place = recorded(1);
    let fractions = |option: &str| {
        let line = format!("stereo left right --disparity-range -8,12 --row-offset 0 -o d.pfm --force {option}");
        place.good(&line);
        let map = DisparityFormat::Pfm.read(&place.path("d.pfm")).unwrap().disparity;
        let found = map.data().iter().filter(|d| d.is_finite());
        let (whole, all) = found.fold((0, 0), |(whole, all), d| (whole + usize::from(d.fract() == 0.0), all + 1));
        assert!(all > 300, "{option}: {all}");
        all - whole
    };
    assert_eq!((fractions("--no-subpixel"), fractions("--no-subpixel --no-left-right-check")), (0, 0));
    assert!(fractions("") > 300);
}

#[test]
fn an_interrupted_run_leaves_whole_files_only() {
    let place = Place::new();
    let line = "stereo - --layout top-bottom --disparity-range -8,12 -o out --format npz,pfm --json";
    let mut command = place.command(&line.split_whitespace().collect::<Vec<_>>());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&header(WIDTH, 2 * HEIGHT)).unwrap();
    for index in 0..2 {
        let [left, right] = views(index);
        pipe.write_all(&[b"FRAME\n".to_vec(), left, right].concat()).unwrap();
    }
    pipe.flush().unwrap();
    let start = Instant::now();
    while !(place.path("out/disparity_000001.npz").exists() && place.path("out/disparity_000001.pfm").exists()) {
        assert!(start.elapsed() < Duration::from_secs(60), "waited in vain for two pairs");
        std::thread::sleep(Duration::from_millis(10));
    }
    // The pipe stays open: the run waits for a pair when the signal comes.
    assert!(std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    drop(pipe);
    assert_eq!(output.status.code(), Some(130));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["interrupted"].as_bool(), Some(true));
    assert_eq!(place.names("out").len(), 4);
    assert!(temporary(&place.path("out")).is_empty());
    for index in 0..2 {
        let name = format!("out/disparity_{index:06}.npz");
        assert!((median(&place, &name, DisparityFormat::Npz) - disparity(index) as f32).abs() < 0.1, "{name}");
    }
}

#[test]
fn disparities_that_a_format_cannot_hold_are_reported() {
    let place = recorded(1);
    let ended = place.good("stereo right left --disparity-range -8,8 -o d.png --row-offset 0");
    assert!(ended.err.contains("do not fit the kitti format"), "{}", ended.err);
}

#[test]
fn mistakes_are_named_and_leave_nothing() {
    let place = recorded(2);
    fs::write(place.path("old.npz"), "mine").unwrap();
    fs::remove_file(place.path("right/1.pgm")).unwrap();
    let before = place.names(".");
    for (line, words) in [
        ("stereo", &["VIEW"][..]),
        ("stereo left -o o", &["input", "--layout"]),
        ("stereo left right --layout top-bottom -o o", &["input", "one input"]),
        ("stereo left right", &["output", "--picture"]),
        ("stereo left right -o o --method magic", &["method", "sgm"]),
        ("stereo left right -o o --disparity-range 3", &["--disparity-range"]),
        ("stereo left right -o o --disparity-range -4000,4000", &["disparity_range"]),
        ("stereo left right -o o --row-offset nan", &["row_offset"]),
        ("stereo left right -o o --threshold 0", &["threshold"]),
        ("stereo left right -o o --format flo", &["format", "npz"]),
        ("stereo left right -o d.flo", &["output", ".npz"]),
        ("stereo left right -o d.npz --format pfm", &["output", "folder"]),
        ("stereo left right -o old.npz", &["output", "--force"]),
        ("stereo left right -o o --threads 0", &["--threads"]),
        ("stereo left beside.y4m -o o.npz --stop 1", &["right", "(64, 96)", "(64, 192)"]),
    ] {
        let ended = place.line(line);
        assert_eq!(ended.code, 2, "{line}: {}", ended.err);
        for word in words {
            assert!(ended.err.contains(word), "{line}: no {word:?} in {}", ended.err);
        }
    }
    assert_eq!(place.names("."), before);
    assert_eq!(fs::read_to_string(place.path("old.npz")).unwrap(), "mine");
    let ended = place.line("stereo left right -o o");
    assert!(ended.code == 2 && ended.err.contains("fewer right than left"), "{}", ended.err);
    assert_eq!(place.line("stereo left nowhere -o o2").code, 1);
}
