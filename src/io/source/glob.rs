//! Image files that match a pattern.

use super::{FilesSource, Kind, files::is_image, files::is_pattern, files::sort_naturally};
use crate::error::{Error, Result};
use crate::io::decode::EXTENSIONS;
use std::path::PathBuf;

pub(super) const KIND: Kind = Kind {
    name: "glob",
    accepts: is_pattern,
    signatures: &[],
    has_planes: true,
    members: |spec| matches(spec).unwrap_or_default(),
    open: |spec, options| Ok(Box::new(FilesSource::new(matches(spec)?, options.colour)?.with_planes(options.planes))),
    open_colour: |spec, options| {
        Ok(Box::new(FilesSource::new(matches(spec)?, options.grey)?.with_planes(options.planes)))
    },
};

fn matches(pattern: &str) -> Result<Vec<PathBuf>> {
    let paths = glob::glob(pattern)
        .map_err(|e| Error::argument("frames", "a pattern of * ? [..] **", format!("{pattern} ({e})")))?;
    let mut found = Vec::new();
    for path in paths {
        let path = path.map_err(|e| Error::io(e.path(), std::io::Error::from(e.error().kind())))?;
        if is_image(&path)? {
            found.push(path);
        }
    }
    if found.is_empty() {
        return Err(Error::format(pattern, format!("matches no images ({})", EXTENSIONS.join(", "))));
    }
    sort_naturally(&mut found);
    Ok(found)
}
