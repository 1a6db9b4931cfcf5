//! A flow field as `.npz`: every plane, and what it means as JSON.
//!
//! | array | shape | content |
//! |---|---|---|
//! | `motion` | (P, H, W) | parameter planes, in the order of `parameters` in the metadata |
//! | `flow` | (H, W, 2) | (u, v), for convenience |
//! | `jacobian` | (H, W, 2, 2) | [[u_x, u_y], [v_x, v_y]], for convenience; 0 for parameters that the model lacks |
//! | `status` | (H, W) uint8 | codes, spelled out in the metadata |
//! | `covariance` | (P (P + 1) / 2, H, W) | upper triangle, row by row; if requested |
//! | `residual`, `rank`, `condition` | (H, W) | if the estimator gives them |
//! | `points` | (N, 2) int64 | pixels (x, y) of the sites, if they are points (then H = 1, W = N) |
//! | `metadata` | text | JSON: model, parameters, units, sites, frame, library version, options |

use super::{npy::Element, npz::NpzReader, npz::NpzWriter};
use crate::error::{Error, Result, shape_text};
use crate::math::Real;
use crate::types::{FieldLayout, FlowField, Interval, Rect, SamplingGrid, Status, Units};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};
use std::path::Path;

/// The JSON text `metadata`.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Metadata {
    /// What the file is: `jacoflow.field` (one) or `jacoflow.stack` (with a leading axis of frames).
    pub(super) format: String,
    /// Version of this layout.
    version: u32,
    /// Library and version that wrote it.
    library: String,
    model: String,
    parameters: Vec<String>,
    /// Unit of each parameter.
    units: Vec<String>,
    frame_size: [usize; 2],
    frame_index: usize,
    /// Seconds between frames, if known: times are then in seconds.
    frame_period: Option<f64>,
    pixel_pitch: [f64; 2],
    /// Unit of lengths: px, or that of the pixel pitch.
    length_unit: String,
    /// The time over which the flow is taken.
    interval: String,
    /// How far errors of neighbours go together, px; absent: not known.
    #[serde(default)]
    correlation_length: f64,
    /// Upper left corner and size `[x, y, width, height]` of the region; absent: the whole frame, or points.
    region: Option<[usize; 4]>,
    /// Distance between sites, px; absent: the sites are in `points`.
    stride: Option<usize>,
    /// Words for the status codes.
    statuses: BTreeMap<u8, String>,
    /// How the field was made, in the caller's words.
    options: String,
    /// The arrays that only some fields have: a damaged name does not hide one.
    #[serde(default)]
    optional: Vec<String>,
}

/// Highest layout version this library reads.
const VERSION: u32 = 2;
const FORMAT: &str = "jacoflow.field";

impl Metadata {
    pub(super) fn new(layout: &FieldLayout, options: &str) -> Self {
        let (region, stride) = match &layout.sites {
            SamplingGrid::Grid { region, stride } => (region.map(|r| [r.x, r.y, r.width, r.height]), Some(*stride)),
            SamplingGrid::Points(_) => (None, None),
        };
        Self {
            format: FORMAT.into(),
            version: VERSION,
            library: concat!("jacoflow ", env!("CARGO_PKG_VERSION")).into(),
            model: layout.model.clone(),
            parameters: layout.parameters.clone(),
            units: layout.parameters.iter().map(|p| layout.units.of_parameter(p)).collect(),
            frame_size: [layout.frame_size.0, layout.frame_size.1],
            frame_index: layout.frame_index,
            frame_period: layout.units.frame_period,
            pixel_pitch: layout.units.pixel_pitch.into(),
            length_unit: layout.units.length.clone(),
            interval: layout.interval.name().into(),
            correlation_length: layout.correlation_length,
            region,
            stride,
            statuses: Status::ALL.iter().map(|s| (*s as u8, s.name().into())).collect(),
            options: options.into(),
            optional: Vec::new(),
        }
    }

    pub(super) fn to_json(&self, path: &Path) -> Result<String> {
        serde_json::to_string(self).map_err(|e| Error::format(path, e.to_string()))
    }

    fn layout(&self, points: Option<Vec<(usize, usize)>>) -> FieldLayout {
        let region = self.region.map(|[x, y, width, height]| Rect { x, y, width, height });
        FieldLayout {
            frame_size: (self.frame_size[0], self.frame_size[1]),
            sites: match (points, self.stride) {
                (Some(points), _) => SamplingGrid::Points(points),
                (None, stride) => SamplingGrid::Grid { region, stride: stride.unwrap_or(1) },
            },
            model: self.model.clone(),
            parameters: self.parameters.clone(),
            units: Units::new(self.pixel_pitch.into(), Some(&self.length_unit), self.frame_period),
            interval: Interval::ALL.into_iter().find(|known| known.name() == self.interval).unwrap_or_default(),
            frame_index: self.frame_index,
            correlation_length: self.correlation_length,
        }
    }
}

