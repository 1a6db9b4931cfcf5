//! From frames to planes of products, one tile at a time, small enough for the processor's caches.

use super::{combine::Combination, equations::Jets, equations::products, plan::Plan, support::Support};
use crate::flow::moment_filter::CHUNK;
use crate::jet::{JetRows, Reach};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;
use std::ops::Range;

/// Columns of a tile.
pub(super) const TILE_COLUMNS: usize = 128;
/// Rows whose moments are held at a time: while they are summed, the products they share stay in the nearest
/// cache.
pub(super) const GROUP_ROWS: usize = 8;
/// Most rows of one parallel task; fixed, so that threads cannot change a result.
const TASK_ROWS: usize = 64;

/// Writes the motion from a pixel on along its row: six rows of equal length, in px and frames.
pub(super) type MotionRow<'a, T> = dyn Fn(isize, isize, &mut [T]) + Sync + 'a;

/// The images and how to take their jets.
#[derive(Clone)]
pub(super) struct Source<'a, T> {
    /// Frames, oldest first, smoothed already where that is an option.
    pub frames: Vec<&'a Frame<T>>,
    /// How they are combined.
    pub combination: Combination,
    /// The stencil.
    pub jets: JetRows<T>,
    /// Its reach.
    pub reach: Reach,
    /// Usable pixels.
    pub support: &'a Support,
    /// Equations a pixel: 1, 3, 6 or 12.
    pub rows: usize,
    /// Motion of each pixel that the frames lack, to be put back.
    pub carried: Option<&'a MotionRow<'a, T>>,
    /// Instruction set.
    pub level: Level,
}

/// Length of a buffer row that holds at least `n` samples, without a tail.
pub(super) const fn padded(n: usize) -> usize {
    n.div_ceil(CHUNK) * CHUNK
}

/// Planes over columns of evenly spaced image rows.
pub(super) struct Grid<T> {
    pub rows: Vec<usize>,
    pub columns: Range<usize>,
    pub planes: usize,
    /// Row after row, of each row its planes one after the other.
    values: Vec<T>,
}

impl<T: SimdReal> Grid<T> {
    /// NaN everywhere; at least one row and column.
    pub fn new(rows: Vec<usize>, columns: Range<usize>, planes: usize) -> Self {
        let values = vec![T::nan(); planes * rows.len() * columns.len()];
        Self { rows, columns, planes, values }
    }

    fn spacing(&self) -> usize {
        self.rows.get(1).map_or(1, |second| second - self.rows[0])
    }

    /// Rows of one parallel task.
    pub fn task_rows(&self) -> usize {
        (TASK_ROWS / self.spacing()).max(1)
    }

    /// Rows and values of each parallel task.
    pub fn tasks(&mut self) -> impl Iterator<Item = (&[usize], &mut [T])> {
        let task = self.task_rows();
        self.rows.chunks(task).zip(self.values.chunks_mut(task * self.planes * self.columns.len()))
    }

    /// Place of the image row `y` among the rows.
    pub fn place(&self, y: usize) -> Option<usize> {
        let j = y.checked_sub(self.rows[0])? / self.spacing();
        (self.rows.get(j) == Some(&y)).then_some(j)
    }

    /// Row `j` of a plane.
    pub fn row(&self, plane: usize, j: usize) -> &[T] {
        let width = self.columns.len();
        &self.values[(j * self.planes + plane) * width..][..width]
    }
}

/// Jets of the combinations over a rectangle, row by row.
#[derive(Default)]
pub(super) struct JetTile<T> {
    images: Vec<T>,
    scratch: Vec<T>,
    rows: Vec<T>,
    weight: Vec<T>,
    image_width: usize,
    image_size: usize,
    corner: (isize, isize),
    left: usize,
    up: usize,
    /// Six rows of the motion to be put back, or none.
    carried: Vec<T>,
}

impl<T: SimdReal> JetTile<T> {
    /// Prepares jets of `height` rows of `width` pixels (a multiple of [`CHUNK`]) from pixel `corner` on,
    /// which may lie outside the frame.
    pub fn load(&mut self, source: &Source<'_, T>, corner: (isize, isize), width: usize, height: usize) {
        let Reach { left, right, up, down } = source.reach;
        (self.corner, self.left, self.up, self.image_width) = (corner, left, up, width + left + right);
        self.image_size = self.image_width * (height + up + down);
        let count = if source.rows == 12 { 3 } else { 2 };
        self.images.resize(count * self.image_size, T::default());
        self.scratch.resize(source.jets.scratch_len(self.image_width), T::default());
        self.rows.resize(18 * self.image_width, T::default());
        self.weight.resize(width, T::default());
        let start = (corner.0 - left as isize, corner.1 - up as isize);
        let images = self.images.chunks_exact_mut(self.image_size);
        source.combination.apply(&source.frames, start, self.image_width, images);
    }

