//! Disparity maps in files: `.npz`, `.pfm`, and the 16-bit PNG of the KITTI benchmark.

use jacoflow::error::Error;
use jacoflow::io::{DisparityFormat, DisparityMap, FloatMap, write_pfm};
use jacoflow::types::Frame;
use std::path::Path;

fn map() -> DisparityMap {
    let disparity = Frame::new(3, 2, vec![1.5, f32::NAN, 255.5, 0.25, -3.0, 300.0]).unwrap();
    let score = Some(Frame::new(3, 2, vec![0.5, f32::NAN, 1.0, 0.25, 0.75, 0.5]).unwrap());
    DisparityMap { disparity, score, row_offset: Some(-1.25) }
}

fn bits(frame: &Frame<f32>) -> Vec<u32> {
    frame.data().iter().map(|v| v.to_bits()).collect()
}

#[test]
fn maps_come_back_as_far_as_the_format_holds_them() {
    let folder = tempfile::tempdir().unwrap();
    for (format, lost) in [(DisparityFormat::Npz, 0), (DisparityFormat::Pfm, 0), (DisparityFormat::Kitti, 2)] {
        let path = folder.path().join(format!("a.{}", format.extension()));
        assert_eq!(DisparityFormat::of(&path), Some(format));
        assert_eq!(DisparityFormat::parse(format.name()).unwrap(), format);
        assert_eq!(format.write(&path, &map()).unwrap(), lost);
        let back = format.read(&path).unwrap();
        let mut want = map().disparity;
        if lost > 0 {
            want.data_mut()[4..].fill(f32::NAN);
        }
        assert_eq!(bits(&back.disparity), bits(&want), "{format:?}");
        if format == DisparityFormat::Npz {
            assert_eq!((bits(&back.score.unwrap()), back.row_offset), (bits(&map().score.unwrap()), Some(-1.25)));
        }
        let whole = std::fs::read(&path).unwrap();
        for cut in [0, 5, whole.len() / 2] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            assert!(matches!(format.read(&path), Err(Error::Format { .. })), "{format:?} {cut}");
        }
        assert!(matches!(format.read(&folder.path().join("none")), Err(Error::Io { .. })));
        let empty = DisparityMap::plain(Frame::default());
        assert!(format.write(&path, &empty).unwrap_err().to_string().starts_with("disparity: "));
    }
    assert!(DisparityFormat::parse("flo").unwrap_err().to_string().starts_with("format: "));
    assert_eq!(DisparityFormat::of(Path::new("a.flo")), None);
}

#[test]
fn infinite_disparities_are_absent_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let disparity = Frame::new(3, 1, vec![f32::INFINITY, 1.5, f32::NEG_INFINITY]).unwrap();
    for format in [DisparityFormat::Npz, DisparityFormat::Pfm, DisparityFormat::Kitti] {
        let path = folder.path().join(format!("a.{}", format.extension()));
        assert_eq!(format.write(&path, &DisparityMap::plain(disparity.clone())).unwrap(), 0);
        let back = format.read(&path).unwrap().disparity;
        assert!(back.data()[0].is_nan() && back.data()[1] == 1.5 && back.data()[2].is_nan(), "{format:?}");
    }
}

#[test]
fn pictures_of_another_kind_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    ::image::GrayImage::new(3, 3).save(&path).unwrap();
    assert!(DisparityFormat::Kitti.read(&path).unwrap_err().to_string().contains("16-bit grey"));
    let path = folder.path().join("a.pfm");
    write_pfm(&path, &FloatMap { width: 1, height: 1, planes: vec![vec![0.0]; 3] }).unwrap();
    assert!(matches!(DisparityFormat::Pfm.read(&path), Err(Error::Format { .. })));
}
