"""Trackers: a moving target followed from frame to frame, with its velocity, size, angle and how far each can be trusted.

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
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._jacoflow import _derivative_kernels, _detect_moving_target, _GaussMarkovFilter, _GradientTracker, _local_flow, _mean_flow
from ._particle_track import ParticleCorners, ParticleStep, ParticleTracker
from ._particle_tracks import ParticleTrack, ParticleTracks, track_particles
from ._stereo_options import StereoCamera, real_number
from ._stereo_track import StereoCluster, StereoStep, StereoTrack, StereoTracker, TrackGraph

__all__ = [
    "GaussMarkovFilter",
    "GradientTracker",
    "MeanFlow",
    "MovingTarget",
    "ParticleCorners",
    "ParticleStep",
    "ParticleTrack",
    "ParticleTracker",
    "ParticleTracks",
    "PixelFlow",
    "StereoCamera",
    "StereoCluster",
    "StereoStep",
    "StereoTrack",
    "StereoTracker",
    "Track",
    "TrackGraph",
    "TrackResult",
    "derivative_kernels",
    "detect_moving_target",
    "local_flow",
    "mean_flow",
    "refine_flow",
    "track",
    "track_particles",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrackResult:
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
    """Whether the picture tells the rotation; else it is held (no unit)."""
    visibility: float
    """Share of the target that is seen, 0 to 1, no unit."""
    status: str
    """"tracking", "occluded", "coasting" (not seen), "out" (beyond the border) or "lost" (not seen for 15 frames)."""
    reason: str
    """Why the status is what it is; empty if there is nothing to be said (no unit)."""
    reacquired: bool
    """Whether this is the first measurement after the target was lost or out of the picture (no unit)."""
    innovation: float
    """Normalised innovation squared of the position, both axes together, no unit."""
    gain: float
    """Brightness over that in the first frame, no unit."""
    los: Array
    """Line of sight: middle of the window that is looked at, (2,), px."""
    n_flow: int
    """How many pixels' flow was used ("local" and "paper"), no unit."""
    frame: int
    """Index of the frame, counted from the one the tracker began with (no unit)."""


@dataclass(frozen=True, eq=False)
class Track:
    """A target through a sequence: as `TrackResult`, each with a leading axis of T frames; frame 0 is the one the tracker began with. Lengths in px."""

    results: tuple[TrackResult, ...]
    """One for each of the T frames."""

    def __len__(self) -> int:
        return len(self.results)

    def __iter__(self) -> Iterator[TrackResult]:
        return iter(self.results)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in {field.name for field in fields(TrackResult)}:
            raise AttributeError(name)
        return np.array([getattr(result, name) for result in self.results])


class GradientTracker:
    """Follows one target by the gradient equation.

    Source: M. Chiba and S. Ozawa, "A Tracking Algorithm for a Video Target Using Gradient-Based Method" (IPSJ). It is deterministic and keeps bounded memory; several targets are several trackers.
    It holds what it has learnt of the scene, several planes as large as the frame, and cannot be pickled; its results can.

    Parameters
    ----------
    frame : array (H, W) of uint8, uint16, float32 or float64
        The first frame, at least 16 x 16 px. Brightness is taken on the scale 0 to 255: uint16 is divided by 257 (samples of 10 to 14 bits must be shifted up first), floats are taken for shares of white unless at least half of what is not dark (above 0.1) exceeds 1.5, in this frame or a later one.
    bbox : (x, y, width, height), px
        The target's box in it, with x = centre - width / 2; sides of at least 3 px and at most twice the frame's; it may reach over the border.
    center : (x, y), px
        In place of a box: a point on the target; it is found as soon as it moves. With neither, the target is the first thing that moves; until then the status is "lost".
    method : "layered", "local" or "paper"
        "layered" (default): target and background as layers, one gradient step over the whole target from the filter's prediction. "local": the paper's loop (local flow in a window, its mean over what moves,
        a Gauss-Markov filter) with the repairs that it needs. "paper": its text to the letter, which loses targets on all but flat backgrounds.
    fov : int, px
        Side of the window that is looked at ("local", "paper"), made odd; default 51, or 1.6 times the longer side of the box where that is more.
    control : "integer" or "subpixel"
        Whether that window moves in whole pixels (default) or not.
    model : "similarity" or "affine"
        What the target's picture does besides moving ("layered"): turn and grow (default; stretched only where its outline is not explained otherwise), or be stretched as well.
    camera : "auto" or "none"
        Whether the camera may move ("layered", default) or stands still, which is faster.
    order : int
        Degree of the polynomials behind the derivatives, 1 to 4 ("local": 4, "paper": 2).
    window : int, px
        Side of the windows of local flow, 3, 5 or 7 ("local": 7, "paper": 5).
    eps : float or "auto", px/frame
        Slowest flow that counts as motion ("local", "paper"); default 0.5; "auto": three deviations of the flow outside the target, at least 0.3.

    Raises
    ------
    ValueError
        For a first frame that is too small, not two-dimensional or not finite, a box that is too small or wholly outside, and options out of range; each message names the argument.
    TypeError
        For another dtype.
    """

    def __init__(
        self,
        frame: ArrayLike,
        bbox: ArrayLike | None = None,
        *,
        center: ArrayLike | None = None,
        method: str = "layered",
        fov: int | None = None,
        control: str = "integer",
        model: str = "similarity",
        camera: str = "auto",
        order: int | None = None,
        window: int | None = None,
        eps: float | str = 0.5,
    ) -> None:
        box, point = _numbers("bbox", bbox, "(x, y, width, height)", 4), _numbers("center", center, "(x, y)", 2)
        words = [_word(name, value) for name, value in (("method", method), ("control", control), ("model", model), ("camera", camera))]
        mode, steering, shape, swing = words
        side, degree, windows = (
            None if value is None else _whole(name, value) for name, value in (("fov", fov), ("order", order), ("window", window))
        )
        if eps is None or (isinstance(eps, str) and eps != "auto"):
            raise ValueError(f'eps: expected a speed in px/frame or "auto", got {eps!r}')
        slowest = None if isinstance(eps, str) else _real("eps", eps)
        self._tracker = _GradientTracker(_frame(frame), box, point, mode, side, steering, shape, swing, degree, windows, slowest)

    def update(self, frame: ArrayLike) -> TrackResult:
        """The target in the next frame, an array (H, W) as large as the first; a frame with NaN, infinity or samples beyond 1e9 grey levels counts as one in which the target was not seen.

        So does, with "layered", a frame whose still scene has nothing to do with that of the frame before (far too bright, or noise): nothing is learnt from it. After ten in a row the scene is taken as it is. A constant
        of more than 64 grey levels that is added to a whole frame is taken off.

        Raises
        ------
        ValueError
            For a frame of another size, naming `frame`.
        """
        return TrackResult(**self._tracker.update(_frame(frame)))

    def __reduce__(self) -> NoReturn:
        raise TypeError("GradientTracker: expected its results or its last box to be kept, got a tracker to pickle; it holds the whole scene")

    @property
    def result(self) -> TrackResult:
        """The target at the last frame; lengths in px."""
        return TrackResult(**self._tracker.state())


