"""The gradient tracker on scenes with exact truth and, with JACOFLOW_DATA, on recordings: share of frames
found, outcomes of tests, time; of discs whose boxes hold background the greatest errors of the position, px,
and over their standard deviations."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks.ablation import outcomes
from benchmarks.rivals.trackers import ours
from benchmarks.scenes import tracking as scenes
from benchmarks.scenes import tracking_begin, tracking_hard, tracking_recordings
from benchmarks.scenes.tracking import TIMES, Plane, Scene, Truth, disc, figure, line, square
from benchmarks.scores.tracking import scores

LARGER_IS_BETTER = (
    "hard", "simulations", "twins", "two planes", "start boxes", "small boxes", "bars", "fences", "half hidden",
    "jumps", "light", "recordings", "tests",
)  # fmt: skip
TESTS = (
    "test_track.py", "test_track_begin.py", "test_track_covered.py", "test_track_edges.py", "test_track_limits.py",
    "test_track_parts.py", "test_track_parts_hidden.py", "test_masked_tracking.py", "test_tracking_scenes.py",
)  # fmt: skip
"""Tests of the tracker."""
SEED = 4000
"""Added to the seeds of the backgrounds; no table uses these."""
BACKGROUND = 64
"""Seed of backgrounds that belong to this table alone."""
DISC_KINDS, DISC_RADIUS = ("smooth:4,110,25", "fractal:1,90,30"), 14.0
"""Backgrounds and radius, px, of discs that are alone in their box."""


def unseen(scene: Scene) -> Scene:
    """The scene before other backgrounds and with other noise."""
    planes = tuple(replace(plane, seed=plane.seed + SEED) for plane in scene.planes)
    return replace(scene, planes=planes, noise_seed=5)


def covered(name: str, target: object, *bars: tuple[float, float, float]) -> Iterator[Scene]:
    """A target behind upright bars (middle, width, level), on two kinds of backgrounds."""
    count = len(TIMES)
    others = tuple(
        figure(np.full((count, 2), (middle, 127.5)), np.full((count, 2), (width, 256.0)), level)
        for middle, width, level in bars
    )
    for kind in tracking_begin.KINDS:
        yield Scene(name, (Plane(kind, BACKGROUND),), target, others=others)


def tested() -> Iterator[tuple[str, Scene]]:
    """The scenes with the row that each belongs to."""
    for scene in tracking_hard.hard():
        yield "hard", unseen(scene)
    for scene in scenes.simulations():
        yield "simulations", unseen(scene)
    for scene in tracking_hard.crossings():
        yield "twins", unseen(scene)
    for seed in range(210, 216):
        yield "two planes", tracking_hard.two_planes(seed)
    for kind in tracking_begin.KINDS:
        for outline in tracking_begin.OUTLINES:
            yield "start boxes", tracking_begin.outlined(outline, 21.0, 1.3, kind, BACKGROUND)
        for box in tracking_begin.BOXES:
            yield "start boxes", tracking_begin.stretched(box, 31.0, kind, BACKGROUND)
        for side in (13.0, 21.0, 41.0):
            exact = Scene("small box", (Plane(kind, BACKGROUND),), square(scenes.circle(20.0), side=side))
            x, y, w, h = exact.start_box
            yield "small boxes", replace(exact, start=(x + 0.2 * w, y + 0.2 * h, 0.6 * w, 0.6 * h))
    for level, bar in ((200.0, 40.0), (200.0, 110.0), (150.0, 40.0), (140.0, 220.0), (20.0, 90.0)):
        for scene in covered("bar", square(line((70.0, 128.0), (2.4, 0.4)), level=level), (129.5, 20.0, bar)):
            yield "bars", scene
    for side, gap, width in ((21.0, 8.0, 4.0), (45.0, 8.0, 4.0), (31.0, 12.0, 6.0), (13.0, 12.0, 6.0)):
        pickets = [(90.0 + k * (gap + width), width, 40.0) for k in range(int(80 // (gap + width)))]
        for scene in covered("fence", square(line((60.0, 128.0), (2.2, 0.2)), side=side), *pickets):
            yield "fences", scene
    for side in (15.0, 31.0, 51.0):
        for speed in (0.6, 1.5, 3.0):
            target = square(line((90.0, 128.0), (speed, 0.0)), side=side)
            for scene in covered("half hidden", target, (44.5, 90.0, 130.0)):
                yield "half hidden", scene
    for jump in (10.0, 18.0, 25.0):
        path = line((90.0, 128.0), (1.0, 0.0)) + np.where(TIMES >= 20, jump, 0.0)[:, None] * (1.0, 0.0)
        for scene in covered("jump", square(path)):
            yield "jumps", scene


LIT = 8
"""Scenes whose light changes."""
LIGHT: dict[str, tuple[float, float]] = {"darker": (0.5, 0.0), "brighter": (1.4, 0.0), "a higher level": (1.0, 60.0)}
"""Gain, and offset in grey levels, of the second half of a recording."""


def in_other_light(frames: NDArray[np.uint8], gain: float, offset: float) -> NDArray[np.uint8]:
    """Frames whose light changes in the middle."""
    half = len(frames) // 2
    later = np.clip(np.rint(gain * frames[half:].astype(float) + offset), 0, 255).astype(np.uint8)
    return np.concatenate([frames[:half], later])


def of_disc(kind: str, speed: float) -> tuple[float, float]:
    """Greatest error of the position of a disc, px, and over its standard deviation, after the first
    frames."""
    target = disc(line((70.0, 128.0), (speed, 0.0)), np.full(len(TIMES), DISC_RADIUS), level=170.0)
    scene = Scene("disc", (Plane(kind, BACKGROUND),), target)
    found = jacoflow.track.track(scene.frames(), scene.start_box)
    errors = np.abs(found.position - scene.centres)[4:]
    return float(errors.max()), float((errors / np.sqrt(found.covariance[4:, :, 0, 0])).max())


def rows() -> dict[str, list[float]]:
    """One value for each scene, or target of a recording."""
    (tracker,) = ours(("layered",))
    found: dict[str, list[float]] = {"ms": []}
    for row, scene in tested():
        figures = scores(tracker.run(scene.frames(), scene.start_box), Truth.of(scene))
        found.setdefault(row, []).append(figures["success"])
        found["ms"].append(figures["milliseconds"])
    for scene in list(scenes.simulations())[:LIT]:
        for light in LIGHT.values():
            frames = in_other_light(np.asarray(unseen(scene).frames()), *light)
            success = scores(tracker.run(frames, scene.start_box), Truth.of(scene))["success"]
            found.setdefault("light", []).append(success)
    for kind in DISC_KINDS:
        for speed in (0.4, 0.8, 1.2, 2.0):
            error, deviations = of_disc(kind, speed)
            found.setdefault("disc, px", []).append(error)
            found.setdefault("disc, deviations", []).append(deviations)
    if os.environ.get("JACOFLOW_DATA"):
        for each in tracking_recordings.read_all(Path(os.environ["JACOFLOW_DATA"])):
            if not isinstance(each, str):
                figures = scores(tracker.run(each.frames, each.start_box), each.truth)
                found.setdefault("recordings", []).append(figures["mean_overlap"])
    found["tests"] = outcomes.passed(*TESTS)
    return found
