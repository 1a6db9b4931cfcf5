"""A translation along the image plane without a rotation: section 5 of the paper, one unknown angle in closed
forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._brief import Brief
from .._jacoflow import _motion3d_lateral, _motion3d_lateral_bound
from ._checks import number, word

__all__ = ["LateralBound", "LateralEstimate", "estimate_lateral", "lateral_bound"]


@dataclass(frozen=True, eq=False, repr=False)
class LateralEstimate(Brief):
    """The direction of a translation along the image plane, an angle in rad, with its variance and the
    inverse depths (N,)."""

    angle: float
    """Angle `psi` of `u = (cos psi, sin psi, 0)`, rad, of the scene relative to the camera; by the sign of
    the depths, most of which are positive."""
    variance: float
    """Variance of `angle`, rad^2: (29), (31) or that of shrunk weights, with the moments of the depths less
    their noise; infinite where noise explains all of the flow."""
    crlb: float
    """The Cramér-Rao bound `sigma^2 / (n m2)` with the same moments, rad^2."""
    noise_std: float
    """Standard deviation of each component of the flow, units of flow: as given, else estimated."""
    inv_depth: NDArray[np.float64]
    """Inverse depths (N,), units of |u| per frame: the flow along the direction, each with the deviation
    `noise_std`. NaN where the flow is not finite."""

    @property
    def translation(self) -> NDArray[np.float64]:
        """Unit direction `u` (3,), no unit."""
        return np.array([np.cos(self.angle), np.sin(self.angle), 0.0])

    @property
    def angle_std(self) -> float:
        """Standard deviation of `angle` (which is in rad), degrees."""
        return float(np.degrees(np.sqrt(self.variance)))


@dataclass(frozen=True, repr=False)
class LateralBound(Brief):
    """Variances of the angle of a translation along the image plane, rad^2, for known depths."""

    crlb: float
    """The Cramér-Rao bound `sigma^2 / (n m2)`, rad^2, with `m2 = mean(nu^2)`."""
    ml_variance: float
    """Maximum likelihood, rad^2: `sigma^2 / (n m2) + sigma^4 / (n m2^2)` (29)."""
    ones_variance: float
    """Weights of 1, rad^2: `sigma^2 / (n mean(nu)^2)` (31); infinite where depths cancel."""
    shrunk_variance: float
    """Shrunk weights, rad^2: `sigma^2 / (n [mean^2 + var^2 / (var + sigma^2)])`, below both."""
    crossover: float
    """Noise, units of flow, above which weights of 1 beat maximum likelihood: `sqrt(m2) std(nu) /
    |mean(nu)|`."""


def estimate_lateral(flow: ArrayLike, *, noise_std: float | None = None, weights: Literal["shrunk", "ml", "ones"] = "shrunk") -> LateralEstimate:
    """The direction of a translation along the image plane (`u_z = 0`) of a camera that does not turn, from
    flow at N points, wherever they are.

    Source: section 5 of T. Endoh, T. Toriu, N. Tagawa, "The Maximum Likelihood Estimator is Not 'Optimal' on
    3-D Motion Estimation from Noisy Optical Flow". The variances are of first order: they hold while they are
    small beside 1 rad^2.

    Parameters
    ----------
    flow : array (N, 2), per frame on the plane at distance 1, or px/frame of a camera with square pixels
        Flow; rows that are not finite are left out.
    noise_std : float, units of flow
        Standard deviation of each component. None: estimated from the flow across the direction.
    weights : "shrunk", "ml" or "ones"
        "ml": each point's own depth, maximum likelihood (28), the principal axis of `sum f f^t`. "ones": the
        same for all (30), `atan2(sum f_y, sum f_x)`, better in large noise. "shrunk": depths drawn to their
        mean by what noise leaves of their scatter, never worse than either.

    Raises
    ------
    ValueError
        For shapes and values that do not fit; each message names the argument.
    NotObservableError
        When all flow is zero, or with "ones" its sum.

    >>> round(float(np.degrees(estimate_lateral([[0.9, 0.9], [1.1, 1.1]], noise_std=0.01).angle)))
    45
    """
    word("weights", weights)
    return LateralEstimate(**_motion3d_lateral(flow, None if noise_std is None else number("noise_std", noise_std), weights))


def lateral_bound(inv_depth: ArrayLike, *, noise_std: float) -> LateralBound:
    """What any estimator, and each of those of `estimate_lateral`, makes of points with these true inverse
    depths: variances in rad^2, for the design of an experiment.

    Parameters
    ----------
    inv_depth : array (N,), units of |u| per frame
        True inverse depths; values that are not finite are left out.
    noise_std : float, units of flow
        Standard deviation of each component of the flow.

    Raises
    ------
    ValueError
        For shapes and values that do not fit; each message names the argument.
    NotObservableError
        When all points are infinitely far.

    >>> round(lateral_bound(np.linspace(0.5, 1.5, 101), noise_std=0.3).crossover, 5)
    0.30369
    """
    return LateralBound(**_motion3d_lateral_bound(inv_depth, number("noise_std", noise_std)))
