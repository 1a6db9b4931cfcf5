//! Parts of a frame: regions, and the pixels at which estimates are made.

use super::Mask;
use crate::error::{Error, Result, numbers};

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

/// A part of a frame. A pixel belongs to it if its centre does.
#[derive(Debug, Clone, PartialEq)]
pub enum Region {
    /// A rectangle.
    Rect(Rect),
    /// A disc.
    Disc {
        /// Its centre `(x, y)`, px.
        centre: (f64, f64),
        /// Its radius, px; the edge belongs to it.
        radius: f64,
    },
    /// A polygon of corners `(x, y)`, px, closed from the last to the first; of one that crosses itself the
    /// part that a line from far away enters an odd number of times.
    Polygon(Vec<(f64, f64)>),
    /// The pixels that are true.
    Mask(Mask),
}

impl Region {
    /// # Errors
    /// [`Error::Argument`] naming `region` unless it fits a frame of `size = (width, height)`: a rectangle
    /// inside it, a positive radius, three finite corners or more, a mask of the same size.
    pub fn check(&self, size: (usize, usize)) -> Result<()> {
        let wrong = |expected: &str, got: String| Err(Error::argument("region", expected, got));
        match self {
            Self::Rect(rect) => SamplingGrid::Grid { region: Some(*rect), stride: 1 }.shape(size).map(|_| ()),
            Self::Disc { centre: (x, y), radius } => {
                let is_usable = x.is_finite() && y.is_finite() && radius.is_finite() && *radius > 0.0;
                let got = numbers([x, y, radius]);
                if is_usable { Ok(()) } else { wrong("a disc (x, y, radius) of positive radius, px", got) }
            }
            Self::Polygon(corners) if corners.len() < 3 => {
                wrong("a polygon of at least 3 corners (x, y)", format!("{} corners", corners.len()))
            }
            Self::Polygon(corners) => match corners.iter().find(|(x, y)| !(x.is_finite() && y.is_finite())) {
                Some((x, y)) => wrong("a polygon of finite corners (x, y), px", numbers([x, y])),
                None => Ok(()),
            },
            Self::Mask(mask) if mask.size() == size => Ok(()),
            Self::Mask(mask) => {
                let expected = format!("a mask of the frame's shape ({}, {})", size.1, size.0);
                wrong(&expected, format!("({}, {})", mask.height(), mask.width()))
            }
        }
    }

    /// Whether the pixel `(x, y)` belongs to it. Call [`Region::check`] first.
    pub fn contains(&self, x: usize, y: usize) -> bool {
        let (px, py) = (x as f64, y as f64);
        match self {
            Self::Rect(r) => x >= r.x && y >= r.y && x - r.x < r.width && y - r.y < r.height,
            Self::Disc { centre, radius } => (px - centre.0).hypot(py - centre.1) <= *radius,
            Self::Polygon(corners) => {
                let before = corners.iter().cycle().skip(corners.len().saturating_sub(1));
                let crosses = |(a, b): &(&(f64, f64), &(f64, f64))| {
                    (a.1 > py) != (b.1 > py) && px < a.0 + (py - a.1) / (b.1 - a.1) * (b.0 - a.0)
                };
                corners.iter().zip(before).filter(crosses).count() % 2 == 1
            }
            Self::Mask(mask) => mask.data()[y * mask.width() + x],
        }
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
