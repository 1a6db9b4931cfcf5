//! Every subcommand on synthetic input.

use super::support::{Place, temporary};
use jacoflow::io::{read_flo, read_npz};
use std::fs;

#[test]
fn version_and_help_go_to_standard_output() {
    let place = Place::new();
    let version = place.good("--version");
    assert_eq!(version.out.trim(), concat!("jacoflow ", env!("CARGO_PKG_VERSION")));
    for command in ["flow", "filter", "measure", "track", "synth", "info", "demo"] {
        let help = place.good(&format!("{command} --help"));
        assert!(help.out.contains("Example") && help.out.contains("--json"), "{command}");
    }
}

#[test]
fn a_folder_of_frames_becomes_a_folder_of_fields_and_pictures() {
    let place = Place::new();
    place.good("synth affine -o frames --frames 5 --size 72x60 --truth truth");
    let formats = "--format npz,flo,kitti,pfm,csv --picture colour,quiver,divergence,curl";
    let ended = place.good(&format!("flow frames -o out --json {formats}"));
    let summary = ended.json();
    assert_eq!((summary["frames"].as_u64(), summary["fields"].as_u64()), (Some(5), Some(3)));
    assert_eq!(summary["files"].as_u64(), Some(3 * 8 + 1));
    assert!(summary["valid_share"].as_f64().unwrap() > 0.9);
    for index in 1..=3 {
        for ending in [".npz", ".flo", ".png", ".pfm", "_colour.png", "_quiver.png", "_divergence.png", "_curl.png"] {
            assert!(place.path(&format!("out/{index:06}{ending}")).is_file(), "{index}{ending}");
        }
    }
    assert!(temporary(&place.path("out")).is_empty());
    let got = read_npz::<f64>(place.path("out/000002.npz")).unwrap().field;
    let want = read_npz::<f64>(place.path("truth/000002.npz")).unwrap().field;
    assert_eq!(got.layout.frame_index, 2);
    let middle = 30 * 72 + 36;
    let (got, want) = (got.affine(middle).to_array(), want.affine(middle).to_array());
    for k in 0..6 {
        let tolerance = if k < 2 { 0.05 } else { 0.02 };
        assert!((got[k] - want[k]).abs() < tolerance, "{k}: {} {}", got[k], want[k]);
    }
    let rows = fs::read_to_string(place.path("out/points.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 3 * 72 * 60);
}

#[test]
fn three_images_become_one_file() {
    let place = Place::new();
    place.good("synth affine -o f --frames 3 --size 48x40");
    let images = "f/frame_000000.png f/frame_000001.png f/frame_000002.png";
    place.good(&format!("flow {images} -o flow.flo --picture colour"));
    assert_eq!(
        (read_flo(place.path("flow.flo")).unwrap().width(), place.path("flow_colour.png").is_file()),
        (48, true)
    );
    let again = place.line(&format!("flow {images} -o flow.flo"));
    assert!(again.code == 2 && again.err.contains("output") && again.err.contains("--force"), "{}", again.err);
    place.good(&format!("flow {images} -o flow.flo --force"));
}

#[test]
fn points_and_regions_agree_with_the_whole() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 3 --size 64x48 --depth float");
    place.good("flow s.npy -o whole.npz");
    place.good("flow s.npy -o part.npz --region 20,10,21,15 --stride 2");
    let points = place.good("flow s.npy --points 30,20 --points 24,16");
    let whole = read_npz::<f64>(place.path("whole.npz")).unwrap().field;
    let part = read_npz::<f64>(place.path("part.npz")).unwrap().field;
    assert_eq!((part.width, part.height), (11, 8));
    let (row, col) = (5, 5);
    assert_eq!(part.affine(row * 11 + col), whole.affine((10 + 2 * row) * 64 + 20 + 2 * col));
    let lines: Vec<&str> = points.out.lines().collect();
    assert!(lines[0].starts_with("frame,time_s,x,y,status,u,v") && lines[0].contains("std_u"));
    let cells: Vec<&str> = lines[1].split(',').collect();
    assert_eq!(cells[..5], ["1", "", "30", "20", "ok"]);
    assert_eq!(cells[5].parse::<f64>().unwrap(), whole.affine(20 * 64 + 30).u);
}

#[test]
fn rows_of_fields_have_the_time_of_their_frame() {
    let place = Place::new();
    place.good("synth affine -o s.y4m --frames 6 --size 40x32 --rate 25");
    place.good("synth affine -o s.npy --frames 6 --size 40x32");
    let times = |line: &str| -> Vec<String> {
        let rows = place.good(line).out;
        rows.lines().skip(1).map(|row| row.split(',').take(2).collect::<Vec<_>>().join(" ")).collect()
    };
    assert_eq!(times("flow s.y4m --points 20,20 --start 1"), ["2 0.08", "3 0.12", "4 0.16"]);
    assert_eq!(times("flow s.y4m --points 20,20 --fps 10 --stop 3"), ["1 0.1"]);
    assert_eq!(times("filter s.y4m --points 20,20 --stop 2"), ["0 0", "1 0.04"]);
    assert_eq!(times("filter s.npy --points 20,20 --stop 1"), ["0 "]);
}

#[test]
fn frames_are_numbered_as_in_the_input() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 12 --size 40x40 --set u=0.05 --set v=0");
    place.good("flow s.npy -o out --start 2 --step 3 --stop 11 --stride 8");
    assert_eq!(place.names("out"), ["000005.npz"]);
    let field = read_npz::<f64>(place.path("out/000005.npz")).unwrap().field;
    assert_eq!(field.layout.frame_index, 5);
}

