//! Options that estimators and the flow filter share, from what Python gives.

use super::arrays::{self, ColourRule};
use crate::errors::Outcome;
use jacoflow::error::Error;
use jacoflow::image::{GaussianSmoother, Preprocess, Quantiser};
use jacoflow::jet::Neighbourhood;
use jacoflow::parallel::Threads;
use jacoflow::simd::Level;
use jacoflow::types::{Mask, Precision, Rect, Sample, SamplingGrid, Units};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyUnicodeEncodeError, PyValueError};
use pyo3::prelude::*;
use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

/// An integer argument. One that 128 bits do not hold becomes the nearest that they do, so that it is refused
/// by name where it is out of range.
#[derive(Debug, Clone, Copy, IntoPyObject, IntoPyObjectRef)]
#[pyo3(transparent)]
pub struct Integer(pub i128);

impl<'py> FromPyObject<'_, 'py> for Integer {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match object.extract::<i128>() {
            Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => {
                Ok(Self(if object.lt(0)? { i128::MIN } else { i128::MAX }))
            }
            value => Ok(Self(value?)),
        }
    }
}

/// A type of arguments.
pub trait Argument: Sized {
    /// What it holds, for messages.
    const EXPECTED: &'static str;
}

macro_rules! arguments {
    ($($type:ty: $expected:literal),* $(,)?) => {$(
        impl Argument for $type {
            const EXPECTED: &'static str = $expected;
        }
    )*};
}
arguments!(
    usize: "an integer from 0 to 2^64 - 1",
    u64: "an integer from 0 to 2^64 - 1",
    u32: "an integer from 0 to 2^32 - 1",
    i32: "an integer from -2^31 to 2^31 - 1",
    f64: "a number up to 1.8e308",
    (f64, f64): "two numbers up to 1.8e308",
    Integer: "an integer",
    bool: "True or False",
    &str: "a string",
    String: "a string",
    PathBuf: "a path (a string or os.PathLike)",
    Region: "four integers (x, y, width, height) of 64 bits",
    Py<PyAny>: "an object",
    Function: "a function",
);

/// A function argument.
#[derive(Debug)]
pub struct Function(pub Py<PyAny>);

impl<'py> FromPyObject<'_, 'py> for Function {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if object.is_callable() {
            Ok(Self(object.to_owned().unbind()))
        } else {
            Err(PyTypeError::new_err(Self::EXPECTED))
        }
    }
}

impl Function {
    /// Another reference to it.
    pub fn clone_ref(&self, py: Python<'_>) -> Self {
        Self(self.0.clone_ref(py))
    }
}

impl Argument for Bound<'_, PyAny> {
    const EXPECTED: &'static str = Py::<PyAny>::EXPECTED;
}

impl<T: Argument> Argument for Option<T> {
    const EXPECTED: &'static str = T::EXPECTED;
}

/// The argument called `name`: one of another type, or a number that its type does not hold, is refused by
/// name.
fn argument<'a, 'py, T: Argument + FromPyObject<'a, 'py>>(name: &str, value: &'a Bound<'py, PyAny>) -> PyResult<T> {
    value.extract::<T>().map_err(|error| {
        let error: PyErr = error.into();
        if error.is_instance_of::<PyOverflowError>(value.py()) {
            return PyValueError::new_err(format!("{name}: expected {}, got {}", T::EXPECTED, shown(value)));
        }
        if error.is_instance_of::<PyUnicodeEncodeError>(value.py()) {
            return PyValueError::new_err(format!("{name}: expected valid Unicode text, got {}", shown(value)));
        }
        if error.is_instance_of::<PyValueError>(value.py()) {
            return PyValueError::new_err(format!("{name}: expected {}, got {}", T::EXPECTED, shown(value)));
        }
        if error.is_instance_of::<PyTypeError>(value.py()) {
            return PyTypeError::new_err(format!("{name}: expected {}, got {}", T::EXPECTED, arrays::kind_of(value)));
        }
        error
    })
}

/// Characters of a value in a message.
const MAX_SHOWN: usize = 40;

/// The beginning of a value's text.
pub fn shown(value: &Bound<'_, PyAny>) -> String {
    let words = value.repr().map_or_else(|_| "another value".into(), |text| text.to_string());
    words.chars().take(MAX_SHOWN).collect()
}

