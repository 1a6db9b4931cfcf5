"""Colour recordings with boxes of their targets, for the particle tracker."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.recordings import from_corner_1, read_boxes, read_video

try:
    import cv2
except ImportError:
    cv2 = None

Array = NDArray[np.float64]
Frames = NDArray[np.uint8]
CAMPUS, OTB = "TUD-Campus", "track_otb"
"""The recording of several people, and the folder of those of the tracking benchmark by Wu, Lim and Yang."""


@dataclass(frozen=True)
class Sequence:
    """Colour frames and the true boxes of their targets."""

    name: str
    frames: Frames
    """(T, H, W, 3), red, green and blue."""
    boxes: Array
    """(T, K, 4), left, top, width, height, px, with left = centre - width / 2; NaN where a target has no
    truth."""

    @property
    def starts(self) -> NDArray[np.intp]:
        """(K,), the first frame in which each target has a true box: trackers get that box."""
        return np.isfinite(self.boxes).all(axis=-1).argmax(axis=0)

    def contains(self, box: Array) -> bool:
        """Whether the centre of a box is in the picture."""
        x, y = box[:2] + box[2:] / 2
        height, width = self.frames.shape[1:3]
        return bool(-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5)


def campus(data: Path) -> Sequence | None:
    """Eight people who hide each other before a still camera: folder `track_mot15/TUD-Campus`, 640 x 480;
    None where it is missing."""
    folder = data / "track_mot15" / CAMPUS
    if cv2 is None or not (folder / "gt" / "gt.txt").exists():
        return None
    frames = np.ascontiguousarray(read_video(folder / f"{CAMPUS}.mp4")[..., ::-1])
    with (folder / "gt" / "gt.txt").open(newline="") as file:
        lines = [[float(each) for each in row[:6]] for row in csv.reader(file)]
    boxes = np.full((len(frames), int(max(line[1] for line in lines)), 4), np.nan)
    for frame, target, *box in lines:
        boxes[int(frame) - 1, int(target) - 1] = box
    return Sequence(CAMPUS, frames, from_corner_1(boxes))


def halved(sequence: Sequence) -> Sequence:
    """At half the size, each pixel the mean of four."""
    height, width = sequence.frames.shape[1:3]
    frames = [
        cv2.resize(frame, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
        for frame in sequence.frames
    ]
    # Pixel centres lie at integers: the corner of the first pixel, at -0.5, stays where it is.
    boxes = np.concatenate([(sequence.boxes[..., :2] + 0.5) / 2 - 0.5, sequence.boxes[..., 2:] / 2], axis=-1)
    return Sequence(sequence.name, np.stack(frames), boxes)


def single(data: Path) -> Iterator[Sequence]:
    """The recordings in `track_otb`: a folder of pictures each, and a file of boxes for each target."""
    if cv2 is None:
        return
    for folder in sorted(data.glob(f"{OTB}/*/")):
        pictures = sorted((folder / "img").glob("[0-9]*.jpg"))
        tracks = [read_boxes(path)[: len(pictures)] for path in sorted(folder.glob("groundtruth_rect*.txt"))]
        if pictures and tracks:
            frames = np.stack([cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB) for path in pictures])
            count = min(len(frames), *(len(track) for track in tracks))
            yield Sequence(
                folder.name,
                frames[:count],
                from_corner_1(np.stack([track[:count] for track in tracks], axis=1)),
            )
