//! TIFF files with several axes, and samples that frames do not have.

use super::options;
use jacoflow::error::{Error, Result};
use jacoflow::io::{Colour, FrameSource, OpenOptions, PlaneSelection, Slices, open, read_image, read_plane};
use jacoflow::types::AnyFrame;
use proptest::prelude::*;
use std::fs::File;
use std::path::Path;
use tiff::encoder::{TiffEncoder, TiffKind, colortype};
use tiff::tags::Tag;

/// Pages of 3 x 2 px with the levels 0, 1, ... and a description of the first.
fn write<K: TiffKind>(mut encoder: TiffEncoder<File, K>, pages: u8, description: &str, is_thumbnail: fn(u8) -> bool) {
    for level in 0..pages {
        let mut page = encoder.new_image::<colortype::Gray8>(3, 2).unwrap();
        if level == 0 {
            page.encoder().write_tag(Tag::ImageDescription, description).unwrap();
        }
        page.encoder().write_tag(Tag::NewSubfileType, u32::from(is_thumbnail(level))).unwrap();
        page.write_data(&[level; 6]).unwrap();
    }
}

fn levels(path: &Path, planes: PlaneSelection) -> Result<Vec<f64>> {
    let mut source = open(&path.to_string_lossy(), &OpenOptions { planes, ..options(Colour::Error) })?;
    let mut levels = Vec::new();
    while let Some(frame) = source.next_frame()? {
        levels.push(frame.to_real::<f64>().get(0, 0));
    }
    Ok(levels)
}

fn plane(channel: Option<usize>, z: Option<Slices>) -> PlaneSelection {
    PlaneSelection { channel, z }
}

#[test]
fn frames_are_the_times_of_one_channel_and_slice() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stack.tif");
    let description = "ImageJ=1.53c\nimages=12\nchannels=2\nslices=3\nframes=2\nhyperstack=true\nfinterval=0.5";
    write(TiffEncoder::new(File::create(&path).unwrap()).unwrap(), 12, description, |_| false);
    assert_eq!(levels(&path, plane(Some(1), Some(Slices::Index(2)))).unwrap(), [5.0, 11.0]);
    for (planes, message) in [
        (plane(None, Some(Slices::Index(0))), "holds 2 channels (C) at each of 2 times; choose one with channel=0"),
        (plane(Some(0), None), "holds 3 slices (Z) at each of 2 times"),
        (plane(Some(2), None), "channel: expected an index below 2, got 2"),
        (plane(Some(0), Some(Slices::Index(3))), "z: expected an index below 3, got 3"),
        (plane(Some(0), Some(Slices::AsTime)), "z: expected an index, as the file holds 2 times"),
    ] {
        let error = levels(&path, planes).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    let chosen = OpenOptions { planes: plane(Some(0), Some(Slices::Index(0))), ..OpenOptions::default() };
    let mut source = open(&path.to_string_lossy(), &chosen).unwrap();
    assert_eq!((source.frame_rate(), source.time(), source.len_hint()), (Some(2.0), None, Some(2)));
    assert_eq!(source.skip(1).unwrap(), 1);
    assert_eq!(source.next_frame().unwrap().unwrap().to_real::<f64>().get(0, 0), 6.0);
    assert_eq!(source.time(), Some(0.5));
    assert!(matches!(read_image(&path, Colour::Error), Err(Error::Format { .. })));
    assert!(read_plane(&path, Colour::Error, chosen.planes).unwrap_err().to_string().contains("several pages"));
}

#[test]
fn large_files_and_thumbnails_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("big.tif");
    write(TiffEncoder::new_big(File::create(&path).unwrap()).unwrap(), 4, "", |level| level % 2 == 1);
    assert_eq!(levels(&path, PlaneSelection::default()).unwrap(), [0.0, 2.0]);
    let error = levels(&path, plane(Some(0), None)).unwrap_err().to_string();
    assert!(error.starts_with("channel: expected none"), "{error}");
}

