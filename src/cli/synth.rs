//! `jacoflow synth`: recordings of scenes with known motion.

use super::arguments::{ComputeArguments, MessageArguments, parse_not_negative, parse_rate, parse_size};
use super::interrupt::Watch;
use super::open::compute;
use super::paths::CommandPaths;
use super::progress::Bar;
use super::report::{Report, print_message};
use super::scene_list;
use super::target_recording::{TargetRecording, check_folder};
use crate::error::{Error, Result};
use crate::io::{FieldFormat, NumberedFiles, check_sink, open_sink};
use crate::parallel::{Progress, Threads};
use crate::pipeline::{check_target, is_folder};
use crate::synth::targets::{SCENES, TargetSceneOptions};
use crate::synth::{Rounding, Scene, SceneOptions, Sensor, build, check_time, truth};
use crate::types::{AnyFrame, Frame};
use clap::{Args, ValueEnum};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Frames of a scene without targets, unless another number is given.
const USUAL_FRAMES: usize = 10;

/// Options of `synth`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "Frames are written as a folder of PNG files (OUT without an extension), a .npy stack or a .y4m file.\n\
    Truth is the velocity and its Jacobian at the time of each frame.\n\n\
    Examples:\n  \
    jacoflow synth --list\n  \
    jacoflow synth ramp -o ramp --frames 400 --rounding floor --truth ramp_truth\n  \
    jacoflow synth disc -o disc.y4m --set rpm=45 --set fps=100 --rate 100 --noise 2\n  \
    jacoflow synth people_handheld -o people --boxes people.txt --random-state 10"
)]
pub struct SynthCommand {
    /// Name of the scene (see --list)
    #[arg(value_name = "SCENE", required_unless_present = "list")]
    pub scene: Option<String>,
    /// List the scenes, what they can carry and what they can be given
    #[arg(long)]
    pub list: bool,
    /// A folder (with / at the end where a new one has a dot in its name), a .npy or a .y4m file, or - for
    /// Y4M on standard output
    #[arg(long, short, value_name = "OUT", required_unless_present = "list")]
    pub output: Option<PathBuf>,
    /// Number of frames [default: 10; of a scene of targets all]
    #[arg(long, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub frames: Option<usize>,
    /// Size of a frame in pixels; that of a scene of targets follows from --scale
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "256x256", value_parser = parse_size)]
    pub size: (usize, usize),
    /// Scene coordinates of the upper left pixel
    #[arg(long, value_name = "X,Y", default_value = "0,0", value_parser = parse_point, allow_hyphen_values = true)]
    pub origin: (f64, f64),
    /// What the motion carries (see --list)
    #[arg(long, value_name = "NAME")]
    pub carrier: Option<String>,
    /// A parameter of the scene or its carrier; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = parse_setting)]
    pub settings: Vec<(String, f64)>,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub random_state: u64,
    /// Standard deviation of added white noise, 8-bit grey levels [default: 0; of a scene of targets 2.5]
    #[arg(long, value_name = "LEVELS", value_parser = parse_not_negative)]
    pub noise: Option<f64>,
    /// Scene of targets: what its lengths are multiplied by; at 1 a frame has 720 x 480 pixels [default: 0.5]
    #[arg(long, value_name = "FACTOR", value_parser = parse_not_negative)]
    pub scale: Option<f64>,
    /// Scene of targets: write the true boxes into this file, as MOT challenge text
    #[arg(long, value_name = "FILE")]
    pub boxes: Option<PathBuf>,
    /// Samples of the frames
    #[arg(long, value_enum, value_name = "TYPE", default_value = "8")]
    pub depth: Depth,
    /// How brightness becomes whole levels
    #[arg(long, value_enum, value_name = "HOW", default_value = "nearest")]
    pub rounding: RoundingWord,
    /// Frames per second noted in a .y4m file
    #[arg(long, value_name = "RATE", default_value = "25", value_parser = parse_rate)]
    pub rate: f64,
    /// Write the true flow and Jacobian of each frame into this folder
    #[arg(long, value_name = "FOLDER")]
    pub truth: Option<PathBuf>,
    /// Formats of the truth: npz (flow and Jacobian), flo, kitti, pfm
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', default_value = "npz", requires = "truth")]
    pub truth_format: Vec<String>,
    /// Replace files that exist
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
}

