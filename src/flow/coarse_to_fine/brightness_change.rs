//! Change of brightness between the frames: gain and offset, smooth over the picture, measured and removed.
//!
//! Along the motion, the brightness of frame `f` is `g(x) I(x) + o(x)`, with `I` that of the reference frame.
//! Both are read from means and standard deviations in wide windows, which a wrong motion changes little (a
//! regression would find too small a gain); pixels that do not follow, occluded ones say, have little weight.
//! Frames are equalised only if that explains much of their difference, so that equal ones stay what they
//! are.
//!
//! Before any motion is known, whole frames are compared ([`equalize_roughly`]): enough for the coarse
//! levels, on whose motion the change is then measured. A change that was removed, and that the motion then
//! found explains, is given back.

use super::{brightness_scale::BrightnessScale, data_term::View, planes::Planes, planes::SITE_SPACING};
use crate::ablation::keeps;
use crate::math::robust_std;
use crate::parallel;
use crate::simd::{Level, SimdReal};
use crate::types::{Frame, Mask};

/// Differences of whole frames that motion alone rarely makes: logarithm of the ratio of their standard
/// deviations, and difference of their means over the standard deviation.
const ROUGH_CHANGE: [f64; 2] = [0.1, 0.2];
/// Approximate number of pixels of a frame that this is judged by.
const ROUGH_SAMPLES: usize = 1000;
/// Maximum standard deviation of the residual that remains, over that between frames as they are, for a
/// change to be removed; and over that of the change removed before, for another one to take its place.
const MAX_REMAINING: f64 = 0.8;
const MAX_OF_PREVIOUS: f64 = 0.98;
/// Windows along the longer side, and their minimum distance, sites: each needs enough of them.
const WINDOWS: f64 = 8.0;
const MIN_PITCH: f64 = 12.0;
/// Weight of the whole picture in each window, over that of the window: windows may have no texture.
const WHOLE_SHARE: f64 = 0.1;
/// Repetitions of the fit with robust weights.
const ROUNDS: usize = 4;
/// Residual, standard deviations, at which a pixel's weight is a half.
const HALF_WEIGHT_RESIDUAL: f64 = 2.0;
/// Bounds of the gain.
const GAIN_BOUNDS: [f64; 2] = [0.1, 10.0];
/// Minimum number of pixels, of a frame or of a measurement.
const MIN_PIXELS: usize = 128;

/// Index of the frame that the others are brought to: the one the field belongs to.
fn reference(frames: usize) -> usize {
    frames - 2
}

/// Frames with the mean and standard deviation of the reference frame; `None` if they have nearly.
pub(super) fn equalize_roughly<T: SimdReal>(frames: &[&Frame<T>], mask: Option<&Mask>) -> Option<Equalized<T>> {
    let scales: Vec<_> =
        frames.iter().map(|frame| BrightnessScale::of_samples(&[*frame], mask, ROUGH_SAMPLES)).collect();
    let known = scales[reference(frames.len())];
    let std = |scale: &BrightnessScale| scale.contrast / scale.gain;
    let is_off = !keeps("flow.brightness_change") || frames[0].data().len() < MIN_PIXELS;
    if is_off || scales.iter().any(|scale| scale.contrast <= 0.0) {
        return None;
    }
    let differs = |scale: &BrightnessScale| {
        (std(scale) / std(&known)).ln().abs() > ROUGH_CHANGE[0]
            || (scale.mean - known.mean).abs() > ROUGH_CHANGE[1] * std(&known)
    };
    scales.iter().any(differs).then(|| {
        let of = |scale: &BrightnessScale| {
            let gain = (std(scale) / std(&known)).clamp(GAIN_BOUNDS[0], GAIN_BOUNDS[1]);
            LightMap::constant([gain, scale.mean - gain * known.mean])
        };
        equalize(frames, scales.iter().map(of).collect())
    })
}

/// Frames without the change of brightness.
pub(super) struct Equalized<T> {
    pub frames: Vec<Frame<T>>,
    /// Mean square of the factors that the noise of the compared frames was multiplied by.
    pub noise_gain: f64,
    /// What was removed from each frame.
    maps: Vec<LightMap>,
}

