"""Synthetic stereo sequences of moving layers: exact label, disparity, visibility and motion of every pixel.

A scene is a stack of flat, bulging or sloping layers, far to near, each with a texture of its own (cells of
one grey level, a little rough) that moves and approaches with it. The right view is rendered by itself, a few
rows lower and a little brighter; noise of 2 grey levels is added to both. Disparity is `x_left - x_right` in
px; it is negative far away because the cameras converge, and -44 px at infinity.

- `crossing()`: a panning wall, three people crossing before it, two of them side by side; one is nearly
  hidden.
- `curved()`: a large ellipsoidal cab with 14 px of relief that drives and approaches, and a small person.
- `cart()`: a cart that recedes between rows of seats.
- `passing()`: two people cross in opposite directions, one hides the other for a step or so.
- `pillar()`: a person walks behind a pillar for six steps.
- `tiny()`: three boxes of 20 to 32 px before a panning wall.
- `small()`: two boxes before a panning wall, 320 x 240, disparity -20..12, for tests.
- `fence()`: a person behind a fence whose pales repeat every 22 px, so that wrong matches look right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import cKDTree

Array = NDArray[np.floating]

AT_INFINITY = -44.0
"""Disparity of a point at infinity, px."""
ROUGHNESS = 6.0
"""Standard deviation of the roughness of a cell, grey levels."""
SOFT_EDGE = 1.4
"""Width over which a layer's border fades, px."""
RIM = 4.0
"""Beyond its half width and height an outline fades within so many px, up to five times as long as wide."""
PALE_DISTANCE = 22.0
"""Distance of a fence's pales, px."""
GAIN, BIAS = 1.02, 2.0
"""The right camera beside the left."""


def texture(rng: np.random.Generator, height: int, width: int, cell: float) -> Array:
    """(height, width), cells about `cell` px wide of random grey levels 40 to 215, with roughness."""
    count = max(6, int(height * width / cell**2))
    seeds = rng.uniform((0, 0), (height, width), (count, 2))
    rows, columns = np.mgrid[:height, :width]
    nearest = (
        cKDTree(seeds).query(np.stack([rows.ravel(), columns.ravel()], axis=1))[1].reshape(height, width)
    )
    levels = rng.uniform(40, 215, count)[nearest]
    # A Gaussian of 1.5 px leaves 0.188 of the standard deviation of white noise.
    return gaussian_filter(
        levels + ROUGHNESS * gaussian_filter(rng.normal(0, 1, (height, width)), 1.5) / 0.188, 0.8
    )


def _box(x: Array, y: Array, half_width: float, half_height: float) -> Array:
    return np.minimum(half_width - abs(x), half_height - abs(y))


def _ellipse(x: Array, y: Array, half_width: float, half_height: float) -> Array:
    return (1 - np.hypot(x / half_width, y / half_height)) * min(half_width, half_height)


def _person(x: Array, y: Array, half_width: float, half_height: float) -> Array:
    """Head, body and two legs; the width follows from the height."""
    h = half_height
    head, body = _ellipse(x, y + 0.8 * h, 0.15 * h, 0.2 * h), _ellipse(x, y + 0.2 * h, 0.28 * h, 0.48 * h)
    legs = [_box(x + side * h, y - 0.55 * h, 0.11 * h, 0.45 * h) for side in (0.14, -0.14)]
    return np.maximum.reduce([head, body, *legs])


def _pales(x: Array, y: Array, half_width: float, half_height: float) -> Array:
    """Upright pales of a third of their distance, and two rails."""
    pales = PALE_DISTANCE / 6 - abs((x + PALE_DISTANCE / 2) % PALE_DISTANCE - PALE_DISTANCE / 2)
    rails = 4 - abs(abs(y) - 0.6 * half_height)
    return np.minimum(np.maximum(pales, rails), _box(x, y, half_width, half_height))


def _everywhere(x: Array, y: Array, half_width: float, half_height: float) -> Array:
    return np.full(np.broadcast_shapes(x.shape, y.shape), 99.0)


OUTLINES: dict[str, Callable[[Array, Array, float, float], Array]] = {
    "box": _box,
    "ellipse": _ellipse,
    "person": _person,
    "pales": _pales,
    "all": _everywhere,
}
"""How far inside an outline a place is, px (negative: outside)."""


