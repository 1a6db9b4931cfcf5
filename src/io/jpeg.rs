//! Whether a JPEG file is all there: decoders fill what is missing with grey and say nothing.

/// Whether the compressed data are followed by the end marker; thumbnails do not count.
pub(crate) fn is_whole(bytes: &[u8]) -> bool {
    scan_start(bytes).is_some_and(|start| bytes[start..].windows(2).any(|pair| pair == [0xff, 0xd9]))
}

/// The first byte after the marker that begins the compressed data, found by walking from segment to segment.
fn scan_start(bytes: &[u8]) -> Option<usize> {
    const START_OF_SCAN: u8 = 0xda;
    let mut at = 2;
    loop {
        let (&marker, &kind) = (bytes.get(at)?, bytes.get(at + 1)?);
        match (marker, kind) {
            (0xff, START_OF_SCAN) => return Some(at + 2),
            // Fill bytes before a marker.
            (0xff, 0xff) => at += 1,
            (0xff, _) => {
                let length = usize::from(u16::from_be_bytes([*bytes.get(at + 2)?, *bytes.get(at + 3)?]));
                at += 2 + length;
            }
            _ => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_marker_counts_only_after_the_scan_began() {
        let header = [0xff, 0xd8, 0xff, 0xe1, 0, 6, 1, 2, 0xff, 0xd9, 0xff, 0xff, 0xda, 0, 2];
        assert!(!is_whole(&header), "an end marker inside a segment is a thumbnail's");
        assert!(is_whole(&[&header[..], &[1, 2, 3, 0xff, 0xd9]].concat()));
        assert!(is_whole(&[&header[..], &[1, 0xff, 0xd9, b'x']].concat()), "more may follow");
        assert!(!is_whole(&[&header[..], &[1, 2, 0xff]].concat()));
        for cut in 0..header.len() {
            assert!(!is_whole(&header[..cut]));
        }
    }
}
