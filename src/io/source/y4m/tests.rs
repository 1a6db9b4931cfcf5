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
