//! The `.npy` header and element types, shared by `.npy` files and the arrays inside `.npz` archives.
//!
//! Headers are parsed here rather than by a general parser of Python literals: a hostile header can neither
//! nest deeply nor ask for a large allocation, and sizes are multiplied with care.

use std::io::{self, Read, Write};

/// A sample type of an array file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementType {
    /// numpy `bool`, one byte.
    Bool,
    /// numpy `uint8`.
    U8,
    /// numpy `uint16`.
    U16,
    /// numpy `uint32`.
    U32,
    /// numpy `uint64`.
    U64,
    /// numpy `int8`.
    I8,
    /// numpy `int16`.
    I16,
    /// numpy `int32`.
    I32,
    /// numpy `int64`.
    I64,
    /// numpy `float16`.
    F16,
    /// numpy `float32`.
    F32,
    /// numpy `float64`.
    F64,
    /// numpy `str_` of this many characters (UTF-32).
    Text(usize),
}

impl ElementType {
    /// Bytes of one element.
    pub fn size(self) -> usize {
        match self {
            Self::Bool | Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
            Self::Text(characters) => characters.saturating_mul(4),
        }
    }

    /// numpy's descriptor, little-endian.
    pub fn descriptor(self) -> String {
        match self {
            Self::Bool => "|b1".into(),
            Self::U8 => "|u1".into(),
            Self::U16 => "<u2".into(),
            Self::U32 => "<u4".into(),
            Self::U64 => "<u8".into(),
            Self::I8 => "|i1".into(),
            Self::I16 => "<i2".into(),
            Self::I32 => "<i4".into(),
            Self::I64 => "<i8".into(),
            Self::F16 => "<f2".into(),
            Self::F32 => "<f4".into(),
            Self::F64 => "<f8".into(),
            Self::Text(characters) => format!("<U{characters}"),
        }
    }

    fn parse(descriptor: &str) -> Option<(Self, bool)> {
        let (order, rest) = match descriptor.chars().next()? {
            c @ ('<' | '>' | '|' | '=') => (c, &descriptor[1..]),
            _ => ('=', descriptor),
        };
        let kind = match rest {
            "b1" => Self::Bool,
            "u1" => Self::U8,
            "u2" => Self::U16,
            "u4" => Self::U32,
            "u8" => Self::U64,
            "i1" => Self::I8,
            "i2" => Self::I16,
            "i4" => Self::I32,
            "i8" => Self::I64,
            "f2" => Self::F16,
            "f4" => Self::F32,
            "f8" => Self::F64,
            _ => Self::Text(rest.strip_prefix('U')?.parse().ok().filter(|&n| n <= MAX_TEXT)?),
        };
        Some((kind, order == '>' || (order == '=' && cfg!(target_endian = "big"))))
    }
}

/// Longest text element accepted, in characters.
const MAX_TEXT: usize = 1 << 24;
/// Longest header accepted, bytes; numpy's own limit is 10 000.
const MAX_HEADER: usize = 1 << 16;
/// Most axes accepted; numpy's own limit is 64.
const MAX_AXES: usize = 64;

/// What the header of a `.npy` file says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    /// Type of the elements.
    pub element: ElementType,
    /// Elements are stored with the most significant byte first.
    pub big_endian: bool,
    /// The first axis varies fastest.
    pub fortran_order: bool,
    /// Length of each axis.
    pub shape: Vec<usize>,
}

impl NpyHeader {
    /// A little-endian array in C order.
    pub fn new(element: ElementType, shape: &[usize]) -> Self {
        Self { element, big_endian: false, fortran_order: false, shape: shape.to_vec() }
    }

    /// The shape as Python writes it: `(2, 48, 64)`.
    pub fn shown(&self) -> String {
        crate::error::shape_text(&self.shape)
    }

    /// Number of elements; `None` when it does not fit a machine word.
    pub fn count(&self) -> Option<usize> {
        self.shape.iter().try_fold(1usize, |n, &axis| n.checked_mul(axis))
    }

