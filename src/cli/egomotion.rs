//! `jacoflow egomotion`: the camera's rigid motion from frame to frame.

use super::arguments::{
    ComputeArguments, GridArguments, InputArguments, MessageArguments, MethodArguments, parse_positive,
};
use super::flow::{Prepared, prepare_with_covariance};
use super::interrupt::Watch;
use super::open::{compute, open_for_method};
use super::paths::CommandPaths;
use super::report::Report;
use super::run::{ReportContext, input_details, run_flow, table_target};
use crate::error::{Error, Result};
use crate::motion3d::{self, FieldOptions, Intrinsics, MotionOptions};
use crate::pipeline::{Egomotion, EgomotionPlan, TableTarget};
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Options of `egomotion`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "Rows: frame, time_s, status, method, points, inliers, direction u (the scene's relative to the camera; the camera moves by -u) with its deviation in\n\
    degrees, rotation w and its deviations in rad/frame, focus of expansion in px with its deviations, and of all points together the rate nu u_z (1/frame) and the time to\n\
    contact (frames) with their deviations; the status of the scene around a --region, how many other motions explain the flow about as well (--alternatives writes them), and the\n\
    deviations of the Cramer-Rao bound of these points, estimated with the depths found (bound_..., nan where these are mostly noise). Points are taken twice as far apart as errors of the flow go together, in a small --region closer; the deviations heed what they share.\n\
    They come from the flow's own covariance: that of the baseline lucas-kanade holds for motions well below a pixel only, and says nothing of larger ones.\n\
    Rows of a run that is stopped (Ctrl-C) are kept in name.partial.csv.\n\
    status: ok, few_points, too_few_points, rotation_only, ambiguous (another motion explains the flow as well), ill_conditioned, low_snr.\n\
    With --region on an object that moves by itself the motion is that object's, and the time to contact its own. --object-rotation-std then says how much the object may turn by itself:\n\
    its rotation is otherwise that of the rest of the picture, whose status is the column scene_status; where that rotation is not known, nothing is assumed of the object's.\n\n\
    Examples:\n  \
    jacoflow egomotion drive/ --intrinsics 707.1,707.1,601.9,183.1 -o motion.csv --picture pictures/ --maps contact/\n  \
    jacoflow egomotion drive/ --intrinsics calib.txt --preset fast --no-robust --alternatives others.csv > motion.csv\n  \
    jacoflow egomotion drive/ --intrinsics 721.5,721.5,609.6,172.9 --region 551,277,170,50 --object-rotation-std 0.001 -o car.csv"
)]
pub struct EgomotionCommand {
    #[command(flatten)]
    pub input: InputArguments,
    /// The camera: focal lengths and principal point FX,FY,CX,CY, and skew if there is any, in px; or a text
    /// file with the 9 numbers of K or the 12 of a projection matrix
    #[arg(long, value_name = "FX,FY,CX,CY[,SKEW]|FILE", required = true, help_heading = "Camera")]
    pub intrinsics: String,
    #[command(flatten)]
    pub method: MethodArguments,
    #[command(flatten)]
    pub grid: GridArguments,
    /// Estimator of the motion: auto, ml (maximum likelihood) or efficient (weights from smoothed depths)
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Motion")]
    pub estimator: String,
    /// Take all points for parts of one rigid scene, instead of looking for those that are
    #[arg(long, help_heading = "Motion")]
    pub no_robust: bool,
    /// Distance of the points, px [default: twice the length over which errors of the flow go together, at
    /// least 8, less where --region would have fewer than 30 points, not below that length]
    #[arg(long, value_name = "PX", value_parser = parse_positive, help_heading = "Motion")]
    pub spacing: Option<f64>,
    /// Most points of a field
    #[arg(long, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(5..), help_heading = "Motion")]
    pub max_points: Option<usize>,
    /// Take what is in --region for an object that moves by itself and turns by so much (standard deviation
    /// about each axis) beside the rotation of the rest of the picture: 0.001 for a car
    #[arg(long, value_name = "RAD/FRAME", value_parser = parse_positive, requires = "region", help_heading = "Motion")]
    pub object_rotation_std: Option<f64>,
    /// Seed of the random choices
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Motion")]
    pub random_state: u64,
    /// A .csv file [default: standard output]
    #[arg(long, short, value_name = "FILE", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// A .csv file for other motions that explain the flow about as well, as those of a status ambiguous:
    /// frame, time_s, number (the best first), direction, rotation, how much less likely it is (squared units
    /// of noise), focus of expansion
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub alternatives: Option<PathBuf>,
    /// Draw what comes near in red, and the focus of expansion, over every frame: a folder for
    /// egomotion_000000.png, ...
    #[arg(long, value_name = "FOLDER", help_heading = "Output")]
    pub picture: Option<PathBuf>,
    /// Times to contact at every pixel (frames) with their standard deviations and residuals (in units of
    /// noise: far from 0 on what moves by itself): a folder for contact_000000.npz, ...
    #[arg(long, value_name = "FOLDER", help_heading = "Output")]
    pub maps: Option<PathBuf>,
    /// Replace files that exist; when the run is complete, what an earlier run left in the folders for
    /// further frames is removed, from the frame --start on
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    #[command(flatten)]
    pub compute: ComputeArguments,
    #[command(flatten)]
    pub messages: MessageArguments,
}

