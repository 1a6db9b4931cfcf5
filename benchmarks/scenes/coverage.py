"""Synthetic scenes for the coverage of 95 % intervals: textures times motions times noise.

The constants of the covariance were fitted on the scenes `FITTED`; `HELD_OUT` differ in seed, size, texture,
motion and noise.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacoflow import scenes

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Family:
    """A carrier and a motion."""

    carrier: str
    motion: str
    name: str
    parameters: dict[str, float] = field(default_factory=dict, hash=False)

    def frames(self, size: tuple[int, int], noise: float, seed: int, count: int) -> tuple[list[Array], Any]:
        """What an 8-bit camera sees, and the exact mean flow at the pixels that the estimate belongs to."""
        scene = scenes.Scene(
            self.motion,
            width=size[0],
            height=size[1],
            random_state=seed,
            carrier=self.carrier,
            **self.parameters,
        )
        camera = scenes.Sensor(noise=noise, rounding="nearest", saturate=True, random_state=seed)
        times = (0.0, 1.0) if count == 2 else (-1.0, 0.0, 1.0)
        pictures = [camera.apply_u8(scene.frame(t), index=int(t) + 8) for t in times]
        return pictures, scene.truth(0.0, between=(0.0, 1.0))


def affine(
    u: float, v: float, u_x: float = 0.0, v_x: float = 0.0, u_y: float = 0.0, v_y: float = 0.0
) -> tuple[str, dict[str, float]]:
    """The scene of one affine motion."""
    return "affine", {"u": u, "v": v, "u_x": u_x, "v_x": v_x, "u_y": u_y, "v_y": v_y}


MOTIONS: dict[str, tuple[str, dict[str, float]]] = {
    "still": affine(0.1, 0.05),
    "affine": affine(3.3, -2.2, 0.01, 0.02, -0.02, 0.01),
    "fast": affine(7.4, 6.7, 0.02, -0.03, 0.02, -0.01),
    "vortex": ("vortex", {"circulation": 400.0, "core": 25.0}),
    "waves": ("waves", {"speed": 1.5, "wavelength": 128.0}),
    "turbulence": ("turbulence", {"speed": 2.0, "longest": 192.0}),
}
CARRIERS: dict[str, tuple[str, dict[str, float]]] = {
    "noise": ("noise", {}),
    "speckle": ("speckle", {}),
    "particles": ("particles", {}),
}
OTHER_MOTIONS: dict[str, tuple[str, dict[str, float]]] = {
    "slide": affine(0.31, 0.62),
    "spin": affine(2.7, -4.4, -0.004, 0.03, -0.03, -0.004),
    "quick": affine(6.3, -5.6, 0.02, 0.01, -0.015, 0.015),
    "vortex": ("vortex", {"circulation": 550.0, "core": 30.0}),
    "waves": ("waves", {"speed": 2.2, "wavelength": 110.0}),
    "turbulence": ("turbulence", {"speed": 1.6, "longest": 170.0}),
}
OTHER_CARRIERS: dict[str, tuple[str, dict[str, float]]] = {
    "noise 1.7 px": ("noise", {"sigma": 1.7, "std": 30.0}),
    "noise 2.6 px": ("noise", {"sigma": 2.6, "std": 45.0}),
    "speckle 3 px": ("speckle", {"radius": 3.0}),
    "particles 3.2 px": ("particles", {"diameter": 3.2, "density": 0.06}),
    "particles 2.5 px": ("particles", {"diameter": 2.5, "density": 0.04}),
}


def families(
    carriers: dict[str, tuple[str, dict[str, float]]], motions: dict[str, tuple[str, dict[str, float]]]
) -> list[Family]:
    """Every combination."""
    return [
        Family(carrier, motion, f"{texture}, {moving}", {**look, **path})
        for (texture, (carrier, look)), (moving, (motion, path)) in itertools.product(
            carriers.items(), motions.items()
        )
    ]


@dataclass(frozen=True)
class Plan:
    """Families seen at some noise levels."""

    families: list[Family]
    noises: tuple[float, ...]
    size: tuple[int, int]


FITTED = Plan(families(CARRIERS, MOTIONS), (0.0, 1.0, 2.0, 4.0), (192, 192))
HELD_OUT = Plan(families(OTHER_CARRIERS, OTHER_MOTIONS), (0.5, 2.0, 3.0), (224, 160))
