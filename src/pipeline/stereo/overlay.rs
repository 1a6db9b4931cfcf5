//! Clusters and disparities over the left views, as pictures or a sequence.

use super::{StereoSink, StereoStep};
use crate::error::Result;
use crate::image::picture::{ClusterMark, GreyRange, Picture, cluster_picture, draw_disparity};
use crate::pipeline::album::Album;
use crate::pipeline::sink::ends_as;
use crate::track::stereo::{Step, TrackGraph};
use crate::types::Frame;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What is drawn over a left view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StereoPicture {
    /// Edge pixels in the colours of their tracks, tracks' numbers, motions since the last step.
    Clusters,
    /// Edge pixels coloured by disparity, from blue at the first (far) to red at the second (near), px.
    Disparities(f64, f64),
}

impl StereoPicture {
    /// First word of the files' names.
    fn stem(self) -> &'static str {
        match self {
            Self::Clusters => "track",
            Self::Disparities(..) => "stereo",
        }
    }

    /// What its place is called in errors.
    fn argument(self) -> &'static str {
        match self {
            Self::Clusters => "overlay",
            Self::Disparities(..) => "disparity_overlay",
        }
    }

    fn draw(self, mut view: Picture, step: &Step, enlargement: usize) -> Picture {
        let pixels = step.columns.iter().zip(&step.rows).map(|(&x, &y)| [x, y]);
        match self {
            Self::Clusters => {
                let tracks: BTreeMap<usize, u64> =
                    step.clusters.iter().map(|node| (node.index, node.track_id)).collect();
                let numbers = step.labels.iter().map(|&label| tracks.get(&(label as usize)).copied().unwrap_or(0));
                let marks: Vec<ClusterMark> = step
                    .clusters
                    .iter()
                    .map(|node| {
                        let [u, v, _] = node.velocity.unwrap_or([f64::NAN; 3]);
                        ClusterMark { number: node.track_id, centre: node.middle, motion: [u, v] }
                    })
                    .collect();
                cluster_picture(&view, pixels.zip(numbers), &marks, enlargement)
            }
            Self::Disparities(far, near) => {
                let mut map = Frame::filled(view.width(), view.height(), f32::NAN);
                for ([x, y], &disparity) in pixels.zip(&step.disparities) {
                    map.row_mut(y as usize)[x as usize] = disparity;
                }
                draw_disparity(&mut view, &map, (far, near));
                if enlargement > 1 { view.enlarged(enlargement) } else { view }
            }
        }
    }
}

/// Writes a picture of every step, numbered as the pairs in the input, each whole, or one sequence.
#[derive(Debug)]
pub struct StereoOverlays {
    album: Album,
    kind: StereoPicture,
    enlargement: usize,
    range: Option<GreyRange>,
}

impl StereoOverlays {
    /// Pictures in a folder, which is made when it does not exist, or, by the name `*.y4m`, a sequence of
    /// `frame_rate` frames per second that appears when it is finished. Pictures are `enlargement` times as
    /// large as the views.
    pub fn create(path: &Path, kind: StereoPicture, enlargement: usize, frame_rate: f64) -> Result<Self> {
        let album = Album::create(path, kind.stem(), kind.argument(), frame_rate)?;
        Ok(Self { album, kind, enlargement, range: None })
    }

    /// Refuses a folder that holds pictures of an earlier run, and a sequence that exists. Makes nothing.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) named `overlay` or `disparity_overlay`.
    pub fn check(path: &Path, kind: StereoPicture) -> Result<()> {
        Album::check(path, kind.stem(), kind.argument())
    }
}

impl StereoSink for StereoOverlays {
    fn accept(&mut self, step: &StereoStep<'_>) -> Result<()> {
        let range = *self.range.get_or_insert_with(|| GreyRange::of(step.left));
        let picture = self.kind.draw(range.picture(step.left), step.step, self.enlargement);
        self.album.add(step.frame_index, &picture)
    }

    ends_as!(album, &TrackGraph);
}
