//! Particle images, as particle image velocimetry takes them.

use super::{Scene, motion::Motion, texture::cell_index, texture::poisson_of_mean_one};
use crate::error::{Error, Result};
use crate::math::random::CounterRng;
use crate::parallel::for_each_band;
use crate::types::{AffineFlow, Frame};

/// Particles are drawn out to this many of their diameters; what is left out is below 1e-11 of the peak.
const REACH: f64 = 1.8;
/// Cells looked through for one picture at most.
const MAX_CELLS: f64 = 2e7;

/// How the particles look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParticleLook {
    /// Particles per px^2.
    pub density: f64,
    /// Diameter, px, at which brightness has fallen to `e^-2` of its peak.
    pub diameter: f64,
    /// Brightness of the brightest particle's centre, grey levels.
    pub peak: f64,
    /// Peaks are spread evenly over `(1 - spread) peak` to `peak`; 0 to 1.
    pub spread: f64,
    /// Brightness where there is no particle, grey levels.
    pub background: f64,
}

impl Default for ParticleLook {
    fn default() -> Self {
        Self { density: 0.05, diameter: 2.8, peak: 200.0, spread: 0.6, background: 10.0 }
    }
}

impl ParticleLook {
    fn check(&self) -> Result<()> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !(positive(self.density) && self.density <= 10.0) {
            return Err(Error::argument("density", "more than 0 and at most 10 particles per px^2", self.density));
        }
        if !(positive(self.diameter) && self.diameter <= 1000.0) {
            return Err(Error::argument("diameter", "more than 0 and at most 1000 px", self.diameter));
        }
        if !(self.peak.is_finite() && self.background.is_finite()) {
            return Err(Error::argument("peak", "finite grey levels", format!("{} on {}", self.peak, self.background)));
        }
        if !(0.0..=1.0).contains(&self.spread) {
            return Err(Error::argument("spread", "0 to 1", self.spread));
        }
        Ok(())
    }
}

/// Gaussian spots `A exp(-8 r^2 / d^2)` strewn at random (Poisson), each carried along its path.
///
/// As in a real recording the spots do not stretch with the flow, so brightness constancy holds for the
/// centres of particles, not for every pixel.
#[derive(Debug, Clone)]
pub struct ParticleImages<M> {
    size: (usize, usize),
    origin: (f64, f64),
    look: ParticleLook,
    motion: M,
    cell: f64,
    rng: CounterRng,
}

/// A particle in a picture.
struct Spot {
    x: f64,
    y: f64,
    peak: f64,
}

impl<M: Motion> ParticleImages<M> {
    /// Particles carried by `motion`, seen through a window whose pixel (0, 0) is the scene point `origin`.
    ///
    /// # Errors
    /// [`Error::Argument`] for a look that makes no picture.
    pub fn new(size: (usize, usize), origin: (f64, f64), look: ParticleLook, motion: M, seed: u64) -> Result<Self> {
        look.check()?;
        let rng = CounterRng::new(seed);
        // One particle a cell on average.
        Ok(Self { size, origin, look, motion, cell: look.density.sqrt().recip(), rng })
    }

    /// The particles that reach into a rectangle at time `t`, in an order that does not depend on it.
    fn spots(&self, (x0, y0): (f64, f64), (x1, y1): (f64, f64), t: f64) -> Vec<Spot> {
        let margin = REACH * self.look.diameter;
        let (x0, y0, x1, y1) = (x0 - margin, y0 - margin, x1 + margin, y1 + margin);
        let Some(((left, top), (right, bottom))) = self.sources((x0, y0), (x1, y1), t) else { return Vec::new() };
        let forward = self.motion.path_map(0.0, t);
        let mut spots = Vec::new();
        for row in top..=bottom {
            for column in left..=right {
                let cell = self.rng.stream(cell_index(column, row));
                for k in 0..poisson_of_mean_one(cell.uniform(0)) {
                    let (start_x, start_y) =
                        (column as f64 + cell.uniform(3 * k + 1), row as f64 + cell.uniform(3 * k + 2));
                    let (x, y) = forward(start_x * self.cell, start_y * self.cell);
                    if x >= x0 && x <= x1 && y >= y0 && y <= y1 {
                        let peak = self.look.peak * (1.0 - self.look.spread * cell.uniform(3 * k + 3));
                        spots.push(Spot { x, y, peak });
                    }
                }
            }
        }
        spots
    }