#[test]
fn pages_are_read_under_any_name() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["stack", "stack.stk", "stack.lsm", "stack.btf", "stack.dat", "stack.npz", "stack.txt", "stack.png"] {
        let path = folder.path().join(name);
        write(TiffEncoder::new(File::create(&path).unwrap()).unwrap(), 4, "", |_| false);
        assert_eq!(levels(&path, PlaneSelection::default()).unwrap(), [0.0, 1.0, 2.0, 3.0], "{name}");
        write(TiffEncoder::new_big(File::create(&path).unwrap()).unwrap(), 2, "", |_| false);
        assert_eq!(levels(&path, PlaneSelection::default()).unwrap(), [0.0, 1.0], "{name}");
    }
}

#[test]
fn integers_become_the_type_that_holds_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.tif");
    let encoder = || TiffEncoder::new(File::create(&path).unwrap()).unwrap();
    encoder().write_image::<colortype::GrayI16>(2, 1, &[-7, 30_000]).unwrap();
    let frame = read_image(&path, Colour::Error).unwrap();
    assert!(matches!(&frame, AnyFrame::F32(frame) if frame.data() == [-7.0, 30_000.0]));
    encoder().write_image::<colortype::Gray32>(2, 1, &[7, u32::MAX]).unwrap();
    let frame = read_image(&path, Colour::Error).unwrap();
    assert!(matches!(&frame, AnyFrame::F64(frame) if frame.data() == [7.0, f64::from(u32::MAX)]));
    encoder().write_image::<colortype::Gray64>(2, 1, &[7, 1 << 53]).unwrap();
    assert!(read_image(&path, Colour::Error).is_ok());
    encoder().write_image::<colortype::Gray64>(2, 1, &[7, (1 << 53) + 1]).unwrap();
    let error = read_image(&path, Colour::Error).unwrap_err();
    assert!(matches!(&error, Error::Format { .. }) && error.to_string().contains("beyond 2^53"), "{error}");
}

#[test]
fn other_files_have_no_channels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    image::GrayImage::new(3, 2).save(&path).unwrap();
    for spec in [path.clone(), folder.path().to_path_buf()] {
        let error = levels(&spec, plane(Some(0), None)).unwrap_err().to_string();
        assert!(error.starts_with("channel: expected none, as only TIFF files"), "{error}");
    }
}

#[test]
fn files_that_only_others_read_say_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    for (name, advice, is_read_in_python) in [
        ("a.npz", "key=", true),
        ("a.MAT", "scipy", true),
        ("a.raw", "numpy.fromfile", false),
        ("a.cih", "16-bit TIFF", false),
        ("a.cine", "16-bit TIFF", false),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, "x").unwrap();
        let error = open(&path.to_string_lossy(), &OpenOptions::default()).err().unwrap();
        let words = error.to_string();
        assert!(words.contains(advice) && words.contains(name), "{words}");
        assert_eq!(matches!(error, Error::Missing(_)), is_read_in_python, "{words}");
        assert_eq!(matches!(error, Error::Format { .. }), !is_read_in_python, "{words}");
    }
    let absent = open(&folder.path().join("b.raw").to_string_lossy(), &OpenOptions::default()).err().unwrap();
    assert!(matches!(absent, Error::Io { .. }), "{absent}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]
    #[test]
    fn no_description_makes_the_reader_panic(
        words in proptest::collection::vec("(channels|slices|frames|images|shape|axes|SizeC|SizeT|IFD|FirstC|PlaneCount|TCYX|=|:|\\[|\\]|\\{|\\}|\"|<Pixels |<TiffData |/>|,|[0-9]{1,20}|-1|\n)", 0..24),
        head in 0_usize..4,
    ) {
        let head = ["", "ImageJ=1\n", "<OME><Pixels DimensionOrder=\"XYTZC\" ", "{\"shape\": "][head];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.tif");
        let encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
        write(encoder, 3, &format!("{head}{}", words.concat()), |_| false);
        for planes in [PlaneSelection::default(), plane(Some(1), Some(Slices::Index(0))), plane(Some(0), Some(Slices::AsTime))] {
            let _ = levels(&path, planes);
        }
    }
}
