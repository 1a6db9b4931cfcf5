"""Targets followed by particle filters through a whole sequence."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._brief import Brief, Rows
from ._checks import known_options, path_of
from ._jacoflow import _write_particle_tracks
from ._particle_options import checked_box, checked_boxes, checked_id
from ._particle_track import Array, ParticleStep, ParticleTracker
from ._progress import Line

Progress = Callable[[int, int], object] | bool | None
Starts = dict[int, list[tuple[int, list[float]]]]


@dataclass(frozen=True, eq=False, repr=False)
class ParticleTrack(Rows):
    """One target through all T frames, in px; NaN (or "", -1, False) in frames in which it is not followed.
    """

    _ROWS = ("present", "boxes", "position", "velocity", "size", "covariance", "effective_sample_size", "similarity", "n_tracks", "degenerate", "status", "reason")

    id: int
    """Its number (no unit)."""
    present: NDArray[np.bool_]
    """Whether it is followed, (T,), no unit."""
    boxes: Array
    """Left, top, width, height, (T, 4), px."""
    position: Array
    """Centre, (T, 2), px."""
    velocity: Array
    """Velocity relative to the scene, (T, 2), px/frame."""
    size: Array
    """Width and height, (T, 2), px."""
    covariance: Array
    """Covariance of the particles, (T, 6, 6), px and frames."""
    effective_sample_size: Array
    """(T,), particles."""
    similarity: Array
    """Likeness of the colours, 0 to 1, (T,), no unit."""
    n_tracks: NDArray[np.int64]
    """Corner tracks that belong to it, (T,), no unit."""
    degenerate: NDArray[np.bool_]
    """Whether no particle had a weight, (T,), no unit."""
    status: tuple[str, ...]
    """T words, as `ParticleStep.status` (no unit)."""
    reason: tuple[str, ...]
    """T reasons (no unit)."""

    def __len__(self) -> int:
        return len(self.present)


@dataclass(frozen=True, eq=False, repr=False)
class ParticleTracks(Brief):
    """The steps of a sequence of T frames, a list of them that cannot be changed; lengths in px. It pickles.
    """

    steps: tuple[ParticleStep, ...]
    """One for each of the T frames."""

    def __len__(self) -> int:
        return len(self.steps)

    def __iter__(self) -> Iterator[ParticleStep]:
        return iter(self.steps)

    @overload
    def __getitem__(self, at: int) -> ParticleStep: ...
    @overload
    def __getitem__(self, at: slice) -> tuple[ParticleStep, ...]: ...
    def __getitem__(self, at: int | slice) -> ParticleStep | tuple[ParticleStep, ...]:
        return self.steps[at]

    @property
    def ids(self) -> NDArray[np.int64]:
        """Numbers of all targets that occur, ascending, (n,), no unit."""
        numbers: NDArray[np.int64] = np.unique(np.concatenate([np.zeros(0, np.int64), *(step.ids for step in self.steps)]))
        return numbers

    def track(self, id: int) -> ParticleTrack:
        """One target through all T frames, lengths in px. ValueError for an `id` that does not occur."""
        places = [np.flatnonzero(step.ids == checked_id(id)) for step in self.steps]
        present = np.array([len(place) > 0 for place in places], bool)
        if not present.any():
            known = ", ".join(str(number) for number in self.ids)
            raise ValueError(f"id: expected a target that occurs ({known}), got {id}")
        steps = [(t, step, int(place[0])) for t, (step, place) in enumerate(zip(self.steps, places, strict=True)) if len(place)]

        def gathered(name: str, missing: Any) -> NDArray[Any]:
            first = getattr(steps[0][1], name)
            values = np.full((len(self), *first.shape[1:]), missing, first.dtype)
            for t, step, at in steps:
                values[t] = getattr(step, name)[at]
            return values

        def words(name: str) -> tuple[str, ...]:
            found = {t: getattr(step, name)[at] for t, step, at in steps}
            return tuple(found.get(t, "") for t in range(len(self)))

        numbers = ("boxes", "position", "velocity", "size", "covariance", "effective_sample_size", "similarity")
        return ParticleTrack(
            id=int(id),
            present=present,
            n_tracks=gathered("n_tracks", -1),
            degenerate=gathered("degenerate", False),
            status=words("status"),
            reason=words("reason"),
            **{name: gathered(name, np.nan) for name in numbers},
        )

    def save_mot(self, path: str | os.PathLike[str]) -> None:
        """Writes the boxes in the form of the MOT challenge: lines frame, id, left, top, width, height,
        confidence, -1, -1, -1, px.

        Frames and pixels are counted from 1. The confidence is 0 while a target is hidden; one that is out or
        lost has no line. As the command line's `--mot`.
        """
        self._write(path, "mot")

    def save_csv(self, path: str | os.PathLike[str]) -> None:
        """Writes everything, a row a target and frame, as the command line's `--csv`: positions in px,
        velocities in px/frame; frames are counted from 0.
        """
        self._write(path, "csv")

    def _write(self, path: str | os.PathLike[str], form: str) -> None:
        _write_particle_tracks(path_of("path", path), form, [step._compiled for step in self.steps])


def track_particles(
    frames: Iterable[ArrayLike],
    boxes: ArrayLike | Mapping[int, ArrayLike] | Mapping[int, Mapping[int, ArrayLike]],
    *,
    progress: Progress = None,
    keep_frames: bool = False,
    keep_particles: bool = False,
    **options: Any,
) -> ParticleTracks:
    """Follows targets through colour frames (T, H, W, 3), or any iterable of such frames (H, W, 3).

    `boxes`: those of the targets in the first frame, as `ParticleTracker` takes them, px; or {frame: {id:
    box}} for targets that start later, frames counted from 0. Options are those of `ParticleTracker`.
    `progress`: None is silent, True draws a line on standard error, a function is called with (done, total)
    frames, total 0 where it is not known. Ctrl-C stops between frames. `keep_frames`: whether steps keep
    their frame, so that `foreground` and `segments` can be had: a frame's memory each. `keep_particles`:
    whether they keep the particles, 56 bytes each.

    Raises
    ------
    ValueError
        As `ParticleTracker`, and for no frames and starts at frames that there are not.

    Warns
    -----
    UserWarning
        Where an iterable of unknown length ends before a target's start.
    """
    known_options("track_particles", ParticleTracker, options)
    starts = _starts(boxes)
    total = _length(frames)
    last_start = max(starts, default=0)
    if total and last_start >= total:
        raise ValueError(f"boxes: expected frames from 0 to {total - 1}, got {last_start}")
    report = _reporter(progress)
    steps: list[ParticleStep] = []
    tracker: ParticleTracker | None = None
    for t, frame in enumerate(_iterator(frames)):
        begin = starts.get(t, [])
        if tracker is None:
            tracker = ParticleTracker(frame, dict(begin), **options)
            step = tracker.step
        else:
            step = tracker.update(frame)
            for number, box in begin:
                tracker.add(box, number)
            step = tracker.step if begin else step
        steps.append(step.without(frame=not keep_frames, particles=not keep_particles))
        report(len(steps), total)
    if not steps:
        raise ValueError("frames: expected at least one frame, got none")
    if not total:
        report(len(steps), len(steps))
    if last_start >= len(steps):
        warnings.warn(f"boxes: a target starts at frame {last_start}, but there are {len(steps)} frames", UserWarning, stacklevel=2)
    return ParticleTracks(tuple(steps))


def _starts(boxes: Any) -> Starts:
    """Targets and their boxes, px, by the frame in which they start."""
    if not (isinstance(boxes, Mapping) and boxes and all(isinstance(value, Mapping) for value in boxes.values())):
        return {0: checked_boxes(boxes)}
    starts: Starts = {}
    for frame, targets in boxes.items():
        if isinstance(frame, bool) or not isinstance(frame, int | np.integer) or frame < 0:
            raise ValueError(f"boxes: expected frames counted from 0, got {frame!r}")
        starts[int(frame)] = sorted((checked_id(number), checked_box("boxes", box)) for number, box in targets.items())
    return starts


def _length(frames: Any) -> int:
    """Number of frames; 0 where it is not known before they came."""
    try:
        return len(frames)
    except TypeError:
        return 0


def _iterator(frames: Any) -> Iterator[Any]:
    try:
        return iter(frames)
    except TypeError:
        raise TypeError(f"frames: expected an array (T, H, W, 3) or an iterable of frames (H, W, 3), got {type(frames).__name__}") from None


def _reporter(progress: Progress) -> Callable[[int, int], object]:
    """What is called with (done, total) frames."""
    if progress is None or progress is False:
        return lambda done, total: None
    if progress is True:
        return Line()
    if not callable(progress):
        raise TypeError(f"progress: expected None, True or a function of (done, total), got {type(progress)}")
    return progress