@dataclass(frozen=True)
class Pose:
    """Where a layer is at one step."""

    x: float
    y: float
    scale: float
    disparity: float


@dataclass(frozen=True)
class Layer:
    """One surface and how it moves."""

    outline: str
    label: int
    position: tuple[float, float]
    """Of its centre at the first step, px."""
    velocity: tuple[float, float]
    """px a step."""
    disparity: float
    """Of its centre at the first step, px."""
    approach: float = 0.0
    """Growth of the disparity, px a step."""
    half: tuple[float, float] = (1.0, 1.0)
    """Half its width and height, px."""
    cell: float = 24.0
    """Width of the texture's cells, px."""
    relief: float = 0.0
    """How far its middle bulges towards the camera, px of disparity."""
    floor: float = 0.0
    """How much nearer the lower edge of the picture is than its middle, px of disparity."""

    def pose(self, t: float) -> Pose:
        """At step `t`; what comes nearer grows."""
        disparity = self.disparity + self.approach * t
        scale = (disparity - AT_INFINITY) / (self.disparity - AT_INFINITY)
        return Pose(
            self.position[0] + self.velocity[0] * t, self.position[1] + self.velocity[1] * t, scale, disparity
        )

    def disparity_at(self, x: Array, y: Array, pose: Pose, height: int) -> Array:
        """Disparity (H, W) in px at places of the layer, in its own px from its centre; `x` and `y` may be
        one row and one column."""
        bulge: Array | float = 0.0
        if self.relief:
            a, b = self.half
            bulge = self.relief * np.sqrt(
                np.clip(1 - (x / (1.06 * a)) ** 2 - 0.4 * (y / (1.06 * b)) ** 2, 0, 1)
            )
        slope = self.floor * np.clip(y / (height / 2.0), 0, None)
        return pose.disparity + pose.scale**2 * (bulge + slope) + 0 * x

    def disparities(self, pose: Pose, height: int) -> tuple[float, float]:
        """Between which its disparities lie, px."""
        nearest = self.relief + self.floor * 2 * max(0.0, self.half[1] + RIM) / height
        return pose.disparity, pose.disparity + pose.scale**2 * nearest

    def part(
        self, pose: Pose, size: tuple[int, int], lower: float = 0.0, left: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[slice, slice]:
        """Rows and columns of a view of `size` (width, height) outside of which nothing of it is, where it is
        shown so many rows lower and between so many px further left."""
        if self.outline == "all":
            return slice(0, size[1]), slice(0, size[0])
        a, b = (pose.scale * (half + RIM) for half in self.half)
        ends = [(pose.y + lower - b, pose.y + lower + b), (pose.x - left[1] - a, pose.x - left[0] + a)]
        bounds = [
            np.clip([np.floor(first), np.ceil(last) + 1], 0, n).astype(int)
            for (first, last), n in zip(ends, size[::-1], strict=True)
        ]
        return slice(*bounds[0]), slice(*bounds[1])

    def texture(self, rng: np.random.Generator, height: int, width: int) -> Array:
        """Its texture, large enough for its outline or for a background that pans."""
        if self.outline == "all":
            return texture(rng, height + 80, width + 240, self.cell)
        return texture(rng, 2 * int(self.half[1]) + 20, 2 * int(self.half[0]) + 20, self.cell)


@dataclass(frozen=True)
class Step:
    """Both views at one time and the truth in the left view."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    label: NDArray[np.int_]
    disparity: Array
    visible: NDArray[np.bool_]
    """Whether the right camera sees the point too."""
    motion: Array
    """(H, W, 3), (u, v, w): px along x and y and disparity to the next step."""


@dataclass(frozen=True)
class Scene:
    """Layers, far to near, and the cameras."""

    name: str
    layers: tuple[Layer, ...]
    steps: int
    row_offset: float
    """How much lower the right view shows a point, rows."""
    seed: int
    size: tuple[int, int] = (640, 480)
    """Width and height, px."""
    disparity_range: tuple[int, int] = (-40, 24)
    """What a matcher has to search, px."""
    noise: float = 2.0
    """Standard deviation, grey levels."""

    def sequence(self, times: Sequence[int] | None = None) -> list[Step]:
        """Every step, or some: those have the same textures, but other noise than they have in the whole
        sequence."""
        rng = np.random.default_rng(self.seed)
        width, height = self.size
        textures = [layer.texture(rng, height, width) for layer in self.layers]
        return [self._step(t, textures, rng) for t in (range(self.steps) if times is None else times)]

    def _step(self, t: int, textures: list[Array], rng: np.random.Generator) -> Step:
        width, height = self.size
        # One column and one row, as long as a place does not depend on both.
        rows, columns = np.arange(height, dtype=float)[:, None], np.arange(width, dtype=float)[None]
        left, right = np.zeros((height, width)), np.zeros((height, width))
        top, top_right = np.full((height, width), -1), np.full((height, width), -1)
        disparity, motion = np.zeros((height, width)), np.zeros((height, width, 3))
        for index, (layer, cover) in enumerate(zip(self.layers, textures, strict=True)):
            now, then = layer.pose(t), layer.pose(t + 1)
            part = layer.part(now, self.size)
            x, y = columns[:, part[1]], rows[part[0]]
            p, q = (x - now.x) / now.scale, (y - now.y) / now.scale
            _paint(left[part], top[part], index, layer, cover, p, q)
            mine, depth = top[part] == index, layer.disparity_at(p, q, now, height)
            moved = layer.disparity_at(p, q, then, height) - depth
            disparity[part][mine] = depth[mine]
            for k, shift in enumerate((then.x + then.scale * p - x, then.y + then.scale * q - y, moved)):
                motion[part][..., k][mine] = np.broadcast_to(shift, mine.shape)[mine]
            # A pixel of the right view shows the point whose x_left - d(x_left) it is.
            part = layer.part(now, self.size, self.row_offset, layer.disparities(now, height))
            x, y = columns[:, part[1]], rows[part[0]]
            q, x_left = (y - self.row_offset - now.y) / now.scale, x + now.disparity
            # Without a relief, disparity does not depend on where along the row a point is.
            for _ in range(8 if layer.relief else 1):
                x_left = x + layer.disparity_at((x_left - now.x) / now.scale, q, now, height)
            _paint(right[part], top_right[part], index, layer, cover, (x_left - now.x) / now.scale, q)
        visible = _seen_by_both(top, top_right, disparity, self.row_offset)
        label = np.array([layer.label for layer in self.layers])[top]
        views = [_recorded(view, self.noise, rng) for view in (left, GAIN * right + BIAS)]
        return Step(views[0], views[1], label, disparity, visible, motion)


def _paint(
    view: Array, top: NDArray[np.int_], index: int, layer: Layer, cover: Array, p: Array, q: Array
) -> None:
    """Lays one more layer over a part of the view, in place; marks in `top` where it is."""
    places = np.broadcast_arrays(q + cover.shape[0] / 2, p + cover.shape[1] / 2)
    shown = map_coordinates(cover, places, order=1, mode="reflect")
    if layer.outline == "all":
        top[:], view[:] = index, shown
        return
    alpha = np.clip(OUTLINES[layer.outline](p, q, *layer.half) / SOFT_EDGE + 0.5, 0, 1)
    top[alpha > 0.5] = index
    view[:] = view * (1 - alpha) + shown * alpha


def _seen_by_both(
    top: NDArray[np.int_], top_right: NDArray[np.int_], disparity: Array, row_offset: float
) -> NDArray[np.bool_]:
    """Where the right view shows the same layer at the place of the match."""
    height, width = top.shape
    rows, columns = np.arange(height)[:, None], np.arange(width)
    x, y = np.rint(columns - disparity).astype(int), np.rint(rows + row_offset).astype(int)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return inside & (top_right[y.clip(0, height - 1), x.clip(0, width - 1)] == top)


def _recorded(view: Array, noise: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    return np.clip(np.rint(view + rng.normal(0, noise, view.shape)), 0, 255).astype(np.uint8)


def wall(x: float, y: float, vx: float, disparity: float, floor: float, cell: float = 56) -> Layer:
    """What is behind everything: it pans by `vx` px a step, and its floor comes nearer downwards."""
    return Layer("all", 0, (x, y), (vx, 0), disparity, floor=floor, cell=cell)


def crossing() -> Scene:
    """Three groups of people cross before a panning wall."""
    person = Layer("person", 3, (515, 290), (-22, 0), 6, 0.4, (60, 150))
    layers = (
        wall(280, 240, 5, -32, 16),
        Layer("person", 1, (270, 245), (3, 0), -20, 0, (40, 95), 16),
        Layer("person", 2, (90, 275), (17, 0), -7, 0, (50, 125), 20),
        person,
        replace(person, position=(600, 295), disparity=5),
    )
    return Scene("crossing", layers, 16, 2.0, 1)


def curved() -> Scene:
    """A bulging cab comes nearer."""
    layers = (
        wall(320, 240, 0, -30, 10),
        Layer("person", 2, (600, 240), (-5, 0), -22, 0, (30, 75), 14),
        Layer("ellipse", 1, (205, 245), (14, -1), -16, 0.8, (155, 125), 30, relief=14),
    )
    return Scene("curved", layers, 10, 1.0, 2)


def cart() -> Scene:
    """A cart goes away between seats."""
    far, near, nearest = (32, 57), (65, 110), (88, 158)
    layers = (
        wall(320, 240, 0, -34, 14),
        Layer("box", 2, (215, 300), (0, 0), -31, 0, far, 20),
        Layer("box", 2, (430, 300), (0, 0), -31, 0, far, 20),
        Layer("box", 1, (325, 290), (1.5, -4), 2, -3, (55, 100), 22),
        Layer("box", 2, (120, 330), (0, 0), 3, 0, near, 34),
        Layer("box", 2, (545, 330), (0, 0), 3, 0, near, 34),
        Layer("box", 2, (45, 380), (0, 0), 14, 0, nearest, 34),
        Layer("box", 2, (610, 385), (0, 0), 16, 0, nearest, 34),
    )
    return Scene("cart", layers, 10, -2.0, 3)


def small() -> Scene:
    """Two boxes before a panning wall."""
    layers = (
        wall(160, 120, 2.5, -16, 0, 30),
        Layer("box", 1, (90, 120), (9, 0), -3, 0, (30, 50), 14),
        Layer("box", 2, (240, 125), (-6.4, 0), 4, 0.7, (35, 55), 14),
    )
    return Scene("small", layers, 6, 1.0, 7, (320, 240), (-20, 12))


def passing() -> Scene:
    """Two people cross in opposite directions before a wall: the near one hides the far one."""
    layers = (
        wall(280, 240, 0, -32, 16),
        Layer("person", 1, (120, 260), (20, 0), -12, 0, (45, 105), 16),
        Layer("person", 2, (520, 280), (-18, 0), 4, 0, (55, 130), 20),
    )
    return Scene("passing", layers, 16, 1.0, 2)


def pillar() -> Scene:
    """A person walks behind a pillar that is wider than six of their steps."""
    layers = (
        wall(320, 240, 0, -30, 8),
        Layer("person", 1, (120, 250), (20, 0), -14, 0, (36, 85), 16),
        Layer("box", 2, (360, 240), (0, 0), 6, 0, (75, 230), 20),
    )
    return Scene("pillar", layers, 18, 0.0, 5)


def tiny() -> Scene:
    """Small objects, two of them no nearer to one another in depth than in the image."""
    layers = (
        wall(320, 240, 2, -30, 4),
        Layer("box", 1, (150, 150), (8, 0), -10, 0, (12, 16), 7),
        Layer("box", 2, (400, 200), (-7, 2), 0, 0, (10, 10), 6),
        Layer("box", 3, (300, 380), (0, -6), 8, 0, (16, 14), 7),
    )
    return Scene("tiny", layers, 10, 0.0, 1)


def fence() -> Scene:
    """A person walks behind a fence."""
    layers = (
        wall(320, 240, 0, -30, 10),
        Layer("person", 1, (200, 240), (9, 0), -18, 0, (45, 110), 16),
        # One grey level: pales differ by their roughness only.
        Layer("pales", 2, (320, 320), (-3, 0), -8, 0, (420, 110), 2000),
    )
    return Scene("fence", layers, 6, 0.0, 9)


def textured_fence() -> Scene:
    """The same before a smaller fence that is as rough as everything else: its pales look less alike."""
    plain = fence()
    wall_, person, pales = plain.layers
    return replace(
        plain, name="fence, textured", layers=(wall_, person, replace(pales, half=(200, 60), cell=14))
    )


SCENES: dict[str, Callable[[], Scene]] = {
    scene.__name__: scene for scene in (crossing, curved, cart, passing, pillar, tiny, small, fence)
}
"""Every scene, by name."""
