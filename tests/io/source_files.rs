//! Image files: a folder of them, or one (whose pages are frames when it is a TIFF).

use image::{GrayImage, ImageBuffer, Luma, RgbImage};
use jacoflow::error::Error;
use jacoflow::io::{Colour, FilesSource, FrameSource, Grey, OpenOptions, open, open_colour, read_image};
use jacoflow::types::{AnyColourFrame, AnyFrame, Frame};
use proptest::prelude::*;
use std::fs;
use std::path::Path;

fn grey(level: u8) -> GrayImage {
    GrayImage::from_fn(4, 3, |x, y| Luma([level + (10 * y + x) as u8]))
}

fn first_samples(spec: &Path, options: &OpenOptions) -> Vec<f64> {
    let mut source = open(&spec.to_string_lossy(), options).unwrap();
    std::iter::from_fn(|| source.next_frame().unwrap()).map(|f| f.to_real::<f64>().get(0, 0)).collect()
}

#[test]
fn a_folder_is_read_in_natural_order_and_other_files_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    for i in [10u8, 9, 1, 100] {
        grey(i).save(folder.path().join(format!("frame{i}.png"))).unwrap();
    }
    fs::write(folder.path().join("notes.md"), "no picture").unwrap();
    fs::write(folder.path().join(".hidden.png"), "no picture").unwrap();
    fs::create_dir(folder.path().join("frame5.png")).unwrap();
    let options = OpenOptions::default();
    assert_eq!(first_samples(folder.path(), &options), [1.0, 9.0, 10.0, 100.0]);
    assert_eq!(first_samples(&folder.path().join("frame1*.png"), &options), [1.0, 10.0, 100.0]);
    assert_eq!(first_samples(&folder.path().join("frame9.png"), &options), [9.0]);
    let part = OpenOptions { start: 1, step: 2, ..options };
    assert_eq!(first_samples(folder.path(), &part), [9.0, 100.0]);
    fs::write(folder.path().join("list.txt"), "frame100.png\nframe9.png\n").unwrap();
    assert_eq!(first_samples(&folder.path().join("list.txt"), &options), [100.0, 9.0]);
}

#[test]
#[cfg(unix)]
fn a_frame_that_leads_nowhere_is_not_left_out() {
    let folder = tempfile::tempdir().unwrap();
    for i in [1u8, 3] {
        grey(i).save(folder.path().join(format!("frame{i}.png"))).unwrap();
    }
    std::os::unix::fs::symlink("not-fetched", folder.path().join("frame2.png")).unwrap();
    for spec in [folder.path().to_path_buf(), folder.path().join("frame*.png")] {
        let error = open(&spec.to_string_lossy(), &OpenOptions::default()).map(|_| ()).unwrap_err();
        assert!(error.to_string().contains("frame2.png"), "{error}");
    }
}

#[test]
fn numbers_of_any_padding_are_compared_by_their_value() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["f.png", "f0.png", "f1.png", "f01.png", "f001b2.png", "f1b10.png", "f009.png", "f10.png", "f0100.png"];
    for (i, name) in names.iter().enumerate().rev() {
        grey(i as u8).save(folder.path().join(name)).unwrap();
    }
    let expected: Vec<f64> = (0..names.len()).map(|i| i as f64).collect();
    assert_eq!(first_samples(folder.path(), &OpenOptions::default()), expected);
    assert_eq!(first_samples(&folder.path().join("f*.png"), &OpenOptions::default()), expected);
}

#[test]
fn nothing_to_read_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for spec in [folder.path().to_path_buf(), folder.path().join("*.png")] {
        let error = open(&spec.to_string_lossy(), &OpenOptions::default()).err().unwrap();
        assert!(matches!(error, Error::Format { .. }) && error.to_string().contains("no images"), "{error}");
    }
    assert!(FilesSource::new(vec![], Colour::Error).is_err());
}

#[test]
fn every_format_gives_its_samples() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.png", "a.tif", "a.bmp", "a.pgm"] {
        let path = folder.path().join(name);
        grey(5).save(&path).unwrap();
        assert_eq!(
            read_image(&path, Colour::Error).unwrap(),
            AnyFrame::U8(jacoflow::types::Frame::from_fn(4, 3, |x, y| (5 + 10 * y + x) as u8)),
            "{name}"
        );
    }
    grey(5).save(folder.path().join("a.jpg")).unwrap();
    assert_eq!(read_image(folder.path().join("a.jpg"), Colour::Error).unwrap().size(), (4, 3));
    let deep: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_fn(4, 3, |x, _| Luma([1000 * x as u16]));
    for name in ["b.png", "b.tif", "b.pgm"] {
        let path = folder.path().join(name);
        deep.save(&path).unwrap();
        assert_eq!(
            read_image(&path, Colour::Error).unwrap(),
            AnyFrame::U16(jacoflow::types::Frame::from_fn(4, 3, |x, _| 1000 * x as u16)),
            "{name}"
        );
    }
}

