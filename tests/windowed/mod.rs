//! The windowed estimate against a naive sum over each window, against exact scenes, and its conventions.

use jacoflow::flow::windowed::{RowSet, WindowedOptions};
use jacoflow::flow::{Estimator, EstimatorOptions, Method, RankPolicy};
use jacoflow::image::GaussianSmoother;
use jacoflow::jet::{JetStencil, Neighbourhood, TimeScheme};
use jacoflow::math::Real;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::synth::texture::Noise;
use jacoflow::synth::{AffineTexture, Scene, Sensor};
use jacoflow::types::{FlowField, Frame, Rect, SamplingGrid, Status};
use nalgebra::{Matrix6, Vector6};

mod calibration;
mod efficiency;

/// Rows of `[J(i); J(i')]` and of `[i'; i'']` of one pixel, as the specification of the method writes them.
fn equations(rows: usize, jet: [f64; 6], first: [f64; 6], second: [f64; 6]) -> (Vec<[f64; 6]>, Vec<f64>) {
    let block = |[_, x, y, xx, xy, yy]: [f64; 6]| {
        [
            [x, y, 0.0, 0.0, 0.0, 0.0],
            [xx, xy, x, y, 0.0, 0.0],
            [xy, yy, 0.0, 0.0, x, y],
            [0.0, 0.0, 2.0 * xx, 2.0 * xy, 0.0, 0.0],
            [0.0, 0.0, xy, yy, xx, xy],
            [0.0, 0.0, 0.0, 0.0, 2.0 * xy, 2.0 * yy],
        ]
        .map(|row| row.map(|v| -v))
    };
    let mut a = block(jet).to_vec();
    let mut b = first.to_vec();
    a.extend(block(first));
    b.extend(second);
    a.truncate(rows);
    b.truncate(rows);
    (a, b)
}

/// The estimate at one pixel by summing equation after equation. `transport`: whether the unknowns are
/// carried to each pixel of the window.
fn naive<T: Real>(
    frames: &[&Frame<T>],
    options: &WindowedOptions,
    usable: &dyn Fn(usize, usize) -> bool,
    (cx, cy): (usize, usize),
    transport: bool,
) -> Vector6<f64> {
    let stencil = JetStencil::new(&options.neighbourhood, (1.0, 1.0)).unwrap();
    let radius = options.radius() as isize;
    let (w, h) = frames[0].size();
    let (mut n, mut r) = (Matrix6::zeros(), Vector6::zeros());
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            let (x, y) = (cx as isize + dx, cy as isize + dy);
            if x < 0 || y < 0 || x >= w as isize || y >= h as isize {
                continue;
            }
            let (x, y) = (x as usize, y as usize);
            if !stencil.reach().fits((x, y), (w, h)) || !usable(x, y) {
                continue;
            }
            let jets: Vec<[f64; 6]> = frames.iter().map(|f| stencil.at_f64(f, x, y)).collect();
            let zip = |a: [f64; 6], b: [f64; 6], f: &dyn Fn(f64, f64) -> f64| -> [f64; 6] {
                std::array::from_fn(|k| f(a[k], b[k]))
            };
            let (jet, first, second) = match (frames.len(), options.scheme) {
                (2, _) => {
                    (zip(jets[0], jets[1], &|a, b| f64::midpoint(a, b)), zip(jets[1], jets[0], &|a, b| a - b), [0.0; 6])
                }
                (_, TimeScheme::Central) => (
                    jets[1],
                    zip(jets[2], jets[0], &|a, b| (a - b) / 2.0),
                    std::array::from_fn(|k| jets[2][k] - 2.0 * jets[1][k] + jets[0][k]),
                ),
                (_, TimeScheme::Backward) => (
                    jets[2],
                    zip(jets[2], jets[1], &|a, b| a - b),
                    std::array::from_fn(|k| jets[2][k] - 2.0 * jets[1][k] + jets[0][k]),
                ),
            };
            let (a, b) = equations(options.rows.count(), jet, first, second);
            let weight = (-0.5 * (dx * dx + dy * dy) as f64 / options.sigma.powi(2)).exp();
            let (dx, dy) = (dx as f64, dy as f64);
            for (a, b) in a.iter().zip(b) {
                let row = if transport {
                    [a[0], a[1], a[2] + dx * a[0], a[3] + dx * a[1], a[4] + dy * a[0], a[5] + dy * a[1]]
                } else {
                    *a
                };
                let row = Vector6::from(row);
                n += weight * row * row.transpose();
                r += weight * b * row;
            }
        }
    }
    n.lu().solve(&r).unwrap_or_else(|| Vector6::repeat(f64::NAN))
}

