//! What a motion does to points, and where it leads.

use super::given::{PROJECTIONS, camera, fixed, rows, triple, word};
use super::results::matrix;
use crate::arrays;
use crate::errors::Outcome;
use jacoflow::error::{Error, shape_text};
use jacoflow::motion3d::{Motion, focus_of_expansion};
use pyo3::prelude::*;

/// An array, in or out.
type Any<'py> = Bound<'py, PyAny>;

/// The axes of a direction and its covariance in them.
pub fn spread(tangent: &Any<'_>, covariance: &Any<'_>) -> Outcome<([[f64; 3]; 2], [[f64; 5]; 5])> {
    Ok((fixed("tangent", tangent)?, fixed("covariance", covariance)?))
}

pub fn motion(translation: &Any<'_>, rotation: &Any<'_>) -> Outcome<Motion> {
    Ok(Motion { translation: triple("translation", translation)?, rotation: triple("rotation", rotation)? })
}

#[pyfunction]
#[pyo3(name = "_motion3d_focus")]
pub fn motion3d_focus<'py>(
    py: Python<'py>,
    translation: &Any<'py>,
    tangent: &Any<'py>,
    covariance: &Any<'py>,
    intrinsics: Option<&Any<'py>>,
) -> Outcome<Option<(Any<'py>, Any<'py>)>> {
    let camera = camera(intrinsics)?;
    let motion = Motion { translation: triple("translation", translation)?, rotation: [0.0; 3] };
    let (axes, values) = spread(tangent, covariance)?;
    let Some((focus, spread)) = focus_of_expansion(&motion, &axes, &values, camera.as_ref()) else { return Ok(None) };
    let focus = arrays::owned(py, &[2], focus.to_vec())?;
    Ok(Some((focus.into_any(), matrix(py, &spread)?.into_any())))
}

#[pyfunction]
#[pyo3(name = "_motion3d_essential")]
pub fn motion3d_essential<'py>(py: Python<'py>, translation: &Any<'py>, rotation: &Any<'py>) -> Outcome<Any<'py>> {
    let motion = motion(translation, rotation)?;
    Ok(matrix(py, &motion.essential_matrix())?.into_any())
}

#[pyfunction]
#[pyo3(name = "_motion3d_predict")]
pub fn motion3d_predict<'py>(
    py: Python<'py>,
    points: &Any<'py>,
    inverse_depth: &Any<'py>,
    translation: &Any<'py>,
    rotation: &Any<'py>,
    intrinsics: Option<&Any<'py>>,
    projection: &str,
    whole_frame: bool,
) -> Outcome<Any<'py>> {
    let spherical = word("projection", projection, &PROJECTIONS)?;
    if spherical && whole_frame {
        return Err(Error::argument("whole_frame", "False on the sphere, whose flow is instantaneous", "True").into());
    }
    let camera = camera(intrinsics)?;
    let motion = motion(translation, rotation)?;
    let (shape, values) = arrays::doubles("points", points)?;
    let (depth_shape, depths) = arrays::doubles("inv_depth", inverse_depth)?;
    let count = shape.first().copied().unwrap_or(0);
    if depth_shape != [count] {
        return Err(Error::argument(
            "inv_depth",
            format!("shape ({count},)"),
            format!("shape {}", shape_text(&depth_shape)),
        )
        .into());
    }
    if spherical {
        let bearings: Vec<[f64; 3]> = rows("points", &shape, &values)?;
        let flow: Vec<[f64; 3]> = bearings.iter().zip(&depths).map(|(&b, &nu)| motion.sphere_flow(b, nu)).collect();
        return Ok(matrix(py, &flow)?.into_any());
    }
    let pixels: Vec<[f64; 2]> = rows("points", &shape, &values)?;
    let moved = |(&at, &nu): (&[f64; 2], &f64)| {
        if whole_frame {
            motion.picture_displacement(at, nu, camera.as_ref())
        } else {
            motion.picture_flow(at, nu, camera.as_ref())
        }
    };
    let flow: Vec<[f64; 2]> = pixels.iter().zip(&depths).map(moved).collect();
    Ok(matrix(py, &flow)?.into_any())
}
