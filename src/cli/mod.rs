//! The command line: the binary `jacoflow` and the Python entry point call the same [`run`].
//!
//! Exit codes: 0 success; 1 a run-time failure (files, formats, numbers); 2 an unusable argument; 3 a missing
//! program (`ffmpeg`); 130 stopped by Ctrl-C or a termination signal.
//!
//! Results go to files, or to standard output where the help says so; everything else (progress, summary,
//! errors) goes to standard error. With `--json`, standard output holds exactly one JSON object, in failure
//! too.

mod arguments;
mod command;
mod demo;
mod egomotion;
mod filter;
mod flow;
mod info;
mod interrupt;
mod measure;
mod open;
mod paths;
mod progress;
mod report;
mod run;
mod scene_list;
mod stereo;
mod synth;
mod target_recording;
mod track;

use clap::Parser;
use command::Command;
use std::ffi::OsString;

/// Optical flow together with its Jacobian and the uncertainty of both.
#[derive(Debug, Parser)]
#[command(name = "jacoflow", version, propagate_version = true, max_term_width = 110)]
#[command(
    after_help = "Exit codes: 0 success, 1 run-time failure, 2 unusable argument, 3 missing program, 130 interrupted.\n\
    Ctrl-C ends the run after the current frame, or at once while inputs are opened. A second Ctrl-C always ends it at once.\n\
    Environment: JACOFLOW_THREADS (number of threads), JACOFLOW_SIMD (scalar, avx2, avx512).\n\n\
    Examples:\n  \
    jacoflow demo -o demo\n  \
    jacoflow flow frames/ -o out/ --picture colour,divergence\n  \
    jacoflow measure disc.y4m --quantity rpm --region 80,40,64,64 --fps 100\n  \
    jacoflow track video.y4m --bbox 120,80,24,30 -o track.csv\n  \
    jacoflow stereo left/ right/ -o out/ --picture pictures/\n  \
    jacoflow egomotion drive/ --intrinsics 707.1,707.1,601.9,183.1 -o motion.csv"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Runs the command line `arguments` (the program's name first) and returns the exit code described at the
/// [module](self).
///
/// Prints to standard output and standard error. The first call installs a handler for Ctrl-C in the process.
pub fn run<I, S>(arguments: I) -> i32
where
    I: IntoIterator<Item = S>,
    S: Into<OsString> + Clone,
{
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(message) => {
            // Help and version are "errors" with code 0; a closed pipe must not turn them into a panic.
            let _ = message.print();
            return message.exit_code();
        }
    };
    let watch = interrupt::Watch::begin();
    let json = cli.command.json();
    let result = cli.command.execute(&watch);
    report::finish(result, json)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_of_every_subcommand_are_consistent() {
        Cli::command().debug_assert();
    }
}