/// Samples of the frames written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Depth {
    /// 8-bit, 0 to 255
    #[value(name = "8")]
    Eight,
    /// 16-bit: 257 times the 8-bit scale, rounded
    #[value(name = "16")]
    Sixteen,
    /// Double precision on the 8-bit scale, neither rounded nor clipped (.npy only)
    Float,
}

/// How brightness becomes whole levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RoundingWord {
    /// To the nearest level
    Nearest,
    /// To the level below, as the patent's quantiser
    Floor,
}

impl SynthCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        if self.list {
            return scene_list::show(self.messages.json);
        }
        let (Some(name), Some(output)) = (&self.scene, &self.output) else {
            return Err(Error::argument("scene", "the name of a scene and --output", "neither"));
        };
        if SCENES.iter().any(|kind| kind.name == name) {
            return self.record_targets(name, output, watch);
        }
        Self::refuse(name, "a scene of targets", &[("scale", self.scale.is_some()), ("boxes", self.boxes.is_some())])?;
        let (width, height) = self.size;
        let scene = build(
            name,
            &SceneOptions {
                width,
                height,
                origin: self.origin,
                random_state: self.random_state,
                carrier: self.carrier.clone(),
                values: self.settings.clone(),
            },
        )?;
        check_time(&*scene, "frames", (self.count() - 1) as f64)?;
        let formats = self.truth_formats()?;
        let (threads, _) = compute(&self.compute)?;
        let truth_files: Vec<NumberedFiles> = formats.iter().filter_map(|format| self.truth_files(*format)).collect();
        let paths = CommandPaths::default().writing_pictures("output", Some(output), "frame");
        let paths = match &self.truth {
            Some(folder) => paths.writing_files("truth", folder, [], truth_files),
            None => paths,
        };
        let _new_folders = paths.check(self.force)?;
        self.check_output(output)?;
        let bar = Bar::new(watch, "synth", self.messages.quiet);
        let written = self.write(&*scene, output, &formats, threads, &bar);
        drop(bar);
        let is_reported = matches!(written.1, Ok(()) | Err(Error::Interrupted)) || written.0 > 0;
        if is_reported && !self.messages.quiet {
            print_message(&format!("{} of {} frames written to {}", written.0, self.count(), output.display()));
        }
        let summary = json!({
            "command": "synth", "scene": name, "output": output, "frames": written.0, "width": width, "height": height,
            "truth": self.truth, "random_state": self.random_state, "interrupted": matches!(written.1, Err(Error::Interrupted)),
        });
        Ok(Report { summary, failure: written.1.err() })
    }

    /// Number of frames of a scene without targets.
    fn count(&self) -> usize {
        self.frames.unwrap_or(USUAL_FRAMES)
    }

    /// Records a scene of targets.
    fn record_targets(&self, scene: &str, output: &Path, watch: &Watch) -> Result<Report> {
        let others = [
            ("carrier", self.carrier.is_some()),
            ("set", !self.settings.is_empty()),
            ("truth", self.truth.is_some()),
            ("depth", self.depth != Depth::Eight),
        ];
        Self::refuse(scene, "a scene without targets", &others)?;
        let usual = TargetSceneOptions::default();
        let recording = TargetRecording {
            scene,
            options: TargetSceneOptions {
                random_state: self.random_state,
                scale: self.scale.unwrap_or(usual.scale),
                noise: self.noise.unwrap_or(usual.noise),
                frames: self.frames,
                ..usual
            },
            output,
            boxes: self.boxes.as_deref(),
            rate: self.rate,
            force: self.force,
            quiet: self.messages.quiet,
        };
        let (threads, _) = compute(&self.compute)?;
        recording.make(threads, watch)
    }

    /// Refuses options that go with another kind of scene.
    fn refuse(scene: &str, wanted: &str, given: &[(&'static str, bool)]) -> Result<()> {
        match given.iter().find(|(_, given)| *given) {
            Some(&(option, _)) => Err(Error::argument(option, wanted, scene)),
            None => Ok(()),
        }
    }

    /// Writes the frames and their truth; how many frames are in place, and what stopped it.
    fn write(
        &self,
        scene: &dyn Scene,
        output: &Path,
        formats: &[FieldFormat],
        threads: Threads,
        bar: &Bar<'_>,
    ) -> (usize, Result<()>) {
        let (mut done, mut truths) = (0, 0);
        let result = (|| {
            let mut recording = open_sink(&output.to_string_lossy(), self.rate)?;
            if let Some(folder) = &self.truth {
                std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
            }
            for index in 0..self.count() {
                bar.step(index, self.count())?;
                let frame = threads.install(|| scene.frame(index as f64));
                recording.write(&self.sample(&frame, index as u64))?;
                if self.truth.is_some() {
                    let field = threads.install(|| truth(scene, index as f64))?;
                    for format in formats {
                        if let Some(files) = self.truth_files(*format) {
                            format.write(files.path(index), &field, "")?;
                            truths = index + 1;
                        }
                    }
                }
                done = index + 1;
            }
            recording.finish()?;
            let mut truth_files = formats.iter().filter_map(|format| self.truth_files(*format));
            truth_files.try_for_each(|files| files.clear_except(|index| index < done))
        })();
        if result.is_ok() {
            return (done, result);
        }
        // Frames appear all or none, and so does their truth.
        for files in formats.iter().filter_map(|format| self.truth_files(*format)) {
            let _beside_the_first_error = files.clear_except(|index| index >= truths);
        }
        (0, result)
    }

    /// The frame as the camera delivers it.
    fn sample(&self, frame: &Frame<f64>, index: u64) -> AnyFrame {
        let rounding = match self.rounding {
            RoundingWord::Nearest => Rounding::Nearest,
            RoundingWord::Floor => Rounding::Floor,
        };
        let sensor = Sensor {
            noise: self.noise.unwrap_or(0.0),
            rounding: Rounding::None,
            saturate: false,
            random_state: self.random_state,
        };
        match self.depth {
            Depth::Eight => AnyFrame::U8(Sensor { rounding, saturate: true, ..sensor }.apply_u8(frame, index)),
            Depth::Float => AnyFrame::F64(sensor.apply(frame, index)),
            Depth::Sixteen => {
                let whole = |level: f64| if rounding == Rounding::Floor { level.floor() } else { level.round() };
                let to_level = |value: &f64| whole(value * 257.0).clamp(0.0, 65535.0) as u16;
                AnyFrame::U16(sensor.apply(frame, index).map(to_level))
            }
        }
    }

    /// The files of the truth in one format.
    fn truth_files(&self, format: FieldFormat) -> Option<NumberedFiles> {
        self.truth.as_ref().map(|folder| NumberedFiles::without_stem(folder, format!(".{}", format.extension())))
    }

    fn truth_formats(&self) -> Result<Vec<FieldFormat>> {
        self.truth_format.iter().map(|name| FieldFormat::parse(name)).collect()
    }

    /// Refuses what could only fail after work has been done.
    fn check_output(&self, output: &Path) -> Result<()> {
        check_sink(&output.to_string_lossy())?;
        if self.depth == Depth::Float && (is_folder(output) || output.extension().is_none_or(|e| e != "npy")) {
            return Err(Error::argument("output", "a .npy file for --depth float", output.display()));
        }
        if !is_folder(output) {
            check_target(output, self.force)?;
        }
        for (option, folder) in
            [("output", Some(output).filter(|path| is_folder(path))), ("truth", self.truth.as_deref())]
        {
            folder.map_or(Ok(()), |folder| check_folder(option, folder, self.force))?;
        }
        Ok(())
    }
}

fn parse_point(text: &str) -> std::result::Result<(f64, f64), String> {
    let number = |word: &str| word.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let (x, y) = text.split_once(',').ok_or("expected X,Y")?;
    number(x).zip(number(y)).ok_or_else(|| "expected two numbers X,Y".into())
}

fn parse_setting(text: &str) -> std::result::Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    let value = value.trim().parse::<f64>().map_err(|_| "expected a number behind the =".to_string())?;
    Ok((name.trim().to_string(), value))
}
