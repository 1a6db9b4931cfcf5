//! OME-XML in the first page's description (OME-TIFF): axes, time between frames, size of a pixel.
//!
//! Source: the OME data model, schema 2016-06, elements Pixels, Channel, TiffData, UUID and Plane.

use super::recording::{Axis, Plane, Recording, Sizes};
use super::xml::{Element, elements};
use crate::error::{Error, Result};
use crate::io::planes::PixelSize;
use std::collections::HashSet;
use std::path::Path;

/// Where the planes from `first` (in the file's order) on are: pages `page`, `page + 1`, ..., of `file`.
struct Run {
    first: [usize; 3],
    page: usize,
    count: Option<usize>,
    file: Option<String>,
}

/// What the description says; `None` when it is no OME-XML.
///
/// # Errors
/// [`Error::Format`] when it describes several images, or its sizes make no sense, or it is in another file.
pub(super) fn parse(path: &Path, description: &str, pages: usize) -> Result<Option<Recording>> {
    if !description.contains("<OME") && !description.contains(":OME") {
        return Ok(None);
    }
    let (mut pixels, mut images, mut channels) = (None::<Element<'_>>, 0, 0);
    let (mut runs, mut planes): (Vec<Run>, Vec<Element<'_>>) = (Vec::new(), Vec::new());
    for element in elements(description) {
        match element.name {
            "BinaryOnly" => {
                let place = element.get("MetadataFile").unwrap_or("another file");
                let message = format!("its axes are described in {place}, which is not read; save it as one OME-TIFF");
                return if pages > 1 { Err(Error::format(path, message)) } else { Ok(None) };
            }
            "Pixels" => {
                images += 1;
                pixels = pixels.or(Some(element));
            }
            "Channel" => channels += 1,
            "TiffData" => runs.push(run(&element)),
            "UUID" => {
                if let Some(run) = runs.last_mut() {
                    run.file = element.get("FileName").map(str::to_string);
                }
            }
            "Plane" => planes.push(element),
            _ => {}
        }
    }
    let Some(pixels) = pixels else { return Ok(None) };
    if images > 1 {
        return Err(Error::format(path, format!("its OME-XML describes {images} images; save one image a file")));
    }
    let size = |name: &str| pixels.number::<usize>(name).filter(|&n| n > 0).unwrap_or(1);
    // Red, green and blue of one channel are samples of it.
    let size_c = if channels > 0 { size("SizeC").min(channels) } else { size("SizeC") };
    let sizes = Sizes { channels: size_c, slices: size("SizeZ"), times: size("SizeT") };
    let recording = Recording::in_order(sizes, order(pixels.get("DimensionOrder").unwrap_or("XYCZT")));
    let mut recording = recording.ok_or_else(|| Error::format(path, "its OME-XML describes impossible sizes"))?;
    place(&mut recording, path, &runs, pages);
    for plane in planes {
        let index = |name: &str| plane.number::<usize>(name).unwrap_or(0);
        let (c, z, t) = (index("TheC"), index("TheZ"), index("TheT"));
        if c < sizes.channels && z < sizes.slices && t < sizes.times {
            let at = recording.place(c, z, t);
            recording.planes[at].time =
                plane.number::<f64>("DeltaT").and_then(|time| Some(time * seconds(plane.get("DeltaTUnit"))?));
        }
    }
    let interval: Option<f64> = pixels.number("TimeIncrement");
    let interval = interval.and_then(|interval| Some(interval * seconds(pixels.get("TimeIncrementUnit"))?));
    recording.frame_rate = interval.map(|interval| 1.0 / interval).filter(|rate| *rate > 0.0 && rate.is_finite());
    let size = |name: &str, unit: &str| Some((pixels.number::<f64>(name)?, pixels.get(unit).unwrap_or("\u{b5}m")));
    let (x, y) = (size("PhysicalSizeX", "PhysicalSizeXUnit"), size("PhysicalSizeY", "PhysicalSizeYUnit"));
    // Where one side is missing, pixels are square.
    recording.pixel_size = x.or(y).zip(y.or(x)).and_then(|((x, unit), (y, of_y))| {
        let y = if unit == of_y { y } else { y * metres(of_y)? / metres(unit)? };
        PixelSize::new((x, y), unit)
    });
    Ok(Some(recording))
}

/// A unit of length that OME-XML names, in metres.
fn metres(unit: &str) -> Option<f64> {
    Some(match unit {
        "m" => 1.0,
        "cm" => 1e-2,
        "mm" => 1e-3,
        "\u{b5}m" | "\u{3bc}m" => 1e-6,
        "nm" => 1e-9,
        "pm" => 1e-12,
        _ => return None,
    })
}

fn run(element: &Element<'_>) -> Run {
    let index = |name: &str| element.number::<usize>(name);
    let first = ["FirstC", "FirstZ", "FirstT"].map(|name| index(name).unwrap_or(0));
    // Without a count: one plane where a page is named, else all.
    let count = index("PlaneCount").or(index("IFD").map(|_| 1));
    Run { first, page: index("IFD").unwrap_or(0), count, file: None }
}

/// Axes from the innermost outwards.
fn order(word: &str) -> [Axis; 3] {
    use Axis::{Channel, Slice, Time};
    match word {
        "XYCTZ" => [Channel, Time, Slice],
        "XYZCT" => [Slice, Channel, Time],
        "XYZTC" => [Slice, Time, Channel],
        "XYTCZ" => [Time, Channel, Slice],
        "XYTZC" => [Time, Slice, Channel],
        _ => [Channel, Slice, Time],
    }
}

/// Replaces the pages by those that `runs` name, if any. Runs of other files are left out; where all are of
/// one file that is this one, though it may have had another name when it was written.
fn place(recording: &mut Recording, path: &Path, runs: &[Run], pages: usize) {
    if runs.is_empty() {
        return;
    }
    let files: HashSet<&str> = runs.iter().filter_map(|run| run.file.as_deref()).collect();
    let own = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let in_order: Vec<Option<usize>> = recording.planes.iter().map(|plane| plane.page).collect();
    let mut by_order = vec![0; in_order.len()];
    for (at, place) in in_order.iter().enumerate() {
        by_order[place.unwrap_or(0)] = at;
    }
    recording.planes.fill(Plane::default());
    for run in runs {
        let [c, z, t] = run.first;
        let Sizes { channels, slices, times } = recording.sizes;
        let elsewhere = files.len() > 1 && run.file.as_deref().is_some_and(|file| file != own);
        if elsewhere || c >= channels || z >= slices || t >= times {
            continue;
        }
        let start = in_order[recording.place(c, z, t)].unwrap_or(0);
        let count = run.count.unwrap_or(pages).min(by_order.len() - start);
        for k in (0..count).take_while(|k| run.page + k < pages) {
            recording.planes[by_order[start + k]].page = Some(run.page + k);
        }
    }
}

/// Seconds in a unit of time; `None` for an unknown one.
fn seconds(unit: Option<&str>) -> Option<f64> {
    match unit.unwrap_or("s") {
        "s" => Some(1.0),
        "ms" => Some(1e-3),
        "\u{b5}s" => Some(1e-6),
        "ns" => Some(1e-9),
        "min" => Some(60.0),
        "h" => Some(3600.0),
        "d" => Some(86400.0),
        _ => None,
    }
}
