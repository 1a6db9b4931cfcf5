//! What rounding alone leaves of a constant image.

use crate::jet::Reach;
use crate::math::Real;
use crate::types::Frame;

/// Sums of squared gradients below this are rounding noise of samples of this size.
fn of_magnitude<T>(largest: f64) -> f64 {
    let epsilon = if size_of::<T>() == 4 { f64::from(f32::EPSILON) } else { f64::EPSILON };
    (8.0 * epsilon * largest).powi(2)
}

/// The floor that holds everywhere: that of the largest sample.
pub(super) fn of_frames<'a, T: Real + 'a>(frames: impl Iterator<Item = &'a Frame<T>>) -> f64 {
    of_magnitude::<T>(frames.map(|frame| largest_magnitude(frame.data())).fold(0.0, f64::max))
}

/// The floor at `(x, y)`: that of the samples which the window of this radius touches. One pixel without data
/// must not hide the rest of the frame.
pub(super) fn about<T: Real>(frames: &[&Frame<T>], (x, y): (usize, usize), radius: usize, reach: Reach) -> f64 {
    let span = |at: usize, before: usize, after: usize, n: usize| {
        at.saturating_sub(radius + before)..(at + radius + after + 1).min(n)
    };
    let mut largest = 0.0;
    for frame in frames {
        let (width, height) = frame.size();
        for row in span(y, reach.up, reach.down, height) {
            let columns = span(x, reach.left, reach.right, width);
            largest = largest_magnitude(&frame.row(row)[columns]).max(largest);
        }
    }
    of_magnitude::<T>(largest)
}

/// Largest finite magnitude.
fn largest_magnitude<T: Real>(data: &[T]) -> f64 {
    let mut largest = [T::default(); 16];
    let mut chunks = data.chunks_exact(16);
    for chunk in &mut chunks {
        for (greatest, v) in largest.iter_mut().zip(chunk) {
            let magnitude = if *v < T::default() { -*v } else { *v };
            *greatest = if magnitude > *greatest { magnitude } else { *greatest };
        }
    }
    let greatest = largest.iter().chain(chunks.remainder()).map(|v| v.to_f64().abs()).fold(0.0, f64::max);
    if greatest.is_finite() {
        return greatest;
    }
    data.iter().map(|v| v.to_f64().abs()).filter(|v| v.is_finite()).fold(0.0, f64::max)
}