    /// Bytes of the data; `None` when they do not fit a machine word.
    pub fn byte_count(&self) -> Option<usize> {
        self.count()?.checked_mul(self.element.size())
    }

    /// Writes the header, version 1.0, padded so that the data start at a multiple of 64 and, when `reserve`
    /// is larger than needed, at byte `reserve`.
    pub fn write(&self, out: &mut impl Write, reserve: usize) -> io::Result<()> {
        let axes: Vec<String> = self.shape.iter().map(|n| format!("{n},")).collect();
        let order = if self.fortran_order { "True" } else { "False" };
        let mut text = format!(
            "{{'descr': '{}', 'fortran_order': {order}, 'shape': ({}), }}",
            self.element.descriptor(),
            axes.join(" ").trim_end_matches(if self.shape.len() > 1 { ',' } else { '\0' }),
        );
        let total = (10 + text.len() + 1).next_multiple_of(64).max(reserve);
        text.extend(std::iter::repeat_n(' ', total - 10 - text.len() - 1));
        text.push('\n');
        let length = u16::try_from(text.len()).map_err(|_| bad("the header is too long"))?;
        out.write_all(b"\x93NUMPY\x01\x00")?;
        out.write_all(&length.to_le_bytes())?;
        out.write_all(text.as_bytes())
    }

    /// Reads a header (versions 1 to 3) up to the first data byte; also returns its length in bytes.
    ///
    /// # Errors
    /// Those of `input`; kind `InvalidData`, with the reason in words, for anything that is not such a
    /// header.
    pub fn read(input: &mut impl Read) -> io::Result<(Self, usize)> {
        let mut start = [0; 8];
        input.read_exact(&mut start).map_err(|_| bad("not a .npy file (shorter than its signature)"))?;
        if &start[..6] != b"\x93NUMPY" {
            return Err(bad("not a .npy file (its signature is missing)"));
        }
        let wide = match start[6] {
            1 => false,
            2 | 3 => true,
            version => return Err(bad(format!("unknown .npy version {version}"))),
        };
        let mut length = [0; 4];
        input.read_exact(&mut length[..if wide { 4 } else { 2 }]).map_err(|_| bad("the .npy header is cut off"))?;
        let length = u32::from_le_bytes(length) as usize;
        if length > MAX_HEADER {
            return Err(bad(format!("a .npy header of {length} bytes (at most {MAX_HEADER} are accepted)")));
        }
        let mut text = vec![0; length];
        input.read_exact(&mut text).map_err(|_| bad("the .npy header is cut off"))?;
        let text = std::str::from_utf8(&text).map_err(|_| bad("the .npy header is not text"))?;
        Ok((Self::parse(text)?, 8 + if wide { 4 } else { 2 } + length))
    }

    fn parse(text: &str) -> io::Result<Self> {
        let descriptor = value_of(text, "descr")?;
        let descriptor = descriptor
            .strip_prefix('\'')
            .and_then(|d| d.split_once('\''))
            .or_else(|| descriptor.strip_prefix('"').and_then(|d| d.split_once('"')))
            .map(|(inside, _)| inside)
            .ok_or_else(|| bad("the .npy array is a record, not plain numbers"))?;
        let (element, big_endian) = ElementType::parse(descriptor).ok_or_else(|| {
            bad(format!(
                "element type '{descriptor}' is not one of bool, integers of 8 to 64 bits, float16, float32, float64, str"
            ))
        })?;
        let fortran_order = match value_of(text, "fortran_order")? {
            v if v.starts_with("True") => true,
            v if v.starts_with("False") => false,
            _ => return Err(bad("fortran_order in the .npy header is neither True nor False")),
        };
        let shape =
            value_of(text, "shape")?.strip_prefix('(').and_then(|s| s.split_once(')')).map(|(inside, _)| inside);
        let shape: Option<Vec<usize>> = shape.and_then(|inside| {
            inside.split(',').map(str::trim).filter(|s| !s.is_empty()).map(|s| s.parse().ok()).collect()
        });
        let shape =
            shape.filter(|s| s.len() <= MAX_AXES).ok_or_else(|| bad("the shape in the .npy header is malformed"))?;
        Ok(Self { element, big_endian, fortran_order, shape })
    }
}

