//! Pictures as a sequence: colour YUV4MPEG2, which players and encoders read.

use jacoflow::image::picture::Picture;
use jacoflow::io::{OpenOptions, SequenceWriter, open};

#[test]
fn a_sequence_is_read_back_and_has_one_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.y4m");
    let mut sequence = SequenceWriter::create(&path, 29.97).unwrap();
    let picture = |level: u8| Picture::filled(6, 4, [level; 3]);
    sequence.write(&picture(10)).unwrap();
    sequence.write(&picture(200)).unwrap();
    assert!(sequence.write(&Picture::filled(4, 6, [0; 3])).unwrap_err().to_string().starts_with("picture"));
    assert!(!path.exists());
    sequence.finish().unwrap();
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let mut levels = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        levels.push(frame.to_real::<f64>().get(5, 3));
    }
    assert_eq!(levels, [10.0, 200.0]);
    assert!(SequenceWriter::create(folder.path().join("b.y4m"), 0.0).is_err());
}
