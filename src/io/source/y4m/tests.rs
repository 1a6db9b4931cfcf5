use super::*;
use proptest::prelude::*;

fn read(bytes: &[u8]) -> Result<Vec<AnyFrame>> {
    let mut source = Y4mSource::new("test.y4m", bytes)?;
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame()? {
        frames.push(frame);
    }
    Ok(frames)
}

/// Two frames of 3 x 2 pixels, luma 0..6 and 10..16, followed by `chroma` bytes each.
fn stream(layout: &str, chroma: usize) -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 W3 H2 F30000:1001 Ip A1:1 {layout} XCOLORRANGE=FULL\n").into_bytes();
    for start in [0u8, 10] {
        bytes.extend(if start == 0 { &b"FRAME\n"[..] } else { &b"FRAME Ip\n"[..] });
        bytes.extend(start..start + 6);
        bytes.extend(std::iter::repeat_n(99, chroma));
    }
    bytes
}

#[test]
fn luma_is_taken_from_every_layout() {
    for (layout, chroma) in [
        ("Cmono", 0),
        ("", 4),
        ("C420", 4),
        ("C420jpeg", 4),
        ("C420mpeg2", 4),
        ("C420paldv", 4),
        ("C411", 4),
        ("C422", 8),
        ("C440", 6),
        ("C444", 12),
        ("C444alpha", 18),
    ] {
        let frames = read(&stream(layout, chroma)).unwrap();
        let want = |start| AnyFrame::U8(Frame::new(3, 2, (start..start + 6).collect()).unwrap());
        assert_eq!(frames, [want(0), want(10)], "{layout}");
    }
    let bytes = stream("Cmono", 0);
    let source = Y4mSource::new("x", &bytes[..]).unwrap();
    assert!((source.frame_rate().unwrap() - 29.97).abs() < 0.001);
}

#[test]
fn colour_is_refused_unless_luminance_is_asked_for() {
    let grey = |bytes: &[u8], colour| {
        let mut source = Y4mSource::new("test.y4m", bytes).unwrap().with_colour(colour);
        source.next_frame().and_then(|_| source.next_frame())
    };
    // The chroma of the stream is 99 and not 128; mono has none, and alpha is no colour.
    for (layout, chroma) in [("C420", 4), ("C444alpha", 18), ("", 4)] {
        let bytes = stream(layout, chroma);
        let refused = grey(&bytes, Colour::Error).unwrap_err().to_string();
        assert!(refused.contains("test.y4m: holds colour") && refused.contains("--luminance"), "{refused}");
        assert!(grey(&bytes, Colour::Luminance).unwrap().is_some());
    }
    assert!(grey(&stream("Cmono", 0), Colour::Error).unwrap().is_some());
    let mut frame = b"YUV4MPEG2 W2 H1 F25:1 C444alpha\nFRAME\n".to_vec();
    frame.extend([5, 6, 128, 127, 129, 128, 0, 255]);
    assert_eq!(grey(&frame, Colour::Error).unwrap(), None);
    let mut deep = b"YUV4MPEG2 W2 H1 F25:1 C420p10\nFRAME\n".to_vec();
    deep.extend([0xff, 0x03, 0x01, 0x00, 0, 2, 1, 2]);
    assert_eq!(grey(&deep, Colour::Error).unwrap(), None);
    *deep.last_mut().unwrap() = 3;
    assert!(grey(&deep, Colour::Error).is_err());
    assert!(grey(&frame[..frame.len() - 4], Colour::Error).unwrap_err().to_string().contains("cut off"));
}

#[test]
fn deep_samples_are_scaled_to_sixteen_bits() {
    let mut bytes = b"YUV4MPEG2 W2 H1 F25:1 C420p10\nFRAME\n".to_vec();
    bytes.extend([0xff, 0x03, 0x01, 0x00, 0, 2, 0, 2]);
    assert_eq!(read(&bytes).unwrap(), [AnyFrame::U16(Frame::new(2, 1, vec![1023 << 6, 1 << 6]).unwrap())]);
    let bytes = b"YUV4MPEG2 W1 H1 Cmono16\nFRAME\n\x34\x12";
    assert_eq!(read(bytes).unwrap(), [AnyFrame::U16(Frame::new(1, 1, vec![0x1234]).unwrap())]);
}

#[test]
fn frames_can_be_passed_over() {
    let bytes = stream("C420", 4);
    let mut source = Y4mSource::new("x", &bytes[..]).unwrap();
    assert_eq!(source.skip(1).unwrap(), 1);
    assert_eq!(source.next_frame().unwrap().unwrap().to_real::<f64>().get(0, 0), 10.0);
    assert_eq!(source.skip(3).unwrap(), 0);
}

#[test]
fn broken_streams_are_format_errors_that_name_the_stream() {
    let whole = stream("C420", 4);
    for cut in [0, 5, 30, whole.len() - 1, whole.len() - 5, whole.len() - 14] {
        let error = read(&whole[..cut]).unwrap_err();
        assert!(matches!(error, Error::Format { .. }) && error.to_string().starts_with("test.y4m"), "{cut}: {error}");
    }
    for header in [
        "YUV4MPEG2 W0 H2\n",
        "YUV4MPEG2 W-1 H2\n",
        "YUV4MPEG2 W99999999999999999999 H2\n",
        "YUV4MPEG2 W70000 H2\n",
        "YUV4MPEG2 W2 H2 C999\n",
        "YUV4MPEG2 W2 H2 Cmono99\n",
        "YUV4MPEG2 W2 H2 C420é\n",
        "YUV4MPEG2 é\n",
        "RIFF\n",
    ] {
        assert!(matches!(read(header.as_bytes()), Err(Error::Format { .. })), "{header}");
    }
    assert!(read(b"YUV4MPEG2 W65536 H65536 C444p16\nFRAME\nxx").is_err(), "no memory is taken for what is not there");
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), at in 0usize..90, value: u8) {
        let _ = read(&bytes);
        let mut damaged = stream("C420p10", 8);
        let at = at.min(damaged.len() - 1);
        damaged[at] = value;
        let _ = read(&damaged);
        let _ = read(&[&b"YUV4MPEG2 "[..], &bytes].concat());
    }
}