/// Frames as they come, and rows that a pair has too.
fn raw() -> WindowedOptions {
    WindowedOptions { presmooth: None, rows: RowSet::Gradient, ..WindowedOptions::default() }
}

fn windowed(options: WindowedOptions, common: EstimatorOptions) -> Estimator {
    Estimator::new(Method::Windowed(options), common).unwrap()
}

fn estimate<T: Precision>(frames: &[Frame<T>], options: &WindowedOptions, common: &EstimatorOptions) -> FlowField<T> {
    T::run(frames, &windowed(options.clone(), common.clone()))
}

/// The two precisions (the estimator's own bound is private).
trait Precision: Real {
    fn run(frames: &[Frame<Self>], estimator: &Estimator) -> FlowField<Self>;
}
macro_rules! precision {
    ($t:ty) => {
        impl Precision for $t {
            fn run(frames: &[Frame<$t>], estimator: &Estimator) -> FlowField<$t> {
                estimator.estimate(&frames.iter().collect::<Vec<_>>(), 0).unwrap()
            }
        }
    };
}
precision!(f32);
precision!(f64);

fn texture(size: (usize, usize), motion: [f64; 6], seed: u64, times: &[f64]) -> Vec<Frame<f64>> {
    let scene = AffineTexture::moving(size, motion, seed).unwrap();
    times.iter().map(|&t| scene.frame(t)).collect()
}

const TRIPLE: [f64; 3] = [-1.0, 0.0, 1.0];
const REFERENCE: [f64; 6] = [0.3, -0.2, 0.01, 0.02, -0.02, 0.01];

fn single(frames: &[Frame<f64>]) -> Vec<Frame<f32>> {
    frames.iter().map(|f| f.map(|v| *v as f32)).collect()
}

