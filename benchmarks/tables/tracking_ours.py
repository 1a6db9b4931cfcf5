"""Tables of our trackers alone: other noise, less contrast, starts that are not exact, and the time of a
frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from benchmarks import report
from benchmarks.rivals.trackers import Tracker, ours, with_affine
from benchmarks.scenes import tracking as scenes
from benchmarks.scenes import tracking_begin
from benchmarks.scenes import tracking_hard as hard_scenes
from benchmarks.scenes.textures import Array, Figure
from benchmarks.scenes.tracking import TIMES, Plane, Scene, Truth, circle, disc, figure, line, square
from benchmarks.scores.tracking import scores

Row = dict[str, object]
NOISE_SEEDS = range(2, 7)
"""Those of the published figures is 1."""
CONTRASTS = (10.0, 15.0, 20.0, 30.0, 60.0)
"""Grey levels above the mean of the background."""
CONTRAST_KINDS = ("smooth:4,90,10", "smooth:4,90,20", "smooth:4,90,40")
SEEDS = range(3, 7)
"""Of backgrounds."""
PLANE_SEEDS = range(100, 124)
"""Of backgrounds with two halves in different motion; which half passes for the still scene depends on
texture."""
BEGIN_SEEDS = range(4)
BAR_SEEDS = range(30, 36)
BARS = (
    (200.0, 40.0),
    (200.0, 90.0),
    (200.0, 110.0),
    (200.0, 250.0),
    (150.0, 40.0),
    (160.0, 250.0),
    (140.0, 220.0),
    (20.0, 90.0),
    (20.0, 150.0),
    (20.0, 250.0),
)
"""Grey levels of targets and of the bars that they go behind."""
ASKED_TIMES = {
    "jacoflow layered": {
        "5 deg/frame": "<= 1",
        "level 140, camera pans": "<= 4",
        "level 140, camera jitter": "<= 4",
    },
    "jacoflow local": {"5 deg/frame": "<= 0.3"},
}
"""ms a frame on one thread, by tracker and scene."""


def noise(trackers: list[Tracker]) -> list[Row]:
    """Mean and worst of five other seeds of the noise, on the scenes with published figures."""
    rows: list[Row] = []
    for scene in scenes.published():
        if scene.noise == 0:
            continue
        for tracker in _named(trackers, "layered", "local"):
            each = [_scores(replace(scene, noise_seed=seed), tracker) for seed in NOISE_SEEDS]
            row: Row = {"scene": scene.name, "tracker": tracker.name}
            worse: dict[str, Callable[[Iterable[float]], float]] = {"success": min, "window_on3": min}
            for column in (
                "success",
                "window_on3",
                "centre_error",
                "displacement_error_x",
                "displacement_error_y",
                "scale_error",
                "angle_error",
            ):
                if column in each[0]:
                    values = [figures[column] for figures in each]
                    row[column] = f"{np.mean(values):.3g} / {worse.get(column, max)(values):.3g}"
            rows.append(row)
    return rows


def contrast(trackers: list[Tracker]) -> list[Row]:
    """Share of frames found, mean over four backgrounds, by how much brighter than the mean of the
    background the target is."""
    rows: list[Row] = []
    for kind in CONTRAST_KINDS:
        for above in CONTRASTS:
            row: Row = {"background": kind, "target above its mean": above}
            for tracker in _named(trackers, "layered", "local", "paper"):
                tested = (
                    Scene(
                        "contrast",
                        (Plane(kind, seed),),
                        square(circle(hard_scenes.RADIUS), level=90.0 + above),
                    )
                    for seed in SEEDS
                )
                row[tracker.name] = float(np.mean([_scores(scene, tracker)["success"] for scene in tested]))
            rows.append(row)
    return rows


def begin(trackers: list[Tracker]) -> list[Row]:
    """Starts that are not exact: share of frames within 3 px, and of tracked frames the greatest error.

    Errors in px and over their stated standard deviation; means and worst over four backgrounds of two kinds.
    """
    rows: list[Row] = []
    if not _named(trackers, "layered"):
        return rows
    tested: list[tuple[str, Callable[[str, int], Scene]]] = []
    for outline in tracking_begin.OUTLINES:
        for larger in (1.0, 1.2, 1.3):
            tested.append((f"{outline} of 21 px, box {larger:g} times as large", _outlined(outline, larger)))
    for box in tracking_begin.BOXES:
        for side in (13.0, 31.0):
            tested.append((f"square of {side:g} px, box {box}", _stretched(box, side)))
    for name, make in tested:
        each = np.array([_stated(make(kind, seed)) for kind in tracking_begin.KINDS for seed in BEGIN_SEEDS])
        near, tracked, error, deviations = each.T
        rows.append(
            {
                "start": name,
                "on3": float(near.mean()),
                "said to be tracked": float(tracked.mean()),
                "greatest error, px": float(error.max()),
                "greatest error over its deviation": float(deviations.max()),
            }
        )
    return rows


def covered(trackers: list[Tracker]) -> list[Row]:
    """Share of frames found, mean and worst over six backgrounds of two kinds each, of a target that goes
    behind a bar as in the hard scenes, but for the brightness of both; background of mean 90."""
    rows: list[Row] = []
    for level, bar_level in BARS:
        row: Row = {"target": f"level {level:g}", "bar": f"level {bar_level:g}"}
        bar = figure(
            np.full((len(TIMES), 2), (129.5, 127.5)), np.full((len(TIMES), 2), (20.0, 256.0)), bar_level
        )
        target = square(line((70.0, 128.0), (2.4, 0.4)), level=level)
        for tracker in _named(trackers, "layered", "local"):
            each = [
                _scores(Scene("bar", (Plane(kind, seed),), target, others=(bar,)), tracker)["success"]
                for kind in tracking_begin.KINDS
                for seed in BAR_SEEDS
            ]
            row[tracker.name] = f"{np.mean(each):.2f} / {min(each):.2f}"
        rows.append(row)
    return rows


def limits(trackers: list[Tracker]) -> list[Row]:
    """Share of frames found, mean and worst over four backgrounds: outlines that change along one axis,
    discs that shrink, very small targets, and two halves of the background in motion."""
    path = circle(hard_scenes.RADIUS)
    tested: list[tuple[str, str, Figure]] = []
    for share in (0.3, 0.45, 0.6):
        width = 16 * (1 + share * np.sin(2 * np.pi * TIMES / 25))
        tested.append(
            (
                f"16 px, width swings by {share:.0%}",
                hard_scenes.KIND,
                figure(path, np.stack([width, np.full_like(width, 16.0)], axis=1), 200.0),
            )
        )
    tested.append(
        ("disc of 32 px, 0.97 times as large each frame", hard_scenes.KIND, disc(path, 16.0 * 0.97**TIMES))
    )
    for side in (5.0, 6.0, 7.0):
        tested.extend(
            (f"{side:g} px", kind, square(path, side=side)) for kind in (hard_scenes.KIND, "smooth:2,128,40")
        )
    rows: list[Row] = []
    for name, kind, target in tested:
        row: Row = {"target": name, "background": kind}
        for tracker in trackers:
            each = [_scores(Scene(name, (Plane(kind, seed),), target), tracker)["success"] for seed in SEEDS]
            row[tracker.name] = f"{np.mean(each):.2f} / {min(each):.2f}"
        rows.append(row)
    row = {
        "target": "13 px before two planes in motion",
        "background": f"{hard_scenes.KIND}, {len(PLANE_SEEDS)} seeds",
    }
    for tracker in trackers:
        each = [_scores(hard_scenes.two_planes(seed), tracker)["success"] for seed in PLANE_SEEDS]
        row[tracker.name] = f"{np.mean(each):.2f} / {min(each):.2f}"
    return [*rows, row]


def times(trackers: list[Tracker]) -> list[Row]:
    """Time of a frame on one thread beside the specified one."""
    by_name = {scene.name: scene for scene in hard_scenes.hard()}
    rows: list[Row] = []
    for tracker in trackers:
        for name, asked in ASKED_TIMES.get(tracker.name, {}).items():
            rows.append(
                {
                    "scene": name,
                    "tracker": tracker.name,
                    "asked, ms": asked,
                    "milliseconds": _scores(by_name[name], tracker)["milliseconds"],
                }
            )
    return rows


def _outlined(outline: str, larger: float) -> Callable[[str, int], Scene]:
    return lambda kind, seed: tracking_begin.outlined(outline, 21.0, larger, kind, seed)


def _stretched(box: str, side: float) -> Callable[[str, int], Scene]:
    return lambda kind, seed: tracking_begin.stretched(box, side, kind, seed)


def _stated(scene: Scene) -> tuple[float, float, float, float]:
    """Share of frames within 3 px, share tracked, greatest error of these, px, and over its standard
    deviation."""
    from jacoflow import track

    found = track.track(scene.frames(), scene.start_box)
    off: Array = np.abs(found.position - scene.centres)
    tracked = (found.status == "tracking") & (np.arange(len(off)) > 0)
    over = off / np.sqrt(found.covariance[:, :, 0, 0])
    return (
        float((np.linalg.norm(off, axis=1) <= 3)[1:].mean()),
        float(tracked[1:].mean()),
        float(off[tracked].max(initial=0.0)),
        float(over[tracked].max(initial=0.0)),
    )


def _named(trackers: list[Tracker], *modes: str) -> list[Tracker]:
    """Ours of some modes."""
    return [tracker for tracker in trackers if tracker.name in {f"jacoflow {mode}" for mode in modes}]


def _scores(scene: Scene, tracker: Tracker) -> dict[str, float]:
    return scores(tracker.run(scene.frames(), scene.start_box), Truth.of(scene))


TABLES = {
    name: report.Table(f"Tracking, {title}", lambda _, rows=rows: rows(list(ours())))
    for name, (title, rows) in {
        "noise": ("five other seeds of the noise, mean / worst", noise),
        "contrast": ("share of frames found by contrast", contrast),
        "begin": ("starts that are not exact (layered)", begin),
        "bars": ("behind bars of other brightness, mean / worst", covered),
        "limits": (
            "outlines and sizes at the limits, mean / worst",
            lambda trackers: limits(with_affine(trackers)),
        ),
        "times": ("time of a frame", times),
    }.items()
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
