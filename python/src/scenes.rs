//! `jacoflow.scenes`: moving pictures with exact truth.

use super::arrays::{self, ColourRule};
use super::{field::FlowField, options::Integer, options::count, options::named};
use crate::errors::Outcome;
use crate::image::renamed;
use crate::interrupt::interruptible;
use crate::keywords::getters;
use jacoflow::error::Error;
use jacoflow::parallel::Threads;
use jacoflow::synth::registry::{CARRIERS, Parameter, SCENES};
use jacoflow::synth::{
    Rounding, Scene as CoreScene, SceneOptions, Sensor as CoreSensor, build, check_time, mean_truth, truth,
};
use pyo3::exceptions::{PyMemoryError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict, PyTuple};
use std::hash::{DefaultHasher, Hash, Hasher};

/// A moving picture I(x, y, t) with exact flow and Jacobian at every point and time.
///
/// `name` is one of `scenes.names()`; frames have `width` x `height` px, pixel (0, 0) lies at the scene point
/// `origin` (x, y) px; `random_state` makes everything random; `carrier` (one of `scenes.carriers()`) is what
/// the motion moves; `parameters` are those of `scenes.parameters(name)`, each in the unit given there. Time
/// t is in frames, brightness in grey levels of an 8-bit scale.
#[pyclass(module = "jacoflow.scenes", frozen)]
pub struct Scene {
    kind: String,
    options: SceneOptions,
    core: Box<dyn CoreScene>,
}

impl Scene {
    /// Memory for so many frames.
    fn expect_room(&self, count: usize) -> Outcome<Vec<f64>> {
        let (width, height) = self.core.size();
        let mut room = Vec::new();
        if count.checked_mul(width * height).is_none_or(|values| room.try_reserve_exact(values).is_err()) {
            let message = format!("count: no memory for {count} frames of {width} x {height} float64");
            return Err(PyMemoryError::new_err(message).into());
        }
        Ok(room)
    }
}