    /// The cells that hold, at time 0, everything that is inside the rectangle at time `t`. A motion keeps
    /// inside what is inside, so following the rectangle's edge back is enough; the edge is sampled and the
    /// longest gap between neighbouring samples added all round.
    fn sources(&self, (x0, y0): (f64, f64), (x1, y1): (f64, f64), t: f64) -> Option<((i64, i64), (i64, i64))> {
        let back = self.motion.path_map(t, 0.0);
        let samples = ((x1 - x0).max(y1 - y0).ceil() as usize).max(8);
        let corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)];
        let edge = corners.windows(2).flat_map(|pair| {
            let ((ax, ay), (bx, by)) = (pair[0], pair[1]);
            (0..samples).map(move |i| {
                let share = i as f64 / samples as f64;
                (ax + share * (bx - ax), ay + share * (by - ay))
            })
        });
        let mapped: Vec<(f64, f64)> = edge.map(|(x, y)| back(x, y)).collect();
        if !mapped.iter().all(|p| p.0.is_finite() && p.1.is_finite()) {
            return None;
        }
        let gap = mapped
            .iter()
            .zip(mapped.iter().cycle().skip(1))
            .map(|(a, b)| (a.0 - b.0).hypot(a.1 - b.1))
            .fold(0.0, f64::max);
        let low = mapped.iter().fold((f64::MAX, f64::MAX), |m, p| (m.0.min(p.0), m.1.min(p.1)));
        let high = mapped.iter().fold((f64::MIN, f64::MIN), |m, p| (m.0.max(p.0), m.1.max(p.1)));
        let cell = |value: f64| (value / self.cell).floor() as i64;
        let area = (high.0 - low.0 + 2.0 * gap) * (high.1 - low.1 + 2.0 * gap);
        if area > MAX_CELLS * self.cell * self.cell {
            return None;
        }
        Some(((cell(low.0 - gap), cell(low.1 - gap)), (cell(high.0 + gap), cell(high.1 + gap))))
    }

    /// Brightness that `spot` adds at `(x, y)`.
    fn shine(&self, spot: &Spot, x: f64, y: f64) -> f64 {
        let (dx, dy) = (x - spot.x, y - spot.y);
        let squared = dx * dx + dy * dy;
        let d = self.look.diameter;
        if squared > (REACH * d).powi(2) { 0.0 } else { spot.peak * (-8.0 * squared / (d * d)).exp() }
    }
}

impl<M: Motion> Scene for ParticleImages<M> {
    fn size(&self) -> (usize, usize) {
        self.size
    }
    fn origin(&self) -> (f64, f64) {
        self.origin
    }
    fn brightness(&self, x: f64, y: f64, t: f64) -> f64 {
        self.spots((x, y), (x, y), t).iter().fold(self.look.background, |sum, spot| sum + self.shine(spot, x, y))
    }
    fn motion(&self, x: f64, y: f64, t: f64) -> Option<AffineFlow<f64>> {
        self.motion.truth(x, y, t)
    }
    fn displacement(&self, x: f64, y: f64, t: f64, duration: f64) -> Option<(f64, f64)> {
        Some(self.motion.displacement(x, y, t, duration))
    }
    fn max_duration(&self) -> f64 {
        self.motion.max_duration()
    }
    fn frame(&self, t: f64) -> Frame<f64> {
        let ((width, height), origin) = (self.size, self.origin);
        let mut frame = Frame::filled(width, height, self.look.background);
        if width == 0 || height == 0 {
            return frame;
        }
        let far = (origin.0 + (width - 1) as f64, origin.1 + (height - 1) as f64);
        let spots = self.spots(origin, far, t);
        let reach = REACH * self.look.diameter;
        let range = |centre: f64, start: f64, low: usize, high: usize| {
            let clamp = |value: f64| (value.max(low as f64) as usize).min(high);
            clamp((centre - reach - start).floor())..clamp((centre + reach - start).floor() + 1.0)
        };
        for_each_band(frame.data_mut(), width, |_, rows, band| {
            for spot in &spots {
                for row in range(spot.y, origin.1, rows.start, rows.end) {
                    let line = &mut band[(row - rows.start) * width..][..width];
                    for column in range(spot.x, origin.0, 0, width) {
                        line[column] += self.shine(spot, origin.0 + column as f64, origin.1 + row as f64);
                    }
                }
            }
        });
        frame
    }
}
