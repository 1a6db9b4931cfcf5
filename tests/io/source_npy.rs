//! `.npy` stacks, read a few frames at a time.

use jacoflow::error::Error;
use jacoflow::io::{Colour, Element, ElementType, FrameSource, Grey, NpyHeader, NpySource, write_values};
use jacoflow::types::{AnyColourFrame, AnyFrame, Frame};
use proptest::prelude::*;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

fn save<T: Element>(folder: &Path, header: &NpyHeader, values: &[T]) -> PathBuf {
    let path = folder.join("stack.npy");
    let mut file = File::create(&path).unwrap();
    header.write(&mut file, 0).unwrap();
    write_values(values, &mut file).unwrap();
    path
}

fn all(path: &Path) -> Vec<AnyFrame> {
    let mut source = NpySource::open(path, Colour::Luminance).unwrap();
    std::iter::from_fn(|| source.next_frame().unwrap()).collect()
}

#[test]
fn both_orders_give_the_same_frames() {
    let folder = tempfile::tempdir().unwrap();
    let (t, h, w) = (5, 3, 6);
    let value = |i: usize, y: usize, x: usize| (100 * i + 10 * y + x) as u16;
    let want: Vec<_> = (0..t).map(|i| AnyFrame::U16(Frame::from_fn(w, h, |x, y| value(i, y, x)))).collect();
    let mut c_order = Vec::new();
    for i in 0..t {
        for y in 0..h {
            c_order.extend((0..w).map(|x| value(i, y, x)));
        }
    }
    let mut fortran = Vec::new();
    for x in 0..w {
        for y in 0..h {
            fortran.extend((0..t).map(|i| value(i, y, x)));
        }
    }
    let mut header = NpyHeader::new(ElementType::U16, &[t, h, w]);
    assert_eq!(all(&save(folder.path(), &header, &c_order)), want);
    header.fortran_order = true;
    let path = save(folder.path(), &header, &fortran);
    assert_eq!(all(&path), want);
    let mut source = NpySource::open(&path, Colour::Error).unwrap();
    source.next_frame().unwrap();
    assert_eq!((source.skip(2).unwrap(), source.len_hint()), (2, Some(2)));
    assert_eq!(source.next_frame().unwrap().as_ref(), Some(&want[3]));
}

#[test]
fn single_frames_and_colour_are_understood() {
    let folder = tempfile::tempdir().unwrap();
    let path = save(folder.path(), &NpyHeader::new(ElementType::F64, &[2, 3]), &[1.0f64, 2.0, 3.0, 4.0, 5.0, f64::NAN]);
    let frames = all(&path);
    assert!(frames.len() == 1 && frames[0].size() == (3, 2));
    let path = save(folder.path(), &NpyHeader::new(ElementType::U8, &[1, 1, 2, 3]), &[255u8, 0, 0, 9, 9, 9]);
    assert_eq!(all(&path), [AnyFrame::U8(Frame::new(2, 1, vec![76, 9]).unwrap())]);
    let refused = NpySource::open(&path, Colour::Error).unwrap_err().to_string();
    assert!(refused.contains("luminance") && refused.contains("stack.npy"), "{refused}");
}

/// Pictures (H, W, 3) are not taken for H frames of W x 3 px.
#[test]
fn one_colour_picture_is_a_picture_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    for channels in [3, 4] {
        let header = NpyHeader::new(ElementType::U8, &[2, 5, channels]);
        let path = save(folder.path(), &header, &vec![7u8; 10 * channels]);
        assert_eq!(all(&path), [AnyFrame::U8(Frame::filled(5, 2, 7))]);
        let refused = NpySource::open(&path, Colour::Error).unwrap_err().to_string();
        assert!(refused.contains("one colour picture") && refused.contains("--luminance"), "{refused}");
    }
    // Frames as small in both directions are no picture.
    let path = save(folder.path(), &NpyHeader::new(ElementType::U8, &[9, 4, 3]), &[7u8; 108]);
    assert_eq!(NpySource::open(&path, Colour::Error).unwrap().len_hint(), Some(9));
}