#[test]
fn equals_the_naive_sum_everywhere() {
    let frames = texture((61, 47), REFERENCE, 3, &TRIPLE);
    let mut cases = Vec::new();
    for rows in RowSet::ALL {
        for scheme in [TimeScheme::Central, TimeScheme::Backward] {
            cases.push(WindowedOptions { rows, scheme, sigma: 2.5, ..raw() });
        }
        if rows != RowSet::All {
            cases.push(WindowedOptions { rows, frames: 2, sigma: 2.0, ..raw() });
        }
    }
    cases.push(WindowedOptions { rows: RowSet::All, neighbourhood: Neighbourhood::square(5), ..raw() });
    let offsets = vec![(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (2, -1)];
    let points = Neighbourhood::Points { offsets, sigma: None };
    cases.push(WindowedOptions { neighbourhood: points, ..raw() });
    for options in cases {
        let frames = &frames[..options.frames];
        let field = estimate(frames, &options, &EstimatorOptions::default());
        let refs: Vec<&Frame<f64>> = frames.iter().collect();
        let coarse = estimate(&single(frames), &options, &EstimatorOptions::default());
        for (x, y) in [(30, 20), (2, 2), (58, 44), (2, 44), (17, 23), (40, 3)] {
            let want = naive(&refs, &options, &|_, _| true, (x, y), true);
            let index = y * 61 + x;
            for (k, want) in want.iter().enumerate() {
                let got = field.motion[k * field.len() + index];
                assert!((got - want).abs() < 1e-9, "{options:?} at {x} {y}, {k}: {got} {want}");
                let got = f64::from(coarse.motion[k * field.len() + index]);
                assert!((got - want).abs() < 2e-4, "single precision, {options:?} at {x} {y}, {k}: {got} {want}");
            }
        }
    }
}

/// Root mean square error of flow (px) and Jacobian (mean over its entries, 1/frame), over the sites `border`
/// px inside.
struct Errors {
    flow: f64,
    jacobian: f64,
    count: f64,
}

impl Errors {
    fn new() -> Self {
        Self { flow: 0.0, jacobian: 0.0, count: 0.0 }
    }
    fn add(&mut self, got: [f64; 6], want: [f64; 6]) {
        let e: Vec<f64> = got.iter().zip(want).map(|(g, w)| g - w).collect();
        self.flow += e[0] * e[0] + e[1] * e[1];
        self.jacobian += e[2..].iter().map(|e| e * e).sum::<f64>() / 4.0;
        self.count += 1.0;
    }
    fn rms(&self) -> [f64; 2] {
        [(self.flow / self.count).sqrt(), (self.jacobian / self.count).sqrt()]
    }
}

/// Four estimators on a texture of 2 px, clean and as a noisy camera saw it: each figure within a quarter of
/// the published one, the transported twelve rows best in both columns.
///
/// Statistics: frames of 96 x 96, a border of 10 px left out, several textures.
#[test]
fn table_of_estimators() {
    let (side, border, step) = (96usize, 10usize, 4usize);
    let published = [
        ("per pixel", [0.22, 0.22], [0.51, 0.21]),
        ("row 1", [0.040, 0.0020], [0.032, 0.0026]),
        ("twelve rows, constant", [0.039, 0.011], [0.048, 0.012]),
        ("twelve rows, transported", [0.0135, 0.0012], [0.0201, 0.0022]),
    ];
    let mut errors: Vec<[Errors; 2]> = (0..4).map(|_| [Errors::new(), Errors::new()]).collect();
    for seed in 0..6u64 {
        let scene = AffineTexture::reference(side, side, 40 + seed).unwrap();
        let clean: Vec<Frame<f64>> = TRIPLE.iter().map(|&t| scene.frame(t)).collect();
        let sensor = Sensor::eight_bit(2.0, seed);
        let smoother = GaussianSmoother::new(1.5).unwrap();
        let noisy: Vec<Frame<f64>> =
            clean.iter().enumerate().map(|(k, f)| smoother.apply(&sensor.apply(f, k as u64))).collect();
        for (column, frames) in [clean, noisy].iter().enumerate() {
            let refs: Vec<&Frame<f64>> = frames.iter().collect();
            let all = WindowedOptions { rows: RowSet::All, truncate: 4.0, ..raw() };
            let one = WindowedOptions { rows: RowSet::Brightness, ..all.clone() };
            let fields = [
                Estimator::new(Method::parse("instantaneous").unwrap(), EstimatorOptions::default())
                    .unwrap()
                    .estimate(&refs, 0)
                    .unwrap(),
                estimate(frames, &one, &EstimatorOptions::default()),
                estimate(frames, &all, &EstimatorOptions::default()),
            ];
            for y in border..side - border {
                for x in border..side - border {
                    let want = scene.motion(x as f64, y as f64, 0.0).unwrap().to_array();
                    for (row, field) in [0, 1, 3].into_iter().zip(&fields) {
                        let got = field.affine(y * side + x).to_array();
                        // The per-pixel form leaves out what it calls unobservable.
                        if got[0].is_finite() {
                            errors[row][column].add(got, want);
                        }
                    }
                    if x % step == 2 && y % step == 2 && seed < 2 {
                        let got = naive(&refs, &all, &|_, _| true, (x, y), false);
                        errors[2][column].add(got.into(), want);
                    }
                }
            }
        }
    }
    for ((name, clean, noisy), errors) in published.iter().zip(&errors) {
        for (want, errors) in [clean, noisy].into_iter().zip(errors) {
            let got = errors.rms();
            println!("{name}: {got:.4?} (published {want:?})");
            for (got, want) in got.iter().zip(want) {
                assert!((got / want - 1.0).abs() < 0.25, "{name}: {got} where {want} is published");
            }
        }
    }
    let best = &errors[3];
    for other in &errors[..3] {
        for column in 0..2 {
            let (a, b) = (best[column].rms(), other[column].rms());
            assert!(a[0] < b[0] && a[1] < b[1]);
        }
    }
}

/// A texture of 3 px, where discretisation is small, moving by `motion` at the centre of 64 x 64 pixels.
fn soft(motion: [f64; 6]) -> Vec<Frame<f64>> {
    let scene = AffineTexture::with_noise((64, 64), motion, Noise::new(3.0, 40.0, 128.0, 8).unwrap());
    TRIPLE.iter().map(|&t| scene.frame(t)).collect()
}

#[test]
fn each_parameter_is_what_its_name_says() {
    for rows in RowSet::ALL {
        for k in 0..6 {
            let mut motion = [0.0; 6];
            motion[k] = if k < 2 { 0.2 } else { 0.01 };
            let options = WindowedOptions { rows, ..raw() };
            let got = estimate(&soft(motion), &options, &EstimatorOptions::default()).affine(32 * 64 + 32).to_array();
            // The centre of the frame lies between four pixels: the flow there differs by half a derivative.
            let near = 0.1 * motion[k];
            for (j, got) in got.iter().enumerate() {
                let half = if j < 2 { 0.5 * (motion[2 + j] + motion[4 + j]) } else { 0.0 };
                let slack = if j < 2 { 0.01 } else { 5e-4 };
                assert!((got - motion[j] - half).abs() < near.max(slack), "{rows:?} {k} {j}: {got}");
            }
        }
    }
}

#[test]
fn gain_and_sample_type_never_change_the_flow() {
    let camera = Sensor::eight_bit(1.0, 4);
    let bytes: Vec<Frame<f64>> =
        texture((50, 40), REFERENCE, 6, &TRIPLE).iter().enumerate().map(|(k, f)| camera.apply(f, k as u64)).collect();
    let options = WindowedOptions { presmooth: Some(1.0), ..raw() };
    let common = EstimatorOptions { covariance: true, ..EstimatorOptions::default() };
    let as_is = estimate(&single(&bytes), &options, &common);
    let doubled: Vec<_> = single(&bytes).iter().map(|f| f.map(|v| v * 256.0)).collect();
    let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    let twice = estimate(&doubled, &options, &common);
    assert!(same(&as_is.motion, &twice.motion) && as_is.status == twice.status);
    assert!(same(as_is.covariance.as_ref().unwrap(), twice.covariance.as_ref().unwrap()));
    // u16 spans 257 times u8; floats may lie in [0, 1].
    for gain in [257.0, 1.0 / 255.0] {
        let other: Vec<_> = single(&bytes).iter().map(|f| f.map(|v| v * gain)).collect();
        let other = estimate(&other, &options, &common);
        assert_eq!(as_is.status, other.status);
        for (a, b) in as_is.motion.iter().zip(&other.motion).filter(|(a, _)| a.is_finite()) {
            assert!((a - b).abs() < 2e-4, "{gain}: {a} {b}");
        }
    }
}

#[test]
fn damage_stays_where_windows_touch_it() {
    let clean = single(&texture((96, 90), REFERENCE, 7, &TRIPLE));
    let mut broken = clean.clone();
    for y in 30..50 {
        for x in 40..60 {
            broken[1].data_mut()[y * 96 + x] = f32::NAN;
        }
    }
    let mask = Frame::from_fn(96, 90, |x, y| !((30..50).contains(&y) && (40..60).contains(&x)));
    for presmooth in [None, Some(1.0)] {
        let options = WindowedOptions { presmooth, sigma: 3.0, ..raw() };
        let common = EstimatorOptions { covariance: true, ..EstimatorOptions::default() };
        let whole = estimate(&clean, &options, &common);
        let masked_common = EstimatorOptions { mask: Some(mask.clone()), ..common.clone() };
        let own = 1 + presmooth.map_or(0, |s| (4.0 * s + 0.5) as usize);
        let window = options.radius() + own;
        for (field, word) in [
            (estimate(&broken, &options, &common), Status::NonFinite),
            (estimate(&clean, &options, &masked_common), Status::Masked),
            (estimate(&broken, &options, &masked_common), Status::Masked),
        ] {
            for y in 0..90usize {
                for x in 0..96usize {
                    let away = |r: usize| x + r < 40 || x >= 60 + r || y + r < 30 || y >= 50 + r;
                    let i = y * 96 + x;
                    if !away(own) {
                        assert!(field.status[i] == word && field.motion[i].is_nan(), "{x} {y} {:?}", field.status[i]);
                    } else if away(window) {
                        for k in 0..6 {
                            let (a, b) = (field.motion[k * field.len() + i], whole.motion[k * field.len() + i]);
                            assert!(a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()), "{x} {y}");
                        }
                        assert_eq!(field.status[i], whole.status[i]);
                    } else if field.status[i] == Status::Ok {
                        assert!((field.motion[i] - whole.motion[i]).abs() < 0.3);
                        assert!(field.covariance_at(i).unwrap()[0][0] > 0.0);
                    }
                }
            }
            // Half a window of data is enough.
            assert_eq!(field.status[40 * 96 + 40 - own - 1], Status::Ok);
        }
        let refs: Vec<&Frame<f32>> = clean.iter().collect();
        if presmooth.is_none() {
            let field = estimate(&broken, &options, &common);
            let far = |x: usize, y: usize| x + 1 < 40 || x > 60 || y + 1 < 30 || y > 50;
            let want = naive(&refs, &options, &far, (37, 36), true);
            for (k, want) in want.iter().enumerate() {
                let got = f64::from(field.motion[k * field.len() + 36 * 96 + 37]);
                assert!((got - want).abs() < 2e-4, "{k}: {got} {want}");
            }
        }
    }
}

