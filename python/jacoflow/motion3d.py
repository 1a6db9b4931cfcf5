"""Rigid 3-D motion from noisy optical flow, with an honest covariance and the bound that no estimator can beat.

One translation direction `u` (`|u| = 1`), one rotation rate `w` and an inverse depth `nu` for every point explain the flow: `f = nu G u + R w`. `u` and `w` are the motion of the scene relative to the camera, `X' = u + w x X`
(the camera itself moves by `-u`); camera axes are x right, y down, z forward; inverse depths are in units of `|u|` per frame. Source: T. Endoh, T. Toriu, N. Tagawa, "The Maximum Likelihood Estimator is Not 'Optimal' on 3-D Motion
Estimation from Noisy Optical Flow" (equation numbers below), and smoothed weights beyond it.

>>> import numpy as np
>>> from jacoflow import motion3d
>>> rng = np.random.default_rng(1)
>>> points, depths = rng.uniform(-0.6, 0.6, (300, 2)), rng.uniform(0.5, 1.5, 300)
>>> u, w = np.array([0.6, 0.2, 0.75]), np.array([0.02, -0.03, 0.01])
>>> flow = motion3d.predict_flow(points, u, w, depths) + rng.normal(0, 0.005, (300, 2))
>>> found = motion3d.estimate_motion(points, flow, sigma=0.005, placement="start")
>>> found.status, float(np.degrees(np.arccos(found.translation @ u / np.linalg.norm(u)))) < 1
('ok', True)
"""

from __future__ import annotations

import operator
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._jacoflow import (
    _motion3d_bound,
    _motion3d_contact_map,
    _motion3d_estimate,
    _motion3d_field_points,
    _motion3d_focus,
    _motion3d_predict,
    _motion3d_two_views,
)
from ._sideways import SidewaysBound, SidewaysEstimate, estimate_sideways, sideways_bound

if TYPE_CHECKING:
    from . import FlowField

__all__ = [
    "MotionBound",
    "MotionEstimate",
    "MotionSolution",
    "SidewaysBound",
    "SidewaysEstimate",
    "essential_matrix",
    "estimate_field_motion",
    "estimate_motion",
    "estimate_sideways",
    "focus_of_expansion",
    "motion_bound",
    "predict_flow",
    "sideways_bound",
    "time_to_contact",
    "time_to_contact_map",
    "time_to_contact_std",
]

Array = NDArray[np.float64]

@dataclass(frozen=True, eq=False)
class MotionSolution:
    """A motion by itself, rad/frame: the maximum-likelihood solution, or another motion that explains the flow about as well."""

    translation: Array
    """Unit direction `u` (3,), scene relative to camera, no unit."""
    rotation: Array
    """Rotation rate `w` (3,), rad/frame."""
    covariance: Array | None = None
    """Covariance (5, 5) of (psi, w), rad and rad/frame: (17) of the paper; None for alternatives, NaN where it is not known."""
    tangent: Array | None = None
    """Axes (2, 3) of psi, no unit: `u + psi @ tangent`."""
    cost: float = float("nan")
    """Sum of the squared residuals across the epipolar lines, in units of noise; of alternatives: how much more than that of the first choice, with what the depths say."""


