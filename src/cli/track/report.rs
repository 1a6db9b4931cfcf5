//! How a run that followed given targets went.

use super::{TrackCommand, output::files_in_words};
use crate::cli::{report::Report, report::print_message};
use crate::error::Error;
use crate::pipeline::{TargetSummary, TrackSummary, is_folder};
use crate::types::TrackStatus;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

impl TrackCommand {
    /// The report of a run whose first sink is the overlay, if any; `details` extend the summary.
    pub(super) fn report(&self, summary: &TrackSummary, failure: Option<Error>, details: Value) -> Report {
        let interrupted = matches!(failure, Some(Error::Interrupted));
        let output = self.output.place(summary.latest.as_ref());
        // A sequence that was stopped has another name, too, or was not begun.
        let overlay = match &self.output.overlay {
            Some(sequence) if !is_folder(sequence) => summary.latest_of_sinks.first().and_then(Option::as_ref),
            folder => folder.as_ref(),
        };
        if !self.messages.quiet && (failure.is_none() || interrupted) {
            let place = output.or(overlay).or(summary.latest.as_ref());
            print_message(&in_words(summary, place.map(PathBuf::as_path)));
        }
        let mut object = json!({
            "command": "track", "frames": summary.frames, "targets": targets(summary), "files": summary.files,
            "seconds": summary.seconds, "output": output, "overlay": overlay, "interrupted": interrupted,
        });
        if let (Some(object), Value::Object(details)) = (object.as_object_mut(), details) {
            object.extend(details);
        }
        Report { summary: object, failure }
    }
}

/// The targets for the summary: how often each status was, and the last state.
fn targets(summary: &TrackSummary) -> Value {
    let one = |target: &TargetSummary| {
        let counts: serde_json::Map<String, Value> = TrackStatus::ALL
            .into_iter()
            .map(|status| (status.name().to_string(), json!(target.counts[status as usize])))
            .collect();
        let (last, bounds) = (&target.last, target.last.bounds);
        json!({
            "target": target.number, "frames": counts, "status": last.status.name(), "reason": last.reason,
            "position": last.position, "velocity": last.velocity, "visibility": last.visibility,
            "box": [bounds.x, bounds.y, bounds.width, bounds.height],
        })
    };
    summary.targets.iter().map(one).collect()
}

fn in_words(summary: &TrackSummary, output: Option<&Path>) -> String {
    let mut parts = vec![format!("{} frames", summary.frames)];
    for target in &summary.targets {
        let measured = target.counts[TrackStatus::Tracking as usize] + target.counts[TrackStatus::Occluded as usize];
        let share = 100.0 * measured as f64 / summary.frames.max(1) as f64;
        parts.push(format!("target {}: seen in {share:.1} %, at last {}", target.number, target.last.status.name()));
    }
    parts.push(format!("{:.2} s", summary.seconds));
    parts.extend(files_in_words(summary.files, output));
    parts.join(", ")
}
