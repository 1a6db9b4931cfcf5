"""Recorded sequences with boxes of their targets, for trackers."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.recordings import from_corner_1, read_boxes, read_grey, read_video
from benchmarks.scenes.tracking import Truth

try:
    import cv2
except ImportError:
    cv2 = None

LONG_ENOUGH = 40
"""Targets that are in fewer frames are left out."""


@dataclass(frozen=True)
class Recording:
    """Grey frames from the first in which the target is seen, and its boxes."""

    name: str
    frames: NDArray[np.uint8]
    """(T, H, W)."""
    truth: Truth

    @property
    def start_box(self) -> tuple[float, float, float, float]:
        """The box in the first frame: x, y, width, height, px."""
        x, y, width, height = (float(each) for each in self.truth.boxes[0])
        return x, y, width, height


def read_all(data: Path) -> Iterator[Recording | str]:
    """What the folder holds; a line that says why for what cannot be read."""
    for name, read in (("Crossing", crossing), ("TUD-Campus", campus)):
        try:
            yield from read(data)
        except OSError as problem:
            yield f"{name}: {problem.strerror or type(problem).__name__}"


def crossing(data: Path) -> Iterator[Recording]:
    """A pedestrian of low contrast: folder `track_otb/Crossing`."""
    folder = data / "track_otb" / "Crossing"
    boxes = read_boxes(folder / "groundtruth_rect.txt")
    frames = np.stack([read_grey(folder / "img" / f"{k + 1:04d}.jpg") for k in range(len(boxes))])
    yield Recording("Crossing", frames, _truth(boxes))


def campus(data: Path) -> Iterator[Recording]:
    """Pedestrians who hide each other before a still camera, one recording each: folder
    `track_mot15/TUD-Campus`."""
    folder = data / "track_mot15" / "TUD-Campus"
    boxes: dict[int, dict[int, list[float]]] = {}
    with (folder / "gt" / "gt.txt").open(newline="") as file:
        for row in csv.reader(file):
            boxes.setdefault(int(row[1]), {})[int(row[0]) - 1] = [float(each) for each in row[2:6]]
    frames = np.stack(
        [cv2.cvtColor(each, cv2.COLOR_BGR2GRAY) for each in read_video(folder / "TUD-Campus.mp4")]
    )
    for target, seen in sorted(boxes.items()):
        if len(seen) >= LONG_ENOUGH:
            first, last = min(seen), max(seen)
            known = np.array([seen.get(t, [np.nan] * 4) for t in range(first, last + 1)])
            yield Recording(f"TUD-Campus {target}", frames[first : last + 1], _truth(known))


def moving(data: Path) -> Iterator[Recording]:
    """Two joggers and a car before a moving camera: folders `track_otb/jogging` and `track_tlp/CarChase2`."""
    joggers, car = data / "track_otb" / "jogging", data / "track_tlp" / "CarChase2"
    tracks = [(joggers, read_boxes(path)) for path in sorted(joggers.glob("groundtruth_rect*.txt"))]
    if (path := car / "groundtruth_rect.txt").exists():
        tracks.append((car, read_boxes(path)[:, 1:5]))
    for folder, boxes in tracks:
        frames = [read_grey(path) for path in sorted((folder / "img").glob("[0-9]*.jpg"))[: len(boxes)]]
        if frames:
            yield Recording(folder.name, np.stack(frames), _truth(boxes[: len(frames)]))


def _truth(boxes: NDArray[np.floating]) -> Truth:
    """The truth from boxes (T, 4) whose corner is counted from 1, to the corner of the first pixel; NaN
    where there is none."""
    ours = from_corner_1(boxes)
    return Truth(ours, np.isfinite(ours).all(axis=1) & (np.arange(len(ours)) > 0))
