//! `egomotion`: from frames to a table and pictures.

use super::support::{Place, names, temporary};
use image::{GrayImage, Luma};

/// Growth of the picture from one frame to the next: the plane comes nearer by 1/1.02 of its distance.
const GROWTH: f64 = 1.02;

/// Frames of a textured plane that is approached, 128 x 96 px.
fn approach(place: &Place, folder: &str, count: i32) {
    approach_to(place, folder, count, (64.0, 48.0));
}

/// The same with another focus of expansion.
fn approach_to(place: &Place, folder: &str, count: i32, focus: (f64, f64)) {
    std::fs::create_dir(place.path(folder)).unwrap();
    let wave =
        |k: f64, x: f64, y: f64| (0.11 + 0.3 * (k * 1.7).sin().abs()) * ((k * 2.3).cos() * x + (k * 2.3).sin() * y) + k;
    for frame in 0..count {
        let scale = GROWTH.powi(frame);
        let picture = GrayImage::from_fn(128, 96, |x, y| {
            let (x, y) = ((f64::from(x) - focus.0) / scale, (f64::from(y) - focus.1) / scale);
            let shade: f64 = (1..25).map(|k| 12.0 * wave(f64::from(k), x, y).sin()).sum();
            Luma([(128.0 + shade).clamp(0.0, 255.0).round() as u8])
        });
        picture.save(place.path(&format!("{folder}/{frame:02}.png"))).unwrap();
    }
}

fn rows(text: &str) -> Vec<std::collections::HashMap<String, String>> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    reader.deserialize().map(|row| row.unwrap()).collect()
}

#[test]
fn an_approach_gives_direction_focus_and_time_to_contact() {
    let place = Place::new();
    approach(&place, "frames", 4);
    let line = "egomotion frames --intrinsics 120,120,64,48 --method windowed --time-scheme pair --no-robust -o motion.csv --picture pictures --json";
    let summary = place.good(line).json();
    assert_eq!((&summary["command"], &summary["fields"]), (&"egomotion".into(), &3.into()));
    let rows = rows(&std::fs::read_to_string(place.path("motion.csv")).unwrap());
    assert_eq!(rows.len(), 3);
    for row in &rows {
        let number = |name: &str| row[name].parse::<f64>().unwrap();
        // The epipole sits among the points, where little is known of their depths, and errors of a small
        // picture go together; that may be told.
        assert!(["ok", "low_snr", "ill_conditioned"].contains(&row["status"].as_str()), "{row:?}");
        assert!(number("u_z") < -0.97, "{row:?}");
        for (name, truth) in [("foe_x", 64.0), ("foe_y", 48.0)] {
            let deviation = number(&format!("{name}_std"));
            assert!((number(name) - truth).abs() < f64::min(4.0 * deviation, 10.0) && deviation < 60.0, "{row:?}");
        }
        let contact = 1.0 / (GROWTH.ln());
        assert!((number("time_to_contact") / contact - 1.0).abs() < 0.1, "{row:?}");
        assert!(number("time_to_contact_std") > 0.0 && number("direction_std_deg") > 0.0);
    }
    let pictures = names(&place.path("pictures"));
    assert_eq!(pictures.len(), 3);
    let picture = image::open(place.path("pictures").join(&pictures[0])).unwrap().to_rgb8();
    assert!(picture.pixels().any(|p| p[0] > p[2]), "what comes nearer is red");
    assert!(temporary(&place.path("")).is_empty());
    // A second run does not write over the first one.
    let again = place.line(line);
    assert!(again.code == 2 && again.err.contains("--force"), "{}", again.err);
    place.good(&format!("{line} --force"));
}

