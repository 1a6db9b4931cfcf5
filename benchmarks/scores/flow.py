"""Errors of flow and Jacobian, and where they are counted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
