"""Edge disparity on the synthetic stereo scenes: density, errors and time of each pair of views, and the
error of its row offset; the same for a right camera of another gain; and the row offset that a tracker keeps
in sequences that begin without a scene and whose right camera is then moved."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks.scenes import stereo as scenes
from benchmarks.scores.stereo import count, figures

LARGER_IS_BETTER = ("density", "gain: density")
SEEDS = (101, 102, 103)
"""Of the scenes' textures and noise; none of them is used elsewhere."""
SCENES = ("crossing", "curved", "cart", "small")
GAINS = (0.5, 0.7)
"""Of the right camera."""
JUMPS = (-1.5, 0.5, 2.5)
"""By which the right camera is moved within a sequence, rows."""
MAX_ROW_ERROR = 1.0
"""The error, rows, of an offset that is farther off or unknown."""

Views = tuple[NDArray[np.float64], NDArray[np.float64]]


def rows() -> dict[str, list[float]]:
    """One value for each scene, seed and step, or jump."""
    found: dict[str, list[float]] = {}

    def add(prefix: str, scene: scenes.Scene, shown: scenes.Step, gain: float) -> float:
        left, right = shown.left.astype(float), gain * shown.right.astype(float)
        begun = time.process_time()
        result = jacoflow.stereo.edge_disparity(left, right, disparity_range=scene.disparity_range, threads=1)
        passed = 1e3 * (time.process_time() - begun)
        edges = np.zeros(left.shape, bool)
        edges[jacoflow.stereo.edge_pixels(left)] = True
        reached = figures([count(result.disparity, edges, shown.disparity, shown.visible)])
        for key in ("density", "MAE", "outliers", "occluded"):
            found.setdefault(prefix + key, []).append(float(reached[key]))
        found.setdefault(prefix + "row offset error", []).append(row_error(result.row_offset, scene.row_offset))
        return passed

    for name in SCENES:
        for seed in SEEDS:
            scene = replace(scenes.SCENES[name](), seed=seed, steps=2)
            for shown in scene.sequence():
                found.setdefault("ms", []).append(add("", scene, shown, 1.0))
            for gain in GAINS:
                add("gain: ", scene, shown, gain)
    for seed in SEEDS:
        for jump in JUMPS:
            for key, error in sequence(seed, jump):
                found.setdefault(key, []).append(error)
    return found


def row_error(estimate: float | None, truth: float) -> float:
    """Distance of a row offset from the truth, rows."""
    return MAX_ROW_ERROR if estimate is None else min(abs(estimate - truth), MAX_ROW_ERROR)


def sequence(seed: int, jump: float) -> Iterator[tuple[str, float]]:
    """Errors of the row offset that a tracker keeps: views of noise and of a title, a scene, noise again, and
    the same scene after the right camera moved."""
    scene = replace(scenes.SCENES["small"](), seed=seed, steps=2)
    moved = replace(scene, row_offset=scene.row_offset + jump)
    noise, title = openings(scene.size, seed)
    tracker = jacoflow.track.StereoTracker(disparity_range=scene.disparity_range, n_components=4, threads=1)
    for views in (noise, title):
        tracker.update(*views)
    for shown in scene.sequence():
        tracker.update(shown.left, shown.right)
        yield "first row offset error", row_error(tracker.row_offset, scene.row_offset)
    tracker.update(*noise)
    yield "row offset error after noise", row_error(tracker.row_offset, scene.row_offset)
    for shown in moved.sequence():
        tracker.update(shown.left, shown.right)
        yield "moved row offset error", row_error(tracker.row_offset, moved.row_offset)


def openings(size: tuple[int, int], seed: int) -> tuple[Views, Views]:
    """Unrelated noise, and a title that is drawn into both views alike."""
    width, height = size
    rng = np.random.default_rng((seed, 91))
    y, x = np.mgrid[:height, :width]
    bar = (y >= 40) & (y < 46) & (x >= 20) & (x < width - 20)
    strokes = (y >= 70) & (y < 100) & (x >= 20) & (x < width - 20) & (x // 6 % 3 == 0)
    title = np.where(bar | strokes, 230.0, 20.0)
    return (rng.uniform(0, 40, (height, width)), rng.uniform(0, 40, (height, width))), (title, title)