@dataclass(frozen=True, eq=False)
class MotionEstimate:
    """A rigid motion, rad/frame, with its uncertainty and the inverse depths (N,) of its points."""

    translation: Array
    """Unit direction `u` (3,) of the scene relative to the camera, no unit; NaN where there is none."""
    rotation: Array
    """Rotation rate `w` (3,) of the scene relative to the camera, rad/frame."""
    status: Literal["ok", "few_points", "too_few_points", "rotation_only", "ambiguous", "ill_conditioned", "low_snr"]
    """How far it can be trusted (no unit): "ok"; "few_points" (below 12 points or 5 patches); "too_few_points" (below 5 points or 2 patches: NaN); "rotation_only" (no translation within the noise: `u` NaN, `inv_depth` 0); "ambiguous" (another
    motion explains the flow as well, see `alternatives`: that of a plane, the opposite direction in a narrow field, that of other points in a robust search); "ill_conditioned" (the points do not tell of all unknowns, `direction_std` is above 20 degrees, or directions beyond the covariance explain the flow as well); "low_snr" (the depths are mostly noise: the covariance is that of smoothed weights; or, of 100 points and more, `direction_std` is above 8 degrees, where the covariance no longer tells the shape of what is not known)."""
    method_used: Literal["ml", "efficient"]
    """Whose result `translation` and `rotation` are (no unit)."""
    fell_back: bool
    """Whether smoothed weights were asked for but led nowhere, so that the result is that of maximum likelihood (no unit)."""
    covariance: Array
    """Covariance (5, 5) of (psi, w): the direction is `u + psi @ tangent`, psi in rad, w in rad/frame."""
    tangent: Array
    """Axes (2, 3) of psi: unit vectors perpendicular to `u`, no unit."""
    crlb: Array
    """The Cramer-Rao bound (5, 5) of (psi, w) (8), rad and rad/frame, with the information estimated; NaN where that is mostly noise."""
    direction_std: float
    """Standard deviation of the direction, `sqrt(trace(covariance[:2, :2]))`, in units of degrees."""
    rotation_std: Array
    """Standard deviations (3,) of `rotation`, rad/frame."""
    inv_depth: Array
    """Inverse depths (N,) by least squares for this motion, in units of `|u|` per frame; of displacements half way in time; NaN for points that are not finite."""
    inv_depth_std: Array
    """Standard deviations (N,) of `inv_depth` from the noise of the point's own flow; infinite at the epipole."""
    inv_depth_smooth: Array
    """Inverse depths (N,) drawn to their neighbours, as they weigh the equations; those of "ml" are `inv_depth`. NaN for points that do not obey the motion."""
    surface_slopes: Array | None
    """Slopes (N, 2) of the inverse depth along x and y in the weights, per unit of the plane at distance 1; None unless a Jacobian was given."""
    time_to_contact: Array
    """`-1 / (nu u_z)` (N,), frames, of `inv_depth_smooth` (of `inv_depth` where that is NaN or comes from `weight_inv_depth`, whose unit is any): positive when approaching, infinite when `u_z = 0`."""
    time_to_contact_std: Array
    """Standard deviations (N,) of `time_to_contact`, frames, from those of the smoothed depths and of the motion."""
    approach_rate: float
    """`nu u_z` of all inliers together, 1/frame, weighted by what each point's own flow says: that of one object or of the scene's mean; `-1 / approach_rate` is its time to contact in frames. NaN for six numbers a patch."""
    approach_rate_std: float
    """Standard deviation of `approach_rate`, 1/frame, of the depths and of the motion."""
    inliers: NDArray[np.bool_]
    """Points (N,) that obey the motion."""
    sigma: float
    """Standard deviation of each flow component, given or estimated, in units of the flow; 1 where covariances were given."""
    residuals: Array
    """Residuals (N,) across the epipolar lines in units of noise (of six numbers: the root of the summed squares); NaN for points that are not finite."""
    alternatives: tuple[MotionSolution, ...]
    """Other motions that explain the flow about as well, the best first (no unit)."""
    ml: MotionSolution
    """The maximum-likelihood solution (units there)."""

    @property
    def camera_translation(self) -> Array:
        """Direction (3,) in which the camera itself moves, no unit: `-translation`."""
        return -self.translation


@dataclass(frozen=True, eq=False)
class MotionBound:
    """What theory predicts for a layout of points: covariances of (psi, w), rad and rad/frame."""

    crlb: Array
    """The Cramer-Rao bound (5, 5) (8), (9), rad and rad/frame."""
    ml_covariance: Array
    """Maximum likelihood's covariance (5, 5) (17), (24), rad and rad/frame: the bound and a term of fourth order in the noise."""
    ideal_covariance: Array
    """Covariance (5, 5) with ideal weights (25), rad and rad/frame."""
    tangent: Array
    """Axes (2, 3) of psi, no unit."""
    direction_std: Array
    """Standard deviations (3,) of the direction in units of degrees: of the bound, of maximum likelihood, of ideal weights."""


