//! The sums over one window: its structure tensor, and the step that explains the difference from the other
//! frame.

use super::{rows::Block, rows::Rows};
use crate::image::StructureTensor;
use crate::simd::Lanes;
use crate::types::Frame;

/// Lanes of the widest vector.
const MAX_LANES: usize = 16;

/// The window around a point of the first frame, and buffers. One for each batch of points.
pub(super) struct Window {
    /// Side of the window, px.
    side: usize,
    /// Values of a row of the planes below: `side` rounded up to whole vectors.
    stride: usize,
    /// Brightness and its slopes along x and y in the first frame, zero beyond the side.
    brightness: Vec<f32>,
    slope_x: Vec<f32>,
    slope_y: Vec<f32>,
    /// Brightness in the window and 1 px around it.
    patch: Vec<f32>,
    patch_stride: usize,
    /// Windows that leave the picture.
    copy: Vec<f32>,
    /// 1 in the columns of the window, 0 in the padding.
    inside: Vec<f32>,
}

/// Whole and fractional part of a position, px.
fn split(position: f64) -> (isize, f32) {
    let whole = position.floor();
    (whole as isize, (position - whole) as f32)
}

/// Sum of all lanes, pairwise.
#[inline(always)]
fn total<V: Lanes<Scalar = f32>>(sums: V) -> f64 {
    let mut lanes = [0.0f32; MAX_LANES];
    sums.store(&mut lanes);
    let mut width = V::LANES / 2;
    while width > 0 {
        for i in 0..width {
            lanes[i] += lanes[i + width];
        }
        width /= 2;
    }
    f64::from(lanes[0])
}

impl Window {
    /// Buffers for windows of `side` px in vectors `V`.
    pub fn new<V: Lanes<Scalar = f32>>(side: usize) -> Self {
        let stride = side.next_multiple_of(V::LANES);
        let patch_stride = (side + 2).next_multiple_of(V::LANES);
        let plane = vec![0.0; side * stride];
        Self {
            side,
            stride,
            slope_x: plane.clone(),
            slope_y: plane.clone(),
            brightness: plane,
            // The slopes of the last row's padding read on.
            patch: vec![0.0; (side + 2) * patch_stride + V::LANES + 2],
            patch_stride,
            copy: Vec::new(),
            inside: (0..stride).map(|x| f32::from(u8::from(x < side))).collect(),
        }
    }

    /// Number of pixels.
    fn area(&self) -> f64 {
        (self.side * self.side) as f64
    }

    /// Takes the window around `centre` (x, y) of the first frame: bilinear samples and their central
    /// differences. Returns their mean structure tensor, (grey levels / px)^2.
    #[inline(always)]
    pub fn take<V: Lanes<Scalar = f32>>(&mut self, frame: &Frame<f32>, centre: [f64; 2]) -> StructureTensor {
        self.sample_patch::<V>(frame, centre);
        let (zero, half) = (V::zero(), V::constant(0.5));
        let (mut xx, mut xy, mut yy) = (zero, zero, zero);
        for x in (0..self.stride).step_by(V::LANES) {
            let inside = zero.lt(V::load(&self.inside[x..]));
            for row in 0..self.side {
                let above = &self.patch[row * self.patch_stride + x..];
                let level = &above[self.patch_stride..];
                let below = &level[self.patch_stride..];
                let along = V::load(&level[2..]) - V::load(level);
                let down = V::load(&below[1..]) - V::load(&above[1..]);
                let gx = V::select(inside, along * half, zero);
                let gy = V::select(inside, down * half, zero);
                let centre = V::load(&level[1..]);
                let out = row * self.stride + x;
                centre.store(&mut self.brightness[out..]);
                gx.store(&mut self.slope_x[out..]);
                gy.store(&mut self.slope_y[out..]);
                (xx, xy, yy) = (gx.mul_add(gx, xx), gx.mul_add(gy, xy), gy.mul_add(gy, yy));
            }
        }
        let area = self.area();
        StructureTensor { xx: total(xx) / area, xy: total(xy) / area, yy: total(yy) / area }
    }

