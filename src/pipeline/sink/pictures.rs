//! Pictures of every field.

use super::{Ending, Sink, Step};
use crate::error::Result;
use crate::flow::derived::{Quantity, plane};
use crate::image::picture::{FlowColours, Picture, Quiver, SignedMap, arrows_on_grid, grey_picture};
use crate::io::write_picture;
use crate::math::Real;
use crate::pipeline::output::{OutputPlan, PictureKind, Place, too_many};
use crate::types::{AnyFrame, FlowField, Frame, SamplingGrid};
use std::collections::HashSet;
use std::path::PathBuf;

/// Pixels between arrows.
const ARROW_SPACING: usize = 16;

/// Ranges of the pictures of a run; `None`: from the first field with an estimate, then kept.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PictureRanges {
    /// Speed of the full colour, in the field's unit; also sets the arrows' scale.
    pub speed: Option<f64>,
    /// Divergence or curl of the strongest red and blue, 1/s where the frame rate is known, else 1/frame; one
    /// range for both, so that they can be compared.
    pub rate: Option<f64>,
}

/// Draws the pictures of a plan.
///
/// Results on a coarse grid are drawn as blocks, so that pictures have about the frame's size.
#[derive(Debug)]
pub struct Pictures {
    plan: OutputPlan,
    ranges: PictureRanges,
    arrow_scale: Option<f64>,
    waiting: Vec<(PathBuf, Picture)>,
    frames: HashSet<usize>,
    written: usize,
    latest: Option<PathBuf>,
}

impl Pictures {
    /// Pictures as `plan` says.
    pub fn new(plan: OutputPlan, ranges: PictureRanges) -> Self {
        Self { plan, ranges, arrow_scale: None, waiting: Vec::new(), frames: HashSet::new(), written: 0, latest: None }
    }

    fn draw<T: Real>(&mut self, kind: PictureKind, field: &FlowField<T>, frame: &Frame<T>) -> Result<Picture> {
        match kind {
            PictureKind::Colour => self.colour(field),
            PictureKind::Quiver => self.quiver(field, frame),
            PictureKind::Divergence => self.signed(field, Quantity::Divergence),
            PictureKind::Curl => self.signed(field, Quantity::Curl),
        }
    }

    fn colour<T: Real>(&mut self, field: &FlowField<T>) -> Result<Picture> {
        let (u, v) = flow_planes(field);
        let colours = FlowColours::new(self.ranges.speed);
        if self.ranges.speed.is_none() && is_known(u) {
            self.ranges.speed = Some(colours.range(u, v));
        }
        let picture = FlowColours::new(self.ranges.speed).picture(u, v, field.width, field.height)?;
        Ok(picture.enlarged(stride(field)))
    }

    fn quiver<T: Real>(&mut self, field: &FlowField<T>, frame: &Frame<T>) -> Result<Picture> {
        let scale = field.layout.units.scale("u");
        let field = &*field.in_pixels_and_frames();
        let (u, v) = flow_planes(field);
        let stride = stride(field);
        let (x, y) = field.layout.sites.pixel(0, 0);
        let spacing = (ARROW_SPACING / stride).max(1);
        let size = (field.width, field.height);
        let arrows = arrows_on_grid(u, v, size, spacing, (x as f64, y as f64), stride as f64)?;
        if self.arrow_scale.is_none() && is_known(u) {
            self.arrow_scale = Some(match self.ranges.speed {
                Some(speed) => Quiver::default().longest * scale / speed,
                None => Quiver::default().resolve_scale(&arrows),
            });
        }
        let mut picture = grey_picture(&AnyFrame::F64(frame.map(|value| value.to_f64())));
        Quiver::new(self.arrow_scale).draw(&mut picture, &arrows);
        Ok(picture)
    }

    /// A diverging map of a quantity. The first known field sets the range, of divergence and curl.
    fn signed<T: Real>(&mut self, field: &FlowField<T>, quantity: Quantity) -> Result<Picture> {
        let values = plane(field, quantity)?;
        if self.ranges.rate.is_none() && is_known(&values) {
            let range = |quantity| -> Result<f64> { Ok(SignedMap::default().resolve_range(&plane(field, quantity)?)) };
            let both = [range(Quantity::Divergence)?, range(Quantity::Curl)?];
            self.ranges.rate = Some(both[0].max(both[1]));
        }
        let map = SignedMap::new(self.ranges.rate);
        Ok(map.picture(&values, field.width, field.height)?.enlarged(stride(field)))
    }

    fn write(&mut self, path: PathBuf, picture: &Picture) -> Result<()> {
        write_picture(&path, picture)?;
        self.written += 1;
        self.latest = Some(path);
        Ok(())
    }
}

fn flow_planes<T: Real>(field: &FlowField<T>) -> (&[T], &[T]) {
    let n = field.len();
    (&field.motion[..n], &field.motion[n..2 * n])
}

fn is_known<T: Real>(plane: &[T]) -> bool {
    plane.iter().any(|value| value.finite())
}

fn stride<T>(field: &FlowField<T>) -> usize {
    match field.layout.sites {
        SamplingGrid::Grid { stride, .. } => stride,
        SamplingGrid::Points(_) => 1,
    }
}

impl<T: Real> Sink<Step<'_, T>> for Pictures {
    fn accept(&mut self, step: &Step<'_, T>) -> Result<()> {
        self.frames.insert(step.field.layout.frame_index);
        for kind in self.plan.pictures.clone() {
            let picture = self.draw(kind, step.field, step.frame)?;
            let Some(path) = self.plan.picture_path(step.field.layout.frame_index, kind) else { continue };
            match &self.plan.place {
                Place::Single(_) if self.frames.len() > 1 => return Err(too_many(&path, "several")),
                Place::Single(_) => self.waiting.push((path, picture)),
                _ => self.write(path, &picture)?,
            }
        }
        Ok(())
    }

    fn finish(&mut self, ending: Ending) -> Result<()> {
        for (path, picture) in std::mem::take(&mut self.waiting) {
            if ending == Ending::Complete {
                self.write(path, &picture)?;
            }
        }
        match ending {
            Ending::Complete => self.plan.remove_stale(&self.plan.picture_files(), &self.frames),
            Ending::Partial => Ok(()),
        }
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        (self.written, self.latest.clone())
    }
}
