//! Robust regional means: typical values around a site, insensitive to a few outliers.
//!
//! The mean is a power mean `(G * f^p)^(1/p)`: p = 1/4 is near a median, p = -1/4 near the calm part.

use super::RefineOptions;
use super::fit::{FIT, pick, smooth_row};
use super::ladder::{Ladder, MAX_OCTAVE, Taps};
use crate::flow::coarse_to_fine::data_term::{ENERGY, UU, UV, VV};
use crate::flow::coarse_to_fine::extended::{Continuation, Field, RIM};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{LEFT, Planes};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Added before a root is taken, in the square of the quantity's unit.
const ROOT_OFFSET: f64 = 1e-12;

/// Planes of regional means, on the coarsest grid: those of Puu, Puv, Pvv, of the root of e, then (per step
/// of the ladder) of the root of the change and of its inverse, then (per window) of the inverse root of the
/// misfit.
pub(super) struct Layout {
    pub windows: usize,
    /// Steps from each window to the next; from the widest to zero as well, if the field may vanish.
    pub steps: usize,
}

impl Layout {
    pub const ENERGY: usize = 3;
    pub fn new(options: &RefineOptions) -> Self {
        let windows = options.ladder.len();
        Self { windows, steps: if options.may_vanish { windows } else { windows.saturating_sub(1) } }
    }
    pub fn change(l: usize) -> usize {
        4 + l
    }
    pub fn calm(&self, l: usize) -> usize {
        4 + self.steps + l
    }
    pub fn misfit(&self, l: usize) -> usize {
        4 + 2 * self.steps + l
    }
    pub fn count(&self) -> usize {
        4 + 2 * self.steps + self.windows
    }
}

enum Item<'a, T> {
    /// A plane of the data term.
    Data(usize),
    /// The fourth root of the residual energy.
    Energy(usize),
    /// The fourth root, and its inverse, of the squared change from one window to the next, or to zero.
    Change((&'a Field<T>, usize), Option<(&'a Field<T>, usize)>),
    /// The inverse fourth root of the misfit.
    Misfit(&'a Field<T>, usize),
}

/// Items of one grid with the planes of the [`Layout`] they go to and their windows.
struct Features<'a, T> {
    items: Vec<Item<'a, T>>,
    targets: Vec<(usize, Taps<T>)>,
}

/// Fields of every window of a ladder, finest first.
pub(super) struct Fitted<'a, T> {
    pub fits: &'a [Field<T>],
    /// The smoothed flow on the window's own grid or, from the finest, at every second site.
    pub samples: Vec<Field<T>>,
}

/// The regional means of all planes of the [`Layout`], on every fourth site.
pub(super) fn regional_means<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    options: &RefineOptions,
    ladder: &Ladder<T>,
    fitted: &Fitted<'_, T>,
    data: &Planes<T>,
) -> Planes<T> {
    let layout = Layout::new(options);
    let quarter = |n: usize| n.div_ceil(1 << MAX_OCTAVE);
    let mut out = space.planes(quarter(data.width), quarter(data.height), layout.count());
    for octave in 1..=MAX_OCTAVE {
        let features = collect(options, ladder, fitted, octave);
        if features.items.is_empty() {
            continue;
        }
        let half = |n: usize| n.div_ceil(1 << octave);
        let mut field = Field::make(space, half(data.width), half(data.height), features.targets.len());
        let (len, stride, width) = (field.row_len(), field.stride(), field.width);
        let (items, step) = (features.items.as_slice(), 1 << octave);
        for_each_band(field.rows_mut(), len, |_, rows, out| {
            dispatch(simd, Roots { items, data, step, rows, out, stride, width });
        });
        field.extend(0..features.targets.len(), Continuation::Even, RIM);
        let (len, stride, width, step) = (out.row_len(), out.stride(), out.width, 1 << (MAX_OCTAVE - octave));
        let (from, targets) = (&field, features.targets.as_slice());
        for_each_band(out.data_mut(), len, |_, rows, out| {
            dispatch(simd, Means { from, targets, step, rows, out, len, stride, width });
        });
        Field::keep(space, [field]);
    }
    out
}

fn collect<'a, T: SimdReal>(
    options: &RefineOptions,
    ladder: &Ladder<T>,
    fitted: &'a Fitted<'_, T>,
    octave: usize,
) -> Features<'a, T> {
    let layout = Layout::new(options);
    let taps = |px: f64| Taps::gaussian(px / (ladder.pitch * f64::from(1 << octave as u32)), 1.0);
    let (mut items, mut targets) = (Vec::new(), Vec::new());
    if octave == 1 {
        items.extend([Item::Data(UU), Item::Data(UV), Item::Data(VV), Item::Energy(ENERGY)]);
        targets.extend((0..=Layout::ENERGY).map(|k| (k, taps(options.noise_region))));
    }
    let grid_octave: Vec<usize> = ladder.scales.iter().map(|s| s.octave.max(1)).collect();
    for l in 0..layout.steps {
        let next = (l + 1).min(layout.windows - 1);
        if grid_octave[next] == octave {
            let finer = (&fitted.samples[l], 1 << (octave - grid_octave[l]));
            items.push(Item::Change(finer, (next > l).then(|| (&fitted.samples[next], 1))));
            targets.push((Layout::change(l), taps(options.region)));
            targets.push((layout.calm(l), taps(options.calm_region)));
        }
    }
    for (l, scale) in ladder.scales.iter().enumerate() {
        if grid_octave[l] == octave {
            items.push(Item::Misfit(&fitted.fits[l], 1 << (octave - scale.octave)));
            targets.push((layout.misfit(l), taps(options.misfit_region)));
        }
    }
    Features { items, targets }
}

