//! `.pfm`, the portable float map: one or three planes of float32, rows from the bottom up.

use jacoflow::error::Error;
use jacoflow::io::{FloatMap, read_pfm, write_pfm};
use proptest::prelude::*;

#[test]
fn rows_are_stored_from_the_bottom() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pfm");
    write_pfm(&path, &FloatMap { width: 1, height: 2, planes: vec![vec![1.0, 2.0]] }).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(bytes, [b"Pf\n1 2\n-1.0\n", &2f32.to_le_bytes()[..], &1f32.to_le_bytes()[..]].concat());
    std::fs::write(&path, [b"Pf 1 2\n 1.0\n", &2f32.to_be_bytes()[..], &1f32.to_be_bytes()[..]].concat()).unwrap();
    assert_eq!(read_pfm(&path).unwrap().planes, [[1.0, 2.0]]);
}

#[test]
fn wrong_planes_and_broken_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pfm");
    for planes in [vec![], vec![vec![0.0; 4]; 2], vec![vec![0.0; 3]]] {
        assert!(
            write_pfm(&path, &FloatMap { width: 2, height: 2, planes }).unwrap_err().to_string().starts_with("planes")
        );
    }
    for text in [
        "",
        "Pf",
        "P5\n1 1\n255\n",
        "Pf\n1 x\n-1\n",
        "Pf\n2 2\n-1\nabc",
        "PF\n99999999999999999999 1\n-1\n",
        "Pf\n60000 60000\n-1\n",
    ] {
        std::fs::write(&path, text).unwrap();
        assert!(matches!(read_pfm(&path), Err(Error::Format { .. })), "{text}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn maps_round_trip_and_random_bytes_do_no_harm(width in 1usize..7, height in 1usize..7, colour: bool, random in proptest::collection::vec(any::<u8>(), 0..80)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pfm");
        let channels = if colour { 3 } else { 1 };
        let planes = (0..channels).map(|c| (0..width * height).map(|i| (100 * c + i) as f32).collect()).collect();
        let map = FloatMap { width, height, planes };
        write_pfm(&path, &map).unwrap();
        prop_assert_eq!(read_pfm(&path).unwrap(), map);
        std::fs::write(&path, [b"Pf\n", &random[..]].concat()).unwrap();
        let _ = read_pfm(&path);
    }
}

#[test]
fn scales_that_say_no_byte_order_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pfm");
    for scale in ["0", "-0.0", "nan", "inf", "-inf"] {
        std::fs::write(&path, [format!("Pf\n1 1\n{scale}\n").as_bytes(), &[0; 4]].concat()).unwrap();
        let message = read_pfm(&path).unwrap_err().to_string();
        assert!(message.contains("its scale is") && message.contains("a.pfm"), "{message}");
    }
}
