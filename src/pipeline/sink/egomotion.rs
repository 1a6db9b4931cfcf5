//! The camera's motion from every field, one row each, and pictures of what comes near.

use super::{Ending, Sink, Step, table::Table, table::TableTarget};
use crate::error::Result;
use crate::image::{picture::ContactMark, picture::draw_contacts, picture::grey_picture};
use crate::io::npz::NpzWriter;
use crate::io::{NumberedFiles, cell, write_picture};
use crate::math::Real;
use crate::motion3d::{
    Alternative, FieldMotion, FieldOptions, Intrinsics, MotionEstimate, MotionOptions, RotationPrior, Status,
    contact_map, estimate_field_motion, focus_of_expansion,
};
use crate::types::{AnyFrame, FlowField};
use std::collections::HashSet;
use std::path::PathBuf;

/// Columns of the table.
const HEADER: [&str; 30] = [
    "frame",
    "time_s",
    "status",
    "method",
    "points",
    "inliers",
    "u_x",
    "u_y",
    "u_z",
    "direction_std_deg",
    "w_x",
    "w_y",
    "w_z",
    "w_x_std",
    "w_y_std",
    "w_z_std",
    "foe_x",
    "foe_y",
    "foe_x_std",
    "foe_y_std",
    "approach_rate",
    "approach_rate_std",
    "time_to_contact",
    "time_to_contact_std",
    "scene_status",
    "alternatives",
    "bound_direction_std_deg",
    "bound_w_x_std",
    "bound_w_y_std",
    "bound_w_z_std",
];

/// Columns of the table of other motions.
const ALTERNATIVES: [&str; 12] =
    ["frame", "time_s", "number", "u_x", "u_y", "u_z", "w_x", "w_y", "w_z", "excess_cost", "foe_x", "foe_y"];

/// What is estimated from fields and where it goes.
#[derive(Debug, Clone)]
pub struct EgomotionPlan {
    /// The camera.
    pub camera: Intrinsics,
    /// Which points of a field are taken.
    pub field: FieldOptions,
    /// How the motion is estimated.
    pub motion: MotionOptions,
    /// How much the object in the field options' region may turn by itself, rad/frame: its rotation is then
    /// known beforehand as that of the rest of the scene. `None`: nothing is known of it.
    pub object_rotation_std: Option<f64>,
    /// Where rows go.
    pub target: TableTarget,
    /// Where other motions go that explain the flow about as well, one row each.
    pub alternatives: Option<TableTarget>,
    /// A folder for pictures, `egomotion_000000.png`, ...
    pub pictures: Option<PathBuf>,
    /// A folder for times to contact all over the field, `contact_000000.npz`, ...
    pub maps: Option<PathBuf>,
    /// The first frame whose pictures and maps of an earlier run are removed when this one is complete;
    /// `None`: none are.
    pub stale_from: Option<usize>,
}

/// Names of pictures begin so.
const PICTURE_STEM: &str = "egomotion";
/// Names of maps begin so.
const MAP_STEM: &str = "contact";

/// Writes, for each field, the rigid motion of the scene relative to the camera: direction `u` and rotation
/// rate `w` (rad/frame) with their standard deviations, the focus of expansion (px), and the rate `nu u_z`
/// (1/frame) and time to contact (frames) of all points together, and the Cramér-Rao bound; other motions
/// that explain the flow as well into a table of their own.
#[derive(Debug)]
pub struct Egomotion {
    plan: EgomotionPlan,
    table: Table,
    alternatives: Option<Table>,
    /// Frames with a map and a picture.
    frames: HashSet<usize>,
    written: usize,
    latest: Option<PathBuf>,
}

impl Egomotion {
    /// Opens the tables.
    pub fn open(plan: EgomotionPlan) -> Result<Self> {
        let table = Table::create(&plan.target, &HEADER)?;
        let alternatives = plan.alternatives.as_ref().map(|target| Table::create(target, &ALTERNATIVES)).transpose()?;
        Ok(Self { table, alternatives, plan, frames: HashSet::new(), written: 0, latest: None })
    }

