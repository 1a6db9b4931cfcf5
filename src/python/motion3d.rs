//! Rigid 3-D motion for Python; what a user meets is `jacoflow.motion3d`.

use super::arrays;
use crate::error::Error;
use crate::motion3d::{
    AffinePatches, Flow, Intrinsics, Method, Motion, MotionBound, MotionEstimate, MotionOptions, Noise, Placement,
    RotationPrior, Smoother, estimate_motion, estimate_patch_motion, focus_of_expansion, motion_bound,
    patch_motion_bound,
};
use crate::parallel::Threads;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyDictMethods};

/// Points of a screen with `D` coordinates each.
fn rows<const D: usize>(name: &'static str, shape: &[usize], values: &[f64]) -> PyResult<Vec<[f64; D]>> {
    if shape.len() == 2 && shape[1] == D || shape == [0] {
        return Ok(values.as_chunks::<D>().0.to_vec());
    }
    Err(Error::argument(name, format!("shape (N, {D})"), format!("shape {shape:?}")).into())
}

fn option<'py, T: for<'a> FromPyObject<'a, 'py, Error = PyErr>>(from: &Bound<'py, PyDict>, name: &str) -> PyResult<T> {
    from.as_any().get_item(name)?.extract()
}

/// An array option, or nothing.
fn optional(from: &Bound<'_, PyDict>, name: &'static str) -> PyResult<Option<(Vec<usize>, Vec<f64>)>> {
    let value = from.as_any().get_item(name)?;
    if value.is_none() { Ok(None) } else { arrays::doubles(name, &value).map(Some) }
}

fn word<T>(name: &'static str, value: &str, known: &[(&str, T)]) -> PyResult<T>
where
    T: Copy,
{
    let found = known.iter().find(|(known, _)| *known == value).map(|(_, result)| *result);
    let names: Vec<String> = known.iter().map(|(known, _)| format!("{known:?}")).collect();
    found.ok_or_else(|| Error::argument(name, names.join(" or "), format!("{value:?}")).into())
}

/// What was given, owned.
struct Given {
    spherical: bool,
    plane: (Vec<[f64; 2]>, Vec<[f64; 2]>),
    sphere: (Vec<[f64; 3]>, Vec<[f64; 3]>),
    camera: Option<Intrinsics>,
    sigma: Option<f64>,
    covariances: Option<Vec<f64>>,
}

fn camera(given: Option<(Vec<usize>, Vec<f64>)>) -> PyResult<Option<Intrinsics>> {
    let Some((shape, values)) = given else { return Ok(None) };
    if shape != [3, 3] {
        return Err(Error::argument("K", "shape (3, 3)", format!("shape {shape:?}")).into());
    }
    let matrix = std::array::from_fn(|i| std::array::from_fn(|j| values[3 * i + j]));
    Ok(Some(Intrinsics::new(matrix)?))
}

impl Given {
    /// Without `flow`, that of points is zero: bounds do not look at it.
    fn new(
        points: &Bound<'_, PyAny>,
        flow: Option<&Bound<'_, PyAny>>,
        parameters: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let projection: String = option(parameters, "projection")?;
        let spherical = word("projection", &projection, &[("plane", false), ("sphere", true)])?;
        let camera = camera(optional(parameters, "K")?)?;
        if spherical && camera.is_some() {
            return Err(Error::argument("K", "none, as bearings need no camera", "a matrix").into());
        }
        let (shape, values) = arrays::doubles("points", points)?;
        let flow = flow.map(|flow| arrays::doubles("flow", flow)).transpose()?;
        let zero = (shape.clone(), vec![0.0; values.len()]);
        let (flow_shape, flow_values) = flow.unwrap_or(zero);
        let mut given = Self {
            spherical,
            plane: (Vec::new(), Vec::new()),
            sphere: (Vec::new(), Vec::new()),
            camera,
            sigma: option(parameters, "sigma")?,
            covariances: None,
        };
        let count = shape.first().copied().unwrap_or(0);
        let size = if spherical {
            given.sphere = (rows("points", &shape, &values)?, rows("flow", &flow_shape, &flow_values)?);
            3
        } else {
            given.plane = (rows("points", &shape, &values)?, rows("flow", &flow_shape, &flow_values)?);
            2
        };
        if let Some((shape, values)) = optional(parameters, "cov")? {
            if given.sigma.is_some() {
                return Err(Error::argument("cov", "either sigma or cov", "both").into());
            }
            if shape != [count, size, size] {
                let expected = format!("shape ({count}, {size}, {size})");
                return Err(Error::argument("cov", expected, format!("shape {shape:?}")).into());
            }
            given.covariances = Some(values);
        }
        Ok(given)
    }

    fn flow(&self) -> Flow<'_> {
        if self.spherical {
            Flow::Sphere { bearings: &self.sphere.0, flow: &self.sphere.1 }
        } else {
            Flow::Plane { points: &self.plane.0, flow: &self.plane.1, camera: self.camera.as_ref() }
        }
    }

    fn noise(&self) -> Noise<'_> {
        match (&self.covariances, self.sigma) {
            (Some(values), _) => Noise::Covariances(values),
            (None, Some(sigma)) => Noise::Sigma(sigma),
            (None, None) => Noise::Unknown,
        }
    }
}