impl EgomotionCommand {
    /// Runs the command.
    pub fn execute(&self, watch: &Watch) -> Result<Report> {
        // Numbers are no file, or one that does not exist.
        let files = self.grid.files().chain(self.method.initial.as_deref()).chain([Path::new(&self.intrinsics)]);
        let _new_folders = CommandPaths::of_input(&self.input.input)
            .reading(files)
            .writing("output", self.output.as_deref())
            .writing("alternatives", self.alternatives.as_deref())
            .writing_numbered("picture", self.picture.as_deref(), "egomotion", &["png"])
            .writing_numbered("maps", self.maps.as_deref(), "contact", &["npz"])
            .check(self.force)?;
        let plan = self.plan()?;
        let mut opened = open_for_method(&self.input, &self.method)?;
        let Prepared { plan: stream, is_double, .. } = prepare_with_covariance(
            &mut opened,
            &self.input,
            &self.method,
            &self.seen(),
            &self.compute,
            "which weighs the points",
        )?;
        let sink = Egomotion::open(plan)?;
        let mut details = input_details(&opened, &self.grid);
        details["method"] = stream.estimator().method().name().into();
        details["estimator"] = json!(self.estimator);
        let context =
            ReportContext { command: "egomotion", messages: &self.messages, output: self.output.as_deref(), details };
        if is_double {
            run_flow::<f64>(opened, stream, vec![Box::new(sink)], context, watch)
        } else {
            run_flow::<f32>(opened, stream, vec![Box::new(sink)], context, watch)
        }
    }

    /// Where flow is wanted: in the whole picture where its rest gives the rotation.
    fn seen(&self) -> GridArguments {
        let mut seen = self.grid.clone();
        if self.object_rotation_std.is_some() {
            seen.region = None;
        }
        seen
    }

    /// What is estimated and where it goes, checked before any work.
    fn plan(&self) -> Result<EgomotionPlan> {
        let method = match self.estimator.as_str() {
            "auto" => motion3d::Method::Auto,
            "ml" => motion3d::Method::MaximumLikelihood,
            "efficient" => motion3d::Method::Efficient,
            other => return Err(Error::argument("estimator", "auto, ml or efficient", other)),
        };
        for (name, folder) in [("picture", &self.picture), ("maps", &self.maps)] {
            self.vacant(name, folder.as_deref())?;
        }
        let threads = compute(&self.compute)?.0;
        Ok(EgomotionPlan {
            camera: intrinsics(&self.intrinsics)?,
            field: FieldOptions {
                spacing: self.spacing,
                max_points: self.max_points,
                region: self.grid.region,
                ..FieldOptions::default()
            },
            motion: MotionOptions {
                method,
                robust: !self.no_robust,
                random_state: self.random_state,
                threads,
                ..MotionOptions::default()
            },
            object_rotation_std: self.object_rotation_std,
            target: table_target(self.output.as_deref(), self.force, self.messages.json)?,
            alternatives: self.others()?,
            pictures: self.picture.clone(),
            maps: self.maps.clone(),
            stale_from: self.force.then_some(self.input.selection.start),
        })
    }

