//! Rows of a picture around a window, replicated beyond its border.

use crate::simd::Lanes;
use crate::types::Frame;

/// Consecutive rows that start at a window's left edge, in the picture itself or in a copy.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    values: &'a [f32],
    stride: usize,
}

/// Where a block of samples starts and how large it is, px.
#[derive(Clone, Copy)]
pub(super) struct Block {
    pub left: isize,
    pub top: isize,
    pub columns: usize,
    pub rows: usize,
    /// Columns that vectors read: the block's own and their padding. The padding may hold anything.
    pub read: usize,
}

impl<'a> Rows<'a> {
    /// The rows of `block`. A block that leaves the picture is copied into `copy` with the border replicated.
    #[inline(always)]
    pub fn of(frame: &'a Frame<f32>, block: Block, copy: &'a mut Vec<f32>) -> Self {
        let (width, height) = frame.size();
        let Block { left, top, columns, rows, read } = block;
        let within = |start: isize, count: usize, size: usize| start >= 0 && start as usize + count <= size;
        if within(left, columns, width) && within(top, rows, height) {
            let start = top as usize * width + left as usize;
            if start + (rows - 1) * width + read <= frame.data().len() {
                return Self { values: &frame.data()[start..], stride: width };
            }
        }
        replicate(frame, block, copy);
        Self { values: copy, stride: read }
    }

    /// Row `row` interpolated between neighbouring columns from column `x` on: `v(x) + fraction (v(x + 1) -
    /// v(x))`.
    #[inline(always)]
    pub fn between<V: Lanes<Scalar = f32>>(&self, row: usize, x: usize, fraction: V) -> V {
        let values = &self.values[row * self.stride + x..][..=V::LANES];
        let (here, next) = (V::load(values), V::load(&values[1..]));
        (next - here).mul_add(fraction, here)
    }
}

/// Copies the block into `copy`, `block.read` values a row, each coordinate clamped to the picture.
#[inline(never)]
fn replicate(frame: &Frame<f32>, block: Block, copy: &mut Vec<f32>) {
    let (width, height) = frame.size();
    let clamp = |at: isize, size: usize| at.clamp(0, size as isize - 1) as usize;
    copy.clear();
    for y in 0..block.rows as isize {
        let row = frame.row(clamp(block.top + y, height));
        copy.extend((0..block.read as isize).map(|x| row[clamp(block.left + x, width)]));
    }
}