#[test]
fn sites_threads_and_levels_agree() {
    let frames = single(&texture((150, 170), REFERENCE, 9, &TRIPLE));
    for (rows, presmooth) in [(RowSet::Gradient, Some(1.0)), (RowSet::All, None), (RowSet::Brightness, None)] {
        let options = WindowedOptions { rows, presmooth, sigma: 2.0, ..raw() };
        let common = EstimatorOptions { covariance: true, diagnostics: true, ..EstimatorOptions::default() };
        let threads = |n| EstimatorOptions { threads: Threads::new(Some(n)).unwrap(), ..common.clone() };
        let dense = estimate(&frames, &options, &threads(1));
        assert_eq!(bits(&dense), bits(&estimate(&frames, &options, &threads(2))));
        let plane = |f: &FlowField<f32>, k: usize, i: usize| f.motion[k * f.len() + i].to_bits();
        let scattered: Vec<(usize, usize)> = (0..4).map(|k| (7 + 40 * k, 3 + 50 * k)).collect();
        let crowded: Vec<(usize, usize)> = (0..600).map(|k| (60 + k % 30, 70 + k / 30)).collect();
        for sites in [
            SamplingGrid::Grid { region: None, stride: 7 },
            SamplingGrid::Grid { region: Some(Rect { x: 31, y: 90, width: 33, height: 50 }), stride: 3 },
            SamplingGrid::Points(scattered),
            SamplingGrid::Points(crowded),
            SamplingGrid::Points(Vec::new()),
        ] {
            let part = estimate(&frames, &options, &EstimatorOptions { sites: sites.clone(), ..common.clone() });
            for i in 0..part.len() {
                let (x, y) = sites.pixel(i % part.width, i / part.width);
                let j = y * 150 + x;
                assert_eq!(part.status[i], dense.status[j]);
                assert!((0..6).all(|k| plane(&part, k, i) == plane(&dense, k, j)), "{rows:?} {sites:?} {x} {y}");
                let (a, b) = (part.covariance_at(i).unwrap(), dense.covariance_at(j).unwrap());
                assert!(a == b || a[0][0].is_nan() && b[0][0].is_nan(), "{rows:?} {sites:?} {x} {y}");
            }
        }
        let fine: Vec<Frame<f64>> = frames.iter().map(|f| f.map(|v| f64::from(*v))).collect();
        for level in Level::available() {
            let common = EstimatorOptions { simd: Some(level), ..common.clone() };
            let (coarse, fine) = (estimate(&frames, &options, &common), estimate(&fine, &options, &common));
            for (a, b) in coarse.motion.iter().zip(&fine.motion) {
                assert!((f64::from(*a) - b).abs() < 1e-3 || (a.is_nan() && b.is_nan()), "{level:?}: {a} {b}");
            }
            for i in 0..fine.len() {
                let (a, b) = (coarse.covariance_at(i).unwrap(), fine.covariance_at(i).unwrap());
                for (k, l) in (0..6).flat_map(|k| (k..6).map(move |l| (k, l))) {
                    let (a, exact) = (a[k][l], b[k][l]);
                    // Terms of a covariance cancel: what rounding leaves of it is a share of the variances.
                    let tolerance = 1e-3 * (b[k][k] * b[l][l]).sqrt();
                    let agrees = (a - exact).abs() < tolerance || (a.is_nan() && exact.is_nan());
                    assert!(agrees, "{level:?}, site {i}, {k} {l}: {a} {exact}");
                }
            }
        }
    }
}

