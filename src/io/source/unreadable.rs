//! Files of frames that are not read here, by their names: what can be done with each.

use super::{Kind, OpenOptions, has_extension};
use crate::error::{Error, Result};
use std::path::Path;

pub(super) const KIND: Kind = Kind {
    name: "unreadable",
    accepts: |spec| Path::new(spec).is_file() && is_known(spec),
    signatures: &[],
    has_planes: true,
    members: super::no_members,
    open: refuse,
    open_colour: refuse,
};

/// Endings of names, what such files are and what can be done with them, of those that the Python package
/// reads.
const READ_IN_PYTHON: [(&[&str], &str); 2] = [
    (
        &["npz"],
        "an archive of numpy arrays: open it in Python with jacoflow.io.frames(path, key=...), or save the stack (T, H, W) as .npy",
    ),
    (
        &["h5", "hdf5", "mat"],
        "HDF5 or MATLAB: open it in Python with jacoflow.io.frames(path, key=...) (needs the package h5py, for MATLAB files before 7.3 scipy), or save the stack (T, H, W) as .npy",
    ),
];

/// The same of those that no part of the package reads, with any dependency.
const READ_NOWHERE: [(&[&str], &str); 3] = [
    (
        &["raw", "bin", "dat"],
        "samples without a header: in Python frames = numpy.fromfile(path, dtype).reshape(T, H, W), then pass the array or save it with numpy.save as .npy",
    ),
    (
        &["mraw", "cih", "cihx"],
        "a recording of a Photron camera: export it as 16-bit TIFF, or in Python frames, info = pyMRAW.load_video(\"name.cih\"), then pass the array or save it as .npy",
    ),
    (
        &["cine"],
        "a recording of a Phantom camera: export it as 16-bit TIFF, or read it in Python with the package pycine, then pass the array or save it as .npy",
    ),
];

fn advice(spec: &str, known: &[(&[&str], &'static str)]) -> Option<&'static str> {
    known.iter().find(|(endings, _)| has_extension(spec, endings)).map(|(_, advice)| *advice)
}

fn is_known(spec: &str) -> bool {
    advice(spec, &READ_IN_PYTHON).or_else(|| advice(spec, &READ_NOWHERE)).is_some()
}

fn refuse<S: ?Sized>(spec: &str, _: &OpenOptions) -> Result<Box<S>> {
    Err(match advice(spec, &READ_IN_PYTHON) {
        Some(advice) => Error::Missing(format!("{spec}: {advice}")),
        None => Error::format(spec, advice(spec, &READ_NOWHERE).unwrap_or("not read")),
    })
}