/// A field as it came from a file, with what was said about it.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredField<T> {
    /// The field.
    pub field: FlowField<T>,
    /// How it was made, in the writer's words.
    pub options: String,
    /// Library and version that wrote it.
    pub library: String,
}

/// Writes a field, with `options` (free text, by custom JSON) saying how it was made.
///
/// # Errors
/// [`Error::Io`] with the path.
pub fn write_npz<T: Real + Element>(path: impl AsRef<Path>, field: &FlowField<T>, options: &str) -> Result<()> {
    let path = path.as_ref();
    let mut npz = NpzWriter::create(path)?;
    write_arrays(&mut npz, path, field, options)?;
    npz.finish()
}

/// As [`write_npz`], into any seekable place; `name` stands for it in messages.
///
/// # Errors
/// [`Error::Io`] with the name.
pub fn write_npz_to<T: Real + Element, W: Write + Seek>(
    place: W,
    name: impl AsRef<Path>,
    field: &FlowField<T>,
    options: &str,
) -> Result<W> {
    let mut npz = NpzWriter::new(place, &name);
    write_arrays(&mut npz, name.as_ref(), field, options)?;
    npz.into_inner()
}

fn write_arrays<T: Real + Element, W: Write + Seek>(
    npz: &mut NpzWriter<W>,
    path: &Path,
    field: &FlowField<T>,
    options: &str,
) -> Result<()> {
    let (w, h, p) = (field.width, field.height, field.layout.parameters.len());
    let mut metadata = Metadata::new(&field.layout, options);
    metadata.optional = optional_arrays(field);
    npz.text("metadata", &metadata.to_json(path)?)?;
    npz.array("motion", &[p, h, w], &field.motion)?;
    npz.array("flow", &[h, w, 2], &interleaved(field, &["u", "v"]))?;
    npz.array("jacobian", &[h, w, 2, 2], &interleaved(field, &["u_x", "u_y", "v_x", "v_y"]))?;
    npz.array("status", &[h, w], &status_codes(field))?;
    if let Some(covariance) = &field.covariance {
        npz.array("covariance", &[p * (p + 1) / 2, h, w], covariance)?;
    }
    if let Some(residual) = &field.residual {
        npz.array("residual", &[h, w], residual)?;
    }
    if let Some(rank) = &field.rank {
        npz.array("rank", &[h, w], rank)?;
    }
    if let Some(condition) = &field.condition {
        npz.array("condition", &[h, w], condition)?;
    }
    if let Some(window) = &field.window {
        npz.array("window", &[h, w], window)?;
    }
    if let SamplingGrid::Points(points) = &field.layout.sites {
        let pairs: Vec<i64> = points.iter().flat_map(|&(x, y)| [x as i64, y as i64]).collect();
        npz.array("points", &[points.len(), 2], &pairs)?;
    }
    Ok(())
}

/// Names of the planes that this field has and another might not.
fn optional_arrays<T>(field: &FlowField<T>) -> Vec<String> {
    let present = [
        ("covariance", field.covariance.is_some()),
        ("residual", field.residual.is_some()),
        ("rank", field.rank.is_some()),
        ("condition", field.condition.is_some()),
        ("window", field.window.is_some()),
    ];
    present.into_iter().filter(|(_, present)| *present).map(|(name, _)| name.to_string()).collect()
}

/// The planes called `names`, interleaved by site; NaN without an estimate, zero by the model.
fn interleaved<T: Real>(field: &FlowField<T>, names: &[&str]) -> Vec<T> {
    let planes: Vec<Option<&[T]>> = names.iter().map(|name| field.plane(name)).collect();
    let mut out = Vec::with_capacity(names.len() * field.len());
    for i in 0..field.len() {
        let absent = if field.motion[i].finite() { T::from_f64(0.0) } else { T::nan() };
        out.extend(planes.iter().map(|plane| plane.map_or(absent, |p| p[i])));
    }
    out
}

pub(super) fn status_codes<T>(field: &FlowField<T>) -> Vec<u8> {
    field.status.iter().map(|s| *s as u8).collect()
}

/// Reads a field, in working precision.
///
/// # Errors
/// [`Error::Io`] when it cannot be read; [`Error::Format`] when it is no such file, damaged, its arrays do
/// not fit together, or its covariance has a negative variance or is not finite at a valid site.
pub fn read_npz<T: Real>(path: impl AsRef<Path>) -> Result<StoredField<T>> {
    read_npz_from(&mut NpzReader::open(path)?)
}

