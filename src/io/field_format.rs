//! The formats a flow field can be written in: one variant and one arm each.

use super::{FloatMap, FlowImage, npy::Element, write_flo, write_kitti, write_npz, write_pfm};
use crate::error::Result;
use crate::math::Real;
use crate::types::{FlowField, choices};
use std::path::Path;

/// A file format for one flow field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldFormat {
    /// Every plane and the metadata: [`write_npz`].
    Npz,
    /// Flow only, float32: [`write_flo`].
    Flo,
    /// Flow only, in steps of 1/64 px: [`write_kitti`].
    Kitti,
    /// Flow only, float32, as three planes u, v, 0: [`write_pfm`].
    Pfm,
}

choices!(FieldFormat, "format": Npz "npz", Flo "flo", Kitti "kitti", Pfm "pfm");

impl FieldFormat {
    /// Its files' extension.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Kitti => "png",
            other => other.name(),
        }
    }

    /// Writes a field. `options` says how it was made, where the format has room for it.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::error::Error::Argument) for a field of points in a format of pictures;
    /// [`Error::Io`](crate::error::Error::Io) with the path.
    pub fn write<T: Real + Element>(self, path: impl AsRef<Path>, field: &FlowField<T>, options: &str) -> Result<()> {
        match self {
            Self::Npz => write_npz(path, field, options),
            Self::Flo => write_flo(path, &FlowImage::from_field(field)?),
            Self::Kitti => write_kitti(path, &FlowImage::from_field(field)?),
            Self::Pfm => {
                let flow = FlowImage::from_field(field)?;
                let planes = vec![flow.u().to_vec(), flow.v().to_vec(), vec![0.0; flow.u().len()]];
                write_pfm(path, &FloatMap { width: flow.width(), height: flow.height(), planes })
            }
        }
    }
}
