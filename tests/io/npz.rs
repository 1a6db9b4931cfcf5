//! Named arrays in one file: numpy's `.npz`, a zip archive of `.npy` files.

use jacoflow::error::{Error, Result};
use jacoflow::io::npz::{NpyArray, NpzReader, NpzWriter};
use jacoflow::io::{ElementType, NpyHeader};
use proptest::prelude::*;
use std::io::{Cursor, Write};

fn sample() -> Vec<u8> {
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()), "memory.npz");
    npz.array("planes", &[2, 3], &[1.0f32, 2.0, 3.0, 4.0, 5.0, f32::NAN]).unwrap();
    npz.array("exact", &[2], &[0.1f64, -0.0]).unwrap();
    npz.array("codes", &[3], &[1u8, 2, 3]).unwrap();
    npz.array("counts", &[1, 1], &[7u32]).unwrap();
    npz.array("index", &[], &[-5i64]).unwrap();
    npz.text("metadata", r#"{"unit": "µm", "n": 1}"#).unwrap();
    npz.into_inner().unwrap().into_inner()
}

fn reader(bytes: Vec<u8>) -> Result<NpzReader<Cursor<Vec<u8>>>> {
    NpzReader::new(Cursor::new(bytes), "memory.npz")
}

#[test]
fn arrays_and_texts_come_back() {
    let mut npz = reader(sample()).unwrap();
    assert_eq!(npz.names(), ["codes", "counts", "exact", "index", "metadata", "planes"]);
    let planes = npz.array::<f32>("planes").unwrap();
    assert!(planes.shape == [2, 3] && planes.values[4] == 5.0 && planes.values[5].is_nan());
    assert_eq!(npz.array::<f64>("exact").unwrap().values, [0.1, -0.0]);
    assert_eq!(npz.array::<u32>("counts").unwrap(), NpyArray { shape: vec![1, 1], values: vec![7] });
    assert_eq!(npz.array::<i64>("index").unwrap(), NpyArray { shape: vec![], values: vec![-5] });
    assert_eq!(npz.text("metadata").unwrap(), r#"{"unit": "µm", "n": 1}"#);
    assert_eq!(npz.real_array::<f32>("exact").unwrap().values, [0.1f32, -0.0]);
    assert_eq!(npz.real_array::<f64>("planes").unwrap().values[1], 2.0);
    assert!(npz.contains("codes") && !npz.contains("code"));
    assert_eq!(sample(), sample(), "the bytes do not depend on the clock");
}

#[test]
fn wrong_names_types_and_counts_are_explained() {
    let mut npz = reader(sample()).unwrap();
    assert!(npz.array::<f32>("nothing").unwrap_err().to_string().contains("'nothing' is missing"));
    assert!(npz.array::<u8>("planes").unwrap_err().to_string().contains("'<f4'"));
    assert!(npz.text("codes").unwrap_err().to_string().contains("single text"));
    assert!(npz.real_array::<f32>("codes").is_err());
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()), "x");
    assert!(npz.array("a", &[2, 2], &[1u8; 3]).is_err());
    assert!(npz.array("a", &[usize::MAX, 2], &[1u8; 3]).is_err());
}

#[test]
fn a_file_appears_only_when_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let mut npz = NpzWriter::create(&path).unwrap();
    npz.array("a", &[1], &[1u8]).unwrap();
    assert!(!path.exists());
    drop(npz);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let mut npz = NpzWriter::create(&path).unwrap();
    npz.array("a", &[1], &[9u8]).unwrap();
    npz.finish().unwrap();
    assert_eq!(NpzReader::open(&path).unwrap().array::<u8>("a").unwrap().values, [9]);
    assert!(matches!(NpzReader::open(folder.path()), Err(Error::Io { .. })));
    std::fs::write(&path, b"no zip").unwrap();
    assert!(matches!(NpzReader::open(&path), Err(Error::Format { .. })));
}

#[test]
fn a_header_that_promises_too_much_is_cut_off_not_allocated() {
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()), "x");
    npz.array_from("a", &NpyHeader::new(ElementType::F64, &[1 << 40]), |out| out.write_all(&[0; 16])).unwrap();
    let mut npz = reader(npz.into_inner().unwrap().into_inner()).unwrap();
    assert!(npz.array::<f64>("a").unwrap_err().to_string().contains("cut off"));
}

#[test]
fn any_changed_byte_gives_an_error_or_the_same_content() {
    let good = sample();
    type Content = (Vec<u32>, Vec<f64>, Vec<u8>, Vec<u32>, Vec<i64>, String);
    let content = |bytes: Vec<u8>| -> Result<Content> {
        let mut npz = reader(bytes)?;
        Ok((
            npz.array::<f32>("planes")?.values.iter().map(|v| v.to_bits()).collect(),
            npz.array::<f64>("exact")?.values,
            npz.array::<u8>("codes")?.values,
            npz.array::<u32>("counts")?.values,
            npz.array::<i64>("index")?.values,
            npz.text("metadata")?,
        ))
    };
    let whole = content(good.clone()).unwrap();
    let mut refused = 0;
    for at in 0..good.len() {
        let mut bytes = good.clone();
        bytes[at] ^= 0x15;
        match content(bytes) {
            Ok(read) => assert_eq!(read, whole, "byte {at}"),
            Err(error) => {
                assert!(error.to_string().contains("memory.npz"), "byte {at}: {error}");
                refused += 1;
            }
        }
    }
    // What may be changed unnoticed is only what the archive says twice or not of the content, such as times.
    assert!(refused > good.len() / 2, "{refused} of {}", good.len());
}

#[test]
fn an_array_longer_than_it_says_is_refused() {
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()), "x");
    npz.array_from("a", &NpyHeader::new(ElementType::U8, &[2]), |out| out.write_all(&[1, 2, 3])).unwrap();
    let mut npz = reader(npz.into_inner().unwrap().into_inner()).unwrap();
    assert!(npz.array::<u8>("a").unwrap_err().to_string().contains("goes on"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    #[test]
    fn damage_never_makes_it_panic(at in 0usize..4000, value: u8, cut in 0usize..4000, random in proptest::collection::vec(any::<u8>(), 0..100)) {
        let mut bytes = sample();
        let at = at % bytes.len();
        bytes[at] = value;
        bytes.truncate(cut.max(1));
        for bytes in [bytes, random] {
            if let Ok(mut npz) = reader(bytes) {
                for name in npz.names() {
                    let _ = npz.array::<f32>(&name);
                    let _ = npz.real_array::<f64>(&name);
                    let _ = npz.text(&name);
                }
            }
        }
    }
}
