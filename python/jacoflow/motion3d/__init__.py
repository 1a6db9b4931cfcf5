"""Rigid 3-D motion from noisy optical flow, with an honest covariance and the bound that no estimator can
beat.

One translation direction `u` (`|u| = 1`), one rotation rate `w` and an inverse depth `nu` for every point
explain the flow: `f = nu G u + R w`. `u` and `w` are the motion of the scene relative to the camera, `X' = u
+ w x X` (the camera itself moves by `-u`); camera axes are x right, y down, z forward; inverse depths are in
units of `|u|` per frame. Source: T. Endoh, T. Toriu, N. Tagawa, "The Maximum Likelihood Estimator is Not
'Optimal' on 3-D Motion Estimation from Noisy Optical Flow" (equation numbers below), and smoothed weights
beyond it.

>>> import numpy as np
>>> from jacoflow import motion3d
>>> rng = np.random.default_rng(1)
>>> points, depths = rng.uniform(-0.6, 0.6, (300, 2)), rng.uniform(0.5, 1.5, 300)
>>> u, w = np.array([0.6, 0.2, 0.75]), np.array([0.02, -0.03, 0.01])
>>> flow = motion3d.predict_flow(points, u, w, depths) + rng.normal(0, 0.005, (300, 2))
>>> found = motion3d.estimate_motion(points, flow, noise_std=0.005, placement="start")
>>> found.status, float(np.degrees(np.arccos(found.translation @ u / np.linalg.norm(u)))) < 1
('ok', True)
"""

from ._bound import MotionBound, motion_bound
from ._estimate import estimate_motion
from ._field import estimate_field_motion, time_to_contact_map
from ._results import MotionEstimate, MotionSolution, SystematicEffect, focus_of_expansion, time_to_contact, time_to_contact_std
from ._lateral import LateralBound, LateralEstimate, estimate_lateral, lateral_bound
from ._two_views import essential_matrix, predict_flow

__all__ = [
    "MotionBound",
    "MotionEstimate",
    "MotionSolution",
    "SystematicEffect",
    "LateralBound",
    "LateralEstimate",
    "essential_matrix",
    "estimate_field_motion",
    "estimate_motion",
    "estimate_lateral",
    "focus_of_expansion",
    "motion_bound",
    "predict_flow",
    "lateral_bound",
    "time_to_contact",
    "time_to_contact_map",
    "time_to_contact_std",
]
