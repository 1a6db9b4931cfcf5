//! What is given about points: where they are, what moves there, its noise, the camera; owned.

use crate::arrays;
use crate::errors::Outcome;
use jacoflow::error::{Error, shape_text};
use jacoflow::motion3d::{AffinePatches, Flow, Intrinsics, Noise};
use pyo3::prelude::*;

/// An argument as Python gave it.
type Any<'py> = Bound<'py, PyAny>;

/// Whether a screen is the sphere, by its name.
pub const PROJECTIONS: [(&str, bool); 2] = [("plane", false), ("sphere", true)];

/// How points are given, by the keywords of the Python functions.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Layout<'py> {
    #[pyo3(item("K"))]
    camera: Option<Any<'py>>,
    noise_std: Option<f64>,
    cov: Option<Any<'py>>,
    projection: String,
}

impl Layout<'_> {
    fn check(&self) -> Outcome<()> {
        if self.cov.is_some() && self.noise_std.is_some() {
            return Err(Error::argument("cov", "either noise_std or cov", "both").into());
        }
        Ok(())
    }
}

/// Points of a screen with `D` coordinates each.
pub fn rows<const D: usize>(name: &'static str, shape: &[usize], values: &[f64]) -> Outcome<Vec<[f64; D]>> {
    if shape.len() == 2 && shape[1] == D || shape == [0] {
        return Ok(values.as_chunks::<D>().0.to_vec());
    }
    Err(Error::argument(name, format!("shape (N, {D})"), format!("shape {}", shape_text(shape))).into())
}

/// A vector of space.
pub fn triple(name: &'static str, given: &Any<'_>) -> Outcome<[f64; 3]> {
    let (shape, values) = arrays::doubles(name, given)?;
    match values[..] {
        [x, y, z] if shape == [3] => Ok([x, y, z]),
        _ => Err(Error::argument(name, "shape (3,)", format!("shape {}", shape_text(&shape))).into()),
    }
}

/// A matrix of a shape.
pub fn fixed<const D: usize, const N: usize>(name: &'static str, given: &Any<'_>) -> Outcome<[[f64; D]; N]> {
    let (shape, values) = arrays::doubles(name, given)?;
    let matrix = <[[f64; D]; N]>::try_from(values.as_chunks().0).ok().filter(|_| shape == [N, D]);
    let wrong = || Error::argument(name, format!("shape ({N}, {D})"), format!("shape {}", shape_text(&shape))).into();
    matrix.ok_or_else(wrong)
}

/// A matrix of 3 x 3 values.
pub fn square(name: &'static str, of: &str, given: &Any<'_>) -> Outcome<[[f64; 3]; 3]> {
    let (shape, values) = arrays::doubles(name, given)?;
    if shape != [3, 3] {
        return Err(Error::argument(name, format!("{of}shape (3, 3)"), format!("shape {}", shape_text(&shape))).into());
    }
    Ok(std::array::from_fn(|i| std::array::from_fn(|j| values[3 * i + j])))
}

/// The camera, where there is one.
pub fn camera(given: Option<&Any<'_>>) -> Outcome<Option<Intrinsics>> {
    let matrix = given.map(|matrix| square("K", "", matrix)).transpose()?;
    Ok(matrix.map(Intrinsics::new).transpose()?)
}

/// The option's value that a word names.
pub fn word<T: Copy>(name: &'static str, value: &str, known: &[(&str, T)]) -> Outcome<T> {
    let found = known.iter().find(|(known, _)| *known == value).map(|(_, result)| *result);
    let names: Vec<String> = known.iter().map(|(known, _)| format!("{known:?}")).collect();
    found.ok_or_else(|| Error::argument(name, names.join(" or "), format!("{value:?}")).into())
}

/// Points with their flow.
enum Screen {
    Plane(Vec<[f64; 2]>, Vec<[f64; 2]>),
    Sphere(Vec<[f64; 3]>, Vec<[f64; 3]>),
}

/// Points with flow and noise.
pub struct Given {
    screen: Screen,
    camera: Option<Intrinsics>,
    noise_std: Option<f64>,
    covariances: Option<Vec<f64>>,
}

impl Given {
    /// Without `flow`, that of points is zero: bounds do not look at it.
    pub fn new(points: &Any<'_>, flow: Option<&Any<'_>>, layout: &Layout<'_>) -> Outcome<Self> {
        layout.check()?;
        let spherical = word("projection", &layout.projection, &PROJECTIONS)?;
        let camera = camera(layout.camera.as_ref())?;
        if spherical && camera.is_some() {
            return Err(Error::argument("K", "none, as bearings need no camera", "a matrix").into());
        }
        let (shape, values) = arrays::doubles("points", points)?;
        let flow = flow.map(|flow| arrays::doubles("flow", flow)).transpose()?;
        let (flow_shape, flow) = flow.unwrap_or_else(|| (shape.clone(), vec![0.0; values.len()]));
        let screen = if spherical {
            Screen::Sphere(rows("points", &shape, &values)?, rows("flow", &flow_shape, &flow)?)
        } else {
            Screen::Plane(rows("points", &shape, &values)?, rows("flow", &flow_shape, &flow)?)
        };
        let count = shape.first().copied().unwrap_or(0);
        let covariances = covariances(layout, count, if spherical { 3 } else { 2 })?;
        Ok(Self { screen, camera, noise_std: layout.noise_std, covariances })
    }