/// Arguments by their names, for `from_py_with`.
pub mod named {
    use super::{Argument, Bound, FromPyObject, PyAny, PyResult, argument};

    macro_rules! arguments {
        ($($name:ident)*) => {$(
            pub fn $name<'a, 'py, T: Argument + FromPyObject<'a, 'py>>(value: &'a Bound<'py, PyAny>) -> PyResult<T> {
                argument(stringify!($name), value)
            }
        )*};
    }
    arguments!(FJacobian HJacobian Hx aggregate alpha augmented backward batch beta between blur_sigma carrier channel classes colour colour_cast count covariance diagnostics dim_x dim_z duration ends forward_backward fps frame_rate frames fx grey grid height hx index initial interval kappa left_right_check length_unit levels mask max_count max_steps method min_distance min_eigenvalue min_step n n_components n_near n_particles name neighbourhood_sigma noise options origin pairs path pixel_pitch points precision preprocess prior_radius profile quality random_state redraw rounding saturate scale scheme search sigma simd source start step stop subpixel t temporal threads threshold time time_scheme transition truncate update_first width window x y);
}

/// The argument `region`, any sequence (x, y, width, height), px.
#[derive(Debug, Clone, Copy, IntoPyObject, IntoPyObjectRef)]
#[pyo3(transparent)]
pub struct Region((i64, i64, i64, i64));

impl<'py> FromPyObject<'_, 'py> for Region {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let wrong = || PyTypeError::new_err(Self::EXPECTED);
        // No more than are needed: there may be very many.
        let items = object.try_iter().and_then(|items| items.take(5).collect());
        let items: Vec<Bound<'_, PyAny>> = items.map_err(|_| wrong())?;
        let is_overflow = |error: &PyErr| error.is_instance_of::<PyOverflowError>(object.py());
        let numbers: PyResult<Vec<i64>> = items.iter().map(PyAnyMethods::extract).collect();
        let numbers = numbers.map_err(|error| if is_overflow(&error) { error } else { wrong() })?;
        let [x, y, width, height] = numbers[..] else { return Err(wrong()) };
        Ok(Self((x, y, width, height)))
    }
}

/// An object that may be absent, as an argument takes it and a pickle keeps it.
pub type Object = Option<Py<PyAny>>;

/// A deep copy of the option called `name`, so that later changes by the user do not reach it. What cannot be
/// copied is no option and is refused by name.
pub fn keep(py: Python<'_>, name: &str, object: Object) -> Outcome<Object> {
    let Some(object) = object else { return Ok(None) };
    let copy = py.import("copy")?.getattr("deepcopy")?.call1((&object,)).map_err(|error| {
        let got = arrays::kind_of(object.bind(py));
        let said = || format!("{name}: expected an object that can be copied, such as an array, got {got}");
        if error.is_instance_of::<PyTypeError>(py) { PyTypeError::new_err(said()) } else { error }
    })?;
    Ok(Some(copy.unbind()))
}

/// A group of options: an object of `jacoflow._options`, or none, whose options are all absent.
pub struct Group<'py>(Option<Bound<'py, PyAny>>);

impl<'py> Group<'py> {
    /// The argument called `argument`, an object of one of the `classes`, which are listed in the message.
    pub fn new(py: Python<'py>, argument: &str, classes: &[&str], object: &Object) -> Outcome<Self> {
        let Some(object) = object else { return Ok(Self(None)) };
        let object = object.bind(py).clone();
        let known = py.import("jacoflow._options")?;
        for class in classes {
            if object.is_instance(&known.getattr(*class)?)? {
                return Ok(Self(Some(object)));
            }
        }
        let names: Vec<String> = classes.iter().map(|class| format!("jacoflow.{class}")).collect();
        let got = object.get_type().name()?;
        Err(PyTypeError::new_err(format!("{argument}: expected {}, got {got}", names.join(" or "))).into())
    }

    /// The option called `name`, if it was given.
    pub fn get<T: Argument + FromPyObjectOwned<'py>>(&self, name: &str) -> Outcome<Option<T>> {
        let Some(object) = &self.0 else { return Ok(None) };
        let value = object.getattr_opt(name)?.filter(|value| !value.is_none());
        Ok(value.map(|value| argument(name, &value)).transpose()?)
    }
}