#[test]
fn a_shorter_run_leaves_nothing_of_a_longer_one() {
    let place = Place::new();
    place.good("synth affine -o five.npy --frames 5 --size 40x32");
    place.good("synth affine -o three.npy --frames 3 --size 40x32");
    for (command, five, three) in [
        ("flow INPUT --picture colour -o out/", 6, vec!["000001.npz", "000001_colour.png"]),
        ("filter INPUT --format flo -o filtered", 5, vec!["000000.flo", "000001.flo", "000002.flo"]),
        ("stereo INPUT INPUT -o pairs", 5, (0..3).map(|_| "disparity_00000").collect()),
    ] {
        let folder = command.split(' ').next_back().unwrap();
        place.good(&command.replace("INPUT", "five.npy"));
        assert_eq!(place.names(folder).len(), five, "{command}");
        fs::write(place.path(folder).join("000004_notes.png"), "mine").unwrap();
        place.good(&format!("{} --force", command.replace("INPUT", "three.npy")));
        let mut left = place.names(folder);
        left.retain(|name| name != "000004_notes.png");
        assert_eq!(left.len(), three.len(), "{left:?}");
        assert!(left.iter().zip(&three).all(|(name, expected)| name.starts_with(expected)), "{left:?}");
        assert!(place.path(folder).join("000004_notes.png").exists(), "{command}");
    }
    place.good("synth affine -o scene --frames 5 --size 40x32 --truth truth");
    place.good("synth affine -o scene --frames 2 --size 40x32 --truth truth --force");
    assert_eq!((place.names("scene").len(), place.names("truth").len()), (2, 2));
    // A folder may be continued: what was found for frames before --start stays.
    place.good("filter five.npy -o on --stop 2 --save-state state.npz");
    place.good("filter five.npy -o on --start 2 --resume state.npz --force");
    assert_eq!(place.names("on").len(), 5);
    place.good("filter five.npy -o on --start 2 --stop 4 --resume state.npz --force");
    assert_eq!(place.names("on"), ["000000.npz", "000001.npz", "000002.npz", "000003.npz"]);
    // A run that fails removes nothing.
    assert_ne!(place.line("flow five.npy -o on --start 1 --stop 2 --force").code, 0);
    assert_eq!(place.names("on").len(), 4);
}

#[test]
fn rpm_of_a_disc_is_measured_within_its_deviation() {
    let place = Place::new();
    place.good("synth disc -o disc.y4m --frames 8 --size 128x128 --rate 60 --set rpm=10 --set fps=60 --noise 1");
    let ended = place.good("measure disc.y4m --quantity rpm,rotation_centre_x,divergence --region 44,44,40,40");
    let mut lines = ended.out.lines();
    assert_eq!(lines.next(), Some("frame,time_s,x,y,quantity,value,std,unit,share,valid_share,status"));
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 6 * 3);
    for row in &rows {
        let (value, std): (f64, f64) = (row[5].parse().unwrap(), row[6].parse().unwrap());
        let (truth, allowance, unit) = match row[4] {
            "rpm" => (10.0, 0.1, "rpm"),
            "rotation_centre_x" => (63.5, 0.3, "px"),
            _ => (0.0, 0.2, "1/s"),
        };
        assert!(std > 0.0 && (value - truth).abs() < 4.0 * std + allowance, "{row:?}");
        assert_eq!((row[7], row[9], row[10]), (unit, "1", "ok"));
        assert!(row[8].parse::<f64>().unwrap() > 0.95, "{row:?}");
    }
    assert!((rows[0][1].parse::<f64>().unwrap() - 1.0 / 60.0).abs() < 1e-9);
}