/// Every pixel of a plane that faces the camera is reached at the same time.
#[test]
fn times_to_contact_are_written_for_every_pixel() {
    let place = Place::new();
    approach(&place, "frames", 3);
    let line = "egomotion frames --intrinsics 120,120,64,48 --method windowed --time-scheme pair --maps maps -o motion.csv --quiet";
    place.good(line);
    let files = names(&place.path("maps"));
    assert_eq!(files, ["contact_000000.npz", "contact_000001.npz"]);
    let mut archive = jacoflow::io::npz::NpzReader::open(place.path("maps").join(&files[0])).unwrap();
    let mut plane = |name: &str| archive.array::<f64>(name).unwrap();
    let (contact, deviation, residual) = (plane("time_to_contact"), plane("time_to_contact_std"), plane("residual"));
    for array in [&contact, &deviation, &residual] {
        assert_eq!(array.shape, [96, 128]);
    }
    let truth = 1.0 / GROWTH.ln();
    let (mut near, mut held, mut all) = (0, 0, 0);
    for (k, (value, spread)) in
        contact.values.iter().zip(&deviation.values).enumerate().filter(|(_, (v, _))| v.is_finite())
    {
        // At the focus of expansion a single pixel tells nothing.
        let (x, y) = ((k % 128) as f64 - 64.0, (k / 128) as f64 - 48.0);
        if x.hypot(y) > 20.0 {
            all += 1;
            near += u32::from((value / truth - 1.0).abs() < 0.2);
            held += u32::from((1.0 / value - 1.0 / truth).abs() < 3.0 * spread / (value * value));
        }
    }
    assert!(all > 4000 && near * 10 > all * 9 && held * 10 > all * 9, "{near} {held} of {all}");
    let again = place.line(line.replace("-o motion.csv", "-o other.csv").as_str());
    assert!(again.code == 2 && again.err.contains("maps") && again.err.contains("--force"), "{}", again.err);
}

#[test]
fn rows_go_to_standard_output_and_do_not_depend_on_threads() {
    let place = Place::new();
    approach(&place, "frames", 3);
    let line = "egomotion frames --intrinsics 120,120,64,48 --method windowed --time-scheme pair --spacing 10 --quiet";
    let one = place.good(&format!("{line} --threads 1")).out;
    assert_eq!(one, place.good(&format!("{line} --threads 3")).out);
    assert_eq!(rows(&one).len(), 2);
    let ml = rows(&place.good(&format!("{line} --estimator ml --max-points 40")).out);
    assert!(ml[0]["method"] == "ml" && ml[0]["points"].parse::<usize>().unwrap() <= 40);
}

/// A region gets a grid of its own, and its own most points.
#[test]
fn a_region_has_points_enough() {
    let place = Place::new();
    approach(&place, "frames", 3);
    let line =
        "egomotion frames --intrinsics 120,120,64,48 --method windowed --time-scheme pair --region 20,16,88,64 --quiet";
    let points = |line: &str| -> Vec<usize> {
        rows(&place.good(line).out).iter().map(|row| row["points"].parse().unwrap()).collect()
    };
    let (own, coarse) = (points(line), points(&format!("{line} --spacing 20")));
    assert!(own.iter().all(|&n| n >= 24) && own[0] > coarse[0], "{own:?} {coarse:?}");
    let few = points(&format!("{line} --max-points 20"));
    assert!(few.iter().all(|&n| (8..=20).contains(&n)), "{few:?}");
}

/// How fast the thing in the next test grows, and by how much the camera turns about its axis, rad/frame.
const NEARER: f64 = 1.03;
const TURN: f64 = 0.01;

