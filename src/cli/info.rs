//! `jacoflow info`: what a recording or a result file holds.

use super::arguments::{MessageArguments, PlaneArguments};
use super::interrupt::Watch;
use super::open::open_source;
use super::progress::Bar;
use super::report::{Report, print};
use super::run::pixel_size;
use crate::error::{Error, Result};
use crate::io::npz::NpzReader;
use crate::io::{FlowImage, FrameSource, OpenOptions, kind_of, read_flo, read_kitti, read_npz, read_pfm};
use crate::parallel::Progress;
use crate::temporal::SavedFilter;
use crate::types::AnyFrame;
use clap::Args;
use serde_json::{Map, Value, json};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Options of `info`.
#[derive(Debug, Args)]
#[command(
    after_help = "Reads recordings (folder, images, .y4m, .npy, video) results (.npz, .flo, .pfm, KITTI .png) and saved filters (.npz).\n\n\
    Examples:\n  \
    jacoflow info frames/\n  \
    jacoflow info out/000012.npz --json"
)]
pub struct InfoCommand {
    /// A recording, as for `flow`, or one result file
    #[arg(required = true, value_name = "INPUT")]
    pub input: Vec<String>,
    #[command(flatten)]
    pub planes: PlaneArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
}

impl InfoCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let summary = match &self.input[..] {
            [one] => match result_info(Path::new(one)) {
                Some(info) => info?,
                None => self.recording(watch)?,
            },
            _ => self.recording(watch)?,
        };
        if !self.messages.json {
            print(&in_words(&summary))?;
        }
        Ok(Report { summary, failure: None })
    }

    fn recording(&self, watch: &Watch) -> Result<Value> {
        let planes = self.planes.selection();
        let options = OpenOptions { colour: crate::io::Colour::Luminance, planes, ..OpenOptions::default() };
        let mut source = open_source(&self.input, &options)?;
        let (name, hint, rate) = (source.describe(), source.len_hint(), source.frame_rate());
        let size = source.pixel_size();
        let first = source.next_frame()?;
        let first = first.ok_or_else(|| Error::argument("input", "at least one frame", format!("none in {name}")))?;
        let frames = match hint {
            Some(frames) => frames,
            None => 1 + count(&mut *source, &Bar::new(watch, "info", self.messages.quiet))?,
        };
        let (width, height) = first.size();
        Ok(json!({
            "command": "info", "kind": "recording", "input": name, "frames": frames, "width": width, "height": height,
            "dtype": first.dtype(), "fps": rate, "pixel_size": size.as_ref().map(pixel_size),
            "first_frame": frame_statistics(&first),
        }))
    }
}

/// Statistics of the samples, which are not copied: they may be as many as memory holds.
fn frame_statistics(frame: &AnyFrame) -> Value {
    match frame {
        AnyFrame::U8(frame) => statistics(frame.data().iter().map(|&sample| f64::from(sample))),
        AnyFrame::U16(frame) => statistics(frame.data().iter().map(|&sample| f64::from(sample))),
        AnyFrame::F32(frame) => statistics(frame.data().iter().map(|&sample| f64::from(sample))),
        AnyFrame::F64(frame) => statistics(frame.data().iter().copied()),
    }
}

fn count(source: &mut dyn FrameSource, bar: &Bar<'_>) -> Result<usize> {
    let mut frames = 0;
    while source.next_frame()?.is_some() {
        frames += 1;
        bar.step(frames, 0)?;
    }
    Ok(frames)
}

/// Least, mean and greatest of the finite values, and their share.
fn statistics(values: impl Iterator<Item = f64>) -> Value {
    let (mut least, mut greatest, mut sum, mut finite, mut all) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0u64, 0u64);
    for value in values {
        all += 1;
        if value.is_finite() {
            finite += 1;
            sum += value;
            least = least.min(value);
            greatest = greatest.max(value);
        }
    }
    if finite == 0 {
        return json!({"min": null, "mean": null, "max": null, "known_share": 0.0});
    }
    json!({"min": least, "mean": sum / finite as f64, "max": greatest, "known_share": finite as f64 / all as f64})
}

/// What a result file holds; `None`: not a result file by its name (or, for PNG, its kind of pixels).
fn result_info(path: &Path) -> Option<Result<Value>> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    // Recordings are recognised by their content under any name.
    if path.to_str().and_then(kind_of).is_some_and(|kind| matches!(kind, "tiff" | "y4m" | "npy")) {
        return None;
    }
    match extension.as_str() {
        "flo" => Some(read_flo(path).map(|flow| flow_image_info(path, "flo", &flow))),
        "pfm" => Some(read_pfm(path).map(|map| {
            let names: &[&str] = if map.planes.len() == 1 { &["value"] } else { &["u", "v", "third"] };
            let planes = names.iter().zip(&map.planes).map(|(name, plane)| (*name, &plane[..]));
            planes_info(path, "pfm", (map.width, map.height), planes)
        })),
        "npz" if !is_foreign(path) => Some(npz_info(path)),
        "png" if is_kitti(path) => Some(read_kitti(path).map(|flow| flow_image_info(path, "kitti", &flow))),
        _ => None,
    }
}

