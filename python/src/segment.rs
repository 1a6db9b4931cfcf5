//! Graph segmentation for Python; what a user meets is `jacoflow.segment`.

use super::{arrays, samples::exact_samples};
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use crate::options::{self, Integer, named};
use jacoflow::error::{Error, Result, shape_text};
use jacoflow::parallel::Threads;
use jacoflow::segment::{EdgeWeight, SegmentImage, SegmentOptions, felzenszwalb, region_means};
use jacoflow::track::GreyLevels;
use jacoflow::types::{Frame, Sample};
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;

/// Labels beyond which a sum for each would take all memory.
const MAX_LABEL: i64 = 1 << 27;

/// Samples of an array (H, W, channels), row-major, and what turns them into levels.
struct Interleaved<'a, S> {
    size: (usize, usize),
    channels: usize,
    samples: &'a [S],
}

macro_rules! interleaved {
    ($($sample:ty => $real:ty),*) => {$(
        impl SegmentImage for Interleaved<'_, $sample> {
            type Real = $real;
            fn size(&self) -> (usize, usize) {
                self.size
            }
            fn planes(&self) -> Vec<Frame<$real>> {
                let gain = (255.0 / <$sample>::FULL_SCALE) as $real;
                let ((width, height), channels) = (self.size, self.channels);
                let plane = |channel| {
                    let samples = self.samples[channel..].iter().step_by(channels);
                    Frame::new(width, height, samples.map(|&sample| gain * <$real>::from(sample)).collect())
                };
                (0..channels).map(|channel| plane(channel).expect("a sample for every pixel")).collect()
            }
        }
    )*};
}
interleaved!(u8 => f32, u16 => f32, f32 => f32, f64 => f64);

/// The compiled part of `jacoflow.segment.felzenszwalb`: labels (H, W).
#[pyfunction(name = "_felzenszwalb")]
pub fn segment_felzenszwalb<'py>(
    image: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = named::scale)] scale: f64,
    #[pyo3(from_py_with = named::sigma)] sigma: f64,
    min_size: i64,
    #[pyo3(from_py_with = named::threads)] threads: Option<Integer>,
) -> Outcome<Bound<'py, PyAny>> {
    let py = image.py();
    let threads = options::threads(threads)?;
    let min_size = usize::try_from(min_size)
        .map_err(|_| Error::argument("min_size", "a number of pixels, at least 0", min_size))?;
    let options = SegmentOptions { scale, sigma, min_size };
    let array = arrays::unmasked("image", image, GreyLevels::of_integers())?;
    arrays::check_size("image", &array)?;
    let array = exact_samples("image", array)?;
    let shape = array.shape().to_vec();
    let (size, channels) = match shape[..] {
        [height, width] => ((width, height), 1),
        [height, width, channels @ (1 | 3)] => ((width, height), channels),
        _ => return Err(Error::argument("image", "shape (H, W) or (H, W, 3)", shape_text(&shape)).into()),
    };
    macro_rules! of {
        ($($sample:ty),*) => {$(
            if let Some(samples) = arrays::elements::<$sample>(&array) {
                let is_finite = |pixel: &[$sample]| pixel.iter().all(|&sample| f64::from(sample).is_finite());
                if !samples.is_empty() && !samples.chunks_exact(channels).any(is_finite) {
                    return Err(Error::argument("image", "at least one finite pixel", "none").into());
                }
                let image = Interleaved { size, channels, samples: &samples };
                return wrap(py, size, interruptible(py, || labels(&image, &options, threads))?);
            }
        )*};
    }
    of!(u8, u16, f32, f64);
    Err(arrays::wrong_dtype("image", &array).into())
}

fn labels<I: SegmentImage + Sync>(image: &I, options: &SegmentOptions, threads: Threads) -> Result<Vec<i32>>
where
    I::Real: EdgeWeight,
{
    Ok(threads.install(|| felzenszwalb(image, options))?.labels)
}

fn wrap(py: Python<'_>, (width, height): (usize, usize), labels: Vec<i32>) -> Outcome<Bound<'_, PyAny>> {
    arrays::owned(py, &[height, width], labels)
}

/// The compiled part of `jacoflow.segment.region_means`: means (n,) or (n, C). `labels` must be int64.
#[pyfunction(name = "_region_means")]
pub fn segment_region_means<'py>(labels: &Bound<'py, PyAny>, values: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyAny>> {
    let py = labels.py();
    let array = arrays::as_array("labels", labels)?;
    arrays::check_size("labels", &array)?;
    let shape = array.shape().to_vec();
    let (value_shape, values) = arrays::doubles("values", values)?;
    let channels = match value_shape[..] {
        _ if value_shape == shape => 1,
        [height, width, channels] if shape == [height, width] => channels,
        _ => {
            let expected = format!("shape {} as labels, or that and channels", shape_text(&shape));
            return Err(Error::argument("values", expected, shape_text(&value_shape)).into());
        }
    };
    let wide = arrays::elements::<i64>(&array).ok_or_else(|| arrays::wrong_dtype("labels", &array))?;
    if let Some(&wrong) = wide.iter().find(|label| !(0..=MAX_LABEL).contains(*label)) {
        return Err(Error::argument("labels", format!("0 to {MAX_LABEL}"), wrong).into());
    }
    let count = wide.iter().max().map_or(0, |&label| label as usize + 1);
    let means = interruptible(py, || {
        let labels: Vec<i32> = wide.into_iter().map(|label| label as i32).collect();
        region_means(&labels, count, &values, channels)
    })?;
    let shape = [count, channels];
    let shape = if value_shape.len() == 2 { &shape[..1] } else { &shape[..] };
    arrays::owned(py, shape, means)
}