/// Patches with six numbers each, owned.
struct GivenPatches {
    points: Vec<[f64; 2]>,
    motion: Vec<[f64; 6]>,
    covariances: Vec<f64>,
    camera: Option<Intrinsics>,
}

impl GivenPatches {
    fn new(
        points: &Bound<'_, PyAny>,
        affine: Option<&Bound<'_, PyAny>>,
        parameters: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        if option::<String>(parameters, "projection")? != "plane" {
            return Err(Error::argument("projection", "\"plane\", for six numbers a patch", "another").into());
        }
        let (shape, values) = arrays::doubles("points", points)?;
        let points: Vec<[f64; 2]> = rows("points", &shape, &values)?;
        let motion = match affine {
            Some(affine) => {
                let (shape, values) = arrays::doubles("flow", affine)?;
                rows("flow", &shape, &values)?
            }
            None => vec![[0.0; 6]; points.len()],
        };
        let covariances = optional(parameters, "cov")?;
        let wanted = [points.len(), 6, 6];
        match covariances {
            Some((shape, values)) if shape == wanted => {
                Ok(Self { points, motion, covariances: values, camera: camera(optional(parameters, "K")?)? })
            }
            other => {
                let got = other.map_or_else(|| "none".into(), |(shape, _)| format!("shape {shape:?}"));
                Err(Error::argument("cov", format!("shape {wanted:?}, for six numbers a patch"), got).into())
            }
        }
    }

    fn patches(&self) -> AffinePatches<'_> {
        AffinePatches {
            points: &self.points,
            motion: &self.motion,
            covariances: &self.covariances,
            camera: self.camera.as_ref(),
        }
    }
}

fn triple(name: &'static str, given: &(Vec<usize>, Vec<f64>)) -> PyResult<[f64; 3]> {
    match given.1[..] {
        [x, y, z] if given.0 == [3] => Ok([x, y, z]),
        _ => Err(Error::argument(name, "shape (3,)", format!("shape {:?}", given.0)).into()),
    }
}

/// A known rotation and its covariance.
fn rotation_prior(from: &Bound<'_, PyDict>) -> PyResult<Option<RotationPrior>> {
    let Some(rotation) = optional(from, "prior_rotation")? else { return Ok(None) };
    let rotation = triple("rotation_prior", &rotation)?;
    match optional(from, "prior_covariance")? {
        Some((shape, values)) if shape == [3, 3] => {
            let covariance = std::array::from_fn(|i| std::array::from_fn(|j| values[3 * i + j]));
            Ok(Some(RotationPrior { rotation, covariance }))
        }
        other => {
            let got = other.map_or_else(|| "none".into(), |(shape, _)| format!("shape {shape:?}"));
            Err(Error::argument("rotation_prior", "a covariance of shape (3, 3)", got).into())
        }
    }
}

/// The core's options from the keywords of the Python function.
fn options(from: &Bound<'_, PyDict>) -> PyResult<MotionOptions> {
    let methods = [("auto", Method::Auto), ("ml", Method::MaximumLikelihood), ("efficient", Method::Efficient)];
    let placements = [("midpoint", Placement::Midpoint), ("start", Placement::Start)];
    let smoothers = [("auto", Smoother::Auto), ("prior", Smoother::Prior), ("neighbours", Smoother::Neighbours)];
    let initial = optional(from, "initial_translation")?.map(|u| triple("initial", &u)).transpose()?;
    let turning = optional(from, "initial_rotation")?.map(|w| triple("initial", &w)).transpose()?;
    let seed: super::options::Integer = option(from, "seed")?;
    Ok(MotionOptions {
        method: word("method", &option::<String>(from, "method")?, &methods)?,
        robust: option(from, "robust")?,
        placement: word("placement", &option::<String>(from, "placement")?, &placements)?,
        smoother: word("smoother", &option::<String>(from, "smoother")?, &smoothers)?,
        weight_depths: optional(from, "weight_inv_depth")?.map(|(_, values)| values),
        initial: initial.map(|translation| Motion { translation, rotation: turning.unwrap_or([0.0; 3]) }),
        rotation_prior: rotation_prior(from)?,
        seed: u64::try_from(seed.0).map_err(|_| Error::argument("seed", "an integer of at least 0", seed.0))?,
        threads: Threads::new(option(from, "threads")?)?,
    })
}