#[test]
fn time_to_contact_counts_down() {
    let place = Place::new();
    place.good("synth plane -o p.npy --frames 12 --size 96x96 --set time_to_contact=50");
    place.good("measure p.npy --quantity time-to-contact --region 20,20,56,56 -o ttc.csv");
    let text = fs::read_to_string(place.path("ttc.csv")).unwrap();
    for (row, line) in text.lines().skip(1).enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        let truth = 50.0 - (row + 1) as f64;
        let value: f64 = cells[5].parse().unwrap();
        let std: f64 = cells[6].parse().unwrap();
        assert!((value - truth).abs() < 4.0 * std && std < 0.02 * truth && cells[7] == "frame", "{line}");
    }
}

#[test]
fn regions_of_every_kind_are_measured() {
    let place = Place::new();
    place.good("synth disc -o disc.y4m --frames 3 --size 128x128 --rate 60 --set rpm=10 --set fps=60 --set disc_radius=40 --noise 1");
    for (region, least) in [
        ("--region 44,44,40,40", 0.95),
        ("--disc 63.5,63.5,25", 0.95),
        ("--polygon 44,44,84,44,84,84,44,84", 0.95),
        ("--at 64,64", 0.1),
    ] {
        let ended = place.good(&format!("measure disc.y4m --quantity rpm {region}"));
        let row: Vec<&str> = ended.out.lines().nth(1).unwrap().split(',').collect();
        let (value, std, share): (f64, f64, f64) =
            (row[5].parse().unwrap(), row[6].parse().unwrap(), row[8].parse().unwrap());
        assert!((value - 10.0).abs() < 4.0 * std + 0.1 && share > least && row[10] == "ok", "{region}: {row:?}");
    }
    for (wrong, words) in [
        ("--disc 1,2", "X,Y,RADIUS"),
        ("--polygon 1,2,3,4", "three corners"),
        ("--at 500,3", "at: expected a pixel"),
        ("--disc 9,9,3 --points 4,4", "cannot be used with"),
    ] {
        let ended = place.line(&format!("measure disc.y4m --quantity rpm {wrong}"));
        assert!(ended.code != 0 && ended.err.contains(words), "{wrong}: {}", ended.err);
    }
}

#[test]
fn double_frames_give_a_field_a_pair() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 4 --size 48x40");
    place.good("flow s.npy -o out --pairs");
    assert_eq!(place.names("out"), ["000000.npz", "000002.npz"]);
    let odd = place.line("flow s.npy -o other --pairs --stop 3");
    assert!(odd.code != 0 && odd.err.contains("frames: expected an even number"), "{}", odd.err);
    let triple = place.line("flow s.npy -o other --pairs --method instantaneous");
    assert!(
        triple.code != 0 && triple.err.contains("pairs: expected a method that takes two frames"),
        "{}",
        triple.err
    );
}

