"""Random scenes with exact truth for 3-D motion: the layouts, depths and motions of the published tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

W0 = np.array([0.02, -0.03, 0.01])
ZERO = np.zeros(3)
MOTIONS = {
    "lateral": (np.array([1.0, 0.0, 0.0]), ZERO),
    "oblique": (np.array([0.6, 0.2, 0.75]), W0),
    "forward": (np.array([0.05, -0.03, 1.0]), W0),
    "off": (np.array([0.35, 0.25, 1.0]), W0),
}
"""Direction and rotation rate, rad/frame."""

K = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
"""The camera of the scenes in pixels."""


def motion(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Unit direction and rotation rate."""
    u, w = MOTIONS[name]
    return u / np.linalg.norm(u), w


def depths(scene: str, shape: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Inverse depths at places in [-1, 1]^2, in units of the translation."""
    x, y = shape.T
    if scene == "uniform":
        return rng.uniform(0.5, 1.5, len(x))
    if scene == "two":
        return np.where(rng.uniform(size=len(x)) < 0.7, 0.4, 1.6)
    if scene == "smooth":
        return 1 + 0.35 * np.sin(2 * x + 1) * np.cos(1.5 * y) + 0.15 * y
    if scene == "layers":
        return np.where(x**2 + (y - 0.2) ** 2 < 0.35, 1.5, 0.6)
    if scene == "ground":
        return 0.3 + 1.2 * np.maximum(y, 0)
    raise ValueError(scene)


def rows(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G (N, 2, 3) and R (N, 2, 3) on the plane at distance 1."""
    x, y = points.T
    one, none = np.ones_like(x), np.zeros_like(x)
    g = np.stack([np.stack([one, none, -x], -1), np.stack([none, one, -y], -1)], 1)
    r = np.stack([np.stack([-x * y, 1 + x * x, -y], -1), np.stack([-(1 + y * y), x * y, x], -1)], 1)
    return g, r


@dataclass(frozen=True)
class Scene:
    """Points on the plane at distance 1 (or bearings) with noisy flow, and the truth."""

    points: np.ndarray
    flow: np.ndarray
    depths: np.ndarray
    u: np.ndarray
    w: np.ndarray
    noise_std: float
    K: np.ndarray | None = None
    inliers: np.ndarray | None = None
    projection: str = "plane"


def differential(scene: str, name: str, n: int, noise_std: float, seed: int, h: float = 0.6) -> Scene:
    """Instantaneous flow of points uniform in [-h, h]^2."""
    rng = np.random.default_rng(seed)
    u, w = motion(name)
    shape = rng.uniform(-1, 1, (n, 2))
    nu = depths(scene, shape, rng)
    g, r = rows(h * shape)
    flow = nu[:, None] * (g @ u) + r @ w + noise_std * rng.normal(size=(n, 2))
    return Scene(h * shape, flow, nu, u, w, noise_std)


def sphere(name: str, n: int, noise_std: float, seed: int) -> Scene:
    """Bearings all around with uniform inverse ranges."""
    rng = np.random.default_rng(seed)
    u, w = motion(name)
    eta = rng.normal(size=(n, 3))
    eta /= np.linalg.norm(eta, axis=1, keepdims=True)
    nu = rng.uniform(0.5, 1.5, n)
    flow = np.cross(eta, nu[:, None] * np.cross(u, eta) + np.cross(np.cross(w, eta), eta))
    noise = noise_std * rng.normal(size=(n, 3))
    flow += noise - (noise * eta).sum(1, keepdims=True) * eta
    return Scene(eta, flow, nu, u, w, noise_std, projection="sphere")


def exponential(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """exp([w]x) and V(w), by their series."""
    cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    term, turn, mean = np.eye(3), np.eye(3), np.eye(3)
    for k in range(1, 30):
        term = term @ cross / k
        turn = turn + term
        mean = mean + term / (k + 1)
    return turn, mean


def displaced(pixels: np.ndarray, nu: np.ndarray, u: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Where pixels are after one frame of a steady rigid motion, exactly."""
    turn, mean = exponential(w)
    eta = np.concatenate([pixels, np.ones((len(pixels), 1))], 1) @ np.linalg.inv(K).T
    after = eta @ turn.T + nu[:, None] * (mean @ u)
    after = after @ K.T
    return after[:, :2] / after[:, 2:]


def two_views(
    scene: str,
    name: str,
    noise_std: float,
    median: float,
    seed: int,
    *,
    n: int = 1000,
    outliers: float = 0.0,
    mover: float = 0.0,
) -> Scene:
    """Exact two-view motion in a 640 x 480 picture, f = 500 px; `median`: median translational flow, px;
    `noise_std` px of noise."""
    rng = np.random.default_rng(seed)
    u, w = motion(name)
    w = w / 2
    pixels = rng.uniform([0, 0], [640, 480], (n, 2))
    shape = (pixels - [320, 240]) / [320, 240]
    nu = depths(scene, shape, rng)
    g, _ = rows((pixels - [320, 240]) / 500)
    nu = nu * median / np.median(500 * np.linalg.norm(nu[:, None] * (g @ u), axis=1))
    flow = displaced(pixels, nu, u, w) - pixels
    inliers = np.ones(n, bool)
    if mover:
        # The square around (200, 260) that holds this share of the points.
        distance = np.abs(pixels - [200, 260]).max(1)
        inliers = distance > np.quantile(distance, mover)
        direction = np.array([-0.8, 0.1, 0.3])
        other = (
            displaced(pixels, 1.5 * nu, direction / np.linalg.norm(direction), np.array([0, 0.01, 0.02]))
            - pixels
        )
        flow = np.where(inliers[:, None], flow, other)
    flow = flow + noise_std * rng.normal(size=(n, 2))
    if outliers:
        inliers = np.arange(n) >= round(outliers * n)
        reach = 4 * np.median(np.linalg.norm(flow, axis=1))
        flow = np.where(inliers[:, None], flow, rng.uniform(-reach, reach, (n, 2)))
    return Scene(pixels, flow, nu, u, w, noise_std, K, inliers)


def patches(
    name: str, n: int, radius: float, noise_std: float, seed: int, h: float, noise: int | None = None
) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Affine flow of patches with half size `radius` px (f = 500, flow of 3 px at the mean depth): scene in
    px, Jacobians (N, 2, 2), covariances (N, 6, 6).

    `noise`: a seed of its own for the noise, to draw it again on the same layout.
    """
    rng = np.random.default_rng(seed)
    u, w = motion(name)
    points = rng.uniform(-h, h, (n, 2))
    # Mean flow 3 px at |G u| = 1.
    nu = rng.uniform(0.5, 1.5, n) * 3 / 500
    slants = 0.8 * nu[:, None] * rng.normal(size=(n, 2))
    g, r = rows(points)
    x, y = points.T
    t = g @ u
    one = np.ones(n)
    flow = nu[:, None] * t + r @ w
    along_x = (
        slants[:, :1] * t
        - nu[:, None] * u[2] * [1, 0]
        + np.stack([-y * w[0] + 2 * x * w[1], y * w[1] + one * w[2]], -1)
    )
    along_y = (
        slants[:, 1:] * t
        - nu[:, None] * u[2] * [0, 1]
        + np.stack([-x * w[0] - one * w[2], -2 * y * w[0] + x * w[1]], -1)
    )
    slope = np.sqrt(3) * noise_std / radius
    rng = rng if noise is None else np.random.default_rng((seed, noise))
    jacobian = np.stack([along_x, along_y], -1) + slope * rng.normal(size=(n, 2, 2))
    flow = 500 * flow + noise_std * rng.normal(size=(n, 2))
    covariance = np.broadcast_to(np.diag([noise_std**2] * 2 + [slope**2] * 4), (n, 6, 6))
    scene = Scene(500 * points + [320, 240], flow, np.column_stack([nu, slants]), u, w, noise_std, K)
    return scene, jacobian, covariance
