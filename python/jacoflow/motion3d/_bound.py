"""What theory predicts for a layout of points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from .._brief import Brief
from .._checks import switch
from .._jacoflow import _motion3d_bound
from ._checks import Array, layout


@dataclass(frozen=True, eq=False, repr=False)
class MotionBound(Brief):
    """What theory predicts for a layout of points: covariances of (psi, w), rad and rad/frame."""

    crlb: Array
    """The Cramer-Rao bound (5, 5) (8), (9), rad and rad/frame."""
    ml_covariance: Array
    """Maximum likelihood's covariance (5, 5) (17), (24), rad and rad/frame: the bound and a term of fourth
    order in the noise."""
    ideal_covariance: Array
    """Covariance (5, 5) with ideal weights (25), rad and rad/frame."""
    tangent: Array
    """Axes (2, 3) of psi, no unit."""
    direction_std: Array
    """Standard deviations (3,) of the direction in units of degrees: of the bound, of maximum likelihood, of
    ideal weights."""


def motion_bound(
    points: ArrayLike,
    translation: ArrayLike,
    rotation: ArrayLike,
    inv_depth: ArrayLike,
    K: ArrayLike | None = None,
    *,
    noise_std: float | None = None,
    cov: ArrayLike | None = None,
    jacobian: bool = False,
    projection: Literal["plane", "sphere"] = "plane",
) -> MotionBound:
    """Predicted covariances of a motion from flow at these points: for the design of an experiment, before
    anything is measured.

    Parameters
    ----------
    points : array (N, 2), px with K, else on the plane at distance 1; (N, 3), unit bearings, on the sphere
        Where flow would be measured.
    translation, rotation : arrays (3,), the latter in rad/frame
        The motion; only the direction of the translation counts.
    inv_depth : array (N,), units of |u| per frame; (N, 3) with `jacobian`: (nu, nu_x, nu_y)
        True inverse depths.
    K : array (3, 3) or None
        Camera matrix, px.
    noise_std : float, units of flow
        Standard deviation of each component of the flow; not with `jacobian`.
    cov : array (N, 2, 2), (N, 3, 3) on the sphere, or (N, 6, 6) with `jacobian`
        Covariances instead of `noise_std`, units of flow squared.
    jacobian : bool
        Whether six numbers would be measured a patch.
    projection : "plane" or "sphere"
        The screen.

    Raises
    ------
    ValueError
        For shapes and values that do not fit, noise that is not given or given twice, and fewer than 5 points
        (2 with `jacobian`) that are finite.
    NotObservableError
        When the points do not determine the motion, as points at one place.
    """
    given = layout(K, noise_std, cov, projection)
    return MotionBound(**_motion3d_bound(points, inv_depth, translation, rotation, switch("jacobian", jacobian), given))
