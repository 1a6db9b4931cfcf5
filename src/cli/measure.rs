//! `jacoflow measure`: derived quantities of a region or of points, as rows with standard deviations.

use super::arguments::{ComputeArguments, InputArguments, MethodArguments, SiteArguments, TellArguments};
use super::flow::prepare;
use super::interrupt::Watch;
use super::open::{Opened, compute, in_double, open_input, preprocess_for};
use super::report::Report;
use super::run::{Telling, input_details, report, run_pipeline, table_target};
use crate::error::{Error, Result};
use crate::flow::derived::Quantity;
use crate::flow::{Estimator, Method};
use crate::pipeline::{EstimatorStage, Measurements, Pipeline};
use crate::simd::SimdReal;
use clap::Args;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Options of `measure`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "Rows: frame, time_s, x, y, quantity, value, std, unit, valid_share. For a region (without --region: the whole frame) one affine motion is\n\
    fitted to its estimates; std knows of their errors, their overlap and their scatter. With --points every point has its rows.\n\
    Rates are per second where the frame rate is known (--fps, or the file), else per frame; rpm needs it.\n\n\
    Quantities: divergence, curl, shear_magnitude, shear_axis, strain_xx, strain_xy, strain_yy, angular_velocity, rpm,\n\
    rotation_centre_x, rotation_centre_y, centre_distance, time_to_contact, speed\n\n\
    Examples:\n  \
    jacoflow measure disc.y4m --quantity rpm,rotation_centre_x,rotation_centre_y --region 100,60,64,64 --fps 100\n  \
    jacoflow measure drive/ --quantity time_to_contact --region 500,150,200,120 --fps 10 -o ttc.csv"
)]
pub struct MeasureCommand {
    #[command(flatten)]
    pub input: InputArguments,
    /// Quantities to measure, separated by commas
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', required = true)]
    pub quantity: Vec<String>,
    #[command(flatten)]
    pub method: MethodArguments,
    #[command(flatten)]
    pub sites: SiteArguments,
    /// A .csv file [default: standard output]
    #[arg(long, short, value_name = "FILE", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Replace a file that exists
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub tell: TellArguments,
}

impl MeasureCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let quantities: Vec<Quantity> =
            self.quantity.iter().map(|name| Quantity::parse(&name.replace('-', "_"))).collect::<Result<_>>()?;
        let target = table_target(self.output.as_deref(), self.force, self.tell.json)?;
        let opened = open_input(&self.input)?;
        if let Some(quantity) = quantities.iter().find(|q| q.needs_fps() && opened.numbering.rate.is_none()) {
            let expected = format!("frames per second, for {}", quantity.name());
            return Err(Error::argument("fps", expected, "none, and the input does not say"));
        }
        if self.method.no_covariance {
            return Err(Error::argument("no_covariance", "a covariance, for the standard deviations", "none"));
        }
        let prepared = prepare(&opened, &self.input, &self.method, &self.sites, &self.compute)?;
        let method = prepared.estimator.method();
        if matches!(method, Method::HornSchunck(_)) {
            return Err(Error::argument("method", "one with a covariance", method.name()));
        }
        let sink = Measurements::open(&target, quantities)?;
        if in_double(self.compute.precision, &opened.first, false) {
            self.run::<f64>(opened, prepared.estimator, sink, watch)
        } else {
            self.run::<f32>(opened, prepared.estimator, sink, watch)
        }
    }

    fn run<T: SimdReal>(
        &self,
        opened: Opened,
        estimator: Estimator,
        sink: Measurements,
        watch: &Watch,
    ) -> Result<Report> {
        let mut details = input_details(&opened, &self.sites);
        if let Value::Object(details) = &mut details {
            details.insert("quantities".into(), json!(self.quantity));
            details.insert("method".into(), estimator.method().name().into());
        }
        let steps = preprocess_for(&estimator, &self.input)?;
        let stage = EstimatorStage::recursive(estimator, self.method.recursive()?)?;
        let mut pipeline = Pipeline::<T>::new(Box::new(stage))
            .with_preprocess(steps)
            .with_threads(compute(&self.compute)?.0)
            .with_numbering(opened.numbering)
            .with_sink(Box::new(sink));
        let telling = Telling { command: "measure", tell: &self.tell, output: self.output.as_deref(), details };
        let (summary, failure) = run_pipeline(&mut pipeline, opened.source, &telling, watch);
        Ok(report(&summary, failure, telling))
    }
}
