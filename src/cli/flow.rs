//! `jacoflow flow`: a field for every two or three frames.

use super::arguments::{
    ComputeArguments, GridArguments, InputArguments, MessageArguments, MethodArguments, OutputArguments,
};
use super::interrupt::Watch;
use super::open::{Opened, compute, open_for_method, preprocess, read_initial, read_mask};
use super::paths::CommandPaths;
use super::report::Report;
use super::run::{ReportContext, input_details, run_flow};
use crate::error::{Error, Result};
use crate::flow::{Estimator, EstimatorOptions};
use crate::pipeline::{OutputPlan, OutputWish, TableTarget, is_folder};
use crate::temporal::StreamPlan;
use crate::types::SamplingGrid;
use clap::Args;
use serde_json::{Value, json};
use std::path::Path;

/// Options of `flow`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "Results in a folder are numbered by the frame they belong to. What exists is not replaced without --force. When a run is stopped\n\
    (Ctrl-C), the files that are complete stay; rows of a .csv are then kept in name.partial.csv.\n\n\
    Examples:\n  \
    jacoflow flow frames/ -o out/ --picture colour,quiver\n  \
    jacoflow flow a.png b.png c.png -o flow.npz --method windowed --window-sigma 3\n  \
    jacoflow flow video.mp4 --points 120,80 --points 200,90 > points.csv\n  \
    ffmpeg -i video.mp4 -f yuv4mpegpipe - | jacoflow flow - -o out/ --stride 4 --json"
)]
pub struct FlowCommand {
    #[command(flatten)]
    pub input: InputArguments,
    #[command(flatten)]
    pub method: MethodArguments,
    #[command(flatten)]
    pub grid: GridArguments,
    #[command(flatten)]
    pub output: OutputArguments,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
}

/// The way from the frames of an opened input to fields.
pub struct Prepared {
    /// Preparation, estimator and fusion.
    pub plan: StreamPlan,
    /// Whether to compute in double precision.
    pub is_double: bool,
    /// How fields are made, for metadata and summary.
    pub description: Value,
}

/// Builds the estimator that the arguments ask for.
pub fn prepare(
    opened: &mut Opened,
    input: &InputArguments,
    method: &MethodArguments,
    grid: &GridArguments,
    compute_arguments: &ComputeArguments,
) -> Result<Prepared> {
    let chosen = method.method(opened.frames, input.smooth)?;
    let places = grid.sampling_grid()?;
    places.shape(opened.first.size)?;
    let (threads, simd) = compute(compute_arguments)?;
    let recursive = method.recursive()?;
    let common = EstimatorOptions {
        sites: places,
        mask: read_mask(grid.mask.as_deref(), opened.first.size)?,
        initial: method.initial.as_deref().map(read_initial).transpose()?,
        units: opened.units(&method.units),
        covariance: !method.no_covariance && chosen.info().has_covariance,
        systematic: recursive.is_some(),
        diagnostics: false,
        noise: method.noise,
        threads,
        simd,
    };
    let mut description = method.describe(&chosen);
    description["quantise"] = json!(input.quantise);
    description["smooth"] = json!(input.smooth);
    description["input"] = json!(opened.name);
    let steps = preprocess(input, common.mask.as_ref())?;
    let mut plan = StreamPlan::new(Estimator::new(chosen, common)?, steps, recursive)?;
    if method.pairs {
        plan = plan.of_pairs()?;
        if let Some(odd) = opened.frames.filter(|count| count % 2 == 1) {
            return Err(Error::argument("frames", "an even number, in pairs", odd));
        }
    }
    Ok(Prepared { plan, is_double: compute_arguments.precision.is_double(opened.first.dtype), description })
}

/// As [`prepare`], with the covariance that `purpose` needs.
pub fn prepare_with_covariance(
    opened: &mut Opened,
    input: &InputArguments,
    method: &MethodArguments,
    grid: &GridArguments,
    compute_arguments: &ComputeArguments,
    purpose: &str,
) -> Result<Prepared> {
    if method.no_covariance {
        return Err(Error::argument("no_covariance", format!("a covariance, {purpose}"), "none"));
    }
    let prepared = prepare(opened, input, method, grid, compute_arguments)?;
    let chosen = prepared.plan.estimator().method();
    if !chosen.info().has_covariance {
        return Err(Error::argument("method", "one with a covariance", chosen.name()));
    }
    Ok(prepared)
}

