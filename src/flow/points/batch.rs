//! Many points, forward and back.

use super::{follow::follow, options::PointFlowOptions, pyramid::PointPyramid, window::Window};
use crate::error::{Error, Result};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::types::Frame;

/// Points of one task. Fixed, though no result depends on it.
const BATCH: usize = 32;

/// Flow at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointFlow {
    /// Flow (u, v), px/frame; NaN if the point is lost.
    pub flow: [f64; 2],
    /// Whether the point was found again and the flow forward and back agrees.
    pub ok: bool,
    /// Distance between the point and where the flow back from its new position leads, px. NaN if the point
    /// is lost on the way or the test is switched off.
    pub error: f64,
    /// Mean absolute difference of brightness between the window and its new place, grey levels; NaN if the
    /// point is lost.
    pub residual: f64,
}

impl PointFlow {
    /// A point that was not found again.
    pub const LOST: Self = Self { flow: [f64::NAN; 2], ok: false, error: f64::NAN, residual: f64::NAN };
}

/// Flow from `before` to `after` at `points` (x, y) px, in their order.
///
/// Minimises `sum (before(q) - after(q + d))^2` over the window around each point by steps
/// `G^-1 sum grad before (before - after)` with `G = sum grad before grad before'` of the window. Levels are
/// passed from the coarsest down (Lucas and Kanade 1981; Bouguet 2000). Samples are bilinear, slopes are
/// central differences of the samples, and the border is replicated, so that a window may hang over it. Only
/// levels whose sides are at least the window are used.
///
/// Flow back from the new position starts without knowledge of the flow forward: from minus `guesses`, or
/// from zero. A point is lost (NaN) if it leaves the picture, if the window has too little structure or
/// touches a sample that is not finite. `guesses`: expected flow (u, v) of each point, px/frame; default
/// zero.
///
/// Parallel over points; identical for any number of threads.
///
/// # Errors
/// [`Error::Argument`] for frames of different size, as many guesses as points not given, or an
/// option out of its range.
pub fn track_points(
    before: &PointPyramid,
    after: &PointPyramid,
    points: &[[f64; 2]],
    guesses: Option<&[[f64; 2]]>,
    options: &PointFlowOptions,
) -> Result<Vec<PointFlow>> {
    options.check()?;
    if before.size() != after.size() {
        return Err(Error::argument("after", format!("size {:?}", before.size()), format!("{:?}", after.size())));
    }
    if let Some(guesses) = guesses.filter(|guesses| guesses.len() != points.len()) {
        return Err(Error::argument("guesses", format!("{} flows, one a point", points.len()), guesses.len()));
    }
    let count = useful_levels(before, options).min(useful_levels(after, options));
    let planes = (&before.planes()[..count], &after.planes()[..count]);
    let mut flows = vec![PointFlow::LOST; points.len()];
    if before.frame().data().is_empty() {
        return Ok(flows);
    }
    let level = options.simd.unwrap_or_else(Level::detect);
    let batches = flows.chunks_mut(BATCH).zip(points.chunks(BATCH)).enumerate();
    parallel::for_each(batches, |(batch, (flows, points))| {
        let guesses = guesses.map(|guesses| &guesses[batch * BATCH..][..points.len()]);
        dispatch(level, Batch { planes, points, guesses, options, flows });
    });
    Ok(flows)
}

/// Number of levels that are used: at least the full size.
fn useful_levels(pyramid: &PointPyramid, options: &PointFlowOptions) -> usize {
    let fits = |frame: &&Frame<f32>| frame.width().min(frame.height()) >= options.window;
    pyramid.planes().iter().take(options.levels).take_while(fits).count().max(1)
}

/// Some points with their results.
struct Batch<'a> {
    planes: (&'a [Frame<f32>], &'a [Frame<f32>]),
    points: &'a [[f64; 2]],
    guesses: Option<&'a [[f64; 2]]>,
    options: &'a PointFlowOptions,
    flows: &'a mut [PointFlow],
}

impl Kernel<f32> for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(self) {
        let Self { planes: (before, after), points, guesses, options, flows } = self;
        let mut window = Window::new::<V>(options.window);
        for (i, (&point, out)) in points.iter().zip(flows).enumerate() {
            let guess = guesses.map_or([0.0; 2], |guesses| guesses[i]);
            let Some(flow) = follow::<V>(&mut window, (before, after), point, guess, options) else { continue };
            let found = [point[0] + flow[0], point[1] + flow[1]];
            // The window still holds the full size of the first frame.
            let residual = window.residual::<V>(&after[0], found);
            let (error, ok) = if options.forward_backward.is_infinite() {
                (f64::NAN, residual.is_finite())
            } else {
                let back = follow::<V>(&mut window, (after, before), found, guess.map(|g| -g), options);
                let error = back.map_or(f64::NAN, |back| (flow[0] + back[0]).hypot(flow[1] + back[1]));
                (error, error <= options.forward_backward)
            };
            *out = PointFlow { flow, ok: ok && residual.is_finite(), error, residual };
        }
    }
}
