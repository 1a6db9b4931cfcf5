"""A texture moved by any affine step, by quintic splines."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

Array = NDArray[np.float64]
SIZE = 160
"""Side of the frames, px."""
CENTRE = (SIZE / 2, SIZE / 2)
"""The point (x, y) about which frames are turned and enlarged, px."""


def texture(seed: int) -> Array:
    """Smoothed noise in 20 to 220 grey levels, twice as large as a frame."""
    noise = gaussian_filter(np.random.default_rng(seed).standard_normal((2 * SIZE, 2 * SIZE)), 1.5)
    return np.asarray(20 + 200 * (noise - noise.min()) / np.ptp(noise))


def coarse(seed: int) -> Array:
    """Noise smoothed by 2 px and noise smoothed by 16, standard deviation 40 grey levels about 128, twice as
    large as a frame: most of it is coarse."""
    rng = np.random.default_rng(seed)
    parts = [gaussian_filter(rng.standard_normal((2 * SIZE, 2 * SIZE)), sigma) for sigma in (2.0, 16.0)]
    total = sum(part / part.std() for part in parts)
    return np.asarray(128 + 40 * total / np.std(total))


def waves(seed: int) -> Array:
    """A sum of 60 waves of 5 to 30 px in random directions about 128, standard deviation 25 grey levels,
    twice as large as a frame: texture without fine detail."""
    rng, (y, x) = np.random.default_rng(seed), np.mgrid[: 2 * SIZE, : 2 * SIZE]
    directions = rng.normal(size=(60, 2))
    lengths = np.exp(rng.uniform(np.log(5), np.log(30), (60, 1)))
    directions *= 2 * np.pi / lengths / np.linalg.norm(directions, axis=1, keepdims=True)
    total = np.zeros(x.shape)
    for a, b in directions:
        total += np.sin(a * x + b * y + rng.uniform(0, 2 * np.pi))
    return np.asarray(128 + 25 * total / total.std())


def moved(picture: Array, matrix: ArrayLike, shift: tuple[float, float] = (0.0, 0.0)) -> Array:
    """The middle of `picture` after the points at p go to M (p - c) + c + shift."""
    y, x = np.mgrid[:SIZE, :SIZE].astype(float)
    dx, dy = x - CENTRE[0] - shift[0], y - CENTRE[1] - shift[1]
    back = np.linalg.inv(np.asarray(matrix, dtype=float))
    at_x, at_y = back[0, 0] * dx + back[0, 1] * dy + CENTRE[0], back[1, 0] * dx + back[1, 1] * dy + CENTRE[1]
    return np.asarray(map_coordinates(picture, [at_y + SIZE / 2, at_x + SIZE / 2], order=5, mode="reflect"))


def turn(angle: float) -> Array:
    """The matrix of a turn from x towards y, rad."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def flow(matrix: ArrayLike, shift: tuple[float, float] = (0.0, 0.0)) -> Array:
    """The step's flow at every pixel, (H, W, 2), px."""
    y, x = np.mgrid[:SIZE, :SIZE].astype(float)
    places = np.stack([x - CENTRE[0], y - CENTRE[1]], axis=-1)
    return np.asarray(places @ (np.asarray(matrix) - np.eye(2)).T + np.array(shift))
