"""Trackers: a moving target followed from frame to frame, with its velocity, size, angle and how far each can
be trusted.

`GradientTracker` follows one target in grey frames, `ParticleTracker` several that may look alike in colour
frames, `StereoTracker` everything that moves before two cameras. Grey frames are arrays (H, W), colour frames
(H, W, 3) of uint8, uint16, float32 or float64; positions are (x, y) in px, x right, y down, times in frames.

>>> import numpy as np
>>> from jacoflow.track import GradientTracker
>>> frames = np.full((6, 64, 64), 90, np.uint8)
>>> for t in range(6):
...     frames[t, 20:33, 20 + t : 33 + t] = 200
>>> tracker = GradientTracker(frames[0], bbox=(19.5, 19.5, 13, 13))
>>> for frame in frames[1:]:
...     result = tracker.update(frame)
>>> result.status, result.position.round(1).tolist()
('tracking', [31.0, 26.0])
"""

from __future__ import annotations

import operator
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._brief import Brief, columns
from ._checks import known_options, numbers, real_number, word
from ._jacoflow import _detect_moving_target, _GaussMarkovFilter, _GradientTracker
from ._particle_track import ParticleCorners, ParticleStep, ParticleTracker
from ._particle_tracks import ParticleTrack, ParticleTracks, track_particles
from ._stereo_options import StereoCamera
from ._stereo_track import StereoCluster, StereoStep, StereoTrack, StereoTracker, TrackGraph

