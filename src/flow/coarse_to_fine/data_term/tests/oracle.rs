//! The sums of the formulas in double precision, pixel by pixel.

use crate::flow::coarse_to_fine::data_term::*;
use crate::parallel::Threads;
use crate::types::Frame;

/// First of the oracle's planes for what the motion leaves of the flow, behind those of all moments.
pub(super) const REST: usize = COUNT;

pub(super) struct Case {
    pub size: (usize, usize),
    pub frames: Vec<Frame<f64>>,
    pub masks: Vec<Option<Mask>>,
    pub motion: [Vec<f64>; MOTION],
    pub scale: Option<f64>,
    pub options: DataOptions,
}

impl Case {
    /// Waves, moved by `speed` px times a motion that is curved everywhere.
    pub fn new((width, height): (usize, usize), views: usize, speed: f64) -> Self {
        let frames = (0..views).map(|k| {
            let t = k as f64;
            Frame::from_fn(width, height, |x, y| {
                let (x, y) = (x as f64 - 0.8 * t, y as f64 + 0.5 * t);
                120.0 + 50.0 * (0.9 * x + 0.3 * y).sin() + 40.0 * (0.35 * x - 0.8 * y + t * 0.1).cos()
            })
        });
        let (sw, sh) = (width.div_ceil(2), height.div_ceil(2));
        let plane = |c: usize| {
            let phase = c as f64;
            let size = if c < 2 { speed } else { 0.15 * speed };
            (0..sw * sh).map(|i| size * (0.4 * (i % sw) as f64 + 0.3 * (i / sw) as f64 + 1.7 * phase).sin()).collect()
        };
        Self {
            size: (width, height),
            frames: frames.collect(),
            masks: vec![None; views],
            motion: std::array::from_fn(plane),
            scale: Some(4.0),
            options: DataOptions::default(),
        }
    }

    fn weights(&self) -> [Vec<f64>; 3] {
        match self.frames.len() {
            2 => [vec![-0.5, 0.5], vec![0.5, 0.5], vec![-1.0, 1.0]],
            _ => [vec![-1.0, 0.0, 1.0], vec![0.25, 0.5, 0.25], vec![-0.5, 0.0, 0.5]],
        }
    }

    pub fn run<T: SimdReal>(&self, level: Level, threads: usize) -> (Planes<T>, Planes<T>, Vec<T>) {
        let pool = Pool::default();
        let term = DataTerm::<T>::new(level, self.options, &pool);
        let splines: Vec<Spline<T>> =
            self.frames.iter().map(|f| Spline::new(level, &f.map(|v| T::from_f64(*v)))).collect();
        let masks: Vec<_> = self.masks.iter().map(Option::as_ref).collect();
        let views = match splines.as_slice() {
            [a, b] => View::pair([a, b], [masks[0], masks[1]]).to_vec(),
            [a, b, c] => View::triple([a, b, c], [masks[0], masks[1], masks[2]]).to_vec(),
            _ => unreachable!(),
        };
        let (sw, sh) = (self.size.0.div_ceil(2), self.size.1.div_ceil(2));
        let mut motion = Planes::new(sw, sh, MOTION);
        // Samples beside the sites may hold any finite value.
        motion.data_mut().fill(T::from_f64(1e30));
        for k in 0..MOTION {
            for y in 0..sh {
                for x in 0..sw {
                    motion.line_mut(k, y)[x] = T::from_f64(self.motion[k][y * sw + x]);
                }
            }
        }
        let (mut out, mut means) = (Planes::default(), Planes::default());
        let scale = self.scale.map(T::from_f64);
        Threads::new(Some(threads)).unwrap().install(|| {
            // Twice, so that content left in memory is seen to do no harm.
            term.linearise(Sums::Moments, (self.size, &views), &motion, scale, &mut out);
            let residuals = term.linearise(Sums::Moments, (self.size, &views), &motion, scale, &mut out);
            term.linearise(Sums::Means, (self.size, &views), &motion, scale, &mut means);
            (out, means, residuals)
        })
    }

    fn dense(&self, x: usize, y: usize) -> [f64; 2] {
        let (sw, sh) = (self.size.0.div_ceil(2), self.size.1.div_ceil(2));
        let near = |p: usize, n: usize| {
            if p.is_multiple_of(2) || p / 2 + 1 == n { vec![p / 2] } else { vec![p / 2, p / 2 + 1] }
        };
        let (columns, rows) = (near(x, sw), near(y, sh));
        [0, 1].map(|c| {
            let mut sum = 0.0;
            for sy in &rows {
                for sx in &columns {
                    // Motion of constant curvature lies midway between the extrapolations of two sites and
                    // the mean of their values: slopes count half.
                    let lever = |p: usize, site: usize, n: usize| (p as f64 - 2.0 * site as f64) / n as f64;
                    let (dx, dy) = (lever(x, *sx, columns.len()), lever(y, *sy, rows.len()));
                    let at = |k: usize| self.motion[k][sy * sw + sx];
                    sum += at(c) + at(2 + c) * dx + at(4 + c) * dy;
                }
            }
            sum / (rows.len() * columns.len()) as f64
        })
    }