fn bits(field: &FlowField<f32>) -> Vec<u32> {
    let planes = [Some(&field.motion), field.covariance.as_ref(), field.residual.as_ref(), field.condition.as_ref()];
    planes.into_iter().flatten().flatten().map(|v| v.to_bits()).collect()
}

#[test]
fn what_cannot_be_seen_is_said() {
    let common = EstimatorOptions { diagnostics: true, covariance: true, ..EstimatorOptions::default() };
    let flat = vec![Frame::filled(40, 30, 77.7f32); 3];
    let stripes: Vec<Frame<f32>> =
        (0..3).map(|t| Frame::from_fn(40, 30, |x, _| 50.0 * ((x as f32 - 0.2 * t as f32) * 0.6).sin())).collect();
    for rows in RowSet::ALL {
        for presmooth in [None, Some(1.2)] {
            let options = WindowedOptions { rows, presmooth, ..raw() };
            let field = estimate(&flat, &options, &common);
            assert!(field.status.iter().all(|s| matches!(s, Status::Unobservable | Status::Border)));
            assert!(field.motion.iter().all(|v| v.is_nan()) && field.rank.unwrap().iter().all(|r| *r == 0));
            let field = estimate(&stripes, &options, &common);
            let i = 15 * 40 + 20;
            assert_eq!(field.status[i], Status::Unobservable, "{rows:?} {presmooth:?}");
            let rank = field.rank.unwrap()[i];
            assert!((1..6).contains(&rank) && field.motion[i].is_nan(), "{rows:?} {rank}");
            let least = WindowedOptions { rank_deficient: RankPolicy::MinNorm, ..options };
            let field = estimate(&stripes, &least, &common);
            assert_eq!(field.status[i], Status::MinNorm);
            let m = field.affine(i);
            assert!((m.u - 0.2).abs() < 0.02 && m.v.abs() < 1e-3, "{rows:?} {m:?}");
        }
    }
}

