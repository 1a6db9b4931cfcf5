"""OpenCV's essential matrices and the two linear methods, on the same flow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import motion3d as scenes

try:
    import cv2
except ImportError:
    cv2 = None

Array = NDArray[np.float64]
METHODS = {"5-point RANSAC": "RANSAC", "USAC_MAGSAC": "USAC_MAGSAC", "USAC_ACCURATE": "USAC_ACCURATE"}
"""OpenCV's names of its robust estimators of an essential matrix."""


def two_view(points: Array, flow: Array, camera: Array, noise_std: float, method: str) -> tuple[Array, Array]:
    """(translation direction, rotation matrix) of `findEssentialMat` and `recoverPose`; threshold 2 sigma
    px. NaN where it finds none."""
    first, second = np.ascontiguousarray(points), np.ascontiguousarray(points + flow)
    cv2.setRNGSeed(0)
    essential, mask = cv2.findEssentialMat(
        first, second, camera, method=getattr(cv2, method), prob=0.999, threshold=2 * noise_std
    )
    if essential is None or essential.shape != (3, 3):
        return np.full(3, np.nan), np.full((3, 3), np.nan)
    _, turn, direction, _, _ = cv2.recoverPose(
        essential, first, second, camera, distanceThresh=1e7, mask=mask
    )
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


def _constraint(points: Array, flow: Array) -> tuple[Array, Array]:
    """Rows of the differential epipolar constraint `u . (xi' x eta) + eta^t S eta = 0` with xi' = (flow,
    0): those of u (N, 3) and those of the symmetric S (N, 6)."""
    eta = np.column_stack([points, np.ones(len(points))])
    speed = np.column_stack([flow, np.zeros(len(points))])
    x, y, z = eta.T
    return np.cross(speed, eta), np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z])


def _without(rows: Array, others: Array) -> Array:
    """What is left of the columns of `rows` across those of `others`."""
    basis = np.linalg.qr(others)[0]
    return rows - basis @ (basis.T @ rows)


def linear(points: Array, flow: Array) -> Array:
    """Direction by linear subspaces (A. Jepson, D. Heeger 1991): combinations of the constraints in which
    no quadratic part is left are linear in u alone."""
    rows, quadratic = _constraint(points, flow)
    u = np.linalg.svd(_without(rows, quadratic), full_matrices=False)[2][-1]
    return _best(_before(points, flow, _rotation(points, flow, u)), u)


def unbiased(points: Array, flow: Array, rounds: int = 10) -> Array:
    """The same with weights `1 / |G u|^2` and a ratio of sums, in which the noise takes no side: the least
    generalised eigenvalue, iterated. With noisy flow the iteration does not settle: its errors depend on
    the number of rounds."""
    rows, quadratic = _constraint(points, flow)
    g, _ = scenes.rows(points)
    # cross(noise, eta) = (n_y, -n_x, n_x y - n_y x): its products have the expectation sigma^2 G^t G; the
    # quadratic part has no noise.
    shares = np.einsum("nij,nik->njk", g, g)
    u = linear(points, flow)
    for _ in range(rounds):
        weights = 1 / np.maximum(((g @ u) ** 2).sum(1), 1e-6)
        root = np.sqrt(weights)[:, None]
        inner = _without(root * rows, root * quadratic)
        values, vectors = np.linalg.eig(
            np.linalg.solve(np.einsum("n,njk->jk", weights, shares), inner.T @ inner)
        )
        following = np.real(vectors[:, np.argmin(np.real(values))])
        u = following / np.linalg.norm(following)
    return _best(_before(points, flow, _rotation(points, flow, u)), u)
