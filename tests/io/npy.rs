//! The `.npy` header and element types, shared by `.npy` files and the arrays inside `.npz` archives.

use jacoflow::io::{Element, ElementType, NpyHeader};
use proptest::prelude::*;

fn written(header: &NpyHeader, reserve: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    header.write(&mut bytes, reserve).unwrap();
    bytes
}

#[test]
fn headers_are_spelled_as_numpy_does() {
    let bytes = written(&NpyHeader::new(ElementType::F32, &[3]), 0);
    assert!(bytes.starts_with(b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }"));
    assert!(bytes.len() == 128 && bytes.ends_with(b" \n"));
    let bytes = written(&NpyHeader::new(ElementType::U8, &[2, 3, 4]), 256);
    assert!(bytes.len() == 256 && String::from_utf8_lossy(&bytes).contains("'shape': (2, 3, 4), }"));
    assert!(
        String::from_utf8_lossy(&written(&NpyHeader::new(ElementType::Text(5), &[]), 0))
            .contains("'<U5', 'fortran_order': False, 'shape': (), }")
    );
}

#[test]
fn unusable_headers_are_explained() {
    let read = |text: &str| {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        NpyHeader::read(&mut &bytes[..]).unwrap_err().to_string()
    };
    assert!(read("{'descr': '|O', 'fortran_order': False, 'shape': (3,)}").contains("'|O'"));
    assert!(read("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (3,)}").contains("record"));
    assert!(read("{'descr': '<f4', 'fortran_order': False, 'shape': (-3,)}").contains("shape"));
    assert!(read("{'descr': '<f4', 'fortran_order': 0, 'shape': (3,)}").contains("fortran_order"));
    assert!(read("((((((((((((((((((((((").contains("descr"));
    assert!(
        NpyHeader::read(&mut &b"\x93NUMPY\x02\x00\xff\xff\xff\xff"[..]).unwrap_err().to_string().contains("4294967295")
    );
    assert!(NpyHeader::read(&mut &b"PK"[..]).is_err());
}

#[test]
fn sizes_that_overflow_are_noticed() {
    let header = NpyHeader::new(ElementType::F64, &[usize::MAX, 2]);
    assert_eq!((header.count(), header.byte_count()), (None, None));
    assert_eq!(NpyHeader::new(ElementType::F64, &[usize::MAX / 4]).byte_count(), None);
}

#[test]
fn big_endian_numbers_are_read() {
    assert_eq!(u16::decode(&[1, 2, 9], true), [258]);
    assert_eq!(f32::decode(&1.5f32.to_le_bytes(), false), [1.5]);
}

proptest! {
    #[test]
    fn headers_round_trip(shape in proptest::collection::vec(0usize..100_000, 0..5), fortran_order: bool, kind in 0usize..8, reserve in 0usize..400) {
        let element = [ElementType::Bool, ElementType::U8, ElementType::U16, ElementType::U32, ElementType::I64, ElementType::F32, ElementType::F64, ElementType::Text(7)][kind];
        let header = NpyHeader { fortran_order, ..NpyHeader::new(element, &shape) };
        let bytes = written(&header, reserve);
        let (back, length) = NpyHeader::read(&mut &bytes[..]).unwrap();
        prop_assert_eq!(back, header);
        prop_assert_eq!(length, bytes.len());
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), text in "\\PC{0,80}") {
        let _ = NpyHeader::read(&mut &bytes[..]);
        let mut with_magic = b"\x93NUMPY\x01\x00".to_vec();
        with_magic.extend(&bytes);
        let _ = NpyHeader::read(&mut &with_magic[..]);
        let length = u16::try_from(text.len()).unwrap().to_le_bytes();
        let with_text = [b"\x93NUMPY\x01\x00", &length[..], text.as_bytes()].concat();
        let _ = NpyHeader::read(&mut &with_text[..]);
    }
}