fn flat<const A: usize, const B: usize>(matrix: &[[f64; B]; A]) -> Vec<f64> {
    matrix.iter().flatten().copied().collect()
}

fn flat_rows<const D: usize>(rows: &[[f64; D]]) -> Vec<f64> {
    rows.iter().flatten().copied().collect()
}

/// An estimate as a dictionary of arrays.
fn told(py: Python<'_>, found: MotionEstimate) -> PyResult<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    let n = found.inverse_depth.len();
    let alternatives = found.alternatives.len();
    let ml = &found.likelihood;
    let arrays: [(&str, &[usize], Vec<f64>); 20] = [
        ("translation", &[3], found.motion.translation.to_vec()),
        ("rotation", &[3], found.motion.rotation.to_vec()),
        ("covariance", &[5, 5], flat(&found.covariance)),
        ("tangent", &[2, 3], flat(&found.tangent)),
        ("crlb", &[5, 5], flat(&found.bound)),
        ("rotation_std", &[3], found.rotation_std.to_vec()),
        ("inv_depth", &[n], found.inverse_depth),
        ("inv_depth_std", &[n], found.inverse_depth_std),
        ("inv_depth_smooth", &[n], found.inverse_depth_smooth),
        ("time_to_contact", &[n], found.time_to_contact),
        ("time_to_contact_std", &[n], found.time_to_contact_std),
        ("residuals", &[n], found.residuals),
        ("surfaces", &[found.surfaces.len(), 3], flat_rows(&found.surfaces)),
        (
            "alternative_translations",
            &[alternatives, 3],
            found.alternatives.iter().flat_map(|a| a.motion.translation).collect(),
        ),
        (
            "alternative_rotations",
            &[alternatives, 3],
            found.alternatives.iter().flat_map(|a| a.motion.rotation).collect(),
        ),
        ("alternative_costs", &[alternatives], found.alternatives.iter().map(|a| a.excess).collect()),
        ("ml_translation", &[3], ml.motion.translation.to_vec()),
        ("ml_rotation", &[3], ml.motion.rotation.to_vec()),
        ("ml_covariance", &[5, 5], flat(&ml.covariance)),
        ("ml_tangent", &[2, 3], flat(&ml.tangent)),
    ];
    for (name, shape, values) in arrays {
        out.set_item(name, arrays::owned(py, shape, values)?)?;
    }
    out.set_item("inliers", arrays::owned(py, &[n], found.inliers)?)?;
    out.set_item("approach_rate", found.approach.0)?;
    out.set_item("approach_rate_std", found.approach.1)?;
    out.set_item("ml_cost", ml.cost)?;
    out.set_item("direction_std", found.direction_std)?;
    out.set_item("sigma", found.sigma)?;
    out.set_item("status", found.status.name())?;
    out.set_item("method_used", if found.efficient { "efficient" } else { "ml" })?;
    out.set_item("fell_back", found.fell_back)?;
    Ok(out)
}

#[pyfunction]
#[pyo3(name = "_motion3d_estimate")]
pub fn motion3d_estimate<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    flow: &Bound<'py, PyAny>,
    parameters: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = options(parameters)?;
    if option(parameters, "six")? {
        let given = GivenPatches::new(points, Some(flow), parameters)?;
        let found = py.detach(|| estimate_patch_motion(&given.patches(), &options))?;
        return told(py, found);
    }
    let given = Given::new(points, Some(flow), parameters)?;
    let found = py.detach(|| estimate_motion(&given.flow(), &given.noise(), &options))?;
    told(py, found)
}

/// A bound as a dictionary of arrays.
fn told_bound<'py>(py: Python<'py>, bound: &MotionBound) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let arrays: [(&str, &[usize], Vec<f64>); 5] = [
        ("crlb", &[5, 5], flat(&bound.bound)),
        ("ml_covariance", &[5, 5], flat(&bound.likelihood)),
        ("ideal_covariance", &[5, 5], flat(&bound.ideal)),
        ("tangent", &[2, 3], flat(&bound.tangent)),
        ("direction_std", &[3], bound.direction_std.to_vec()),
    ];
    for (name, shape, values) in arrays {
        out.set_item(name, arrays::owned(py, shape, values)?)?;
    }
    Ok(out)
}

