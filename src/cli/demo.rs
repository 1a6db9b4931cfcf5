//! `jacoflow demo`: the main job on an embedded scene, with the error against its exact truth.

use super::arguments::{ComputeArguments, TellArguments};
use super::interrupt::Watch;
use super::open::compute;
use super::report::{Report, print};
use super::run::{Telling, report, run_pipeline};
use crate::error::{Error, Result};
use crate::flow::windowed::WindowedOptions;
use crate::flow::{Common, Estimator, Method};
use crate::io::{FieldFormat, MemorySource, open_sink};
use crate::parallel::Threads;
use crate::pipeline::PictureRanges;
use crate::pipeline::{Collect, EstimatorStage, Numbering, OutputPlan, OutputWish, Pipeline};
use crate::synth::{Scene, SceneOptions, Sensor, build, truth};
use crate::types::{AnyFrame, FlowField};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::sync::PoisonError;

/// Frames of the scene.
const FRAMES: usize = 6;
/// Frames per second that the scene is said to be filmed at.
const RATE: f64 = 25.0;

/// Options of `demo`.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes the frames of a vortex (8 bits, noise of 1 grey level) to OUT/frames, estimates flow and Jacobian, writes them with pictures to\n\
    OUT/flow and prints the error against the exact truth.\n\n\
    Example:\n  jacoflow demo -o demo"
)]
pub struct DemoCommand {
    /// A new folder
    #[arg(long, short, value_name = "FOLDER", default_value = "jacoflow-demo")]
    pub output: PathBuf,
    /// Write into a folder that exists
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub tell: TellArguments,
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
        if self.output.extension().is_some() {
            return Err(Error::argument("output", "a folder", self.output.display()));
        }
        let scene = build("vortex", &SceneOptions { width: 256, height: 192, seed: 1, ..SceneOptions::default() })?;
        let plan = OutputPlan::decide(&OutputWish {
            path: Some(&self.output.join("flow")),
            formats: &[],
            pictures: &["colour", "quiver", "divergence", "curl"].map(String::from),
            replace: self.force,
            fields: None,
        })?;
        let options = WindowedOptions::default();
        let common = Common { covariance: true, threads, simd, frame_period: Some(1.0 / RATE), ..Common::default() };
        let estimator = Estimator::new(Method::Windowed(options), common)?;
        let frames = self.write_frames(&*scene, threads, watch)?;
        let kept = Collect::<f32>::default();
        let fields = kept.handle();
        let mut pipeline = Pipeline::<f32>::new(Box::new(EstimatorStage::new(estimator)))
            .with_threads(threads)
            .with_numbering(Numbering { rate: Some(RATE), ..Numbering::default() })
            .with_sink(Box::new(kept));
        for sink in
            plan.sinks(json!({"method": "windowed", "scene": "vortex"}).to_string(), PictureRanges::default())?
        {
            pipeline = pipeline.with_sink(sink);
        }
        let source = Box::new(MemorySource::new(frames)?.with_frame_rate(RATE));
        let mut telling = Telling { command: "demo", tell: &self.tell, output: Some(&self.output), details: json!({}) };
        let (summary, failure) = run_pipeline(&mut pipeline, source, &telling, watch);
        if failure.is_none() {
            let fields = fields.lock().unwrap_or_else(PoisonError::into_inner);
            let errors = compare(&*scene, &fields)?;
            telling.details = json!({
                "scene": "vortex", "flow_rms_error": errors.flow, "jacobian_rms_error": errors.jacobian,
            });
            if !self.tell.json {
                print(&self.words(&errors))?;
            }
        }
        Ok(report(&summary, failure, telling))
    }

    /// Makes the frames and keeps a copy on disk for the user's own trials.
    fn write_frames(&self, scene: &dyn Scene, threads: Threads, watch: &Watch) -> Result<Vec<AnyFrame>> {
        let folder = self.output.join("frames");
        let occupied = folder.read_dir().is_ok_and(|mut entries| entries.next().is_some());
        if occupied && !self.force {
            return Err(Error::argument("output", "a new folder (--force writes into it)", self.output.display()));
        }
        let mut sink = open_sink(&folder.to_string_lossy(), RATE)?;
        let sensor = Sensor::eight_bit(1.0, 7);
        let mut frames = Vec::with_capacity(FRAMES);
        for index in 0..FRAMES {
            watch.check()?;
            let exact = threads.install(|| scene.frame(index as f64));
            let frame = AnyFrame::U8(sensor.apply_u8(&exact, index as u64));
            sink.write(&frame)?;
            FieldFormat::Npz.write(
                self.output.join(format!("truth_{index:06}.npz")),
                &truth(scene, index as f64)?,
                "",
            )?;
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

/// Root mean square errors over every valid site of every field, 12 px from the edge.
fn compare(scene: &dyn Scene, fields: &[FlowField<f32>]) -> Result<Errors> {
    const MARGIN: usize = 12;
    let mut sum = Errors::default();
    for field in fields {
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
