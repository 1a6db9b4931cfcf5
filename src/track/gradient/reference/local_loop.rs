//! The paper's loop (its figure 6): local flow in a moving window, its mean over what moves, a Gauss-Markov
//! filter that steers the window.
//!
//! M. Chiba and S. Ozawa, section on the tracking algorithm, equations (11) to (26), with the repairs that it
//! needs: a minimum of the gradients, two starts of the flow, steering by position, a maximum of innovations,
//! and a rule for targets that stop. [`Rules::paper`] is the text to the letter.

use super::extent::{Ends, Extent, ends};
use super::local_flow::{LocalFlow, MeanFlow};
use super::options::{Control, ReferenceOptions, Rules};
use crate::image::Interpolation;
use crate::math::robust_std;
use crate::track::gradient::detect::detect_moving_target;
use crate::track::gradient::gauss_markov::{GaussMarkovFilter, Measurement};
use crate::types::{Frame, TargetBox, TrackState, TrackStatus};

/// Pixels around the window that masks need.
const MARGIN: usize = 6;
/// Fewest moving pixels that a target is.
const MIN_MOVING_PIXELS: usize = 12;
/// Largest innovation squared that is taken for one of the target, four degrees of freedom.
const MAX_INNOVATION: f64 = 16.0;
/// Refusals in a row after which a measurement is taken all the same.
const MAX_REFUSALS: usize = 3;
/// Variance of position and velocity of a target too fast for local flow, px^2: whole pixels.
const FAST: f64 = 1.0;
/// Its sides differ from the target's by less than this factor.
const MAX_SIDE_RATIO: f64 = 1.6;
/// Rates of the usual count of moving pixels, up and down: parts are hidden more often than they grow.
const USUAL: [f64; 2] = [0.1, 0.03];
/// Share of the usual count from which on all of the target is seen: counts scatter.
const WHOLE: f64 = 0.85;
/// Deviation of the mean flow of what is left over the target's speed, where nearly all is hidden: the edge
/// that hides it stands still.
const SLIP: f64 = 2.0;
/// Least speed for that, px/frame.
const MIN_SLIP_SPEED: f64 = 1.0;
/// Share of the usual count below which what is left of a target is about to be hidden, and not to stop.
const HIDDEN: f64 = 0.6;
/// Share of the usual count that is missing where what is left shows nothing of the target's ends.
const MAX_MISSING_SHARE: f64 = 0.6;
/// Frames without motion after which the target counts as lost.
const MAX_MISSED_FRAMES: usize = 15;
/// Least automatic `min_speed`, px/frame.
const MIN_SPEED: f64 = 0.3;

/// Share of all moving pixels around the target from which on they are more than a few outliers.
const ALL: f64 = 0.25;
const ALL_MOVES: &str = "all around the target moves, too";

#[derive(Debug, Clone, Copy)]
struct Measured {
    mean: MeanFlow,
    ends: Option<Ends>,
    /// Whether what is around the target moves as well.
    all_moves: bool,
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(in crate::track::gradient) struct LocalLoop {
    rules: Rules,
    search_window: usize,
    control: Control,
    min_speed: Option<f64>,
    filter: GaussMarkovFilter,
    size: [f64; 2],
    /// Centre of the window.
    window_center: [f64; 2],
    /// What the window showed in the frame before.
    before: Frame<f64>,
    /// How many pixels of the target move where none is hidden; 0: not known yet.
    usual: f64,
    extent: Extent,
    /// Sides of the picture, px.
    lengths: [f64; 2],
    /// Share of these that moved in the last frame in which any did.
    seen: f64,
    refused: usize,
    missed: usize,
    /// How many pixels moved in the last frame.
    flow_count: usize,
}

/// The window that is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchWindow {
    /// Its center, px.
    pub center: [f64; 2],
    /// Its side, px.
    pub side: usize,
    /// How many pixels moved in it.
    pub flow_count: usize,
}

impl LocalLoop {
    pub fn new(frame: &Frame<f64>, bounds: TargetBox, options: &ReferenceOptions) -> Self {
        let rules = Rules::of(options);
        let centre = bounds.centre();
        let mut this = Self {
            search_window: side(options.search_window, bounds, frame.size()),
            control: options.control,
            min_speed: options.min_speed,
            filter: GaussMarkovFilter::new(centre, rules.dynamics, rules.velocity),
            size: [bounds.width, bounds.height],
            window_center: centre,
            before: Frame::default(),
            usual: 0.0,
            extent: Extent::new([bounds.width, bounds.height].map(|side| side + 0.5 * rules.flow.window as f64)),
            lengths: [frame.width() as f64, frame.height() as f64],
            seen: 1.0,
            refused: 0,
            missed: 0,
            flow_count: 0,
            rules,
        };
        this.before = this.cut(frame);
        this
    }