/// As [`read_npz`], from an open archive.
pub fn read_npz_from<T: Real, R: Read + Seek>(npz: &mut NpzReader<R>) -> Result<StoredField<T>> {
    let text = npz.text("metadata")?;
    let metadata: Metadata =
        serde_json::from_str(&text).map_err(|e| npz.wrong("metadata", &format!("is not that of a flow field: {e}")))?;
    if metadata.format != FORMAT || metadata.version > VERSION {
        let what = format!(
            "is of format {} version {}; expected {FORMAT} up to version {VERSION}",
            metadata.format, metadata.version
        );
        return Err(npz.wrong("metadata", &what));
    }
    if let Some(lost) = metadata.optional.iter().find(|name| !npz.contains(name)) {
        return Err(npz.wrong(lost, "is missing"));
    }
    let points = if metadata.stride.is_none() { Some(read_points(npz)?) } else { None };
    let layout = metadata.layout(points);
    let (width, height) = layout.sites.shape(layout.frame_size).map_err(|e| npz.wrong("metadata", &e.to_string()))?;
    let shape = Shape { p: layout.parameters.len(), width, height };
    let codes = npz.array::<u8>("status")?;
    shape.check(npz, "status", &codes.shape, None)?;
    let status: Option<Vec<Status>> = codes.values.iter().map(|&c| Status::from_code(c)).collect();
    let field = FlowField {
        motion: shape.planes(npz, "motion", Some(shape.p))?,
        covariance: if npz.contains("covariance") {
            Some(shape.planes(npz, "covariance", Some(shape.p * (shape.p + 1) / 2))?)
        } else {
            None
        },
        systematic: None,
        residual: if npz.contains("residual") { Some(shape.planes(npz, "residual", None)?) } else { None },
        condition: if npz.contains("condition") { Some(shape.planes(npz, "condition", None)?) } else { None },
        window: if npz.contains("window") { Some(shape.planes(npz, "window", None)?) } else { None },
        rank: if npz.contains("rank") { Some(shape.ranks(npz)?) } else { None },
        status: status.ok_or_else(|| npz.wrong("status", "holds an unknown code"))?,
        width,
        height,
        layout,
    };
    if let Some(flaw) = flaw_of_covariance(&field) {
        return Err(npz.wrong("covariance", &flaw));
    }
    Ok(StoredField { field, options: metadata.options, library: metadata.library })
}

/// What is wrong with stored covariance: a negative variance, or a value that is not finite at a valid site.
fn flaw_of_covariance<T: Real>(field: &FlowField<T>) -> Option<String> {
    let planes = field.covariance.as_ref()?;
    let (p, n) = (field.layout.parameters.len(), field.len());
    // Row k of the upper triangle begins with a variance and has p - k values.
    let mut variances = (0..p).scan(0, |next, k| Some(std::mem::replace(next, *next + p - k)));
    let negative = variances.find_map(|plane| {
        let site = planes[plane * n..(plane + 1) * n].iter().position(|value| value.to_f64() < 0.0)?;
        Some(("a negative variance", site))
    });
    let (what, site) = negative.or_else(|| {
        let at =
            planes.iter().enumerate().position(|(at, value)| !value.finite() && field.status[at % n].is_valid())?;
        Some(("a value that is not finite where the field is valid", at % n))
    })?;
    Some(format!("holds {what}, at row {}, column {}", site / field.width, site % field.width))
}

fn read_points<R: Read + Seek>(npz: &mut NpzReader<R>) -> Result<Vec<(usize, usize)>> {
    let points = npz.array::<i64>("points")?;
    if points.shape.len() != 2 || points.shape[1] != 2 {
        return Err(
            npz.wrong("points", &format!("has shape {}, expected (N, 2)", crate::error::shape_text(&points.shape)))
        );
    }
    let pair = |p: &[i64]| Some((usize::try_from(p[0]).ok()?, usize::try_from(p[1]).ok()?));
    let points: Option<_> = points.values.chunks_exact(2).map(pair).collect();
    points.ok_or_else(|| npz.wrong("points", "holds a negative coordinate"))
}

#[derive(Clone, Copy)]
struct Shape {
    p: usize,
    width: usize,
    height: usize,
}

impl Shape {
    fn check<R: Read + Seek>(self, npz: &NpzReader<R>, name: &str, got: &[usize], planes: Option<usize>) -> Result<()> {
        let wanted: Vec<usize> = planes.into_iter().chain([self.height, self.width]).collect();
        if got == wanted {
            return Ok(());
        }
        let [got, wanted] = [got, &wanted].map(shape_text);
        Err(npz.wrong(name, &format!("has shape {got}, expected {wanted}")))
    }

    fn planes<T: Real, R: Read + Seek>(
        self,
        npz: &mut NpzReader<R>,
        name: &str,
        planes: Option<usize>,
    ) -> Result<Vec<T>> {
        let array = npz.real_array::<T>(name)?;
        self.check(npz, name, &array.shape, planes)?;
        Ok(array.values)
    }

    fn ranks<R: Read + Seek>(self, npz: &mut NpzReader<R>) -> Result<Vec<u8>> {
        let array = npz.array::<u8>("rank")?;
        self.check(npz, "rank", &array.shape, None)?;
        Ok(array.values)
    }
}
