//! Frames without holes, so that splines and pyramids of them are finite everywhere.

use crate::math::Real;
use crate::parallel::for_each_band;
use crate::types::{Frame, Mask};
use std::borrow::Cow;

/// Which pixels of `frame` are finite and allowed by `usable`; a mask of another size allows all.
pub fn usable_pixels<T: Real>(frame: &Frame<T>, usable: Option<&Mask>) -> Mask {
    let mut mask = match usable {
        Some(usable) if usable.size() == frame.size() => usable.clone(),
        _ => Frame::filled(frame.width(), frame.height(), true),
    };
    for (usable, value) in mask.data_mut().iter_mut().zip(frame.data()) {
        *usable &= finite(*value);
    }
    mask
}

/// The frame with every pixel that is not finite or not allowed by `usable` replaced by a smooth continuation
/// of those around it; all zero when there are none. A frame without such pixels is handed through. A mask of
/// another size allows everything: to refuse it is for others.
///
/// Averages of the usable pixels of 2 x 2 are taken until no hole is left; then the holes of each finer frame
/// are filled from the coarser one, bilinearly (S. J. Gortler, R. Grzeszczuk, R. Szeliski, M. F. Cohen, "The
/// lumigraph", 1996, section 3.4). Identical for any number of threads.
pub fn fill_holes<'a, T: Real>(frame: &'a Frame<T>, usable: Option<&Mask>) -> Cow<'a, Frame<T>> {
    let allowed = usable.is_none_or(|mask| mask.size() != frame.size() || all(mask));
    // Without a short circuit, so that the compiler may use lanes.
    if allowed && frame.data().iter().fold(true, |so_far, &value| so_far & finite(value)) {
        return Cow::Borrowed(frame);
    }
    let mut filled = frame.clone();
    for (value, usable) in filled.data_mut().iter_mut().zip(usable_pixels(frame, usable).data()) {
        *value = if *usable { *value } else { T::nan() };
    }
    fill(&mut filled);
    Cow::Owned(filled)
}

fn all(mask: &Mask) -> bool {
    mask.data().iter().fold(true, |so_far, &usable| so_far & usable)
}

/// Neither NaN nor infinite, by one multiplication.
#[inline(always)]
fn finite<T: Real>(value: T) -> bool {
    let zero = T::from_f64(0.0);
    value * zero == zero
}

/// Fills the holes of `frame`, which are NaN.
fn fill<T: Real>(frame: &mut Frame<T>) {
    if frame.data().iter().fold(true, |so_far, &value| so_far & finite(value)) {
        return;
    }
    let (width, height) = frame.size();
    if width * height == 1 {
        frame.data_mut().fill(T::from_f64(0.0));
        return;
    }
    let mut coarse = average(frame);
    fill(&mut coarse);
    for_each_band(frame.data_mut(), width, |_, rows, output| {
        for (y, row) in rows.zip(output.chunks_exact_mut(width)) {
            for (x, value) in row.iter_mut().enumerate().filter(|(_, value)| !finite(**value)) {
                *value = interpolate(&coarse, x, y);
            }
        }
    });
}

/// Averages of the finite pixels of each 2 x 2; NaN where there are none.
fn average<T: Real>(frame: &Frame<T>) -> Frame<T> {
    let (width, height) = frame.size();
    let mut out = Frame::filled(width.div_ceil(2), height.div_ceil(2), T::from_f64(0.0));
    let (out_width, zero) = (out.width(), T::from_f64(0.0));
    let shares: [T; 5] = [f64::NAN, 1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0].map(T::from_f64);
    for_each_band(out.data_mut(), out_width, |_, rows, output| {
        for (y, row) in rows.zip(output.chunks_exact_mut(out_width)) {
            // At an odd edge the last pixels count twice, which their average does not notice.
            let (top, bottom) = (frame.row(2 * y), frame.row((2 * y + 1).min(height - 1)));
            for ((out, top), bottom) in row.iter_mut().zip(top.chunks(2)).zip(bottom.chunks(2)) {
                let four = [top[0], top[top.len() - 1], bottom[0], bottom[bottom.len() - 1]];
                let share = shares[four.iter().map(|&value| usize::from(finite(value))).sum::<usize>()];
                // Each is divided before they are summed: the average of large numbers must not overflow.
                *out = four.iter().map(|&value| if finite(value) { value } else { zero } * share).sum();
            }
        }
    });
    out
}

/// The value at pixel `(x, y)` of a frame of twice the size, whose 2 x 2 pixels share the place of one here.
fn interpolate<T: Real>(coarse: &Frame<T>, x: usize, y: usize) -> T {
    let (x_near, x_far) = neighbours(x, coarse.width());
    let (y_near, y_far) = neighbours(y, coarse.height());
    let (near, far) = (T::from_f64(0.75), T::from_f64(0.25));
    let along = |y: usize| coarse.get(x_near, y) * near + coarse.get(x_far, y) * far;
    along(y_near) * near + along(y_far) * far
}

/// The coarse pixel that fine pixel `i` is part of, and the next on `i`'s side.
fn neighbours(i: usize, len: usize) -> (usize, usize) {
    let near = i / 2;
    let far = if i.is_multiple_of(2) { near.saturating_sub(1) } else { (near + 1).min(len - 1) };
    (near, far)
}