/// Adds the paths of `output` to those of a command; `points`: results are for a list of points.
pub fn with_output(paths: CommandPaths, output: &OutputArguments, points: bool) -> Result<CommandPaths> {
    let Some(given) = output.output.as_deref() else { return Ok(paths) };
    let plan = decide_output(output, points, false, true, None)?;
    let numbered = plan.field_files().into_iter().chain(plan.picture_files());
    // The table of a folder, which another run writes without a format for points.
    let table = Some(given.join("points.csv")).filter(|_| is_folder(given) && output.format.is_empty());
    Ok(paths.writing_files("output", given, plan.single_files().into_iter().chain(table), numbered))
}

/// Where results go: the user's words, or CSV on standard output for points without any. With --force,
/// results that an earlier run left for frames from `start` on are removed at the end.
pub fn plan_output(
    output: &OutputArguments,
    sites: &SamplingGrid,
    json: bool,
    fields: Option<usize>,
    start: usize,
) -> Result<OutputPlan> {
    let points = matches!(sites, SamplingGrid::Points(_));
    let mut plan = decide_output(output, points, json, output.force, fields)?;
    plan.stale_from = output.force.then_some(start);
    plan.check_sites(sites)?;
    if json && plan.table == Some(TableTarget::StandardOutput) {
        return Err(Error::argument("output", "a file or folder, as --json needs standard output", "-"));
    }
    Ok(plan)
}

fn decide_output(
    output: &OutputArguments,
    points: bool,
    json: bool,
    replace: bool,
    fields: Option<usize>,
) -> Result<OutputPlan> {
    let standard_output = points && output.output.is_none() && !json;
    let path = if standard_output { Some(Path::new("-")) } else { output.output.as_deref() };
    let csv = vec!["csv".to_string()];
    // The name of a file says its format.
    let is_file = path.is_some_and(|path| path != Path::new("-") && !is_folder(path));
    OutputPlan::decide(&OutputWish {
        path,
        formats: if points && output.format.is_empty() && !is_file { &csv } else { &output.format },
        pictures: &output.picture,
        replace,
        fields,
    })
}

/// Refuses to compute what nobody would see: without a place for results only the summary of `--json` is
/// left, or the output that `has_other` stands for.
pub fn expect_output(plan: &OutputPlan, json: bool, has_other: bool) -> Result<()> {
    if plan.writes_nothing() && !json && !has_other {
        let wanted =
            "a folder or a file for the results (- for CSV on standard output), or --json for the summary alone";
        return Err(Error::argument("output", wanted, "none"));
    }
    Ok(())
}

impl FlowCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let files = self.grid.files().chain(self.method.initial.as_deref());
        let paths = CommandPaths::of_input(&self.input.input).reading(files);
        let paths = with_output(paths, &self.output, !self.grid.points.is_empty())?;
        let _new_folders = paths.check(self.output.force)?;
        let mut opened = open_for_method(&self.input, &self.method)?;
        let Prepared { plan: stream, is_double, description } =
            prepare(&mut opened, &self.input, &self.method, &self.grid, &self.compute)?;
        let estimator = stream.estimator();
        let count = |frames: usize| (frames + 1).saturating_sub(estimator.frames_needed());
        let fields = opened.frames.map(|frames| if self.method.pairs { frames / 2 } else { count(frames) });
        let plan =
            plan_output(&self.output, &estimator.options().sites, self.messages.json, fields, opened.numbering.start)?;
        expect_output(&plan, self.messages.json, false)?;
        plan.check_parameters(estimator.model().parameters().iter().map(|parameter| parameter.name))?;
        let mut details = input_details(&opened, &self.grid);
        details["method"] = description["method"].clone();
        let context =
            ReportContext { command: "flow", messages: &self.messages, output: self.output.output.as_deref(), details };
        let (description, ranges) = (description.to_string(), self.output.ranges());
        if is_double {
            run_flow::<f64>(opened, stream, plan.sinks(description, ranges)?, context, watch)
        } else {
            run_flow::<f32>(opened, stream, plan.sinks(description, ranges)?, context, watch)
        }
    }
}
