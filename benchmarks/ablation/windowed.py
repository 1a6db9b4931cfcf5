"""Windowed estimate on slow synthetic scenes, on the slower controlled scenes and on gratings: error, how far
its 95 % intervals are from holding 95 %, time."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator

import numpy as np

import jacoflow
from benchmarks.scenes import controlled
from benchmarks.scenes.coverage import OTHER_CARRIERS, Family, affine, families
from benchmarks.tables.coverage import held
from jacoflow import scenes

SEEDS = (21, 22)
"""Of the scenes' textures and noise; none of them was used to choose a rule."""
SIZE = (128, 112)
MARGIN = 24
MOTIONS = {
    "slide": affine(0.21, -0.12),
    "spin": affine(0.1, 0.2, -0.004, 0.01, -0.01, -0.004),
    "vortex": ("vortex", {"circulation": 60.0, "core": 25.0}),
    "waves": ("waves", {"speed": 0.4, "wavelength": 110.0}),
}
ALONG = (-2.0, 2.0)
"""Motions along the lines of a grating, px/frame: no frame shows them, so every interval has to hold them."""


def rows() -> dict[str, list[float]]:
    """One value for each scene, noise and seed."""
    found: dict[str, list[float]] = {"error": [], "scenes": [], "controlled": [], "grating": [], "ms": []}
    slow: list[Family] = families(OTHER_CARRIERS, MOTIONS)
    for family, noise, seed in itertools.product(slow, (0.5, 3.0), SEEDS):
        frames, truth = family.frames(SIZE, noise, seed, 3)
        begun = time.process_time()
        field = jacoflow.flow(*frames, method="windowed", threads=1)
        found["ms"].append(1e3 * (time.process_time() - begun))
        inner = np.zeros(field.shape, bool)
        inner[MARGIN:-MARGIN, MARGIN:-MARGIN] = True
        inner &= field.valid
        found["error"].append(float(np.linalg.norm((field.flow - truth.flow)[inner], axis=-1).mean()))
        found["scenes"].append(excess(held(field, truth.flow, truth.jacobian, inner)))
    found["controlled"] = list(controlled_scenes())
    found["grating"] = [grating(noise, seed) for noise, seed in itertools.product((0.3, 1.0, 3.0), SEEDS)]
    return found


def excess(shares: dict[str, float]) -> float:
    """How far the mean share of intervals that hold the truth is from .95."""
    return abs(float(np.mean(list(shares.values()))) - 0.95)


def controlled_scenes() -> Iterator[float]:
    """The controlled scenes of up to 2 px/frame, brightness rows as in their table."""
    for wavelength, speed, noise, seed in itertools.product((64.0, 256.0), (1.0, 2.0), (0.0, 3.0), SEEDS):
        case = controlled.Case(wavelength, speed, noise, seed)
        frames = [controlled.frame(case, t) for t in (-1.0, 0.0, 1.0)]
        flow, jacobian = controlled.truth(wavelength, speed, seed, 0.0, (-1.0, 1.0))
        field = jacoflow.flow(*frames, method=jacoflow.Windowed(rows="brightness"), threads=1)
        inner = np.zeros(field.shape, bool)
        inner[MARGIN:-MARGIN, MARGIN:-MARGIN] = True
        yield excess(held(field, flow, jacobian, inner & field.valid))


def grating(noise: float, seed: int) -> float:
    """Share of the intervals that miss a motion along the lines of a grating."""
    x = np.arange(64.0)
    camera = scenes.Sensor(noise=noise, rounding="nearest", saturate=True, random_state=seed)
    lines = [np.tile(100 + 50 * np.sin((x - 0.3 * t) / 4), (56, 1)) for t in (-1, 0, 1)]
    frames = [camera.apply_u8(frame, index=k) for k, frame in enumerate(lines)]
    field = jacoflow.flow(*frames, method="windowed", threads=1)
    v, std = field.v[field.valid], field.std("v")[field.valid]
    return float(np.mean([np.abs(v - along) > 1.96 * std for along in ALONG]))
