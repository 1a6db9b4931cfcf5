//! Entry point of all methods.

use super::baseline::{HornSchunck, LucasKanade};
use super::coarse_to_fine::CoarseToFine;
use super::instantaneous::Instantaneous;
use super::intake::Intake;
use super::methods::Method;
use super::model::ModelKind;
use super::options::EstimatorOptions;
use super::windowed::Windowed;
use crate::error::{Error, Result};
use crate::simd::{SimdReal, same, same_mut};
use crate::types::{FieldLayout, FlowField, Frame};

/// Maximum standard deviation of the noise in single precision, grey levels: squares overflow.
const MAX_SINGLE_NOISE: f64 = 1e12;

/// A method made ready: options checked, stencils and kernels computed.
///
/// ```
/// use jacoflow::flow::{EstimatorOptions, Estimator, Method};
/// use jacoflow::types::Frame;
/// let estimator = Estimator::new(Method::parse("instantaneous")?, EstimatorOptions::default())?;
/// let frames: Vec<Frame<f64>> = (0..3)
///     .map(|t| {
///         let wave = |x: f64, y: f64| (0.7 * x).sin() * 50.0 + (0.4 * y).cos() * 40.0;
///         Frame::from_fn(8, 8, |x, y| wave(x as f64 - 0.25 * t as f64, y as f64))
///     })
///     .collect();
/// let field = estimator.estimate(&[&frames[0], &frames[1], &frames[2]], 0)?;
/// assert_eq!((field.width, field.height, field.layout.frame_index), (8, 8, 1));
/// # Ok::<(), jacoflow::Error>(())
/// ```
#[derive(Debug)]
pub struct Estimator {
    engine: Engine,
    method: Method,
    options: EstimatorOptions,
}

#[derive(Debug)]
enum Engine {
    CoarseToFine(CoarseToFine),
    Instantaneous(Box<Instantaneous>),
    Windowed(Box<Windowed>),
    LucasKanade(LucasKanade),
    HornSchunck(HornSchunck),
}

impl Estimator {
    /// Checks the options and prepares the method.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option that cannot be used.
    pub fn new(method: Method, options: EstimatorOptions) -> Result<Self> {
        options.check()?;
        if options.initial.is_some() && !method.info().takes_initial {
            return Err(Error::argument("initial", "method coarse_to_fine", method.name()));
        }
        let engine = match &method {
            Method::CoarseToFine(o) => Engine::CoarseToFine(CoarseToFine::new(o)?),
            Method::Instantaneous(o) => Engine::Instantaneous(Box::new(Instantaneous::new(o, &options)?)),
            Method::Windowed(o) => Engine::Windowed(Box::new(Windowed::new(o)?)),
            Method::LucasKanade(o) => Engine::LucasKanade(LucasKanade::new(o, &options)?),
            Method::HornSchunck(o) => Engine::HornSchunck(HornSchunck::new(o, &options)?),
        };
        Ok(Self { engine, method, options })
    }

    /// The method with its options.
    pub fn method(&self) -> &Method {
        &self.method
    }
    /// The shared options.
    pub fn options(&self) -> &EstimatorOptions {
        &self.options
    }

    /// Frames that one field is estimated from: 3, or 2 for a baseline that differences a pair.
    pub fn frames_needed(&self) -> usize {
        match &self.engine {
            Engine::CoarseToFine(e) => e.frames_needed(),
            Engine::Instantaneous(_) => 3,
            Engine::Windowed(e) => e.frames_needed(),
            Engine::LucasKanade(e) => e.frames_needed(),
            Engine::HornSchunck(e) => e.frames_needed(),
        }
    }

    /// Which of the frames the field belongs to, 0 being the oldest.
    pub fn reference_frame(&self) -> usize {
        match &self.engine {
            Engine::CoarseToFine(e) => e.frame(),
            Engine::Instantaneous(e) => e.frame(),
            Engine::Windowed(e) => e.frame(),
            Engine::LucasKanade(e) => e.frame(),
            Engine::HornSchunck(e) => e.frame(),
        }
    }

