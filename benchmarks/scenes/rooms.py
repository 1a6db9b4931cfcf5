"""Rendered rooms with exact truth: six textured walls seen from inside, in any pose, by a camera that
moves between two frames."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

SIZE = (240, 320)
"""Height and width, px."""
K = np.array([[300.0, 0, 160], [0, 300, 120], [0, 0, 1]])
TEXELS = 110.0
"""Texels in a unit of length: about 300 / 110 px each at the distance 1."""
WALL = 800
"""Side of a wall's texture, texels."""
WALLS = tuple((axis, sign) for axis in range(3) for sign in (-1, 1))


@dataclass(frozen=True)
class Room:
    """A room about the camera of the first frame, and how it moves to the second: `X_2 = rotation X_1 +
    shift`."""

    pose: Array
    extent: Array
    """Half its sides."""
    walls: list[Array]
    """Coefficients of cubic splines, one for each wall."""
    u: Array
    w: Array
    rotation: Array
    shift: Array

    def _hits(self, rays: Array, centre: Array) -> tuple[Array, Array]:
        """How far along each ray (N, 3) from `centre` the wall is, and which."""
        axes = np.array([sign * self.pose[axis] / self.extent[axis] for axis, sign in WALLS])
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (1 - axes @ centre) / (rays @ axes.T)
        along = np.where(along > 0, along, np.inf)
        return along.min(axis=1), along.argmin(axis=1)

    def picture(self, second: bool) -> Array:
        """What the camera sees, without noise."""
        rotation, shift = (self.rotation, self.shift) if second else (np.eye(3), np.zeros(3))
        rays, centre = _pixel_rays() @ rotation, -rotation.T @ shift
        along, wall = self._hits(rays, centre)
        places = (centre + along[:, None] * rays) @ self.pose.T * TEXELS + WALL / 2
        shade = np.empty(len(places))
        for k, (axis, _) in enumerate(WALLS):
            seen = wall == k
            shade[seen] = map_coordinates(
                self.walls[k],
                np.delete(places[seen], axis, axis=1).T,
                order=3,
                prefilter=False,
                mode="mirror",
            )
        return shade.reshape(SIZE)

    def flow(self, points: Array) -> Array:
        """The true displacements of pixels (N, 2) of the first frame."""
        rays = _rays(points)
        along, _ = self._hits(rays, np.zeros(3))
        seen = (along[:, None] * rays @ self.rotation.T + self.shift) @ K.T
        return np.asarray(seen[:, :2] / seen[:, 2:] - points)


def _pixels() -> Array:
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    return np.stack([x, y], axis=-1).reshape(-1, 2).astype(float)


@cache
def _pixel_rays() -> Array:
    return _rays(_pixels())


def _rays(points: Array) -> Array:
    return np.column_stack([points, np.ones(len(points))]) @ np.linalg.inv(K).T


def _wall(rng: np.random.Generator) -> Array:
    """A texture of 1.5 to 3 texels that covers most grey levels."""
    grey = gaussian_filter(rng.normal(size=(WALL, WALL)), rng.uniform(1.5, 3))
    return np.asarray(spline_filter(128 + 40 * (grey - grey.mean()) / grey.std(), order=3, mode="mirror"))


@lru_cache(maxsize=1)
def _at_rest(seed: int) -> tuple[list[Array], Array, Array, Array, Array, float]:
    """Walls, pose, half sides, direction of the camera, the axis that it turns about and by which share of
    the most: walls take long, and several motions in a row are seen in one room."""
    rng = np.random.default_rng((seed, 31))
    walls = [_wall(rng) for _ in WALLS]
    pose = Rotation.from_rotvec(0.4 * rng.normal(size=3)).as_matrix()
    u, axis = (vector / np.linalg.norm(vector) for vector in rng.normal(size=(2, 3)))
    share = rng.random()
    return walls, pose, rng.uniform(1.2, 3, 3), u, axis, share


def room(seed: int, step: float = 0.02, turn: float = 0.006) -> Room:
    """A room of chance, half sides 1.2 to 3; the camera moves by `step` in any direction and turns by up
    to `turn` rad."""
    walls, pose, extent, u, axis, share = _at_rest(seed)
    w = axis * (turn * share)
    # The steady motion over the frame: its shift is the mean of those that the rotation turns on.
    steps = Rotation.from_rotvec((np.arange(64)[:, None] + 0.5) / 64 * w).as_matrix()
    return Room(pose, extent, walls, u, w, Rotation.from_rotvec(w).as_matrix(), step * steps.mean(axis=0) @ u)


def frames(made: Room, noise: float, seed: int) -> list[NDArray[np.uint8]]:
    """Both frames with noise of so many grey levels, in eight bits."""
    rng = np.random.default_rng((seed, 32))
    noisy = (made.picture(second) + rng.normal(0, noise, SIZE) for second in (False, True))
    return [np.clip(picture.round(), 0, 255).astype(np.uint8) for picture in noisy]