fn equalize<T: SimdReal>(frames: &[&Frame<T>], maps: Vec<LightMap>) -> Equalized<T> {
    let mean = |map: &LightMap| map.nodes.iter().map(|[gain, _]| gain.powi(-2)).sum::<f64>() / map.nodes.len() as f64;
    let compared: Vec<f64> =
        maps.iter().enumerate().filter(|(n, _)| frames.len() == 2 || *n != 1).map(|(_, m)| mean(m)).collect();
    let noise_gain = compared.iter().sum::<f64>() / compared.len() as f64;
    let frames = frames.iter().zip(&maps).map(|(frame, map)| map.remove_from(frame)).collect();
    Equalized { frames, noise_gain, maps }
}

/// Gain and offset on a grid, bilinear between the nodes.
#[derive(Clone)]
struct LightMap {
    columns: usize,
    rows: usize,
    /// Distance of the nodes, px of the frame or sites.
    pitch: f64,
    nodes: Vec<[f64; 2]>,
}

fn blend(first: &[f64; 2], second: &[f64; 2], share: f64) -> [f64; 2] {
    [0, 1].map(|k| first[k] + share * (second[k] - first[k]))
}

impl LightMap {
    fn constant(node: [f64; 2]) -> Self {
        Self { columns: 1, rows: 1, pitch: f64::INFINITY, nodes: vec![node] }
    }

    fn identity() -> Self {
        Self::constant([1.0, 0.0])
    }

    fn is_identity(&self) -> bool {
        self.nodes.iter().all(|node| *node == [1.0, 0.0])
    }

    /// Along an axis with `count` nodes: the first of two around a position, the second, and its share.
    fn around(&self, at: f64, count: usize) -> (usize, usize, f64) {
        let at = at / self.pitch;
        let first = (at as usize).min(count.saturating_sub(2));
        (first, (first + 1).min(count - 1), (at - first as f64).clamp(0.0, 1.0))
    }

    /// Gain and offset at the columns of nodes on row `y`.
    fn line(&self, y: f64) -> Vec<[f64; 2]> {
        let (above, below, share) = self.around(y, self.rows);
        let row = |y: usize| &self.nodes[y * self.columns..][..self.columns];
        row(above).iter().zip(row(below)).map(|(a, b)| blend(a, b, share)).collect()
    }

    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let (left, right, share) = self.around(x, self.columns);
        let line = self.line(y);
        blend(&line[left], &line[right], share)
    }

    /// Both changes, on the grid of the second.
    fn then(&self, second: &Self) -> Self {
        let of = |(node, &[gain, offset]): (usize, &[f64; 2])| {
            let at = |place: usize| if place == 0 { 0.0 } else { second.pitch * place as f64 };
            let first = self.at(at(node % second.columns), at(node / second.columns));
            [first[0] * gain, first[0] * offset + first[1]]
        };
        Self { nodes: second.nodes.iter().enumerate().map(of).collect(), ..*second }
    }

    fn remove_from<T: SimdReal>(&self, frame: &Frame<T>) -> Frame<T> {
        let mut out = frame.clone();
        if self.is_identity() {
            return out;
        }
        parallel::for_each(out.data_mut().chunks_mut(frame.width().max(1)).enumerate(), |(y, row)| {
            // Linear in x between two columns of nodes.
            for first in 0..self.columns.max(2) - 1 {
                let pixel = |column: usize| ((column as f64 * self.pitch).ceil() as usize).min(row.len());
                let start = if first == 0 { 0 } else { pixel(first) };
                let end = if first + 2 >= self.columns { row.len() } else { pixel(first + 1) };
                let [gain, offset] = self.at(start as f64, y as f64);
                let steps = self.at(start as f64 + 1.0, y as f64);
                for (x, value) in row[start..end].iter_mut().enumerate() {
                    let along = x as f64;
                    let gain = gain + along * (steps[0] - gain);
                    *value = T::from_f64((value.to_f64() - offset - along * (steps[1] - offset)) / gain);
                }
            }
        });
        out
    }
}

/// What is to be removed from each frame.
pub(super) struct Change(Vec<LightMap>);

impl Change {
    /// The frames without it; `None` if there is none.
    pub fn removed_from<T: SimdReal>(self, frames: &[&Frame<T>]) -> Option<Equalized<T>> {
        (!self.0.iter().all(LightMap::is_identity)).then(|| equalize(frames, self.0))
    }
}