/// An archive of arrays that holds neither a field nor a filter.
fn is_foreign(path: &Path) -> bool {
    NpzReader::open(path).is_ok_and(|archive| !archive.contains("metadata") && !archive.contains("header"))
}

/// KITTI flow is the only 16-bit RGB picture among ours.
fn is_kitti(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let Ok(reader) = png::Decoder::new(BufReader::new(file)).read_info() else { return false };
    let info = reader.info();
    info.color_type == png::ColorType::Rgb && info.bit_depth == png::BitDepth::Sixteen
}

fn flow_image_info(path: &Path, format: &str, flow: &FlowImage) -> Value {
    let planes = [("u", flow.u()), ("v", flow.v())];
    planes_info(path, format, (flow.width(), flow.height()), planes.into_iter())
}

fn planes_info<'a, T: Copy + Into<f64> + 'a>(
    path: &Path,
    format: &str,
    (width, height): (usize, usize),
    planes: impl Iterator<Item = (&'a str, &'a [T])>,
) -> Value {
    let planes: Map<String, Value> =
        planes.map(|(name, values)| (name.to_string(), statistics(values.iter().map(|&value| value.into())))).collect();
    let share = planes.get("u").or(planes.get("value")).map(|plane| plane["known_share"].clone());
    json!({
        "command": "info", "kind": "result", "input": path, "format": format, "width": width, "height": height,
        "valid_share": share, "planes": planes,
    })
}

/// A saved filter, if the archive holds one.
fn filter_info(path: &Path) -> Result<Option<Value>> {
    let saved = SavedFilter::describe(&mut NpzReader::open(path)?)?;
    Ok(saved.map(|saved| {
        let options: Value = serde_json::from_str(&saved.options).unwrap_or_default();
        json!({
            "command": "info", "kind": "filter state", "input": path, "format": "npz", "frames": saved.frames,
            "width": saved.frame_size.0, "height": saved.frame_size.1, "dtype": saved.precision,
            "form": options["form"], "transition": options["transition"], "repairs": saved.repairs, "options": options,
        })
    }))
}

fn npz_info(path: &Path) -> Result<Value> {
    if let Some(info) = filter_info(path)? {
        return Ok(info);
    }
    let stored = read_npz::<f64>(path)?;
    let field = &stored.field;
    let planes = field.layout.parameters.iter().map(|name| (name.as_str(), field.plane(name).unwrap_or(&[])));
    let mut info = planes_info(path, "npz", (field.width, field.height), planes);
    let valid = field.status.iter().filter(|status| status.is_valid()).count();
    info["valid_share"] = json!(valid as f64 / field.len().max(1) as f64);
    info["model"] = json!(field.layout.model);
    info["frame_index"] = json!(field.layout.frame_index);
    info["frame_period"] = json!(field.layout.units.frame_period);
    let units = field.layout.parameters.iter().map(|name| (name.clone(), field.layout.units.of_parameter(name).into()));
    info["units"] = Value::Object(units.collect());
    info["covariance"] = json!(field.covariance.is_some());
    info["options"] = json!(stored.options);
    info["library"] = json!(stored.library);
    Ok(info)
}

/// Entries in the order in which people want to read them.
const ORDER: [&str; 17] = [
    "kind",
    "input",
    "format",
    "frames",
    "width",
    "height",
    "dtype",
    "form",
    "transition",
    "repairs",
    "fps",
    "model",
    "frame_index",
    "frame_period",
    "covariance",
    "valid_share",
    "library",
];

/// The summary as lines `name: value`, planes as a small table.
fn in_words(summary: &Value) -> String {
    let mut lines: Vec<String> = Vec::new();
    for name in ORDER {
        match &summary[name] {
            Value::Null => {}
            Value::String(value) => lines.push(format!("{:<14}{value}", name.replace('_', " "))),
            value => lines.push(format!("{:<14}{value}", name.replace('_', " "))),
        }
    }
    let pixel = &summary["pixel_size"];
    if let Some(unit) = pixel["unit"].as_str() {
        lines.push(format!("{:<14}{} x {} {unit}", "pixel size", pixel["width"], pixel["height"]));
    }
    if summary["first_frame"].is_object() {
        lines.push(format!("{:<14}{}", "first frame", statistics_line(&summary["first_frame"])));
    }
    for (name, plane) in summary["planes"].as_object().into_iter().flatten() {
        let unit = summary["units"][name].as_str().unwrap_or_default();
        lines.push(format!("{name:<14}{}  {unit}", statistics_line(plane)).trim_end().to_string());
    }
    lines.join("\n") + "\n"
}

fn statistics_line(plane: &Value) -> String {
    let number = |key: &str| plane[key].as_f64().map_or_else(|| "-".to_string(), |value| format!("{value:.6}"));
    format!(
        "min {}  mean {}  max {}  known {:.1} %",
        number("min"),
        number("mean"),
        number("max"),
        100.0 * plane["known_share"].as_f64().unwrap_or(0.0)
    )
}
