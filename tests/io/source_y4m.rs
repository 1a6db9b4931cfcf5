//! YUV4MPEG2 (`.y4m`): uncompressed video with a text header, from a file or standard input. The luma plane

use jacoflow::error::{Error, Result};
use jacoflow::io::{Colour, FrameSource, Grey, Y4mSource};
use jacoflow::types::{AnyColourFrame, AnyFrame, Frame};
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
        let mut source = Y4mSource::new("test.y4m", bytes).unwrap().with_policy(colour);
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

fn first_colour(bytes: &[u8], policy: Grey) -> Result<AnyColourFrame> {
    Ok(Y4mSource::new("test.y4m", bytes)?.with_policy(policy).next_frame()?.unwrap())
}

/// One frame of 3 x 3 pixels, luma 40 to 48, and chroma samples that count up from 100 (blue) and from 150
/// (red).
fn chroma_stream(layout: &str, count: u8, range: &str) -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 W3 H3 {layout} {range}\nFRAME\n").into_bytes();
    bytes.extend(40..49);
    bytes.extend(100..100 + count);
    bytes.extend(150..150 + count);
    bytes
}

#[test]
fn each_pixel_has_the_chroma_that_covers_it() {
    for (layout, columns, rows, across, down) in
        [("C420", 2, 2, 2, 2), ("C422", 2, 3, 2, 1), ("C440", 3, 2, 1, 2), ("C444", 3, 3, 1, 1), ("C411", 1, 3, 4, 1)]
    {
        for (range, full) in [("XCOLORRANGE=FULL", true), ("XCOLORRANGE=LIMITED", false), ("", false)] {
            let AnyColourFrame::U8(got) =
                first_colour(&chroma_stream(layout, columns * rows, range), Grey::Error).unwrap()
            else {
                panic!("another type")
            };
            for (x, y) in (0..3).flat_map(|y| (0..3).map(move |x| (x, y))) {
                let sample = f64::from(x / across + columns * (y / down));
                let (luma, blue, red) = (f64::from(40 + x + 3 * y), 100.0 + sample - 128.0, 150.0 + sample - 128.0);
                // ITU-R BT.601-7 with its constants written out.
                let (luma, scale) = if full { (luma, 1.0) } else { (255.0 / 219.0 * (luma - 16.0), 255.0 / 224.0) };
                let want = [
                    luma + scale * 1.402 * red,
                    luma - scale * (0.344_136 * blue + 0.714_136 * red),
                    luma + scale * 1.772 * blue,
                ];
                assert_eq!(got.get(x.into(), y.into()), want.map(|v| v.round() as u8), "{layout} {range} {x} {y}");
            }
        }
    }
}

#[test]
fn deep_colour_fills_sixteen_bits_and_mono_is_grey() {
    let white = [940_u16, 512, 512].map(u16::to_le_bytes).concat();
    let bytes = [&b"YUV4MPEG2 W1 H1 C444p10\nFRAME\n"[..], &white].concat();
    assert_eq!(first_colour(&bytes, Grey::Error).unwrap(), AnyColourFrame::U16(Frame::filled(1, 1, [65535; 3])));
    let mono = stream("Cmono", 0);
    let message = first_colour(&mono, Grey::Error).unwrap_err().to_string();
    assert!(message.contains("test.y4m") && message.contains("colour is needed"), "{message}");
    let AnyColourFrame::U8(repeated) = first_colour(&mono, Grey::Repeat).unwrap() else { panic!("another type") };
    assert_eq!(repeated.row(1), [[3; 3], [4; 3], [5; 3]]);
    let cut = stream("C444", 11);
    assert!(first_colour(&cut[..cut.len() - 50], Grey::Error).unwrap_err().to_string().contains("cut off"));
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
