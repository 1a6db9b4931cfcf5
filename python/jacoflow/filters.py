"""Kalman filters that know nothing of images: linear, extended and unscented, over a batch of independent states.

Names follow filterpy: `x`, `P`, `Q`, `R`, `predict`, `update`. With `batch=B` every array has a leading axis (B, ...), and one call of a vectorised
callback serves every state and every sigma point. Units are those of the state and the measurement.

>>> import numpy as np
>>> from jacoflow.filters import KalmanFilter
>>> f = KalmanFilter(2, 1)
>>> f.F = [[1, 1], [0, 1]]
>>> f.H = [[1, 0]]
>>> for z in (1.0, 2.0, 3.0):
...     f.predict()
...     f.update(z)
>>> f.x.shape
(2,)
"""

from ._jacoflow import (
    ExtendedKalmanFilter,
    GaussianFilter,
    KalmanFilter,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
)

__all__ = [
    "ExtendedKalmanFilter",
    "GaussianFilter",
    "KalmanFilter",
    "MerweScaledSigmaPoints",
    "UnscentedKalmanFilter",
]
