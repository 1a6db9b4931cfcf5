"""How well a window of brightness determines an affine motion, given the noise of the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
TERMS = (4.0, -6.0, 4.0, -1.0)
"""A window K of fourth order is `1 - (1 - K)^4 = 4 K - 6 K^2 + 4 K^3 - K^4`."""
ROUNDING = 1.0 / 12.0
"""Variance of rounding to whole grey levels."""
TRUNCATION = 4.0
"""Where the Gaussian window ends, standard deviations."""
STEPS = 5
"""Windows that bounds are computed for where windows vary."""
WINDOWS = (3.0, 4.5, 6.5, 9.0, 12.5, 18.0, 27.0)
"""Windows to choose from, px."""


def moments(plane: Array, weights: Array, offsets: Array, power: int, axis: int) -> Array:
    """`sum_d weight(d) d^power plane(p + d)` at every pixel p along one axis; nothing lies beyond the
    edge."""
    from scipy.ndimage import correlate1d

    return correlate1d(plane, weights * offsets**power, axis=axis, mode="constant")


def normal_matrix(gradient: Array, weights: Array, offsets: Array) -> Array:
    """`N = sum_d w(d) a a^T` (H, W, 6, 6) of the rows `a = (g_x, g_y, g_x dx, g_y dx, g_x dy, g_y dy)` at `p
    + d`.

    Unknowns in the order (u, v, u_x, v_x, u_y, v_y) of the window's middle.
    """
    products = {(i, j): gradient[..., i] * gradient[..., j] for i in (0, 1) for j in (0, 1)}
    powers = [(0, 0), (1, 0), (0, 1)]
    along_x: dict[tuple[int, ...], Array] = {}
    known: dict[tuple[int, ...], Array] = {}
    matrix = np.empty((*gradient.shape[:2], 6, 6))
    for i in range(6):
        for j in range(6):
            (ix, iy), (jx, jy) = powers[i // 2], powers[j // 2]
            key = (min(i % 2, j % 2), max(i % 2, j % 2), ix + jx, iy + jy)
            if key[:3] not in along_x:
                along_x[key[:3]] = moments(products[key[0], key[1]], weights, offsets, key[2], 1)
            if key not in known:
                known[key] = moments(along_x[key[:3]], weights, offsets, key[3], 0)
            matrix[..., i, j] = known[key]
    return matrix


def covariance(gradient: Array, window: float, noise: float, frames: int = 2) -> Array:
    """The least-squares noise bound: covariance (H, W, 6, 6) of (u, v, u_x, v_x, u_y, v_y), px/frame and
    1/frame squared, from a Gaussian window.

    In the window about a pixel each pixel p + d gives one equation of an affine motion (brightness constancy,
    the first row of the system), `g . (u + u_x dx + u_y dy, v + v_x dx + v_y dy) = -(difference of the
    frames) + e`, with the exact gradient g of the texture (`gradient`, (H, W, 2), grey levels/px) and an
    error e that is the frames' noise alone: variance `2 s^2` for the difference of a pair, `s^2 / 2` for half
    the difference of the outer frames of a triple, where `s^2 = noise^2 + 1/12` counts the rounding. Weighted
    with `w = exp(-|d|^2 / (2 window^2))`, least squares has the covariance `N^-1 (sum w^2 a a^T) N^-1
    var(e)`, `N = sum w a a^T`: what remains when texture, motion model and window are perfect and only noise
    is left. Gradients that must be taken from noisy frames, bent flow within the window and interpolation all
    come on top.
    """
    radius = int(np.ceil(TRUNCATION * window))
    offsets = np.arange(-radius, radius + 1, dtype=float)
    weights = np.exp(-0.5 * (offsets / window) ** 2)
    inverse = np.linalg.inv(normal_matrix(gradient, weights, offsets))
    variance = (noise**2 + ROUNDING) * (2.0 if frames == 2 else 0.5)
    return variance * inverse @ normal_matrix(gradient, weights**2, offsets) @ inverse


def plain_window(slopes: bool) -> float:
    """Width of the plain Gaussian window that is as noisy as one of fourth order, over that one's; for the
    flow, or for its `slopes`.

    White noise of unit density leaves `integral H^2 w dw / (2 pi)` in the flow and `integral H^2 w^3 dw / (4
    pi)` in a slope, `H = sum_n c_n exp(-n s^2 w^2 / 2)`: `sum_nm c_n c_m 2 / (n + m)` and `sum_nm c_n c_m 4 /
    (n + m)^2` times what a plain window leaves, which goes with `s^-2` and `s^-4`.
    """
    orders = np.arange(1, len(TERMS) + 1)
    pairs = 2.0 / np.add.outer(orders, orders)
    more = float(np.array(TERMS) @ (pairs**2 if slopes else pairs) @ np.array(TERMS))
    return more ** (-0.25 if slopes else -0.5)


def jacobian_bound(
    gradient: Array, window: float | Array, noise: float, where: NDArray[np.bool_], frames: int = 2
) -> float:
    """Root mean square over `where` and the four derivatives of the deviations of :func:`covariance`,
    1/frame; `window` may be an array (H, W), px.

    For an array, variances at its pixels lie on straight lines, in logarithms, between those of `STEPS`
    windows.
    """
    if np.ndim(window) == 0:
        return float(np.sqrt(slope_variance(gradient, float(window), noise, frames)[where].mean()))
    logs = np.log(np.broadcast_to(window, where.shape))
    nodes = np.linspace(logs[where].min(), logs[where].max() + 1e-9, STEPS)
    known = np.stack([np.log(slope_variance(gradient, float(np.exp(node)), noise, frames)) for node in nodes])
    at = np.clip((logs - nodes[0]) / (nodes[1] - nodes[0]), 0.0, STEPS - 1.0)
    low = np.minimum(at.astype(int), STEPS - 2)
    rows, columns = np.indices(where.shape)
    variance = np.exp(known[low, rows, columns] * (1 + low - at) + known[low + 1, rows, columns] * (at - low))
    return float(np.sqrt(variance[where].mean()))


def slope_variance(gradient: Array, window: float, noise: float, frames: int) -> Array:
    """Mean over the four derivatives of the variances of :func:`covariance`, (H, W), 1/frame^2."""
    return np.diagonal(covariance(gradient, window, noise, frames), axis1=-2, axis2=-1)[..., 2:].mean(axis=-1)


def efficient_end_point_error(
    gradient: Array, truth: Array, noise: float, where: NDArray[np.bool_], frames: int = 2
) -> float:
    """Mean end-point error, px, of least squares in the best single window of fourth order, chosen with the
    truth.

    In each of the `WINDOWS` the true flow loses what the window smooths away, and has an error of the
    covariance that :func:`covariance` tells of a plain window as noisy: gradients are exact, frames are
    aligned without error. No estimate that is as smooth everywhere, and no smoother than its data, does much
    better.
    """
    from scipy.ndimage import gaussian_filter

    draw = np.random.default_rng(0).standard_normal((*truth.shape[:2], 2))
    errors = []
    for window in WINDOWS:
        once = [
            gaussian_filter(truth, (np.sqrt(n) * window, np.sqrt(n) * window, 0), mode="nearest")
            for n in range(1, len(TERMS) + 1)
        ]
        lost = sum(term * part for term, part in zip(TERMS, once, strict=True)) - truth
        spread = np.linalg.cholesky(
            covariance(gradient, window * plain_window(slopes=False), noise, frames)[..., :2, :2]
        )
        errors.append(
            np.linalg.norm(lost + np.einsum("...ij,...j->...i", spread, draw), axis=-1)[where].mean()
        )
    return float(min(errors))
