//! An image's channels as planes in levels 0 to 255, smoothed.

use crate::error::{Error, Result};
use crate::image::GaussianSmoother;
use crate::math::Real;
use crate::simd::SimdReal;
use crate::types::Frame;

/// A pixel: one grey level, or one level a channel.
pub trait SegmentPixel: Copy + Send + Sync {
    /// The precision in which the segmentation is computed.
    type Real: SimdReal;
    /// Number of channels.
    const CHANNELS: usize;
    /// Level of a channel, 0 to 255.
    fn level(&self, channel: usize) -> Self::Real;
}

impl<T: SimdReal> SegmentPixel for T {
    type Real = T;
    const CHANNELS: usize = 1;
    #[inline(always)]
    fn level(&self, _channel: usize) -> T {
        *self
    }
}

impl<T: SimdReal, const N: usize> SegmentPixel for [T; N] {
    type Real = T;
    const CHANNELS: usize = N;
    #[inline(always)]
    fn level(&self, channel: usize) -> T {
        self[channel]
    }
}

/// An image that can be segmented.
pub trait SegmentImage {
    /// The precision in which the segmentation is computed.
    type Real: SimdReal;
    /// `(width, height)`, px.
    fn size(&self) -> (usize, usize);
    /// The channels, each of the image's size, in levels 0 to 255.
    fn planes(&self) -> Vec<Frame<Self::Real>>;
}

impl<P: SegmentPixel> SegmentImage for Frame<P> {
    type Real = P::Real;
    fn size(&self) -> (usize, usize) {
        Frame::size(self)
    }
    fn planes(&self) -> Vec<Frame<P::Real>> {
        (0..P::CHANNELS).map(|channel| self.map(|pixel| pixel.level(channel))).collect()
    }
}

/// The channels of `image` after a Gaussian of standard deviation `sigma` px.
///
/// A pixel with a channel that is not finite becomes NaN in all, and is left out of the smoothing.
pub(super) fn smoothed<I: SegmentImage>(image: &I, sigma: f64) -> Result<Vec<Frame<I::Real>>> {
    let smoother = GaussianSmoother::new(sigma)
        .map_err(|_| Error::argument("sigma", "a standard deviation of at most 4096 px", sigma))?;
    let planes = image.planes();
    let invalid: Vec<usize> =
        (0..planes[0].data().len()).filter(|&pixel| planes.iter().any(|plane| !plane.data()[pixel].finite())).collect();
    if invalid.is_empty() {
        return Ok(if sigma == 0.0 { planes } else { planes.iter().map(|plane| smoother.apply(plane)).collect() });
    }
    Ok(smoothed_without(&smoother, planes, &invalid))
}

/// Normalised convolution: smoothed values over the smoothed share of valid pixels.
fn smoothed_without<T: SimdReal>(
    smoother: &GaussianSmoother,
    planes: Vec<Frame<T>>,
    invalid: &[usize],
) -> Vec<Frame<T>> {
    let (width, height) = planes[0].size();
    let mut valid = Frame::filled(width, height, T::from_f64(1.0));
    for &pixel in invalid {
        valid.data_mut()[pixel] = T::from_f64(0.0);
    }
    let share = smoother.apply(&valid);
    let smooth = |mut plane: Frame<T>| {
        for &pixel in invalid {
            plane.data_mut()[pixel] = T::from_f64(0.0);
        }
        let mut out = smoother.apply(&plane);
        for (value, &share) in out.data_mut().iter_mut().zip(share.data()) {
            *value /= share;
        }
        for &pixel in invalid {
            out.data_mut()[pixel] = T::nan();
        }
        out
    };
    planes.into_iter().map(smooth).collect()
}
