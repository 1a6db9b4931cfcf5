//! What the particle tracker follows, how, and what it writes.

use crate::error::{Error, Result};
use crate::io::read_mot;
use crate::parallel::Threads;
use crate::pipeline::{Numbering, TargetStart};
use crate::track::particle::{ParticleMode, ParticleOptions};
use crate::types::TargetBox;
use clap::Args;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Options of the particle tracker. Those that are not given keep the tracker's own default.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "With --method particle")]
pub struct ParticleTrackerArguments {
    /// Where targets start: lines of the MOT challenge, frame,id,left,top,width,height,... counted from 1;
    /// each id starts at its first line
    #[arg(long = "boxes", value_name = "FILE")]
    pub box_file: Option<PathBuf>,
    /// Particles of a target; twice as many while another target is near [default: 1000]
    #[arg(long, value_name = "N")]
    pub n_particles: Option<usize>,
    /// Write boxes in the form of the MOT challenge: a .txt file, or any other name
    #[arg(long, value_name = "FILE")]
    pub mot: Option<PathBuf>,
    /// Write everything as a table: a .csv file, or any other name
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Draw the foreground map of every frame, white where it is not background: a folder for
    /// foreground_000000.png, ..., or a sequence *.y4m
    #[arg(long, value_name = "FOLDER|Y4M")]
    pub foreground: Option<PathBuf>,
}

impl ParticleTrackerArguments {
    /// Whether any was given.
    pub fn given(&self) -> Option<&'static str> {
        // Every field is named, so that a new option cannot be left out.
        let Self { box_file, n_particles, mot, csv, foreground } = self;
        [
            box_file.as_ref().map(|_| "boxes"),
            n_particles.map(|_| "n_particles"),
            mot.as_ref().map(|_| "mot"),
            csv.as_ref().map(|_| "csv"),
            foreground.as_ref().map(|_| "foreground"),
        ]
        .into_iter()
        .find_map(|given| given)
    }

    /// The options of the particle tracker.
    pub fn options(&self, mode: ParticleMode, random_state: Option<u64>, threads: Threads) -> Result<ParticleOptions> {
        let mut options = ParticleOptions { mode, threads, ..ParticleOptions::default() };
        if let Some(particles) = self.n_particles {
            options.n_particles = particles;
            options.n_near = particles.saturating_mul(2);
        }
        options.random_state = random_state.unwrap_or(options.random_state);
        options.check().map_err(|error| match error {
            Error::Argument { argument: "n_near", expected, got } => {
                Error::Argument { argument: "n_particles", expected, got }
            }
            other => other,
        })?;
        Ok(options)
    }

    /// Where targets start: `given` boxes in the first frame, numbered from 1, or those of the file.
    /// `frames`: how many come, if that is known.
    pub fn starts(&self, given: &[TargetBox], numbering: Numbering, frames: Option<usize>) -> Result<Vec<TargetStart>> {
        match (&self.box_file, given) {
            (None, []) => Err(Error::argument("bbox", "a --bbox for each target, or --boxes FILE", "none")),
            (None, given) => {
                let start =
                    |(id, bounds): (u64, &TargetBox)| TargetStart { frame: numbering.start, id, bounds: *bounds };
                Ok((1..).zip(given).map(start).collect())
            }
            (Some(path), []) => starts_in(path, numbering, frames),
            (Some(path), _) => {
                let got = format!("{} beside --bbox", path.display());
                Err(Error::argument("boxes", "either --bbox or --boxes, since both number the targets", got))
            }
        }
    }
}

/// Every target of a file at its first line in a frame that is read.
fn starts_in(path: &Path, numbering: Numbering, frames: Option<usize>) -> Result<Vec<TargetStart>> {
    let is_read = |frame: usize| {
        let after = frame.checked_sub(numbering.start).filter(|after| after.is_multiple_of(numbering.step));
        after.is_some_and(|after| frames.is_none_or(|frames| after / numbering.step < frames))
    };
    let mut starts = BTreeMap::<u64, TargetStart>::new();
    for line in read_mot(path)? {
        let id = u64::try_from(line.target).map_err(|_| {
            Error::format(path, format!("expected a target's number of at least 0, got {}", line.target))
        })?;
        let start = TargetStart { frame: line.frame, id, bounds: line.bounds };
        if is_read(line.frame) {
            let earliest = starts.entry(id).or_insert(start);
            if line.frame < earliest.frame {
                *earliest = start;
            }
        }
    }
    if starts.is_empty() {
        let expected = "a box in at least one frame that is read";
        return Err(Error::argument("boxes", expected, format!("none in {}", path.display())));
    }
    Ok(starts.into_values().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments(box_file: Option<PathBuf>) -> ParticleTrackerArguments {
        ParticleTrackerArguments { box_file, n_particles: None, mot: None, csv: None, foreground: None }
    }

    #[test]
    fn targets_start_at_their_first_line_that_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("first.csv");
        std::fs::write(&path, "3,7,1,1,5,6,1\n2,7,2.5,1,5,6,1\n6,4,9,9,5,6,1\n1,9,8,8,5,6\n").unwrap();
        let from_file = arguments(Some(path.clone()));
        let starts = |numbering, limit| {
            let starts = from_file.starts(&[], numbering, limit)?;
            Ok::<_, Error>(starts.iter().map(|start| (start.id, start.frame, start.bounds.x)).collect::<Vec<_>>())
        };
        let all = Numbering::default();
        // Pixel 1 of the file is pixel 0 here and reaches from -1/2.
        assert_eq!(starts(all, None).unwrap(), [(4, 5, 7.5), (7, 1, 1.0), (9, 0, 6.5)]);
        let every_second = Numbering { step: 2, ..Numbering::default() };
        assert_eq!(starts(every_second, None).unwrap(), [(7, 2, -0.5), (9, 0, 6.5)]);
        assert_eq!(starts(all, Some(1)).unwrap(), [(9, 0, 6.5)]);
        let late = starts(Numbering { start: 6, ..Numbering::default() }, None).unwrap_err().to_string();
        assert!(late.starts_with("boxes: expected"), "{late}");
        std::fs::write(&path, "1,-1,1,1,5,6,1\n").unwrap();
        assert!(starts(all, None).unwrap_err().to_string().contains("number of at least 0"));
    }
}
