//! `region` of means and measurements: a rectangle, a disc, a polygon or a mask.

use crate::arrays;
use crate::errors::Outcome;
use jacoflow::error::{Error, shape_text};
use jacoflow::types::{Rect, Region};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// What a region may be, for messages.
const EXPECTED: &str =
    "a rectangle (x, y, width, height) in whole px, a disc (x, y, radius), corners (N, 2) or a boolean mask (H, W)";

/// The region that `object` stands for; `None`: everywhere.
pub fn parse(object: Option<&Bound<'_, PyAny>>) -> Outcome<Option<Region>> {
    let Some(object) = object else { return Ok(None) };
    if object.is_instance_of::<pyo3::types::PyString>() {
        return Err(Error::argument("region", EXPECTED, "a string").into());
    }
    if arrays::is_boolean(object)? {
        return Ok(Some(Region::Mask(arrays::boolean("region", object)?)));
    }
    let (shape, values) = arrays::doubles("region", object)?;
    match (shape.as_slice(), values.as_slice()) {
        (_, &[x, y, width, height]) if shape == [4] => rectangle([x, y, width, height]).map(Some),
        (_, &[x, y, radius]) if shape == [3] => Ok(Some(Region::Disc { centre: (x, y), radius })),
        ([_, 2], _) => Ok(Some(Region::Polygon(values.as_chunks::<2>().0.iter().map(|&[x, y]| (x, y)).collect()))),
        ([_, _], _) => {
            let dtype = arrays::dtype_name(&arrays::as_array("region", object)?);
            let got = format!("{dtype} of shape {}", shape_text(&shape));
            Err(PyTypeError::new_err(format!("region: expected a boolean mask (H, W) or corners (N, 2), got {got}"))
                .into())
        }
        _ => Err(Error::argument("region", EXPECTED, format!("shape {}", shape_text(&shape))).into()),
    }
}

fn rectangle(values: [f64; 4]) -> Outcome<Region> {
    let whole = |value: f64| (value >= 0.0 && value.fract() == 0.0 && value < 1e15).then_some(value as usize);
    if let [Some(x), Some(y), Some(width), Some(height)] = values.map(whole) {
        return Ok(Region::Rect(Rect { x, y, width, height }));
    }
    let [x, y, width, height] = values;
    let got = format!("({x}, {y}, {width}, {height})");
    Err(Error::argument("region", "(x, y, width, height), whole px, none negative", got).into())
}