def _frame(frame: ArrayLike) -> NDArray[Any]:
    """A frame as an array; a masked one stays what it is, and is refused."""
    return frame if isinstance(frame, np.ndarray) else np.asarray(frame)


_WORDS = {
    "method": '"layered", "local" or "paper"',
    "control": '"integer" or "subpixel"',
    "model": '"similarity" or "affine"',
    "camera": '"auto" or "none"',
    "measures": '"mean" or "instant"',
}
"""Arguments that take a word, and the words."""
_SWITCHES = (bool, np.bool_)
"""They count as 0 and 1 in Python, and are no numbers here."""


def _word(name: str, value: Any) -> str:
    """A word; which ones there are the compiled part checks."""
    if not isinstance(value, str):
        raise ValueError(f"{name}: expected {_WORDS[name]}, got {value!r}")
    return value


def _whole(name: str, value: Any) -> int:
    """An integer of any size; what is too large for it the compiled part tells."""
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
    try:
        array = None if value is None else np.asarray(value, float)
    except (TypeError, ValueError):
        array = None
    if array is None or _holds_switches(value):
        raise ValueError(f"{name}: expected {expected}, got {value!r}")
    if array.shape != (count,):
        raise ValueError(f"{name}: expected {expected}, got shape {array.shape}")
    return [float(number) for number in array]


def _holds_switches(value: Any) -> bool:
    """Whether True or False is among the numbers."""
    return any(isinstance(each, _SWITCHES) for each in np.asarray(value, object).ravel())


def track(frames: Iterable[ArrayLike], bbox: ArrayLike | None = None, **options: Any) -> Track:
    """Follows a target through frames (T, H, W), or any iterable of frames (H, W), from its box (x, y, width, height), px, in the first.

    Options are those of `GradientTracker`. The result has T entries.
    """
    try:
        rest = iter(frames)
    except TypeError:
        raise TypeError(f"frames: expected an array (T, H, W) or an iterable of frames (H, W), got {type(frames).__name__}") from None
    try:
        first = next(rest)
    except StopIteration:
        raise ValueError("frames: expected at least one frame, got none") from None
    tracker = GradientTracker(first, bbox, **options)
    return Track((tracker.result, *(tracker.update(frame) for frame in rest)))


def derivative_kernels(order: int) -> tuple[Array, Array, Array]:
    """Beaudet's masks (value, along x, along y), three arrays (5, 5) [row, column] = [y, x]: value and slopes (1/px) at the middle of a least-squares polynomial of total degree `order`, 1 to 4."""
    value, along_x, along_y = _derivative_kernels(_whole("order", order))
    return value, along_x, along_y