def estimate_motion(
    points: ArrayLike,
    flow: ArrayLike,
    K: ArrayLike | None = None,
    *,
    sigma: float | None = None,
    cov: ArrayLike | None = None,
    jacobian: ArrayLike | None = None,
    projection: Literal["plane", "sphere"] = "plane",
    method: Literal["auto", "ml", "efficient"] = "auto",
    robust: bool = False,
    placement: Literal["midpoint", "start"] = "midpoint",
    smoother: Literal["auto", "prior", "neighbours"] = "auto",
    weight_inv_depth: ArrayLike | None = None,
    rotation_prior: tuple[ArrayLike, ArrayLike] | None = None,
    initial: tuple[ArrayLike, ArrayLike] | None = None,
    shared: float = 1.0,
    correlation_length: float = 0.0,
    seed: int = 0,
    threads: int | None = None,
) -> MotionEstimate:
    """The rigid motion that explains flow at N points, with covariance, depths and status.

    Maximum likelihood over all directions (3), (4), then the estimating equation (19) whose weights have smoothed depths. Scenes that do not determine a motion are told by `status`. Everything is computed in double precision; the result does not depend on the
    number of threads.

    Parameters
    ----------
    points : array (N, 2), px with K, else (x, y) on the plane at distance 1; (N, 3), unit bearings, on the sphere
        Where. Rows that are not finite are left out.
    flow : array (N, 2), px/frame with K, else per frame; (N, 3) on the sphere
        Displacement over one frame.
    K : array (3, 3) or None
        Camera matrix, px; skew and unequal focal lengths are heeded.
    sigma : float, units of flow
        Standard deviation of each component. None, and no `cov`: estimated from the residuals.
    cov : array (N, 2, 2), units of flow squared; (N, 3, 3) on the sphere; (N, 6, 6) with `jacobian`
        Covariance of each point's flow, in the order (u, v, u_x, v_x, u_y, v_y). A point with a variance below a millionth of the lower quartile of all has that quartile added, as no measurement is so much better than the others.
    jacobian : array (N, 2, 2), 1/frame
        [[u_x, u_y], [v_x, v_y]] at the points: six numbers a patch, which pays for few (2 to 10), large patches (windows of 30 px and more) that do not overlap. Needs `cov`.
    projection : "plane" or "sphere"
        The screen.
    method : "auto", "ml" or "efficient"
        "auto": "efficient" from 30 points (5 patches) on, else "ml".
    robust : bool
        Find the points that obey one motion among up to 60 % that do not. Without `sigma` or `cov` and below 100 points, outliers are believed in only if they explain more than larger noise would; where that is not sure the status is "few_points". A mover whose border cannot be told makes it "ambiguous".
    placement : "midpoint" or "start"
        What flow is. "midpoint": a displacement over one frame of a steady motion, from `points` to `points + flow`; its rotation is taken out of both ends, half from each, so that `translation` and `rotation` are exact however fast the camera turns (`X_2 = exp([w]x) X_1 + V(w) u`; noise-free views are recovered to rounding), and inverse depths are those half way in time. Where that is
        negligible beside the noise the displacement is placed half way, exact to second order. "start": instantaneous flow at `points`. Bearings and their flow are taken as given.
    smoother : "auto", "prior" or "neighbours"
        What depths in the weights are drawn to: one normal distribution, regressions on 8 to 64 neighbours, or the better of them.
    weight_inv_depth : array (N,), units of |u| per frame
        Inverse depths for the weights, known from elsewhere, in any unit: a common factor is found. What is wrong with them costs variance, which the covariance tells, and causes no bias; where they have nothing to do with the flow's depths, `ml` is returned (`fell_back`). Points whose value is not finite are left out.
    rotation_prior : (rotation (3,) in rad/frame, covariance (3, 3))
        The rotation as known from elsewhere: from a gyroscope, or from the rest of the scene where the points lie on a thing that moves by itself. In a narrow field a rotation looks like a sideways translation, and this decides.
    initial : (translation (3,), rotation (3,) in rad/frame)
        Look for the minimum near this motion instead of everywhere.
    shared : float, no unit
        How many points share one error, as close points of a dense field do: `cov` (or `sigma` squared) is so many times their own, so that together they tell no more than they know. What is an outlier, and whether chance explains a rotation alone, is judged by their own. At least 1.
    correlation_length : float, px with K, else units of points; rad on the sphere
        How far errors of neighbours go together, as those of windowed flow do (a field tells its own): at the distance d and with this length l their correlation is taken to be `0.4 exp(-d^2 / 4 l^2) + 0.6 exp(-d / 3.75 l)`. It widens the covariance and leaves the motion alone. 0: errors are independent.
    seed : int
        Seed of the random choices.
    threads : int or None
        Number of threads; default: the environment variable JACOFLOW_THREADS, or every processor.

    Raises
    ------
    ValueError
        For shapes and values that do not fit; each message names the argument.
    """
    for name, value in (("projection", projection), ("method", method), ("placement", placement), ("smoother", smoother)):
        _word(name, value)
    layout = {"K": K, "sigma": _sigma(sigma), "cov": cov, "projection": projection, "six": jacobian is not None}
    options = {
        "method": method, "robust": _switch("robust", robust), "placement": placement, "smoother": smoother, "weight_inv_depth": weight_inv_depth,
        "rotation_prior": _pair("rotation_prior", rotation_prior), "initial": _pair("initial", initial), "shared": _besides(1, _number("shared", shared)), "correlation_length": _besides(0, _number("correlation_length", correlation_length)), "seed": _whole("seed", seed), "threads": None if threads is None else _count("threads", threads),
    }  # fmt: skip
    if jacobian is not None:
        flow = _six(flow, jacobian, sigma)
    return _estimate(_motion3d_estimate(points, flow, layout, options))


