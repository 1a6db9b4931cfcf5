//! `observability`: what theorem 1 of the patent says of every pixel.

use super::arrays;
use super::frame_list::Frames;
use super::image::renamed;
use super::options::{self, Object, PreprocessOptions, named};
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use jacoflow::error::Error;
use jacoflow::flow::{Observability, observability as core};
use jacoflow::jet::TimeScheme;
use jacoflow::types::{AnyFrame, expect_dtype};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Observability of the affine model at every pixel, from three frames.
///
/// Returns a dictionary of arrays (H, W) without units: `rank` of the twelve equations (6: observable),
/// `rank_single` of the six without second time derivatives, `condition` code (see `ObservabilityMap`),
/// `condition_number`, and `known`, false at the border and where a sample is not finite.
#[pyfunction(name = "_observability")]
#[pyo3(signature = (frames, *, time_scheme=None, neighbourhood=None, neighbourhood_sigma=None, preprocess=None, threads=None))]
pub fn observability<'py>(
    frames: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = named::time_scheme)] time_scheme: Option<&str>,
    neighbourhood: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = named::neighbourhood_sigma)] neighbourhood_sigma: Option<f64>,
    preprocess: Object,
    #[pyo3(from_py_with = named::threads)] threads: Option<options::Integer>,
) -> Outcome<Bound<'py, PyDict>> {
    let py = frames.py();
    let preprocess = PreprocessOptions::new(py, &preprocess)?;
    let frames = Frames::new(frames, preprocess.colour)?;
    if frames.count != 3 {
        return Err(Error::argument("frames", "three frames", format!("{} frames", frames.count)).into());
    }
    let frames = [frames.get(0)?, frames.get(1)?, frames.get(2)?];
    for (_, dtype) in &frames[1..] {
        expect_dtype("frames", dtype, frames[0].1)?;
    }
    let frames = frames.map(|(frame, _)| frame);
    let scheme = time_scheme.map_or(Ok(TimeScheme::default()), TimeScheme::parse);
    let pixels = neighbourhood.map(options::neighbourhood).transpose()?;
    let steps = preprocess.steps(None)?;
    let scheme = scheme.map_err(|e| renamed(e, "scheme", "time_scheme"))?;
    let neighbourhood = pixels.unwrap_or_default().weighted(neighbourhood_sigma);
    let threads = options::threads(threads)?;
    macro_rules! map_of {
        ($frames:expr) => {{
            let frames = $frames.map(|frame| threads.install(|| steps.apply(frame)));
            core(frames.each_ref(), scheme, &neighbourhood, threads)
        }};
    }
    let map = interruptible(py, || match &frames {
        [AnyFrame::F64(a), AnyFrame::F64(b), AnyFrame::F64(c)] => map_of!([a, b, c].map(Clone::clone)),
        frames => map_of!(frames.each_ref().map(AnyFrame::to_real::<f32>)),
    })?;
    let known = map.pixels.iter().map(Option::is_some).collect();
    let result = PyDict::new(py);
    let shape = [map.height, map.width];
    let codes = |of: fn(&Observability) -> u8| map.pixels.iter().map(|p| p.as_ref().map_or(0, of)).collect();
    result.set_item("rank", arrays::owned::<u8>(py, &shape, codes(|p| p.rank))?)?;
    result.set_item("rank_single", arrays::owned::<u8>(py, &shape, codes(|p| p.rank_single))?)?;
    result.set_item("condition", arrays::owned::<u8>(py, &shape, codes(|p| p.condition as u8))?)?;
    let numbers = map.pixels.iter().map(|p| p.as_ref().map_or(f64::NAN, |p| p.condition_number)).collect();
    result.set_item("condition_number", arrays::owned::<f64>(py, &shape, numbers)?)?;
    result.set_item("known", arrays::owned::<bool>(py, &shape, known)?)?;
    Ok(result)
}

/// Theorem 1 for one jet (I, Ix, Iy, Ixx, Ixy, Iyy) moving by (u, v, u_x, v_x, u_y, v_y): (condition code,
/// rank_single, rank, condition number).
#[pyfunction(name = "_classify")]
pub fn classify(jet: [f64; 6], motion: [f64; 6]) -> (u8, u8, u8, f64) {
    let found = jacoflow::flow::classify(jet, motion);
    (found.condition as u8, found.rank_single, found.rank, found.condition_number)
}
