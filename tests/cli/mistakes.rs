//! What goes wrong is told by name, early, with the documented exit code.

use super::support::Place;
use std::fs;

/// Runs a line that must fail: exit code, and words on standard error.
fn fails(place: &Place, line: &str, code: i32, words: &[&str]) {
    let ended = place.line(line);
    assert_eq!(ended.code, code, "{line}: {}", ended.err);
    assert!(ended.err.contains("error:"), "{line}: {}", ended.err);
    for word in words {
        assert!(ended.err.contains(word), "{line}: no {word:?} in {}", ended.err);
    }
    assert!(!ended.err.contains("panicked"), "{}", ended.err);
}

#[test]
fn unusable_arguments_are_named() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 4 --size 40x32");
    fs::write(place.path("small.png"), b"no picture").unwrap();
    for (line, words) in [
        ("flow", &["INPUT"][..]),
        ("flow s.npy --method best", &["method", "windowed"]),
        ("flow s.npy --method instantaneous --model quadratic", &["model", "affine"]),
        ("flow s.npy --method windowed --smoothness 1", &["smoothness"]),
        ("flow s.npy --rows many", &["rows"]),
        ("flow s.npy --time-scheme sideways", &["time_scheme"]),
        ("flow s.npy --temporal kalman", &["temporal", "recursive"]),
        ("flow s.npy --forgetting 0.9", &["forgetting"]),
        ("flow s.npy -o x/ --temporal recursive --forgetting 2", &["forgetting"]),
        ("flow s.npy -o x/ --temporal recursive --no-covariance", &["covariance"]),
        ("flow s.npy -o x/ --temporal recursive --method lucas-kanade", &["method", "affine"]),
        ("flow s.npy --window-sigma -1", &["--window-sigma"]),
        ("flow s.npy --neighbourhood 2x2", &["neighbourhood"]),
        ("flow s.npy --region 30,0,20,20", &["region", "40 x 32"]),
        ("flow s.npy --region 1,2,3", &["--region"]),
        ("flow s.npy --points 99,1", &["points", "(99, 1)"]),
        ("flow s.npy --points 1,-1", &["points"]),
        ("flow s.npy --points -1,1", &["points", "-1,1"]),
        ("flow s.npy --points 1,1 --stride 2", &["--stride"]),
        ("flow s.npy --step 0", &["--step"]),
        ("flow s.npy --threads 0", &["--threads"]),
        ("flow s.npy --simd mmx", &["simd"]),
        ("flow s.npy --smooth nan", &["--smooth"]),
        ("flow s.npy --fps 0", &["--fps"]),
        ("flow s.npy -o out --format gif", &["format", "npz"]),
        ("flow s.npy -o out --picture photo", &["picture", "curl"]),
        ("flow s.npy --picture curl", &["output"]),
        ("flow s.npy -o x/ --method lucas-kanade --picture curl", &["picture", "quiver"]),
        ("flow s.npy -o out.xyz", &["output", ".npz"]),
        ("flow s.npy -o one.npz", &["output", "folder"]),
        ("flow s.npy -o p --points 1,1 --format flo", &["format"]),
        ("flow s.npy --stop 1 -o one.npz", &["frames", "1"]),
        ("flow s.npy", &["output", "--json"]),
        ("filter s.npy", &["output", "--json"]),
        ("flow s.npy -o v1.2", &["output", "v1.2/"]),
        ("flow s.npy --start 9", &["input"]),
        ("measure s.npy --quantity rpm", &["fps"]),
        ("measure s.npy --quantity beauty", &["quantity", "divergence"]),
        ("measure s.npy --quantity vorticity", &["quantity", "did you mean \"curl\""]),
        ("measure s.npy --quantity curl --method horn-schunck", &["method"]),
        ("measure s.npy --quantity curl -o rows.txt", &["output", ".csv"]),
        ("measure s.npy --quantity curl --json", &["output"]),
        ("measure s.npy s.npy --quantity curl", &["input", "image files only", "s.npy"]),
        ("filter s.npy --profile mine", &["profile"]),
        ("filter s.npy --form square", &["form"]),
        ("filter s.npy --process-noise 1,2", &["--process-noise"]),
        ("synth nowhere -o x", &["scene", "ramp"]),
        ("synth affine -o x --set spin=1", &["spin"]),
        ("synth affine -o x.avi", &["output", ".y4m"]),
        ("synth affine -o v1.2", &["output", "v1.2/"]),
        ("synth affine -o x.npy --simd mmx", &["simd"]),
        ("demo -o v1.2", &["output", "v1.2/"]),
        ("synth affine -o x --depth float", &["output", ".npy"]),
        ("synth affine -o s.npy", &["output", "--force"]),
        ("frobnicate", &["frobnicate"]),
    ] {
        fails(&place, line, 2, words);
    }
    assert_eq!(place.names("."), ["s.npy", "small.png"], "mistakes leave nothing behind");
}

