//! Trackers as bytes, from which they go on bit for bit: a mark, the number of the layout, the content and a
//! checksum.

use crate::error::{Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Bytes of mark and layout.
const HEAD: usize = 6;
/// Bytes of the checksum.
const TAIL: usize = 8;

/// A kind of bytes.
pub(super) struct Kind {
    /// The first bytes.
    pub mark: [u8; 4],
    /// Number of the layout: it goes up with every change of what is kept.
    pub layout: u16,
    /// What is kept, for messages.
    pub what: &'static str,
}

impl Kind {
    /// The content as bytes.
    pub fn sealed(&self, content: &impl Serialize) -> Vec<u8> {
        let head = [&self.mark[..], &self.layout.to_le_bytes()].concat();
        // Only what has no known length, or an allocation, could fail.
        let mut bytes = postcard::to_extend(content, head).expect("lists of known length");
        bytes.extend(checksum(&bytes).to_le_bytes());
        bytes
    }

    /// The content of bytes that [`Kind::sealed`] returned.
    pub fn opened<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T> {
        if bytes.len() < HEAD + TAIL || bytes[..4] != self.mark {
            return Err(self.damaged("bytes of another kind"));
        }
        let layout = u16::from_le_bytes([bytes[4], bytes[5]]);
        if layout != self.layout {
            let got = format!("those of another version (layout {layout}, this one reads {})", self.layout);
            return Err(self.damaged(&got));
        }
        let (content, tail) = bytes.split_at(bytes.len() - TAIL);
        if checksum(content).to_le_bytes() != tail {
            return Err(self.damaged("damaged bytes"));
        }
        postcard::from_bytes(&content[HEAD..]).map_err(|error| self.damaged(&error.to_string()))
    }

    /// The error for other bytes.
    pub fn damaged(&self, got: &str) -> Error {
        Error::argument("state", format!("the bytes of a pickled {}", self.what), got)
    }
}

/// FNV-1a of 64 bits (G. Fowler, L. C. Noll, K.-P. Vo, D. Eastlake, "The FNV Non-Cryptographic Hash
/// Algorithm"): any one changed byte changes it.
fn checksum(bytes: &[u8]) -> u64 {
    const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    bytes.iter().fold(OFFSET, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
}