    /// Seven products a pixel, the two right sides without the motion, and |R| at the pixels of the
    /// subsample.
    fn products(&self) -> (Vec<[f64; 9]>, Vec<f64>) {
        let (w, h) = self.size;
        let (edge_x, edge_y) = (w as f64 - 2.0, h as f64 - 2.0);
        let [times, means, rates] = self.weights();
        let splines: Vec<_> = self.frames.iter().map(|f| Spline::new(Level::SCALAR, f)).collect();
        let (mut a, mut r, mut valid) = (vec![0.0; w * h], vec![0.0; w * h], vec![1.0; w * h]);
        for i in 0..w * h {
            let (x, y) = (i % w, i / w);
            if x == 0 || y == 0 || x + 1 == w || y + 1 == h {
                valid[i] = 0.0;
            }
            let [u, v] = self.dense(x, y);
            for (k, spline) in splines.iter().enumerate() {
                let (px, py) = (x as f64 + times[k] * u, y as f64 + times[k] * v);
                let mut sample = [0.0];
                spline.sample_row(Level::SCALAR, &[px], &[py], &mut sample);
                a[i] += means[k] * sample[0];
                r[i] += rates[k] * sample[0];
                let inside = (1.0..=edge_x).contains(&px) && (1.0..=edge_y).contains(&py);
                let usable = |m: &Mask| m.get(px.round() as usize, py.round() as usize);
                if !inside || !self.masks[k].as_ref().is_none_or(usable) {
                    valid[i] = 0.0;
                }
            }
        }
        let (b, d, s) = ([1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0], [-0.5, 0.0, 0.5], [1.0, -2.0, 1.0]);
        let (mut out, mut residuals) = (vec![[0.0; 9]; w * h], Vec::new());
        for y in 1..h.max(1) - 1 {
            for x in 1..w.max(1) - 1 {
                let stencil = |image: &[f64], kx: [f64; 3], ky: [f64; 3]| {
                    let mut sum = 0.0;
                    for j in 0..3 {
                        for i in 0..3 {
                            sum += kx[i] * ky[j] * image[(y + j - 1) * w + x + i - 1];
                        }
                    }
                    sum
                };
                let [ax, ay, axx, axy, ayy] =
                    [(d, b), (b, d), (s, b), (d, d), (b, s)].map(|(kx, ky)| stencil(&a, kx, ky));
                let [r0, rx, ry] = [(b, b), (d, b), (b, d)].map(|(kx, ky)| stencil(&r, kx, ky));
                let [u, v] = self.dense(x, y);
                let [b1, b2, b3] = [-r0 + ax * u + ay * v, -rx + axx * u + axy * v, -ry + axy * u + ayy * v];
                let ok = valid[y * w + x];
                let weight = ok / (1.0 + self.scale.map_or(0.0, |s0| (r0 / (self.options.robust * s0)).powi(2)));
                let g = self.options.gradient.powi(2);
                out[y * w + x] = [
                    weight * (ax * ax + g * (axx * axx + axy * axy)),
                    weight * (ax * ay + g * (axx * axy + axy * ayy)),
                    weight * (ay * ay + g * (axy * axy + ayy * ayy)),
                    weight * (ax * b1 + g * (axx * b2 + axy * b3)),
                    weight * (ay * b1 + g * (axy * b2 + ayy * b3)),
                    weight * (r0 * r0 + g * (rx * rx + ry * ry)),
                    ok,
                    -weight * (ax * r0 + g * (axx * rx + axy * ry)),
                    -weight * (ay * r0 + g * (axy * rx + ayy * ry)),
                ];
                if x % 4 == 0 && y % 4 == 0 && ok > 0.0 {
                    residuals.push(r0.abs());
                }
            }
        }
        (out, residuals)
    }

    /// Planes in the order of the code under test, each row-major.
    pub fn oracle(&self) -> (Vec<Vec<f64>>, Vec<f64>) {
        let (products, residuals) = self.products();
        let (w, h) = self.size;
        let (sw, sh) = (w.div_ceil(2), h.div_ceil(2));
        let sigma = self.options.sigma;
        let radius = (3.0 * sigma + 0.5) as isize;
        let gauss = |k: isize| (-0.5 * (k as f64 / sigma).powi(2)).exp();
        let full: f64 = (-radius..=radius).map(gauss).sum();
        // Entries of the normal matrix that are the same share a plane: each is summed once.
        let mut entries: Vec<_> = (0..36).map(|e| (normal(e / 6, e % 6), e / 6, e % 6)).collect();
        entries.sort_unstable();
        entries.dedup_by_key(|e| e.0);
        let mut out = vec![vec![0.0; sw * sh]; REST + 2];
        for site in 0..sw * sh {
            let (cx, cy) = (2 * (site % sw) as isize, 2 * (site / sw) as isize);
            for dy in -radius..=radius {
                for dx in -radius..=radius {
                    let (px, py) = (cx + dx, cy + dy);
                    if px < 0 || py < 0 || px >= w as isize || py >= h as isize {
                        continue;
                    }
                    let p = products[py as usize * w + px as usize];
                    let g = gauss(dx) * gauss(dy) / (full * full);
                    let power = [1.0, dx as f64, dy as f64];
                    for (plane, i, j) in &entries {
                        out[*plane][site] += g * power[i / 2] * power[j / 2] * p[i % 2 + j % 2];
                    }
                    for i in 0..6 {
                        out[right(i)][site] += g * power[i / 2] * p[3 + i % 2];
                    }
                    out[ERROR][site] += g * p[5];
                    out[VALID][site] += g * p[6];
                    (0..2).for_each(|c| out[REST + c][site] += g * p[7 + c]);
                }
            }
        }
        (out, residuals)
    }
}
