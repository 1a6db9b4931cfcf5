"""Filters that know nothing of images: linear, extended and unscented Kalman filters and a particle filter,
over a batch of states.

Names follow filterpy: `x`, `P`, `Q`, `R`, `predict`, `update`. With `batch=B` every array has a leading axis
(B, ...), and one call of a vectorised callback serves every state and every sigma point. Units are those of
the state and the measurement.

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

A whole sequence, with a measurement missing, and what its future says about its past:

>>> means, covariances, _, _ = f.batch_filter([4.0, None, 6.0])
>>> smoothed, narrowed, _, _ = f.rts_smoother(means, covariances)
>>> bool(narrowed[1, 0, 0] < covariances[1, 0, 0])
True

Angles have differences of their own, for every filter `residual_x`, `residual_z` and `state_add`, for sigma
points `x_mean` and `z_mean`:

>>> f.residual_z = lambda a, b: (a - b + np.pi) % (2 * np.pi) - np.pi

A particle filter takes any transition and any likelihood:

>>> from jacoflow.filters import ParticleFilter
>>> p = ParticleFilter(1, 1000, random_state=1)
>>> p.sample_gaussian([0.0], 4.0)
>>> for z in (1.0, 1.2, 1.1):
...     p.predict(Q=0.1)
...     p.update(lambda x: -0.5 * (x[:, 0] - z) ** 2 / 0.2)
...     _ = p.resample("systematic", threshold=0.5)
>>> bool(abs(p.mean[0] - 1.1) < 0.1)
True
"""

from ._jacoflow import (
    ExtendedKalmanFilter,
    GaussianFilter,
    KalmanFilter,
    MerweScaledSigmaPoints,
    ParticleFilter,
    UnscentedKalmanFilter,
    resample,
)

__all__ = [
    "ExtendedKalmanFilter",
    "GaussianFilter",
    "KalmanFilter",
    "MerweScaledSigmaPoints",
    "ParticleFilter",
    "UnscentedKalmanFilter",
    "resample",
]