#[test]
fn double_frames_may_lie_in_two_inputs() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 8 --size 64x48 --set u=1.5 --set v=-0.5");
    place.good("synth affine -o s --frames 8 --size 64x48 --set u=1.5 --set v=-0.5");
    let whole = place.good("measure s.npy --pairs --quantity u,v").out;
    for (folder, shift) in [("A", 0), ("B", 1)] {
        fs::create_dir(place.path(folder)).unwrap();
        for pair in 0..4 {
            let frame = place.path(&format!("s/frame_{:06}.png", 2 * pair + shift));
            fs::copy(frame, place.path(&format!("{folder}/{pair}.png"))).unwrap();
        }
        place.good(&format!("synth affine -o {folder}.npy --frames 8 --size 64x48"));
        place.good(&format!("synth affine -o {folder}.y4m --frames 8 --size 64x48 --rate 15"));
    }
    // Frame n of the first input is followed by frame n of the second, in folders, patterns and single files.
    let line = |input: &str| place.good(&format!("measure {input} --pairs --quantity u,v")).out;
    assert_eq!(line("A B"), whole);
    assert_eq!(line("A/*.png B/*.png"), whole);
    assert_eq!(whole.lines().count(), 1 + 4 * 2);
    let first: Vec<&str> = whole.lines().take(3).collect();
    assert_eq!(line("A/0.png B/0.png").lines().collect::<Vec<_>>(), first);
    let value: f64 = first[1].split(',').nth(5).unwrap().parse().unwrap();
    assert!((value - 1.5).abs() < 0.05, "{}", first[1]);
    // Two stacks; the frames are counted as if they lay in one.
    place.good("flow A.npy B.npy --pairs --start 2 --stop 6 -o out");
    assert_eq!(place.names("out"), ["000002.npz", "000004.npz"]);
    for chosen in ["--start 1", "--step 2"] {
        let refused = place.line(&format!("flow A.npy B.npy --pairs {chosen} -o other"));
        assert!(
            refused.code == 2 && refused.err.contains("an even start and step 1 with two inputs"),
            "{}",
            refused.err
        );
    }
    // The rate of the files counts pairs, and says nothing of the time within them.
    let rate = place.good("flow A.y4m B.y4m --pairs --json");
    assert_eq!((&rate.json()["fps"], rate.json()["fields"].as_u64()), (&serde_json::Value::Null, Some(8)));
    // Every other way of giving several inputs is the order given.
    let ordered = line("A/0.png A/1.png B/0.png B/1.png");
    assert!((ordered.lines().nth(1).unwrap().split(',').nth(5).unwrap().parse::<f64>().unwrap() - 3.0).abs() < 0.1);
    fs::remove_file(place.path("B/3.png")).unwrap();
    let fewer = place.line("measure A B --pairs --quantity u");
    assert_eq!(fewer.code, 2);
    assert!(fewer.err.contains("input: expected as many frames in both inputs"), "{}", fewer.err);
    assert!(fewer.err.contains("got 4 in 4 images, A/0.png to A/3.png and 3 in 3 images"), "{}", fewer.err);
    let without = place.line("measure A B --quantity u");
    assert!(without.code == 2 && without.err.contains("with --pairs"), "{}", without.err);
}

#[test]
fn fields_of_a_known_rate_and_pitch_are_in_those_units() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 3 --size 48x40");
    place.good("flow s.npy -o px.npz");
    place.good("flow s.npy -o mm.npz --fps 50 --pixel-pitch 0.02 --length-unit mm");
    let read = |name: &str| read_npz::<f64>(place.path(name)).unwrap().field;
    let (px, mm) = (read("px.npz"), read("mm.npz"));
    assert_eq!(mm.layout.units.of_parameter("u"), "mm/s");
    let site = 20 * 48 + 24;
    assert!((mm.affine(site).u / px.affine(site).u - 1.0).abs() < 1e-5, "{} {}", mm.affine(site).u, px.affine(site).u);
    assert!((mm.affine(site).u_x / px.affine(site).u_x / 50.0 - 1.0).abs() < 1e-5);
    let info = place.good("info mm.npz --json").json();
    assert_eq!(info["units"]["v_y"], "1/s");
}

