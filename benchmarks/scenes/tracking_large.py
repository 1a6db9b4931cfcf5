"""A target of 80 x 80 px in frames of 720 x 480: what a frame costs where boxes are large."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.textures import Array, background, shifted, texture
from benchmarks.scenes.tracking import BACKGROUND_SEED, CENTRE, TIMES, Plane, Scene, circle, square

WIDTH, HEIGHT = 720, 480
SIDE = 80.0
RADIUS = 30.0
"""Of the path, px: 3.8 px a frame."""
PAN = (-1.5, 0.5)
"""How far the camera goes from frame to frame, px."""


@dataclass(frozen=True)
class LargeScene(Scene):
    """A scene with frames (T, 480, 720)."""

    @property
    def scored(self) -> NDArray[np.bool_]:
        """(T,), all frames after the first."""
        return TIMES > 0

    def picture(self, t: int) -> Array:
        """(480, 720), brightness at frame `t` without noise, grey levels."""
        plane = self.planes[0]
        still = background(plane.kind, plane.seed, WIDTH)
        picture = (still if plane.motion is None else shifted(still, *plane.motion[t]))[:HEIGHT].copy()
        self.target.draw(picture, t)
        return picture


def large() -> list[Scene]:
    """The scene with a camera that stands still, and with one that pans."""
    target = square(
        circle(RADIUS) - CENTRE + (WIDTH / 2, HEIGHT / 2),
        SIDE,
        1.0,
        surface=texture(int(SIDE), 170.0, 30.0, 3.0, 7),
    )
    pan = TIMES[:, None] * PAN
    planes = {
        "still camera": Plane("fractal:1,90,30", BACKGROUND_SEED),
        "camera pans": Plane("fractal:1,90,30", BACKGROUND_SEED, pan),
    }
    return [LargeScene(f"80 px in 720 x 480, {name}", (plane,), target) for name, plane in planes.items()]
