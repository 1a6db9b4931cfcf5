//! What the commands with a pipeline have in common: running it, and the report of how it ended.

use super::arguments::{GridArguments, MessageArguments};
use super::interrupt::Watch;
use super::open::Opened;
use super::progress::Bar;
use super::report::{Report, print_message};
use crate::error::{Error, Result};
use crate::io::{FrameSource, PixelSize};
use crate::pipeline::{FieldSink, Pipeline, Summary, TableTarget, check_target, is_folder};
use crate::simd::SimdReal;
use crate::temporal::{FlowStream, StreamPlan};
use serde_json::{Value, json};
use std::path::Path;

/// What a report holds beside the figures of the run.
pub struct ReportContext<'a> {
    /// The subcommand.
    pub command: &'static str,
    /// Options of messages.
    pub messages: &'a MessageArguments,
    /// Where results go, if anywhere.
    pub output: Option<&'a Path>,
    /// Further entries of the summary.
    pub details: Value,
}

/// Estimates flow of the opened frames and hands the fields to `sinks`.
pub fn run_flow<T: SimdReal>(
    opened: Opened,
    plan: StreamPlan,
    sinks: Vec<Box<FieldSink<T>>>,
    context: ReportContext<'_>,
    watch: &Watch,
) -> Result<Report> {
    let stage = Box::new(FlowStream::<T>::new(plan)?);
    let mut pipeline = Pipeline::new(stage).with_numbering(opened.numbering).with_sinks(sinks);
    let (summary, failure) = run_pipeline(&mut pipeline, opened.source, &context, watch);
    Ok(report(&summary, failure, context))
}

/// Runs the pipeline; what it did, with the error or interruption that ended it early.
pub fn run_pipeline<T: SimdReal>(
    pipeline: &mut Pipeline<T>,
    source: Box<dyn FrameSource>,
    context: &ReportContext<'_>,
    watch: &Watch,
) -> (Summary, Option<Error>) {
    let failure = pipeline.run(source, &Bar::new(watch, context.command, context.messages.quiet)).err();
    (pipeline.summary(), failure)
}

/// The report of a run, also printed in words on standard error unless quiet.
pub fn report(summary: &Summary, failure: Option<Error>, context: ReportContext<'_>) -> Report {
    let interrupted = matches!(failure, Some(Error::Interrupted));
    let output = place(summary, context.output, failure.is_none());
    if !context.messages.quiet && (failure.is_none() || interrupted) {
        print_message(&in_words(summary, output));
        if let Some(scale) = scale_in_words(&context.details) {
            print_message(&scale);
        }
    }
    let mut object = json!({
        "command": context.command,
        "frames": summary.frames,
        "fields": summary.fields,
        "valid_share": summary.valid_share(),
        "repairs": summary.repairs,
        "files": summary.files,
        "seconds": summary.seconds,
        "output": output,
        "interrupted": interrupted,
    });
    if let (Some(object), Value::Object(details)) = (object.as_object_mut(), context.details) {
        object.extend(details);
    }
    Report { summary: object, failure }
}

/// Where the results are: the requested place; after a stopped run the partial file, if there is one.
fn place<'a>(summary: &'a Summary, asked: Option<&'a Path>, complete: bool) -> Option<&'a Path> {
    let one_file = |asked: &&Path| *asked != Path::new("-") && !is_folder(asked);
    match asked.filter(one_file) {
        Some(_) if !complete || summary.files == 1 => summary.latest.as_deref(),
        _ => asked,
    }
}

fn in_words(summary: &Summary, output: Option<&Path>) -> String {
    let mut parts = vec![
        format!("{} frames", summary.frames),
        format!("{} fields", summary.fields),
        format!("{:.1} % of the sites valid", 100.0 * summary.valid_share()),
        format!("{:.2} s", summary.seconds),
    ];
    if summary.repairs > 0 {
        parts.push(format!("{} repairs", summary.repairs));
    }
    if let Some(output) = output.filter(|_| summary.files > 0) {
        let files = match summary.files {
            1 => "1 file:".to_string(),
            more if is_folder(output) => format!("{more} files:"),
            more => format!("{more} files, among them"),
        };
        parts.push(format!("{files} {}", output.display()));
    }
    parts.join(", ")
}

/// A pixel's size for a summary.
pub(super) fn pixel_size(size: &PixelSize) -> Value {
    json!({"width": size.pitch.0, "height": size.pitch.1, "unit": size.unit})
}

/// What was taken from the file instead of an option, in words.
fn scale_in_words(details: &Value) -> Option<String> {
    let rate = (details["fps_from"] == "file").then(|| format!("{} frames/s", details["fps"]));
    let pixel = &details["pixel_size"];
    let size = pixel["unit"].as_str().map(|unit| format!("pixels of {} x {} {unit}", pixel["width"], pixel["height"]));
    let parts: Vec<String> = rate.into_iter().chain(size).collect();
    (!parts.is_empty()).then(|| format!("as the file says: {}", parts.join(", ")))
}

/// The entries about the input that every summary has.
pub fn input_details(opened: &Opened, grid: &GridArguments) -> Value {
    let (width, height) = opened.first.size;
    json!({
        "input": opened.name, "width": width, "height": height, "dtype": opened.first.dtype,
        "fps": opened.numbering.rate,
        "fps_from": opened.numbering.rate.map(|_| if opened.has_own_rate { "file" } else { "option" }),
        "pixel_size": opened.pixel_size.as_ref().map(pixel_size),
        "region": grid.region.map(|r| [r.x, r.y, r.width, r.height]), "stride": grid.stride.unwrap_or(1),
    })
}

/// Where a table goes: a `.csv` file that may be written, or standard output unless JSON goes there.
pub(super) fn table_target(output: Option<&Path>, force: bool, json: bool) -> Result<TableTarget> {
    match output {
        Some(path) if path != Path::new("-") => {
            if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("csv")) {
                return Err(Error::argument("output", "a .csv file, or - for standard output", path.display()));
            }
            check_target(path, force)?;
            Ok(TableTarget::File(path.to_path_buf()))
        }
        _ if json => Err(Error::argument("output", "a .csv file, as --json needs standard output", "standard output")),
        _ => Ok(TableTarget::StandardOutput),
    }
}
