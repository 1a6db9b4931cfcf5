"""Optical flow together with its Jacobian, and how far each number can be trusted.

Frames are arrays (H, W), indexed [row, column] = [y, x]; x right, y down. Flow (u, v) is in px/frame along (x, y); the Jacobian
is [[u_x, u_y], [v_x, v_y]] in 1/frame.
"""

from . import filters, scenes
from ._jacoflow import (
    FlowField,
    FormatError,
    JacoflowError,
    MissingDependencyError,
    NotObservableError,
    NumericalError,
    __version__,
)
from .status import Status

__all__ = [
    "FlowField",
    "FormatError",
    "JacoflowError",
    "MissingDependencyError",
    "NotObservableError",
    "NumericalError",
    "Status",
    "__version__",
    "filters",
    "scenes",
]
