//! Which flow filter, and its constants.

use super::{UnitArguments, method::rectangle, method::word, parse_positive, parse_size};
use crate::error::Result;
use crate::temporal::{FilterForm, FlowFilterOptions, SquareRoot, Transition};
use clap::Args;
use serde_json::{Value, json};

/// Filter options. Those that are not given come from the profile.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Filter")]
pub struct FilterArguments {
    /// Set of constants: patent (embodiment 2 of WO2010/098160: quantised frames, smoothed by 3 px) or
    /// measured (9x9 pixels, raw 8-bit frames, unbiased divergence) [default: patent]
    #[arg(long, value_name = "NAME")]
    pub profile: Option<String>,
    /// Prediction: augmented (49 sigma points), non-augmented (25), fast (13: the numbers of the 25 with the
    /// motion first, for the profile measured) or extended
    #[arg(long, value_name = "NAME")]
    pub form: Option<String>,
    /// State transition: rk4 or exact
    #[arg(long, value_name = "NAME")]
    pub transition: Option<String>,
    /// Order of the square root that spreads the sigma points: brightness-first or motion-first [default:
    /// motion-first for the form fast, which knows no other, else brightness-first]
    #[arg(long, value_name = "NAME")]
    pub square_root: Option<String>,
    /// Pixels of one measurement
    #[arg(long, value_name = "KxL", visible_alias = "neighborhood", value_parser = parse_size)]
    pub neighbourhood: Option<(usize, usize)>,
    /// Q: variances a frame of (I, Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y)
    #[arg(long, value_name = "12 NUMBERS", value_parser = parse_twelve)]
    pub process_noise: Option<Twelve>,
    /// R: variance of one pixel, 8-bit grey levels squared
    #[arg(long, value_name = "VARIANCE", value_parser = parse_positive)]
    pub measurement_noise: Option<f64>,
    /// Mean before the first frame
    #[arg(long, value_name = "12 NUMBERS", value_parser = parse_twelve, allow_hyphen_values = true)]
    pub initial_mean: Option<Twelve>,
    /// P0: variances before the first frame
    #[arg(long, value_name = "12 NUMBERS", value_parser = parse_twelve)]
    pub initial_covariance: Option<Twelve>,
    /// Spread of the sigma points
    #[arg(long, value_name = "NUMBER", value_parser = parse_positive)]
    pub alpha: Option<f64>,
    /// Knowledge of the distribution
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    pub beta: Option<f64>,
    /// Second scale of the sigma points
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    pub kappa: Option<f64>,
    /// Sample value of 255 grey levels [default: 255 for 8-bit and floating-point frames, 65535 for 16-bit]
    #[arg(long, value_name = "VALUE", value_parser = parse_positive)]
    pub full_scale: Option<f64>,
    /// Leave the covariance out: faster, smaller files
    #[arg(long)]
    pub no_covariance: bool,
    #[command(flatten)]
    pub units: UnitArguments,
}

/// One number for each component of the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twelve(pub [f64; 12]);

fn parse_twelve(text: &str) -> std::result::Result<Twelve, String> {
    let numbers: Vec<f64> = text.split(',').map_while(|word| word.trim().parse().ok()).collect();
    match <[f64; 12]>::try_from(numbers) {
        Ok(twelve) if text.split(',').count() == 12 && twelve.iter().all(|value| value.is_finite()) => {
            Ok(Twelve(twelve))
        }
        _ => Err("expected twelve numbers, separated by commas".into()),
    }
}

impl FilterArguments {
    /// The constants for frames of samples of `dtype`.
    pub fn options(&self, dtype: &str) -> Result<FlowFilterOptions> {
        let mut options = FlowFilterOptions::profile(self.profile.as_deref().unwrap_or("patent"))?;
        if let Some(form) = &self.form {
            options.form = FilterForm::parse(&word(form))?;
        }
        if let Some(transition) = &self.transition {
            options.transition = Transition::parse(&word(transition))?;
        }
        options.square_root = self.square_root.as_deref().map(|name| SquareRoot::parse(&word(name))).transpose()?;
        options.neighbourhood = self.neighbourhood.map_or(options.neighbourhood, rectangle);
        options.process_noise = self.process_noise.map_or(options.process_noise, |q| q.0);
        options.measurement_noise = self.measurement_noise.unwrap_or(options.measurement_noise);
        options.initial_mean = self.initial_mean.map_or(options.initial_mean, |mean| mean.0);
        options.initial_covariance = self.initial_covariance.map_or(options.initial_covariance, |p| p.0);
        let points = &mut options.sigma_points;
        points.alpha = self.alpha.unwrap_or(points.alpha);
        points.beta = self.beta.unwrap_or(points.beta);
        points.kappa = self.kappa.unwrap_or(points.kappa);
        options.full_scale = self.full_scale.unwrap_or(if dtype == "uint16" { 65535.0 } else { 255.0 });
        options.covariance = !self.no_covariance;
        Ok(options)
    }

    /// The names of options that a resumed filter already has and that cannot be given again.
    pub fn given(&self) -> Option<&'static str> {
        let given = [
            ("profile", self.profile.is_some()),
            ("form", self.form.is_some()),
            ("transition", self.transition.is_some()),
            ("square_root", self.square_root.is_some()),
            ("neighbourhood", self.neighbourhood.is_some()),
            ("process_noise", self.process_noise.is_some()),
            ("measurement_noise", self.measurement_noise.is_some()),
            ("initial_mean", self.initial_mean.is_some()),
            ("initial_covariance", self.initial_covariance.is_some()),
            ("alpha", self.alpha.is_some()),
            ("beta", self.beta.is_some()),
            ("kappa", self.kappa.is_some()),
            ("full_scale", self.full_scale.is_some()),
            ("no_covariance", self.no_covariance),
            ("pixel_pitch", self.units.pixel_pitch.is_some()),
            ("length_unit", self.units.length_unit.is_some()),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(name, _)| name)
    }
}

/// How fields are made, for the metadata of files.
pub fn describe_filter(options: &FlowFilterOptions) -> Value {
    json!({
        "method": "filter", "form": options.form.name(), "transition": options.transition.name(),
        "square_root": options.square_root.map(SquareRoot::name),
        "neighbourhood": format!("{:?}", options.neighbourhood), "process_noise": options.process_noise,
        "measurement_noise": options.measurement_noise, "initial_mean": options.initial_mean,
        "initial_covariance": options.initial_covariance, "full_scale": options.full_scale,
    })
}
