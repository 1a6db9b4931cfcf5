//! The E step in lanes for any number of dimensions: differences of a block are kept in memory and read for
//! two rows of a matrix at a time, so that reading is not what it waits for.

use super::{Sums, shares};
use crate::mixture::densities::Densities;
use crate::mixture::points::{BLOCK, Planes};
use crate::simd::{Kernel, Lanes};
use std::ops::Range;

/// Vectors of points that go through a matrix together.
const ABREAST: usize = 4;

/// One coordinate of a block.
type Plane = [f64; BLOCK];

/// A band of points.
pub(super) struct AnyBand<'a> {
    pub planes: &'a Planes,
    pub densities: &'a Densities,
    pub points: Range<usize>,
}

impl Kernel<f64> for AnyBand<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> Sums {
        let (d, components) = (self.planes.dimensions, self.densities.components());
        let length = 1 + d + self.densities.triangle();
        let mut lanes = vec![0.0; components * length * V::LANES];
        let mut logs = vec![0.0; components * BLOCK];
        // Where their number is odd, a last plane of zeros makes pairs of all of them.
        let mut off = vec![[0.0; BLOCK]; d.next_multiple_of(2)];
        let mut weighted = off.clone();
        let mut negentropy = 0.0;
        for from in self.points.step_by(BLOCK) {
            let mut most = [f64::NEG_INFINITY; BLOCK];
            for (k, logs) in logs.chunks_exact_mut(BLOCK).enumerate() {
                differences::<V>(self.planes, self.densities, k, from, &mut off);
                log_densities::<V>(self.densities, k, &off, logs, &mut most);
            }
            let mut scale = [0.0; BLOCK];
            negentropy += shares::<V>(&mut logs, &most, &self.planes.weights[from..from + BLOCK], &mut scale);
            for (k, (shares, lanes)) in
                logs.chunks_exact(BLOCK).zip(lanes.chunks_exact_mut(length * V::LANES)).enumerate()
            {
                differences::<V>(self.planes, self.densities, k, from, &mut off);
                let (count, rest) = lanes.split_at_mut(V::LANES);
                let (first, second) = rest.split_at_mut(d * V::LANES);
                weigh::<V>(shares, &scale, &off, &mut weighted, (count, first));
                add_products::<V>(&weighted, &off, second);
            }
        }
        let values = lanes.chunks_exact(V::LANES).map(|lanes| lanes.iter().sum()).collect();
        Sums { values, negentropy }
    }
}

/// `x - m_k` of a block, plane by plane.
#[inline(always)]
fn differences<V: Lanes<Scalar = f64>>(
    planes: &Planes,
    densities: &Densities,
    k: usize,
    from: usize,
    off: &mut [Plane],
) {
    for (i, off) in off.iter_mut().take(planes.dimensions).enumerate() {
        let mean = V::splat(densities.means[k * planes.dimensions + i]);
        let plane = &planes.plane(i)[from..from + BLOCK];
        for at in (0..BLOCK).step_by(V::LANES) {
            (V::load(&plane[at..]) - mean).store(&mut off[at..]);
        }
    }
}

/// `ln rho` of a block under component k, and the greatest so far of each point.
#[inline(always)]
fn log_densities<V: Lanes<Scalar = f64>>(
    densities: &Densities,
    k: usize,
    off: &[Plane],
    logs: &mut [f64],
    most: &mut Plane,
) {
    let (d, length) = (densities.dimensions, densities.triangle());
    let triangle = &densities.whitening[k * length..(k + 1) * length];
    for at in (0..BLOCK).step_by(ABREAST * V::LANES) {
        let mut log = [V::splat(densities.constants[k]); ABREAST];
        // Where the number of rows is odd, the first, which is short, comes alone.
        let (mut done, mut rows) = (0, triangle);
        while done < d {
            if (d - done) % 2 == 1 {
                let z = products::<V, 1>([&rows[..=done]], off, at);
                log = subtracted(log, z[0]);
                rows = &rows[done + 1..];
                done += 1;
            } else {
                let (upper, rest) = rows.split_at(done + 1);
                let (lower, rest) = rest.split_at(done + 2);
                let [upper, z] = products::<V, 2>([upper, lower], off, at);
                let last = V::splat(lower[done + 1]);
                let lower = std::array::from_fn(|n| V::load(&off[done + 1][at + n * V::LANES..]).mul_add(last, z[n]));
                log = subtracted(subtracted(log, upper), lower);
                rows = rest;
                done += 2;
            }
        }
        for (n, log) in log.into_iter().enumerate() {
            let at = at + n * V::LANES;
            log.store(&mut logs[at..]);
            log.max(V::load(&most[at..])).store(&mut most[at..]);
        }
    }
}

