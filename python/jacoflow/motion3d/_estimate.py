"""The motion that explains flow at points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from numpy.typing import ArrayLike

from .._checks import switch
from .._jacoflow import _motion3d_estimate
from ._checks import layout, number, optional, pair, whole, word
from ._results import MotionEstimate, estimate_of

OPTIONS: dict[str, tuple[object, Callable[[str, Any], Any]]] = {
    "method": ("auto", word),
    "robust": (False, switch),
    "placement": ("midpoint", word),
    "smoother": ("auto", word),
    "weight_inv_depth": (None, lambda name, value: value),
    "rotation_prior": (None, pair),
    "initial": (None, pair),
    "points_per_independent_sample": (None, number),
    "correlation_length": (None, number),
    "flow_scale_std": (None, number),
    "flow_bias_std": (None, number),
    "random_state": (0, whole),
    "threads": (None, optional(whole)),
}
"""Options of an estimate: what is meant where they are not given, and the check of their kind."""


def options_of(given: dict[str, Any]) -> dict[str, Any]:
    """The options as the compiled module takes them."""
    return {name: check(name, given[name]) if name in given else default for name, (default, check) in OPTIONS.items()}


def estimate_motion(
    points: ArrayLike,
    flow: ArrayLike,
    K: ArrayLike | None = None,
    *,
    noise_std: float | None = None,
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
    points_per_independent_sample: float = 1.0,
    correlation_length: float = 0.0,
    flow_scale_std: float = 0.0,
    flow_bias_std: float = 0.0,
    random_state: int = 0,
    threads: int | None = None,
) -> MotionEstimate:
    """The rigid motion that explains flow at N points, with covariance, depths and status.

    Maximum likelihood over all directions (3), (4), then the estimating equation (19) whose weights have
    smoothed depths. Degenerate scenes are reported in `status`, not as errors. Everything is computed in
    double precision; the result does not depend on the number of threads.

    Parameters
    ----------
    points : array (N, 2), px, or (N, 3), unit bearings
        Where: with K in px, without on the plane at distance 1, within 10; (N, 3) on the sphere. Rows that
        are not finite are left out.
    flow : array (N, 2), px/frame with K, else per frame; (N, 3) on the sphere
        Displacement over one frame.
    K : array (3, 3) or None
        Camera matrix, px; skew and unequal focal lengths are used.
    noise_std : float, units of flow
        Standard deviation of each component. None, and no `cov`: estimated from the residuals.
    cov : array (N, 2, 2), units of flow squared; (N, 3, 3) on the sphere; (N, 6, 6) with `jacobian`
        Covariance of each point's flow, in the order (u, v, u_x, v_x, u_y, v_y). A point with a variance
        below a millionth of the lower quartile of all has that quartile added, as no measurement is so much
        better than the others.
    jacobian : array (N, 2, 2), 1/frame
        [[u_x, u_y], [v_x, v_y]] at the points: six numbers a patch, which pays for few (2 to 10), large
        patches (windows of 30 px and more) that do not overlap. Needs `cov`.
    projection : "plane" or "sphere"
        The screen.
    method : "auto", "ml" or "efficient"
        "auto": "efficient" from 30 points (5 patches) on, else "ml".
    robust : bool
        Find the inliers of one motion among up to 60 % outliers. Where residuals of inliers look like those
        of an object with another motion (residuals of neighbours have one sign, or those of a part of the
        picture pull another way) and two motions explain them better, the status is "ambiguous"; that is not
        tested with `points_per_independent_sample` or `correlation_length`, as errors that go together look
        like that everywhere. Noise of these points that is larger than given widens the covariance. Without
        `noise_std` or `cov` and below 100 points, outliers are believed in only if they explain more than
        larger noise would; where that is not sure the status is "few_points". A mover whose border is not
        determined makes it "ambiguous".
    placement : "midpoint" or "start"
        What flow is. "midpoint": a displacement over one frame of a steady motion, from `points` to `points +
        flow`; its rotation is taken out of both ends, half from each, so that `translation` and `rotation`
        are exact however fast the camera turns (`X_2 = exp([w]x) X_1 + V(w) u`; noise-free views are
        recovered to rounding), and inverse depths are those half way in time. Where that is negligible beside
        the noise the displacement is placed half way, exact to second order. "start": instantaneous flow at
        `points`. Bearings and their flow are taken as given.
    smoother : "auto", "prior" or "neighbours"
        What depths in the weights are drawn to: one normal distribution, regressions on 8 to 64 neighbours,
        or the better of them.
    weight_inv_depth : array (N,), units of |u| per frame
        Inverse depths for the weights, known from elsewhere, in any unit: a common factor is found, which is
        positive as the depths are. What is wrong with them costs variance, which the covariance holds, and
        causes no bias; where they have nothing to do with the flow's depths, `ml` is returned (`fell_back`).
        Points whose value is not finite are left out.
    rotation_prior : (rotation (3,) in rad/frame, covariance (3, 3))
        The rotation as known from elsewhere: from a gyroscope, or from the rest of the scene where the points
        lie on an object that moves by itself. In a narrow field a rotation looks like a sideways translation,
        and this decides. Where the flow contradicts it by more than chance, the status is "ambiguous", the
        motion of the flow alone is among the `alternatives`, and the covariance reaches as far; of a rotation
        alone the status stays "rotation_only", with both.
    initial : (translation (3,), rotation (3,) in rad/frame)
        Look for the minimum near this motion instead of everywhere.
    points_per_independent_sample : float, no unit
        Number of given points per statistically independent one, as in a dense field: `cov` (or `noise_std`
        squared) is so many times their own, so that together they count once. What is an outlier, and whether
        chance explains a rotation alone, is judged by their own. At least 1.
    correlation_length : float, px with K, else units of points; rad on the sphere
        How far errors of neighbours go together, as those of windowed flow do (a field has its own): at the
        distance d and with this length l their correlation is taken to be `0.4 exp(-d^2 / 4 l^2) + 0.6 exp(-d
        / 3.75 l)`. It widens the covariance and leaves the motion alone. Where residuals of neighbours are
        more alike than that, `l` is taken to be longer, up to four times, and where they are larger than the
        noise of a point, as much larger. 0: errors are independent.
    flow_scale_std : float, no unit, from 0 to 1
        Standard deviation of a factor, about 1, that all flow has in common, as flow from gradients is too
        short or too long by a share (estimated from a field). No residual shows it; it widens the covariance
        of the rotation along itself.
    flow_bias_std : float, units of flow
        Standard deviation of each component of a displacement that all flow has in common (estimated from a
        field). Most of it looks like a rotation, and no residual shows it; it widens the covariance along
        what it would make of the motion. Not on the sphere.
    random_state : int
        Seed of the random choices.
    threads : int or None
        Number of threads; default: the environment variable JACOFLOW_THREADS, or every processor.

    Raises
    ------
    ValueError
        For shapes and values that do not fit; each message names the argument.
    """
    options = options_of(
        {
            "method": method,
            "robust": robust,
            "placement": placement,
            "smoother": smoother,
            "weight_inv_depth": weight_inv_depth,
            "rotation_prior": rotation_prior,
            "initial": initial,
            "points_per_independent_sample": points_per_independent_sample,
            "correlation_length": correlation_length,
            "flow_scale_std": flow_scale_std,
            "flow_bias_std": flow_bias_std,
            "random_state": random_state,
            "threads": threads,
        }
    )
    return estimate_of(_motion3d_estimate(points, flow, jacobian, layout(K, noise_std, cov, projection), options))