    /// The motion of the scene outside of the region, where an independently moving object lies in the
    /// region.
    fn scene<T: Real>(&self, field: &FlowField<T>) -> Result<Option<MotionEstimate>> {
        let (Some(_), Some(region)) = (self.plan.object_rotation_std, self.plan.field.region) else {
            return Ok(None);
        };
        let around = FieldOptions { excluded: Some(region), ..FieldOptions::default() };
        Ok(Some(estimate_field_motion(field, &self.plan.camera, &around, &self.plan.motion)?.estimate))
    }

    fn row(&mut self, frame: usize, time: Option<f64>, found: &MotionEstimate, scene: Option<Status>) -> Result<()> {
        let motion = &found.motion;
        let focus = focus_of_expansion(motion, &found.tangent, &found.covariance, Some(&self.plan.camera));
        let (at, spread) = focus.unwrap_or(([f64::NAN; 2], [[f64::NAN; 2]; 2]));
        let (rate, rate_std) = found.approach;
        let (contact, contact_std) = time_to_contact(rate, rate_std);
        let mut cells = vec![
            frame.to_string(),
            time.map(cell).unwrap_or_default(),
            found.status.name().to_string(),
            if found.efficient { "efficient" } else { "ml" }.to_string(),
            found.inliers.len().to_string(),
            found.inliers.iter().filter(|&&inlier| inlier).count().to_string(),
        ];
        cells.extend(motion.translation.map(cell));
        cells.push(cell(found.direction_std));
        cells.extend(motion.rotation.map(cell));
        cells.extend(found.rotation_std.map(cell));
        cells.extend(at.map(cell));
        cells.extend([spread[0][0].sqrt(), spread[1][1].sqrt(), rate, rate_std, contact, contact_std].map(cell));
        cells.push(scene.map_or("", Status::name).to_string());
        cells.push(found.alternatives.len().to_string());
        cells.extend(bound_deviations(&found.bound).map(cell));
        self.table.row(cells)?;
        self.table.flush()
    }

    /// Other motions that explain the flow about as well, the best first.
    fn others(&mut self, frame: usize, time: Option<f64>, found: &MotionEstimate) -> Result<()> {
        let Some(table) = &mut self.alternatives else { return Ok(()) };
        for (k, Alternative { motion, excess }) in found.alternatives.iter().enumerate() {
            let focus = focus_of_expansion(motion, &found.tangent, &found.covariance, Some(&self.plan.camera));
            let mut cells = vec![frame.to_string(), time.map(cell).unwrap_or_default(), (k + 1).to_string()];
            cells.extend(motion.translation.map(cell));
            cells.extend(motion.rotation.map(cell));
            cells.push(cell(*excess));
            // Its covariance would be that of the first choice.
            cells.extend(focus.map_or([f64::NAN; 2], |(at, _)| at).map(cell));
            table.row(cells)?;
        }
        Ok(())
    }

    /// The frame with its points in the colours of their rates of approach, and the focus of expansion.
    fn draw<T: Real>(&mut self, step: &Step<'_, T>, motion: &FieldMotion) -> Result<()> {
        let Some(folder) = &self.plan.pictures else { return Ok(()) };
        let FieldMotion { estimate: found, points, spacing } = motion;
        let mut picture = grey_picture(&AnyFrame::F64(step.frame.map(|value| value.to_f64())));
        let mark = |(k, at): (usize, &[f64; 2])| ContactMark { at: *at, rate: -1.0 / found.time_to_contact[k] };
        let marks: Vec<ContactMark> = points.iter().enumerate().filter(|(k, _)| found.inliers[*k]).map(mark).collect();
        let focus = focus_of_expansion(&found.motion, &found.tangent, &found.covariance, Some(&self.plan.camera));
        draw_contacts(&mut picture, &marks, 0.5 * spacing, focus);
        let path = NumberedFiles::create(folder, PICTURE_STEM, "png")?.path(step.field.layout.frame_index);
        write_picture(&path, &picture)?;
        self.written += 1;
        self.latest = Some(path);
        Ok(())
    }