/// The text after `'key':` in a dictionary literal.
fn value_of<'a>(text: &'a str, key: &str) -> io::Result<&'a str> {
    let missing = || bad(format!("the .npy header has no '{key}'"));
    let at = text.find(&format!("'{key}'")).or_else(|| text.find(&format!("\"{key}\""))).ok_or_else(missing)?;
    let rest = text[at + key.len() + 2..].trim_start();
    Ok(rest.strip_prefix(':').ok_or_else(missing)?.trim_start())
}

pub(crate) fn bad(message: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message.into())
}

/// A number that array files can hold.
pub trait Element: Copy + Default + Send + Sync + 'static {
    /// Its type in files.
    const TYPE: ElementType;
    /// Appends the little-endian bytes of `values`.
    fn encode(values: &[Self], out: &mut Vec<u8>);
    /// The values whose bytes these are; a rest shorter than one element is ignored.
    fn decode(bytes: &[u8], big_endian: bool) -> Vec<Self>;
}

macro_rules! elements {
    ($($t:ty, $kind:ident;)*) => {$(
        impl Element for $t {
            const TYPE: ElementType = ElementType::$kind;
            fn encode(values: &[Self], out: &mut Vec<u8>) {
                out.reserve(std::mem::size_of_val(values));
                for value in values {
                    out.extend_from_slice(&value.to_le_bytes());
                }
            }
            fn decode(bytes: &[u8], big_endian: bool) -> Vec<Self> {
                let (chunks, _) = bytes.as_chunks::<{ size_of::<$t>() }>();
                let from = if big_endian { <$t>::from_be_bytes } else { <$t>::from_le_bytes };
                chunks.iter().map(|c| from(*c)).collect()
            }
        }
    )*};
}
elements! {
    u8, U8; u16, U16; u32, U32; u64, U64; i8, I8; i16, I16; i32, I32; i64, I64; half::f16, F16; f32, F32; f64, F64;
}

/// Writes `values` as little-endian bytes, a block at a time.
pub fn write_values<T: Element>(values: &[T], out: &mut impl Write) -> io::Result<()> {
    let mut bytes = Vec::new();
    for block in values.chunks(1 << 15) {
        bytes.clear();
        T::encode(block, &mut bytes);
        out.write_all(&bytes)?;
    }
    Ok(())
}

/// Values stored with the first axis fastest, put in C order.
pub(crate) fn from_fortran_order<T: Copy>(values: &[T], shape: &[usize]) -> Vec<T> {
    // Without values, the other axes may be of any length, and strides beyond a machine word.
    if values.is_empty() {
        return Vec::new();
    }
    let mut strides = Vec::with_capacity(shape.len());
    let mut stride = 1;
    for &axis in shape {
        strides.push(stride);
        stride *= axis;
    }
    let mut index = vec![0; shape.len()];
    (0..values.len())
        .map(|_| {
            let value = values[index.iter().zip(&strides).map(|(i, s)| i * s).sum::<usize>()];
            for axis in (0..shape.len()).rev() {
                index[axis] += 1;
                if index[axis] < shape[axis] {
                    break;
                }
                index[axis] = 0;
            }
            value
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fortran_order_is_undone() {
        // Element (i, j, k) = 100 i + 10 j + k of shape (2, 3, 4), first axis fastest.
        let mut stored = Vec::new();
        for k in 0..4 {
            for j in 0..3 {
                for i in 0..2 {
                    stored.push(100 * i + 10 * j + k);
                }
            }
        }
        let values = from_fortran_order(&stored, &[2, 3, 4]);
        assert!(values.iter().enumerate().all(|(n, v)| *v == 100 * (n / 12) + 10 * (n / 4 % 3) + n % 4));
        assert_eq!(from_fortran_order(&[7], &[]), [7]);
        assert!(from_fortran_order::<u8>(&[], &[0, 3]).is_empty());
    }
}