#[test]
fn broken_and_missing_files_are_named() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 4 --size 40x32");
    fs::write(place.path("bad.y4m"), b"YUV4MPEG2 W4 H4 F25:1 Cmono\nFRAME\n1234").unwrap();
    fs::write(place.path("bad.png"), b"no picture").unwrap();
    fs::write(place.path("bad.flo"), b"PIEH").unwrap();
    for (line, word) in [
        ("flow nowhere -o out1", "nowhere"),
        ("flow bad.y4m -o out2", "bad.y4m"),
        ("flow s.npy -o no/such/folder/x.csv", "no/such/folder"),
        ("flow s.npy --mask bad.png", "bad.png"),
        ("flow s.npy --points list.csv", "list.csv"),
        ("info bad.flo", "bad.flo"),
        ("info nowhere", "nowhere"),
        ("filter s.npy --resume nothing.npz", "nothing.npz"),
    ] {
        fails(&place, line, 1, &[word]);
    }
}

#[test]
fn a_resumed_filter_has_its_options() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 4 --size 40x32");
    for (option, name) in [
        ("--smooth 3", "smooth"),
        ("--quantise", "quantise"),
        ("--fps 50", "fps"),
        ("--profile patent", "profile"),
        ("--measurement-noise 2", "measurement_noise"),
    ] {
        let expected = format!("error: {name}: expected no such option with --resume");
        fails(&place, &format!("filter s.npy {option} --resume state.npz -o out"), 2, &[&expected]);
    }
}

#[test]
fn a_mask_of_another_size_and_frames_of_another_size_are_refused() {
    let place = Place::new();
    place.good("synth affine -o a --frames 3 --size 40x32");
    place.good("synth affine -o b --frames 1 --size 41x32");
    fails(&place, "flow a --mask b/frame_000000.png", 2, &["mask", "40 x 32", "41 x 32"]);
    let images = "a/frame_000000.png a/frame_000001.png b/frame_000000.png";
    let ended = place.line(&format!("flow {images} -o out"));
    assert!(ended.code != 0 && ended.err.contains("41"), "{}", ended.err);
    // Where no field was written, no folder stays; one that was there does.
    fs::create_dir(place.path("old")).unwrap();
    for folder in ["new/deep", "old"] {
        assert_ne!(place.line(&format!("flow b/frame_000000.png a/frame_000001.png -o {folder}")).code, 0);
    }
    assert!(!place.path("new").exists() && place.path("old").is_dir());
}

#[test]
fn colour_is_refused_with_the_way_out() {
    let place = Place::new();
    place.good("synth affine -o f --frames 3 --size 40x32");
    place.good("flow f -o out --picture colour");
    let image = "out/000001_colour.png";
    let ended = place.line(&format!("flow {image} {image} {image}"));
    assert!(ended.code != 0 && ended.err.contains("luminance"), "{}", ended.err);
    place.good(&format!("flow {image} {image} {image} --luminance --json"));
}

#[test]
fn video_without_ffmpeg_is_a_missing_program() {
    let place = Place::new();
    fs::write(place.path("sequence.mp4"), b"\0\0\0\x18ftypmp42").unwrap();
    let output = place.command(&["flow", "sequence.mp4", "-o", "out"]).env("PATH", "").output().unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{words}");
    assert!(words.contains("ffmpeg"), "{words}");
}

#[test]
fn json_of_a_failure_is_one_object_too() {
    let place = Place::new();
    let ended = place.line("flow nowhere --json");
    let object = ended.json();
    assert_eq!((ended.code, object["exit_code"].as_i64()), (1, Some(1)));
    assert!(object["error"].as_str().unwrap().contains("nowhere"));
}

#[test]
fn quiet_runs_say_nothing() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 3 --size 40x32 --quiet");
    let ended = place.good("flow s.npy -o out --quiet");
    assert_eq!((ended.out.as_str(), ended.err.as_str()), ("", ""));
    let told = place.good("flow s.npy -o out2");
    assert!(told.out.is_empty() && told.err.contains("1 fields"));
}

