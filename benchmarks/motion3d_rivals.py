"""OpenCV's essential matrices and the two linear methods, on the same flow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import motion3d_scenes as scenes

try:
    import cv2
except ImportError:
    cv2 = None

Array = NDArray[np.float64]
METHODS = {"5-point RANSAC": "RANSAC", "USAC_MAGSAC": "USAC_MAGSAC", "USAC_ACCURATE": "USAC_ACCURATE"}
"""OpenCV's names of its robust estimators of an essential matrix."""


def two_view(points: Array, flow: Array, camera: Array, sigma: float, method: str) -> tuple[Array, Array]:
    """(translation direction, rotation matrix) of `findEssentialMat` and `recoverPose`; threshold 2 sigma px. NaN where it finds none."""
    first, second = np.ascontiguousarray(points), np.ascontiguousarray(points + flow)
    cv2.setRNGSeed(0)
    essential, mask = cv2.findEssentialMat(first, second, camera, method=getattr(cv2, method), prob=0.999, threshold=2 * sigma)
    if essential is None or essential.shape != (3, 3):
        return np.full(3, np.nan), np.full((3, 3), np.nan)
    _, turn, direction, _, _ = cv2.recoverPose(essential, first, second, camera, distanceThresh=1e7, mask=mask)
    return direction.ravel(), turn


def _best(value: Callable[[Array], float], start: Array) -> Array:
    """Smallest eigenvector's sign by the depths: the more points before the camera."""
    return start if value(start) >= value(-start) else -start


def _before(points: Array, flow: Array, turn: Array) -> Callable[[Array], float]:
    g, r = scenes.rows(points)
    return lambda u: float((((g @ u) * (flow - r @ turn)).sum(1) > 0).mean())


def _rotation(points: Array, flow: Array, u: Array) -> Array:
    """Least squares for w across the epipolar lines of u."""
    g, r = scenes.rows(points)
    t = g @ u
    p = np.stack([t[:, 1], -t[:, 0]], 1) / np.maximum(np.linalg.norm(t, axis=1, keepdims=True), 1e-12)
    return np.linalg.lstsq(np.einsum("ni,nij->nj", p, r), (p * flow).sum(1), rcond=None)[0]


def linear(points: Array, flow: Array) -> Array:
    """Direction by the differential epipolar constraint, linear in nine numbers: the eight-point method of flow.

    `eta . (u x xi') + eta^t S eta = 0` with xi' = (flow, 0), S symmetric: least squares on the unit sphere of (u, S).
    """
    eta = np.column_stack([points, np.ones(len(points))])
    speed = np.column_stack([flow, np.zeros(len(points))])
    x, y, z = eta.T
    rows = np.column_stack([np.cross(speed, eta), x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z])
    u = np.linalg.svd(rows, full_matrices=False)[2][-1, :3]
    u = u / max(np.linalg.norm(u), 1e-300)
    return _best(_before(points, flow, _rotation(points, flow, u)), u)


def unbiased(points: Array, flow: Array, sigma: float, rounds: int = 10) -> Array:
    """The same with weights `1 / |G u|^2` and the noise's share taken out of the matrix: a ratio of sums, iterated."""
    eta = np.column_stack([points, np.ones(len(points))])
    speed = np.column_stack([flow, np.zeros(len(points))])
    x, y, z = eta.T
    rows = np.column_stack([np.cross(speed, eta), x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z])
    g, _ = scenes.rows(points)
    # cross(noise, eta) = (n_y, -n_x, n_x y - n_y x): its products have the expectation sigma^2 G^t G.
    shares = np.einsum("nij,nik->njk", g, g)
    u = linear(points, flow)
    for _ in range(rounds):
        weights = 1 / np.maximum(((g @ u) ** 2).sum(1), 1e-6)
        moments = (weights[:, None] * rows).T @ rows
        noise = np.zeros((9, 9))
        noise[:3, :3] = np.einsum("n,njk->jk", weights, shares) * sigma**2
        # The quadratic part has no noise: eliminate it, then the generalised eigenproblem of u alone.
        inner = moments[:3, :3] - moments[:3, 3:] @ np.linalg.pinv(moments[3:, 3:]) @ moments[3:, :3]
        values, vectors = np.linalg.eig(np.linalg.solve(noise[:3, :3], inner))
        following = np.real(vectors[:, np.argmin(np.abs(np.real(values) - 1) if sigma > 0 else np.abs(values))])
        u = following / np.linalg.norm(following)
    return _best(_before(points, flow, _rotation(points, flow, u)), u)
