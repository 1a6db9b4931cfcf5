//! Disparity maps in files: `.npz`, `.pfm`, and the 16-bit PNG of the KITTI benchmark.

use super::npz::{NpzReader, NpzWriter};
use super::pfm::{FloatMap, read_pfm, write_pfm};
use super::sixteen_bit_png::SixteenBitPng;
use crate::error::{Error, Result};
use crate::types::{Frame, choices};
use std::path::Path;

/// Steps of a KITTI disparity PNG in one px.
const STEPS: f64 = 256.0;

const PNG: SixteenBitPng =
    SixteenBitPng { what: "disparity", colour: png::ColorType::Grayscale, colour_in_words: "grey" };

/// How a disparity map is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DisparityFormat {
    /// `.npz`: `disparity` and `score` (H, W) of float32, NaN where there is none, and `row_offset`. The only
    /// one that keeps everything.
    Npz,
    /// `.pfm`: float32, infinite where there is none (the convention of Middlebury's stereo benchmark).
    Pfm,
    /// `.png` of 16 bit: `256 d`, 0 where there is none (A. Geiger et al., "Vision meets robotics: the KITTI
    /// dataset", 2013). It holds disparities above 0 and below 256 px; others become unknown.
    Kitti,
}

choices!(DisparityFormat, "format": Npz "npz", Pfm "pfm", Kitti "kitti");

impl DisparityFormat {
    /// The extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Kitti => "png",
            other => other.name(),
        }
    }

    /// The format that a file's extension means.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_string_lossy().to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.extension() == extension)
    }

    /// Writes a map, whole or not at all; returns how many disparities the format could not hold. One that is
    /// infinite counts as absent.
    ///
    /// # Errors
    /// [`Error::Argument`] for an empty map or a score of another size, [`Error::Io`] with the path.
    pub fn write(self, path: &Path, map: &DisparityMap) -> Result<usize> {
        let (width, height) = map.disparity.size();
        if width == 0 || height == 0 || map.score.as_ref().is_some_and(|score| score.size() != (width, height)) {
            return Err(Error::argument(
                "disparity",
                "an array (H, W) and a score alike",
                format!("({height}, {width})"),
            ));
        }
        match self {
            Self::Npz => {
                let disparity = map.disparity.map(|&d| if d.is_finite() { d } else { f32::NAN });
                write_npz(path, &DisparityMap { disparity, ..map.clone() }).map(|()| 0)
            }
            Self::Pfm => {
                let plane = map.disparity.data().iter().map(|&d| if d.is_finite() { d } else { f32::INFINITY });
                write_pfm(path, &FloatMap { width, height, planes: vec![plane.collect()] }).map(|()| 0)
            }
            Self::Kitti => write_kitti_disparity(path, &map.disparity),
        }
    }

    /// Reads a map; NaN where there is none.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read, [`Error::Format`] when it is not of this format or damaged.
    pub fn read(self, path: &Path) -> Result<DisparityMap> {
        match self {
            Self::Npz => read_npz(path),
            Self::Pfm => {
                let FloatMap { width, height, planes } = read_pfm(path)?;
                let [plane] = <[Vec<f32>; 1]>::try_from(planes)
                    .map_err(|_| Error::format(path, "expected one plane of disparity, got three"))?;
                let known = plane.into_iter().map(|d| if d.is_finite() { d } else { f32::NAN }).collect();
                Frame::new(width, height, known).map(DisparityMap::plain)
            }
            Self::Kitti => read_kitti_disparity(path).map(DisparityMap::plain),
        }
    }
}

/// What a file of disparities holds.
#[derive(Debug, Clone, PartialEq)]
pub struct DisparityMap {
    /// `x_left - x_right` of every left pixel, px; NaN where there is none.
    pub disparity: Frame<f32>,
    /// How well both views agree there, 0 to 1.
    pub score: Option<Frame<f32>>,
    /// How many rows lower the right view shows a point.
    pub row_offset: Option<f64>,
}

impl DisparityMap {
    /// Disparities about which nothing else is known.
    pub fn plain(disparity: Frame<f32>) -> Self {
        Self { disparity, score: None, row_offset: None }
    }
}

fn write_npz(path: &Path, map: &DisparityMap) -> Result<()> {
    let mut npz = NpzWriter::create(path)?;
    let shape = [map.disparity.height(), map.disparity.width()];
    npz.array("disparity", &shape, map.disparity.data())?;
    if let Some(score) = &map.score {
        npz.array("score", &shape, score.data())?;
    }
    if let Some(rows) = map.row_offset {
        npz.array("row_offset", &[], &[rows])?;
    }
    npz.finish()
}

fn read_npz(path: &Path) -> Result<DisparityMap> {
    let mut npz = NpzReader::open(path)?;
    let plane = |npz: &mut NpzReader<_>, name: &str| {
        let array = npz.real_array::<f32>(name)?;
        match array.shape[..] {
            [height, width] => Frame::new(width, height, array.values),
            _ => Err(Error::format(
                path,
                format!("array '{name}' has shape {}, expected (H, W)", crate::error::shape_text(&array.shape)),
            )),
        }
    };
    let disparity = plane(&mut npz, "disparity")?;
    let score = if npz.contains("score") { Some(plane(&mut npz, "score")?) } else { None };
    let row_offset =
        if npz.contains("row_offset") { npz.real_array::<f64>("row_offset")?.values.first().copied() } else { None };
    Ok(DisparityMap { disparity, score, row_offset })
}

/// Writes the PNG; returns how many disparities did not fit.
fn write_kitti_disparity(path: &Path, disparity: &Frame<f32>) -> Result<usize> {
    let mut lost = 0;
    let mut bytes = Vec::with_capacity(2 * disparity.data().len());
    for &value in disparity.data() {
        let sample = (f64::from(value) * STEPS).round();
        let held = (1.0..=65535.0).contains(&sample);
        lost += usize::from(value.is_finite() && !held);
        bytes.extend(if held { sample as u16 } else { 0 }.to_be_bytes());
    }
    PNG.write(path, disparity.size(), &bytes)?;
    Ok(lost)
}

fn read_kitti_disparity(path: &Path) -> Result<Frame<f32>> {
    let mut values = Vec::new();
    let (width, height) = PNG.read(path, |[sample]| {
        values.push(if sample > 0 { f32::from(sample) / STEPS as f32 } else { f32::NAN });
    })?;
    Frame::new(width, height, values).map_err(|_| Error::format(path, "cut off"))
}
