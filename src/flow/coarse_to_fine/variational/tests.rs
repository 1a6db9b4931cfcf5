use super::*;
use crate::flow::coarse_to_fine::planes::SITE_SPACING;
use crate::image::Spline;
use crate::types::Frame;

const SIZE: (usize, usize) = (150, 90);

/// Band-limited texture.
fn texture(x: f64, y: f64) -> f64 {
    40.0 * ((0.9 * x + 0.3 * y).sin() + (0.7 * y - 0.4 * x + 1.0).sin() + (0.45 * x + 0.6 * y).cos())
}

/// The second frame shows at `x + u(x)` what the first shows at `x`; `position` is the inverse of that.
fn refined(
    level: Level,
    position: impl Fn(f64, f64) -> (f64, f64),
    start: impl Fn(f64, f64) -> [f64; MOTION],
) -> Planes<f64> {
    let first = Frame::from_fn(SIZE.0, SIZE.1, |x, y| texture(x as f64, y as f64));
    let second = Frame::from_fn(SIZE.0, SIZE.1, |x, y| {
        let (x, y) = position(x as f64, y as f64);
        texture(x, y)
    });
    let splines = [first, second].map(|frame| Spline::new(level, &frame));
    let (space, sites) = (PlanePool::default(), (SIZE.0.div_ceil(2), SIZE.1.div_ceil(2)));
    let mut motion = Planes::new(sites.0, sites.1, MOTION);
    for y in 0..sites.1 {
        for x in 0..sites.0 {
            let values = start(SITE_SPACING * x as f64, SITE_SPACING * y as f64);
            (0..MOTION).for_each(|k| motion.line_mut(k, y)[x] = values[k]);
        }
    }
    let views = View::ahead([&splines[0], &splines[1]], [None, None]);
    let PixelMotion { unrefined: mut flow, moves } = PixelMotion::new(level, &space, (&views, 50.0), &motion, SIZE);
    for y in 0..SIZE.1 {
        for k in 0..2 {
            flow.line_mut(k, y).iter_mut().zip(moves.line(k, y)).for_each(|(flow, by)| *flow += by);
        }
    }
    flow
}

/// Mean distance of `u` from `truth` over the columns, away from the border.
fn error(flow: &Planes<f64>, truth: impl Fn(f64) -> f64, columns: Range<usize>) -> f64 {
    let (rows, count) = (8..SIZE.1 - 8, (columns.len() * (SIZE.1 - 16)) as f64);
    rows.map(|y| columns.clone().map(|x| (flow.at(0, x, y) - truth(x as f64)).abs()).sum::<f64>()).sum::<f64>() / count
}

#[test]
fn right_affine_flow_stays() {
    for level in Level::available() {
        let flow = refined(level, |x, y| ((x - 0.3) / 1.04, y), |x, _| [0.3 + 0.04 * x, 0.0, 0.04, 0.0, 0.0, 0.0]);
        assert!(error(&flow, |x| 0.3 + 0.04 * x, 4..SIZE.0 - 14) < 1e-3, "{}", level.name());
        assert!((0..SIZE.0).all(|x| (flow.at(2, x, 40) - 0.04).abs() < 1e-12), "{}", level.name());
    }
}

#[test]
fn blurred_boundary_becomes_sharp() {
    let truth = |x: f64| if x < 75.0 { 0.5 } else { -0.5 };
    // Between the surfaces the second frame shows both: those pixels are not judged.
    let second = |x: f64, y: f64| (x - truth(x), y);
    let start = |x: f64, _: f64| [((75.0 - x) / 12.0).clamp(-0.5, 0.5), 0.0, 0.0, 0.0, 0.0, 0.0];
    let blurred = |columns: Range<usize>| {
        let count = columns.len() as f64;
        columns.map(|x| (start(x as f64, 0.0)[0] - truth(x as f64)).abs()).sum::<f64>() / count
    };
    let mut flows = Vec::new();
    for level in Level::available() {
        let flow = refined(level, second, start);
        for columns in [69..74, 77..82] {
            let found = error(&flow, truth, columns.clone());
            assert!(found < 0.3 * blurred(columns), "{}: {found}", level.name());
        }
        flows.push(flow);
    }
    // Lanes fuse multiplications with additions.
    for flow in &flows[1..] {
        for y in 0..SIZE.1 {
            let apart = flow.line(0, y).iter().zip(flows[0].line(0, y)).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-9);
        }
    }
}
