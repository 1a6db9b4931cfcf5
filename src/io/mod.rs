//! Frames in, results out: sources of grey frames, and readers and writers of flow, arrays, tables and pictures.
//!
//! Every file is written under a temporary name and renamed when it is whole ([`write`]). Every reader takes damaged and hostile files for what they
//! are: an [`Error::Format`](crate::Error::Format) with the path, never a panic, and no allocation that the file's own length does not justify.

mod decode;
mod jpeg;
mod npy;
mod source;
pub mod write;

pub use decode::read_image;
pub use npy::{Element, ElementType, NpyHeader};
pub use source::{
    Colour, FfmpegSource, FilesSource, FrameSource, MemorySource, NpySource, OpenOptions, Selected, Y4mSource, kind_of,
    open,
};
