//! Views along the motion: their mean, their rate, and where all of them are usable.

use super::{View, scratch::Columns, scratch::IN_ORDER, scratch::LEFT};
use crate::simd::{Lanes, SimdReal};
use crate::types::Mask;

/// Maximum number of lanes of a vector.
const MAX_LANES: usize = 16;

/// Mean and rate of the views in row `y` of a level, and 1 where every view is usable, to a row `image` of
/// the planes `A, R, u, v`, validity, of which `u` and `v` are given. `frame`: numbers of the columns, and 1
/// inside the border.
#[inline(always)]
pub(super) fn warp_row<T: SimdReal, V: Lanes<Scalar = T>>(
    views: &[View<'_, T>],
    (size, y): ((usize, usize), usize),
    columns: &Columns,
    frame: [&[T]; 2],
    (in_order, image): (&mut [T], &mut [T]),
) {
    let (row, n) = (V::constant(y as f64), 2 * columns.count);
    // In the order of the columns, neighbours read neighbouring pixels, which is one load for all.
    let [u, v, mean, rate, valid]: [&mut [T]; IN_ORDER] = lines(in_order, columns.row(1), n);
    let halves = |k: usize| [0, 1].map(|h| columns.samples(k, h));
    for (line, k) in [&mut *u, &mut *v].into_iter().zip([2, 3]) {
        let [even, odd] = halves(k);
        for (pair, (&even, &odd)) in line.chunks_exact_mut(2).zip(image[even].iter().zip(&image[odd])) {
            pair.copy_from_slice(&[even, odd]);
        }
    }
    let [number, inside] = frame.map(|line| &line[..n]);
    let mut at = 0;
    while at + V::LANES <= n {
        let (u, v, column) = (V::load(&u[at..]), V::load(&v[at..]), V::load(&number[at..]));
        let [a, r, seen] = sample_views(views, size, [column, row], [u, v], V::load(&inside[at..]));
        a.store(&mut mean[at..]);
        r.store(&mut rate[at..]);
        seen.store(&mut valid[at..]);
        at += V::LANES;
    }
    for (line, k) in [mean, rate, valid].into_iter().zip([0, 1, 4]) {
        let (even, odd) = image.split_at_mut((2 * k + 1) * columns.half);
        let (even, odd) = (&mut even[columns.samples(k, 0)], &mut odd[LEFT..LEFT + columns.count]);
        for (pair, (even, odd)) in line.chunks_exact(2).zip(even.iter_mut().zip(odd)) {
            (*even, *odd) = (pair[0], pair[1]);
        }
    }
}

/// Mean and rate of the views at positions moved by `flow`, and `seen` where every view is usable, else 0.
#[inline(always)]
pub(in crate::flow::coarse_to_fine) fn sample_views<T: SimdReal, V: Lanes<Scalar = T>>(
    views: &[View<'_, T>],
    (width, height): (usize, usize),
    position: [V; 2],
    flow: [V; 2],
    mut seen: V,
) -> [V; 3] {
    let (right, low) = (V::constant(width as f64 - 2.0), V::constant(height as f64 - 2.0));
    let (mut mean, mut rate) = (V::zero(), V::zero());
    for view in views {
        let time = V::splat(view.time);
        let (x, y) = (flow[0].mul_add(time, position[0]), flow[1].mul_add(time, position[1]));
        seen = within(x, right, within(y, low, seen));
        if let Some(mask) = view.usable {
            seen = hide(mask, x, y, seen);
        }
        let brightness = view.spline.sample_in(x, y);
        mean = brightness.mul_add(V::splat(view.mean), mean);
        rate = brightness.mul_add(V::splat(view.rate), rate);
    }
    [mean, rate, seen]
}

/// The first `n` samples of every `stride`.
#[inline(always)]
fn lines<T, const COUNT: usize>(mut rest: &mut [T], stride: usize, n: usize) -> [&mut [T]; COUNT] {
    std::array::from_fn(|_| {
        let (line, after) = std::mem::take(&mut rest).split_at_mut(stride);
        rest = after;
        &mut line[..n]
    })
}

/// `seen` where the position lies in `1..=last`, else 0.
#[inline(always)]
fn within<V: Lanes>(position: V, last: V, seen: V) -> V {
    let inner = V::select(last.lt(position), V::zero(), seen);
    V::select(position.lt(V::constant(1.0)), V::zero(), inner)
}

/// `seen` where the pixel nearest to the position may be used, else 0.
#[inline(always)]
fn hide<T: SimdReal, V: Lanes<Scalar = T>>(mask: &Mask, x: V, y: V, seen: V) -> V {
    let mut buffers = [[T::from_f64(0.0); MAX_LANES]; 3];
    let [xs, ys, kept] = &mut buffers;
    x.store(xs);
    y.store(ys);
    seen.store(kept);
    for l in 0..V::LANES {
        if !is_usable(mask, xs[l], ys[l]) {
            kept[l] = T::from_f64(0.0);
        }
    }
    V::load(kept)
}

/// Whether the pixel nearest to the position may be used.
pub(in crate::flow::coarse_to_fine) fn is_usable<T: SimdReal>(mask: &Mask, x: T, y: T) -> bool {
    let (column, row) = ((x.to_f64() + 0.5) as usize, (y.to_f64() + 0.5) as usize);
    column < mask.width() && row < mask.height() && mask.get(column, row)
}