/// The string that an option is, unless it is another object.
pub fn word(py: Python<'_>, object: &Object) -> Option<String> {
    object.as_ref()?.extract(py).ok()
}

impl Display for Integer {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.0 {
            i128::MAX => f.write_str("one above 2^127"),
            i128::MIN => f.write_str("one below -2^127"),
            value => value.fmt(f),
        }
    }
}

impl Integer {
    /// At most 2^63 - 1: for counts of which all larger ones mean the same.
    pub fn saturated(self) -> Self {
        Self(self.0.min(i64::MAX.into()))
    }

    /// The nearest unsigned number of 64 bits below 2^63; `None` below 0.
    pub fn clamped(self) -> Option<usize> {
        usize::try_from(self.saturated().0).ok()
    }
}

/// A count of at least one.
pub fn count(name: &'static str, value: Integer) -> Outcome<usize> {
    if value.0 > i64::MAX.into() {
        return Err(Error::argument(name, "a positive integer below 2^63", value).into());
    }
    value.clamped().filter(|&n| n > 0).ok_or_else(|| Error::argument(name, "a positive integer", value).into())
}

/// A count or an index, at least 0.
pub fn natural(name: &'static str, value: Integer) -> Outcome<usize> {
    Ok(value.clamped().ok_or_else(|| Error::argument(name, "an integer of 0 or more", value))?)
}

/// `threads`: a positive number, or all.
pub fn threads(value: Option<Integer>) -> Outcome<Threads> {
    // More than there are processors for is no mistake.
    Ok(Threads::new(value.map(|n| count("threads", n.saturated())).transpose()?)?)
}

/// `simd`: the name of an instruction set that the processor has.
pub fn simd(name: Option<&str>) -> Outcome<Option<Level>> {
    Ok(name.map(Level::parse).transpose()?)
}

/// `grid`: where to estimate.
pub fn grid(py: Python<'_>, object: &Object) -> Outcome<SamplingGrid> {
    let group = Group::new(py, "grid", &["SamplingGrid"], object)?;
    let region = region(group.get("region")?)?;
    let stride = group.get("stride")?.map(|n| count("stride", n)).transpose()?;
    let Some(points) = group.get::<Bound<'_, PyAny>>("points")? else {
        let SamplingGrid::Grid { stride: default, .. } = SamplingGrid::default() else {
            return Ok(SamplingGrid::default());
        };
        return Ok(SamplingGrid::Grid { region, stride: stride.unwrap_or(default) });
    };
    if region.is_some() || stride.is_some() {
        let other = if region.is_some() { "region" } else { "stride" };
        return Err(Error::argument("points", format!("points without {other}"), "both").into());
    }
    let inside = arrays::integer_pairs("points", &points)?
        .into_iter()
        .map(|(x, y)| Ok((usize::try_from(x).map_err(|_| (x, y))?, usize::try_from(y).map_err(|_| (x, y))?)));
    let pixels = inside.collect::<Result<Vec<_>, _>>();
    pixels.map(SamplingGrid::Points).map_err(|point: (i64, i64)| {
        Error::argument("points", "pixels (x, y) inside the frame", format!("{point:?}")).into()
    })
}

/// `neighbourhood`: (columns, rows) or an (N, 2) array of offsets, of equal weights.
pub fn neighbourhood(value: &Bound<'_, PyAny>) -> Outcome<Neighbourhood> {
    let rectangle = |columns, rows| {
        let (width, height) = (count("neighbourhood", columns)?, count("neighbourhood", rows)?);
        Ok(Neighbourhood::Rectangle { width, height, sigma: None })
    };
    if let Ok((columns, rows)) = value.extract::<(Integer, Integer)>() {
        return rectangle(columns, rows);
    }
    let array = arrays::as_array("neighbourhood", value)?;
    if let Ok([columns, rows]) = array.extract::<[Integer; 2]>() {
        return rectangle(columns, rows);
    }
    let offsets = arrays::integer_pairs("neighbourhood", array.as_any())?;
    let narrow = offsets.into_iter().map(|(x, y)| Ok((i32::try_from(x)?, i32::try_from(y)?)));
    let offsets = narrow
        .collect::<Result<Vec<_>, std::num::TryFromIntError>>()
        .map_err(|_| Error::argument("neighbourhood", "offsets of a few px", "one far outside"))?;
    Ok(Neighbourhood::Points { offsets, sigma: None })
}