    /// The motion model: what the planes of the field are.
    pub fn model(&self) -> ModelKind {
        match &self.engine {
            Engine::Instantaneous(e) => e.model(),
            Engine::CoarseToFine(_) | Engine::Windowed(_) => ModelKind::Affine,
            Engine::LucasKanade(_) | Engine::HornSchunck(_) => ModelKind::Translational,
        }
    }

    /// Flow at the sites, from [`Estimator::frames_needed`] frames, oldest first; the first of them is frame
    /// `first_index` of its sequence.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `frames` when their number or sizes are wrong or they are smaller than 3x3;
    /// naming `mask`, `region` or `points` when those do not fit the frames.
    pub fn estimate<T: SimdReal>(&self, frames: &[&Frame<T>], first_index: usize) -> Result<FlowField<T>> {
        self.check(frames)?;
        let mut field = FlowField::unwritten(self.layout(frames[0].size(), first_index), self.options.covariance)?;
        self.fill(frames, &mut field)?;
        Ok(field)
    }

    /// As [`Estimator::estimate`], into an existing field: nothing is allocated if its size fits.
    ///
    /// # Errors As [`Estimator::estimate`]; the field's values are then unspecified.
    pub fn estimate_into<T: SimdReal>(
        &self,
        frames: &[&Frame<T>],
        first_index: usize,
        field: &mut FlowField<T>,
    ) -> Result<()> {
        self.check(frames)?;
        let layout = self.layout(frames[0].size(), first_index);
        let shape = layout.sites.shape(layout.frame_size)?;
        let (n, p) = (shape.0 * shape.1, layout.parameters.len());
        let covariance = if self.options.covariance { Some(p * (p + 1) / 2 * n) } else { None };
        let fits = (field.width, field.height) == shape
            && field.motion.len() == p * n
            && field.status.len() == n
            && field.covariance.as_ref().map(Vec::len) == covariance;
        if fits {
            field.layout = layout;
        } else {
            *field = FlowField::unwritten(layout, self.options.covariance)?;
        }
        self.fill(frames, field)
    }

    /// The layout of a field from these frames.
    pub(crate) fn layout(&self, frame_size: (usize, usize), first_index: usize) -> FieldLayout {
        let model = self.model();
        FieldLayout {
            frame_size,
            sites: self.options.sites.clone(),
            model: model.name().into(),
            parameters: model.parameters().iter().map(|p| p.name.to_string()).collect(),
            units: self.options.units.clone(),
            interval: self.method.interval(),
            frame_index: first_index + self.reference_frame(),
            correlation_length: self.method.correlation_length(),
        }
    }

    fn check<T: SimdReal>(&self, frames: &[&Frame<T>]) -> Result<()> {
        let needed = self.frames_needed();
        if frames.len() != needed {
            return Err(Error::argument("frames", format!("{needed} frames"), format!("{} frames", frames.len())));
        }
        let (w, h) = frames[0].size();
        if let Some(other) = frames.iter().find(|f| f.size() != (w, h)) {
            let got = format!("one of {} x {}", other.width(), other.height());
            return Err(Error::argument("frames", format!("frames of one size (the first is {w} x {h})"), got));
        }
        if w < 3 || h < 3 {
            return Err(Error::argument("frames", "at least 3 x 3 pixels", format!("{w} x {h}")));
        }
        if let Some(mask) = self.options.mask.as_ref().filter(|m| m.size() != (w, h)) {
            let got = format!("{} x {}", mask.width(), mask.height());
            return Err(Error::argument("mask", format!("the size of the frames, {w} x {h}"), got));
        }
        if let Some(initial) = self.options.initial.as_ref().filter(|i| [i.u.size(), i.v.size()] != [(w, h); 2]) {
            let got = format!("{} x {}", initial.u.width(), initial.u.height());
            return Err(Error::argument("initial", format!("a flow of the frames' size, {w} x {h}"), got));
        }
        if let Some(noise) =
            self.options.noise.filter(|noise| *noise > MAX_SINGLE_NOISE && size_of::<T>() == size_of::<f32>())
        {
            let expected = format!("at most {MAX_SINGLE_NOISE:e} grey levels in single precision");
            return Err(Error::argument("noise", expected, noise));
        }
        Ok(())
    }

