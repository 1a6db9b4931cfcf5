//! A field as a dictionary of arrays and plain values, and back: what pickling needs.

use super::{FlowField, Note, Packed, Store, Stored, each};
use crate::arrays;
use crate::errors::{Outcome, Raised};
use jacoflow::error::{Error, shape_text};
use jacoflow::types::{FieldLayout, Interval, Rect, SamplingGrid, Status, Units};
use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A note as plain values.
type PlainNote = (usize, Option<f64>, f64);

fn of_plain((frame_index, period, correlation_length): PlainNote) -> Note {
    Note { frame_index, period, correlation_length }
}

/// Everything that makes a field, copied out of the memory it may share with others.
pub fn save<'py>(field: &FlowField, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
    let state = layout_state(py, field.layout())?;
    let (width, height) = field.size();
    state.set_item("stack", field.stack)?;
    state.set_item("count", field.count)?;
    each!(field.store, packed => {
        let notes = &packed.notes[field.start..field.start + field.count];
        let notes: Vec<PlainNote> = notes.iter().map(|n| (n.frame_index, n.period, n.correlation_length)).collect();
        state.set_item("notes", notes)?;
        let part = |total: usize| {
            let length = total / packed.count.max(1);
            field.start * length..(field.start + field.count) * length
        };
        let shape = |total: usize| [field.count, total / (packed.count * width * height).max(1), height, width];
        state.set_item("motion", arrays::owned(py, &shape(packed.motion.len()), packed.motion[part(packed.motion.len())].to_vec())?)?;
        state.set_item("status", arrays::owned(py, &shape(packed.status.len()), packed.status[part(packed.status.len())].to_vec())?)?;
        let optional = [("covariance", &packed.covariance), ("residual", &packed.residual), ("condition", &packed.condition), ("window", &packed.window)];
        for (name, planes) in optional {
            if let Some(planes) = planes {
                state.set_item(name, arrays::owned(py, &shape(planes.len()), planes[part(planes.len())].to_vec())?)?;
            }
        }
        if let Some(rank) = &packed.rank {
            state.set_item("rank", arrays::owned(py, &shape(rank.len()), rank[part(rank.len())].to_vec())?)?;
        }
    });
    Ok(state)
}

/// The layout as plain values.
fn layout_state<'py>(py: Python<'py>, layout: &FieldLayout) -> Outcome<Bound<'py, PyDict>> {
    let state = PyDict::new(py);
    state.set_item("frame_size", layout.frame_size)?;
    state.set_item("model", &layout.model)?;
    state.set_item("parameters", &layout.parameters)?;
    state.set_item("pixel_pitch", layout.units.pixel_pitch)?;
    state.set_item("length_unit", &layout.units.length)?;
    state.set_item("interval", layout.interval.name())?;
    match &layout.sites {
        SamplingGrid::Grid { region, stride } => {
            state.set_item("region", region.map(|r| (r.x, r.y, r.width, r.height)))?;
            state.set_item("stride", stride)?;
        }
        SamplingGrid::Points(points) => state.set_item("points", points)?,
    }
    Ok(state)
}

/// A field from what `FlowField.__reduce__` wrote.
#[pyfunction(name = "_restore_field")]
pub fn restore_field(state: &Bound<'_, PyDict>) -> Outcome<FlowField> {
    let motion = required(state, "motion")?;
    if motion.cast::<PyArrayDyn<f32>>().is_ok() { restore::<f32>(state) } else { restore::<f64>(state) }
}

fn restore<T: Stored>(state: &Bound<'_, PyDict>) -> Outcome<FlowField> {
    let sites = match state.get_item("points")? {
        Some(points) => SamplingGrid::Points(points.extract()?),
        None => SamplingGrid::Grid {
            region: required(state, "region")?
                .extract::<Option<(usize, usize, usize, usize)>>()?
                .map(|(x, y, width, height)| Rect { x, y, width, height }),
            stride: required(state, "stride")?.extract()?,
        },
    };
    let interval = Interval::parse(&required(state, "interval")?.extract::<String>()?)?;
    let count: usize = required(state, "count")?.extract()?;
    let notes: Vec<PlainNote> = required(state, "notes")?.extract()?;
    if notes.len() != count {
        return Err(Error::argument("state", format!("{count} notes"), notes.len()).into());
    }
    let (frame_index, frame_period, correlation_length) = notes.first().copied().unwrap_or((0, None, 0.0));
    let layout = FieldLayout {
        frame_size: required(state, "frame_size")?.extract()?,
        sites,
        model: required(state, "model")?.extract()?,
        parameters: required(state, "parameters")?.extract()?,
        units: Units {
            pixel_pitch: required(state, "pixel_pitch")?.extract()?,
            length: required(state, "length_unit")?.extract()?,
            frame_period,
        },
        interval,
        frame_index,
        correlation_length,
    };
    let (width, height) = layout.sites.shape(layout.frame_size)?;
    let (sites, parameters) = (width * height * count, layout.parameters.len());
    let packed = Packed {
        width,
        height,
        count,
        notes: notes.into_iter().map(of_plain).collect(),
        motion: plane::<T>(state, "motion", sites * parameters)?.ok_or_else(|| missing("motion"))?,
        covariance: plane(state, "covariance", sites * parameters * (parameters + 1) / 2)?,
        status: plane(state, "status", sites)?.ok_or_else(|| missing("status"))?,
        residual: plane(state, "residual", sites)?,
        rank: plane(state, "rank", sites)?,
        condition: plane(state, "condition", sites)?,
        window: plane(state, "window", sites)?,
        layout,
    };
    if packed.status.iter().any(|&code| Status::from_code(code).is_none()) {
        return Err(Error::argument("state", "known status codes", "an unknown one").into());
    }
    let stack: bool = required(state, "stack")?.extract()?;
    Ok(FlowField { store: T::store(packed), start: 0, count, stack })
}