getters! {
    Scene;
    /// Size (width, height) of the frames, px.
    size(this) -> (usize, usize) = this.core.size();
    /// Scene point (x, y) of pixel (0, 0), px.
    origin(this) -> (f64, f64) = this.core.origin();
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (name, *, width=None, height=None, origin=None, random_state=None, carrier=None, **parameters))]
    fn new(
        #[pyo3(from_py_with = named::name)] name: String,
        #[pyo3(from_py_with = named::width)] width: Option<Integer>,
        #[pyo3(from_py_with = named::height)] height: Option<Integer>,
        #[pyo3(from_py_with = named::origin)] origin: Option<(f64, f64)>,
        #[pyo3(from_py_with = named::random_state)] random_state: Option<u64>,
        #[pyo3(from_py_with = named::carrier)] carrier: Option<String>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> Outcome<Self> {
        let default = SceneOptions::default();
        let parameter = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| -> Outcome<(String, f64)> {
            let name: String = name.extract()?;
            match value.extract() {
                Ok(number) => Ok((name, number)),
                Err(_) => {
                    Err(PyTypeError::new_err(format!("{name}: expected a number, got {}", value.get_type())).into())
                }
            }
        };
        let values = parameters.iter().flat_map(|given| given.iter()).map(parameter).collect::<Outcome<_>>()?;
        let options = SceneOptions {
            width: width.map_or(Ok(default.width), |n| count("width", n))?,
            height: height.map_or(Ok(default.height), |n| count("height", n))?,
            origin: origin.unwrap_or(default.origin),
            random_state: random_state.unwrap_or(default.random_state),
            carrier,
            values,
        };
        let core = build(&name, &options).map_err(|error| renamed(error, "scene", "name"))?;
        Ok(Self { kind: name, options, core })
    }

    /// Name of the scene (no unit).
    #[getter]
    fn name(&self) -> &str {
        &self.kind
    }

    /// The frame of time `t` (frames): float64 array (H, W), grey levels of an 8-bit scale, neither rounded
    /// nor clipped.
    ///
    /// ValueError for a time that is not finite, or beyond the paths that the scene follows: 1e5 steps, which
    /// are 25000 frames or fewer in the scenes whose paths are integrated.
    fn frame<'py>(&self, py: Python<'py>, #[pyo3(from_py_with = named::t)] t: f64) -> Outcome<Bound<'py, PyAny>> {
        check_time(self.core.as_ref(), "t", t)?;
        self.expect_room(1)?;
        let threads = Threads::new(None)?;
        let frame = interruptible(py, || Ok(threads.install(|| self.core.frame(t))))?;
        arrays::from_frame(py, frame)
    }

    /// Frames of the times start, start + 1, ...: float64 array (count, H, W), grey levels of an 8-bit scale.
    /// ValueError for times that `frame` refuses.
    #[pyo3(signature = (count, start=0.0))]
    fn frames<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = named::count)] count: Integer,
        #[pyo3(from_py_with = named::start)] start: f64,
    ) -> Outcome<Bound<'py, PyAny>> {
        let wrong = || Error::argument("count", "zero or a positive integer", count);
        let count = count.clamped().ok_or_else(wrong)?;
        check_time(self.core.as_ref(), "start", start)?;
        check_time(self.core.as_ref(), "count", start + count.saturating_sub(1) as f64)?;
        let (width, height) = self.core.size();
        let threads = Threads::new(None)?;
        let mut data = self.expect_room(count)?;
        for index in 0..count {
            py.check_signals()?;
            let frame = interruptible(py, || Ok(threads.install(|| self.core.frame(start + index as f64))))?;
            data.extend(frame.into_data());
        }
        arrays::owned(py, &[count, height, width], data)
    }

    /// Exact flow and Jacobian of the frame of time `t` (frames), a FlowField (H, W) in px/frame and 1/frame.
    ///
    /// Without `between` the velocity at that time. With `between=(a, b)`, frames, the mean velocity between
    /// the times t + a and t + b of the matter that is at each pixel at time t, `(d(b) - d(a)) / (b - a)` for
    /// displacements d since t: what frames can show, where paths are curved. (0, 1) is the displacement to
    /// the next frame, (-1, 1) the mean of those since the last and to the next. Status MASKED and NaN where
    /// the scene has no single truth. ValueError for times that are not finite, equal times and those that
    /// `displacement` refuses.
    #[pyo3(signature = (t, *, between=None))]
    fn truth(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = named::t)] t: f64,
        #[pyo3(from_py_with = named::between)] between: Option<(f64, f64)>,
    ) -> Outcome<FlowField> {
        let threads = Threads::new(None)?;
        let scene = self.core.as_ref();
        let field = interruptible(py, || {
            threads.install(|| match between {
                None => truth(scene, t),
                Some(between) => mean_truth(scene, t, between),
            })
        })?;
        Ok(FlowField::single(field))
    }

    /// Exact (u, v, u_x, v_x, u_y, v_y) at scene point (x, y) px and time t (frames), px/frame and 1/frame,
    /// array (6,); None without truth. ValueError for a number that is not finite.
    fn motion<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = named::x)] x: f64,
        #[pyo3(from_py_with = named::y)] y: f64,
        #[pyo3(from_py_with = named::t)] t: f64,
    ) -> Outcome<Option<Bound<'py, PyAny>>> {
        check_finite([("x", x), ("y", y), ("t", t)])?;
        let motion = self.core.motion(x, y, t);
        motion.map(|m| arrays::owned(py, &[6], m.to_array().to_vec())).transpose()
    }

    /// How far (x, y) px the matter at scene point (x, y) px and time t has gone `duration` frames later;
    /// None where the scene does not know.
    ///
    /// It differs from `duration` times the velocity wherever paths are curved. ValueError for a number that
    /// is not finite, and for a duration longer than the scene follows paths, as in `frame`.
    #[pyo3(signature = (x, y, t, duration=1.0))]
    fn displacement(
        &self,
        #[pyo3(from_py_with = named::x)] x: f64,
        #[pyo3(from_py_with = named::y)] y: f64,
        #[pyo3(from_py_with = named::t)] t: f64,
        #[pyo3(from_py_with = named::duration)] duration: f64,
    ) -> Outcome<Option<(f64, f64)>> {
        check_finite([("x", x), ("y", y), ("t", t)])?;
        check_time(self.core.as_ref(), "duration", duration)?;
        Ok(self.core.displacement(x, y, t, duration))
    }

    /// The same name and options, so the same pictures.
    fn __eq__(&self, other: &Self) -> bool {
        (&self.kind, &self.options) == (&other.kind, &other.options)
    }

    fn __hash__(&self) -> u64 {
        hash(&(&self.kind, self.options.width, self.options.height, self.options.random_state))
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.core.size();
        format!("Scene({:?}, width={width}, height={height}, random_state={})", self.kind, self.options.random_state)
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> Outcome<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let options = PyDict::new(py);
        for (name, value) in &self.options.values {
            options.set_item(name, value)?;
        }
        options.set_item("width", self.options.width)?;
        options.set_item("height", self.options.height)?;
        options.set_item("origin", self.options.origin)?;
        options.set_item("random_state", self.options.random_state)?;
        options.set_item("carrier", &self.options.carrier)?;
        Ok((PyTuple::new(py, [&self.kind])?, options))
    }
}

/// What a camera does to a frame: white noise, rounding, clipping.
///
/// `noise` standard deviation in grey levels; `rounding` "none", "floor" (the patent's quantiser) or
/// "nearest"; `saturate` clips to 0 ... 255; `random_state` of the noise. Without arguments it changes
/// nothing.
#[pyclass(module = "jacoflow.scenes", frozen)]
pub struct Sensor {
    sensor: CoreSensor,
}

