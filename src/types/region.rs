//! Pixels at which estimates are made.

use crate::error::{Error, Result};

/// A rectangle of pixels: columns `x .. x + width`, rows `y .. y + height`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(from = "[usize; 4]", into = "[usize; 4]")
)]
pub struct Rect {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl From<[usize; 4]> for Rect {
    fn from([x, y, width, height]: [usize; 4]) -> Self {
        Self { x, y, width, height }
    }
}

impl From<Rect> for [usize; 4] {
    fn from(Rect { x, y, width, height }: Rect) -> Self {
        [x, y, width, height]
    }
}

/// The pixels at which estimates are made.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum SamplingGrid {
    /// Every `stride`-th column and row of a region (`None`: the whole frame), from its upper left corner.
    Grid {
        /// The region.
        region: Option<Rect>,
        /// Distance between neighbouring sites, px.
        stride: usize,
    },
    /// A list of pixels `(x, y)`.
    Points(Vec<(usize, usize)>),
}

impl Default for SamplingGrid {
    fn default() -> Self {
        Self::Grid { region: None, stride: 1 }
    }
}

impl SamplingGrid {
    /// Columns and rows of the result for frames of `size = (width, height)`: points come as one row.
    ///
    /// # Errors
    /// [`Error::Argument`] for a stride of 0, a region or a point outside the frame.
    pub fn shape(&self, size: (usize, usize)) -> Result<(usize, usize)> {
        let (w, h) = size;
        match self {
            Self::Grid { stride: 0, .. } => Err(Error::argument("stride", "a positive integer", 0)),
            Self::Grid { region, stride } => {
                let r = region.unwrap_or(Rect { x: 0, y: 0, width: w, height: h });
                let inside = r.x.checked_add(r.width).is_some_and(|e| e <= w)
                    && r.y.checked_add(r.height).is_some_and(|e| e <= h);
                if !inside || ((r.width == 0 || r.height == 0) && region.is_some()) {
                    return Err(Error::argument(
                        "region",
                        format!("a non-empty rectangle inside the {w} x {h} frame"),
                        format!("x {}, y {}, width {}, height {}", r.x, r.y, r.width, r.height),
                    ));
                }
                Ok((r.width.div_ceil(*stride), r.height.div_ceil(*stride)))
            }
            Self::Points(points) => {
                if let Some(&(x, y)) = points.iter().find(|&&(x, y)| x >= w || y >= h) {
                    return Err(Error::argument(
                        "points",
                        format!("pixels (x, y) inside the {w} x {h} frame"),
                        format!("({x}, {y})"),
                    ));
                }
                Ok((points.len(), 1))
            }
        }
    }

    /// The pixel `(x, y)` of result column `col`, row `row`. Call [`SamplingGrid::shape`] first.
    #[inline]
    pub fn pixel(&self, col: usize, row: usize) -> (usize, usize) {
        match self {
            Self::Grid { region, stride } => {
                let (x, y) = region.map_or((0, 0), |r| (r.x, r.y));
                (x + col * stride, y + row * stride)
            }
            Self::Points(points) => points[col],
        }
    }
}
