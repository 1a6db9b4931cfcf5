"""OpenCV's flows, and their Jacobians after the smoothing that suits them best."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks.scores.flow import differences

try:
    import cv2
except ImportError:
    cv2 = None

Array = NDArray[np.floating]
Picture = NDArray[np.uint8]
SIGMAS = range(1, 9)
"""Gaussians that a flow without a Jacobian may be smoothed with before it is differentiated, px."""
WINDOWS = (5, 7, 9, 11, 13, 17, 21, 25, 31, 37, 45, 53, 63, 75, 89, 105)
"""Savitzky-Golay windows that may be chosen, px."""
ORDERS = (1, 2, 3, 4)
"""Orders of their polynomials."""


def farneback(first: Picture, second: Picture) -> Array:
    """Farneback's flow with the settings usual in examples: half size a level, 5 levels, window 15, 3
    iterations, neighbourhood 5, sigma 1.1."""
    return cv2.calcOpticalFlowFarneback(first, second, None, 0.5, 5, 15, 3, 5, 1.1, 0).astype(float)


def dis(first: Picture, second: Picture) -> Array:
    """Dense inverse search, preset medium."""
    return (
        cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(first, second, None).astype(float)
    )


RIVALS: dict[str, Callable[[Picture, Picture], Array]] = {
    "OpenCV DIS medium": dis,
    "OpenCV Farneback": farneback,
}


def gaussian_fits(flow: Array) -> Iterator[tuple[dict[str, object], Array, Array]]:
    """The flow smoothed by each Gaussian, and its derivative: setting, flow (H, W, 2), Jacobian (H, W, 2,
    2)."""
    for sigma in SIGMAS:
        smooth = cv2.GaussianBlur(flow, (0, 0), sigma)
        yield {"sigma": sigma}, smooth, differences(smooth)


def savitzky_golay_fits(flow: Array) -> Iterator[tuple[dict[str, object], Array, Array]]:
    """Polynomials fitted to each window of the flow (along rows, then columns): setting, flow and Jacobian
    in the middle of the window."""
    from scipy.signal import savgol_filter

    def fit(window: int, order: int, along_x: int, along_y: int) -> Array:
        rows = savgol_filter(flow, window, order, deriv=along_x, axis=1)
        return savgol_filter(rows, window, order, deriv=along_y, axis=0)

    for window in WINDOWS:
        for order in ORDERS:
            if order < window:
                jacobian = np.stack([fit(window, order, 1, 0), fit(window, order, 0, 1)], axis=-1)
                yield {"window": window, "order": order}, fit(window, order, 0, 0), jacobian


def best(
    fits: Iterator[tuple[dict[str, object], Array, Array]], error: Callable[[Array, Array], float]
) -> tuple[dict[str, object], Array, Array]:
    """The fit with the least `error(flow, jacobian)`: chosen with the truth, which a user does not have."""
    return min(fits, key=lambda each: error(each[1], each[2]))
