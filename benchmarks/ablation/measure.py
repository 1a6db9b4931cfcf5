"""`measure` of regions with two motions, of turning discs and of a noisy plane: how well values and standard
deviations fit the truth, and the share of regions without a dominant motion, of these and of waves, whose
motion is not affine; and of regions for which a minority was taken: a third of them still, the rest moving or
unrelated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks.scenes import steps
from benchmarks.tables.limits import SQUARE, eight_bit

SEEDS = tuple(range(10, 18))
"""Of textures and noise; the constants were chosen on others."""
DIFFERENCES, RADII, ANGLES, NOISES = (0.1, 0.2, 0.4), (15.0, 20.0, 30.0, 45.0), (0.02, 0.06), (0.5, 2.0)
SMALL = 20.0
"""Radius, px, up to which slopes see the wall beside a disc."""
MAX_LOSS = 50.0
"""So that one wrong value does not hide all others."""


def rows() -> dict[str, list[float]]:
    """One value for each region."""
    names = ("two motions", "small discs", "discs", "plane", "none found", "waves, none found", "minority, found")
    found: dict[str, list[float]] = {name: [] for name in names}
    for seed in SEEDS:
        picture = steps.texture(seed)
        for difference in DIFFERENCES:
            gone = steps.moved(picture, np.eye(2), (difference, 0.0))
            right = np.arange(steps.SIZE)[None, :] > steps.CENTRE[0]
            still = steps.moved(picture, np.eye(2))
            motion = measured(seed, (still, np.where(right, gone, still)), 1.0, "u", SQUARE)
            # Either motion may be the dominant one.
            truth = min((0.0, difference), key=lambda u: abs(u - motion.value))
            add(found, "two motions", motion, truth)
        y, x = np.mgrid[: steps.SIZE, : steps.SIZE]
        wall = steps.moved(steps.texture(seed + 100), np.eye(2))
        for radius in RADII:
            inside = np.hypot(x - steps.CENTRE[0], y - steps.CENTRE[1]) < radius
            for angle in ANGLES:
                pair = [np.where(inside, steps.moved(picture, steps.turn(k * angle)), wall) for k in range(2)]
                disc = (*steps.CENTRE, radius - 3.0)
                row = "small discs" if radius <= SMALL else "discs"
                add(found, row, measured(seed, pair, 1.0, "angular_velocity", disc), angle)
        for noise in NOISES:
            pair = [steps.moved(picture, np.eye(2)), steps.moved(picture, 1.01 * np.eye(2), (0.37, 0.0))]
            add(found, "plane", measured(seed, pair, noise, "divergence", SQUARE), 2 * np.log(1.01))
        waves = jacoflow.scenes.Scene("waves", random_state=seed, speed=0.4, wavelength=256.0, width=steps.SIZE, height=steps.SIZE)
        pair = [waves.frame(float(k)) for k in range(2)]
        found["waves, none found"].append(float(measured(seed, pair, 0.5, "u", SQUARE).status != "ok"))
        columns = np.arange(steps.SIZE)
        still, gone = (steps.moved(steps.waves(seed), np.eye(2), (shift, 0.0)) for shift in (0.0, 3.0))
        other = steps.moved(steps.waves(seed + 100), np.eye(2))
        pair = [still, np.where(columns < 60, still, np.where(columns < 90, gone, other))]
        found["minority, found"].append(float(measured(seed, pair, 0.5, "u", (0, 0, 140, steps.SIZE)).status == "ok"))
    return found


def measured(
    seed: int, pair: Sequence[NDArray[np.float64]], noise: float, name: str, region: tuple[float, ...]
) -> jacoflow.Measurement:
    """A quantity of a region from two frames with noise."""
    rng = np.random.default_rng(seed)
    return jacoflow.flow(*(eight_bit(frame, noise, rng) for frame in pair)).measure(name, region)


def add(found: dict[str, list[float]], row: str, motion: jacoflow.Measurement, truth: float) -> None:
    """Adds the loss (negative logarithm of the normal density of the relative error, less its constant); that
    of no motion is that of a standard deviation as large as the truth."""
    is_found = motion.status == "ok"
    found["none found"].append(float(not is_found))
    size = max(abs(truth), 0.01)
    error, std = ((motion.value - truth) / size, motion.std / size) if is_found else (0.0, 1.0)
    found[row].append(min(0.5 * (error / std) ** 2 + float(np.log(std)), MAX_LOSS))
