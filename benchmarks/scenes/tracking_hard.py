"""Scenes that are hard to track in, each in its own way; `hard()` has 28 of them, `others_win()` those in
which other trackers are known to do better.

The background is `fractal:1,90,30`, seed 5; the target a square of 13 px, level 200, on a circle of radius 20
px (2.5 px/frame) along real-valued positions; noise 2 grey levels, unless the name has another value.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.scenes import textures as pictures
from benchmarks.scenes.textures import Array, Figure
from benchmarks.scenes.tracking import TIMES, Plane, Scene, circle, disc, figure, line, square

KIND = "fractal:1,90,30"
SEED = 5
RADIUS = 20.0
CAMERA_SEED = 12
TEXTURE_SEED = 2
BAR_LEVEL = 40.0
MIDDLE = 25
"""The frame in which twins meet."""


def scene(
    name: str, target: Figure | None = None, *, kind: str = KIND, motion: Array | None = None, **more: Any
) -> Scene:
    """A scene that differs from the ordinary one in what is given."""
    return Scene(
        name, more.pop("planes", (Plane(kind, SEED, motion),)), target or square(circle(RADIUS)), **more
    )


def hard() -> list[Scene]:
    """All 28."""
    return [*table(), *further()]


def table() -> Iterator[Scene]:
    """The fifteen with published figures."""
    yield scene("level 115 on smooth:4,90,20", square(circle(RADIUS), level=115.0), kind="smooth:4,90,20")
    surface = pictures.texture(21, 110.0, 35.0, 2.0, TEXTURE_SEED)
    yield scene(
        "21 px, textured, 3 deg/frame",
        square(circle(RADIUS), side=21.0, level=1.0, degrees=3.0, surface=surface),
    )
    yield scene("5 deg/frame", square(circle(RADIUS), degrees=5.0))
    yield scene("growing disc", disc(circle(RADIUS), 7.0 + np.maximum(TIMES - 3, 0) // 2))
    yield scene("noise 20", noise=20.0)
    yield scene("9 px/frame", square(circle(72.0)))
    moving = np.minimum(TIMES, 20) + np.maximum(TIMES - 35, 0)
    yield scene(
        "stands still from 20 to 35",
        square(np.stack([60 + 2.5 * moving, np.full_like(TIMES, 128.0)], axis=1)),
    )
    corner = np.stack([80 + 3 * np.minimum(TIMES, 25), 90 + 3 * np.maximum(TIMES - 25, 0)], axis=1)
    yield scene("turns a corner", square(corner))
    bar = figure(np.full((len(TIMES), 2), (129.5, 127.5)), np.full((len(TIMES), 2), (20.0, 256.0)), BAR_LEVEL)
    yield scene("behind a bar", square(line((70.0, 128.0), (2.4, 0.4))), others=(bar,))
    yield scene("frames 25 to 27 uniform", uniform={25: 128, 26: 128, 27: 128})
    yield scene("frame gain 1 to 0.6", gain=1 - 0.4 * TIMES / 50)
    yield scene(
        "level 140, camera pans", square(circle(RADIUS), level=140.0), motion=line((0.0, 0.0), (-3.0, 1.0))
    )
    jitter = np.random.default_rng(CAMERA_SEED).uniform(-5.0, 5.0, (len(TIMES), 2))
    yield scene("level 140, camera jitter", square(circle(RADIUS), level=140.0), motion=jitter)
    yield scene(
        "meets its twin head on",
        square(line((70.0, 128.0), (2.5, 0.0))),
        others=(square(line((196.0, 128.0), (-2.5, 0.0))),),
    )
    yield scene(
        "half out and back",
        square(np.stack([240 + 20 * np.sin(2 * np.pi * TIMES / 50), np.full_like(TIMES, 128.0)], axis=1)),
    )


def further() -> Iterator[Scene]:
    """Thirteen more: edge cases, and a look-alike that does not hide the target."""
    out = np.stack([230 + 35 * np.sin(np.pi * TIMES / 50), np.full_like(TIMES, 128.0)], axis=1)
    yield scene("leaves the picture and returns", square(out))
    yield scene("0.3 px/frame", square(line((120.0, 128.0), (0.3, 0.0))))
    yield scene("stops at 20 for good", square(circle(RADIUS, np.minimum(TIMES, 20))))
    yield scene(
        "target alone 40 % brighter and darker",
        square(circle(RADIUS), level=180 * (1 + 0.4 * np.sin(2 * np.pi * TIMES / 50))),
    )
    yield scene("frame 25 black", uniform={25: 0})
    yield scene("frames 15 and 35 repeat the one before", repeated=(15, 35))
    yield scene("start box partly outside", square(line((2.0, 100.0), (2.0, 0.5))))
    x, y, w, h = square(circle(RADIUS)).boxes()[0]
    yield scene("start box off by 2 px", start=(x + 2, y - 2, w, h))
    yield scene("start box 40 % too large", start=(x - 0.2 * w, y - 0.2 * h, 1.4 * w, 1.4 * h))
    yield two_planes(SEED)
    yield scene("level 130, noise 5", square(circle(RADIUS), level=130.0), noise=5.0)
    yield meeting("a twin passes 16 px beside", (2.0, 0.0), (-2.0, 0.0), apart=(0.0, 16.0))
    yield meeting("a twin overtakes 14 px beside", (1.5, 0.0), (2.5, 0.0), apart=(0.0, 14.0))


def two_planes(seed: int) -> Scene:
    """A background whose upper half moves by 1 px a frame and whose lower half by 3."""
    upper, lower = (line((0.0, 0.0), (speed, 0.0)) for speed in (1.0, 3.0))
    return scene(
        "two background planes, 1 and 3 px/frame",
        planes=(Plane(KIND, seed, upper, (0, 128)), Plane(KIND, seed + 1, lower, (128, 256))),
    )


def others_win() -> list[Scene]:
    """A turn out of the plane, a breathing ellipse, and fourteen crossings with an identical twin that
    coincide to within 3 px."""
    return [turn_out_of_plane(), breathing_ellipse(), *crossings()]


def turn_out_of_plane() -> Scene:
    """The width shrinks to 40 % and comes back."""
    width = 13 * (0.7 + 0.3 * np.cos(2 * np.pi * TIMES / 50))
    return scene(
        "turns out of the plane, width to 40 %",
        figure(circle(RADIUS), np.stack([width, np.full_like(width, 13.0)], axis=1), 200.0),
    )


def breathing_ellipse() -> Scene:
    """Width and height swing by 45 %, against each other."""
    swing = 0.45 * np.sin(2 * np.pi * TIMES / 25)
    return scene(
        "ellipse breathing by 45 %",
        figure(circle(RADIUS), 16 * np.stack([1 + swing, 1 - swing], axis=1), 200.0, shape="disc"),
    )


def crossings() -> Iterator[Scene]:
    """Head on, at right angles, overtaking and at a distance of 3 px, at several speeds."""
    for v in (1.0, 1.5, 2.0, 3.0):
        yield meeting(f"twin head on, {v:g} px/frame", (v, 0.0), (-v, 0.0))
    for v in (1.0, 2.0, 2.5, 3.0):
        yield meeting(f"twin at right angles, {v:g} px/frame", (v, 0.0), (0.0, v))
    for v in (1.0, 2.0, 3.0):
        yield meeting(f"twin overtakes, {v:g} px/frame faster", (0.5, 0.0), (0.5 + v, 0.0))
    for v in (1.0, 2.0, 3.0):
        yield meeting(f"twin head on 3 px beside, {v:g} px/frame", (v, 0.0), (-v, 0.0), apart=(0.0, 3.0))


def meeting(
    name: str,
    velocity: tuple[float, float],
    of_twin: tuple[float, float],
    apart: tuple[float, float] = (0.0, 0.0),
) -> Scene:
    """The target and a twin pass (128, 128) in frame 25, the twin `apart` px from there."""
    since = (TIMES - MIDDLE)[:, None]
    paths = [128 + since * np.array(velocity), 128 + np.array(apart) + since * np.array(of_twin)]
    return scene(name, square(paths[0]), others=(square(paths[1]),))