#[test]
fn a_useless_environment_is_named_unless_an_option_overrides_it() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 3 --size 40x32");
    for (variable, value) in [("THREADS", "abc"), ("THREADS", "0"), ("THREADS", "-1"), ("SIMD", "abc")] {
        let variable = format!("JACOFLOW_{variable}");
        let run =
            |line: &str| place.command(&line.split(' ').collect::<Vec<_>>()).env(&variable, value).output().unwrap();
        for line in [
            "flow s.npy -o out",
            "filter s.npy -o out",
            "measure s.npy --quantity curl -o out.csv",
            "synth affine -o out",
            "demo -o out",
        ] {
            let output = run(line);
            let words = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{line} {variable}={value}: {words}");
            assert!(words.contains(&format!("error: {variable}: expected")) && words.contains(value), "{words}");
        }
        assert_eq!(place.names("."), ["s.npy"]);
        assert!(run("flow s.npy --json --threads 1 --simd scalar").status.success());
    }
    for variable in ["JACOFLOW_THREADS", "JACOFLOW_SIMD"] {
        let output = place.command(&["flow", "s.npy", "--json"]).env(variable, "").output().unwrap();
        assert!(output.status.success(), "an empty {variable} is as good as none");
    }
}

#[test]
fn files_are_named_as_they_were_asked_for() {
    let place = Place::new();
    let refused = place.line("synth affine -o z.bmp");
    assert!(refused.code == 2 && refused.err.starts_with("error: output"), "{}", refused.err);
    place.good("synth affine -o frames.v1/ --frames 5 --size 40x32");
    place.good("flow frames.v1 -o flow.v1/ --stop 3");
    assert_eq!(place.names("flow.v1"), ["000001.npz"]);
    let again = place.line("synth affine -o frames.v1/ --frames 5 --size 40x32");
    assert!(again.code == 2 && again.err.contains("--force"), "{}", again.err);
    // A stream does not tell beforehand how many fields will come.
    place.good("synth affine -o s.y4m --frames 5 --size 40x32");
    let stream = fs::read(place.path("s.y4m")).unwrap();
    for (output, name) in [("one.npz", "one.npz"), ("one.csv --picture curl", "one_curl.png")] {
        let ended = place.fed(&format!("flow - -o {output}"), &stream);
        assert!(ended.code == 2 && ended.err.contains(&format!("the file {name} ")), "{}", ended.err);
    }
}

#[test]
fn what_is_read_is_never_replaced() {
    let place = Place::new();
    place.good("synth affine -o left --frames 2 --size 40x32");
    let picture = place.path("a.png");
    fs::copy(place.path("left/frame_000000.png"), &picture).unwrap();
    let whole = fs::read(&picture).unwrap();
    for line in [
        "flow a.png a.png -o a.png --force",
        "flow a.png a.png -o . --force --format kitti",
        "filter left -o left --force",
        "stereo a.png a.png -o a.png --force",
        "stereo left/*.png left -o left/ --force",
        "flow left/*.png -o left --force",
        "egomotion left --intrinsics 40,40,20,16 -o left/frame_000000.png --force",
    ] {
        let ended = place.line(line);
        assert!(ended.code != 0 && ended.err.contains("output: expected"), "{line}: {}", ended.err);
    }
    assert_eq!(fs::read(&picture).unwrap(), whole);
    assert_eq!(place.names("left"), ["frame_000000.png", "frame_000001.png"]);
}

#[test]
fn no_file_that_a_command_reads_is_written_by_any_option() {
    let place = Place::new();
    place.good("synth affine -o in --frames 3 --size 40x32");
    place.good("synth affine -o s.npy --frames 3 --size 40x32");
    place.good("flow s.npy -o i.flo");
    place.good("filter s.npy -o - --points 9,9 --save-state state.npz");
    fs::create_dir(place.path("out")).unwrap();
    for (copy, original) in [("m.png", "in/frame_000000.png"), ("out/000001.flo", "i.flo"), ("m_colour.png", "m.png")] {
        fs::copy(place.path(original), place.path(copy)).unwrap();
    }
    fs::write(place.path("l.txt"), "in/frame_000000.png\nin/../in/frame_000001.png\nin/frame_000002.png\n").unwrap();
    fs::write(place.path("p.csv"), "x,y\n9,9\n").unwrap();
    fs::write(place.path("k.csv"), "40 0 20\n0 40 16\n0 0 1\n").unwrap();
    fs::write(place.path("boxes.txt"), "1,1,5,5,9,9,1,-1,-1,-1\n").unwrap();
    let files = ["s.npy", "i.flo", "m.png", "l.txt", "p.csv", "k.csv", "boxes.txt", "state.npz", "m_colour.png"];
    let read = || -> Vec<Vec<u8>> {
        let others = ["in/frame_000000.png", "in/frame_000001.png", "out/000001.flo"];
        files.iter().chain(&others).map(|name| fs::read(place.path(name)).unwrap()).collect()
    };
    let before = read();
    for (line, option) in [
        ("filter s.npy --points 9,9 -o q.csv --save-state s.npy", "save_state"),
        ("filter s.npy --resume state.npz -o ./state.npz --stop 1", "output"),
        ("filter s.npy --points p.csv -o q.csv --save-state p.csv", "save_state"),
        ("flow l.txt -o in/frame_000001.png", "output"),
        ("flow in -o in/frame_000001.png", "output"),
        ("flow l.txt -o in", "output"),
        ("flow in --mask m.png -o m.png", "output"),
        ("flow in --mask m_colour.png -o m.npz --picture colour", "output"),
        ("flow in --initial i.flo -o out/../i.flo", "output"),
        ("flow in --initial out/000001.flo -o out --format flo", "output"),
        ("flow in --points p.csv -o p.csv", "output"),
        ("measure in --quantity curl --points p.csv -o p.csv", "output"),
        ("egomotion in --intrinsics k.csv -o k.csv", "output"),
        ("egomotion in --intrinsics k.csv -o q.csv --alternatives k.csv", "alternatives"),
        ("track in --method particle --boxes boxes.txt -o boxes.txt", "output"),
        ("track in --method particle --boxes boxes.txt --mot boxes.txt", "mot"),
    ] {
        let line = format!("{line} --force");
        fails(&place, &line, 2, &[&format!("error: {option}: expected another place than the input")]);
    }
    assert!(before == read());
    assert!(!place.path("q.csv").exists());
    // The state alone may be replaced by its successor, and what is read may lie beside results.
    place.good("filter s.npy --resume state.npz -o - --save-state ./state.npz");
    fs::rename(place.path("m.png"), place.path("out/m.png")).unwrap();
    place.good("flow in --mask out/m.png --initial out/000001.flo -o out --force");
}

