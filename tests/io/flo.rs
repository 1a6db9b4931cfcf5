//! `.flo`: the flow format of the Middlebury benchmark (S. Baker et al., "A database and evaluation

use jacoflow::error::Error;
use jacoflow::io::{FlowImage, read_flo, write_flo};
use proptest::prelude::*;

#[test]
fn bytes_are_those_of_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.flo");
    write_flo(&path, &FlowImage::new(2, 1, vec![1.5, f32::NAN], vec![-2.0, 0.0]).unwrap()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(&bytes[..12], b"PIEH\x02\0\0\0\x01\0\0\0");
    let numbers: Vec<f32> = bytes[12..].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(numbers, [1.5, -2.0, 1e10, 1e10]);
    let back = read_flo(&path).unwrap();
    assert!(back.u()[0] == 1.5 && back.v()[0] == -2.0 && back.u()[1].is_nan() && back.v()[1].is_nan());
}

#[test]
fn broken_files_are_format_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.flo");
    write_flo(&path, &FlowImage::new(3, 2, vec![0.0; 6], vec![0.0; 6]).unwrap()).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for cut in [0, 3, 11, 12, 50] {
        std::fs::write(&path, &whole[..cut]).unwrap();
        assert!(matches!(read_flo(&path), Err(Error::Format { .. })), "{cut}");
    }
    std::fs::write(&path, [&whole[..], &[0; 8]].concat()).unwrap();
    let error = read_flo(&path).unwrap_err().to_string();
    assert!(error.contains("longer than a field of 3 x 2 px"), "{error}");
    for size in [[0u8; 8], [0xff; 8], [0xff, 0xff, 0, 0, 0xff, 0xff, 0, 0]] {
        std::fs::write(&path, [&whole[..4], &size, &whole[12..]].concat()).unwrap();
        assert!(matches!(read_flo(&path), Err(Error::Format { .. })), "{size:?}");
    }
    assert!(matches!(read_flo(folder.path().join("none.flo")), Err(Error::Io { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn flow_round_trips_and_random_bytes_do_no_harm(width in 1usize..9, height in 1usize..9, seed: u32, random in proptest::collection::vec(any::<u8>(), 0..60)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.flo");
        let u: Vec<f32> = (0..width * height).map(|i| f32::from_bits((seed >> 9) | 0x4000_0000) + i as f32).collect();
        let flow = FlowImage::new(width, height, u.clone(), u).unwrap();
        write_flo(&path, &flow).unwrap();
        prop_assert_eq!(read_flo(&path).unwrap(), flow);
        std::fs::write(&path, &random).unwrap();
        prop_assert!(read_flo(&path).is_err());
        std::fs::write(&path, [b"PIEH", &random[..]].concat()).unwrap();
        let _ = read_flo(&path);
    }
}