/// Measures the change along the `motion` of a level between `views`, those of frames without what was
/// `removed` before; `None` if that is what there is to remove. `scale`: px of the frame per px of the level.
pub(super) fn change_along<T: SimdReal>(
    simd: Level,
    (views, brightness): (&[View<'_, T>], BrightnessScale),
    (motion, scale): (&Planes<T>, f64),
    removed: Option<&Equalized<T>>,
) -> Option<Change> {
    if !keeps("flow.brightness_change") {
        return None;
    }
    let samples: Vec<Vec<f64>> = views.iter().map(|view| sample(simd, view, motion)).collect();
    let reference = reference(views.len());
    let (size, site) = ((motion.width, motion.height), scale * SITE_SPACING);
    let previous = |n: usize| removed.map_or_else(LightMap::identity, |removed| removed.maps[n].clone());
    let of = |n: usize| {
        let previous = on_sites(&previous(n), site, brightness);
        (n != reference).then(|| change(size, &samples[reference], &samples[n], &previous)).flatten()
    };
    let found: Vec<Option<LightMap>> = (0..samples.len()).map(of).collect();
    if found.iter().all(Option::is_none) {
        return None;
    }
    let map_of = |(n, found): (usize, Option<LightMap>)| {
        found.map_or_else(|| previous(n), |map| in_frames(&map, site, brightness))
    };
    Some(Change(found.into_iter().enumerate().map(map_of).collect()))
}

/// The change of the `other` brightness, from which `previous` was removed, against the `known` one; `None`
/// if it is the previous one.
fn change(size: (usize, usize), known: &[f64], other: &[f64], previous: &LightMap) -> Option<LightMap> {
    let (further, between, remaining) = fit(size, known, other)?;
    let of_site = |(site, (known, other)): (usize, (&f64, &f64))| {
        let [gain, offset] = previous.at((site % size.0) as f64, (site / size.0) as f64);
        (gain * other + offset - known).abs()
    };
    let originals = known.iter().zip(other).enumerate().map(of_site);
    let original = robust_std(&mut originals.filter(|r| r.is_finite()).collect::<Vec<f64>>())?;
    if remaining > MAX_REMAINING * original {
        return (!previous.is_identity()).then(LightMap::identity);
    }
    (remaining < MAX_OF_PREVIOUS * between).then(|| previous.then(&further))
}

/// Brightness of a view at the sites, along the motion; NaN beyond the frame.
fn sample<T: SimdReal>(simd: Level, view: &View<'_, T>, motion: &Planes<T>) -> Vec<f64> {
    let (width, height) = view.spline.size();
    let row = |y: usize| {
        let place = |site: usize, flow: &T| T::from_f64(SITE_SPACING * site as f64) + view.time * *flow;
        let xs: Vec<T> = motion.line(0, y).iter().enumerate().map(|(x, u)| place(x, u)).collect();
        let ys: Vec<T> = motion.line(1, y).iter().map(|v| place(y, v)).collect();
        let mut out = vec![T::from_f64(0.0); xs.len()];
        view.spline.sample_row(simd, &xs, &ys, &mut out);
        let inside = |at: T, count: usize| (0.0..=count as f64 - 1.0).contains(&at.to_f64());
        let usable = |x: T, y: T| {
            inside(x, width)
                && inside(y, height)
                && view.usable.is_none_or(|mask| mask.get(x.to_f64() as usize, y.to_f64() as usize))
        };
        out.iter()
            .zip(xs.iter().zip(&ys))
            .map(|(v, (x, y))| if usable(*x, *y) { v.to_f64() } else { f64::NAN })
            .collect::<Vec<f64>>()
    };
    parallel::map(0..motion.height, row).concat()
}

/// Gain and offset of the `other` brightness over the `known` one, on the sites, and the standard deviations
/// of their difference and of what remains of it; `None` for too few sites.
fn fit((width, height): (usize, usize), known: &[f64], other: &[f64]) -> Option<(LightMap, f64, f64)> {
    let pitch = (width.max(height) as f64 / WINDOWS).max(MIN_PITCH);
    let [columns, rows] = [width, height].map(|len| ((len as f64 - 1.0) / pitch).ceil() as usize + 1);
    let mut map = LightMap { columns, rows, pitch, nodes: vec![[1.0, 0.0]; columns * rows] };
    let compared = ComparedBrightness {
        width,
        columns: (0..width).map(|x| map.around(x as f64, columns)).collect(),
        known,
        other,
    };
    let before = compared.residual_std(&map)?;
    let mut scale = f64::INFINITY;
    for _ in 0..ROUNDS {
        compared.improve(&mut map, scale);
        scale = compared.residual_std(&map)?;
    }
    Some((map, before, scale))
}

/// Two brightnesses of all sites, row by row.
struct ComparedBrightness<'a> {
    width: usize,
    /// The columns of nodes around each column, and the share of the second.
    columns: Vec<(usize, usize, f64)>,
    known: &'a [f64],
    other: &'a [f64],
}

impl ComparedBrightness<'_> {
    /// Residuals of the sites of row `y`.
    fn residuals(&self, map: &LightMap, y: usize) -> impl Iterator<Item = f64> {
        let (line, first) = (map.line(y as f64), y * self.width);
        self.columns.iter().enumerate().map(move |(x, &(left, right, share))| {
            let [gain, offset] = blend(&line[left], &line[right], share);
            self.other[first + x] - gain * self.known[first + x] - offset
        })
    }

    fn rows(&self) -> usize {
        self.known.len() / self.width.max(1)
    }

    fn residual_std(&self, map: &LightMap) -> Option<f64> {
        let of_row = |y: usize| self.residuals(map, y).map(f64::abs).filter(|r| r.is_finite()).collect::<Vec<_>>();
        let mut residuals = parallel::map(0..self.rows(), of_row).concat();
        if residuals.len() < MIN_PIXELS { None } else { robust_std(&mut residuals) }
    }

    /// Fits once, with robust weights for residuals of the standard deviation `scale`.
    fn improve(&self, map: &mut LightMap, scale: f64) {
        let inverse = 1.0 / (HALF_WEIGHT_RESIDUAL * scale).max(f64::MIN_POSITIVE);
        // Of weights, of both brightnesses and of their squares: at the nodes, on a row's columns of nodes.
        let mut sums = vec![[0.0; 5]; map.nodes.len()];
        let mut line = vec![[0.0; 5]; map.columns];
        for y in 0..self.rows() {
            line.fill([0.0; 5]);
            for (x, residual) in self.residuals(map, y).enumerate().filter(|(_, residual)| residual.is_finite()) {
                let (a, b) = (self.known[y * self.width + x], self.other[y * self.width + x]);
                let weight = 1.0 / (1.0 + (residual * inverse).powi(2));
                let terms = [weight, weight * a, weight * b, weight * a * a, weight * b * b];
                let (left, right, share) = self.columns[x];
                for (column, share) in [(left, 1.0 - share), (right, share)] {
                    add(&mut line[column], share, &terms);
                }
            }
            let (above, below, share) = map.around(y as f64, map.rows);
            for (row, share) in [(above, 1.0 - share), (below, share)] {
                let nodes = sums[row * map.columns..].iter_mut().zip(&line);
                nodes.for_each(|(sums, terms)| add(sums, share, terms));
            }
        }
        let mut whole = [0.0; 5];
        for sums in &sums {
            add(&mut whole, 1.0, sums);
        }
        let share = WHOLE_SHARE / map.nodes.len() as f64;
        for (node, sums) in map.nodes.iter_mut().zip(&mut sums) {
            add(sums, share, &whole);
            let [a, b, aa, bb] = [1, 2, 3, 4].map(|k| sums[k] / sums[0].max(f64::MIN_POSITIVE));
            let gain = ((bb - b * b) / (aa - a * a)).sqrt().clamp(GAIN_BOUNDS[0], GAIN_BOUNDS[1]);
            if gain.is_finite() {
                *node = [gain, b - gain * a];
            }
        }
    }
}

fn add(sums: &mut [f64; 5], share: f64, terms: &[f64; 5]) {
    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += share * term);
}

/// A map of frames on sites, of brightness `(I - mean) gain`; `site`: distance of sites, px.
fn on_sites(map: &LightMap, site: f64, brightness: BrightnessScale) -> LightMap {
    let node = |&[gain, offset]: &[f64; 2]| [gain, (offset - brightness.mean * (1.0 - gain)) * brightness.gain];
    LightMap { pitch: map.pitch / site, nodes: map.nodes.iter().map(node).collect(), ..*map }
}

/// A map on sites, of brightness `(I - mean) gain`, in units of the frames; `site`: distance of sites, px.
fn in_frames(map: &LightMap, site: f64, brightness: BrightnessScale) -> LightMap {
    let node = |&[gain, offset]: &[f64; 2]| [gain, brightness.mean * (1.0 - gain) + offset / brightness.gain];
    LightMap { pitch: site * map.pitch, nodes: map.nodes.iter().map(node).collect(), ..*map }
}
