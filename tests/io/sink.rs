//! Where frames go: one file for each kind of sink and one line in [`KINDS`].

use jacoflow::error::{Error, Result};
use jacoflow::io::{OpenOptions, open, open_colour, open_colour_sink, open_sink};
use jacoflow::types::{AnyColourFrame, AnyFrame, Frame};

fn frames(n: usize) -> Vec<AnyFrame> {
    (0..n).map(|i| AnyFrame::U8(Frame::from_fn(5, 3, |x, y| (40 * i + 10 * y + x) as u8))).collect()
}

fn written(spec: &str, frames: &[AnyFrame]) -> Result<Vec<AnyFrame>> {
    let mut sink = open_sink(spec, 29.97)?;
    for frame in frames {
        sink.write(frame)?;
    }
    sink.finish()?;
    let mut source = open(spec, &OpenOptions::default())?;
    let mut back = Vec::new();
    while let Some(frame) = source.next_frame()? {
        back.push(frame);
    }
    Ok(back)
}

#[test]
fn every_sink_is_read_back_by_its_source() {
    let folder = tempfile::tempdir().unwrap();
    let deep: Vec<_> =
        (0..3).map(|i| AnyFrame::U16(Frame::from_fn(5, 3, |x, y| (9000 * i + 10 * y + x) as u16))).collect();
    for (name, i) in [("a.y4m", 0), ("a.npy", 1), ("pictures", 2)] {
        let spec = folder.path().join(name).to_string_lossy().into_owned();
        assert_eq!(written(&spec, &frames(3)).unwrap(), frames(3), "{name}");
        if i > 0 {
            assert_eq!(written(&spec, &deep).unwrap(), deep, "{name}");
        }
    }
    let float = vec![AnyFrame::F64(Frame::filled(2, 2, 0.5)); 2];
    let spec = folder.path().join("f.npy").to_string_lossy().into_owned();
    assert_eq!(written(&spec, &float).unwrap(), float);
    let spec = folder.path().join("d.y4m").to_string_lossy().into_owned();
    assert_eq!(written(&spec, &deep).unwrap(), deep);
}

fn written_in_colour(spec: &str, frames: &[AnyColourFrame]) -> Result<Vec<AnyColourFrame>> {
    let mut sink = open_colour_sink(spec, 25.0)?;
    for frame in frames {
        sink.write(frame)?;
    }
    sink.finish()?;
    let mut source = open_colour(spec, &OpenOptions::default())?;
    let mut back = Vec::new();
    while let Some(frame) = source.next_frame()? {
        back.push(frame);
    }
    Ok(back)
}

/// Largest difference of any two samples, in levels.
fn apart(a: &[AnyColourFrame], b: &[AnyColourFrame]) -> f32 {
    assert_eq!(a.len(), b.len());
    let pixels = |frames: &[AnyColourFrame]| {
        frames.iter().flat_map(|f| f.scaled(1.0).into_data()).flatten().collect::<Vec<f32>>()
    };
    pixels(a).iter().zip(pixels(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn colour_is_read_back_by_its_source() {
    let folder = tempfile::tempdir().unwrap();
    let spec = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let level = |i: usize, x: usize, y: usize| [60 * i + 40 * x, 255 - 50 * x - 20 * y, 90 * y + i];
    let bytes: Vec<_> =
        (0..2).map(|i| AnyColourFrame::U8(Frame::from_fn(5, 3, |x, y| level(i, x, y).map(|v| v as u8)))).collect();
    let deep: Vec<_> = (0..2)
        .map(|i| AnyColourFrame::U16(Frame::from_fn(5, 3, |x, y| level(i, x, y).map(|v| 255 * v as u16))))
        .collect();
    for (kind, frames) in [("u8", &bytes), ("u16", &deep)] {
        for name in [format!("{kind}.npy"), format!("{kind}_pictures")] {
            assert_eq!(&written_in_colour(&spec(&name), frames).unwrap(), frames, "{name}");
        }
        // Luma and chroma are rounded: at most (1 + 1.772) / 2 levels away before the last rounding.
        let sequence = written_in_colour(&spec(&format!("{kind}.y4m")), frames).unwrap();
        assert!(
            sequence[0].dtype() == frames[0].dtype() && apart(&sequence, frames) <= 1.0,
            "{}",
            apart(&sequence, frames)
        );
    }
    let float = vec![AnyColourFrame::F64(Frame::filled(2, 2, [0.5, 0.25, -1.0])); 2];
    assert_eq!(written_in_colour(&spec("f.npy"), &float).unwrap(), float);
    for name in ["f.y4m", "f_pictures"] {
        let error = written_in_colour(&spec(name), &float).unwrap_err();
        assert!(matches!(error, Error::Type { argument: "frame", .. }), "{error}");
    }
    let mixed = [bytes[0].clone(), deep[0].clone()];
    assert!(written_in_colour(&spec("mixed.npy"), &mixed).unwrap_err().to_string().contains("uint16"));
    assert!(!folder.path().join("mixed.npy").exists());
}

#[test]
fn unlike_frames_and_unknown_outputs_are_refused_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.y4m", "a.npy"] {
        let spec = folder.path().join(name).to_string_lossy().into_owned();
        let mut mixed = frames(2);
        mixed.push(AnyFrame::U8(Frame::filled(3, 5, 0)));
        assert!(written(&spec, &mixed).unwrap_err().to_string().contains("3 x 5"), "{name}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    assert!(open_sink("a.avi", 25.0).err().unwrap().to_string().starts_with("output"));
    assert!(open_sink("-", 0.0).err().unwrap().to_string().starts_with("frame_rate"));
}

#[test]
fn a_shorter_run_leaves_no_frames_of_a_longer_one() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("frames");
    let spec = place.to_str().unwrap();
    for count in [3, 1] {
        let mut sink = open_sink(spec, 25.0).unwrap();
        for level in 0..count {
            sink.write(&AnyFrame::U8(Frame::filled(4, 3, level as u8))).unwrap();
        }
        sink.finish().unwrap();
        assert_eq!(std::fs::read_dir(&place).unwrap().count(), count);
    }
    assert!(open_sink("", 25.0).err().unwrap().to_string().contains("an empty name"));
}
