"""Optical flow together with its Jacobian and the uncertainty of both.

Frames are arrays (H, W), indexed [row, column] = [y, x]; x right, y down. Flow (u, v) is in px/frame along
(x, y); the Jacobian is [[u_x, u_y], [v_x, v_y]] in 1/frame.

>>> import jacoflow
>>> frames = jacoflow.scenes.Scene("affine", width=96, height=64).frames(3)
>>> field = jacoflow.estimate(frames)
>>> field.shape
(3, 64, 96)
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from . import filters, io, motion3d, plot, scenes, segment, stereo, track, video
from ._jacoflow import (
    FlowEstimator,
    FlowField,
    FlowFilter,
    FormatError,
    JacoflowError,
    Measurement,
    MissingDependencyError,
    NotObservableError,
    NumericalError,
    __version__,
    corners,
    estimate,
    flow,
    luminance,
    point_flow,
    quantise,
    quantities,
    smooth,
)
from ._observability import Condition, Observability, ObservabilityMap, classify, observability
from ._options import (
    CoarseToFine,
    FilterProfile,
    HornSchunck,
    Instantaneous,
    LucasKanade,
    Preprocess,
    Recursive,
    SamplingGrid,
    Windowed,
)
from .status import Status

__all__ = [
    "CoarseToFine",
    "Condition",
    "FilterProfile",
    "FlowEstimator",
    "FlowField",
    "FlowFilter",
    "FormatError",
    "HornSchunck",
    "Instantaneous",
    "JacoflowError",
    "LucasKanade",
    "Measurement",
    "MissingDependencyError",
    "NotObservableError",
    "NumericalError",
    "Observability",
    "ObservabilityMap",
    "Preprocess",
    "Recursive",
    "SamplingGrid",
    "Status",
    "Windowed",
    "__version__",
    "classify",
    "corners",
    "estimate",
    "filters",
    "flow",
    "io",
    "luminance",
    "mixture",
    "motion3d",
    "observability",
    "plot",
    "point_flow",
    "quantise",
    "quantities",
    "scenes",
    "segment",
    "smooth",
    "stereo",
    "track",
    "video",
]

if _TYPE_CHECKING:
    from . import mixture


def __getattr__(name: str) -> _Any:
    """`jacoflow.mixture`, imported on first use, because importing scikit-learn takes long."""
    if name == "mixture":
        return _import_module("jacoflow.mixture")
    raise AttributeError(f"module 'jacoflow' has no attribute {name!r}")
