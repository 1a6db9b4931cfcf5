//! `jacoflow.io`: flow and float maps in and out.

use super::{arrays, field::FlowField, field::Store};
use crate::errors::Outcome;
use crate::interrupt::abandonable;
use crate::options::named;
use jacoflow::error::{Error, shape_text};
use jacoflow::io::{
    FieldFormat, FloatMap, FlowImage, NumberedFiles, npz::NpzReader, read_flo, read_kitti, read_npz_from, read_pfm,
    write_flo, write_kitti, write_pfm,
};
use jacoflow::types::AnyField;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// A flow array `(H, W, 2)`, or a single field, as a flow image.
pub fn flow_image(argument: &'static str, flow: &Bound<'_, PyAny>) -> Outcome<FlowImage> {
    if let Ok(field) = flow.cast::<FlowField>() {
        let field = field.get();
        if field.count().1 {
            return Err(Error::argument(argument, "one field", "a stack of fields").into());
        }
        return Ok(match field.store() {
            Store::Single(packed) => FlowImage::from_field(&field.core(packed, 0))?,
            Store::Double(packed) => FlowImage::from_field(&field.core(packed, 0))?,
        });
    }
    let (shape, values) = arrays::doubles(argument, flow)?;
    let [height, width, 2] = shape[..] else {
        return Err(Error::argument(argument, "shape (H, W, 2)", format!("shape {}", shape_text(&shape))).into());
    };
    let plane = |k: usize| values.iter().skip(k).step_by(2).map(|&v| v as f32).collect();
    Ok(FlowImage::new(width, height, plane(0), plane(1))?)
}

fn from_flow_image<'py>(py: Python<'py>, flow: &FlowImage) -> Outcome<Bound<'py, PyAny>> {
    let values = flow.u().iter().zip(flow.v()).flat_map(|(&u, &v)| [u, v]).collect();
    arrays::owned(py, &[flow.height(), flow.width(), 2], values)
}

/// Reads flow in one of the exchange formats.
#[pyfunction(name = "_read_flow")]
pub fn read_flow<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = named::path)] path: PathBuf,
    format: &str,
) -> Outcome<Bound<'py, PyAny>> {
    let is_kitti = format == "kitti";
    let flow = abandonable(py, move || if is_kitti { read_kitti(&path) } else { read_flo(&path) })?;
    from_flow_image(py, &flow)
}

/// Writes flow in one of the exchange formats.
#[pyfunction(name = "_write_flow")]
pub fn write_flow(
    py: Python<'_>,
    #[pyo3(from_py_with = named::path)] path: PathBuf,
    flow: &Bound<'_, PyAny>,
    format: &str,
) -> Outcome<()> {
    let flow = flow_image("flow", flow)?;
    Ok(py.detach(|| match format {
        "kitti" => write_kitti(&path, &flow),
        _ => write_flo(&path, &flow),
    })?)
}

