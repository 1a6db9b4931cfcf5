//! Real recordings, from files to pictures. Skipped where the data are not there.

use super::support::Place;
use jacoflow::io::{read_flo, read_npz};
use std::path::PathBuf;

/// A folder or file of the recorded sequences: `JACOFLOW_DATA`, or `../shared/data` beside the package;
/// `None`, with a note, when it is not there.
fn data(part: &str) -> Option<String> {
    let root = std::env::var_os("JACOFLOW_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let path = root.join(part);
    if !path.exists() {
        println!("skipped: {part} is not there (set JACOFLOW_DATA)");
        return None;
    }
    Some(path.to_string_lossy().into_owned())
}

/// Runs `flow` with pictures and returns the valid share; every picture must be there and not be of one
/// colour.
fn to_pictures(place: &Place, input: &[String], more: &str, index: usize) -> f64 {
    let mut arguments: Vec<String> = vec!["flow".into()];
    arguments.extend_from_slice(input);
    let rest = format!("-o out --json --picture colour,quiver,divergence,curl {more}");
    arguments.extend(rest.split_whitespace().map(String::from));
    let ended = place.run(&arguments);
    assert_eq!(ended.code, 0, "{}", ended.err);
    for kind in ["colour", "quiver", "divergence", "curl"] {
        let path = place.path(&format!("out/{index:06}_{kind}.png"));
        let picture = image::open(&path).unwrap().to_rgb8();
        let first = picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|pixel| pixel != first), "{kind} is of one colour");
    }
    ended.json()["valid_share"].as_f64().unwrap()
}

#[test]
fn rubber_whale_in_colour() {
    let Some(folder) = data("middlebury_flow/RubberWhale") else { return };
    let place = Place::new();
    let refused = place.run(&["flow".to_string(), folder.clone(), "-o".into(), "x".into()]);
    assert!(refused.code != 0 && refused.err.contains("luminance"), "{}", refused.err);
    let frames: Vec<String> = [9, 10, 11].map(|k| format!("{folder}/frame{k:02}.png")).to_vec();
    to_pictures(&place, &frames, "--luminance --smooth 1 --format npz,flo", 1);
    let (got, truth) = (read_flo(place.path("out/000001.flo")), read_flo(format!("{folder}/flow10.flo")));
    let (got, truth) = (got.unwrap(), truth.unwrap());
    let errors: Vec<f64> = (0..got.u().len())
        .map(|i| f64::from(got.u()[i] - truth.u()[i]).hypot(f64::from(got.v()[i] - truth.v()[i])))
        .filter(|e| e.is_finite() && *e < 1e3)
        .collect();
    // Of all pixels, 1.6 % have no truth. What contradicts its window is not valid, but has an estimate.
    let known = truth.u().iter().filter(|u| u.abs() < 1e3).count();
    assert!(errors.len() as f64 > 0.95 * known as f64, "{} of {known}", errors.len());
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    // No motion at all would be 1.26 px off; there is no pyramid here.
    assert!(mean < 0.8, "mean error {mean} px");
}

#[test]
fn yosemite() {
    let Some(folder) = data("yosemite/yosemite_sequence") else { return };
    let place = Place::new();
    let share = to_pictures(&place, &[format!("{folder}/*.tif")], "--stop 4 --smooth 1", 1);
    assert!(share > 0.9, "{share}");
    assert_eq!(read_npz::<f32>(place.path("out/000002.npz")).unwrap().field.layout.frame_size, (316, 252));
}

#[test]
fn a_pair_of_particle_images() {
    let Some(folder) = data("piv_synthetic/DNS_turbulence") else { return };
    let mut images: Vec<String> = super::support::names(folder.as_ref())
        .into_iter()
        .filter(|name| name.starts_with("DNS_turbulence_00001") && name.contains(".tif"))
        .map(|name| format!("{folder}/{name}"))
        .collect();
    images.sort();
    let place = Place::new();
    let share = to_pictures(&place, &images, "--smooth 1", 0);
    assert!(images.len() == 2 && share > 0.95, "{share} {images:?}");
}

/// Ranges of the car ahead by laser, m, from frame 20 on.
fn ranges(folder: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(format!("{folder}/lidar_range.csv")).unwrap();
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    let rows = reader.deserialize::<std::collections::HashMap<String, String>>().map(|row| row.unwrap());
    rows.filter(|row| (20..28).contains(&row["frame"].parse::<i32>().unwrap()))
        .map(|row| row["Z_m"].parse().unwrap())
        .collect()
}

/// Its closing speed is that of one line through the ranges of the frames; the rotation of the rest of the
/// picture is what makes its time to contact known. In double precision: of the last pair's two motions,
/// about as likely, the rounding of single precision, which instruction sets differ in, chooses one.
#[test]
fn the_car_ahead_has_the_time_to_contact_that_the_laser_has() {
    let Some(folder) = data("ttc_kitti_lidar") else { return };
    let place = Place::new();
    let line = format!(
        "egomotion {folder}/image_02 --luminance --intrinsics 721.5377,721.5377,609.5593,172.854 --preset balanced --time-scheme pair --region 555,225,160,65 --spacing 8 --precision float64 --quiet"
    );
    let rows = |line: &str| -> Vec<std::collections::HashMap<String, String>> {
        let out = place.good(line).out;
        csv::Reader::from_reader(out.as_bytes()).deserialize().map(|row| row.unwrap()).collect()
    };
    let (alone, known) = (rows(&line), rows(&format!("{line} --object-rotation-std 0.0005")));
    let ranges = ranges(&folder);
    let middle = 0.5 * (ranges.len() - 1) as f64;
    let (mut slope, mut squares) = (0.0, 0.0);
    for (k, range) in ranges.iter().enumerate() {
        slope += (k as f64 - middle) * range;
        squares += (k as f64 - middle).powi(2);
    }
    let closing = -slope / squares;
    assert_eq!((alone.len(), known.len(), ranges.len()), (7, 7, 8));
    let (mut off, mut shares) = (Vec::new(), Vec::new());
    for (k, (alone, known)) in alone.iter().zip(&known).enumerate() {
        let number = |row: &std::collections::HashMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
        let laser = 0.5 * (ranges[k] + ranges[k + 1]) / closing;
        let (contact, deviation) = (number(known, "time_to_contact"), number(known, "time_to_contact_std"));
        off.push(((contact - laser) / deviation).abs());
        shares.push(deviation / laser);
        assert!(off[k] < 1.5, "{contact} {deviation}, laser: {laser}");
        assert!(number(alone, "time_to_contact_std") > 1.5 * deviation, "{alone:?}");
        assert!(!known["scene_status"].is_empty() && alone["scene_status"].is_empty());
    }
    let mean = |values: &[f64], power| values.iter().map(|value| value.powi(power)).sum::<f64>() / values.len() as f64;
    assert!(mean(&shares, 1) < 0.16, "{shares:?}");
    assert!(mean(&off, 2) < 1.0, "{off:?}");
}