    /// Where other motions go.
    fn others(&self) -> Result<Option<TableTarget>> {
        let Some(path) = self.alternatives.as_deref() else { return Ok(None) };
        if path == Path::new("-") {
            return Err(Error::argument("alternatives", "a .csv file of its own", path.display()));
        }
        table_target(Some(path), self.force, false).map(Some).map_err(|error| error.about("alternatives"))
    }

    /// Whether a folder may be written into.
    fn vacant(&self, name: &'static str, folder: Option<&Path>) -> Result<()> {
        let Some(folder) = folder.filter(|_| !self.force) else { return Ok(()) };
        if folder.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
            let wanted = "an empty or new folder (--force writes into it)";
            return Err(Error::argument(name, wanted, folder.display()));
        }
        Ok(())
    }
}

/// `FX,FY,CX,CY[,SKEW]`, or a file with the 9 numbers of K or the 12 of a projection matrix; words in it (as
/// `P0:`) are skipped, and only its first line counts where that has enough numbers.
fn intrinsics(text: &str) -> Result<Intrinsics> {
    read_intrinsics(text).map_err(|error| match error {
        // The core calls the matrix K.
        Error::Argument { argument: "K", expected, got } => {
            Error::argument("intrinsics", expected, format!("{got}, from {text}"))
        }
        other => other,
    })
}

fn read_intrinsics(text: &str) -> Result<Intrinsics> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[fx, fy, cx, cy]) => return Intrinsics::new([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        Some(&[fx, fy, cx, cy, skew]) => return Intrinsics::new([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        Some(_) => return Err(Error::argument("intrinsics", "FX,FY,CX,CY[,SKEW] or a file", text)),
        None => {}
    }
    let path = Path::new(text);
    if text.contains(',') && !path.exists() {
        return Err(Error::argument("intrinsics", "numbers FX,FY,CX,CY[,SKEW] or a file", text));
    }
    let content = std::fs::read_to_string(path).map_err(|source| Error::io(path, source))?;
    let read = |text: &str| -> Vec<f64> {
        text.split(|c: char| c.is_whitespace() || c == ',').filter_map(|word| word.parse().ok()).collect()
    };
    let first = read(content.lines().next().unwrap_or_default());
    let all = if first.len() >= 9 { first } else { read(&content) };
    match all[..] {
        [a, b, c, d, e, f, g, h, i] | [a, b, c, _, d, e, f, _, g, h, i, _] => {
            Intrinsics::new([[a, b, c], [d, e, f], [g, h, i]])
        }
        _ => Err(Error::format(path, format!("expected 9 numbers (K) or 12 (a projection matrix), got {}", all.len()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_come_as_words_and_as_files() {
        let want = [[500.0, 0.0, 320.0], [0.0, 490.0, 240.0], [0.0, 0.0, 1.0]];
        assert_eq!(intrinsics("500,490,320,240").unwrap().matrix(), want);
        assert_eq!(intrinsics("500,490,320,240,2").unwrap().matrix()[0][1], 2.0);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("calib.txt");
        for content in ["500 0 320\n0 490 240\n0 0 1\n", "P0: 500 0 320 0 0 490 240 0 0 0 1 0\nP1: 1 2 3\n"] {
            std::fs::write(&file, content).unwrap();
            assert_eq!(intrinsics(file.to_str().unwrap()).unwrap().matrix(), want);
        }
        std::fs::write(&file, "1 2 3").unwrap();
        assert!(intrinsics(file.to_str().unwrap()).unwrap_err().to_string().contains("got 3"));
        assert!(intrinsics("1,2,3").unwrap_err().to_string().starts_with("intrinsics: "));
        for wrong in ["0,500,3,4", "707,707,a,1", "nan,500,3,4"] {
            assert!(intrinsics(wrong).unwrap_err().to_string().starts_with("intrinsics: "), "{wrong}");
        }
        std::fs::write(&file, "1 2 3 4 5 6 7 8 9").unwrap();
        assert!(intrinsics(file.to_str().unwrap()).unwrap_err().to_string().starts_with("intrinsics: "));
        assert!(intrinsics("no/such/file").is_err());
    }
}
