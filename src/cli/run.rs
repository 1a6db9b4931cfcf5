//! What the commands with a pipeline have in common: running it, and telling how it ended.

use super::arguments::{SiteArguments, TellArguments};
use super::interrupt::Watch;
use super::open::Opened;
use super::progress::Bar;
use super::report::{Report, tell};
use crate::error::{Error, Result};
use crate::io::FrameSource;
use crate::pipeline::{Pipeline, Summary, TableTarget, check_target, is_folder};
use crate::simd::SimdReal;
use serde_json::{Value, json};
use std::path::Path;

/// What a command tells beside the figures of its run.
pub struct Telling<'a> {
    /// The subcommand.
    pub command: &'static str,
    /// The arguments about messages.
    pub tell: &'a TellArguments,
    /// Where results go, if anywhere.
    pub output: Option<&'a Path>,
    /// Further entries of the summary.
    pub details: Value,
}

/// Runs the pipeline; what it did, with the error or interruption that ended it early.
pub fn run_pipeline<T: SimdReal>(
    pipeline: &mut Pipeline<T>,
    source: Box<dyn FrameSource>,
    telling: &Telling<'_>,
    watch: &Watch,
) -> (Summary, Option<Error>) {
    let failure = pipeline.run(source, &Bar::new(watch, telling.command, telling.tell.quiet)).err();
    (pipeline.summary(), failure)
}

/// The report of a run, told in words on standard error unless asked not to.
pub fn report(summary: &Summary, failure: Option<Error>, telling: Telling<'_>) -> Report {
    let interrupted = matches!(failure, Some(Error::Interrupted));
    let output = place(summary, telling.output, failure.is_none());
    if !telling.tell.quiet && (failure.is_none() || interrupted) {
        tell(&in_words(summary, output));
    }
    let mut object = json!({
        "command": telling.command,
        "frames": summary.frames,
        "fields": summary.fields,
        "valid_share": summary.valid_share(),
        "repairs": summary.repairs,
        "files": summary.files,
        "seconds": summary.seconds,
        "output": output,
        "interrupted": interrupted,
    });
    if let (Some(object), Value::Object(details)) = (object.as_object_mut(), telling.details) {
        object.extend(details);
    }
    Report { summary: object, failure }
}

/// Where the results are: the place asked for; of a run that was stopped the other name that one file has
/// then, and nothing where it left none.
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

/// The entries about the input that every summary has.
pub fn input_details(opened: &Opened, sites: &SiteArguments) -> Value {
    let (width, height) = opened.first.size;
    json!({
        "input": opened.name, "width": width, "height": height, "dtype": opened.first.dtype,
        "fps": opened.numbering.rate,
        "region": sites.region.map(|r| [r.x, r.y, r.width, r.height]), "stride": sites.stride.unwrap_or(1),
    })
}

/// Where a table goes: to a `.csv` file that may be written, or to standard output, unless the report as JSON
/// goes there.
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