    /// The samples of the window and of 1 px around it.
    #[inline(always)]
    fn sample_patch<V: Lanes<Scalar = f32>>(&mut self, frame: &Frame<f32>, centre: [f64; 2]) {
        let margin = (self.side / 2 + 1) as isize;
        let ((left, along), (top, down)) = (split(centre[0]), split(centre[1]));
        let count = self.side + 2;
        let (left, top, read) = (left - margin, top - margin, self.patch_stride + 1);
        let rows = Rows::of(frame, Block { left, top, columns: count + 1, rows: count + 1, read }, &mut self.copy);
        let (along, down) = (V::splat(along), V::splat(down));
        for x in (0..self.patch_stride).step_by(V::LANES) {
            let mut above = rows.between(0, x, along);
            for row in 0..count {
                let below = rows.between(row + 1, x, along);
                (below - above).mul_add(down, above).store(&mut self.patch[row * self.patch_stride + x..]);
                above = below;
            }
        }
    }

    /// Compares with the window around `centre` of the second frame. Returns the means of slope times
    /// difference along x and y.
    ///
    /// The difference is first frame minus second frame, so that [`StructureTensor::solve`] makes it the step
    /// to take from `centre`.
    #[inline(always)]
    pub fn compare<V: Lanes<Scalar = f32>>(&mut self, frame: &Frame<f32>, centre: [f64; 2]) -> [f64; 2] {
        let zero = V::zero();
        let (mut sum_x, mut sum_y) = (zero, zero);
        let ((left, along), (top, down)) = (split(centre[0]), split(centre[1]));
        let rows = Rows::of(frame, block(self.side, self.stride, left, top), &mut self.copy);
        let (along, down) = (V::splat(along), V::splat(down));
        for x in (0..self.stride).step_by(V::LANES) {
            // The padding may hold a NaN that the window does not touch.
            let inside = zero.lt(V::load(&self.inside[x..]));
            let mut above = rows.between(0, x, along);
            for row in 0..self.side {
                let below = rows.between(row + 1, x, along);
                let at = row * self.stride + x;
                let difference = V::load(&self.brightness[at..]) - (below - above).mul_add(down, above);
                let difference = V::select(inside, difference, zero);
                sum_x = difference.mul_add(V::load(&self.slope_x[at..]), sum_x);
                sum_y = difference.mul_add(V::load(&self.slope_y[at..]), sum_y);
                above = below;
            }
        }
        let area = self.area();
        [total(sum_x) / area, total(sum_y) / area]
    }

    /// Mean absolute difference from the window around `centre` of the second frame, grey levels.
    #[inline(always)]
    pub fn residual<V: Lanes<Scalar = f32>>(&mut self, frame: &Frame<f32>, centre: [f64; 2]) -> f64 {
        let zero = V::zero();
        let mut sum = zero;
        let ((left, along), (top, down)) = (split(centre[0]), split(centre[1]));
        let rows = Rows::of(frame, block(self.side, self.stride, left, top), &mut self.copy);
        let (along, down) = (V::splat(along), V::splat(down));
        for x in (0..self.stride).step_by(V::LANES) {
            let inside = zero.lt(V::load(&self.inside[x..]));
            let mut above = rows.between(0, x, along);
            for row in 0..self.side {
                let below = rows.between(row + 1, x, along);
                let own = V::load(&self.brightness[row * self.stride + x..]);
                let difference = own - (below - above).mul_add(down, above);
                sum = sum + V::select(inside, difference.max(-difference), zero);
                above = below;
            }
        }
        total(sum) / self.area()
    }
}

/// The samples that interpolation reads for a window whose centre lies right and below of pixel `(left,
/// top)`.
fn block(side: usize, stride: usize, left: isize, top: isize) -> Block {
    let half = (side / 2) as isize;
    Block { left: left - half, top: top - half, columns: side + 1, rows: side + 1, read: stride + 1 }
}
