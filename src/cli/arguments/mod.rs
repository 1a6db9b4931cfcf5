//! Argument groups that several subcommands share, and the words they are parsed from.

mod compute;
mod filter;
mod grid;
mod input;
mod method;
mod output;
mod particle_track;
mod stereo_track;
mod track;
mod views;

pub use compute::{ComputeArguments, MessageArguments, ThreadArguments};
pub use filter::{FilterArguments, describe_filter};
pub use grid::GridArguments;
pub use input::{InputArguments, PlaneArguments, SelectionArguments, UnitArguments};
pub use method::MethodArguments;
pub use output::OutputArguments;
pub use particle_track::ParticleTrackerArguments;
pub use stereo_track::StereoTrackerArguments;
pub use track::{TargetArguments, TrackerArguments};
pub use views::{LayoutArguments, SearchArguments};

/// `KxL` (or `K` for a square): width and height of a neighbourhood or a frame.
pub fn parse_size(text: &str) -> Result<(usize, usize), String> {
    let (width, height) = text.split_once(['x', 'X']).unwrap_or((text, text));
    match (width.trim().parse(), height.trim().parse()) {
        (Ok(w), Ok(h)) if w > 0 && h > 0 => Ok((w, h)),
        _ => Err("expected WIDTHxHEIGHT in pixels, such as 9x9".into()),
    }
}

/// Two positive numbers `A,B`, or one for both.
pub fn parse_pair(text: &str) -> Result<(f64, f64), String> {
    let (a, b) = text.split_once(',').unwrap_or((text, text));
    match (parse_positive(a), parse_positive(b)) {
        (Ok(a), Ok(b)) => Ok((a, b)),
        _ => Err("expected one or two positive numbers, such as 0.5 or 0.5,0.4".into()),
    }
}

/// Two whole numbers `A,B`, the lesser first.
pub fn parse_range(text: &str) -> Result<(i32, i32), String> {
    let ends = text.split_once(',').and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
    match ends {
        Some((least, greatest)) if least > greatest => Err(format!("expected the minimum first, {greatest},{least}")),
        Some(ends) => Ok(ends),
        None => Err("expected MIN,MAX, two whole numbers".into()),
    }
}

/// A positive finite number.
pub fn parse_positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a positive number".into()),
    }
}

/// A finite number of at least zero.
pub fn parse_not_negative(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("expected a number of at least 0".into()),
    }
}

/// A number or a fraction (`25`, `30000/1001`) of frames per second.
pub fn parse_rate(text: &str) -> Result<f64, String> {
    let rate = match text.split_once('/') {
        Some((above, below)) => parse_positive(above).and_then(|a| parse_positive(below).map(|b| a / b)),
        None => parse_positive(text),
    };
    rate.map_err(|_| "expected a positive number or a fraction such as 30000/1001".into())
}
