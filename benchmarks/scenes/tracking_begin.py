"""Starts that are not exact: boxes that are too large round figures that do not fill them, of another
aspect, or beside the target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.textures import Array, Figure
from benchmarks.scenes.tracking import TIMES, Plane, Scene, circle, square

OUTLINES = ("diamond", "cross", "ring", "triangle")
KINDS = ("fractal:1,90,30", "smooth:4,90,20")
RADIUS = 20.0
BOXES = {
    "exact": (1.0, 1.0, 0.0, 0.0),
    "half as wide again": (1.5, 1.0, 0.0, 0.0),
    "1.3 times as wide, 0.8 as high": (1.3, 0.8, 0.0, 0.0),
    "30 % beside": (1.0, 1.0, 0.3, 0.0),
    "30 % beside and below": (1.0, 1.0, 0.3, 0.3),
}
"""Sides of the start box over the target's, and how far it is beside that, in sides."""


@dataclass(frozen=True)
class Outline(Figure):
    """A figure of one brightness with another outline than a square or a disc."""

    outline: str = "diamond"

    def _samples(self, patch: tuple[slice, slice], t: int) -> tuple[NDArray[np.bool_], Array, Array]:
        """Which samples of the patch lie on it, and where they lie along its width and height, px from its
        centre."""
        _, right, down = super()._samples(patch, t)
        right, down = np.broadcast_arrays(right, down)
        return _inside(self.outline, right, down, self.sizes[t, 0] / 2), right, down


def _inside(outline: str, right: Array, down: Array, half: float) -> NDArray[np.bool_]:
    """Which samples an outline holds."""
    if outline == "diamond":
        return np.abs(right) + np.abs(down) <= half
    if outline == "cross":
        return (np.maximum(np.abs(right), np.abs(down)) <= half) & (
            np.minimum(np.abs(right), np.abs(down)) <= half / 3
        )
    if outline == "ring":
        distance = np.hypot(right, down)
        return (distance <= half) & (distance >= 0.55 * half)
    return (np.abs(down) <= half) & (np.abs(right) <= (down + half) / 2)


def outlined(outline: str, side: float, larger: float, kind: str, seed: int) -> Scene:
    """A figure with that outline on a circle, begun with a box so many times as large as its own."""
    path = circle(RADIUS)
    target = Outline(
        path, np.full_like(path, side), np.zeros(len(TIMES)), np.full(len(TIMES), 200.0), outline=outline
    )
    return Scene(
        f"{outline} {side:g} px, box {larger:g} times as large",
        (Plane(kind, seed),),
        target,
        start=_changed(target, (larger, larger, 0.0, 0.0)),
    )


def stretched(box: str, side: float, kind: str, seed: int) -> Scene:
    """A square on a circle, begun with a box of `BOXES`."""
    target = square(circle(RADIUS), side=side)
    return Scene(f"{side:g} px, box {box}", (Plane(kind, seed),), target, start=_changed(target, BOXES[box]))


def _changed(target: Figure, box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """The first box, changed by factors of its sides and by shares of them."""
    (x, y, w, h), (wide, high, right, down) = target.boxes()[0], box
    return (x + w * (0.5 + right - wide / 2), y + h * (0.5 + down - high / 2), w * wide, h * high)
