"""Trackers under one roof: OpenCV's and ours, each begun with the exact box and given one frame after the
other."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.textures import Array
from benchmarks.scores import timing
from benchmarks.scores.tracking import Track

try:
    import cv2
except ImportError:
    cv2 = None

Frames = NDArray[np.uint8]
Box = tuple[float, float, float, float]
MODES = ("layered", "local", "paper")
"""Our tracker, and the two methods of its source: these need a build with the feature `reference`."""
RIVALS = ("CSRT", "KCF", "MedianFlow", "MIL", "MOSSE")
"""OpenCV's trackers that need no trained network."""
ENLARGED = ("CSRT", "KCF")
"""Those that also run on frames enlarged three times."""
TIMES_LARGER = 3
ARGUMENTS = {"--trackers": {"nargs": "+", "help": "parts of the names of the trackers to run"}}
"""Option of the tables that compare trackers."""


@dataclass(frozen=True)
class Tracker:
    """A tracker by name."""

    name: str
    run: Callable[[Frames, Box], Track]
    """The track through the frames (T, H, W) from a box in the first."""


def chosen(options: Namespace) -> list[Tracker]:
    """Every tracker whose name holds one of the parts in `--trackers`."""
    return [
        each
        for each in everyone()
        if options.trackers is None or any(part in each.name for part in options.trackers)
    ]


def with_affine(trackers: list[Tracker]) -> list[Tracker]:
    """The trackers; `layered` with an affine model first if `layered` is among them."""
    if not any(tracker.name == "jacoflow layered" for tracker in trackers):
        return trackers
    return [
        *(Tracker(f"{each.name} affine", each.run) for each in ours(("layered",), model="affine")),
        *trackers,
    ]


def everyone() -> list[Tracker]:
    """Ours, then OpenCV's, those that this installation has."""
    return [*ours(), *rivals()]


def ours(modes: tuple[str, ...] = MODES, **options: Any) -> Iterator[Tracker]:
    """Our methods; none where jacoflow has no trackers."""
    try:
        from jacoflow import reference, track
    except ImportError:
        return
    kinds = {"layered": track.GradientTracker}
    if has_reference():
        kinds |= {mode: partial(reference.ReferenceTracker, method=mode) for mode in ("local", "paper")}

    def runner(mode: str) -> Callable[[Frames, Box], Track]:
        return lambda frames, box: _run_ours(kinds[mode], frames, box, options)

    for mode in modes:
        if mode in kinds:
            yield Tracker(f"jacoflow {mode}", runner(mode))


def has_reference() -> bool:
    """Whether jacoflow was built with the feature `reference`: the loop of the tracker's source."""
    from jacoflow import _jacoflow

    return hasattr(_jacoflow, "_reference_tracker")


def _run_ours(kind: Any, frames: Frames, box: Box, options: dict[str, Any]) -> Track:
    """One of our trackers through the frames."""
    results: list[Any] = []

    def work() -> None:
        tracker = kind(frames[0], bbox=box, **options)
        results.extend(tracker.update(frame) for frame in frames[1:])

    time = timing.once(work)

    def column(name: str, first: Any) -> Array:
        return np.array([first, *(getattr(result, name) for result in results)], float)

    centre = (box[0] + box[2] / 2, box[1] + box[3] / 2)
    return Track(
        boxes=column("box", box),
        displacements=column("displacement", (np.nan, np.nan)),
        velocities=column("velocity", (0.0, 0.0)),
        windows=column("window_center", centre) if hasattr(results[0], "window_center") else None,
        scales=column("scale", 1.0),
        rotations=column("rotation", 0.0),
        milliseconds=1000 * time.busiest / (len(frames) - 1),
    )


def rivals() -> Iterator[Tracker]:
    """OpenCV's trackers, on the frames as they are and enlarged."""
    if cv2 is None:
        return
    cv2.setNumThreads(1)
    for times in (1, TIMES_LARGER):
        for name in RIVALS if times == 1 else ENLARGED:
            create = creator(name)
            if create is not None:
                yield Tracker(f"OpenCV {name}" + (f" {times}x" if times > 1 else ""), _runner(create, times))


def creator(name: str) -> Callable[[], Any] | None:
    """What makes the tracker: in the main name space, or among the older ones; None where this OpenCV has
    neither."""
    for place in (cv2, getattr(cv2, "legacy", None)):
        create = getattr(place, f"Tracker{name}_create", None)
        if create is not None:
            return create
    return None


def _runner(create: Callable[[], Any], times: int) -> Callable[[Frames, Box], Track]:
    """Its run over whole sequences."""
    return lambda frames, box: _run_rival(create, times, frames, box)


def _run_rival(create: Callable[[], Any], times: int, frames: Frames, box: Box) -> Track:
    """One of OpenCV's trackers through the frames. Enlarging them is not counted in its time; where it
    reports a failure or raises an error its last box stands."""
    # They expect colour.
    pictures = [cv2.cvtColor(_enlarged(frame, times), cv2.COLOR_GRAY2BGR) for frame in frames]
    boxes = [box]

    def work() -> None:
        cv2.setRNGSeed(1)
        tracker = create()
        try:
            tracker.init(pictures[0], to_opencv(box, times))
        except cv2.error:
            boxes.extend([box] * (len(pictures) - 1))
            return
        for picture in pictures[1:]:
            boxes.append(next_box(tracker, picture, times) or boxes[-1])

    time = timing.once(work)
    track = np.array(boxes, float)
    centres = track[:, :2] + track[:, 2:] / 2
    return Track(
        track, np.diff(centres, axis=0, prepend=np.nan), milliseconds=1000 * time.busiest / (len(frames) - 1)
    )


def next_box(tracker: Any, picture: Frames, times: int) -> Box | None:
    """The box in the next picture."""
    try:
        found, box = tracker.update(picture)
    except cv2.error:
        return None
    return from_opencv(box, times) if found else None


def _enlarged(frame: Frames, times: int) -> Frames:
    """A frame enlarged by cubic interpolation."""
    return frame if times == 1 else cv2.resize(frame, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)


def to_opencv(box: Box, times: int = 1) -> tuple[int, int, int, int]:
    """Our box as OpenCV's: whole pixels, counted from the corner of the first pixel and not from its
    centre."""
    x, y, width, height = (
        int(np.floor(times * each + 0.5)) for each in (box[0] + 0.5, box[1] + 0.5, box[2], box[3])
    )
    return x, y, width, height


def from_opencv(box: Any, times: int = 1) -> Box:
    """OpenCV's box as ours."""
    x, y, width, height = (float(each) / times for each in box)
    return x - 0.5, y - 0.5, width, height
