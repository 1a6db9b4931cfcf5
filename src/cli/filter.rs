//! `jacoflow filter`: flow filtered in time, a field for every frame.

use super::arguments::{
    ComputeArguments, FilterArguments, GridArguments, InputArguments, MessageArguments, OutputArguments,
    describe_filter,
};
use super::flow::{expect_output, plan_output, with_output};
use super::interrupt::Watch;
use super::open::{Opened, compute, open_input, preprocess, read_mask};
use super::paths::{CommandPaths, is_same_file};
use super::report::{Report, print_message};
use super::run::{ReportContext, input_details, report, run_pipeline};
use crate::error::{Error, Result};
use crate::io::{Element, npz::NpzReader};
use crate::pipeline::{FilterStage, OutputPlan, Pipeline, check_target, is_folder};
use crate::simd::SimdReal;
use crate::temporal::{FlowFilter, FlowFilterOptions, SavedFilter};
use crate::types::Precision;
use clap::Args;
use std::path::{Path, PathBuf};

/// Options of `filter`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "A filter starts from nothing and needs some tens of frames to settle. Its state can be saved and taken up again: the next run then gives\n\
    the same bits as one run over all frames. The state is saved after the last completed frame, also when the run is stopped.\n\n\
    Examples:\n  \
    jacoflow filter frames/ -o out/ --profile patent --quantise --smooth 3\n  \
    jacoflow filter frames/ --profile measured --points 140,140 > point.csv\n  \
    jacoflow filter frames/ -o out/ --stop 200 --save-state state.npz\n  \
    jacoflow filter frames/ -o rest/ --start 200 --resume state.npz"
)]
pub struct FilterCommand {
    #[command(flatten)]
    pub input: InputArguments,
    #[command(flatten)]
    pub filter: FilterArguments,
    #[command(flatten)]
    pub grid: GridArguments,
    #[command(flatten)]
    pub output: OutputArguments,
    /// Save the state after the last frame (.npz)
    #[arg(long, value_name = "FILE", help_heading = "State")]
    pub save_state: Option<PathBuf>,
    /// Go on from a saved state, with its options; the frames are those that follow
    #[arg(long, value_name = "FILE", help_heading = "State", conflicts_with_all = ["region", "stride", "points", "mask"])]
    pub resume: Option<PathBuf>,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
}

impl FilterCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let steps = [("quantise", self.input.quantise), ("smooth", self.input.smooth), ("fps", self.input.fps)];
        let step = steps.into_iter().find(|(_, given)| given.is_some()).map(|(name, _)| name);
        if let (Some(_), Some(name)) = (&self.resume, self.filter.given().or(step)) {
            return Err(Error::argument(name, "no such option with --resume, whose state has its own", "one"));
        }
        let _new_folders = self.paths()?.check(self.output.force)?;
        let mut opened = open_input(&self.input)?;
        let options = self.options(&mut opened)?;
        if let Some(path) = self.save_state.as_ref().filter(|path| !self.is_in_new_folder(path)) {
            check_target(path, self.output.force || self.is_resumed(path))
                .map_err(|error| error.about("save_state"))?;
        }
        if let Some(path) = &self.resume {
            return self.resume(path, opened, &options, watch);
        }
        if options.is_double(self.compute.precision, opened.first.dtype) {
            self.run(opened, FilterStage::<f64>::new(options), watch)
        } else {
            self.run(opened, FilterStage::<f32>::new(options), watch)
        }
    }

    /// What the command reads and writes. The state that it resumes may be replaced by that which it saves.
    fn paths(&self) -> Result<CommandPaths> {
        let is_replaced = |path: &&Path| self.save_state.as_deref().is_some_and(|saved| is_same_file(saved, path));
        let resumed = self.resume.as_deref().filter(|path| !is_replaced(path));
        let paths = CommandPaths::of_input(&self.input.input).reading(self.grid.files().chain(resumed));
        let paths = with_output(paths, &self.output, !self.grid.points.is_empty())?;
        Ok(paths.writing("save_state", self.save_state.as_deref()))
    }

    /// Whether a path is that of the state that the filter starts from.
    fn is_resumed(&self, path: &Path) -> bool {
        self.resume.as_deref().is_some_and(|resumed| is_same_file(resumed, path))
    }

    /// Whether a file is to lie in the folder of the results, which is made before anything is written.
    fn is_in_new_folder(&self, path: &Path) -> bool {
        let folder = self.output.output.as_deref().filter(|folder| is_folder(folder) && !folder.exists());
        folder.is_some_and(|folder| path.parent() == Some(folder))
    }

    /// Goes on with a saved filter, in the precision that it was saved in.
    fn resume(&self, path: &Path, opened: Opened, options: &FlowFilterOptions, watch: &Watch) -> Result<Report> {
        if self.compute.precision != Precision::Auto {
            return Err(Error::argument("precision", "auto with --resume, whose state has its own", "another"));
        }
        let (threads, simd) = (options.threads, options.simd);
        if SavedFilter::is_double(&mut NpzReader::open(path)?)? {
            let filter = FlowFilter::<f64>::load(path)?.with_computation(threads, simd);
            self.run(opened, FilterStage::resume(filter), watch)
        } else {
            let filter = FlowFilter::<f32>::load(path)?.with_computation(threads, simd);
            self.run(opened, FilterStage::resume(filter), watch)
        }
    }

    fn options(&self, opened: &mut Opened) -> Result<FlowFilterOptions> {
        let mut options = self.filter.options(opened.first.dtype)?;
        if self.resume.is_some() {
            // The saved state has its own.
            opened.pixel_size = None;
        }
        options.units = opened.units(&self.filter.units);
        options.sites = self.grid.sampling_grid()?;
        options.sites.shape(opened.first.size)?;
        options.mask = read_mask(self.grid.mask.as_deref(), opened.first.size)?;
        options.preprocess = preprocess(&self.input, options.mask.as_ref())?;
        (options.threads, options.simd) = compute(&self.compute)?;
        Ok(options)
    }

    fn run<T: SimdReal + Element>(&self, opened: Opened, stage: FilterStage<T>, watch: &Watch) -> Result<Report> {
        let options = stage.options();
        let description = describe_filter(options);
        let mut details = input_details(&opened, &self.grid);
        details["form"] = options.form.name().into();
        details["save_state"] = serde_json::json!(self.save_state);
        let start = opened.numbering.start;
        let plan: OutputPlan = plan_output(&self.output, &options.sites, self.messages.json, opened.frames, start)?;
        expect_output(&plan, self.messages.json, self.save_state.is_some())?;
        let sinks = plan.sinks(description.to_string(), self.output.ranges())?;
        let mut pipeline = Pipeline::<T>::new(Box::new(stage)).with_numbering(opened.numbering).with_sinks(sinks);
        let context = ReportContext {
            command: "filter",
            messages: &self.messages,
            output: self.output.output.as_deref(),
            details,
        };
        let (summary, mut failure) = run_pipeline(&mut pipeline, opened.source, &context, watch);
        if let Some(path) = self.save_state.as_ref().filter(|_| summary.fields > 0) {
            let saved = pipeline.stage().save(path);
            if saved.is_ok() && !self.messages.quiet {
                let next = opened.numbering.index(summary.fields);
                print_message(&format!("state in {}; go on with --resume and --start {next}", path.display()));
            }
            failure = failure.or(saved.err());
        }
        Ok(report(&summary, failure, context))
    }
}
