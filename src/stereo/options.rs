//! Options of edge disparity.

use crate::error::{Error, Result};
use crate::parallel::Threads;
use crate::types::{Frame, choices};

/// Smallest side of a view, px: the window of the gradient.
pub const MIN_VIEW_SIDE: usize = 17;
/// Widest window of the class matching, px: its rows are compared 32 pixels at a time.
const MAX_WINDOW: usize = 31;
/// Most disparities, and most rows, that can be searched.
const MAX_CANDIDATES: i64 = 1024;

/// Matching method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Agreement of the classes of gradient direction in a window, section 3 of the stereo paper: whole
    /// disparities, each with a row offset of its own.
    Classes,
    /// Gradients compared and smoothed along chains of edge pixels from eight sides, checked from the right
    /// view, refined to fractions of a pixel. A gain of the right view is removed first. The default.
    #[default]
    SemiGlobal,
}

choices!(Method, "method": Classes "classes", SemiGlobal "sgm");

/// Options of [`edge_disparity`](super::edge_disparity) and
/// [`estimate_row_offset`](super::estimate_row_offset). Grey levels are those of 8 bit.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeDisparityOptions {
    /// Method; default [`Method::SemiGlobal`].
    pub method: Method,
    /// Least and greatest disparity `x_left - x_right`, px, both included; default -40 to 24.
    pub disparity_range: (i32, i32),
    /// Least and greatest row offset `y_right - y_left`, rows, both included, that are searched where
    /// `row_offset` is not given; default -4 to 4.
    pub row_range: (i32, i32),
    /// Row offset of the right view, rows. `None` (default): searched at every pixel by [`Method::Classes`],
    /// estimated first for [`Method::SemiGlobal`]. The class matching rounds it.
    pub row_offset: Option<f64>,
    /// Fractions of a pixel ([`Method::SemiGlobal`] only; classes give whole px); default true.
    pub subpixel: bool,
    /// Keep only what matching from the right view confirms ([`Method::SemiGlobal`] only); default true.
    pub left_right_check: bool,
    /// Expected disparity of every left pixel, px; NaN or `None` (default): no expectation.
    pub prior: Option<Frame<f32>>,
    /// Search radius about the expected disparity, px; default 3.
    pub prior_radius: u32,
    /// Standard deviation of the Gaussian of gradients and edges, px; default 2, cut off at four times.
    pub blur_sigma: f64,
    /// Least magnitude of the gradient that has a direction, grey levels/px; default 2.
    pub threshold: f64,
    /// Signed classes of gradient direction over the whole turn; default 12, of 30 degrees each.
    pub classes: usize,
    /// Side of the window of the class matching, px, odd; default 17.
    pub window: usize,
    /// Least share of the window's classed pixels that agree; default 0.3.
    pub min_support: f64,
    /// Threads; the result is the same for any number.
    pub threads: Threads,
}

impl Default for EdgeDisparityOptions {
    fn default() -> Self {
        Self {
            method: Method::default(),
            disparity_range: (-40, 24),
            row_range: (-4, 4),
            row_offset: None,
            subpixel: true,
            left_right_check: true,
            prior: None,
            prior_radius: 3,
            blur_sigma: 2.0,
            threshold: 2.0,
            classes: 12,
            window: 17,
            min_support: 0.3,
            threads: Threads::default(),
        }
    }
}

/// Checks a range of candidates.
fn check_range(name: &'static str, (least, greatest): (i32, i32)) -> Result<()> {
    let count = i64::from(greatest) - i64::from(least) + 1;
    let far = i64::from(least).abs().max(i64::from(greatest).abs());
    if (1..=MAX_CANDIDATES).contains(&count) && far <= 1 << 15 {
        return Ok(());
    }
    let expected = format!("least and greatest px, at most {MAX_CANDIDATES} values within 32768 px of 0");
    Err(Error::argument(name, expected, format!("({least}, {greatest})")))
}

impl EdgeDisparityOptions {
    /// Checks every option by itself.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        check_range("disparity_range", self.disparity_range)?;
        check_range("row_range", self.row_range)?;
        if let Some(rows) = self.row_offset.filter(|rows| rows.is_nan() || rows.abs() > 32768.0) {
            return Err(Error::argument("row_offset", "rows, finite and within 32768 of 0", rows));
        }
        if !(0.5..=16.0).contains(&self.blur_sigma) {
            return Err(Error::argument("blur_sigma", "0.5 to 16 px", self.blur_sigma));
        }
        if !(self.threshold > 0.0 && self.threshold.is_finite()) {
            return Err(Error::argument("threshold", "grey levels/px, above 0 and finite", self.threshold));
        }
        if !(2..=64).contains(&self.classes) {
            return Err(Error::argument("classes", "2 to 64 directions", self.classes));
        }
        if !(3..=MAX_WINDOW).contains(&self.window) || self.window.is_multiple_of(2) {
            return Err(Error::argument("window", format!("an odd number, 3 to {MAX_WINDOW} px"), self.window));
        }
        if !(0.0..=1.0).contains(&self.min_support) {
            return Err(Error::argument("min_support", "a share, 0 to 1", self.min_support));
        }
        self.threads.check().map(|_| ())
    }

    /// Checks the options and that both views, and the prior, fit one another.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option or, with both shapes, `right`.
    pub(super) fn check_views(&self, left: &Frame<f32>, right: &Frame<f32>) -> Result<()> {
        self.check()?;
        let shape = |frame: &Frame<f32>| format!("({}, {})", frame.height(), frame.width());
        let got = || format!("left {} and right {}", shape(left), shape(right));
        if left.size() != right.size() {
            return Err(Error::argument("right", "two views (H, W) of one size", got()));
        }
        if left.width().min(left.height()) < MIN_VIEW_SIDE {
            return Err(Error::argument(
                "right",
                format!("views of at least {MIN_VIEW_SIDE} x {MIN_VIEW_SIDE} px"),
                got(),
            ));
        }
        match &self.prior {
            Some(prior) if prior.size() != left.size() => {
                let expected = format!("the views' shape {}", shape(left));
                Err(Error::argument("prior", expected, format!("shape {}", shape(prior))))
            }
            _ => Ok(()),
        }
    }

    /// Candidates at a pixel, px, both included; none if the expectation lies outside the range.
    pub(super) fn candidates(&self, x: usize, y: usize) -> Option<(i32, i32)> {
        let (least, greatest) = self.disparity_range;
        let expected = self.prior.as_ref().map_or(f32::NAN, |prior| prior.get(x, y));
        if !expected.is_finite() {
            return Some((least, greatest));
        }
        let (near, reach) = (f64::from(expected), f64::from(self.prior_radius));
        let low = (near - reach).ceil().max(f64::from(least)) as i32;
        let high = (near + reach).floor().min(f64::from(greatest)) as i32;
        (low <= high).then_some((low, high))
    }
}
