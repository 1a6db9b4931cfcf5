//! A YUV4MPEG2 stream, grey or in colour, to a file or standard output.

use jacoflow::error::Error;
use jacoflow::io::{FrameSink, Y4mSink};
use jacoflow::types::{AnyFrame, Frame};

#[test]
fn floats_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut sink = Y4mSink::create(folder.path().join("a.y4m"), 25.0).unwrap();
    assert!(matches!(sink.write(&AnyFrame::F32(Frame::filled(1, 1, 0.0))), Err(Error::Type { argument: "frame", .. })));
}
