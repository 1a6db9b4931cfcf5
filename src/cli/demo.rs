//! `jacoflow demo`: the main job on an embedded scene, with the error against its exact truth.

use super::arguments::{ComputeArguments, MessageArguments};
use super::interrupt::{Watch, start_work};
use super::open::compute;
use super::report::{Report, print};
use super::run::{ReportContext, report, run_pipeline};
use crate::error::{Error, Result};
use crate::flow::windowed::WindowedOptions;
use crate::flow::{Estimator, EstimatorOptions, Method};
use crate::image::Preprocess;
use crate::io::{FieldFormat, MemorySource, open_sink};
use crate::parallel::Threads;
use crate::pipeline::{
    Collect, FieldSink, Numbering, OutputPlan, OutputWish, PictureKind, PictureRanges, Pipeline, is_folder,
};
use crate::synth::{Scene, SceneOptions, Sensor, build, truth};
use crate::temporal::{FlowStream, StreamPlan};
use crate::types::{AnyFrame, FlowField, Units};
use clap::Args;
use serde_json::json;
use std::fs::DirEntry;
use std::path::{Path, PathBuf};
use std::sync::PoisonError;

/// Frames of the scene.
const FRAMES: usize = 6;
/// Frames per second that the scene is taken at.
const RATE: f64 = 25.0;

/// Options of `demo`.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes the frames of a vortex (8 bits, noise of 1 grey level) to OUT/frames, estimates flow and Jacobian, writes them with pictures to\n\
    OUT/flow and prints the error against the exact truth.\n\n\
    Example:\n  jacoflow demo -o demo"
)]
pub struct DemoCommand {
    /// A new folder, or one that holds nothing but the results of an earlier demo, which are then replaced
    #[arg(long, short, value_name = "FOLDER", default_value = "jacoflow-demo")]
    pub output: PathBuf,
    /// Write into any folder that exists
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
}

/// Error of a field against the truth.
#[derive(Debug, Default)]
struct Errors {
    flow: f64,
    jacobian: f64,
    sites: usize,
}

impl DemoCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let (threads, simd) = compute(&self.compute)?;
        if !is_folder(&self.output) {
            let got = format!("{0}; for a new folder of this name write {0}/", self.output.display());
            return Err(Error::argument("output", "a folder", got));
        }
        let replace = self.force || is_own_work(&self.output);
        let scene =
            build("vortex", &SceneOptions { width: 256, height: 192, random_state: 1, ..SceneOptions::default() })?;
        let plan = OutputPlan::decide(&OutputWish {
            path: Some(&self.output.join("flow")),
            formats: &[],
            pictures: &PictureKind::ALL.map(|kind| kind.name().to_string()),
            replace,
            fields: None,
        })?;
        let options = WindowedOptions::default();
        let common = EstimatorOptions {
            covariance: true,
            threads,
            simd,
            units: Units::new((1.0, 1.0), None, Some(1.0 / RATE)),
            ..EstimatorOptions::default()
        };
        let estimator = Estimator::new(Method::Windowed(options), common)?;
        start_work();
        let frames = self.write_frames(&*scene, threads, replace, watch)?;
        let kept = Collect::<f32>::default();
        let fields = kept.handle();
        let description = json!({"method": "windowed", "scene": "vortex"});
        let stream = FlowStream::new(StreamPlan::new(estimator, Preprocess::default(), None)?)?;
        let mut pipeline = Pipeline::<f32>::new(Box::new(stream))
            .with_numbering(Numbering { rate: Some(RATE), ..Numbering::default() })
            .with_sinks([Box::new(kept) as Box<FieldSink<f32>>])
            .with_sinks(plan.sinks(description.to_string(), PictureRanges::default())?);
        let source = Box::new(MemorySource::new(frames)?.with_frame_rate(RATE));
        let mut context =
            ReportContext { command: "demo", messages: &self.messages, output: Some(&self.output), details: json!({}) };
        let (summary, failure) = run_pipeline(&mut pipeline, source, &context, watch);
        if failure.is_none() {
            let fields = fields.lock().unwrap_or_else(PoisonError::into_inner);
            let errors = threads.install(|| compare(&*scene, &fields))?;
            context.details = json!({
                "scene": "vortex", "flow_rms_error": errors.flow, "jacobian_rms_error": errors.jacobian,
            });
            if !self.messages.json {
                print(&self.words(&errors))?;
            }
        }
        Ok(report(&summary, failure, context))
    }

    /// Makes the frames and keeps a copy on disk for the user's own trials.
    fn write_frames(&self, scene: &dyn Scene, threads: Threads, replace: bool, watch: &Watch) -> Result<Vec<AnyFrame>> {
        let folder = self.output.join("frames");
        let occupied = self.output.read_dir().is_ok_and(|mut entries| entries.next().is_some());
        if occupied && !replace {
            let wanted = "a new folder, or one that holds nothing but an earlier demo (--force writes into any)";
            return Err(Error::argument("output", wanted, self.output.display()));
        }
        let mut sink = open_sink(&folder.to_string_lossy(), RATE)?;
        let sensor = Sensor::eight_bit(1.0, 7);
        let mut frames = Vec::with_capacity(FRAMES);
        for index in 0..FRAMES {
            watch.check()?;
            let time = index as f64;
            let (exact, motion) = threads.install(|| (scene.frame(time), truth(scene, time)));
            let frame = AnyFrame::U8(sensor.apply_u8(&exact, index as u64));
            sink.write(&frame)?;
            FieldFormat::Npz.write(self.output.join(truth_name(index)), &motion?, "")?;
            frames.push(frame);
        }
        sink.finish()?;
        Ok(frames)
    }

    fn words(&self, errors: &Errors) -> String {
        format!(
            "a vortex, {FRAMES} frames of 256 x 192, 8 bits, noise of 1 grey level, against its exact truth ({} sites):\n  \
             flow      rms error {:.4} px/frame\n  Jacobian  rms error {:.4} 1/frame\n\
             frames, truth and results with pictures: {}\n",
            errors.sites,
            errors.flow,
            errors.jacobian,
            self.output.display()
        )
    }
}