/// Products of rows of a matrix, as far as the first one goes, with the points from `at` on.
#[inline(always)]
fn products<V: Lanes<Scalar = f64>, const R: usize>(rows: [&[f64]; R], off: &[Plane], at: usize) -> [[V; ABREAST]; R] {
    let mut sums = [[V::zero(); ABREAST]; R];
    let length = rows[0].len();
    let rows = rows.map(|row| &row[..length]);
    for (j, off) in off[..length].iter().enumerate() {
        let off: [V; ABREAST] = std::array::from_fn(|n| V::load(&off[at + n * V::LANES..]));
        for (sums, row) in sums.iter_mut().zip(rows) {
            let factor = V::splat(row[j]);
            for n in 0..ABREAST {
                sums[n] = off[n].mul_add(factor, sums[n]);
            }
        }
    }
    sums
}

/// Logarithms less squares.
#[inline(always)]
fn subtracted<V: Lanes<Scalar = f64>>(log: [V; ABREAST], z: [V; ABREAST]) -> [V; ABREAST] {
    std::array::from_fn(|n| z[n].neg_mul_add(z[n], log[n]))
}

/// Responsibilities times weights times differences of a block, and the lanes' sums.
#[inline(always)]
fn weigh<V: Lanes<Scalar = f64>>(
    shares: &[f64],
    scale: &Plane,
    off: &[Plane],
    weighted: &mut [Plane],
    (count, first): (&mut [f64], &mut [f64]),
) {
    let mut share = [0.0; BLOCK];
    let mut sum = V::load(count);
    for at in (0..BLOCK).step_by(V::LANES) {
        let now = V::load(&shares[at..]) * V::load(&scale[at..]);
        sum = sum + now;
        now.store(&mut share[at..]);
    }
    sum.store(count);
    for ((off, weighted), first) in off.iter().zip(weighted).zip(first.chunks_exact_mut(V::LANES)) {
        let mut sum = V::load(first);
        for at in (0..BLOCK).step_by(V::LANES) {
            let now = V::load(&share[at..]) * V::load(&off[at..]);
            sum = sum + now;
            now.store(&mut weighted[at..]);
        }
        sum.store(first);
    }
}

/// Adds the lower triangle of a block's weighted products to the lanes' sums, by 2 x 2 tiles.
#[inline(always)]
fn add_products<V: Lanes<Scalar = f64>>(weighted: &[Plane], off: &[Plane], second: &mut [f64]) {
    for (upper, weighted) in weighted.chunks_exact(2).enumerate() {
        for (left, off) in off.chunks_exact(2).enumerate().take(upper + 1) {
            let tile = tile::<V>(weighted, off);
            for (i, row) in tile.into_iter().enumerate() {
                for (j, sum) in row.into_iter().enumerate() {
                    let (i, j) = (2 * upper + i, 2 * left + j);
                    let slot = (i * (i + 1) / 2 + j) * V::LANES;
                    // Above the diagonal, or of the plane of zeros.
                    if j > i || slot >= second.len() {
                        continue;
                    }
                    (V::load(&second[slot..]) + sum).store(&mut second[slot..]);
                }
            }
        }
    }
}

/// Sums of the products of two planes with two others.
#[inline(always)]
fn tile<V: Lanes<Scalar = f64>>(weighted: &[Plane], off: &[Plane]) -> [[V; 2]; 2] {
    let mut sums = [[V::zero(); 2]; 2];
    for at in (0..BLOCK).step_by(V::LANES) {
        let off = [V::load(&off[0][at..]), V::load(&off[1][at..])];
        for (sums, weighted) in sums.iter_mut().zip(weighted) {
            let weighted = V::load(&weighted[at..]);
            for j in 0..2 {
                sums[j] = weighted.mul_add(off[j], sums[j]);
            }
        }
    }
    sums
}