/// Frames of a textured plane that is approached by a camera that turns, and of a thing before it, 72 x 60 px
/// around (121, 82), that comes nearer faster; 192 x 144 px.
fn thing_ahead(place: &Place, folder: &str, count: i32) {
    std::fs::create_dir(place.path(folder)).unwrap();
    let shade = |seed: f64, x: f64, y: f64| -> f64 {
        let wave = |k: f64| {
            (0.11 + 0.3 * (k * seed).sin().abs()) * ((k * 2.3 + seed).cos() * x + (k * 2.3 + seed).sin() * y) + k
        };
        (1..25).map(|k| 12.0 * wave(f64::from(k)).sin()).sum()
    };
    for frame in 0..count {
        let (sin, cos) = (-TURN * f64::from(frame)).sin_cos();
        let (behind, before) = (1.01f64.powi(frame), NEARER.powi(frame));
        let picture = GrayImage::from_fn(192, 144, |x, y| {
            let (x, y) = (f64::from(x) - 96.0, f64::from(y) - 72.0);
            let (x, y) = (cos * x - sin * y, sin * x + cos * y);
            let (a, b) = ((x - 25.0) / before, (y - 10.0) / before);
            let thing = a.abs() < 36.0 && b.abs() < 30.0;
            let value = if thing { shade(1.3, a, b) } else { shade(1.7, x / behind, y / behind) };
            Luma([(128.0 + value).clamp(0.0, 255.0).round() as u8])
        });
        picture.save(place.path(&format!("{folder}/{frame:02}.png"))).unwrap();
    }
}

/// In a narrow field a rotation trades against a sideways motion and the approach: the rest of the picture
/// tells the rotation.
#[test]
fn an_object_ahead_has_its_own_time_to_contact() {
    let place = Place::new();
    thing_ahead(&place, "frames", 4);
    let line =
        "egomotion frames --intrinsics 250,250,96,72 --method windowed --time-scheme pair --region 92,58,58,48 --quiet";
    let number = |row: &std::collections::HashMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
    let (alone, known) =
        (rows(&place.good(line).out), rows(&place.good(&format!("{line} --object-rotation-std 0.0005")).out));
    assert_eq!((alone.len(), known.len()), (3, 3));
    let truth = 1.0 / NEARER.ln();
    for (alone, known) in alone.iter().zip(&known) {
        assert_eq!(alone["scene_status"], "");
        assert!(!["", "too_few_points"].contains(&known["scene_status"].as_str()), "{known:?}");
        let (contact, deviation) = (number(known, "time_to_contact"), number(known, "time_to_contact_std"));
        assert!((contact - truth).abs() < 4.0 * deviation && deviation < 0.1 * truth, "{contact} {deviation}");
        assert!((number(known, "w_z") - TURN).abs() < 0.002, "{known:?}");
        for axis in ["w_x_std", "w_y_std"] {
            assert!(number(known, axis) < 0.7 * number(alone, axis), "{axis}: {alone:?} {known:?}");
        }
    }
    let ended = place.line("egomotion frames --intrinsics 250,250,96,72 --object-rotation-std 0.001");
    assert!(ended.code == 2 && ended.err.contains("--region"), "{}", ended.err);
}

/// The bound is estimated, too, with the depths found: near the deviation where weights are good, and not
/// told where depths are mostly noise.
#[test]
fn the_bound_stands_beside_the_deviations() {
    let place = Place::new();
    approach_to(&place, "frames", 3, (112.0, 48.0));
    for row in rows(
        &place
            .good("egomotion frames --intrinsics 120,120,64,48 --preset fast --time-scheme pair --no-robust --quiet")
            .out,
    ) {
        for name in ["direction_std_deg", "w_x_std", "w_y_std", "w_z_std"] {
            let [own, bound] =
                [name.to_string(), format!("bound_{name}")].map(|name| row[&name].parse::<f64>().unwrap());
            assert!(bound > 0.5 * own && bound < 1.5 * own, "{name}: {row:?}");
        }
    }
}