    /// The window, and how many pixels moved in it.
    pub fn window(&self) -> SearchWindow {
        SearchWindow { center: self.window_center(), side: self.search_window, flow_count: self.flow_count }
    }

    /// Covariance of the filter along x and y.
    pub fn covariance(&self) -> [[[f64; 3]; 3]; 2] {
        self.filter.covariance()
    }

    /// The next frame; `None`: it cannot be used.
    pub fn update(&mut self, frame: Option<&Frame<f64>>, state: &mut TrackState) {
        let second = frame.map(|frame| self.cut(frame));
        let measured = second.as_ref().map(|second| self.measure(second));
        let (found, ends) = (measured.map(|measured| measured.mean), measured.and_then(|measured| measured.ends));
        self.flow_count = found.map_or(0, |mean| mean.count);
        let all_moves = measured.is_some_and(|measured| measured.all_moves);
        let was_lost = self.missed >= MAX_MISSED_FRAMES;
        self.filter.predict();
        let (mut innovation, mut measured) = (f64::NAN, false);
        match &found {
            // The mean of what moves is not the target's.
            Some(_) if all_moves => {}
            Some(mean) if mean.count >= if self.rules.careful { MIN_MOVING_PIXELS } else { 1 } => {
                let missing = if self.rules.careful { 1.0 - self.share(mean.count) } else { 0.0 };
                let (place, lean) = self.place(mean, ends.as_ref(), missing);
                let slip = self.slip(missing);
                let [r_pos, r_vel] = self.rules.variances;
                let mut z = Measurement {
                    position: Some((place, lean.map(|lean| r_pos + lean * lean))),
                    velocity: Some((mean.velocity, slip.map(|slip| r_vel + slip * slip))),
                };
                innovation = self.filter.innovation(&z);
                let fast = second.as_ref().filter(|_| self.rules.careful && innovation >= MAX_INNOVATION);
                let fast = fast.and_then(|second| self.too_fast(second));
                z = fast.unwrap_or(z);
                if !self.rules.careful || innovation < MAX_INNOVATION || fast.is_some() || self.refused >= MAX_REFUSALS
                {
                    self.filter.update(&z);
                    (self.refused, measured) = (0, true);
                    self.count(mean.count);
                    if let Some(ends) = ends.filter(|_| self.seen >= 1.0) {
                        self.extent.learn(&ends);
                    }
                } else {
                    self.refused += 1;
                }
            }
            Some(_) if self.rules.careful && self.seen < HIDDEN => {}
            Some(_) if self.rules.careful => {
                // Nothing moves though all of it did: the target has stopped.
                self.refused = 0;
                self.filter
                    .update(&Measurement { position: None, velocity: Some(([0.0; 2], [self.rules.variances[1]; 2])) });
            }
            _ => {}
        }
        self.missed = if measured { 0 } else { self.missed + 1 };
        self.steer();
        if let Some(frame) = frame {
            self.before = self.cut(frame);
        }
        self.report(state, found, (innovation, measured, was_lost));
        if all_moves && state.status == TrackStatus::Coasting {
            state.reason = ALL_MOVES.into();
        }
    }

    /// Position of the target and its standard deviations along x and y beyond noise, px, where a share is
    /// `missing`: the middle between the ends, or the mean if these are not its own. A hidden side takes its
    /// quarter of the outline from the mean.
    fn place(&self, mean: &MeanFlow, ends: Option<&Ends>, missing: f64) -> ([f64; 2], [f64; 2]) {
        let of_mean = [0, 1].map(|k| mean.centroid[k] + self.rules.brought * mean.velocity[k]);
        let Some(ends) = ends else { return (of_mean, self.size.map(|length| missing * length)) };
        let between = self.extent.middle(ends, self.filter.position(), self.lengths);
        // Of what shows little the ends are anything's.
        let hardly = if missing > MAX_MISSING_SHARE { missing } else { 0.0 };
        let lean = |k: usize| self.size[k] * between[k].map_or(missing, |middle| middle.missing.max(hardly));
        ([0, 1].map(|k| between[k].map_or(of_mean[k], |middle| middle.at)), [0, 1].map(lean))
    }

    /// Standard deviations of the mean flow from the target's, px/frame, where a share is `missing`.
    fn slip(&self, missing: f64) -> [f64; 2] {
        self.filter.speed().map(|speed| SLIP * missing * speed.abs().max(MIN_SLIP_SPEED))
    }

