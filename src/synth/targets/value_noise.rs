//! Value noise: random lattices, interpolated.

use crate::math::random::CounterRng;
use crate::parallel::for_each_band;
use crate::types::Frame;

/// One lattice of the noise: distance of its points, px, and the greatest value it reaches.
pub(super) type Octave = (f64, f64);

/// A sum of bilinear lattices of uniform random numbers, `sum_o a_o U_o(x / c_o)`, `U` in [-1, 1].
pub(super) fn value_noise(rng: CounterRng, (width, height): (usize, usize), octaves: &[Octave]) -> Frame<f64> {
    let lattices: Vec<Lattice> =
        octaves.iter().zip(0..).map(|(&octave, k)| Lattice::new(rng.stream(k), (width, height), octave)).collect();
    let mut noise = Frame::filled(width, height, 0.0);
    for_each_band(noise.data_mut(), width, |_, rows, band| {
        for (line, row) in band.chunks_mut(width).zip(rows) {
            for (column, sample) in line.iter_mut().enumerate() {
                *sample = lattices.iter().map(|lattice| lattice.at(column as f64, row as f64)).sum();
            }
        }
    });
    noise
}

/// Random numbers `cell` px apart.
struct Lattice {
    cell: f64,
    width: usize,
    values: Vec<f64>,
}

impl Lattice {
    /// Covers a frame of the given size.
    fn new(rng: CounterRng, (width, height): (usize, usize), (cell, amplitude): Octave) -> Self {
        let points = |length: usize| (length as f64 / cell).ceil() as usize + 2;
        let count = (points(width) * points(height)) as u64;
        let values = (0..count).map(|k| amplitude * (2.0 * rng.uniform(k) - 1.0)).collect();
        Self { cell, width: points(width), values }
    }

    /// Its value at a pixel.
    fn at(&self, x: f64, y: f64) -> f64 {
        let (x, y) = (x / self.cell, y / self.cell);
        let (left, top) = (x as usize, y as usize);
        let (right_share, lower_share) = (x - left as f64, y - top as f64);
        let row = |offset: usize| {
            let start = (top + offset) * self.width + left;
            self.values[start] + right_share * (self.values[start + 1] - self.values[start])
        };
        row(0) + lower_share * (row(1) - row(0))
    }
}