@dataclass(frozen=True, eq=False)
class PixelFlow:
    """Flow of single pixels of a frame (H, W), px/frame."""

    flow: Array
    """(H, W, 2), px/frame."""
    valid: NDArray[np.bool_]
    """(H, W), where it is accepted."""


def local_flow(
    first: ArrayLike, second: ArrayLike, *, window: int = 7, order: int = 4, cond_max: float = 10.0, min_sigma: float = 2.5, step_max: float = 4.0
) -> PixelFlow:
    """Flow of single pixels from a frame (H, W) to the next, one step from rest: M. Chiba and S. Ozawa, equations (1) to (8).

    `.flow` (H, W, 2) is in px/frame, `.valid` (H, W) tells where it is accepted: condition number of the gradients in the window (side `window` px) up to `cond_max`, weakest gradient at least `min_sigma` grey
    levels/px (and 0.7 times the frames' noise, unless it is 0), step up to `step_max` px.
    """
    return _flow_of_pixels(first, second, False, window=window, order=order, cond_max=cond_max, min_sigma=min_sigma, step_max=step_max)


def refine_flow(
    first: ArrayLike, second: ArrayLike, *, window: int = 7, order: int = 4, cond_max: float = 10.0, min_sigma: float = 2.5, step_max: float = 4.0
) -> PixelFlow:
    """As `local_flow`, refined by warping (9)(10) from pictures smoothed over 9 and 5 px to the frames (H, W) themselves; motions up to about 3 px."""
    return _flow_of_pixels(first, second, True, window=window, order=order, cond_max=cond_max, min_sigma=min_sigma, step_max=step_max)


def _flow_of_pixels(first: ArrayLike, second: ArrayLike, refined: bool, *, window: int, order: int, **limits: float) -> PixelFlow:
    """Flow from a frame (H, W) to the next, px/frame; each option is checked by its name."""
    sizes = _whole("window", window), _whole("order", order)
    numbers = (_real(name, value) for name, value in limits.items())
    return PixelFlow(*_local_flow(_frame(first), _frame(second), refined, *sizes, *numbers))


@dataclass(frozen=True, eq=False)
class MeanFlow:
    """What moves in a frame, px/frame, and where: M. Chiba and S. Ozawa, equation (11)."""

    velocity: Array
    """Mean flow (u, v) over the pixels that move, px/frame; zero where nothing does."""
    centroid: Array
    """Their mean place (x, y), px; NaN where nothing moves."""
    count: int
    """How many they are, no unit."""


def mean_flow(flow: PixelFlow, eps: float = 0.5) -> MeanFlow:
    """Mean over the valid pixels of a field (H, W) whose flow along x or along y is at least `eps` px/frame: one set for both axes (11).

    Raises `ValueError` for a negative `eps` and for arrays of another shape.
    """
    field, valid = np.ascontiguousarray(flow.flow, float), np.ascontiguousarray(flow.valid, bool)
    if field.ndim != 3 or field.shape[2] != 2:
        raise ValueError(f"flow: expected a field (H, W, 2), got shape {field.shape}")
    if valid.shape != field.shape[:2]:
        raise ValueError(f"valid: expected an array {field.shape[:2]} like the flow, got shape {valid.shape}")
    velocity, centroid, count = _mean_flow(field, valid, _real("eps", eps))
    return MeanFlow(np.array(velocity), np.array(centroid), count)


@dataclass(frozen=True, eq=False)
class MovingTarget:
    """The first thing that moves; lengths in px."""

    box: Array
    """Its box (x, y, width, height) in the second frame, px."""
    displacement: Array
    """How far it moved, (2,), whole px."""


def detect_moving_target(first: ArrayLike, second: ArrayLike, center: ArrayLike | None = None) -> MovingTarget | None:
    """Finds what moves between two frames (H, W) of a still scene: the largest thing, or that nearest to `center` (x, y), px; None where nothing moves.

    Changed pixels differ by more than three deviations of the noise; the displacement, at most 10 px along each axis, is the smallest that explains them nearly best.

    Raises `ValueError` for frames of different size.
    """
    found = _detect_moving_target(_frame(first), _frame(second), _numbers("center", center, "(x, y)", 2))
    return None if found is None else MovingTarget(*(np.array(part) for part in found))


class GaussMarkovFilter:
    """Position, velocity and acceleration of a point, each axis by itself; the acceleration is a first-order Gauss-Markov sequence.

    Source: M. Chiba and S. Ozawa, equations (12) to (24): F = [1 1 1/2; 0 1 1; 0 0 alpha], Q = diag(0, 0, q), one frame a step.

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
        What is measured as velocity: the mean since the frame before, x' - x''/(2 alpha) (default, what optical flow tells), or the velocity at the frame, as (24) is printed.

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
        """Takes what was measured (16)-(18): a position (x, y), px, a velocity, px/frame, or both, with their variances (one number or one an axis).

        Returns the normalised innovation squared, both axes together: chi squared with as many degrees of freedom as numbers were measured.
        Raises `ValueError` for numbers that are not finite and variances that are not above 0.
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