/// A field of arrays from elsewhere.
pub fn from_arrays(
    flow: &Bound<'_, PyAny>,
    covariance: Option<&Bound<'_, PyAny>>,
    jacobian: Option<&Bound<'_, PyAny>>,
    interval: Option<&str>,
) -> Outcome<FlowField> {
    let (shape, values) = arrays::doubles("flow", &arrays::filled_with_nan(flow)?)?;
    let [height, width, 2] = shape[..] else {
        return Err(Error::argument("flow", "shape (H, W, 2)", format!("shape {}", shape_text(&shape))).into());
    };
    // Plane k holds every `tail`-th value of an array from its `at`-th on.
    let planes = |values: &[f64], tail: usize, places: &[usize]| -> Vec<f64> {
        places.iter().flat_map(|&at| values.iter().skip(at).step_by(tail).copied()).collect()
    };
    let matrices = |name: &'static str, object: &Bound<'_, PyAny>, side: usize, places: &[usize]| {
        let (shape, values) = arrays::doubles(name, &arrays::filled_with_nan(object)?)?;
        if shape != [height, width, side, side] {
            let expected = format!("shape ({height}, {width}, {side}, {side})");
            return Err(Raised::from(Error::argument(name, expected, format!("shape {}", shape_text(&shape)))));
        }
        Ok((planes(&values, side * side, places), values))
    };
    let mut motion = planes(&values, 2, &[0, 1]);
    if let Some(jacobian) = jacobian {
        motion.extend(matrices("jacobian", jacobian, 2, &[0, 2, 1, 3])?.0);
    }
    let side = if jacobian.is_some() { 6 } else { 2 };
    let upper: Vec<usize> = (0..side).flat_map(|i| (i..side).map(move |j| i * side + j)).collect();
    let covariance = covariance.map(|object| matrices("covariance", object, side, &upper)).transpose()?;
    let is_asymmetric = |matrix| is_asymmetric(matrix, side);
    if let Some((_, values)) = &covariance
        && let Some(site) = values.chunks_exact(side * side).position(is_asymmetric)
    {
        let got = format!("an asymmetric one at pixel ({}, {})", site % width, site / width);
        return Err(Error::argument("covariance", "symmetric matrices", got).into());
    }
    let covariance = covariance.map(|(upper, _)| upper);
    let mut field = jacoflow::types::FlowField::from_planes((width, height), motion, covariance)?;
    field.layout.interval = interval.map(Interval::parse).transpose()?.unwrap_or_default();
    Ok(FlowField::single(field))
}

/// Whether elements of a matrix differ from their mirror images by more than rounding in single precision.
fn is_asymmetric(matrix: &[f64], side: usize) -> bool {
    let at = |i: usize, j: usize| matrix[i * side + j];
    let pairs = || (0..side).flat_map(|i| (0..i).map(move |j| (i, j)));
    pairs().any(|(i, j)| (at(i, j) - at(j, i)).abs() > f64::from(f32::EPSILON) * (at(i, i) * at(j, j)).sqrt())
}

fn missing(name: &str) -> Raised {
    Error::argument("state", format!("the entry {name:?}"), "none").into()
}

fn required<'py>(state: &Bound<'py, PyDict>, name: &str) -> Outcome<Bound<'py, PyAny>> {
    state.get_item(name)?.ok_or_else(|| missing(name))
}

fn plane<T: numpy::Element + Copy>(state: &Bound<'_, PyDict>, name: &str, length: usize) -> Outcome<Option<Vec<T>>> {
    let Some(array) = state.get_item(name)? else { return Ok(None) };
    let array = array.cast_into::<PyArrayDyn<T>>()?;
    let values = array.try_readonly()?.as_array().iter().copied().collect::<Vec<T>>();
    if values.len() != length {
        return Err(Error::argument("state", format!("{length} values in {name:?}"), values.len()).into());
    }
    Ok(Some(values))
}

/// Words of the status codes, by code.
#[pyfunction(name = "_status_names")]
pub fn status_names() -> Vec<&'static str> {
    Status::ALL.iter().map(|status| status.name()).collect()
}
