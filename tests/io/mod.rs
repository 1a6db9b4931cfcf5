//! Frames in and results out: the recorded sequences with truth, where they are there, and files handed from
//! one room to another.

mod disparity;
mod field_format;
mod field_npz;
mod fields;
mod flo;
mod flow_image;
mod kitti;
mod mot;
mod npy;
mod npz;
mod numbered;
mod pfm;
mod picture_png;
mod picture_sequence;
mod sink;
mod sink_y4m;
mod source;
mod source_ffmpeg;
mod source_files;
mod source_memory;
mod source_npy;
mod source_select;
mod source_tiff;
mod source_views;
mod source_y4m;
mod table;
mod track_table;
mod write;

use jacoflow::image::picture::{FlowColours, Quiver, SignedMap, arrows_on_grid, grey_picture};
use jacoflow::image::{GaussianSmoother, Preprocess, Quantiser};
use jacoflow::io::{
    Colour, FlowImage, OpenOptions, open, open_sink, read_flo, read_image, read_kitti, write_flo, write_kitti,
    write_picture,
};
use jacoflow::types::AnyFrame;
use std::path::{Path, PathBuf};

/// The folder of recorded sequences: `JACOFLOW_DATA`, or `../shared/data` beside the package. `None`, with a
/// note, when it is not there.
fn data(part: &str) -> Option<PathBuf> {
    let root = std::env::var_os("JACOFLOW_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let folder = root.join(part);
    let found = folder.exists().then_some(folder);
    if found.is_none() {
        println!("skipped: {part} is not there (set JACOFLOW_DATA)");
    }
    found
}

fn options(colour: Colour) -> OpenOptions {
    OpenOptions { colour, ..OpenOptions::default() }
}

/// Number of frames and their size.
fn count(spec: &Path, colour: Colour) -> (usize, (usize, usize), &'static str) {
    let mut source = open(&spec.to_string_lossy(), &options(colour)).unwrap_or_else(|e| panic!("{e}"));
    let hint = source.len_hint();
    let (mut n, mut size, mut dtype) = (0, (0, 0), "");
    while let Some(frame) = source.next_frame().unwrap_or_else(|e| panic!("{e}")) {
        (size, dtype) = (frame.size(), frame.dtype());
        n += 1;
    }
    assert_eq!(hint.unwrap_or(n), n);
    (n, size, dtype)
}

#[test]
fn every_recorded_sequence_opens() {
    for (part, colour, n, size, dtype) in [
        ("middlebury_flow/RubberWhale", Colour::Luminance, 8, (584, 388), "uint8"),
        ("middlebury_flow/Dimetrodon", Colour::Luminance, 2, (584, 388), "uint8"),
        ("yosemite/yosemite_sequence", Colour::Error, 15, (316, 252), "uint8"),
        ("piv_synthetic/DNS_turbulence", Colour::Error, 2, (256, 256), "uint8"),
        ("piv_synthetic/backstep", Colour::Error, 2, (256, 256), "uint8"),
        ("piv_openpiv/test1", Colour::Error, 2, (511, 369), "uint8"),
        ("piv_openpiv/test6", Colour::Error, 4, (256, 256), "uint8"),
        ("piv_openopticalflow/White_Oval_*.tif", Colour::Luminance, 2, (334, 238), "uint8"),
        ("piv_openopticalflow/I?_vortexpair*.tif", Colour::Luminance, 2, (500, 500), "uint8"),
        ("dic_challenge/sample14", Colour::Error, 2, (2048, 589), "uint8"),
        ("track_otb/Crossing/img", Colour::Luminance, 120, (360, 240), "uint8"),
        ("kitti2012/image_0", Colour::Error, 5, (1242, 375), "uint8"),
        ("kitti2012/image_1", Colour::Error, 5, (1242, 375), "uint8"),
        ("kitti2012/disp_noc", Colour::Error, 1, (1242, 375), "uint16"),
        ("kitti_odometry/KITTI_sequence_1/image_l", Colour::Error, 20, (1226, 370), "uint8"),
        ("stereo_stills/tsukuba/disp3.pgm", Colour::Error, 1, (384, 288), "uint8"),
        ("stereo_stills/teddy/im*.png", Colour::Luminance, 2, (450, 375), "uint8"),
    ] {
        let (folder, name) = part.rsplit_once('/').unwrap();
        let Some(found) = data(if name.contains(['*', '?']) { folder } else { part }) else { continue };
        let spec = if name.contains(['*', '?']) { found.join(name) } else { found };
        assert_eq!(count(&spec, colour), (n, size, dtype), "{part}");
    }
}

#[test]
fn recorded_frames_come_in_natural_order() {
    let Some(folder) = data("yosemite/yosemite_sequence") else { return };
    let mut source = open(&folder.to_string_lossy(), &OpenOptions::default()).unwrap();
    assert!(
        source.describe().contains("yos2.tif to") && source.describe().contains("yos16.tif"),
        "{}",
        source.describe()
    );
    source.skip(7).unwrap();
    assert_eq!(source.next_frame().unwrap().unwrap(), read_image(folder.join("yos9.tif"), Colour::Error).unwrap());
}

#[test]
fn colour_needs_to_be_asked_for() {
    let Some(folder) = data("middlebury_flow/RubberWhale") else { return };
    let message =
        open(&folder.to_string_lossy(), &OpenOptions::default()).unwrap().next_frame().unwrap_err().to_string();
    assert!(message.contains("frame07.png") && message.contains("luminance"), "{message}");
}

fn mean_speed(flow: &FlowImage) -> f64 {
    let speeds = flow.u().iter().zip(flow.v()).map(|(u, v)| f64::from(u.hypot(*v))).filter(|s| s.is_finite());
    let (n, sum) = speeds.fold((0, 0.0), |(n, sum), s| (n + 1, sum + s));
    sum / f64::from(n)
}

/// Valid share and mean speed are those published with the collection.
#[test]
fn middlebury_truth_has_its_known_statistics_and_round_trips() {
    let folder = tempfile::tempdir().unwrap();
    for (part, share, speed) in [
        ("middlebury_flow/RubberWhale/flow10.flo", 0.984, 1.26),
        ("middlebury_flow/Dimetrodon/flow10.flo", 0.952, 2.06),
        ("piv_synthetic/DNS_turbulence/DNS_turbulence_00001_flow.flo", 1.0, 0.88),
    ] {
        let Some(path) = data(part) else { continue };
        let flow = read_flo(&path).unwrap();
        assert!((flow.valid_share() - share).abs() < 6e-4, "{part}: {}", flow.valid_share());
        assert!((mean_speed(&flow) - speed).abs() < 6e-3, "{part}: {}", mean_speed(&flow));
        let copy = folder.path().join("copy.flo");
        write_flo(&copy, &flow).unwrap();
        let back = read_flo(&copy).unwrap();
        let bits = |plane: &[f32]| plane.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert!(bits(back.u()) == bits(flow.u()) && bits(back.v()) == bits(flow.v()));
    }
}

#[test]
fn kitti_truth_has_its_known_statistics_and_round_trips() {
    let Some(path) = data("kitti2012/flow_noc/000151_10.png") else { return };
    let flow = read_kitti(&path).unwrap();
    assert!((flow.valid_share() - 0.252).abs() < 6e-4, "{}", flow.valid_share());
    assert!((mean_speed(&flow) - 35.95).abs() < 6e-3, "{}", mean_speed(&flow));
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("copy.png");
    write_kitti(&copy, &flow).unwrap();
    let back = read_kitti(&copy).unwrap();
    assert!(back.u().iter().zip(flow.u()).all(|(a, b)| a == b || (a.is_nan() && b.is_nan())));
}

/// From a recorded pair with truth to the four pictures: each has the frames' size and is no single colour.
#[test]
fn recorded_truth_becomes_pictures() {
    let Some(folder) = data("middlebury_flow/RubberWhale") else { return };
    let out = tempfile::tempdir().unwrap();
    let flow = read_flo(folder.join("flow10.flo")).unwrap();
    let (w, h) = (flow.width(), flow.height());
    let frame = read_image(folder.join("frame10.png"), Colour::Luminance).unwrap();
    let mut arrows = grey_picture(&frame);
    Quiver::default().draw(&mut arrows, &arrows_on_grid(flow.u(), flow.v(), (w, h), 16, (0.0, 0.0), 1.0).unwrap());
    let colours = FlowColours::default().picture(flow.u(), flow.v(), w, h).unwrap();
    let map = SignedMap::default().picture(flow.u(), w, h).unwrap();
    for (name, picture) in [("colours", colours), ("arrows", arrows), ("map", map)] {
        assert!(picture.data().chunks(3).any(|p| p != &picture.data()[..3]), "{name}");
        let path = out.path().join(format!("{name}.png"));
        write_picture(&path, &picture).unwrap();
        assert_eq!(read_image(&path, Colour::Luminance).unwrap().size(), (w, h));
    }
}

/// A sequence written, read, and prepared as the pipeline does: quantised levels are whole, smoothing keeps
/// the mean.
#[test]
fn frames_pass_from_sink_to_source_to_preprocessing() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("ramp.npy").to_string_lossy().into_owned();
    let mut sink = open_sink(&spec, 25.0).unwrap();
    for t in 0..4 {
        let frame =
            jacoflow::types::Frame::from_fn(24, 18, |x, y| 100.0 + 0.3 * x as f64 - 0.2 * y as f64 + f64::from(t));
        sink.write(&AnyFrame::F64(frame)).unwrap();
    }
    sink.finish().unwrap();
    let mut source = open(&spec, &OpenOptions::default()).unwrap();
    let frame = source.next_frame().unwrap().unwrap().to_real::<f64>();
    let quantise = Preprocess { quantise: Some(Quantiser::default()), ..Preprocess::default() };
    let levels = quantise.apply(frame.clone());
    assert!(levels.data().iter().zip(frame.data()).all(|(l, x)| l.fract() == 0.0 && (0.0..1.0).contains(&(x - l))));
    let smooth = Preprocess { smooth: Some(GaussianSmoother::new(1.5).unwrap()), ..Preprocess::default() };
    let mean = |f: &jacoflow::types::Frame<f64>| f.data().iter().sum::<f64>() / f.data().len() as f64;
    // Reflected borders make the smoother's weights sum to one down every column of its matrix too.
    assert!((mean(&smooth.apply(levels.clone())) - mean(&levels)).abs() < 1e-10);
    assert_eq!(source.len_hint(), Some(3));
}