    /// Share of the target that moves, by the usual count.
    fn share(&self, count: usize) -> f64 {
        if self.usual > 0.0 { (count as f64 / (WHOLE * self.usual)).min(1.0) } else { 1.0 }
    }

    fn count(&mut self, count: usize) {
        self.seen = self.share(count);
        let count_now = count as f64;
        let gain = if self.usual == 0.0 { 1.0 } else { USUAL[usize::from(count_now < self.usual)] };
        self.usual += gain * (count_now - self.usual);
    }

    /// A target farther from the prediction than local flow reaches; `second`: the window of this frame.
    fn too_fast(&self, second: &Frame<f64>) -> Option<Measurement> {
        let (corner, expected, speed) = (self.corner(), self.filter.position(), self.filter.speed());
        let near = [0, 1].map(|k| expected[k] - corner[k]);
        let found = detect_moving_target(&self.before, second, Some(near))?;
        let unlike = (0..2).any(|k| (found.displacement[k] - speed[k]).abs() > self.rules.flow.step_max);
        let alike = |found: f64, known: f64| (found / known).max(known / found) < MAX_SIDE_RATIO;
        let same = alike(found.bounds.width, self.size[0]) && alike(found.bounds.height, self.size[1]);
        let centre = found.bounds.centre();
        (unlike && same).then(|| Measurement {
            position: Some(([0, 1].map(|k| centre[k] + corner[k]), [FAST; 2])),
            velocity: Some((found.displacement, [FAST; 2])),
        })
    }

    fn measure(&self, second: &Frame<f64>) -> Measured {
        let first = &self.before;
        let velocity = self.filter.speed();
        let starts: &[[f64; 2]] = if self.rules.rest { &[[0.0; 2], velocity] } else { &[velocity] };
        let mut flow = self.rules.flow.flow_from(first, second, starts, self.rules.flat);
        self.keep_window(&mut flow);
        let min_speed = self.min_speed.unwrap_or_else(|| self.automatic_min_speed(&flow));
        let mut mean = flow.mean(min_speed);
        let all_moves = self.rules.careful && self.all_moves(&flow, &mean, min_speed);
        let corner = self.corner();
        mean.centroid = [mean.centroid[0] + corner[0], mean.centroid[1] + corner[1]];
        // What is farther than a step of local flow moves where it was and where it is.
        let near = mean.velocity[0].hypot(mean.velocity[1]) < self.rules.flow.step_max;
        let ends = ends(&flow, min_speed).filter(|_| self.rules.careful && near);
        let ends = ends.map(|ends| [0, 1].map(|k| ends[k].map(|end| end + corner[k] + mean.velocity[k])));
        Measured { mean, ends, all_moves }
    }

    fn window_center(&self) -> [f64; 2] {
        match self.control {
            Control::Integer => self.window_center.map(|at| (at + 0.5).floor()),
            Control::Subpixel => self.window_center,
        }
    }

    fn corner(&self) -> [f64; 2] {
        self.window_center().map(|at| at - (self.search_window / 2 + MARGIN) as f64)
    }

    /// The window with its margin; NaN outside the picture.
    fn cut(&self, frame: &Frame<f64>) -> Frame<f64> {
        let (corner, side) = (self.corner(), self.search_window + 2 * MARGIN);
        if self.control == Control::Integer {
            return whole_pixels(frame, corner.map(|at| at as isize), side);
        }
        let inside = |at: f64, length: usize| at >= 0.0 && at <= length as f64 - 1.0;
        Frame::from_fn(side, side, |x, y| {
            let (x, y) = (corner[0] + x as f64, corner[1] + y as f64);
            if inside(x, frame.width()) && inside(y, frame.height()) {
                Interpolation::Bilinear.at(frame, x, y)
            } else {
                f64::NAN
            }
        })
    }

    fn keep_window(&self, flow: &mut LocalFlow) {
        let inside = MARGIN..MARGIN + self.search_window;
        let (width, height) = flow.accepted.size();
        for y in 0..height {
            for x in 0..width {
                if !inside.contains(&x) || !inside.contains(&y) {
                    flow.accepted.row_mut(y)[x] = false;
                }
            }
        }
    }

    /// Three standard deviations of the accepted flow outside the target.
    fn automatic_min_speed(&self, flow: &LocalFlow) -> f64 {
        let mut sizes: Vec<f64> = self.around(flow).flat_map(|w| w.map(f64::abs)).collect();
        (3.0 * robust_std(&mut sizes).unwrap_or(0.0)).max(MIN_SPEED)
    }

