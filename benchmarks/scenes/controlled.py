"""Noise textures moved by smooth velocity fields with exact truth, seen by an 8-bit camera."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jacoflow import scenes

Array = NDArray[np.floating]
Picture = NDArray[np.uint8]
SIZE = 256
"""Width and height of the frames, px."""


@dataclass(frozen=True)
class Case:
    """A scene: a noise texture moved by waves of about `wavelength` px, at most `speed` px/frame fast in
    the frame, seen by an 8-bit camera."""

    wavelength: float
    speed: float
    noise: float
    """Grey levels."""
    seed: int = 1

    def scene(self, origin: tuple[float, float] = (0.0, 0.0)) -> scenes.Scene:
        """The scene through a window at `origin`."""
        rms = self.speed / fastest(self.wavelength, self.seed)
        return scenes.Scene(
            "waves",
            width=SIZE,
            height=SIZE,
            origin=origin,
            random_state=self.seed,
            carrier="noise",
            speed=rms,
            wavelength=self.wavelength,
        )


@functools.cache
def fastest(wavelength: float, seed: int) -> float:
    """The greatest speed in the frame of a field whose root-mean-square speed is 1 px/frame."""
    unit = scenes.Scene(
        "waves",
        width=SIZE,
        height=SIZE,
        random_state=seed,
        carrier="speckle",
        speed=1.0,
        wavelength=wavelength,
    )
    return float(np.linalg.norm(unit.truth(0.0).flow, axis=-1).max())


@functools.cache
def clean_frame(wavelength: float, speed: float, seed: int, t: float) -> Array:
    """The scene's brightness at a time, before the camera."""
    return Case(wavelength, speed, 0.0, seed).scene().frame(t)


def frame(case: Case, t: float) -> Picture:
    """What the camera sees at a time: noise, whole grey levels, 0 to 255."""
    camera = scenes.Sensor(noise=case.noise, rounding="nearest", saturate=True, random_state=case.seed)
    return camera.apply_u8(clean_frame(case.wavelength, case.speed, case.seed, t), index=int(t) + 8)


@functools.cache
def truth(
    wavelength: float, speed: float, seed: int, t: float, between: tuple[float, float]
) -> tuple[Array, Array]:
    """Exact mean flow and Jacobian between the frames at the pixels of time t."""
    field = Case(wavelength, speed, 0.0, seed).scene().truth(t, between=between)
    return field.flow, field.jacobian


@functools.cache
def gradient(wavelength: float, speed: float, seed: int, t: float) -> Array:
    """Exact brightness gradient (H, W, 2) at a time, grey levels/px: differences over 0.02 px of the scene
    itself."""
    case, h = Case(wavelength, speed, 0.0, seed), 0.01
    along_x, along_y = (
        (case.scene((dx, dy)).frame(t) - case.scene((-dx, -dy)).frame(t)) / (2 * h)
        for dx, dy in ((h, 0.0), (0.0, h))
    )
    return np.stack([along_x, along_y], axis=-1)


def cases(
    wavelengths: tuple[float, ...] = (64.0, 256.0),
    speeds: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0),
    noises: tuple[float, ...] = (0.0, 3.0),
) -> list[Case]:
    """Every combination."""
    return [Case(*each) for each in itertools.product(wavelengths, speeds, noises)]