#[test]
fn no_file_is_written_by_two_options() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 3 --size 40x32");
    let files = place.names(".");
    for (line, option) in [
        ("filter s.npy --points 5,5 -o x.csv --save-state x.csv", "save_state"),
        ("filter s.npy --points 5,5 -o x/ --save-state ./x/points.csv", "save_state"),
        ("filter s.npy -o x/ --save-state x/000001.npz", "save_state"),
        ("filter s.npy -o x/ --save-state x/points.csv", "save_state"),
        ("egomotion s.npy --intrinsics 40,40,20,16 -o x.csv --alternatives ./x.csv", "alternatives"),
        ("track s.npy --method particle --bbox 5,5,9,9 --mot x --csv ./x", "csv"),
        ("track s.npy --method particle --bbox 5,5,9,9 -o x/ --csv x/tracks.csv", "csv"),
        ("track s.npy --bbox 5,5,9,9 -o x/ --overlay x/tracks.csv", "overlay"),
        ("track s.npy --method particle --bbox 5,5,9,9 --overlay x.y4m --foreground x.y4m", "foreground"),
        ("synth cars_handheld -o x.npy --boxes x.npy", "boxes"),
    ] {
        fails(&place, line, 2, &[&format!("error: {option}: expected a")]);
    }
    assert_eq!(place.names("."), files);
    // Files of different names may lie in one folder.
    place.good("filter s.npy -o x/ --save-state x/state.npz");
}

#[test]
fn scenes_without_end_are_refused() {
    let place = Place::new();
    fails(&place, "synth waves -o w --set speed=1e6", 2, &["speed: expected at most 16 wavelengths a frame"]);
    let line = "synth turbulence -o w --size 8x8 --frames 30000";
    fails(&place, line, 2, &["frames: expected a time in frames, within 25000 of 0, got 29999"]);
    assert!(!place.path("w").exists());
}

#[test]
fn a_place_that_is_taken_is_named_by_its_option() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 3 --size 40x32 --truth truth");
    place.good("filter s.npy -o out/ --save-state state.npz");
    fs::write(place.path("boxes.txt"), "").unwrap();
    for (line, option) in [
        ("synth affine -o t --size 40x32 --truth truth", "truth"),
        ("synth cars_handheld -o t --boxes boxes.txt", "boxes"),
        ("filter s.npy -o t/ --save-state state.npz", "save_state"),
        ("stereo s.npy s.npy -o t --picture truth", "picture"),
    ] {
        fails(&place, line, 2, &[&format!("error: {option}: expected a"), "--force"]);
        assert!(!place.path("t").exists(), "{line}");
    }
}

#[test]
fn points_go_into_one_file_and_states_into_a_new_folder() {
    let place = Place::new();
    place.good("synth affine -o s.npy --frames 3 --size 40x32");
    place.good("flow s.npy -o x.npz --points 5,5 --time-scheme central");
    assert!(place.good("info x.npz").out.contains("width"));
    place.good("filter s.npy -o new/ --save-state new/s.npz");
    assert!(place.names("new").contains(&"s.npz".into()));
}
