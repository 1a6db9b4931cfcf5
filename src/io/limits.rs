//! What a file may ask for: sizes, and memory that its own length justifies.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;

/// Largest width and height accepted from a file, px.
pub(crate) const MAX_SIDE: usize = 65_536;
/// Most memory one decoded picture may take, bytes.
const MAX_BYTES: u64 = 2 << 30;
/// Bytes of picture that one byte of file can stand for at most (long runs in LZW).
const MAX_EXPANSION: u64 = 4096;
/// Memory that any file may ask for: decoders keep buffers of their own.
const FREE_BYTES: u64 = 16 << 20;

/// Memory that decoding `file` may take: what its own length can justify.
pub(crate) fn memory_limit(file: &File) -> std::io::Result<u64> {
    Ok(file.metadata()?.len().saturating_mul(MAX_EXPANSION).saturating_add(FREE_BYTES).min(MAX_BYTES))
}

/// Refuses sizes that no frame has, before memory is taken for them.
pub(crate) fn check_size(path: &Path, width: usize, height: usize) -> Result<()> {
    if (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) {
        return Ok(());
    }
    Err(Error::format(path, format!("a frame of {width} x {height} px (expected 1 to {MAX_SIDE} px each way)")))
}

/// Failures of the system stay such; everything else says that the file is damaged.
pub(crate) fn io_error(path: &Path, error: std::io::Error) -> Error {
    match error.kind() {
        ErrorKind::PermissionDenied | ErrorKind::NotFound | ErrorKind::IsADirectory | ErrorKind::OutOfMemory => {
            Error::io(path, error)
        }
        ErrorKind::UnexpectedEof => Error::format(path, "cut off"),
        _ => Error::format(path, error.to_string()),
    }
}
