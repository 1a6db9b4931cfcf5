"""How well a window of brightness can tell an affine motion at all, given the camera's noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
ROUNDING = 1.0 / 12.0
"""Variance of rounding to whole grey levels."""
TRUNCATION = 4.0
"""Where the Gaussian window ends, standard deviations."""


def moments(plane: Array, weights: Array, offsets: Array, power_x: int, power_y: int) -> Array:
    """`sum_d weight(dx) weight(dy) dx^power_x dy^power_y plane(p + d)` at every pixel p; nothing lies beyond the edge."""
    from scipy.ndimage import correlate1d

    along_x = correlate1d(plane, weights * offsets**power_x, axis=1, mode="constant")
    return correlate1d(along_x, weights * offsets**power_y, axis=0, mode="constant")


def normal_matrix(gradient: Array, weights: Array, offsets: Array) -> Array:
    """`N = sum_d w(d) a a^T` (H, W, 6, 6) of the rows `a = (g_x, g_y, g_x dx, g_y dx, g_x dy, g_y dy)` at `p + d`.

    Unknowns in the order (u, v, u_x, v_x, u_y, v_y) of the window's middle.
    """
    products = {(i, j): gradient[..., i] * gradient[..., j] for i in (0, 1) for j in (0, 1)}
    powers = [(0, 0), (1, 0), (0, 1)]
    known: dict[tuple[int, ...], Array] = {}
    matrix = np.empty((*gradient.shape[:2], 6, 6))
    for i in range(6):
        for j in range(6):
            (ix, iy), (jx, jy) = powers[i // 2], powers[j // 2]
            key = (min(i % 2, j % 2), max(i % 2, j % 2), ix + jx, iy + jy)
            if key not in known:
                known[key] = moments(products[key[0], key[1]], weights, offsets, key[2], key[3])
            matrix[..., i, j] = known[key]
    return matrix


def covariance(gradient: Array, window: float, noise: float, frames: int = 2) -> Array:
    """The least-squares noise bound: covariance (H, W, 6, 6) of (u, v, u_x, v_x, u_y, v_y), px/frame and 1/frame squared, from a Gaussian window.

    In the window about a pixel each pixel p + d gives one equation of an affine motion (brightness constancy, the first row of the system),
    `g . (u + u_x dx + u_y dy, v + v_x dx + v_y dy) = -(difference of the frames) + e`, with the exact gradient g of the texture (`gradient`, (H, W, 2), grey
    levels/px) and an error e that is the frames' noise alone: variance `2 s^2` for the difference of a pair, `s^2 / 2` for half the difference of the
    outer frames of a triple, where `s^2 = noise^2 + 1/12` counts the rounding. Weighted with `w = exp(-|d|^2 / (2 window^2))`, least squares has the covariance
    `N^-1 (sum w^2 a a^T) N^-1 var(e)`, `N = sum w a a^T`: what remains when texture, motion model and window are perfect and only noise is left.
    Gradients that must be taken from noisy frames, bent flow within the window and interpolation all come on top.
    """
    radius = int(np.ceil(TRUNCATION * window))
    offsets = np.arange(-radius, radius + 1, dtype=float)
    weights = np.exp(-0.5 * (offsets / window) ** 2)
    inverse = np.linalg.inv(normal_matrix(gradient, weights, offsets))
    variance = (noise**2 + ROUNDING) * (2.0 if frames == 2 else 0.5)
    return variance * inverse @ normal_matrix(gradient, weights**2, offsets) @ inverse


def jacobian_bound(gradient: Array, window: float, noise: float, where: NDArray[np.bool_], frames: int = 2) -> float:
    """Root mean square over `where` and the four derivatives of the deviations of :func:`covariance`, 1/frame."""
    variances = np.diagonal(covariance(gradient, window, noise, frames), axis1=-2, axis2=-1)[..., 2:]
    return float(np.sqrt(variances[where].mean()))