#[test]
fn the_filter_follows_the_ramp_and_goes_on_from_its_state() {
    let place = Place::new();
    place.good("synth ramp -o ramp.npy --frames 60 --size 24x20 --origin 48,70 --rounding floor");
    let filter = "filter ramp.npy --profile measured --form fast --neighbourhood 9x9";
    place.good(&format!("{filter} -o whole --stop 60"));
    place.good(&format!("{filter} -o first --stop 25 --save-state state.npz"));
    place.good("filter ramp.npy -o second --start 25 --resume state.npz");
    assert_eq!((place.names("first").len(), place.names("second").len()), (25, 35));
    for index in 25..60 {
        let name = format!("{index:06}.npz");
        let (a, b) = (place.path("whole").join(&name), place.path("second").join(&name));
        let (a, b) = (read_npz::<f64>(a).unwrap().field, read_npz::<f64>(b).unwrap().field);
        assert_eq!((bits(&a.motion), a.status, a.layout), (bits(&b.motion), b.status, b.layout), "{index}");
    }
    let last = read_npz::<f64>(place.path("whole/000059.npz")).unwrap().field;
    let got = last.affine(10 * 24 + 12);
    assert!(got.u.is_finite() && (got.v_x - 0.0314).abs() < 0.02, "{got:?}");
    // What is done to the frames first goes with the state.
    let smoothed = "filter ramp.npy --smooth 1 --quantise=2";
    place.good(&format!("{smoothed} -o smooth --stop 6"));
    place.good(&format!("{smoothed} -o start --stop 3 --save-state smooth.npz"));
    place.good("filter ramp.npy -o rest --start 3 --stop 6 --resume smooth.npz");
    for index in 3..6 {
        let [a, b] = ["smooth", "rest"]
            .map(|folder| read_npz::<f64>(place.path(&format!("{folder}/{index:06}.npz"))).unwrap().field);
        assert_eq!(bits(&a.motion), bits(&b.motion), "{index}");
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 4 --size 70x61 --noise 1");
    for threads in [1, 2] {
        let smooth = "--smooth 1 --picture colour,curl --format npz,flo";
        place.good(&format!("flow s.npy -o out{threads} --threads {threads} {smooth}"));
        place.good(&format!("filter s.npy -o filtered{threads} --threads {threads} --stop 2"));
    }
    for folder in ["out", "filtered"] {
        let (one, two) = (format!("{folder}1"), format!("{folder}2"));
        assert_eq!(place.names(&one), place.names(&two));
        for name in place.names(&one) {
            let bytes = |folder: &str| fs::read(place.path(folder).join(&name)).unwrap();
            assert!(bytes(&one) == bytes(&two), "{folder}/{name}");
        }
    }
}

#[test]
fn synth_writes_every_kind_of_recording() {
    let place = Place::new();
    let list = place.good("synth --list");
    assert!(list.out.contains("ramp") && list.out.contains("vortex") && list.out.contains("particles"));
    assert!(place.good("synth --list --json").json()["scenes"].as_array().unwrap().len() >= 6);
    place.good("synth vortex -o v16 --frames 2 --size 30x20 --depth 16 --truth t --truth-format npz,flo");
    assert_eq!(place.names("t"), ["000000.flo", "000000.npz", "000001.flo", "000001.npz"]);
    place.good("synth vortex -o v.npy --frames 2 --size 30x20 --depth float");
    place.good("synth vortex -o v.y4m --frames 2 --size 30x20 --rate 30000/1001 --random-state 4 --noise 3");
    for (input, dtype) in [("v16", "uint16"), ("v.npy", "float64"), ("v.y4m", "uint8")] {
        let info = place.good(&format!("info {input} --json")).json();
        assert_eq!((info["frames"].as_u64(), info["dtype"].as_str()), (Some(2), Some(dtype)), "{input}");
        assert_eq!((info["width"].as_u64(), info["height"].as_u64()), (Some(30), Some(20)));
    }
    assert!(place.good("info v.y4m").out.contains("29.97"));
    let stream = place.command(&["synth", "ramp", "-o", "-", "--frames", "1", "--size", "8x8"]).output().unwrap();
    assert!(stream.status.success() && stream.stdout.starts_with(b"YUV4MPEG2 W8 H8"));
}

#[test]
fn synth_records_scenes_of_targets_with_their_boxes() {
    let place = Place::new();
    assert!(place.good("synth --list").out.contains("meet_and_return"));
    let summary =
        place.good("synth cars_handheld -o c.npy --boxes c.txt --frames 3 --scale 0.2 --random-state 4 --json").json();
    assert_eq!((summary["frames"].as_u64(), summary["targets"].as_u64()), (Some(3), Some(2)));
    place.good("synth cars_handheld -o c.y4m --frames 2 --scale 0.2");
    place.good("synth cars_handheld -o folder --frames 2 --scale 0.2");
    assert_eq!(place.names("folder").len(), 2);
    let boxes = jacoflow::io::read_mot(place.path("c.txt")).unwrap();
    assert_eq!(
        boxes.iter().map(|each| (each.frame, each.target)).collect::<Vec<_>>(),
        [(0, 1), (0, 2), (1, 1), (1, 2), (2, 1), (2, 2)]
    );
    assert!(boxes.iter().all(|each| (each.bounds.width / each.bounds.height - 76.0 / 42.0).abs() < 1e-2));
    for wrong in
        ["cars_handheld -o d.npy --set u=1", "affine -o d.npy --boxes d.txt", "cars_handheld -o c.npy --frames 1"]
    {
        assert_eq!(place.line(&format!("synth {wrong}")).code, 2, "{wrong}");
    }
}

#[test]
fn info_reads_results() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 3 --size 40x32");
    for name in ["a.npz", "a.flo", "a.pfm", "a.png"] {
        place.good(&format!("flow s.npy -o {name}"));
        let info = place.good(&format!("info {name} --json")).json();
        assert_eq!((info["kind"].as_str(), info["width"].as_u64()), (Some("result"), Some(40)), "{name}");
        let mean = info["planes"]["u"]["mean"].as_f64().unwrap();
        assert!((mean - 0.3).abs() < 0.1, "{name}: {mean}");
        assert!(place.good(&format!("info {name}")).out.contains("mean"));
    }
    place.good("flow s.npy -o rates.npz --fps 50");
    assert!(place.good("info rates.npz").out.lines().any(|line| line.starts_with("u_x") && line.ends_with(" 1/s")));
    place.good("filter s.npy -o fields --form fast --save-state state.npz");
    let info = place.good("info state.npz --json").json();
    assert_eq!((info["kind"].as_str(), info["frames"].as_u64()), (Some("filter state"), Some(3)));
    assert_eq!((info["form"].as_str(), info["width"].as_u64()), (Some("fast"), Some(40)));
    assert!(place.good("info state.npz").out.contains("filter state"));
}

