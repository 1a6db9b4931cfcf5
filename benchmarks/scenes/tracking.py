"""Moving targets with exact truth: the paper's three simulations, and scenes that are harder.

Frames are 256 x 256, 51 of them. A figure is drawn by area (8 x 8 samples a pixel) over a background, noise
of 2 grey levels is added frame after frame from `default_rng(1)`, and the sum is clipped to 0..255 and
rounded. Without another word the target is a square of 13 px and level 200 that goes round a circle about
(128, 128) once in 50 frames.

- `simulations()`: 24 scenes: Simulations 1 (square), 2 (square turning 1 degree a frame) and 3 (growing disc)
  on four backgrounds, radius 8 and 24 px.
- `sequences()`: 96 of them: eight backgrounds, radius 8 to 32 px. All backgrounds are synthetic; there are no
  photographs among them.
- `hard()` in :mod:`tracking_hard_scenes`: 28 scenes, each hard in its own way.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.textures import SIZE, Array, Figure, background, shifted

FRAMES = 51
"""Frames of a scene."""
TIMES = np.arange(FRAMES, dtype=float)
"""Their times, frames."""
CENTRE = np.array([128.0, 128.0])
"""Middle of the paths, px."""
NOISE_SEED = 1
BACKGROUNDS = ("smooth:4,90,20", "smooth:2,90,20", "smooth:2,128,40", "fractal:1,90,30")
"""Those of the 24 simulations."""
MORE_BACKGROUNDS = ("flat:90", "smooth:8,90,30", "fractal:1,90,15", "fractal:1.5,90,30")
"""Further backgrounds of the 96 sequences."""
BACKGROUND_SEED = 3


@dataclass(frozen=True)
class Plane:
    """A background, or some rows of it, and how it moves."""

    kind: str
    seed: int
    motion: Array | None = None
    """(T, 2), how far it has moved since the beginning, px; None: it is still."""
    rows: tuple[int, int] = (0, SIZE)
    """The rows of the frame that show it: the first, and the one after the last."""

    @cached_property
    def still(self) -> Array:
        """Its picture before it moves."""
        return background(self.kind, self.seed)

    def at(self, t: int) -> Array:
        """Its picture at frame `t`."""
        return self.still if self.motion is None else shifted(self.still, *self.motion[t])


@lru_cache(maxsize=1)
def _grain(seed: int, shape: tuple[int, ...]) -> Array:
    """Noise of deviation 1, (T, H, W): nearly all scenes have the same."""
    return np.random.default_rng(seed).standard_normal(shape)


@dataclass(frozen=True)
class Scene:
    """Frames with a target whose place is known exactly."""

    name: str
    planes: tuple[Plane, ...]
    target: Figure
    others: tuple[Figure, ...] = ()
    """Rendered after the target, in front of it."""
    noise: float = 2.0
    """Standard deviation, grey levels."""
    noise_seed: int = NOISE_SEED
    gain: Array | None = None
    """(T,), what the frames are multiplied by before the noise; None: 1."""
    uniform: dict[int, int] = field(default_factory=dict)
    """Frames that show one grey level and nothing else, and that level."""
    repeated: tuple[int, ...] = ()
    """Frames that are the one before again."""
    start: tuple[float, float, float, float] | None = None
    """Box given to the tracker in frame 0: x, y, width, height, px; None: the true one."""

    @property
    def centres(self) -> Array:
        """(T, 2), x and y of the target's centre, px."""
        return self.target.centres

    @property
    def boxes(self) -> Array:
        """(T, 4), x, y, width, height, px, with x = centre - width / 2; as large as the target, not
        enlarged by its turning."""
        return self.target.boxes()

    @property
    def scales(self) -> Array | None:
        """(T,), size over that in frame 0; None where width and height change differently."""
        ratios = self.target.sizes / self.target.sizes[0]
        return ratios[:, 0] if np.array_equal(ratios[:, 0], ratios[:, 1]) else None

    @property
    def angles(self) -> Array | None:
        """(T,), rad turned since frame 0, from x towards y; None for discs, which do not show it."""
        return None if self.target.shape == "disc" else self.target.angles - self.target.angles[0]

    @property
    def start_box(self) -> tuple[float, float, float, float]:
        """The box the tracker begins with, px."""
        return self.start or tuple(self.boxes[0].tolist())

    @property
    def scored(self) -> NDArray[np.bool_]:
        """(T,), the frames that count: all after the first with some of the target's box in the picture."""
        low, high = self.boxes[:, :2], self.boxes[:, :2] + self.boxes[:, 2:]
        return ((high > -0.5) & (low < SIZE - 0.5)).all(axis=1) & (TIMES > 0)

    def frames(self) -> NDArray[np.uint8]:
        """(T, H, W), what the camera sees."""
        seen: list[NDArray[np.uint8]] = []
        for t in range(len(self.centres)):
            picture = self.picture(t)
            if self.noise > 0:
                picture = picture + self.noise * _grain(self.noise_seed, (len(self.centres), *picture.shape))[t]
            frame = np.rint(np.clip(picture, 0.0, 255.0)).astype(np.uint8)
            if t in self.uniform:
                frame[:] = self.uniform[t]
            seen.append(seen[-1] if t in self.repeated else frame)
        return np.stack(seen)

    def picture(self, t: int) -> Array:
        """(H, W), brightness at frame `t` without noise, grey levels."""
        picture = np.empty((SIZE, SIZE))
        for plane in self.planes:
            rows = slice(*plane.rows)
            picture[rows] = plane.at(t)[rows]
        for figure in (self.target, *self.others):
            figure.draw(picture, t)
        return picture if self.gain is None else picture * self.gain[t]


