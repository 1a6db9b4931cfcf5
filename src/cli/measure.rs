//! `jacoflow measure`: motion and derived quantities of a region or of points, with standard deviations.

use super::arguments::{ComputeArguments, GridArguments, InputArguments, MessageArguments, MethodArguments};
use super::flow::{Prepared, prepare_with_covariance};
use super::interrupt::Watch;
use super::open::open_for_method;
use super::paths::CommandPaths;
use super::report::Report;
use super::run::{ReportContext, input_details, run_flow, table_target};
use crate::error::{Error, Result};
use crate::flow::derived::Measured;
use crate::pipeline::{MeasuredRegion, Measurements};
use crate::types::Region;
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

/// Options of `measure`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "Rows: frame, time_s, x, y, quantity, value, std, unit, share, valid_share, status. For a region (default: the whole frame) one affine\n\
    motion is fitted to the valid estimates that follow it, a share of them; the status is no_dominant_motion and the value NaN where\n\
    that is half of them or less, or less than the frames contradict. std knows of their errors, their overlap and their scatter.\n\
    With --points every point has its rows.\n\
    Rates are per second where the frame rate is known (--fps, or the file), else per frame; rpm needs it.\n\n\
    Quantities: u, v, u_x, v_x, u_y, v_y, divergence, curl, shear_magnitude, shear_axis, strain_xx, strain_xy, strain_yy, angular_velocity, rpm,\n\
    rotation_centre_x, rotation_centre_y, centre_distance, time_to_contact, speed (u and v of a region: at its centre, or --at)\n\n\
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
    pub grid: GridArguments,
    /// Only a disc, px
    #[arg(long, value_name = "X,Y,RADIUS", help_heading = "Where", allow_hyphen_values = true, value_parser = parse_disc, conflicts_with_all = ["points", "polygon"])]
    pub disc: Option<Region>,
    /// Only a polygon of three corners or more, px
    #[arg(long, value_name = "X,Y,X,Y,...", help_heading = "Where", allow_hyphen_values = true, value_parser = parse_polygon, conflicts_with = "points")]
    pub polygon: Option<Region>,
    /// The motion around this pixel [default: the motion that most of the region follows]
    #[arg(long, value_name = "X,Y", help_heading = "Where", value_parser = parse_pixel, conflicts_with = "points")]
    pub at: Option<(f64, f64)>,
    /// A .csv file [default: standard output]
    #[arg(long, short, value_name = "FILE", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Replace a file that exists
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
}

impl MeasureCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        let quantities: Vec<Measured> =
            self.quantity.iter().map(|name| Measured::parse(&name.replace('-', "_"))).collect::<Result<_>>()?;
        let files = self.grid.files().chain(self.method.initial.as_deref());
        let paths = CommandPaths::of_input(&self.input.input).reading(files);
        let _new_folders = paths.writing("output", self.output.as_deref()).check(self.force)?;
        let target = table_target(self.output.as_deref(), self.force, self.messages.json)?;
        let mut opened = open_for_method(&self.input, &self.method)?;
        if let Some(quantity) = quantities.iter().find(|q| q.needs_fps() && opened.numbering.rate.is_none()) {
            let expected = format!("frames per second, for {}", quantity.name());
            return Err(Error::argument("fps", expected, "none, and the input does not say"));
        }
        let Prepared { plan, is_double, .. } = prepare_with_covariance(
            &mut opened,
            &self.input,
            &self.method,
            &self.grid,
            &self.compute,
            "for the standard deviations",
        )?;
        let place = MeasuredRegion { region: self.disc.clone().or(self.polygon.clone()), at: self.at };
        if let Some(region) = &place.region {
            region.check(opened.first.size)?;
        }
        let sink = Measurements::open(&target, quantities, place)?;
        let mut details = input_details(&opened, &self.grid);
        details["quantities"] = json!(self.quantity);
        details["method"] = plan.estimator().method().name().into();
        let context =
            ReportContext { command: "measure", messages: &self.messages, output: self.output.as_deref(), details };
        if is_double {
            run_flow::<f64>(opened, plan, vec![Box::new(sink)], context, watch)
        } else {
            run_flow::<f32>(opened, plan, vec![Box::new(sink)], context, watch)
        }
    }
}

/// Numbers separated by commas.
fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split(',').map(|word| word.trim().parse().ok().filter(|value: &f64| value.is_finite())).collect()
}

fn parse_disc(text: &str) -> std::result::Result<Region, String> {
    match numbers(text).as_deref() {
        Some(&[x, y, radius]) if radius > 0.0 => Ok(Region::Disc { centre: (x, y), radius }),
        _ => Err("expected X,Y,RADIUS in pixels with a positive radius".into()),
    }
}

fn parse_polygon(text: &str) -> std::result::Result<Region, String> {
    let corners = numbers(text).filter(|values| values.len() >= 6 && values.len() % 2 == 0);
    let corners = corners.ok_or("expected three corners X,Y,X,Y,X,Y or more, in pixels")?;
    Ok(Region::Polygon(corners.as_chunks::<2>().0.iter().map(|&[x, y]| (x, y)).collect()))
}

fn parse_pixel(text: &str) -> std::result::Result<(f64, f64), String> {
    match numbers(text).as_deref() {
        Some(&[x, y]) => Ok((x, y)),
        _ => Err("expected X,Y in pixels".into()),
    }
}
