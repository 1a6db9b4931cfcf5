"""The loop of the gradient tracker's source, to the letter and with repairs, and its parts: for comparison
with `jacoflow.track.GradientTracker`.

Source: M. Chiba and S. Ozawa, "A Tracking Algorithm for a Video Target Using Gradient-Based Method" (IPSJ). A
user's wheel is built without it; `maturin develop --features reference` builds it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _jacoflow
from ._brief import Brief
from ._jacoflow import MissingDependencyError
from .track import Array, GradientTracker, Track, TrackResult, _follow, _frame, _numbers, _real, _whole, _word

__all__ = ["MeanFlow", "PixelFlow", "ReferenceResult", "ReferenceTracker", "derivative_kernels", "local_flow", "mean_flow", "track"]


def _compiled(name: str) -> Callable[..., Any]:
    """A function of the compiled part."""
    function: Callable[..., Any] | None = getattr(_jacoflow, name, None)
    if function is None:
        raise MissingDependencyError("jacoflow.reference: expected a build with the feature `reference`, got one without")
    return function


@dataclass(frozen=True, eq=False, repr=False)
class ReferenceResult(TrackResult):
    """The target at one frame, and the window that was searched; lengths in px."""

    window_center: Array
    """Center of the searched window, (2,), px; NaN before the target moves."""
    n_flow: int
    """How many pixels moved in it, no unit."""


class ReferenceTracker(GradientTracker):
    """Follows one target by local flow in a moving window, its mean over what moves and a Gauss-Markov
    filter.

    Parameters
    ----------
    frame, bbox, center, camera
        As for `GradientTracker`; `camera` matters only until the target moves.
    method : "local" or "paper"
        With the repairs that the loop needs (default), or the text to the letter, which loses targets on all
        but flat backgrounds.
    search_window : int, px
        Side of the searched window, made odd; default 51, or 1.6 times the longer side of the box where that
        is more.
    control : "integer" or "subpixel"
        Whether that window moves in whole pixels (default) or not.
    order : int
        Degree of the polynomials behind the derivatives, 1 to 4 ("local": 4, "paper": 2).
    window : int, px
        Side of the windows of local flow, 3, 5 or 7 ("local": 7, "paper": 5).
    min_speed : float or "auto", px/frame
        Slowest flow that counts as motion; default 0.5; "auto": three standard deviations of the flow outside
        the target, at least 0.3.

    Raises
    ------
    ValueError
        As `GradientTracker`, and for options out of range; each message names the argument.
    TypeError
        For options of another type.
    """

    def __init__(
        self,
        frame: ArrayLike,
        bbox: ArrayLike | None = None,
        *,
        center: ArrayLike | None = None,
        method: str = "local",
        search_window: int | None = None,
        control: str = "integer",
        camera: str = "auto",
        order: int | None = None,
        window: int | None = None,
        min_speed: float | str = 0.5,
    ) -> None:
        box, point = _numbers("bbox", bbox, "(x, y, width, height)", 4), _numbers("center", center, "(x, y)", 2)
        mode, steering, swing = (_word(name, value) for name, value in (("method", method), ("control", control), ("camera", camera)))
        side, degree, windows = (
            None if value is None else _whole(name, value)
            for name, value in (("search_window", search_window), ("order", order), ("window", window))
        )
        if min_speed is None or (isinstance(min_speed, str) and min_speed != "auto"):
            raise ValueError(f'min_speed: expected a speed in px/frame or "auto", got {min_speed!r}')
        slowest = None if isinstance(min_speed, str) else _real("min_speed", min_speed)
        self._tracker: Any = _compiled("_reference_tracker")(_frame(frame), box, point, mode, side, steering, swing, degree, windows, slowest)

    def update(self, frame: ArrayLike) -> ReferenceResult:
        """The target in the next frame, an array (H, W) as large as the first."""
        return self._result(self._tracker.update(_frame(frame)))

    @property
    def result(self) -> ReferenceResult:
        """The target at the last frame; lengths in px."""
        return self._result(self._tracker.state())

    def _result(self, state: dict[str, Any]) -> ReferenceResult:
        """The state with the window."""
        center, count = self._tracker.search_window() or ((np.nan, np.nan), 0)
        return ReferenceResult(**state, window_center=np.array(center), n_flow=count)


def track(frames: Iterable[ArrayLike], bbox: ArrayLike | None = None, **options: Any) -> Track:
    """As `jacoflow.track.track`, frames (T, H, W), by a `ReferenceTracker` with these options."""
    return _follow(ReferenceTracker, frames, bbox, options)


def derivative_kernels(order: int) -> tuple[Array, Array, Array]:
    """Beaudet's masks (value, along x, along y), three arrays (5, 5) [row, column] = [y, x]: value and slopes
    (1/px) at the middle of a least-squares polynomial of total degree `order`, 1 to 4."""
    value, along_x, along_y = _compiled("_derivative_kernels")(_whole("order", order))
    return value, along_x, along_y


@dataclass(frozen=True, eq=False, repr=False)
class PixelFlow(Brief):
    """Flow of single pixels of a frame (H, W), px/frame."""

    flow: Array
    """(H, W, 2), px/frame."""
    valid: NDArray[np.bool_]
    """(H, W), where it is accepted."""


def local_flow(
    first: ArrayLike, second: ArrayLike, *, window: int = 7, order: int = 4, cond_max: float = 10.0, min_sigma: float = 2.5, step_max: float = 4.0
) -> PixelFlow:
    """Flow of single pixels from a frame (H, W) to the next, one step from rest: M. Chiba and S. Ozawa,
    equations (1) to (8).

    `.flow` (H, W, 2) is in px/frame, `.valid` (H, W) is where it is accepted: condition number of the
    gradients in the window (side `window` px) up to `cond_max`, weakest gradient at least `min_sigma` grey
    levels/px (and 0.7 times the frames' noise, unless it is 0), step up to `step_max` px.
    """
    sizes = _whole("window", window), _whole("order", order)
    limits = _real("cond_max", cond_max), _real("min_sigma", min_sigma), _real("step_max", step_max)
    return PixelFlow(*_compiled("_local_flow")(_frame(first), _frame(second), *sizes, *limits))


@dataclass(frozen=True, eq=False, repr=False)
class MeanFlow(Brief):
    """What moves in a frame, px/frame, and where: M. Chiba and S. Ozawa, equation (11)."""

    velocity: Array
    """Mean flow (u, v) over the pixels that move, px/frame; zero where nothing does."""
    centroid: Array
    """Their mean place (x, y), px; NaN where nothing moves."""
    count: int
    """How many they are, no unit."""


def mean_flow(flow: PixelFlow, min_speed: float = 0.5) -> MeanFlow:
    """Mean over the valid pixels of a field (H, W) whose flow along x or along y is at least `min_speed`
    px/frame: one set for both axes (11).

    Raises `TypeError` for another object, `ValueError` for a negative `min_speed` and for arrays of another
    shape.
    """
    if not isinstance(flow, PixelFlow):
        raise TypeError(f"flow: expected a PixelFlow, got {type(flow).__name__}")
    field, valid = np.ascontiguousarray(flow.flow, float), np.ascontiguousarray(flow.valid, bool)
    if field.ndim != 3 or field.shape[2] != 2:
        raise ValueError(f"flow: expected a field (H, W, 2), got shape {field.shape}")
    if valid.shape != field.shape[:2]:
        raise ValueError(f"valid: expected an array {field.shape[:2]} like the flow, got shape {valid.shape}")
    velocity, centroid, count = _compiled("_mean_flow")(field, valid, _real("min_speed", min_speed))
    return MeanFlow(np.array(velocity), np.array(centroid), count)
