//! The shape of an array, as tifffile writes it into the first page: `{"shape": [..], "axes": ".."}`.

use super::recording::{Axis, Recording, Sizes};
use crate::error::{Error, Result, shape_text};
use serde_json::Value;
use std::path::Path;

/// What the description says; `None` when it is no such shape, or not that of `pages` pages of `width` x
/// `height` px.
///
/// # Errors
/// [`Error::Format`] when the planes lie along several axes that are not named, or along one that is neither
/// time nor channel nor slice.
pub(super) fn parse(
    path: &Path,
    description: &str,
    pages: usize,
    (width, height): (usize, usize),
) -> Result<Option<Recording>> {
    let Ok(Value::Object(entries)) = serde_json::from_str::<Value>(description) else { return Ok(None) };
    let shape: Option<Vec<usize>> = entries
        .get("shape")
        .and_then(Value::as_array)
        .and_then(|shape| shape.iter().map(|n| Some(n.as_u64()? as usize)).collect());
    let Some(shape) = shape else { return Ok(None) };
    // Axes of a page: rows, columns, samples.
    let own = match shape[..] {
        [.., h, w, 2..=4] if (h, w) == (height, width) => 3,
        [.., h, w] if (h, w) == (height, width) => 2,
        _ => return Ok(None),
    };
    let outer = &shape[..shape.len() - own];
    let count = outer.iter().try_fold(1_usize, |n, &axis| n.checked_mul(axis));
    let is_truncated = pages == 1 && entries.get("truncated") == Some(&Value::Bool(true));
    if count != Some(pages) && !is_truncated {
        return Ok(None);
    }
    let named = entries.get("axes").and_then(Value::as_str).filter(|axes| axes.chars().count() == shape.len());
    let letters: Vec<char> =
        named.map_or_else(|| vec!['?'; outer.len()], |axes| axes.chars().take(outer.len()).collect());
    let long: Vec<(char, usize)> = letters.into_iter().zip(outer.iter().copied()).filter(|(_, n)| *n > 1).collect();
    let mut sizes = Sizes { channels: 1, slices: 1, times: 1 };
    let mut order = Vec::new();
    for &(letter, length) in long.iter().rev() {
        let (axis, size) = match letter {
            'C' => (Axis::Channel, &mut sizes.channels),
            'Z' => (Axis::Slice, &mut sizes.slices),
            'T' => (Axis::Time, &mut sizes.times),
            // One axis that is not named is a sequence.
            _ if long.len() == 1 => (Axis::Time, &mut sizes.times),
            _ => {
                let outer = shape_text(outer);
                let message = format!(
                    "holds planes of shape {outer} along axes that are not all named T, C or Z; save it with their names (in tifffile metadata={{\"axes\": \"TCYX\"}}), or one channel a file"
                );
                return Err(Error::format(path, message));
            }
        };
        if order.contains(&axis) {
            return Err(Error::format(path, format!("names an axis twice: {named:?}")));
        }
        *size = length;
        order.push(axis);
    }
    let rest = [Axis::Channel, Axis::Slice, Axis::Time].into_iter().filter(|axis| !order.contains(axis));
    let order: Vec<Axis> = order.iter().copied().chain(rest).collect();
    Ok(Recording::in_order(sizes, [order[0], order[1], order[2]]))
}