    /// Whether much around the target moves: the camera moves, or the window shows another object.
    fn all_moves(&self, flow: &LocalFlow, mean: &MeanFlow, min_speed: f64) -> bool {
        let (mut moving, mut all) = (0, 0);
        for w in self.around(flow) {
            moving += usize::from(w[0].abs() >= min_speed || w[1].abs() >= min_speed);
            all += 1;
        }
        2 * moving > all && moving > MIN_MOVING_PIXELS && moving as f64 > ALL * mean.count as f64
    }

    /// Accepted flow outside the target, as far off that no window of local flow sees any of it.
    fn around(&self, flow: &LocalFlow) -> impl Iterator<Item = [f64; 2]> {
        let (corner, centre, speed) = (self.corner(), self.filter.position(), self.filter.speed());
        let usual = self.extent.mean_extent();
        let reach = [0, 1].map(|k| self.size[k].max(usual[k]) / 2.0 + MARGIN as f64 + speed[k].abs());
        let width = flow.flow.width();
        let outside = move |at: usize| {
            let place = [at % width, at / width];
            (0..2).any(|k| (corner[k] + place[k] as f64 - centre[k]).abs() > reach[k])
        };
        let pixels = flow.flow.data().iter().zip(flow.accepted.data()).enumerate();
        pixels.filter(move |(at, (_, accepted))| **accepted && outside(*at)).map(|(_, (w, _))| *w)
    }

    fn steer(&mut self) {
        let to = if self.rules.by_position {
            self.filter.position()
        } else {
            let velocity = self.filter.speed();
            [0, 1].map(|k| self.window_center[k] + velocity[k])
        };
        if to.iter().all(|at| at.is_finite()) {
            self.window_center = to;
        }
    }

    fn report(
        &self,
        state: &mut TrackState,
        found: Option<MeanFlow>,
        (innovation, measured, was_lost): (f64, bool, bool),
    ) {
        let (status, reason) = match (measured, found) {
            (true, _) => (TrackStatus::Tracking, ""),
            _ if self.missed >= MAX_MISSED_FRAMES => (TrackStatus::Lost, "nothing that moves like the target for long"),
            (_, None) => (TrackStatus::Coasting, "the frame cannot be used"),
            (_, Some(mean)) if mean.count < MIN_MOVING_PIXELS => (TrackStatus::Coasting, "nothing moves"),
            _ => (TrackStatus::Coasting, "what moves is not where the target should be"),
        };
        (state.status, state.reason) = (status, reason.into());
        state.reacquired = measured && was_lost;
        state.position = self.filter.position();
        state.velocity = self.filter.speed();
        state.scene_velocity = state.velocity;
        state.acceleration = self.filter.acceleration();
        state.covariance = self.filter.covariance();
        state.displacement = if measured { found.map_or([f64::NAN; 2], |mean| mean.velocity) } else { [f64::NAN; 2] };
        state.bounds = TargetBox::about(state.position, self.size[0], self.size[1]);
        state.rotation_observable = false;
        state.visibility = f64::from(u8::from(measured));
        state.innovation = innovation;
    }
}

/// Side of the window of small targets, px.
const MIN_SEARCH_WINDOW: usize = 51;
/// Side of the window over that of a large target.
const SEARCH_WINDOW_PER_TARGET: f64 = 1.6;

/// Odd side of the window, px: as requested, or as the target needs it; at most twice that of the frame.
fn side(wanted: Option<usize>, bounds: TargetBox, (width, height): (usize, usize)) -> usize {
    let needed = (SEARCH_WINDOW_PER_TARGET * bounds.width.max(bounds.height)) as usize;
    wanted.unwrap_or(needed.max(MIN_SEARCH_WINDOW)).min(2 * width.max(height)) | 1
}

fn whole_pixels(frame: &Frame<f64>, corner: [isize; 2], side: usize) -> Frame<f64> {
    let within = |corner: isize, length: usize| {
        let first = (-corner).clamp(0, side as isize);
        let end = (length as isize - corner).clamp(first, side as isize);
        first as usize..end as usize
    };
    let columns = within(corner[0], frame.width());
    let mut out = Frame::filled(side, side, f64::NAN);
    for y in within(corner[1], frame.height()).filter(|_| !columns.is_empty()) {
        let from = (corner[0] + columns.start as isize) as usize;
        let row = &frame.row((corner[1] + y as isize) as usize)[from..from + columns.len()];
        out.row_mut(y)[columns.clone()].copy_from_slice(row);
    }
    out
}
