//! The E step in lanes for any number of dimensions: differences of a block are kept in memory.

use super::{Sums, shares};
use crate::mixture::points::{BLOCK, Planes};
use crate::mixture::posterior::Densities;
use crate::simd::{Kernel, Lanes};
use std::ops::Range;

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
        let mut off = vec![0.0; d * BLOCK];
        let mut weighted = vec![0.0; d * BLOCK];
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
                add::<V>(shares, &scale, &off, &mut weighted, lanes);
            }
        }
        let values = lanes.chunks_exact(V::LANES).map(|lanes| lanes.iter().sum()).collect();
        Sums { values, negentropy }
    }
}

/// `x - m_k` of a block, (D, BLOCK).
#[inline(always)]
fn differences<V: Lanes<Scalar = f64>>(planes: &Planes, densities: &Densities, k: usize, from: usize, off: &mut [f64]) {
    for (i, off) in off.chunks_exact_mut(BLOCK).enumerate() {
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
    off: &[f64],
    logs: &mut [f64],
    most: &mut [f64; BLOCK],
) {
    let length = densities.triangle();
    let triangle = &densities.whitening[k * length..(k + 1) * length];
    for at in (0..BLOCK).step_by(V::LANES) {
        let mut log = V::splat(densities.constants[k]);
        let mut rows = triangle;
        for i in 0..densities.dimensions {
            let (row, rest) = rows.split_at(i + 1);
            let mut z = V::zero();
            for j in 0..=i {
                z = V::load(&off[j * BLOCK + at..]).mul_add(V::splat(row[j]), z);
            }
            log = z.neg_mul_add(z, log);
            rows = rest;
        }
        log.store(&mut logs[at..]);
        log.max(V::load(&most[at..])).store(&mut most[at..]);
    }
}

/// Adds a block to the lanes' sums of one component.
#[inline(always)]
fn add<V: Lanes<Scalar = f64>>(
    shares: &[f64],
    scale: &[f64; BLOCK],
    off: &[f64],
    weighted: &mut [f64],
    lanes: &mut [f64],
) {
    let d = off.len() / BLOCK;
    let mut count = V::load(lanes);
    for at in (0..BLOCK).step_by(V::LANES) {
        let share = V::load(&shares[at..]) * V::load(&scale[at..]);
        count = count + share;
        for i in 0..d {
            (share * V::load(&off[i * BLOCK + at..])).store(&mut weighted[i * BLOCK + at..]);
        }
    }
    count.store(lanes);
    let mut slot = 1 + d;
    for i in 0..d {
        let weighted = &weighted[i * BLOCK..(i + 1) * BLOCK];
        let mut first = V::load(&lanes[(1 + i) * V::LANES..]);
        for at in (0..BLOCK).step_by(V::LANES) {
            first = first + V::load(&weighted[at..]);
        }
        first.store(&mut lanes[(1 + i) * V::LANES..]);
        for off in off.chunks_exact(BLOCK).take(i + 1) {
            let mut second = V::load(&lanes[slot * V::LANES..]);
            for at in (0..BLOCK).step_by(V::LANES) {
                second = V::load(&weighted[at..]).mul_add(V::load(&off[at..]), second);
            }
            second.store(&mut lanes[slot * V::LANES..]);
            slot += 1;
        }
    }
}