#[pymethods]
impl Sensor {
    #[new]
    #[pyo3(signature = (*, noise=None, rounding=None, saturate=None, random_state=None))]
    fn new(
        #[pyo3(from_py_with = named::noise)] noise: Option<f64>,
        #[pyo3(from_py_with = named::rounding)] rounding: Option<&str>,
        #[pyo3(from_py_with = named::saturate)] saturate: Option<bool>,
        #[pyo3(from_py_with = named::random_state)] random_state: Option<u64>,
    ) -> Outcome<Self> {
        let default = CoreSensor::default();
        let sensor = CoreSensor {
            noise: noise.unwrap_or(default.noise),
            rounding: match rounding {
                None => default.rounding,
                Some("none") => Rounding::None,
                Some("floor") => Rounding::Floor,
                Some("nearest") => Rounding::Nearest,
                Some(other) => {
                    let expected = "\"none\", \"floor\" or \"nearest\"";
                    return Err(Error::argument("rounding", expected, format!("{other:?}")).into());
                }
            },
            saturate: saturate.unwrap_or(default.saturate),
            random_state: random_state.unwrap_or(default.random_state),
        };
        sensor.check()?;
        Ok(Self { sensor })
    }

    /// `frame` (H, W) as the camera delivers it, a new float64 array (H, W) in grey levels.
    ///
    /// The noise depends on the seed, `index` (which frame it is) and the pixel, on nothing else.
    #[pyo3(signature = (frame, index=0))]
    fn apply<'py>(
        &self,
        frame: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = named::index)] index: u64,
    ) -> Outcome<Bound<'py, PyAny>> {
        let py = frame.py();
        let frame = arrays::frame("frame", frame, ColourRule::Refuse)?;
        let seen = py.detach(|| self.sensor.apply(&frame.to_real(), index));
        arrays::from_frame(py, seen)
    }

    /// As `apply`, as a uint8 array (H, W) of grey levels; fractions are cut off and values outside 0 ... 255
    /// clipped.
    #[pyo3(signature = (frame, index=0))]
    fn apply_u8<'py>(
        &self,
        frame: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = named::index)] index: u64,
    ) -> Outcome<Bound<'py, PyAny>> {
        let py = frame.py();
        let frame = arrays::frame("frame", frame, ColourRule::Refuse)?;
        let seen = py.detach(|| self.sensor.apply_u8(&frame.to_real(), index));
        arrays::from_frame(py, seen)
    }

    /// The same options, so the same noise.
    fn __eq__(&self, other: &Self) -> bool {
        self.sensor == other.sensor
    }

    fn __hash__(&self) -> u64 {
        hash(&(self.sensor.noise.to_bits(), self.rounding(), self.sensor.saturate, self.sensor.random_state))
    }

    fn __repr__(&self) -> String {
        let CoreSensor { noise, saturate, random_state, .. } = self.sensor;
        let saturate = if saturate { "True" } else { "False" };
        format!(
            "Sensor(noise={noise}, rounding={:?}, saturate={saturate}, random_state={random_state})",
            self.rounding()
        )
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> Outcome<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let options = PyDict::new(py);
        options.set_item("noise", self.sensor.noise)?;
        options.set_item("rounding", self.rounding())?;
        options.set_item("saturate", self.sensor.saturate)?;
        options.set_item("random_state", self.sensor.random_state)?;
        Ok((PyTuple::empty(py), options))
    }
}

impl Sensor {
    fn rounding(&self) -> &'static str {
        match self.sensor.rounding {
            Rounding::None => "none",
            Rounding::Floor => "floor",
            Rounding::Nearest => "nearest",
        }
    }
}

/// Refuses a coordinate or a time that is not finite.
fn check_finite(numbers: [(&'static str, f64); 3]) -> Outcome<()> {
    match numbers.into_iter().find(|(_, number)| !number.is_finite()) {
        Some((name, number)) => Err(Error::argument(name, "a finite number", number).into()),
        None => Ok(()),
    }
}

pub(super) fn hash(value: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

/// Names of the scenes, with one line about each: a dictionary.
#[pyfunction(name = "_scene_names")]
pub fn scene_names(py: Python<'_>) -> Outcome<Bound<'_, PyDict>> {
    Ok(SCENES.iter().map(|kind| (kind.name, kind.summary)).into_py_dict(py)?)
}

/// Names of what a motion can carry, with one line about each: a dictionary. The first is the default.
#[pyfunction(name = "_scene_carriers")]
pub fn scene_carriers(py: Python<'_>) -> Outcome<Bound<'_, PyDict>> {
    Ok(CARRIERS.iter().map(|kind| (kind.name, kind.summary)).into_py_dict(py)?)
}

/// Parameters of the scene or carrier `name`: a dictionary from the parameter's name to (default or None,
/// meaning with its unit).
///
/// ValueError for an unknown name.
#[pyfunction(name = "_scene_parameters")]
pub fn scene_parameters<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = named::name)] name: &str,
) -> Outcome<Bound<'py, PyDict>> {
    let scenes = SCENES.iter().map(|kind| (kind.name, kind.parameters));
    let known: Vec<(&str, &[Parameter])> =
        scenes.chain(CARRIERS.iter().map(|kind| (kind.name, kind.parameters))).collect();
    let Some((_, parameters)) = known.iter().find(|(known, _)| *known == name) else {
        let names: Vec<_> = known.iter().map(|(name, _)| *name).collect();
        return Err(Error::argument("name", format!("one of {}", names.join(", ")), format!("{name:?}")).into());
    };
    Ok(parameters.iter().map(|parameter| (parameter.name, (parameter.default, parameter.meaning))).into_py_dict(py)?)
}