def circle(radius: float, phase: Array = TIMES, whole: bool = False) -> Array:
    """(T, 2), the path round (128, 128), once in 50 units of phase, px; `whole`: rounded to whole pixels."""
    angle = 2 * np.pi * phase / 50
    path = CENTRE + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.floor(path + 0.5) if whole else path


def line(start: tuple[float, float], velocity: tuple[float, float]) -> Array:
    """(T, 2), a straight path, px."""
    return np.array(start) + TIMES[:, None] * velocity


def square(
    path: Array, side: float = 13.0, level: float | Array = 200.0, degrees: float = 0.0, **more: Any
) -> Figure:
    """A square on a path, turning by `degrees` a frame."""
    return figure(path, np.full_like(path, side), level, angles=np.deg2rad(degrees) * TIMES, **more)


def disc(path: Array, radii: Array, level: float = 200.0) -> Figure:
    """A disc on a path with a radius (T,) for every frame, px."""
    return figure(path, np.stack([2 * radii, 2 * radii], axis=1), level, shape="disc")


def figure(
    path: Array, sizes: Array, level: float | Array, angles: Array | None = None, **more: Any
) -> Figure:
    """A figure on a path."""
    return Figure(
        path,
        sizes,
        np.zeros(len(path)) if angles is None else angles,
        np.broadcast_to(np.asarray(level, float), len(path)),
        **more,
    )


def simulation(
    number: int,
    kind: str,
    radius: float,
    *,
    seed: int = BACKGROUND_SEED,
    whole: bool = False,
    noise: float = 2.0,
) -> Scene:
    """Simulation 1, 2 or 3 of the paper on a background, on a circle of `radius` px; `whole`: its path
    rounded to whole pixels."""
    path = circle(radius, whole=whole)
    target = {
        1: lambda: square(path),
        2: lambda: square(path, degrees=1.0),
        3: lambda: disc(path, 7.0 + TIMES // 5),
    }[number]()
    name = (
        f"S{number} {kind} R {radius:g}"
        + (", whole pixels" if whole else "")
        + ("" if noise else ", no noise")
    )
    return Scene(name, (Plane(kind, seed),), target, noise=noise)


def simulations() -> Iterator[Scene]:
    """The 24 scenes of Simulations 1 to 3."""
    return (simulation(n, kind, radius) for n in (1, 2, 3) for kind in BACKGROUNDS for radius in (8.0, 24.0))


def sequences() -> Iterator[Scene]:
    """The 96 sequences of Simulations 1 to 3."""
    kinds = BACKGROUNDS + MORE_BACKGROUNDS
    return (
        simulation(n, kind, radius) for n in (1, 2, 3) for kind in kinds for radius in (8.0, 16.0, 24.0, 32.0)
    )


def published() -> Iterator[Scene]:
    """The seven scenes with published errors of every estimate."""
    for number in (1, 2, 3):
        yield simulation(number, "smooth:4,90,20", 16.0, whole=True)
    yield simulation(1, "flat:90", 16.0, whole=True, noise=0.0)
    for number in (1, 2, 3):
        yield simulation(number, "fractal:1,90,30", 24.0)


@dataclass(frozen=True)
class Truth:
    """What a track is compared with; the first axis is time (T)."""

    boxes: Array
    """(T, 4), x, y, width, height, px; NaN where unknown."""
    scored: NDArray[np.bool_]
    """(T,), frames that count."""
    scales: Array | None = None
    """(T,)."""
    angles: Array | None = None
    """(T,), rad."""

    @classmethod
    def of(cls, scene: Scene) -> Truth:
        """The truth of a scene."""
        return cls(scene.boxes, scene.scored, scene.scales, scene.angles)

    @property
    def centres(self) -> Array:
        """(T, 2), px."""
        return self.boxes[:, :2] + self.boxes[:, 2:] / 2