    /// Computes the jets and weights of row `r` of the rectangle.
    pub fn row(&mut self, source: &Source<'_, T>, r: usize) {
        let width = self.image_width;
        let images = self.images.chunks_exact(self.image_size);
        for (rows, image) in self.rows.chunks_exact_mut(6 * width).zip(images) {
            let (jets, row, scratch) = (&source.jets, r + self.up, &mut self.scratch[..]);
            dispatch(source.level, JetRow { jets, image, width, row, scratch, rows });
        }
        source.support.weights(self.corner.0, self.corner.1 + r as isize, &mut self.weight);
        if let Some(motion) = source.carried {
            self.carried.resize(6 * self.weight.len(), T::default());
            motion(self.corner.0, self.corner.1 + r as isize, &mut self.carried);
        } else {
            self.carried.clear();
        }
    }

    /// The motion to be put back at column `c` of the last row.
    #[inline(always)]
    fn carried<V: Lanes<Scalar = T>>(&self, c: usize) -> Option<[V; 6]> {
        let width = self.weight.len();
        (!self.carried.is_empty()).then(|| std::array::from_fn(|k| V::load(&self.carried[k * width + c..])))
    }

    /// Jets of the last row at column `c`, zero where the pixel is not usable; 1 where it is.
    #[inline(always)]
    pub fn jets<V: Lanes<Scalar = T>>(&self, c: usize, second: bool) -> (Jets<V>, V) {
        let weight = V::load(&self.weight[c..]);
        let usable = V::zero().lt(weight);
        let mut jets = [[V::zero(); 6]; 3];
        for (k, value) in jets[..if second { 3 } else { 2 }].iter_mut().flatten().enumerate() {
            *value = V::select(usable, V::load(&self.rows[k * self.image_width + self.left + c..]), V::zero());
        }
        let [coefficient, first, second] = jets;
        (Jets { coefficient, first, second }, weight)
    }
}

/// Planes of a tile with a margin, each of `height` rows of `width` samples.
#[derive(Default)]
pub(super) struct Planes<T> {
    pub data: Vec<T>,
    pub width: usize,
    pub height: usize,
}

impl<T: SimdReal> Planes<T> {
    pub fn resize(&mut self, count: usize, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.data.resize(count * width * height, T::default());
    }

    /// Plane `p`.
    #[inline(always)]
    pub fn plane(&self, p: usize) -> &[T] {
        &self.data[self.at(p, 0, 0)..self.at(p + 1, 0, 0)]
    }

    /// Place of the sample at row `r`, column `c` of plane `p`.
    #[inline(always)]
    pub fn at(&self, p: usize, r: usize, c: usize) -> usize {
        (p * self.height + r) * self.width + c
    }

    /// Fills the planes of the equations from the jets.
    pub fn fill(&mut self, source: &Source<'_, T>, jets: &mut JetTile<T>, scale: T) {
        for row in 0..self.height {
            jets.row(source, row);
            match source.rows {
                1 => dispatch(source.level, Products::<T, 1> { planes: self, jets, row, scale }),
                3 => dispatch(source.level, Products::<T, 3> { planes: self, jets, row, scale }),
                6 => dispatch(source.level, Products::<T, 6> { planes: self, jets, row, scale }),
                _ => dispatch(source.level, Products::<T, 12> { planes: self, jets, row, scale }),
            }
        }
    }
}

/// Jets of one row.
struct JetRow<'a, T> {
    jets: &'a JetRows<T>,
    image: &'a [T],
    width: usize,
    row: usize,
    scratch: &'a mut [T],
    rows: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for JetRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        self.jets.row::<V>(self.image, self.width, self.row, self.scratch, self.rows);
    }
}

/// Planes of the equations in one row.
struct Products<'a, T, const ROWS: usize> {
    planes: &'a mut Planes<T>,
    jets: &'a JetTile<T>,
    row: usize,
    scale: T,
}

impl<T: SimdReal, const ROWS: usize> Kernel<T> for Products<'_, T, ROWS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Planes { data, width, height } = self.planes;
        let (count, n, scale) = (Plan::of_rows(ROWS).planes(), *width * *height, V::splat(self.scale));
        let mut c = 0;
        while c < *width {
            let (jets, usable) = self.jets.jets::<V>(c, ROWS == 12);
            let carried = self.jets.carried::<V>(c);
            let values = products::<V, ROWS>(&jets, (usable, scale), carried.as_ref());
            let at = self.row * *width + c;
            for (p, value) in values.into_iter().enumerate().take(count) {
                value.store(&mut data[p * n + at..]);
            }
            c += V::LANES;
        }
    }
}