#[test]
fn options_are_checked_by_name() {
    let refused = |options: WindowedOptions| {
        Estimator::new(Method::Windowed(options), EstimatorOptions::default()).unwrap_err().to_string()
    };
    let base = raw;
    assert!(refused(WindowedOptions { sigma: 0.0, ..base() }).starts_with("sigma"));
    assert!(refused(WindowedOptions { sigma: 1e9, ..base() }).starts_with("sigma"));
    assert!(refused(WindowedOptions { truncate: f64::NAN, ..base() }).starts_with("truncate"));
    assert!(refused(WindowedOptions { frames: 4, ..base() }).starts_with("frames"));
    assert!(refused(WindowedOptions { frames: 2, rows: RowSet::All, ..base() }).starts_with("rows"));
    assert!(refused(WindowedOptions { presmooth: Some(-1.0), ..base() }).starts_with("presmooth"));
    assert!(RowSet::parse("rows").unwrap_err().to_string().starts_with("rows"));
    for set in RowSet::ALL {
        assert_eq!(RowSet::parse(set.name()).unwrap(), set);
    }
    // Frames smaller than the window, and a pair.
    let tiny = texture((5, 4), REFERENCE, 2, &TRIPLE);
    let field = estimate(&tiny, &base(), &EstimatorOptions { covariance: true, ..EstimatorOptions::default() });
    assert_eq!((field.width, field.height), (5, 4));
    let pair = estimate(&tiny[..2], &WindowedOptions { frames: 2, ..base() }, &EstimatorOptions::default());
    assert_eq!(pair.layout.frame_index, 0);
}

#[test]
fn a_jump_is_contradicted_and_a_small_motion_is_not() {
    for (frames, options) in [(3, WindowedOptions::default()), (2, WindowedOptions::pair())] {
        for (seed, motion, is_jump) in [
            (31, [0.3, -0.2], false),
            (32, [0.9, 0.4], false),
            (33, [12.0, -5.0], true),
            (34, [30.0, 20.0], true),
            (35, [80.0, -3.0], true),
        ] {
            let [u, v] = motion;
            let noises = texture((96, 96), [u, v, 0.002, 0.004, -0.004, 0.002], seed, &[-1.0, 0.0, 1.0][..frames]);
            let camera = Sensor::eight_bit(2.0, seed);
            let noisy: Vec<Frame<f64>> = noises.iter().zip(0..).map(|(f, t)| camera.apply(f, t)).collect();
            let common = EstimatorOptions { covariance: true, ..EstimatorOptions::default() };
            let estimator = Estimator::new(Method::Windowed(options.clone()), common).unwrap();
            let field = estimator.estimate(&noisy.iter().collect::<Vec<_>>(), 0).unwrap();
            let known: Vec<Status> = field.status.iter().copied().filter(|status| status.has_estimate()).collect();
            let contradicted = known.iter().filter(|&&status| status == Status::Inconsistent).count();
            let share = contradicted as f64 / known.len() as f64;
            println!("{frames} frames, {motion:?}: {share:.3} inconsistent");
            assert!(if is_jump { share > 0.9 } else { share < 0.001 }, "{frames} {motion:?}: {share}");
            let is_kept = |site: usize| field.motion[site].is_finite() || field.status[site] != Status::Inconsistent;
            assert!((0..field.len()).all(is_kept));
        }
    }
}