/// A number that may be absent.
pub fn real(py: Python<'_>, name: &str, value: &Object) -> Outcome<Option<f64>> {
    Ok(value.as_ref().map(|value| argument(name, value.bind(py))).transpose()?)
}

/// `fps`, as seconds between frames.
fn frame_period(py: Python<'_>, fps: &Object) -> Outcome<Option<f64>> {
    Ok(real(py, "fps", fps)?.map(Units::period_at).transpose()?)
}

/// `preprocess`: what is done to each frame first.
pub struct PreprocessOptions {
    quantise: Option<f64>,
    /// Standard deviation of the smoothing, px.
    pub smooth: Option<f64>,
    /// What is done with colour.
    pub colour: ColourRule,
}

impl PreprocessOptions {
    /// The options that `object` holds.
    pub fn new(py: Python<'_>, object: &Object) -> Outcome<Self> {
        let group = Group::new(py, "preprocess", &["Preprocess"], object)?;
        let colour = ColourRule::parse(group.get::<String>("colour")?.as_deref())?;
        Ok(Self { quantise: group.get("quantise")?, smooth: group.get("smooth")?, colour })
    }

    /// The steps; smoothing leaves out what `mask` excludes.
    pub fn steps(&self, mask: Option<&Mask>) -> Outcome<Preprocess> {
        Ok(Preprocess {
            quantise: self.quantise.map(Quantiser::new).transpose()?,
            smooth: self.smooth.map(GaussianSmoother::new).transpose()?,
            mask: mask.cloned(),
        })
    }
}

/// `pixel_pitch`, one length for both axes or (dx, dy), `length_unit` and `fps`.
pub fn units(py: Python<'_>, pitch: &Object, length: Option<&str>, fps: &Object) -> Outcome<Units> {
    let period = frame_period(py, fps)?;
    let Some(value) = pitch else {
        return match length {
            None => Ok(Units::new((1.0, 1.0), None, period)),
            Some(name) => {
                Err(Error::argument("length_unit", "a pixel_pitch in that unit", format!("{name:?} alone")).into())
            }
        };
    };
    let pitch = match arrays::doubles("pixel_pitch", value.bind(py))?.1[..] {
        [side] => (side, side),
        [dx, dy] => (dx, dy),
        ref more => {
            let got = format!("{} numbers", more.len());
            return Err(Error::argument("pixel_pitch", "a length or (dx, dy)", got).into());
        }
    };
    Ok(Units::new(pitch, length, period))
}

/// `precision=None | "float32" | "float64"`.
pub fn precision(name: Option<&str>) -> Outcome<Precision> {
    let Some(name) = name else { return Ok(Precision::Auto) };
    // "auto" is the command line's word for None.
    let unknown = |_| Error::argument("precision", "\"float32\" or \"float64\"", format!("{name:?}"));
    Ok(Precision::parse(name).map_err(unknown)?)
}

/// `region`: (x, y, width, height), px.
pub fn region(region: Option<Region>) -> Outcome<Option<Rect>> {
    let Some(Region((x, y, width, height))) = region else { return Ok(None) };
    let side = |value: i64| usize::try_from(value).ok();
    let rect = || Some(Rect { x: side(x)?, y: side(y)?, width: side(width)?, height: side(height)? });
    let got = format!("({x}, {y}, {width}, {height})");
    rect().map(Some).ok_or_else(|| Error::argument("region", "(x, y, width, height), none negative", got).into())
}

/// The static name of a sample type.
pub fn known_dtype(name: &str) -> Outcome<&'static str> {
    let known = [u8::DTYPE, u16::DTYPE, f32::DTYPE, f64::DTYPE].into_iter().find(|known| *known == name);
    known.ok_or_else(|| Error::argument("state", "a sample type that frames have", format!("{name:?}")).into())
}
