//! Segmentation of an image into regions of similar colour, by greedy merging of a pixel graph.
//!
//! Source: P. F. Felzenszwalb and D. P. Huttenlocher, "Efficient graph-based image segmentation",
//! International Journal of Computer Vision 59(2), 2004, section 4. Two regions are merged if the lightest
//! edge between them is no heavier than the heaviest edge inside each of them, plus `k / size`.
//!
//! The steps, one file each: `planes` (channels in levels, smoothed), `edges` (weights of the 8-connected
//! grid), `sort` (stable, by weight), `forest` (the merging), `labels` (numbering, means over regions).

mod edges;
mod forest;
mod labels;
mod options;
mod planes;
mod sort;

pub use edges::EdgeWeight;
pub use labels::{Labels, region_means};
pub use options::SegmentOptions;
pub use planes::{SegmentImage, SegmentPixel};

use crate::error::{Error, Result};
use edges::grid_edges;
use forest::Forest;
use sort::sort_by_weight;

/// Pixels beyond which an edge's number no longer fits into 32 bits.
const MAX_PIXELS: usize = 1 << 30;

/// Segments an image into regions of similar colour.
///
/// Each channel is smoothed by a Gaussian (reflecting border, cut off at 4 sigma). Neighbours, diagonal ones
/// included, are joined by edges whose weight is the Euclidean distance of their colours. The edges are taken
/// in order of weight, equal weights in the order right, lower, lower right, upper right neighbour, each
/// row-major. An edge of weight `e` merges its two regions if `e <= min(Int_1 + k / |C_1|, Int_2 + k /
/// |C_2|)` (the paper's (4) and (5)), where `Int` is the heaviest edge merged so far and `|C|` the number of
/// pixels. Then, in the same order, regions that an edge joins are merged while one of them has fewer than
/// `min_size` pixels.
///
/// `image`: levels 0 to 255 (grey or colour). Pixels that are not finite are left out of the smoothing; their
/// edges come last and merge nothing but regions smaller than `min_size`. `f32` images are computed in
/// single, `f64` images in double precision. The result is bit-identical for any number of threads; call this
/// inside [`Threads::install`](crate::parallel::Threads::install) to choose it.
///
/// # Errors
/// [`Error::Argument`] for an option out of range, or an image without pixels or with more than 2^30.
pub fn felzenszwalb<I>(image: &I, options: &SegmentOptions) -> Result<Labels>
where
    I: SegmentImage,
    I::Real: EdgeWeight,
{
    options.check()?;
    let (width, height) = image.size();
    if width == 0 || height == 0 || width.saturating_mul(height) > MAX_PIXELS {
        let expected = format!("from 1 to {MAX_PIXELS} pixels");
        return Err(Error::argument("image", expected, format!("{height} x {width} pixels")));
    }
    let planes = planes::smoothed(image, options.sigma)?;
    let mut edges = grid_edges(&planes, width, height);
    drop(planes);
    sort_by_weight(&mut edges);
    let mut forest = Forest::new(width, height, I::Real::from_scale(options.scale));
    let rejected = forest.merge_similar(&edges);
    forest.merge_small(&rejected, options.min_size);
    Ok(Labels::of_roots(width, height, |pixel| forest.root(pixel)))
}