    /// As the core takes it.
    pub fn flow(&self) -> Flow<'_> {
        match &self.screen {
            Screen::Sphere(bearings, flow) => Flow::Sphere { bearings, flow },
            Screen::Plane(points, flow) => Flow::Plane { points, flow, camera: self.camera.as_ref() },
        }
    }

    /// As the core takes it.
    pub fn noise(&self) -> Noise<'_> {
        match (&self.covariances, self.noise_std) {
            (Some(values), _) => Noise::Covariances(values),
            (None, Some(noise_std)) => Noise::StandardDeviation(noise_std),
            (None, None) => Noise::Unknown,
        }
    }
}

/// Covariances of `count` flow vectors, where they are given.
fn covariances(layout: &Layout<'_>, count: usize, size: usize) -> Outcome<Option<Vec<f64>>> {
    let Some(given) = &layout.cov else { return Ok(None) };
    let (shape, values) = arrays::doubles("cov", given)?;
    if shape != [count, size, size] {
        let expected = format!("shape ({count}, {size}, {size})");
        return Err(Error::argument("cov", expected, format!("shape {}", shape_text(&shape))).into());
    }
    Ok(Some(values))
}

/// `(u, v, u_x, v_x, u_y, v_y)` of flow (N, 2) and Jacobians (N, 2, 2).
fn six_numbers(flow: &Any<'_>, slopes: &Any<'_>) -> Outcome<Vec<[f64; 6]>> {
    let (shape, values) = arrays::doubles("flow", flow)?;
    let flow: Vec<[f64; 2]> = rows("flow", &shape, &values)?;
    let (shape, slopes) = arrays::doubles("jacobian", slopes)?;
    if shape != [flow.len(), 2, 2] {
        let expected = format!("shape ({}, 2, 2)", flow.len());
        return Err(Error::argument("jacobian", expected, format!("shape {}", shape_text(&shape))).into());
    }
    let one = |(f, j): (&[f64; 2], &[f64; 4])| [f[0], f[1], j[0], j[2], j[1], j[3]];
    Ok(flow.iter().zip(slopes.as_chunks::<4>().0).map(one).collect())
}

/// Patches with six numbers each.
pub struct GivenPatches {
    points: Vec<[f64; 2]>,
    motion: Vec<[f64; 6]>,
    covariances: Vec<f64>,
    camera: Option<Intrinsics>,
}

impl GivenPatches {
    /// Without `affine`, flow and Jacobian, the numbers are zero: bounds do not look at them.
    pub fn new(points: &Any<'_>, affine: Option<(&Any<'_>, &Any<'_>)>, layout: &Layout<'_>) -> Outcome<Self> {
        layout.check()?;
        if layout.projection != "plane" {
            let expected = "\"plane\" with a jacobian, whose numbers are those of the plane";
            return Err(Error::argument("projection", expected, format!("{:?}", layout.projection)).into());
        }
        if layout.noise_std.is_some() {
            return Err(
                Error::argument("noise_std", "None with a jacobian, which needs cov (N, 6, 6)", "a number").into()
            );
        }
        let (shape, values) = arrays::doubles("points", points)?;
        let points: Vec<[f64; 2]> = rows("points", &shape, &values)?;
        let motion = affine.map(|(flow, slopes)| six_numbers(flow, slopes)).transpose()?;
        let motion = motion.unwrap_or_else(|| vec![[0.0; 6]; points.len()]);
        let wanted = [points.len(), 6, 6];
        match layout.cov.as_ref().map(|given| arrays::doubles("cov", given)).transpose()? {
            Some((shape, covariances)) if shape == wanted => {
                Ok(Self { points, motion, covariances, camera: camera(layout.camera.as_ref())? })
            }
            other => {
                let got = other.map_or_else(|| "none".into(), |(shape, _)| format!("shape {}", shape_text(&shape)));
                Err(Error::argument("cov", format!("shape {}, for six numbers a patch", shape_text(&wanted)), got)
                    .into())
            }
        }
    }

    /// As the core takes them.
    pub fn patches(&self) -> AffinePatches<'_> {
        AffinePatches {
            points: &self.points,
            motion: &self.motion,
            covariances: &self.covariances,
            camera: self.camera.as_ref(),
        }
    }
}
