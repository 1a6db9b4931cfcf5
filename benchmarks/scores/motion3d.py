"""Errors of 3-D motion: angles, squared Mahalanobis distances, and when an estimate with status `ok` is
wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jacoflow import motion3d

Array = NDArray[np.float64]
FAR_OFF, DEVIATIONS = 15.0, 4.0
"""An `ok` is wrong beyond both: degrees, and standard deviations."""
ELLIPSE = 5.991
"""95 % of chi squared with two degrees of freedom."""
ELLIPSOID = 11.070
"""95 % of chi squared with five degrees of freedom."""


def angle(a: Array, b: Array) -> float:
    """Angle between two directions, degrees."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b))))


def rms(values: Sequence[float]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def squared(delta: Array, covariance: Array) -> float:
    """Squared Mahalanobis distance."""
    return float(delta @ np.linalg.solve(covariance, delta))


def far_off(found: motion3d.MotionEstimate, u: Array) -> bool:
    """Whether a direction said to be `ok` is beyond both limits."""
    return angle(found.translation, u) > max(FAR_OFF, DEVIATIONS * found.direction_std)