#[test]
fn colour_frames_come_in_either_order() {
    let folder = tempfile::tempdir().unwrap();
    let (t, h, w) = (3, 2, 4);
    let value = |i: usize, y: usize, x: usize, c: usize| (1000 * i + 100 * y + 10 * x + c) as u16;
    let pixel = |i: usize, y: usize, x: usize| [0, 1, 2].map(|c| value(i, y, x, c));
    let want: Vec<_> = (0..t).map(|i| AnyColourFrame::U16(Frame::from_fn(w, h, |x, y| pixel(i, y, x)))).collect();
    let places = |outer: usize, inner: usize| (0..outer).flat_map(move |a| (0..inner).map(move |b| (a, b)));
    let c_order: Vec<u16> = (0..t).flat_map(|i| places(h, w).flat_map(move |(y, x)| pixel(i, y, x))).collect();
    let fortran: Vec<u16> =
        (0..3).flat_map(|c| places(w, h).flat_map(move |(x, y)| (0..t).map(move |i| value(i, y, x, c)))).collect();
    let mut header = NpyHeader::new(ElementType::U16, &[t, h, w, 3]);
    let read = |path: &Path| {
        let mut source = NpySource::open(path, Grey::Error).unwrap();
        std::iter::from_fn(|| source.next_frame().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(read(&save(folder.path(), &header, &c_order)), want);
    header.fortran_order = true;
    assert_eq!(read(&save(folder.path(), &header, &fortran)), want);
    let one = save(folder.path(), &NpyHeader::new(ElementType::U16, &[h, w, 3]), &c_order[..h * w * 3]);
    assert_eq!(read(&one), want[..1]);
}

#[test]
fn grey_stacks_are_refused_where_colour_is_needed_or_repeated() {
    let folder = tempfile::tempdir().unwrap();
    for shape in [vec![2, 1, 2], vec![2, 1, 2, 1]] {
        let path = save(folder.path(), &NpyHeader::new(ElementType::F32, &shape), &[0.5_f32, 1.0, 2.0, 3.0]);
        let message = NpySource::open(&path, Grey::Error).unwrap_err().to_string();
        assert!(message.contains("colour is needed") && message.contains("stack.npy"), "{message}");
        let first = NpySource::open(&path, Grey::Repeat).unwrap().next_frame().unwrap().unwrap();
        assert_eq!(first, AnyColourFrame::F32(Frame::new(2, 1, vec![[0.5; 3], [1.0; 3]]).unwrap()));
    }
}

#[test]
fn lies_about_the_size_are_found_before_anything_is_allocated() {
    let folder = tempfile::tempdir().unwrap();
    for shape in [
        vec![1 << 40, 3, 4],
        vec![3, 30_000, 30_000],
        vec![usize::MAX, 8, 8],
        vec![2, 3, 5],
        vec![7],
        vec![1, 1, 1, 2],
        vec![usize::MAX - 99, 1, 1],
    ] {
        for fortran_order in [false, true] {
            for element in [ElementType::U8, ElementType::F32] {
                let header = NpyHeader { fortran_order, ..NpyHeader::new(element, &shape) };
                let path = save(folder.path(), &header, &[0u8; 24]);
                let error = NpySource::open(&path, Colour::Luminance).unwrap_err();
                assert!(matches!(error, Error::Format { .. }), "{shape:?}: {error}");
            }
        }
    }
    let path = save(folder.path(), &NpyHeader::new(ElementType::Text(1), &[1, 3, 4]), &[65_u32; 12]);
    assert!(NpySource::open(&path, Colour::Error).unwrap_err().to_string().contains("got text"));
}

#[test]
fn other_numbers_become_the_type_that_holds_them() {
    let folder = tempfile::tempdir().unwrap();
    let first = |path: PathBuf| NpySource::open(&path, Colour::Error).unwrap().next_frame();
    let path = save(folder.path(), &NpyHeader::new(ElementType::I16, &[1, 1, 2]), &[-3_i16, 4]);
    assert_eq!(first(path).unwrap(), Some(AnyFrame::F32(Frame::new(2, 1, vec![-3.0, 4.0]).unwrap())));
    let path = save(folder.path(), &NpyHeader::new(ElementType::Bool, &[1, 2]), &[1_u8, 0]);
    assert_eq!(first(path).unwrap(), Some(AnyFrame::U8(Frame::new(2, 1, vec![1, 0]).unwrap())));
    let path = save(folder.path(), &NpyHeader::new(ElementType::U32, &[1, 2]), &[u32::MAX, 0]);
    assert_eq!(first(path).unwrap(), Some(AnyFrame::F64(Frame::new(2, 1, vec![f64::from(u32::MAX), 0.0]).unwrap())));
    // 1 and -2 as float16.
    let path = save(folder.path(), &NpyHeader::new(ElementType::F16, &[1, 2]), &[0x3c00_u16, 0xc000]);
    assert_eq!(first(path).unwrap(), Some(AnyFrame::F32(Frame::new(2, 1, vec![1.0, -2.0]).unwrap())));
    let path = save(folder.path(), &NpyHeader::new(ElementType::I64, &[1, 2]), &[1_i64 << 53, 7]);
    assert!(first(path).is_ok());
    let path = save(folder.path(), &NpyHeader::new(ElementType::I64, &[1, 2]), &[(1_i64 << 53) + 1, 7]);
    assert!(first(path).unwrap_err().to_string().contains("beyond 2^53"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn no_file_makes_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), cut in 0usize..200) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hostile.npy");
        std::fs::write(&path, &bytes).unwrap();
        prop_assert!(NpySource::open(&path, Colour::Luminance).is_err());
        let path = save(folder.path(), &NpyHeader::new(ElementType::U8, &[2, 5, 6]), &[1u8; 60]);
        let whole = std::fs::read(&path).unwrap();
        File::create(&path).unwrap().write_all(&whole[..cut.min(whole.len() - 1)]).unwrap();
        let is_format_error = matches!(NpySource::open(&path, Colour::Error), Err(Error::Format { .. }));
        prop_assert!(is_format_error);
    }
}

/// A frame takes no more memory than its samples, and a pass over the file no more than its own frames.
#[test]
fn a_million_frames_of_one_pixel_come_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let count = 1_000_000;
    let values: Vec<u16> = (0..count).map(|t| (t % 65_521) as u16).collect();
    let header = NpyHeader { fortran_order: true, ..NpyHeader::new(ElementType::U16, &[count, 1, 1]) };
    let path = save(folder.path(), &header, &values);
    let mut source = NpySource::open(&path, Colour::Error).unwrap();
    for &value in &values[..1000] {
        assert_eq!(source.next_frame().unwrap().unwrap(), AnyFrame::U16(Frame::filled(1, 1, value)));
    }
    assert_eq!(source.skip(count - 1001).unwrap(), count - 1001);
    assert_eq!(source.next_frame().unwrap().unwrap(), AnyFrame::U16(Frame::filled(1, 1, values[count - 1])));
    assert!(source.next_frame().unwrap().is_none());
}
