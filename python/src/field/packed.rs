//! Fields of consecutive frames in one piece of memory, so that every array seen from Python is a view.

use jacoflow::buffer_pool;
use jacoflow::error::{Error, Result};
use jacoflow::math::Real;
use jacoflow::types::{FieldLayout, FlowField as CoreField, Status};

/// What fields of one stack differ in.
#[derive(Debug, Clone, Copy)]
pub struct Note {
    /// Index of the field's frame.
    pub frame_index: usize,
    /// Seconds between its frames.
    pub period: Option<f64>,
    /// Length, px, over which its errors go together.
    pub correlation_length: f64,
}

impl Note {
    fn of(layout: &FieldLayout) -> Self {
        let FieldLayout { frame_index, correlation_length, .. } = *layout;
        Self { frame_index, period: layout.units.frame_period, correlation_length }
    }
}

/// `count` fields of one layout: for each plane-wise quantity the planes of frame 0, then those of frame 1,
/// and so on.
#[derive(Debug, Clone)]
pub struct Packed<T: Real> {
    /// Layout of the first field; of the others it differs by their notes.
    pub layout: FieldLayout,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Number of fields.
    pub count: usize,
    /// Of each field.
    pub notes: Vec<Note>,
    /// `count * P` planes.
    pub motion: Vec<T>,
    /// `count * P (P + 1) / 2` planes.
    pub covariance: Option<Vec<T>>,
    /// `count` planes of status codes.
    pub status: Vec<u8>,
    /// `count` planes.
    pub residual: Option<Vec<T>>,
    /// `count` planes.
    pub rank: Option<Vec<u8>>,
    /// `count` planes.
    pub condition: Option<Vec<T>>,
    /// `count` planes.
    pub window: Option<Vec<T>>,
}

impl<T: Real> Packed<T> {
    /// One field, without copying its planes.
    pub fn one(field: CoreField<T>) -> Self {
        Self {
            width: field.width,
            height: field.height,
            count: 1,
            notes: vec![Note::of(&field.layout)],
            motion: field.motion,
            covariance: field.covariance,
            // In place: the codes are as large as the status.
            status: field.status.into_iter().map(|s| s as u8).collect(),
            residual: field.residual,
            rank: field.rank,
            condition: field.condition,
            window: field.window,
            layout: field.layout,
        }
    }

    /// Adds the field of the next frame.
    pub fn append(&mut self, field: CoreField<T>) -> Result<()> {
        if (field.width, field.height) != (self.width, self.height) || field.motion.len() != self.stride() {
            return Err(Error::argument("frames", "fields of one size and model", "fields that differ"));
        }
        self.notes.push(Note::of(&field.layout));
        extend_from(&mut self.motion, field.motion);
        self.status.extend(field.status.iter().map(|&s| s as u8));
        extend(&mut self.covariance, field.covariance);
        extend(&mut self.residual, field.residual);
        extend(&mut self.rank, field.rank);
        extend(&mut self.condition, field.condition);
        extend(&mut self.window, field.window);
        self.count += 1;
        Ok(())
    }

    /// Number of sites of one field.
    pub fn site_count(&self) -> usize {
        self.width * self.height
    }

    /// Values of `motion` that belong to one field.
    fn stride(&self) -> usize {
        self.site_count() * self.layout.parameters.len()
    }

    /// A copy of field `index`, as the core takes it.
    pub fn field(&self, index: usize) -> CoreField<T> {
        let part = |values: &[T]| {
            let length = values.len() / self.count.max(1);
            values[index * length..(index + 1) * length].to_vec()
        };
        let sites = index * self.site_count()..(index + 1) * self.site_count();
        let mut layout = self.layout.clone();
        let note = self.notes[index];
        (layout.frame_index, layout.correlation_length) = (note.frame_index, note.correlation_length);
        layout.units.frame_period = note.period;
        CoreField {
            layout,
            width: self.width,
            height: self.height,
            motion: part(&self.motion),
            covariance: self.covariance.as_deref().map(part),
            systematic: None,
            status: self.status[sites.clone()]
                .iter()
                .map(|&code| Status::from_code(code).unwrap_or_default())
                .collect(),
            residual: self.residual.as_deref().map(part),
            rank: self.rank.as_deref().map(|values| values[sites].to_vec()),
            condition: self.condition.as_deref().map(part),
            window: self.window.as_deref().map(part),
        }
    }
}

impl<T: Real> Drop for Packed<T> {
    fn drop(&mut self) {
        buffer_pool::give(std::mem::take(&mut self.motion));
        buffer_pool::give(std::mem::take(&mut self.status));
        if let Some(planes) = self.covariance.take() {
            buffer_pool::give(planes);
        }
    }
}

fn extend_from<T: Copy + Send + 'static>(planes: &mut Vec<T>, more: Vec<T>) {
    planes.extend_from_slice(&more);
    buffer_pool::give(more);
}

fn extend<T: Copy + Send + 'static>(planes: &mut Option<Vec<T>>, more: Option<Vec<T>>) {
    match (planes, more) {
        (Some(planes), Some(more)) => extend_from(planes, more),
        (planes, _) => *planes = None,
    }
}
