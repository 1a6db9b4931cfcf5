//! Recordings of scenes of targets, for `jacoflow synth`: colour frames and the true boxes.

use super::{interrupt::Watch, paths::CommandPaths, progress::Bar, report::Report, report::print_message};
use crate::error::{Error, Result};
use crate::io::{MotTable, check_sink, open_colour_sink, write::NewFolders};
use crate::parallel::{Progress, Threads};
use crate::pipeline::{check_target, is_folder};
use crate::synth::targets::{TargetScene, TargetSceneOptions};
use crate::types::{AnyColourFrame, TrackState};
use serde_json::json;
use std::path::Path;

/// What is recorded, and where it goes.
pub struct TargetRecording<'a> {
    /// Name of the scene.
    pub scene: &'a str,
    /// Its options.
    pub options: TargetSceneOptions,
    /// Where the frames go.
    pub output: &'a Path,
    /// Where the true boxes go, as text in the form of the MOT challenge.
    pub boxes: Option<&'a Path>,
    /// Frames per second noted in a .y4m file.
    pub rate: f64,
    /// Whether files that exist are replaced.
    pub force: bool,
    /// Whether progress and summary are suppressed.
    pub quiet: bool,
}

impl TargetRecording<'_> {
    /// Renders and writes the recording.
    pub fn make(&self, threads: Threads, watch: &Watch) -> Result<Report> {
        let _new_folders = self.check_output()?;
        let scene = threads.install(|| TargetScene::new(self.scene, self.options))?;
        let bar = Bar::new(watch, "synth", self.quiet);
        let mut done = 0;
        let result = self.write(&scene, threads, &bar, &mut done);
        drop(bar);
        // One file appears whole or not at all; of a folder what was complete stays.
        let written = if result.is_err() && !is_folder(self.output) { 0 } else { done };
        if !self.quiet && (written > 0 || matches!(result, Err(Error::Interrupted))) {
            print_message(&format!("{written} of {} frames written to {}", scene.frame_count(), self.output.display()));
        }
        let (width, height) = scene.size();
        let summary = json!({
            "command": "synth", "scene": self.scene, "output": self.output, "frames": written, "width": width, "height": height,
            "boxes": self.boxes, "targets": scene.target_count(), "random_state": self.options.random_state,
            "interrupted": matches!(result, Err(Error::Interrupted)),
        });
        Ok(Report { summary, failure: result.err() })
    }

    /// Writes frames and boxes; `done` counts the frames.
    fn write(&self, scene: &TargetScene, threads: Threads, bar: &Bar<'_>, done: &mut usize) -> Result<()> {
        let mut frames = open_colour_sink(&self.output.to_string_lossy(), self.rate)?;
        let mut boxes = self.boxes.map(MotTable::create).transpose()?;
        for index in 0..scene.frame_count() {
            bar.step(index, scene.frame_count())?;
            let frame = threads.install(|| scene.frame(index));
            frames.write(&AnyColourFrame::U8(frame))?;
            for target in 0..boxes.as_ref().map_or(0, |_| scene.target_count()) {
                let bounds = scene.target_box(index, target);
                if let Some(table) = &mut boxes {
                    table.write(target + 1, index, &TrackState::at(bounds.centre(), bounds))?;
                }
            }
            *done = index + 1;
        }
        boxes.map_or(Ok(()), MotTable::finish)?;
        frames.finish()
    }

    /// Refuses what could only fail after work has been done.
    fn check_output(&self) -> Result<NewFolders> {
        let new_folders = CommandPaths::default()
            .writing_pictures("output", Some(self.output), "frame")
            .writing("boxes", self.boxes)
            .check(self.force)?;
        check_sink(&self.output.to_string_lossy())?;
        if let Some(boxes) = self.boxes {
            check_target(boxes, self.force).map_err(|error| error.about("boxes"))?;
        }
        if is_folder(self.output) {
            check_folder("output", self.output, self.force)?;
        } else {
            check_target(self.output, self.force)?;
        }
        Ok(new_folders)
    }
}

/// Refuses a folder that is not empty, unless forced.
pub fn check_folder(option: &'static str, folder: &Path, force: bool) -> Result<()> {
    let occupied = folder.read_dir().is_ok_and(|mut entries| entries.next().is_some());
    if occupied && !force {
        let wanted = "an empty or new folder (--force writes into it)";
        return Err(Error::argument(option, wanted, folder.display()));
    }
    Ok(())
}