#[pyfunction]
#[pyo3(name = "_motion3d_bound")]
pub fn motion3d_bound<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    inverse_depth: &Bound<'py, PyAny>,
    translation: &Bound<'py, PyAny>,
    rotation: &Bound<'py, PyAny>,
    parameters: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    let direction = triple("translation", &arrays::doubles("translation", translation)?)?;
    let motion = Motion::new(direction, triple("rotation", &arrays::doubles("rotation", rotation)?)?);
    let (shape, depths) = arrays::doubles("inv_depth", inverse_depth)?;
    if option(parameters, "six")? {
        let given = GivenPatches::new(points, None, parameters)?;
        let surfaces: Vec<[f64; 3]> = rows("inv_depth", &shape, &depths)?;
        let bound = py.detach(|| patch_motion_bound(&given.patches(), &motion, &surfaces))?;
        return told_bound(py, &bound);
    }
    let given = Given::new(points, None, parameters)?;
    let bound = py.detach(|| motion_bound(&given.flow(), &given.noise(), &motion, &depths))?;
    told_bound(py, &bound)
}

#[pyfunction]
#[pyo3(name = "_motion3d_focus")]
pub fn motion3d_focus<'py>(
    py: Python<'py>,
    translation: &Bound<'py, PyAny>,
    tangent: &Bound<'py, PyAny>,
    covariance: &Bound<'py, PyAny>,
    intrinsics: Option<&Bound<'py, PyAny>>,
) -> PyResult<Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>> {
    let camera = camera(intrinsics.map(|k| arrays::doubles("K", k)).transpose()?)?;
    let direction = triple("translation", &arrays::doubles("translation", translation)?)?;
    let (_, axes) = arrays::doubles("tangent", tangent)?;
    let (_, values) = arrays::doubles("covariance", covariance)?;
    if axes.len() != 6 || values.len() != 25 {
        return Err(Error::argument("covariance", "shapes (2, 3) and (5, 5)", "others").into());
    }
    let motion = Motion { translation: direction, rotation: [0.0; 3] };
    let axes = std::array::from_fn(|i| std::array::from_fn(|j| axes[3 * i + j]));
    let values = std::array::from_fn(|i| std::array::from_fn(|j| values[5 * i + j]));
    let Some((focus, spread)) = focus_of_expansion(&motion, &axes, &values, camera.as_ref()) else { return Ok(None) };
    let focus = arrays::owned(py, &[2], focus.to_vec())?.into_any();
    Ok(Some((focus, arrays::owned(py, &[2, 2], flat(&spread))?.into_any())))
}

#[pyfunction]
#[pyo3(name = "_motion3d_two_views")]
pub fn motion3d_two_views<'py>(
    py: Python<'py>,
    translation: &Bound<'py, PyAny>,
    rotation: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let motion = Motion {
        translation: triple("translation", &arrays::doubles("translation", translation)?)?,
        rotation: triple("rotation", &arrays::doubles("rotation", rotation)?)?,
    };
    let essential = arrays::owned(py, &[3, 3], flat(&motion.essential_matrix()))?;
    let turn = arrays::owned(py, &[3, 3], flat(&motion.rotation_matrix()))?;
    let displacement = arrays::owned(py, &[3], motion.displacement().to_vec())?;
    Ok((essential.into_any(), turn.into_any(), displacement.into_any()))
}

#[pyfunction]
#[pyo3(name = "_motion3d_predict")]
pub fn motion3d_predict<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    inverse_depth: &Bound<'py, PyAny>,
    translation: &Bound<'py, PyAny>,
    rotation: &Bound<'py, PyAny>,
    intrinsics: Option<&Bound<'py, PyAny>>,
    spherical: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let camera = camera(intrinsics.map(|k| arrays::doubles("K", k)).transpose()?)?;
    let motion = Motion {
        translation: triple("translation", &arrays::doubles("translation", translation)?)?,
        rotation: triple("rotation", &arrays::doubles("rotation", rotation)?)?,
    };
    let (shape, values) = arrays::doubles("points", points)?;
    let (depth_shape, depths) = arrays::doubles("inv_depth", inverse_depth)?;
    let count = shape.first().copied().unwrap_or(0);
    if depth_shape != [count] {
        return Err(Error::argument("inv_depth", format!("shape ({count},)"), format!("shape {depth_shape:?}")).into());
    }
    if spherical {
        let bearings: Vec<[f64; 3]> = rows("points", &shape, &values)?;
        let flow: Vec<[f64; 3]> = bearings.iter().zip(&depths).map(|(&b, &nu)| motion.sphere_flow(b, nu)).collect();
        return Ok(arrays::owned(py, &[count, 3], flat_rows(&flow))?.into_any());
    }
    let pixels: Vec<[f64; 2]> = rows("points", &shape, &values)?;
    let flow: Vec<[f64; 2]> =
        pixels.iter().zip(&depths).map(|(&at, &nu)| motion.picture_flow(at, nu, camera.as_ref())).collect();
    Ok(arrays::owned(py, &[count, 2], flat_rows(&flow))?.into_any())
}
