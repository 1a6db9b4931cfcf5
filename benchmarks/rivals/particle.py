"""Trackers of several targets in colour frames under one roof: the particle tracker, and OpenCV's, one for
each target."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.rivals.trackers import Box, creator, cv2, next_box, to_opencv
from benchmarks.scenes.particle_recordings import Sequence

Array = NDArray[np.float64]
Frames = NDArray[np.uint8]
RIVALS = ("CSRT", "KCF", "MIL", "MedianFlow")
"""OpenCV's trackers that need no trained network."""


@dataclass(frozen=True)
class Contestant:
    """A tracker by name."""

    name: str
    follow: Callable[[Sequence, int], Array]
    """Boxes (T, K, 4) of a sequence's targets with a seed; NaN before the start, where it reports none and
    from where the centre has left the picture on."""
    random: bool = False
    """Whether the seed matters."""


@dataclass(frozen=True)
class Settings:
    """Options of the particle tracker, by a name."""

    name: str
    mode: str
    options: dict[str, Any] = field(default_factory=dict)

    def contestant(self) -> Contestant:
        """The tracker with these options."""
        return Contestant(self.name, self._follow, random=True)

    def _follow(self, sequence: Sequence, seed: int) -> Array:
        """The tracker's boxes; targets are added in the frame in which they start."""
        from jacoflow.track import ParticleTracker

        boxes, starts = np.full(sequence.boxes.shape, np.nan), sequence.starts
        first = int(starts.min())
        begun = {k: sequence.boxes[first, k] for k in np.flatnonzero(starts == first).tolist()}
        tracker = ParticleTracker(
            sequence.frames[first], begun, mode=self.mode, random_state=seed, **self.options
        )
        boxes[first, list(begun)] = sequence.boxes[first, list(begun)]
        ended: set[int] = set()
        for t in range(first + 1, len(sequence.frames)):
            step = tracker.update(sequence.frames[t])
            for k, box, status in zip(step.ids, step.boxes, step.status, strict=True):
                # A target that is out of the picture has ended, even if it comes back.
                ended |= {int(k)} if str(status) == "out" else set()
                if int(k) not in ended and str(status) != "lost":
                    boxes[t, int(k)] = box
            for k in np.flatnonzero(starts == t).tolist():
                tracker.add(sequence.boxes[t, k], k)
                boxes[t, k] = sequence.boxes[t, k]
        return boxes


def rivals(names: tuple[str, ...] = RIVALS) -> Iterator[Contestant]:
    """OpenCV's trackers, those that this installation has."""
    if cv2 is None:
        return
    cv2.setNumThreads(1)
    for name in names:
        create = creator(name)
        if create is not None:
            yield Contestant(f"OpenCV {name}", _rival(create))


def _rival(create: Callable[[], Any]) -> Callable[[Sequence, int], Array]:
    """Its run through a sequence, one tracker for each target."""

    def follow(sequence: Sequence, seed: int) -> Array:
        del seed
        # OpenCV's order of channels.
        pictures = [np.ascontiguousarray(frame[..., ::-1]) for frame in sequence.frames]
        tracks = [_follow_one(create, sequence, pictures, k) for k in range(sequence.boxes.shape[1])]
        return np.stack(tracks, axis=1)

    return follow


def _follow_one(create: Callable[[], Any], sequence: Sequence, pictures: list[Frames], target: int) -> Array:
    """Boxes (T, 4) of one target."""
    boxes, start = np.full((len(pictures), 4), np.nan), int(sequence.starts[target])
    x, y, width, height = sequence.boxes[start, target].tolist()
    boxes[start] = x, y, width, height
    tracker = _begun(create, pictures[start], (x, y, width, height))
    for t in range(start + 1, len(pictures)):
        box = next_box(tracker, pictures[t], 1)
        if box is None:
            continue
        if not sequence.contains(np.array(box)):
            break
        boxes[t] = box
    return boxes


def _begun(create: Callable[[], Any], picture: Frames, box: Box) -> Any:
    """A tracker that has been given its target; where it refuses a box that is partly outside, the part in
    the picture."""
    left, top, width, height = to_opencv(box)
    right, bottom = min(left + width, picture.shape[1]), min(top + height, picture.shape[0])
    inside = (max(left, 0), max(top, 0), right - max(left, 0), bottom - max(top, 0))
    cv2.setRNGSeed(1)
    try:
        tracker = create()
        tracker.init(picture, (left, top, width, height))
    except cv2.error:
        tracker = create()
        tracker.init(picture, inside)
    return tracker
