"""A motion with its uncertainty, and what can be read off it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._brief import Brief, Rows
from .._jacoflow import _motion3d_focus
from ._checks import Array, kind


@dataclass(frozen=True, eq=False, repr=False)
class MotionSolution(Brief):
    """A motion by itself, rad/frame: the maximum-likelihood solution, or another motion that explains the
    flow about as well."""

    translation: Array
    """Unit direction `u` (3,), scene relative to camera, no unit."""
    rotation: Array
    """Rotation rate `w` (3,), rad/frame."""
    covariance: Array | None = None
    """Covariance (5, 5) of (psi, w), rad and rad/frame: (17) of the paper; None for alternatives, NaN where
    it is not known."""
    tangent: Array | None = None
    """Axes (2, 3) of psi, no unit: `u + psi @ tangent`."""
    cost: float = float("nan")
    """Sum of the squared residuals across the epipolar lines, in units of noise; of alternatives: how much
    more than that of the first choice, with what the depths say."""


@dataclass(frozen=True, eq=False, repr=False)
class SystematicEffect(Brief):
    """What a factor and a displacement do to a motion that all flow has in common (`flow_scale_std`,
    `flow_bias_std` of `estimate_motion`): `motion.T @ motion` (5, 5) is in its covariance, rad and
    rad/frame."""

    scale: float
    """Standard deviation of the factor, no unit."""
    displacements: Array
    """Displacements (2, 2), one a row, of one standard deviation along both axes of the picture, on the plane
    at distance 1."""
    motion: Array
    """What one standard deviation of the factor and each displacement do to (psi, w) (3, 5), rad and
    rad/frame."""


@dataclass(frozen=True, eq=False, repr=False)
class MotionEstimate(Rows):
    """A rigid motion, rad/frame, with its uncertainty and the inverse depths (N,) of its points."""

    _ROWS = ("inv_depth", "inv_depth_std", "inv_depth_smooth", "surface_slopes", "time_to_contact", "time_to_contact_std", "inliers", "residuals")

    translation: Array
    """Unit direction `u` (3,) of the scene relative to the camera, no unit; NaN where there is none."""
    rotation: Array
    """Rotation rate `w` (3,) of the scene relative to the camera, rad/frame."""
    status: Literal["ok", "few_points", "too_few_points", "rotation_only", "ambiguous", "ill_conditioned", "low_snr"]
    """Whether the estimate is usable, or why not (no unit): "ok"; "few_points" (below 12 points or 5 patches,
    or too few to separate outliers from inliers); "too_few_points" (below 5 points or 2 patches: NaN);
    "rotation_only" (no translation within the noise: `u` NaN, `inv_depth` 0); "ambiguous" (another motion
    explains the flow as well, see `alternatives`: that of a plane, the opposite direction in a narrow field,
    that of other points in a robust search, that of the flow alone where it contradicts the
    `rotation_prior`); "ill_conditioned" (the points do not determine all unknowns, `direction_std` is above
    20 degrees or 1.5 times the field, its confidence interval has no end, or directions beyond the covariance
    explain the flow as well); "low_snr" (the depths are mostly noise: the covariance is that of smoothed
    weights)."""
    method_used: Literal["ml", "efficient"]
    """Whose result `translation` and `rotation` are (no unit)."""
    fell_back: bool
    """Whether smoothed weights were requested but had no solution, so that the result is that of maximum
    likelihood (no unit)."""
    covariance: Array
    """Covariance (5, 5) of (psi, w): the direction is `u + psi @ tangent`, psi in rad, w in rad/frame. Where
    residuals are larger than the given noise, by more than chance, it is larger by as much. NaN where it is
    not known: also of 7 points and fewer without `noise_std` and `cov`, whose residuals do not say how large
    the noise is (Student's distribution with up to two degrees of freedom has no variance). Of
    "ill_conditioned" its directions reach as far as those that explain the flow as well."""
    tangent: Array
    """Axes (2, 3) of psi: unit vectors perpendicular to `u`, no unit."""
    systematic_errors: SystematicEffect
    """What is in `covariance` of errors that all flow has in common (units there)."""
    crlb: Array
    """The Cramer-Rao bound (5, 5) of (psi, w) (8), rad and rad/frame, with the information estimated; NaN
    where that is mostly noise."""
    direction_std: float
    """Standard deviation of the direction, `sqrt(trace(covariance[:2, :2]))`, in units of degrees; NaN where
    `covariance` is."""
    rotation_std: Array
    """Standard deviations (3,) of `rotation`, rad/frame."""
    inv_depth: Array
    """Inverse depths (N,) by least squares for this motion, in units of `|u|` per frame; of displacements
    half way in time; NaN for points that are not finite."""
    inv_depth_std: Array
    """Standard deviations (N,) of `inv_depth` from the noise of the point's own flow; infinite at the
    epipole."""
    inv_depth_smooth: Array
    """Inverse depths (N,) shrunk to their neighbours, as they weigh the equations; those of "ml" are
    `inv_depth`. NaN for outliers."""
    surface_slopes: Array | None
    """Slopes (N, 2) of the inverse depth along x and y in the weights, per unit of the plane at distance 1;
    None unless a Jacobian was given."""
    time_to_contact: Array
    """`-1 / (nu u_z)` (N,), frames, of `inv_depth_smooth` (of `inv_depth` where that is NaN or comes from
    `weight_inv_depth`, whose unit is any): positive when approaching, infinite when `u_z = 0`."""
    time_to_contact_std: Array
    """Standard deviations (N,) of `time_to_contact`, frames, from those of the smoothed depths and of the
    motion."""
    approach_rate: float
    """`nu u_z` of all inliers together, 1/frame, weighted by what each point's own flow says: that of one
    object or of the scene's mean; `-1 / approach_rate` is its time to contact in frames. NaN for six numbers
    a patch."""
    approach_rate_std: float
    """Standard deviation of `approach_rate`, 1/frame, of the depths and of the motion."""
    inliers: NDArray[np.bool_]
    """Inliers (N,) of the motion."""
    noise_std: float
    """Standard deviation of each flow component, given or estimated, in units of the flow; 1 where
    covariances were given."""
    residuals: Array
    """Residuals (N,) across the epipolar lines in units of noise (of six numbers: the root of the summed
    squares); NaN for points that are not finite."""
    alternatives: tuple[MotionSolution, ...]
    """Other motions that explain the flow about as well, the best first (no unit)."""
    ml: MotionSolution
    """The maximum-likelihood solution (units there)."""

    @property
    def camera_translation(self) -> Array:
        """Direction (3,) in which the camera itself moves, no unit: `-translation`."""
        return -self.translation


def estimate_of(values: dict[str, Any]) -> MotionEstimate:
    """Builds the result from that of the compiled module."""
    surfaces = values.pop("surfaces")
    values["alternatives"] = tuple(MotionSolution(**other) for other in values["alternatives"])
    values["ml"] = MotionSolution(**values["ml"])
    values["systematic_errors"] = SystematicEffect(**values["systematic_errors"])
    return MotionEstimate(**values, surface_slopes=surfaces[:, 1:] if len(surfaces) else None)


def time_to_contact(result: MotionEstimate) -> Array:
    """Frames until each point (N,) reaches the camera's plane, `-1 / (nu u_z)`: positive when approaching,
    infinite when `u_z = 0`. On the sphere, where inverse depths are inverse ranges, times and their
    deviations are to be multiplied by the bearings' z: `result.time_to_contact * points[:, 2]`."""
    kind("result", result, MotionEstimate)
    return result.time_to_contact


def time_to_contact_std(result: MotionEstimate) -> Array:
    """Standard deviations (N,) of `time_to_contact`, frames, to first order: of the smoothed depth (its
    posterior deviation given its neighbours; the point's own where nothing was smoothed) and of the
    motion."""
    kind("result", result, MotionEstimate)
    return result.time_to_contact_std


def focus_of_expansion(result: MotionEstimate, K: ArrayLike | None = None) -> tuple[Array, Array] | None:
    """The point `K (u / u_z)` that the flow comes from or goes to: its place (2,), px with K, and its
    covariance (2, 2), px^2; None when `|u_z| < 1e-9`."""
    kind("result", result, MotionEstimate)
    return _motion3d_focus(result.translation, result.tangent, result.covariance, K)