/// Reads a float map.
#[pyfunction(name = "_read_pfm")]
pub fn read_float_map(py: Python<'_>, #[pyo3(from_py_with = named::path)] path: PathBuf) -> Outcome<Bound<'_, PyAny>> {
    let map = abandonable(py, move || read_pfm(&path))?;
    let mut planes = map.planes;
    if planes.len() == 1 {
        return arrays::owned(py, &[map.height, map.width], planes.remove(0));
    }
    let pixels = (0..map.height * map.width).flat_map(|i| planes.iter().map(move |plane| plane[i]));
    arrays::owned(py, &[map.height, map.width, 3], pixels.collect())
}

/// Writes a float map.
#[pyfunction(name = "_write_pfm")]
pub fn write_float_map(
    py: Python<'_>,
    #[pyo3(from_py_with = named::path)] path: PathBuf,
    values: &Bound<'_, PyAny>,
) -> Outcome<()> {
    let (shape, values) = arrays::doubles("values", values)?;
    let (height, width, count) = match shape[..] {
        [height, width] => (height, width, 1),
        [height, width, 3] => (height, width, 3),
        _ => {
            return Err(Error::argument(
                "values",
                "shape (H, W) or (H, W, 3)",
                format!("shape {}", shape_text(&shape)),
            )
            .into());
        }
    };
    let plane = |k: usize| values.iter().skip(k).step_by(count).map(|&v| v as f32).collect();
    let map = FloatMap { width, height, planes: (0..count).map(plane).collect() };
    Ok(py.detach(|| write_pfm(&path, &map))?)
}

/// The format that a file name implies; `None`: no extension, a folder.
fn format_of(path: &Path) -> jacoflow::Result<Option<FieldFormat>> {
    let Some(extension) = path.extension().and_then(|e| e.to_str()) else { return Ok(None) };
    let known = FieldFormat::ALL.into_iter().find(|f| f.extension().eq_ignore_ascii_case(extension));
    known.map(Some).ok_or_else(|| {
        let names: Vec<_> = FieldFormat::ALL.iter().map(|f| format!(".{}", f.extension())).collect();
        Error::argument("path", format!("one of the extensions {}", names.join(", ")), path.display())
    })
}

/// Writes a field, or the fields of a stack into a folder.
pub fn save_field(py: Python<'_>, field: &FlowField, path: &Path, options: &str) -> Outcome<()> {
    let format = format_of(path)?;
    let (count, stack) = field.count();
    match (format, stack) {
        (Some(format), false) => write_one(py, field, 0, format, path, options),
        (None, true) => {
            let names = NumberedFiles::create(path, "flow", FieldFormat::Npz.extension())?;
            // A run is saved in parts, first to last: what an earlier run left behind this part is not of it.
            names.clear_except(|frame| frame < field.first_frame())?;
            for index in 0..count {
                py.check_signals()?;
                let name = names.path(field.first_frame() + index);
                write_one(py, field, index, FieldFormat::Npz, &name, options)?;
            }
            Ok(())
        }
        (Some(_), true) => {
            let expected = "a folder name without extension, for a stack of fields (or save field[t])";
            Err(Error::argument("path", expected, path.display()).into())
        }
        (None, false) => Err(Error::argument("path", "a file name with extension", path.display()).into()),
    }
}

fn write_one(
    py: Python<'_>,
    field: &FlowField,
    index: usize,
    format: FieldFormat,
    path: &Path,
    options: &str,
) -> Outcome<()> {
    match field.store() {
        Store::Single(packed) => {
            let field = field.core(packed, index);
            py.detach(|| format.write(path, &field, options))?;
        }
        Store::Double(packed) => {
            let field = field.core(packed, index);
            py.detach(|| format.write(path, &field, options))?;
        }
    }
    Ok(())
}

/// Reads a field.
pub fn load_field(py: Python<'_>, path: &Path) -> Outcome<FlowField> {
    let format =
        format_of(path)?.ok_or_else(|| Error::argument("path", "a file name with extension", path.display()))?;
    let path = path.to_path_buf();
    let field = abandonable(py, move || {
        let flow = match format {
            FieldFormat::Npz => return load_npz(&path),
            FieldFormat::Flo => read_flo(path)?,
            FieldFormat::Kitti => read_kitti(path)?,
            FieldFormat::Pfm => {
                let map = read_pfm(&path)?;
                let [u, v, _] = <[Vec<f32>; 3]>::try_from(map.planes)
                    .map_err(|_| Error::format(path, "expected three planes (u, v, 0), got one"))?;
                FlowImage::new(map.width, map.height, u, v)?
            }
        };
        Ok(AnyField::Single(flow.to_field()?))
    })?;
    Ok(match field {
        AnyField::Single(field) => FlowField::single(field),
        AnyField::Double(field) => FlowField::single(field),
    })
}

fn load_npz(path: &Path) -> jacoflow::Result<AnyField> {
    let mut npz = NpzReader::open(path)?;
    if npz.array::<f64>("motion").is_ok() {
        return Ok(AnyField::Double(read_npz_from::<f64, _>(&mut npz)?.field));
    }
    Ok(AnyField::Single(read_npz_from::<f32, _>(&mut npz)?.field))
}
