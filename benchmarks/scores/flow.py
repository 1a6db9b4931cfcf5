"""Errors of flow and Jacobian, and where they are counted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

import jacoflow

Array = NDArray[np.floating]
Mask = NDArray[np.bool_]
BORDER = 12
"""Left out of the Jacobian's error along each side, px."""
AROUND_UNKNOWN = 4
"""Left out of the Jacobian's error around pixels whose true Jacobian is unknown, px."""
EDGE = 0.3
"""A motion boundary: some entry of the true Jacobian is as large as this, 1/frame."""


def differences(flow: Array) -> Array:
    """Jacobian (H, W, 2, 2) of a flow by central differences; NaN wherever one of the pixels it needs is."""
    along_y, along_x = np.gradient(flow, axis=(0, 1))
    return np.stack([along_x, along_y], axis=-1)


def widened(mask: Mask, reach: int) -> Mask:
    """The mask and everything within `reach` px of it along rows and columns (a square)."""
    for axis in (0, 1):
        sides = [(0, 0), (0, 0)]
        sides[axis] = (reach, reach)
        padded = np.pad(mask, sides)
        mask = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=axis).any(axis=-1)
    return mask


def inside(shape: tuple[int, ...], margin: int) -> Mask:
    """Everything but a margin along each side."""
    mask = np.zeros(shape, bool)
    mask[margin:-margin, margin:-margin] = True
    return mask


def usable(truth: Array) -> Mask:
    """Where the Jacobian is compared: 12 px from the frame's edge, 4 px from where the true Jacobian is
    unknown, and off motion boundaries."""
    jacobian = differences(truth)
    unknown = ~np.isfinite(jacobian).all(axis=(-2, -1))
    edge = np.abs(np.where(unknown[..., None, None], 0.0, jacobian)).max(axis=(-2, -1)) >= EDGE
    return inside(unknown.shape, BORDER) & ~widened(unknown, AROUND_UNKNOWN) & ~edge


def root_mean_square(values: Array) -> float:
    """`sqrt(mean(values^2))`."""
    return float(np.sqrt(np.mean(np.square(values))))


def end_point_error(flow: Array, truth: Array, where: Mask | None = None) -> tuple[float, float]:
    """Mean length of `flow - truth`, px, and the share of the pixels with a truth that have a flow; over
    `where` if given."""
    known = np.isfinite(truth).all(axis=-1)
    if where is not None:
        known &= where
    have = known & np.isfinite(flow).all(axis=-1)
    return float(np.linalg.norm(flow - truth, axis=-1)[have].mean()), float(have.sum() / known.sum())


def jacobian_error(jacobian: Array, truth: Array, where: Mask) -> float:
    """Root-mean-square error over the four entries of Jacobians (H, W, 2, 2), 1/frame, where there is one."""
    have = where & np.isfinite(jacobian).all(axis=(-2, -1))
    return root_mean_square((jacobian - truth)[have])


FROM_BOUNDARY = 10
"""Distance from motion boundaries, px, beyond which intervals are counted as interior."""
TRUTH_SIGMA = 4.0
"""Of the Gaussian that takes the noise of a recording's truth out before its Jacobian, px."""
LARGE_ERROR = 1.0
"""px; it is silent where the stated standard deviation is below a fifth of it and the status is OK."""
NORMAL = 1.959964
"""Half the width of a 95 % interval, standard deviations."""


def interior(truth: Array) -> Mask:
    """Pixels with a truth, 16 px from the frame's edge and more than 10 px from motion boundaries."""
    jacobian = differences(truth)
    edge = np.abs(np.nan_to_num(jacobian)).max(axis=(-2, -1)) >= EDGE
    known = np.isfinite(truth).all(axis=-1)
    return known & inside(known.shape, 16) & (distance_transform_edt(~edge) > FROM_BOUNDARY)


def intervals(field: jacoflow.FlowField, truth: Array, truth_std: float = 0.0) -> dict[str, float]:
    """Shares of 95 % intervals that hold: u, v and Jacobian (truth smoothed) in the interior, flow at all
    pixels with a truth; mean squared normalised error of (u, v), 1 if the covariance is right; share of large
    errors that are silent, and of pixels with large errors. `truth_std`, px, is the noise of the truth, which
    is part of the errors."""
    where, known = interior(truth), np.isfinite(truth).all(axis=-1)
    error, std = field.flow - truth, np.stack([field.std("u"), field.std("v")], axis=-1)
    of_error = field.covariance[where][:, :2, :2] + truth_std**2 * np.eye(2)
    share = np.where(known, 1.0, 0.0)
    smooth = [gaussian_filter(np.nan_to_num(truth[..., c]), TRUTH_SIGMA) for c in (0, 1)]
    slopes = differences(np.stack(smooth, axis=-1) / np.maximum(gaussian_filter(share, TRUTH_SIGMA), 1e-9)[..., None])
    holds = [
        np.abs(field.value(name) - slopes[..., row, column]) <= NORMAL * field.std(name)
        for name, row, column in (("u_x", 0, 0), ("u_y", 0, 1), ("v_x", 1, 0), ("v_y", 1, 1))
    ]
    held = np.abs(error) <= NORMAL * np.hypot(std, truth_std)
    squares = np.einsum("...i,...ij,...j", error[where], np.linalg.inv(of_error), error[where])
    length = np.linalg.norm(error, axis=-1)
    large = known & (length > LARGE_ERROR)
    silent = large & (np.hypot(*np.moveaxis(std, -1, 0)) < length / 5) & (field.status == jacoflow.Status.OK)
    return {
        "u": float(held[where][:, 0].mean()),
        "v": float(held[where][:, 1].mean()),
        "jacobian": float(np.mean([hold[where].mean() for hold in holds])),
        "nees": float(squares.mean() / 2),
        "all": float(held[known].mean()),
        "silent": float(silent.sum() / max(large.sum(), 1)),
        "large": float(large.sum() / max(known.sum(), 1)),
    }