fn truth_name(index: usize) -> String {
    format!("truth_{index:06}.npz")
}

/// Whether a folder holds only what an earlier run of this command left: then the next may replace it.
fn is_own_work(folder: &Path) -> bool {
    let frames = |name: &str| (0..FRAMES).any(|k| name == format!("frame_{k:06}.png"));
    let results = |name: &str| {
        let pictures = |k: usize| PictureKind::ALL.map(|kind| format!("{k:06}_{}.png", kind.name()));
        (0..FRAMES).any(|k| name == format!("{k:06}.npz") || pictures(k).iter().any(|picture| name == picture))
    };
    let own = |name: &str| match name {
        "frames" => holds_only(&folder.join(name), frames),
        "flow" => holds_only(&folder.join(name), results),
        _ => (0..FRAMES).any(|k| name == truth_name(k)) && folder.join(name).is_file(),
    };
    // A folder of frames alone may be anybody's.
    folder.join(truth_name(0)).is_file() && holds_only(folder, own)
}

/// Whether `known` knows every name in a folder.
fn holds_only(folder: &Path, known: impl Fn(&str) -> bool) -> bool {
    let own = |entry: std::io::Result<DirEntry>| entry.is_ok_and(|e| e.file_name().to_str().is_some_and(&known));
    folder.read_dir().is_ok_and(|mut entries| entries.all(own))
}

/// Root mean square errors over every valid site of every field, 12 px from the edge.
fn compare(scene: &dyn Scene, fields: &[FlowField<f32>]) -> Result<Errors> {
    const MARGIN: usize = 12;
    let mut sum = Errors::default();
    for field in fields {
        let field = field.in_pixels_and_frames();
        let exact = truth(scene, field.layout.frame_index as f64)?;
        for site in 0..field.len() {
            let (x, y) = (site % field.width, site / field.width);
            let inside = x.min(field.width - 1 - x).min(y).min(field.height - 1 - y) >= MARGIN;
            if !(inside && field.status[site].is_valid() && exact.status[site].is_valid()) {
                continue;
            }
            let (got, want) = (field.affine(site).to_array(), exact.affine(site).to_array());
            let square = |k: usize| (f64::from(got[k]) - want[k]).powi(2);
            sum.flow += square(0) + square(1);
            sum.jacobian += (2..6).map(square).sum::<f64>() / 4.0;
            sum.sites += 1;
        }
    }
    let n = sum.sites.max(1) as f64;
    Ok(Errors { flow: (sum.flow / n).sqrt(), jacobian: (sum.jacobian / n).sqrt(), sites: sum.sites })
}