#[test]
fn colour_is_refused_with_advice_or_converted() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["c.png", "c.tif", "c.bmp", "c.ppm"] {
        let path = folder.path().join(name);
        RgbImage::from_pixel(4, 3, ::image::Rgb([255, 0, 0])).save(&path).unwrap();
        let message = read_image(&path, Colour::Error).unwrap_err().to_string();
        assert!(message.contains(name) && message.contains("luminance"), "{message}");
        assert_eq!(read_image(&path, Colour::Luminance).unwrap().to_real::<f64>().get(1, 1), 76.0, "{name}");
    }
}

#[test]
fn colour_is_kept_whole_and_grey_says_that_colour_is_needed() {
    let folder = tempfile::tempdir().unwrap();
    let rgb = |x: u32, y: u32| [(60 * x) as u8, (70 * y) as u8, 200];
    let picture = RgbImage::from_fn(4, 3, |x, y| ::image::Rgb(rgb(x, y)));
    let deep: ImageBuffer<::image::Rgb<u16>, Vec<u16>> =
        ImageBuffer::from_fn(4, 3, |x, y| ::image::Rgb(rgb(x, y).map(|v| 257 * u16::from(v))));
    let want = AnyColourFrame::U8(Frame::from_fn(4, 3, |x, y| rgb(x as u32, y as u32)));
    for name in ["c.png", "c.tif", "c.bmp", "c.ppm"] {
        picture.save(folder.path().join(name)).unwrap();
        assert_eq!(read_image(folder.path().join(name), Grey::Error).unwrap(), want, "{name}");
    }
    for name in ["d.png", "d.tif", "d.ppm"] {
        deep.save(folder.path().join(name)).unwrap();
        let AnyColourFrame::U16(got) = read_image(folder.path().join(name), Grey::Error).unwrap() else {
            panic!("{name}")
        };
        assert_eq!(got.get(3, 2), rgb(3, 2).map(|v| 257 * u16::from(v)), "{name}");
    }
    RgbImage::from_pixel(16, 16, ::image::Rgb([200, 30, 60])).save(folder.path().join("e.jpg")).unwrap();
    let AnyColourFrame::U8(got) = read_image(folder.path().join("e.jpg"), Grey::Error).unwrap() else {
        panic!("e.jpg")
    };
    assert!(got.get(8, 8).iter().zip([200_u8, 30, 60]).all(|(a, b)| a.abs_diff(b) < 5), "{:?}", got.get(8, 8));
    for name in ["g.png", "g.tif", "g.pgm", "g.jpg"] {
        let path = folder.path().join(name);
        grey(5).save(&path).unwrap();
        let message = read_image(&path, Grey::Error).unwrap_err().to_string();
        assert!(message.contains(name) && message.contains("colour is needed"), "{message}");
        assert_eq!(read_image(&path, Grey::Repeat).unwrap().size(), (4, 3));
    }
}

#[test]
fn sources_of_files_give_colour() {
    let folder = tempfile::tempdir().unwrap();
    for i in [2_u8, 10, 1] {
        RgbImage::from_pixel(4, 3, ::image::Rgb([i, 0, 9])).save(folder.path().join(format!("f{i}.png"))).unwrap();
    }
    fs::write(folder.path().join("list.txt"), "f10.png\nf1.png\n").unwrap();
    let reds = |spec: &str, options: &OpenOptions| {
        let mut source = open_colour(&folder.path().join(spec).to_string_lossy(), options).unwrap();
        let frames = std::iter::from_fn(|| source.next_frame().unwrap());
        frames.map(|frame| frame.scaled(1.0).get(0, 0)[0]).collect::<Vec<f32>>()
    };
    let options = OpenOptions::default();
    assert_eq!(reds("", &options), [1.0, 2.0, 10.0]);
    assert_eq!(reds("f1*.png", &options), [1.0, 10.0]);
    assert_eq!(reds("list.txt", &options), [10.0, 1.0]);
    assert_eq!(reds("", &OpenOptions { start: 1, step: 2, ..options }), [2.0]);
    grey(0).save(folder.path().join("f3.png")).unwrap();
    let error = open_colour(&folder.path().join("f3.png").to_string_lossy(), &options).unwrap().next_frame();
    assert!(error.unwrap_err().to_string().contains("colour is needed"));
    assert_eq!(reds("f3.png", &OpenOptions { grey: Grey::Repeat, ..options }), [0.0]);
}