/// A plane that faces the camera and is approached obliquely looks as if it were approached straight by a
/// camera that turns.
#[test]
fn other_motions_that_explain_the_flow_have_a_table_of_their_own() {
    let place = Place::new();
    approach_to(&place, "frames", 4, (112.0, 48.0));
    let line = "egomotion frames --intrinsics 120,120,64,48 --method windowed --time-scheme pair --no-robust -o motion.csv --alternatives others.csv --json";
    let summary = place.good(line).json();
    assert_eq!((&summary["files"], &summary["output"]), (&2.into(), &"motion.csv".into()));
    let read = |name: &str| rows(&std::fs::read_to_string(place.path(name)).unwrap());
    let (motions, others) = (read("motion.csv"), read("others.csv"));
    assert_eq!(motions.len(), 3);
    let mut ambiguous = 0;
    for row in &motions {
        let own: Vec<_> = others.iter().filter(|other| other["frame"] == row["frame"]).collect();
        assert_eq!(row["alternatives"], own.len().to_string(), "{row:?}");
        if row["status"] != "ambiguous" {
            continue;
        }
        ambiguous += 1;
        // One of them is the true one, another comes along the normal.
        let foci: Vec<f64> =
            own.iter().map(|other| &other["foe_x"]).chain([&row["foe_x"]]).map(|x| x.parse().unwrap()).collect();
        for truth in [112.0, 64.0] {
            assert!(foci.iter().any(|x| (x - truth).abs() < 16.0), "{truth}: {foci:?}");
        }
        assert_eq!(own[0]["number"], "1");
        let length: f64 = ["u_x", "u_y", "u_z"].iter().map(|name| own[0][*name].parse::<f64>().unwrap().powi(2)).sum();
        assert!((length - 1.0).abs() < 1e-6 && own[0]["excess_cost"].parse::<f64>().unwrap().is_finite());
    }
    assert!(ambiguous > 0, "{motions:?}");
    for (wrong, word) in
        [("others.csv", "--force"), ("-", "alternatives"), ("motion2.csv", "its own"), ("o.txt", "alternatives")]
    {
        let line = line.replace("-o motion.csv", "-o motion2.csv").replace("others.csv", wrong);
        let ended = place.line(&line);
        assert!(ended.code == 2 && ended.err.contains("alternatives: ") && ended.err.contains(word), "{}", ended.err);
    }
    assert_eq!(place.names("."), ["frames", "motion.csv", "others.csv"]);
}

/// Not even a header is told to standard output before a run that can only fail.
#[test]
fn nothing_is_written_where_nothing_can_be_reported() {
    let place = Place::new();
    approach(&place, "frames", 2);
    let line = "egomotion frames --intrinsics 120,120,64,48 --method windowed --time-scheme pair";
    let words = "at least 2 frames";
    let ended = place.line(&format!("{line} --stop 1"));
    assert!(ended.code == 2 && ended.out.is_empty() && ended.err.contains(words), "{:?} {}", ended.out, ended.err);
    let ended = place.line(&format!("{line} --stop 1 -o motion.csv --json"));
    assert!(ended.code == 2 && ended.err.contains(words) && place.names(".") == ["frames"], "{}", ended.err);
    place.good(&format!("{line} --pixel-pitch 1 --quiet"));
}

#[test]
fn mistakes_are_reported_before_any_work() {
    let place = Place::new();
    approach(&place, "frames", 2);
    for (line, word) in [
        ("egomotion frames --intrinsics 1,2,3", "intrinsics"),
        ("egomotion frames --intrinsics 0,1,2,3", "focal lengths 0 and 1"),
        ("egomotion frames", "--intrinsics"),
        ("egomotion frames --intrinsics no.txt", "no.txt"),
        ("egomotion frames --intrinsics 120,120,64,48 --estimator best", "estimator"),
        ("egomotion frames --intrinsics 120,120,64,48 --no-covariance", "no_covariance"),
        ("egomotion frames --intrinsics 120,120,64,48 --json", "output"),
        ("egomotion frames --intrinsics 120,120,64,48 -o rows.txt", "output"),
        ("egomotion frames --intrinsics 120,120,64,48 --method horn-schunck --time-scheme pair", "method"),
    ] {
        let ended = place.line(line);
        assert!(ended.code != 0 && ended.err.contains(word), "{line}: {} {}", ended.code, ended.err);
        assert_eq!(names(&place.path("")), ["frames"], "{line}");
    }
}
