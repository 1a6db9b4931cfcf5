//! Frames in, results out: sources, and files of flow, disparity, arrays, tables, tracks, pictures.
//!
//! Every file is written under a temporary name and renamed when it is whole ([`mod@write`]). Every reader
//! takes damaged and hostile files for what they are: an [`Error::Format`](crate::Error::Format) with the
//! path, never a panic, and no allocation that the file's own length does not justify.

mod channels;
mod decode;
mod disparity;
mod field_format;
mod field_npz;
mod flo;
mod flow_image;
mod jpeg;
mod kitti;
mod limits;
mod mot;
mod npy;
pub mod npz;
mod numbered;
mod pages;
mod pfm;
mod picture_png;
mod picture_sequence;
mod planes;
mod pnm;
mod sink;
mod sixteen_bit_png;
mod source;
mod table;
mod track_table;
pub mod write;
mod ycbcr;

pub use channels::{ChannelPolicy, Colour, FrameFormat, Grey};
pub use decode::{read_image, read_plane};
pub use disparity::{DisparityFormat, DisparityMap};
pub use field_format::FieldFormat;
pub use field_npz::{StoredField, read_npz, read_npz_from, write_npz, write_npz_to};
pub use flo::{read_flo, write_flo};
pub use flow_image::FlowImage;
pub use kitti::{read_kitti, write_kitti};
pub use mot::{MotBox, MotTable, read_mot};
pub use npy::{Element, ElementType, NpyHeader, write_values};
pub use numbered::NumberedFiles;
pub use pfm::{FloatMap, read_pfm, write_pfm};
pub use picture_png::{write_colour_png, write_frame_png, write_picture};
pub use picture_sequence::SequenceWriter;
pub use planes::{PixelSize, PlaneSelection, Slices};
pub use sink::{ColourSink, FrameSink, NpySink, PngSink, Y4mSink, check_sink, open_colour_sink, open_sink};
pub use source::{
    ColourSource, DoubleFrames, FfmpegSource, FilesSource, FrameSource, MemorySource, NpySource, OpenOptions, Selected,
    ViewLayout, ViewPairs, Y4mSource, files_read, kind_of, open, open_colour,
};
pub use table::{FieldTable, TableWriter, cell};
pub use track_table::TrackTable;