#[test]
fn a_changing_size_or_type_names_the_file_and_both_sizes() {
    let folder = tempfile::tempdir().unwrap();
    grey(0).save(folder.path().join("f1.png")).unwrap();
    GrayImage::new(5, 3).save(folder.path().join("f2.png")).unwrap();
    let mut source = open(&folder.path().to_string_lossy(), &OpenOptions::default()).unwrap();
    source.next_frame().unwrap();
    let message = source.next_frame().unwrap_err().to_string();
    assert!(message.contains("f2.png") && message.contains("5 x 3") && message.contains("4 x 3"), "{message}");
    let deep: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::new(4, 3);
    deep.save(folder.path().join("f2.png")).unwrap();
    let mut source = open(&folder.path().to_string_lossy(), &OpenOptions::default()).unwrap();
    source.next_frame().unwrap();
    assert!(source.next_frame().unwrap_err().to_string().contains("uint16"));
}

/// A TIFF of float pages, 2 x 2 px.
fn write_pages(path: &Path, pages: &[f32]) {
    let mut encoder = tiff::encoder::TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
    for &level in pages {
        encoder.write_image::<tiff::encoder::colortype::Gray32Float>(2, 2, &[level; 4]).unwrap();
    }
}

#[test]
fn tiff_pages_are_frames_of_a_file_opened_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stack.tif");
    write_pages(&path, &[1.5, 2.5, 3.5]);
    assert_eq!(first_samples(&path, &OpenOptions::default()), [1.5, 2.5, 3.5]);
    let mut source = open(&path.to_string_lossy(), &OpenOptions { start: 1, ..OpenOptions::default() }).unwrap();
    assert_eq!(source.len_hint(), Some(2));
    assert!(matches!(source.next_frame().unwrap(), Some(AnyFrame::F32(_))));
    assert_eq!(source.len_hint(), Some(1));
    let message =
        open(&folder.path().to_string_lossy(), &OpenOptions::default()).unwrap().next_frame().unwrap_err().to_string();
    assert!(message.contains("several pages"), "{message}");
}

#[test]
fn damaged_files_are_format_errors_with_their_path() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["d.png", "d.tif", "d.bmp", "d.pgm", "d.jpg"] {
        let path = folder.path().join(name);
        GrayImage::from_fn(40, 30, |x, y| Luma([(x * y) as u8])).save(&path).unwrap();
        let whole = fs::read(&path).unwrap();
        for keep in [0, 1, 10, whole.len() / 2] {
            fs::write(&path, &whole[..keep]).unwrap();
            let error = read_image(&path, Colour::Error).unwrap_err();
            assert!(
                matches!(error, Error::Format { .. }) && error.to_string().contains(name),
                "{name} {keep}: {error}"
            );
        }
    }
    let huge = folder.path().join("huge.pgm");
    fs::write(&huge, "P5 60000 60000 255\nx").unwrap();
    assert!(matches!(read_image(&huge, Colour::Error), Err(Error::Format { .. })));
    fs::write(&huge, "P5 20000 20000 255\nx").unwrap();
    assert!(
        read_image(&huge, Colour::Error).unwrap_err().to_string().contains("too large"),
        "a few bytes cannot hold 400 megapixels"
    );
    fs::write(&huge, "P5 4000000000 4000000000 255\nx").unwrap();
    assert!(matches!(read_image(&huge, Colour::Error), Err(Error::Format { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn damage_never_makes_a_reader_panic(kind in 0usize..5, at in 0usize..400, value: u8, cut in 0usize..2000, random in proptest::collection::vec(any::<u8>(), 0..64)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(["d.png", "d.tif", "d.bmp", "d.pgm", "d.jpg"][kind]);
        GrayImage::from_fn(20, 15, |x, y| Luma([(x * y) as u8])).save(&path).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        let at = at % bytes.len();
        bytes[at] = value;
        bytes.truncate(cut);
        fs::write(&path, &bytes).unwrap();
        let _ = read_image(&path, Colour::Luminance);
        let mut headed = bytes[..bytes.len().min(4)].to_vec();
        headed.extend(&random);
        fs::write(&path, &headed).unwrap();
        let _ = read_image(&path, Colour::Luminance);
        if let Ok(mut source) = open(&path.to_string_lossy(), &OpenOptions::default()) {
            let _ = source.next_frame();
        }
    }
}