    /// Removes pictures and maps of frames from `first` on that this run did not write.
    fn remove_stale(&self, first: usize) -> Result<()> {
        let pictures = self.plan.pictures.iter().map(|folder| NumberedFiles::named(folder, PICTURE_STEM, "png"));
        let maps = self.plan.maps.iter().map(|folder| NumberedFiles::named(folder, MAP_STEM, "npz"));
        let is_kept = |index: usize| index < first || self.frames.contains(&index);
        pictures.chain(maps).try_for_each(|files| files.clear_except(is_kept))
    }

    /// Times to contact of all sites with their standard deviations and residuals.
    fn map<T: Real>(&mut self, field: &FlowField<T>, found: &MotionEstimate) -> Result<()> {
        let Some(folder) = &self.plan.maps else { return Ok(()) };
        let map = contact_map(field, &self.plan.camera, &found.uncertain(), self.plan.motion.placement)?;
        let path = NumberedFiles::create(folder, MAP_STEM, "npz")?.path(field.layout.frame_index);
        let mut archive = NpzWriter::create(&path)?;
        let planes =
            [("time_to_contact", map.contact), ("time_to_contact_std", map.deviation), ("residual", map.residual)];
        for (name, values) in planes {
            archive.array(name, &[map.height, map.width], &values)?;
        }
        archive.finish()?;
        self.written += 1;
        self.latest = Some(path);
        Ok(())
    }
}

/// Standard deviations of the bound: of the direction, degrees, and of the rotation, rad/frame.
fn bound_deviations(bound: &[[f64; 5]; 5]) -> [f64; 4] {
    let deviation = |i: usize| bound[i][i].sqrt();
    [deviation(0).hypot(deviation(1)).to_degrees(), deviation(2), deviation(3), deviation(4)]
}

/// `-1 / rate` with its standard deviation; infinite without an approach.
fn time_to_contact(rate: f64, deviation: f64) -> (f64, f64) {
    if rate == 0.0 { (f64::INFINITY, f64::INFINITY) } else { (-1.0 / rate, deviation / (rate * rate)) }
}

impl<T: Real> Sink<Step<'_, T>> for Egomotion {
    fn accept(&mut self, step: &Step<'_, T>) -> Result<()> {
        let scene = self.scene(step.field)?;
        let rotation_prior = scene
            .as_ref()
            .zip(self.plan.object_rotation_std)
            .and_then(|(scene, std)| RotationPrior::of_scene(scene.motion.rotation, &scene.covariance, std));
        let options = MotionOptions { rotation_prior, ..self.plan.motion.clone() };
        let found = estimate_field_motion(step.field, &self.plan.camera, &self.plan.field, &options)?;
        let frame = step.field.layout.frame_index;
        self.row(frame, step.time, &found.estimate, scene.map(|scene| scene.status))?;
        self.others(frame, step.time, &found.estimate)?;
        if found.estimate.status == Status::TooFewPoints {
            return Ok(());
        }
        self.frames.insert(frame);
        self.map(step.field, &found.estimate)?;
        self.draw(step, &found)
    }

    fn finish(&mut self, ending: Ending) -> Result<()> {
        let others = self.alternatives.as_mut().map_or(Ok(()), |table| table.finish(ending));
        self.table.finish(ending).and(others)?;
        match (ending, self.plan.stale_from) {
            (Ending::Complete, Some(first)) => self.remove_stale(first),
            _ => Ok(()),
        }
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        let (tables, table) = self.table.files();
        let (others, _) = self.alternatives.as_ref().map(Table::files).unwrap_or_default();
        (tables + others + self.written, table.or_else(|| self.latest.clone()))
    }
}
