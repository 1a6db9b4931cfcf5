//! The flow PNG of the KITTI benchmark (A. Geiger et al., "Vision meets robotics: the KITTI dataset", 2013).

use jacoflow::error::Error;
use jacoflow::io::{FlowImage, read_kitti, write_kitti};
use proptest::prelude::*;

#[test]
fn flow_comes_back_and_what_does_not_fit_is_invalid() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let u = vec![1.25, f32::NAN, 600.0, -3.015625];
    write_kitti(&path, &FlowImage::new(2, 2, u, vec![0.0, 0.0, 0.0, 2.0]).unwrap()).unwrap();
    let back = read_kitti(&path).unwrap();
    assert_eq!((back.u()[0], back.u()[3], back.v()[3]), (1.25, -3.015625, 2.0));
    assert!(back.u()[1].is_nan() && back.v()[2].is_nan());
    let whole = std::fs::read(&path).unwrap();
    for cut in [0, 7, 20, 40, whole.len() / 2] {
        std::fs::write(&path, &whole[..cut]).unwrap();
        assert!(matches!(read_kitti(&path), Err(Error::Format { .. })), "{cut}");
    }
    ::image::GrayImage::new(3, 3).save(&path).unwrap();
    assert!(read_kitti(&path).unwrap_err().to_string().contains("16-bit RGB"));
    assert!(matches!(read_kitti(folder.path().join("none.png")), Err(Error::Io { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn rounding_is_at_most_half_a_step(u in -511.9f32..511.9) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_kitti(&path, &FlowImage::new(1, 1, vec![u], vec![-512.0]).unwrap()).unwrap();
        let back = read_kitti(&path).unwrap();
        prop_assert!((back.u()[0] - u).abs() <= 0.5 / 64.0 + 1e-5 && back.v()[0] == -512.0);
    }

    #[test]
    fn damage_never_makes_it_panic(at in 0usize..200, value: u8) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_kitti(&path, &FlowImage::new(4, 3, vec![1.0; 12], vec![2.0; 12]).unwrap()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let at = at % bytes.len();
        bytes[at] = value;
        std::fs::write(&path, &bytes).unwrap();
        let _ = read_kitti(&path);
    }
}
