//! `jacoflow flow`: a field for every two or three frames.

use super::arguments::{
    ComputeArguments, InputArguments, MethodArguments, OutputArguments, SiteArguments, TellArguments,
};
use super::interrupt::Watch;
use super::open::{Opened, compute, in_double, open_input, preprocess_for, read_mask};
use super::report::Report;
use super::run::{Telling, input_details, report, run_pipeline};
use crate::error::{Error, Result};
use crate::flow::{Estimator, EstimatorOptions, Method};
use crate::io::Element;
use crate::pipeline::{EstimatorStage, OutputPlan, OutputWish, Pipeline, TableTarget};
use crate::simd::SimdReal;
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
    jacoflow flow a.png b.png c.png -o flow.npz --window 3 --rows all\n  \
    jacoflow flow film.mp4 --points 120,80 --points 200,90 > points.csv\n  \
    ffmpeg -i film.mp4 -f yuv4mpegpipe - | jacoflow flow - -o out/ --stride 4 --json"
)]
pub struct FlowCommand {
    #[command(flatten)]
    pub input: InputArguments,
    #[command(flatten)]
    pub method: MethodArguments,
    #[command(flatten)]
    pub sites: SiteArguments,
    #[command(flatten)]
    pub output: OutputArguments,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub tell: TellArguments,
}

/// An estimator for an opened input, with what it was made from.
pub struct Prepared {
    /// The estimator.
    pub estimator: Estimator,
    /// Where it estimates.
    pub sites: SamplingGrid,
    /// How fields are made, for metadata and summary.
    pub description: Value,
}

/// Builds the estimator that the arguments ask for.
pub fn prepare(
    opened: &Opened,
    input: &InputArguments,
    method: &MethodArguments,
    sites: &SiteArguments,
    compute_arguments: &ComputeArguments,
) -> Result<Prepared> {
    let chosen = method.method(opened.frames, input.smooth)?;
    let places = sites.sites()?;
    places.shape(opened.first.size)?;
    let (threads, simd) = compute(compute_arguments)?;
    let common = EstimatorOptions {
        sites: places.clone(),
        mask: read_mask(sites.mask.as_deref(), opened.first.size)?,
        pixel_pitch: method.pixel_pitch.unwrap_or((1.0, 1.0)),
        frame_period: opened.numbering.period(),
        covariance: !method.no_covariance && !matches!(chosen, Method::HornSchunck(_)),
        systematic: method.recursive()?.is_some(),
        diagnostics: false,
        noise: method.noise,
        threads,
        simd,
    };
    let mut description = method.describe(&chosen);
    if let Value::Object(object) = &mut description {
        object.insert("quantise".into(), json!(input.quantise));
        object.insert("smooth".into(), json!(input.smooth));
        object.insert("input".into(), json!(opened.name));
    }
    Ok(Prepared { estimator: Estimator::new(chosen, common)?, sites: places, description })
}

/// Where results go: the user's words, or CSV on standard output for points without any.
pub fn plan_output(
    output: &OutputArguments,
    sites: &SamplingGrid,
    json: bool,
    fields: Option<usize>,
) -> Result<OutputPlan> {
    let points = matches!(sites, SamplingGrid::Points(_));
    let standard_output = points && output.output.is_none() && !json;
    let path = if standard_output { Some(Path::new("-")) } else { output.output.as_deref() };
    let csv = vec!["csv".to_string()];
    let plan = OutputPlan::decide(&OutputWish {
        path,
        formats: if points && output.format.is_empty() { &csv } else { &output.format },
        pictures: &output.picture,
        replace: output.force,
        fields,
    })?;
    plan.check_sites(sites)?;
    if json && plan.table == Some(TableTarget::StandardOutput) {
        return Err(Error::argument("output", "a file or folder, as --json needs standard output", "-"));
    }
    Ok(plan)
}

/// Refuses to compute what nobody would see: without a place for results only the summary of `--json` is
/// left, or what `besides` is there for.
pub fn expect_output(plan: &OutputPlan, json: bool, besides: bool) -> Result<()> {
    if plan.writes_nothing() && !json && !besides {
        let wanted =
            "a folder or a file for the results (- for CSV on standard output), or --json for the summary alone";
        return Err(Error::argument("output", wanted, "none"));
    }
    Ok(())
}

impl FlowCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let opened = open_input(&self.input)?;
        let prepared = prepare(&opened, &self.input, &self.method, &self.sites, &self.compute)?;
        let needed = prepared.estimator.frames_needed();
        let fields = opened.frames.map(|frames| (frames + 1).saturating_sub(needed));
        let plan = plan_output(&self.output, &prepared.sites, self.tell.json, fields)?;
        expect_output(&plan, self.tell.json, false)?;
        plan.check_parameters(prepared.estimator.model().parameters().iter().map(|parameter| parameter.name))?;
        if in_double(self.compute.precision, &opened.first, false) {
            self.run::<f64>(opened, prepared, &plan, watch)
        } else {
            self.run::<f32>(opened, prepared, &plan, watch)
        }
    }

    fn run<T: SimdReal + Element>(
        &self,
        opened: Opened,
        prepared: Prepared,
        plan: &OutputPlan,
        watch: &Watch,
    ) -> Result<Report> {
        let mut details = input_details(&opened, &self.sites);
        if let Value::Object(details) = &mut details {
            details.insert("method".into(), prepared.description["method"].clone());
        }
        let steps = preprocess_for(&prepared.estimator, &self.input)?;
        let stage = EstimatorStage::recursive(prepared.estimator, self.method.recursive()?)?;
        let mut pipeline = Pipeline::<T>::new(Box::new(stage))
            .with_preprocess(steps)
            .with_threads(compute(&self.compute)?.0)
            .with_numbering(opened.numbering);
        for sink in plan.sinks(prepared.description.to_string(), self.output.ranges())? {
            pipeline = pipeline.with_sink(sink);
        }
        let telling = Telling { command: "flow", tell: &self.tell, output: self.output.output.as_deref(), details };
        let (summary, failure) = run_pipeline(&mut pipeline, opened.source, &telling, watch);
        Ok(report(&summary, failure, telling))
    }
}
