"""The gradient tracker on scenes with exact truth and, with JACOFLOW_DATA, on recordings: share of frames
found, outcomes of tests, time; of discs whose boxes hold background the greatest errors of the position, px,
and over their standard deviations; of start boxes the share of positions within two standard deviations; of
each recording of people the mean overlap from boxes that are larger, smaller or beside the first one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks.ablation import outcomes
from benchmarks.rivals.trackers import Tracker, ours
from benchmarks.scenes import tracking as scenes
from benchmarks.scenes import textures, tracking_begin, tracking_hard, tracking_recordings
from benchmarks.scenes.tracking import TIMES, Plane, Scene, Truth, disc, figure, line, square
from benchmarks.scenes.tracking_recordings import Recording
from benchmarks.scores.tracking import scores

PEOPLE = ("Crossing", *(f"TUD-Campus {target}" for target in (2, 3, 4, 5, 7)))
"""Recordings whose start boxes are changed."""
LARGER_IS_BETTER = (
    "hard", "simulations", "twins", "two planes", "start boxes", "small boxes", "bars", "fences", "half hidden",
    "jumps", "light", "other sizes, overlap", "first frames, held", "fast starts", "recordings",
    "recordings, parts", "tests", *(f"{name}, boxes" for name in PEOPLE),
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
TWIN_SEEDS = (SEED, 5000, 6000)
"""Added to the seeds of the backgrounds of twins."""
SEEDS = range(64, 72)
"""Seeds of the backgrounds of start boxes whose covariance is looked at, and of targets that change their
size while they are covered."""
FAST_SEEDS, FAST_FRAMES = range(64, 704), 26
"""Seeds of the backgrounds of fast starts, of which few lose the target, and their frames."""
FIRST = 13
"""Frames in which a first box may be undecided."""
PART = 30
"""Frames of a part of a recording."""
OTHER_BOXES = (
    (1.0, 1.0, 0.0, 0.0), (1.2, 1.2, 0.0, 0.0), (1.4, 1.0, 0.0, 0.0), (0.85, 0.85, 0.0, 0.0),
    (1.0, 1.0, 0.1, 0.0), (1.0, 1.0, -0.1, 0.0), (1.0, 1.0, 0.0, 0.1), (1.0, 1.0, 0.0, -0.1),
)  # fmt: skip
"""Sides of other start boxes over those of the first, and how far they are beside that, in sides."""
DISC_KINDS, DISC_RADIUS = ("smooth:4,110,25", "fractal:1,90,30"), 14.0
"""Backgrounds and radius, px, of discs that are alone in their box."""


def unseen(scene: Scene, seed: int = SEED) -> Scene:
    """The scene before other backgrounds and with other noise."""
    planes = tuple(replace(plane, seed=plane.seed + seed) for plane in scene.planes)
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
        for seed in TWIN_SEEDS:
            yield "twins", unseen(scene, seed)
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


def resized() -> Iterator[Scene]:
    """A target that changes its size while a bar hides it or a low wall hides its lower half."""
    count = len(TIMES)
    bar = figure(np.full((count, 2), (129.5, 127.5)), np.full((count, 2), (40.0, 256.0)), 40.0)
    wall = figure(np.full((count, 2), (129.5, 138.0)), np.full((count, 2), (70.0, 20.0)), 40.0)
    for occluder, fall in ((bar, 0.4), (wall, 0.0)):
        path = line((70.0, 128.0), (2.4, fall))
        grown = np.clip((path[:, 0] - 97.0) / 65.0, 0.0, 1.0)[:, None]
        for seed in SEEDS:
            surface = textures.texture(45, 150.0, 35.0, 2.0, seed)
            for kind in tracking_begin.KINDS:
                for factor in (0.8, 1.25):
                    sides = np.repeat(25.0 * (1.0 + (factor - 1.0) * grown), 2, axis=1)
                    for target in (figure(path, sides, 200.0), figure(path, sides, 1.0, surface=surface)):
                        yield Scene("other size", (Plane(kind, seed),), target, others=(occluder,))


def of_start_box() -> Iterator[float]:
    """Shares of the first frames with the centre within two standard deviations along both axes, of targets
    in boxes of other sides or beside them."""
    for seed in SEEDS:
        for kind in tracking_begin.KINDS:
            for box in tracking_begin.BOXES:
                for side in (13.0, 21.0):
                    scene = tracking_begin.stretched(box, side, kind, seed)
                    found = jacoflow.track.track(scene.frames(), scene.start_box)
                    errors = np.abs(found.position - scene.centres) / np.sqrt(found.covariance[:, :, 0, 0])
                    yield float((errors[1:FIRST] <= 2.0).all(axis=1).mean())


def of_fast_start(tracker: Tracker, seed: int) -> float:
    """Share of frames in which a faint target before a rough background is found that moves by 5 px a frame
    from the first one on."""
    path = line((60.0, 120.0), (5.0, 0.0))[:FAST_FRAMES]
    scene = Scene("fast", (Plane("fractal:1,90,30", seed),), square(path, side=21.0, level=115.0))
    frames = []
    for t in range(FAST_FRAMES):
        picture = scene.picture(t)
        noise = scene.noise * np.random.default_rng((seed, t)).standard_normal(picture.shape)
        frames.append(np.rint(np.clip(picture + noise, 0.0, 255.0)).astype(np.uint8))
    truth = Truth(scene.boxes, np.arange(FAST_FRAMES) > 0)
    return scores(tracker.run(np.stack(frames), scene.start_box), truth)["success"]


def parts(recording: Recording) -> Iterator[Recording]:
    """The recording in parts of `PART` frames that begin where the target has a box."""
    for first in range(0, len(recording.frames) - PART + 1, PART):
        boxes = recording.truth.boxes[first : first + PART]
        known = np.isfinite(boxes).all(axis=1)
        if known[0]:
            truth = Truth(boxes, known & (np.arange(PART) > 0))
            yield Recording(recording.name, recording.frames[first : first + PART], truth)


def overlap_of(tracker: Tracker, recording: Recording) -> float:
    """Mean overlap on a recording."""
    return scores(tracker.run(recording.frames, recording.start_box), recording.truth)["mean_overlap"]


def overlaps_from_other_boxes(tracker: Tracker, recording: Recording) -> list[float]:
    """Mean overlap on a recording from each of the other start boxes."""
    x, y, w, h = recording.start_box
    boxes = [
        (x + w * (0.5 + right - wide / 2), y + h * (0.5 + down - high / 2), w * wide, h * high)
        for wide, high, right, down in OTHER_BOXES
    ]
    return [scores(tracker.run(recording.frames, box), recording.truth)["mean_overlap"] for box in boxes]


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
    found["other sizes, overlap"] = [
        scores(tracker.run(scene.frames(), scene.start_box), Truth.of(scene))["mean_overlap"]
        for scene in resized()
    ]
    found["first frames, held"] = list(of_start_box())
    found["fast starts"] = [of_fast_start(tracker, seed) for seed in FAST_SEEDS]
    for kind in DISC_KINDS:
        for speed in (0.4, 0.8, 1.2, 2.0):
            error, deviations = of_disc(kind, speed)
            found.setdefault("disc, px", []).append(error)
            found.setdefault("disc, deviations", []).append(deviations)
    if os.environ.get("JACOFLOW_DATA"):
        data = Path(os.environ["JACOFLOW_DATA"])
        still = [each for each in tracking_recordings.read_all(data) if not isinstance(each, str)]
        found["recordings"] = [overlap_of(tracker, each) for each in still]
        people = [each for each in still if each.name in PEOPLE]
        found |= {f"{each.name}, boxes": overlaps_from_other_boxes(tracker, each) for each in people}
        found["recordings, parts"] = [
            overlap_of(tracker, part)
            for each in [*still, *tracking_recordings.moving(data)]
            for part in parts(each)
        ]
    found["tests"] = outcomes.passed(*TESTS)
    return found
