//! Which planes of a file with several axes are its frames, and how large their pixels are.

/// The planes of a TIFF file whose metadata (ImageJ, OME-XML) name axes beside time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlaneSelection {
    /// Index of the channel; `None`: the file must have one channel.
    pub channel: Option<usize>,
    /// Which slices; `None`: the file must have one slice at each time.
    pub z: Option<Slices>,
}

impl PlaneSelection {
    /// The name of an option that is given, for files without such axes.
    pub fn given(&self) -> Option<&'static str> {
        if self.channel.is_some() { Some("channel") } else { self.z.map(|_| "z") }
    }
}

/// What is done with the slices (axis Z) of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slices {
    /// Frames are the times of this slice.
    Index(usize),
    /// Slices are frames, for files whose writer took time for depth.
    AsTime,
}

/// Physical size of a pixel, as a file says.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelSize {
    /// Width and height, in `unit`.
    pub pitch: (f64, f64),
    /// Unit of length as the file spells it: `µm`, `mm`.
    pub unit: String,
}

impl PixelSize {
    /// A size of positive, finite lengths in a unit of length; `None` for others, as for pixels.
    pub(crate) fn new(pitch: (f64, f64), unit: &str) -> Option<Self> {
        let is_length = |v: f64| v > 0.0 && v.is_finite();
        // Dots per inch are of prints and screens: programs write them into every file.
        let unnamed = ["", "pixel", "pixels", "px", "inch", "reference frame"];
        if !is_length(pitch.0) || !is_length(pitch.1) || unnamed.contains(&unit.to_lowercase().as_str()) {
            return None;
        }
        let unit = if ["micron", "microns", "um", "\u{3bc}m", "\\u00B5m"].contains(&unit) { "\u{b5}m" } else { unit };
        Some(Self { pitch, unit: unit.to_string() })
    }
}