struct Roots<'a, T> {
    items: &'a [Item<'a, T>],
    data: &'a Planes<T>,
    /// Distance of these sites on the finest grid.
    step: usize,
    rows: Range<usize>,
    out: &'a mut [T],
    stride: usize,
    width: usize,
}

impl<T: SimdReal> Kernel<T> for Roots<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { items, data, step, rows, out, stride, width } = self;
        let mut buffer = vec![T::from_f64(0.0); 4 * stride];
        let planes = items.iter().map(|item| if let Item::Change(..) = item { 2 } else { 1 }).sum::<usize>();
        for (y, out) in rows.zip(out.chunks_exact_mut(planes * stride)) {
            let mut lines = out.chunks_exact_mut(stride).map(|line| &mut line[LEFT..]);
            for item in items {
                let Some(line) = lines.next() else { return };
                match item {
                    Item::Data(k) => pick(row_values(data, *k, step * y), step, &mut line[..width]),
                    Item::Energy(k) => {
                        pick(row_values(data, *k, step * y), step, &mut buffer[..width]);
                        roots::<V>(&buffer, line);
                    }
                    Item::Change(finer, coarser) => {
                        buffer[2 * stride..].fill(T::from_f64(0.0));
                        for (n, (field, step)) in [finer].into_iter().chain(coarser).enumerate() {
                            for k in 0..2 {
                                let source = &field.line(k, (step * y) as isize)[LEFT..];
                                pick(source, *step, &mut buffer[(2 * n + k) * stride..][..width]);
                            }
                        }
                        let (finer, coarser) = buffer.split_at_mut(2 * stride);
                        squares::<V>(finer, coarser, stride);
                        roots::<V>(finer, line);
                        let Some(inverse) = lines.next() else { return };
                        invert::<V>(line, inverse);
                    }
                    Item::Misfit(fits, step) => {
                        let source = &fits.line(FIT - 1, (step * y) as isize)[LEFT..];
                        pick(source, *step, &mut buffer[..width]);
                        roots::<V>(&buffer, line);
                        for x in (0..line.len()).step_by(V::LANES) {
                            (V::constant(1.0) / V::load(&line[x..])).store(&mut line[x..]);
                        }
                    }
                }
            }
        }
    }
}

/// The sites of a row, and the samples after the last.
#[inline(always)]
fn row_values<T: SimdReal>(data: &Planes<T>, k: usize, y: usize) -> &[T] {
    &data.row(y)[k * data.stride() + LEFT..]
}

/// `|finer - coarser|^2` of two pairs of lines into the first of `finer`.
#[inline(always)]
fn squares<V: Lanes>(finer: &mut [V::Scalar], coarser: &[V::Scalar], stride: usize) {
    for x in (0..stride).step_by(V::LANES) {
        let u = V::load(&finer[x..]) - V::load(&coarser[x..]);
        let v = V::load(&finer[stride + x..]) - V::load(&coarser[stride + x..]);
        u.mul_add(u, v * v).store(&mut finer[x..]);
    }
}

/// Fourth roots of positive values, to the end of `out`.
#[inline(always)]
fn roots<V: Lanes>(values: &[V::Scalar], out: &mut [V::Scalar]) {
    for x in (0..out.len()).step_by(V::LANES) {
        (V::load(&values[x..]).max(V::zero()) + V::constant(ROOT_OFFSET)).sqrt().sqrt().store(&mut out[x..]);
    }
}

#[inline(always)]
fn invert<V: Lanes>(values: &[V::Scalar], out: &mut [V::Scalar]) {
    for x in (0..out.len()).step_by(V::LANES) {
        (V::constant(1.0) / V::load(&values[x..])).store(&mut out[x..]);
    }
}

/// Gaussian means at every `step`-th site.
struct Means<'a, T> {
    from: &'a Field<T>,
    targets: &'a [(usize, Taps<T>)],
    step: usize,
    rows: Range<usize>,
    out: &'a mut [T],
    len: usize,
    stride: usize,
    width: usize,
}

impl<T: SimdReal> Kernel<T> for Means<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { from, targets, step, rows, out, len, stride, width } = self;
        let mut buffer = vec![T::from_f64(0.0); 2 * from.stride()];
        for (y, out) in rows.zip(out.chunks_exact_mut(len)) {
            for (k, (target, taps)) in targets.iter().enumerate() {
                smooth_row::<V>(from, k, step * y, taps, &mut buffer);
                pick(&buffer[from.stride()..], step, &mut out[target * stride + LEFT..][..width]);
            }
        }
    }
}