#[test]
fn the_demo_measures_its_scene() {
    let place = Place::new();
    let ended = place.good("demo -o demo --json");
    let summary = ended.json();
    assert!(summary["flow_rms_error"].as_f64().unwrap() < 0.1, "{summary}");
    assert!(summary["jacobian_rms_error"].as_f64().unwrap() < 0.02, "{summary}");
    assert!(place.path("demo/frames/frame_000000.png").is_file());
    assert!(place.path("demo/flow/000001_curl.png").is_file());
    // Its own results it replaces, anybody else's it does not touch.
    fs::write(place.path("demo/flow/000001_curl.png"), b"old").unwrap();
    place.good("demo -o demo --quiet");
    assert!(fs::read(place.path("demo/flow/000001_curl.png")).unwrap().len() > 3);
    for (mine, words) in
        [("demo/flow/000009.npz", "mine"), ("demo/notes.txt", "mine"), ("other/frames/frame_000000.png", "")]
    {
        let mine = place.path(mine);
        fs::create_dir_all(mine.parent().unwrap()).unwrap();
        fs::write(&mine, words).unwrap();
        let folder = if words.is_empty() { "other" } else { "demo" };
        let refused = place.line(&format!("demo -o {folder}"));
        assert!(refused.code == 2 && refused.err.contains("--force"), "{mine:?}: {}", refused.err);
        assert_eq!(fs::read_to_string(&mine).unwrap(), words);
        fs::remove_file(mine).unwrap();
    }
}

#[test]
fn a_pair_is_enough_for_a_field() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 2 --size 48x40");
    for method in ["windowed", "lucas-kanade", "horn-schunck"] {
        place.good(&format!("flow s.npy -o {method}.npz --method {method}"));
        let field = read_npz::<f64>(place.path(&format!("{method}.npz"))).unwrap().field;
        assert!((field.affine(20 * 48 + 24).u - 0.3).abs() < 0.1, "{method}");
    }
}

#[test]
fn estimates_are_fused_over_time_on_request() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 9 --size 48x40 --noise 3");
    place.good("flow s.npy -o plain --stride 4");
    place.good("flow s.npy -o fused --stride 4 --temporal recursive");
    let read = |name: &str| read_npz::<f64>(place.path(name)).unwrap().field;
    assert_eq!(read("plain/000001.npz").motion[65], read("fused/000001.npz").motion[65]);
    let (plain, fused) = (read("plain/000007.npz"), read("fused/000007.npz"));
    let deviation = |field: &jacoflow::types::FlowField<f64>| {
        let deviations = field.standard_deviation("u").unwrap();
        deviations.iter().sum::<f64>() / deviations.len() as f64
    };
    assert!(deviation(&fused) < 0.87 * deviation(&plain), "{} {}", deviation(&fused), deviation(&plain));
    let rows = |more: &str| {
        let ended = place.good(&format!("measure s.npy --quantity curl --region 12,12,16,16 {more}"));
        ended.out.lines().last().unwrap().split(',').nth(6).unwrap().parse::<f64>().unwrap()
    };
    assert!(rows("--temporal recursive --forgetting 1") < rows(""));
}