def _word(name: str, value: object) -> None:
    if not isinstance(value, str):
        raise TypeError(f"{name}: expected a word, got {value!r}")


def _pair(name: str, given: tuple[ArrayLike, ArrayLike] | None) -> tuple[ArrayLike, ArrayLike] | None:
    if given is None:
        return None
    try:
        parts = tuple(given)
    except TypeError:
        raise TypeError(f"{name}: expected two arrays, got {given!r}") from None
    if len(parts) != 2:
        raise ValueError(f"{name}: expected two arrays, got {len(parts)}")
    return parts[0], parts[1]


def _number(name: str, value: float) -> float:
    """A real number that is none of the things that Python turns into one."""
    if not isinstance(value, str | bytes | bool | np.bool_ | complex):
        try:
            return float(value)
        except (TypeError, ValueError, OverflowError):
            pass
    raise TypeError(f"{name}: expected a number, got {value!r}")


def _besides(usual: float, value: float) -> float | None:
    """None for the usual value, which needs nothing of the other options."""
    return None if value == usual else value


def _whole(name: str, value: int) -> int:
    if isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected an integer, got {value!r}")
    try:
        return operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected an integer, got {value!r}") from None


def _count(name: str, value: int) -> int:
    count = _whole(name, value)
    if not 1 <= count <= sys.maxsize:
        raise ValueError(f"{name}: expected a positive integer, got {count}")
    return count


