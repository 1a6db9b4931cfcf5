//! The E step in lanes for few dimensions, whose sums stay in registers.

use super::{Sums, shares};
use crate::mixture::densities::Densities;
use crate::mixture::points::{BLOCK, Planes};
use crate::simd::{Kernel, Lanes};
use std::ops::Range;

/// A band of points in D dimensions.
pub(super) struct Band<'a, const D: usize> {
    pub planes: &'a Planes,
    pub densities: &'a Densities,
    pub points: Range<usize>,
}

impl<const D: usize> Kernel<f64> for Band<'_, D> {
    type Output = Sums;

    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> Sums {
        let components = self.densities.components();
        let length = 1 + D + self.densities.triangle();
        let mut lanes = vec![0.0; components * length * V::LANES];
        let mut logs = vec![0.0; components * BLOCK];
        let mut negentropy = 0.0;
        for from in self.points.step_by(BLOCK) {
            let mut points = [[0.0; BLOCK]; D];
            for d in 0..D {
                points[d].copy_from_slice(&self.planes.plane(d)[from..from + BLOCK]);
            }
            let weights = &self.planes.weights[from..from + BLOCK];
            let mut most = [f64::NEG_INFINITY; BLOCK];
            for (k, logs) in logs.chunks_exact_mut(BLOCK).enumerate() {
                log_densities::<V, D>(self.densities, k, &points, logs, &mut most);
            }
            let mut scale = [0.0; BLOCK];
            negentropy += shares::<V>(&mut logs, &most, weights, &mut scale);
            for (k, (shares, lanes)) in
                logs.chunks_exact(BLOCK).zip(lanes.chunks_exact_mut(length * V::LANES)).enumerate()
            {
                add::<V, D>(&self.densities.means[k * D..(k + 1) * D], &points, shares, &scale, lanes);
            }
        }
        let values = lanes.chunks_exact(V::LANES).map(|lanes| lanes.iter().sum()).collect();
        Sums { values, negentropy }
    }
}

/// `ln rho` of a block's points under component k, and the greatest so far of each point.
#[inline(always)]
fn log_densities<V: Lanes<Scalar = f64>, const D: usize>(
    densities: &Densities,
    k: usize,
    points: &[[f64; BLOCK]; D],
    logs: &mut [f64],
    most: &mut [f64; BLOCK],
) {
    let constant = V::splat(densities.constants[k]);
    let mut mean = [V::zero(); D];
    let mut rows = [[V::zero(); D]; D];
    let triangle = &densities.whitening[k * D * (D + 1) / 2..(k + 1) * D * (D + 1) / 2];
    for i in 0..D {
        mean[i] = V::splat(densities.means[k * D + i]);
        for j in 0..=i {
            rows[i][j] = V::splat(triangle[i * (i + 1) / 2 + j]);
        }
    }
    for at in (0..BLOCK).step_by(V::LANES) {
        let mut off = [V::zero(); D];
        let mut log = constant;
        for i in 0..D {
            off[i] = V::load(&points[i][at..]) - mean[i];
            let mut z = off[0] * rows[i][0];
            for j in 1..=i {
                z = off[j].mul_add(rows[i][j], z);
            }
            log = z.neg_mul_add(z, log);
        }
        log.store(&mut logs[at..]);
        log.max(V::load(&most[at..])).store(&mut most[at..]);
    }
}

/// Adds a block to the lanes' sums of one component.
#[inline(always)]
fn add<V: Lanes<Scalar = f64>, const D: usize>(
    mean: &[f64],
    points: &[[f64; BLOCK]; D],
    shares: &[f64],
    scale: &[f64; BLOCK],
    lanes: &mut [f64],
) {
    let mut centre = [V::zero(); D];
    let mut count = V::load(lanes);
    let mut first = [V::zero(); D];
    let mut second = [[V::zero(); D]; D];
    let mut slot = 1 + D;
    for i in 0..D {
        centre[i] = V::splat(mean[i]);
        first[i] = V::load(&lanes[(1 + i) * V::LANES..]);
        for j in 0..=i {
            second[i][j] = V::load(&lanes[slot * V::LANES..]);
            slot += 1;
        }
    }
    for at in (0..BLOCK).step_by(V::LANES) {
        let share = V::load(&shares[at..]) * V::load(&scale[at..]);
        count = count + share;
        let mut off = [V::zero(); D];
        for i in 0..D {
            off[i] = V::load(&points[i][at..]) - centre[i];
            let weighted = share * off[i];
            first[i] = first[i] + weighted;
            for j in 0..=i {
                second[i][j] = weighted.mul_add(off[j], second[i][j]);
            }
        }
    }
    count.store(lanes);
    slot = 1 + D;
    for i in 0..D {
        first[i].store(&mut lanes[(1 + i) * V::LANES..]);
        for j in 0..=i {
            second[i][j].store(&mut lanes[slot * V::LANES..]);
            slot += 1;
        }
    }
}