__all__ = [
    "GaussMarkovFilter",
    "GradientTracker",
    "MovingTarget",
    "ParticleCorners",
    "ParticleStep",
    "ParticleTrack",
    "ParticleTracker",
    "ParticleTracks",
    "StereoCamera",
    "StereoCluster",
    "StereoStep",
    "StereoTrack",
    "StereoTracker",
    "Track",
    "TrackGraph",
    "TrackResult",
    "detect_moving_target",
    "track",
    "track_particles",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class TrackResult(Brief):
    """The target at one frame. Lengths in px, times in frames; NaN where nothing was measured."""

    position: Array
    """Filtered centre (x, y), px."""
    velocity: Array
    """Filtered velocity in the picture, (2,), px/frame."""
    acceleration: Array
    """Filtered acceleration, (2,), px/frame^2."""
    scene_velocity: Array
    """Velocity relative to the scene, (2,), px/frame."""
    camera_motion: Array
    """How far the still scene moved in the picture since the frame before, (2,), px."""
    covariance: Array
    """Covariance of position, velocity and acceleration along x and along y, (2, 3, 3), px and frames."""
    displacement: Array
    """Measured step since the frame before, unfiltered, (2,), px."""
    box: Array
    """Upright box (x, y, width, height), px, with x = centre - width / 2."""
    scale: float
    """Size over that in the first frame, no unit."""
    rotation: float
    """Angle turned since the first frame, rad, clockwise on the screen, not wrapped."""
    rotation_observable: bool
    """Whether the picture determines the rotation; else it is held (no unit)."""
    visibility: float
    """Share of the target that is seen, 0 to 1, no unit."""
    status: str
    """"tracking", "occluded", "coasting" (not seen), "out" (beyond the border) or "lost" (not seen for 15
    frames)."""
    reason: str
    """Why the status is what it is; empty if there is nothing to be said (no unit)."""
    reacquired: bool
    """Whether this is the first measurement after the target was lost or out of the picture (no unit)."""
    innovation: float
    """Normalised innovation squared of the position, both axes together, no unit."""
    gain: float
    """Brightness over that in the first frame, no unit."""
    frame: int
    """Index of the frame, counted from the one the tracker began with (no unit)."""


@dataclass(frozen=True, eq=False, repr=False)
class Track(Brief):
    """A target through a sequence: as `TrackResult`, each with a leading axis of T frames; frame 0 is the one
    the tracker began with. Lengths in px."""

    results: tuple[TrackResult, ...]
    """One for each of the T frames."""

    def __len__(self) -> int:
        return len(self.results)

    def __iter__(self) -> Iterator[TrackResult]:
        return iter(self.results)

    def table(self) -> dict[str, NDArray[Any]]:
        """A column (T,) for each number of a frame, as for `pandas.DataFrame(track.table())`, in the units of
        `TrackResult`; those of an array end in their indices: `box_0` to `box_3`."""
        names = [field.name for field in fields(self.results[0])]
        return columns({name: getattr(self, name) for name in names})

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in {field.name for field in fields(self.results[0])}:
            raise AttributeError(name)
        return np.array([getattr(result, name) for result in self.results])


class GradientTracker:
    """Follows one target by the gradient equation.

    Source: M. Chiba and S. Ozawa, "A Tracking Algorithm for a Video Target Using Gradient-Based Method"
    (IPSJ). It is deterministic and keeps bounded memory; several targets are several trackers. It pickles,
    also in mid-stream, with what it has learned of the scene: several planes as large as the frame.

    Parameters
    ----------
    frame : array (H, W) of uint8, uint16, float32 or float64
        The first frame, at least 16 x 16 px. It may be masked (numpy.ma), as all frames. Brightness is taken
        on the scale 0 to 255: uint16 is divided by 257 (samples of 10 to 14 bits must be shifted up first),
        floats are taken for shares of white unless at least half of what is not dark (above 0.1) exceeds 1.5,
        in this frame or a later one.
    bbox : (x, y, width, height), px
        The target's box in it, with x = centre - width / 2; sides of at least 3 px and at most twice the
        frame's; it may reach over the border.
    center : (x, y), px
        In place of a box: a point on the target; it is found as soon as it moves. With neither, the target is
        the first object that moves; until then the status is "lost".
    model : "similarity" or "affine"
        How the target's picture deforms: rotation and scale (default; stretching only where its outline needs
        it), or stretching as well.
    camera : "auto" or "none"
        Whether the camera may move (default) or stands still, which is faster.

    Raises
    ------
    ValueError
        For a first frame that is too small, not two-dimensional or mostly not finite, a box that is too
        small, wholly outside or more than half masked, and options out of range; each message names the
        argument.
    TypeError
        For another dtype.
    """

    def __init__(
        self,
        frame: ArrayLike,
        bbox: ArrayLike | None = None,
        *,
        center: ArrayLike | None = None,
        model: str = "similarity",
        camera: str = "auto",
    ) -> None:
        box, point = _numbers("bbox", bbox, "(x, y, width, height)", 4), _numbers("center", center, "(x, y)", 2)
        self._tracker = _GradientTracker(_frame(frame), box, point, _word("model", model), _word("camera", camera))

    def update(self, frame: ArrayLike) -> TrackResult:
        """The target in the next frame, an array (H, W) as large as the first. Where samples are masked, NaN,
        infinite or beyond 1e9 grey levels the target is hidden; a frame with more than half of these counts
        as one in which it was not seen.

        So does a frame whose still scene has nothing to do with that of the frame before (far too bright, or
        noise): nothing is learned from it. After ten in a row the scene is taken as it is. A constant of more
        than 64 grey levels that is added to a whole frame is taken off.

        Raises
        ------
        ValueError
            For a frame of another size, naming `frame`.
        """
        return TrackResult(**self._tracker.update(_frame(frame)))

    @property
    def result(self) -> TrackResult:
        """The target at the last frame; lengths in px."""
        return TrackResult(**self._tracker.state())


def _frame(frame: ArrayLike) -> NDArray[Any]:
    """A frame as an array; a masked one stays what it is, and is refused."""
    return frame if isinstance(frame, np.ndarray) else np.asarray(frame)


_WORDS = {
    "method": '"local" or "paper"',
    "control": '"integer" or "subpixel"',
    "model": '"similarity" or "affine"',
    "camera": '"auto" or "none"',
    "measures": '"mean" or "instant"',
}
"""Arguments that take a word, and the words."""
_SWITCHES = (bool, np.bool_)
"""They count as 0 and 1 in Python, and are no numbers here."""


def _word(name: str, value: Any) -> str:
    """One of the words of `_WORDS`."""
    return word(name, value, _WORDS[name])


def _whole(name: str, value: Any) -> int:
    """An integer of any size; the compiled part refuses what is too large."""
    try:
        if isinstance(value, _SWITCHES):
            raise TypeError
        return operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected an integer, got {value!r}") from None


def _real(name: str, value: Any) -> float:
    """A number that is not a switch."""
    if isinstance(value, _SWITCHES):
        raise TypeError(f"{name}: expected a number, got {value!r}")
    return real_number(name, value)


def _numbers(name: str, value: ArrayLike | None, expected: str, count: int) -> list[float] | None:
    """A short list of numbers."""
    return None if value is None else _needed(name, value, expected, count)


def _needed(name: str, value: ArrayLike | None, expected: str, count: int) -> list[float]:
    """A short list of numbers that must be there."""
    checked: list[float] = numbers(name, value, expected, (count,)).tolist()
    if any(isinstance(each, _SWITCHES) for each in np.asarray(value, object)):
        raise ValueError(f"{name}: expected {expected}, got {value!r}")
    return checked


def track(frames: Iterable[ArrayLike], bbox: ArrayLike | None = None, **options: Any) -> Track:
    """Follows a target through frames (T, H, W), or any iterable of frames (H, W), from its box (x, y, width,
    height), px, in the first.

    Options are those of `GradientTracker`. The result has T entries.
    """
    return _follow(GradientTracker, frames, bbox, options)


def _follow(kind: type[GradientTracker], frames: Iterable[ArrayLike], bbox: ArrayLike | None, options: dict[str, Any]) -> Track:
    """A tracker of a kind through frames."""
    known_options("track", kind, options)
    if isinstance(frames, (str, os.PathLike)):
        raise TypeError(f"frames: expected frames, got the name of a file ({frames}); open it with jacoflow.io.frames(path)")
    try:
        rest = iter(frames)
    except TypeError:
        raise TypeError(f"frames: expected an array (T, H, W) or an iterable of frames (H, W), got {type(frames).__name__}") from None
    try:
        first = next(rest)
    except StopIteration:
        raise ValueError("frames: expected at least one frame, got none") from None
    tracker = kind(first, bbox, **options)
    return Track((tracker.result, *(tracker.update(frame) for frame in rest)))


@dataclass(frozen=True, eq=False, repr=False)
class MovingTarget(Brief):
    """The first object that moves; lengths in px."""

    box: Array
    """Its box (x, y, width, height) in the second frame, px."""
    displacement: Array
    """How far it moved, (2,), whole px."""


def detect_moving_target(first: ArrayLike, second: ArrayLike, center: ArrayLike | None = None) -> MovingTarget | None:
    """Finds what moves between two frames (H, W) of a still scene: the largest object, or the one nearest to
    `center` (x, y), px; None where nothing moves.

    Changed pixels differ by more than three deviations of the noise; the displacement, at most 10 px along
    each axis, is the smallest that explains them nearly best.

    Raises `ValueError` for frames of different size.
    """
    found = _detect_moving_target(_frame(first), _frame(second), _numbers("center", center, "(x, y)", 2))
    return None if found is None else MovingTarget(*(np.array(part) for part in found))


class GaussMarkovFilter:
    """Position, velocity and acceleration of a point, each axis by itself; the acceleration is a first-order
    Gauss-Markov sequence.

    Source: M. Chiba and S. Ozawa, equations (12) to (24): F = [1 1 1/2; 0 1 1; 0 0 alpha], Q = diag(0, 0, q),
    one frame a step.

    Parameters
    ----------
    position : (x, y), px
        Where the point is at first; it is taken to be at rest.
    alpha : float
        Correlation of the acceleration from frame to frame, above 0 and at most 1; default 0.8.
    q : float, (px/frame^2)^2
        Variance of what drives the acceleration; default 0.5.
    start : three variances, px and frames
        Of position, velocity and acceleration at first; default (1, 4, 1).
    measures : "mean" or "instant"
        What is measured as velocity: the mean since the frame before, x' - x''/(2 alpha) (default, what
        optical flow measures), or the velocity at the frame, as (24) is printed.

    Raises
    ------
    ValueError
        For numbers out of range; the message names the argument.

    Examples
    --------
    >>> point = GaussMarkovFilter((10, 5))
    >>> for t in range(1, 30):
    ...     point.predict()
    ...     nis = point.update(position=(10 + 2 * t, 5), velocity=(2, 0))
    >>> point.velocity.round(2).tolist()
    [2.0, 0.0]
    """

    def __init__(
        self, position: ArrayLike, *, alpha: float = 0.8, q: float = 0.5, start: ArrayLike = (1.0, 4.0, 1.0), measures: str = "mean"
    ) -> None:
        place, variances = _needed("position", position, "(x, y)", 2), _needed("start", start, "three variances", 3)
        self._filter = _GaussMarkovFilter(place, _real("alpha", alpha), _real("q", q), variances, _word("measures", measures))

    def __getstate__(self) -> dict[str, Any]:
        return self._filter.save()

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._filter = _GaussMarkovFilter((0.0, 0.0), state["alpha"], state["q"], (0.0, 0.0, 0.0), state["measures"])
        self._filter.restore(state["x"], state["p"])

    def predict(self) -> None:
        """Goes to the next frame (19)(20); the unit of time is the frame, lengths are in px."""
        self._filter.predict()

    def update(
        self,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        *,
        position_variance: ArrayLike = 1.0,
        velocity_variance: ArrayLike = 0.25,
    ) -> float:
        """Takes what was measured (16)-(18): a position (x, y), px, a velocity, px/frame, or both, with their
        variances (one number or one an axis).

        Returns the normalised innovation squared, both axes together: chi squared with as many degrees of
        freedom as numbers were measured. Raises `ValueError` for numbers that are not finite and variances
        that are not above 0.
        """
        return self._filter.update(
            _measured("position", position, position_variance), _measured("velocity", velocity, velocity_variance)
        )

    @property
    def position(self) -> Array:
        """Position (x, y), (2,), px."""
        return self._filter.state()[:, 0]

    @property
    def velocity(self) -> Array:
        """Velocity, (2,), px/frame."""
        return self._filter.state()[:, 1]

    @property
    def acceleration(self) -> Array:
        """Acceleration, (2,), px/frame^2."""
        return self._filter.state()[:, 2]

    @property
    def covariance(self) -> Array:
        """Covariance of position, velocity and acceleration along x and along y, (2, 3, 3), px and frames."""
        return self._filter.covariance()


def _measured(name: str, value: ArrayLike | None, variance: ArrayLike) -> tuple[list[float], list[float]] | None:
    """Values and variances of both axes."""
    values = _numbers(name, value, "one number an axis", 2)
    if values is None:
        return None
    expected = "one variance, or one an axis"
    if np.ndim(variance) == 0:
        return values, 2 * _needed(f"{name}_variance", np.atleast_1d(np.asarray(variance)), expected, 1)
    return values, _needed(f"{name}_variance", variance, expected, 2)