def _switch(name: str, value: bool) -> bool:
    """True or False, and none of the things that only have a truth: any text is true."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected True or False, got {value!r}")
    return bool(value)


def _sigma(sigma: float | None) -> float | None:
    return None if sigma is None else _number("sigma", sigma)


def _six(flow: ArrayLike, jacobian: ArrayLike, sigma: float | None) -> Array:
    """(N, 6) numbers (u, v, u_x, v_x, u_y, v_y), px/frame and 1/frame."""
    if sigma is not None:
        raise ValueError("sigma: expected None with a jacobian, whose covariances (N, 6, 6) are needed, got a number")
    flow, slopes = _real("flow", flow), _real("jacobian", jacobian)
    if flow.ndim != 2 or flow.shape[1] != 2:
        raise ValueError(f"flow: expected shape (N, 2), got shape {flow.shape}")
    if slopes.shape != (len(flow), 2, 2):
        raise ValueError(f"jacobian: expected shape ({len(flow)}, 2, 2), got shape {slopes.shape}")
    return np.concatenate([flow, slopes.transpose(0, 2, 1).reshape(-1, 4)], axis=1)


def _real(name: str, given: ArrayLike) -> Array:
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise ValueError(f"{name}: expected rows of equal length, got {error}") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name}: expected real numbers, got {array.dtype}")
    return array.astype(float)


def _estimate(told: dict[str, Any]) -> MotionEstimate:
    surfaces = told.pop("surfaces")
    told["alternatives"] = tuple(MotionSolution(**other) for other in told["alternatives"])
    told["ml"] = MotionSolution(**told["ml"])
    return MotionEstimate(**told, surface_slopes=surfaces[:, 1:] if len(surfaces) else None)


def motion_bound(
    points: ArrayLike,
    translation: ArrayLike,
    rotation: ArrayLike,
    inv_depth: ArrayLike,
    K: ArrayLike | None = None,
    *,
    sigma: float | None = None,
    cov: ArrayLike | None = None,
    jacobian: bool = False,
    projection: Literal["plane", "sphere"] = "plane",
) -> MotionBound:
    """What flow at these points could tell about a motion: for the design of an experiment, before anything is measured.

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
    sigma : float, units of flow
        Standard deviation of each component of the flow.
    cov : array (N, 2, 2), (N, 3, 3) on the sphere, or (N, 6, 6) with `jacobian`
        Covariances instead of `sigma`, units of flow squared.
    jacobian : bool
        Whether six numbers would be measured a patch.
    projection : "plane" or "sphere"
        The screen.

    Raises
    ------
    ValueError
        For shapes and values that do not fit, or noise that is not told.
    NotObservableError
        When the points do not determine the motion.
    """
    _word("projection", projection)
    layout = {"K": K, "sigma": _sigma(sigma), "cov": cov, "projection": projection, "six": bool(jacobian)}
    return MotionBound(**_motion3d_bound(points, inv_depth, translation, rotation, layout))


def time_to_contact(result: MotionEstimate) -> Array:
    """Frames until each point (N,) reaches the camera's plane, `-1 / (nu u_z)`: positive when approaching, infinite when `u_z = 0`. On the sphere, where inverse depths are inverse ranges, times are to be multiplied by the bearings' z."""
    return result.time_to_contact


def time_to_contact_std(result: MotionEstimate) -> Array:
    """Standard deviations (N,) of `time_to_contact`, frames, to first order: of the smoothed depth (its posterior deviation given its neighbours; the point's own where nothing was smoothed) and of the motion."""
    return result.time_to_contact_std


def focus_of_expansion(result: MotionEstimate, K: ArrayLike | None = None) -> tuple[Array, Array] | None:
    """The point `K (u / u_z)` that the flow comes from or goes to: its place (2,), px with K, and its covariance (2, 2), px^2; None when `|u_z| < 1e-9`."""
    return _motion3d_focus(result.translation, result.tangent, result.covariance, K)


def predict_flow(
    points: ArrayLike,
    translation: ArrayLike,
    rotation: ArrayLike,
    inv_depth: ArrayLike,
    K: ArrayLike | None = None,
    *,
    projection: Literal["plane", "sphere"] = "plane",
    whole_frame: bool = False,
) -> Array:
    """Flow of points under a motion: (N, 2), px/frame with K, else per frame; on the sphere (N, 3).

    Instantaneous flow (1) where the points are, or (`whole_frame`) the exact displacement of points of the first view to the second as the motion is steady over the frame, `X_2 = exp([w]x) X_1 + V(w) u`: what a result of `estimate_motion` with placement "midpoint" says that the flow was.

    Parameters
    ----------
    points : array (N, 2), px with K, else on the plane at distance 1; (N, 3), unit bearings, on the sphere
        Where.
    translation, rotation : arrays (3,), the latter in rad/frame
        The motion. The translation need not have length 1: inverse depths are in units of its length.
    inv_depth : array (N,)
        Inverse depths; with `whole_frame` half way in time, as `estimate_motion` tells them.
    K : array (3, 3) or None
        Camera matrix, px.
    projection : "plane" or "sphere"
        The screen.
    whole_frame : bool
        Displacements over the whole frame, on the plane only; NaN where a point would be behind the camera.

    Raises
    ------
    ValueError
        For shapes and values that do not fit.
    """
    if projection not in ("plane", "sphere"):
        raise ValueError(f'projection: expected "plane" or "sphere", got {projection!r}')
    if whole_frame and projection == "sphere":
        raise ValueError("whole_frame: expected False on the sphere, whose flow is instantaneous; got True")
    return _motion3d_predict(points, inv_depth, translation, rotation, K, projection == "sphere", bool(whole_frame))


def essential_matrix(result: MotionEstimate | MotionSolution) -> Array:
    """The essential matrix `[t]x Rot` (3, 3), no unit, of the two views: `eta_2 @ E @ eta_1 = 0`, with `Rot = exp([w]x)` and `t = V(w) u`, as the motion is steady over the frame."""
    return _motion3d_two_views(result.translation, result.rotation)[0]


def estimate_field_motion(
    field: FlowField,
    K: ArrayLike,
    *,
    spacing: float | None = None,
    max_points: int | None = None,
    region: Sequence[int] | None = None,
    scene: MotionEstimate | None = None,
    turning: float = 1e-3,
    **options: Any,
) -> tuple[MotionEstimate, Array]:
    """The rigid motion of the scene in a flow field, from its own covariances, and the points (N, 2), px, that it was estimated from.

    Parameters
    ----------
    field : FlowField
        One field (not a stack) with a covariance, in px/frame.
    K : array (3, 3)
        Camera matrix, px.
    spacing : px or None
        Least distance of the points along rows and columns; default: twice the field's `correlation_length`, but at least 8 px, and closer where a `region` would have fewer than 30 points. Never below the `correlation_length`. Points closer than 4 correlation lengths `l`, which share windows, get larger covariances: times `4 pi l^2 / spacing^2`. Errors go together farther still; the motion's covariance sums that (`correlation_length` of `estimate_motion`).
    max_points : int or None
        Most points, of the `region` if there is one; the grid is made coarser to keep to it.
    region : (x, y, width, height), px, or None
        Only points in this rectangle: those of one thing, whose motion relative to the camera is then found.
    scene : MotionEstimate or None
        The motion of the whole scene. Its rotation, which is the camera's, is then what is known beforehand of the thing's in `region`: in a narrow field a rotation looks like a sideways motion, and with a slanted surface that trades against the approach.
    turning : float, rad/frame
        Standard deviation of the thing's own rotation, per axis; it matters only with `scene`.
    **options
        Those of `estimate_motion`; `robust` is True unless told otherwise.

    Raises
    ------
    ValueError
        For a stack, a field without a covariance or with a `pixel_pitch`, for a `scene` whose rotation is not known, for no `K`, and for options that do not fit.
    """
    if K is None:
        raise ValueError("K: expected a camera matrix (3, 3), px, for a field's points are pixels; got None")
    points, flow, covariances, (_, shared, length) = _motion3d_field_points(field, None if spacing is None else _number("spacing", spacing), None if max_points is None else _count("max_points", max_points), region)
    if scene is not None:
        options["rotation_prior"] = _turned(scene, turning)
    return estimate_motion(points, flow, K, cov=covariances, **{"robust": True, "shared": shared, "correlation_length": length, **options}), points


def time_to_contact_map(
    field: FlowField, result: MotionEstimate, K: ArrayLike, *, placement: Literal["midpoint", "start"] = "midpoint"
) -> tuple[Array, Array, Array]:
    """Frames to contact at every pixel of a flow field, (H, W), their standard deviations, frames, and residuals, in units of noise.

    Each pixel has the time of whatever it shows, `-1 / (nu u_z)` with the inverse depth of its own flow: positive when approaching, infinite where the motion has no translation, NaN where the field is not valid. Times count from half way between the frames with
    "midpoint". The deviations are those of the pixel's own flow and of the motion; errors of neighbours go together over the field's `correlation_length`. A residual beyond 3 tells of something that moves by itself, whose time to contact is another one: see `region` of `estimate_field_motion`.

    Parameters
    ----------
    field : FlowField
        One field (not a stack) with a covariance, in px/frame.
    result : MotionEstimate
        The motion of its scene, from `estimate_field_motion`.
    K : array (3, 3)
        Camera matrix, px.
    placement : "midpoint" or "start"
        As in `estimate_motion`.

    Raises
    ------
    ValueError
        For a stack, a field without a covariance or with a `pixel_pitch`, and for a matrix that is none of a camera.
    """
    _word("placement", placement)
    return _motion3d_contact_map(field, K, (result.translation, result.rotation, result.tangent, result.covariance), placement)


def _turned(scene: MotionEstimate, turning: float) -> tuple[Array, Array]:
    """What the scene's rotation says about that of a thing in it."""
    if not _number("turning", turning) > 0:
        raise ValueError(f"turning: expected a positive number, got {turning!r}")
    spread = scene.covariance[2:, 2:] + turning**2 * np.eye(3)
    if not np.isfinite(spread).all():
        raise ValueError(f"scene: expected a motion whose rotation is known, got one with the status {scene.status!r}")
    return scene.rotation, spread
