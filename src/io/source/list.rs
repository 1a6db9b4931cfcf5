//! A text file that lists image files.

use super::{FilesSource, Kind, has_extension};
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    name: "list",
    accepts: |spec| has_extension(spec, &["txt", "lst"]),
    signatures: &[],
    has_planes: true,
    members: |spec| listed(Path::new(spec)).unwrap_or_default(),
    open: |spec, options| {
        Ok(Box::new(FilesSource::new(listed(Path::new(spec))?, options.colour)?.with_planes(options.planes)))
    },
    open_colour: |spec, options| {
        Ok(Box::new(FilesSource::new(listed(Path::new(spec))?, options.grey)?.with_planes(options.planes)))
    },
};

/// Longest list read, bytes.
const MAX_BYTES: u64 = 256 << 20;

/// The paths in a list, one a line, in the order written; relative ones start at the list's folder. Empty
/// lines and lines that begin with `#` are skipped.
fn listed(list: &Path) -> Result<Vec<PathBuf>> {
    let file = File::open(list).map_err(|e| Error::io(list, e))?;
    let folder = list.parent().unwrap_or(Path::new(""));
    let mut paths = Vec::new();
    for line in BufReader::new(file.take(MAX_BYTES)).lines() {
        let line = line.map_err(|e| match e.kind() {
            ErrorKind::InvalidData => Error::format(list, "not a list of files: it is not text"),
            _ => Error::io(list, e),
        })?;
        // Editors of Windows begin text with a byte order mark.
        let line = line.trim_start_matches('\u{feff}').trim();
        if !line.is_empty() && !line.starts_with('#') {
            paths.push(folder.join(line));
        }
    }
    if paths.is_empty() {
        return Err(Error::format(list, "lists no files"));
    }
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_paths_relative_to_the_list() {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("frames.txt");
        std::fs::write(&list, "\u{feff}# frames\nb.png\r\n\n  a b.png \n/abs/c.png\n").unwrap();
        let want: Vec<_> = ["b.png", "a b.png", "/abs/c.png"].iter().map(|n| folder.path().join(n)).collect();
        assert_eq!(listed(&list).unwrap(), want);
        std::fs::write(&list, "\n# nothing\n").unwrap();
        assert!(matches!(listed(&list), Err(Error::Format { .. })));
        std::fs::write(&list, [0xff, 0xfe, 0x00]).unwrap();
        assert!(matches!(listed(&list), Err(Error::Format { .. })));
    }
}