    /// Calls the instance for the precision: both are compiled here, not in every calling crate.
    fn fill<T: SimdReal>(&self, frames: &[&Frame<T>], field: &mut FlowField<T>) -> Result<()> {
        if let Some(field) = same_mut::<_, FlowField<f32>>(field) {
            self.fill_single(&frames.iter().filter_map(|f| same(*f)).collect::<Vec<_>>(), field)
        } else if let Some(field) = same_mut::<_, FlowField<f64>>(field) {
            self.fill_double(&frames.iter().filter_map(|f| same(*f)).collect::<Vec<_>>(), field)
        } else {
            Err(Error::argument("frames", "float32 or float64 precision", std::any::type_name::<T>()))
        }
    }

    #[inline(never)]
    fn fill_single(&self, frames: &[&Frame<f32>], field: &mut FlowField<f32>) -> Result<()> {
        self.fill_with(frames, field)
    }

    #[inline(never)]
    fn fill_double(&self, frames: &[&Frame<f64>], field: &mut FlowField<f64>) -> Result<()> {
        self.fill_with(frames, field)
    }

    fn fill_with<T: SimdReal>(&self, frames: &[&Frame<T>], field: &mut FlowField<T>) -> Result<()> {
        let Some(Intake { frames, gain }) = Intake::of(frames, self.options.mask.as_ref()) else {
            return self.fill_from(frames, &self.options, field);
        };
        let options = EstimatorOptions { noise: self.options.noise.map(|noise| gain * noise), ..self.options.clone() };
        self.fill_from(&frames.iter().collect::<Vec<_>>(), &options, field)?;
        for value in field.residual.iter_mut().flatten().filter(|_| gain != 1.0) {
            *value = T::from_f64(value.to_f64() / gain);
        }
        Ok(())
    }

    fn fill_from<T: SimdReal>(
        &self,
        frames: &[&Frame<T>],
        options: &EstimatorOptions,
        field: &mut FlowField<T>,
    ) -> Result<()> {
        let n = field.len();
        if options.diagnostics {
            field.residual.get_or_insert_default().resize(n, T::nan());
            field.condition.get_or_insert_default().resize(n, T::nan());
            field.rank.get_or_insert_default().resize(n, 0);
        } else {
            (field.residual, field.condition, field.rank) = (None, None, None);
        }
        let info = self.method.info();
        field.window = (options.diagnostics && info.chooses_window).then(|| {
            let mut plane = field.window.take().unwrap_or_default();
            plane.resize(n, T::nan());
            plane
        });
        let has_systematic = options.covariance && options.systematic && info.has_systematic;
        let entries = field.covariance.as_ref().map_or(0, Vec::len);
        field.systematic = has_systematic.then(|| {
            let mut planes = field.systematic.take().unwrap_or_default();
            planes.resize(entries, T::nan());
            planes
        });
        match (&self.engine, frames) {
            (Engine::Instantaneous(e), &[a, b, c]) => e.estimate_into([a, b, c], options, field),
            (Engine::Instantaneous(_), _) => {}
            (Engine::CoarseToFine(e), _) => e.estimate_into(frames, options, field),
            (Engine::Windowed(e), _) => e.estimate_into(frames, options, field),
            (Engine::LucasKanade(e), _) => e.estimate_into(frames, options, field)?,
            (Engine::HornSchunck(e), _) => e.estimate_into(frames, options, field)?,
        }
        let units = std::mem::take(&mut field.layout.units);
        field.convert(units);
        Ok(())
    }
}
