"""Options of edge disparities and of the stereo tracker, checked by name before the compiled part takes
them."""

from __future__ import annotations

import operator
import warnings
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._checks import converted, real_number, switch, word
from ._jacoflow import _check_camera

COUNTS = ("n_components", "random_state", "search", "threads")
"""Counts, no unit; None where the default depends on the mode."""
NUMBERS = ("row_offset", "step_time")
"""Numbers, in the units of `StereoTracker`; None where one may be missing."""
TUPLES = {"disparity_range": 2, "row_range": 2, "grid": 3}
"""How many numbers (no unit) each of these holds."""
OPTIONAL = frozenset({"n_components", "threads", "row_offset"})
"""Names (no unit) of those that may be None."""


LIMITS = {"random_state": 2**64 - 1, "prior_radius": 2**32 - 1, "disparity_range": 2**31 - 1, "row_range": 2**31 - 1}
"""Greatest values, no unit, that the compiled part can hold, where they are not `DEFAULT_LIMIT`."""
DEFAULT_LIMIT = 2**63 - 1
"""Greatest size of every other integer, no unit."""


@dataclass(frozen=True)
class StereoCamera:
    """A pair of cameras, for depths.

    Raises
    ------
    ValueError
        For a length that is not above 0 or a disparity that is not finite, naming it; `TypeError` for no
        number.
    """

    focal: float
    """Focal length, px."""
    baseline: float
    """Distance of the cameras, in the unit that depths shall have."""
    d_infinity: float = 0.0
    """Disparity of a point at infinity, px; below 0 where the cameras converge."""

    def __post_init__(self) -> None:
        for name in ("focal", "baseline", "d_infinity"):
            object.__setattr__(self, name, real_number(name, getattr(self, name)))
        _check_camera(*astuple(self))


def checked(options: Mapping[str, Any]) -> dict[str, Any]:
    """The stereo tracker's options, each in the unit it had, as the compiled part takes them; what is of
    another kind, length or sign is refused by name."""
    out = dict(options)
    word("mode", out["mode"], '"improved" or "paper"')
    if out["camera"] is not None and not isinstance(out["camera"], StereoCamera):
        raise TypeError(f"camera: expected a StereoCamera or None, got {out['camera']!r}")
    out["camera"] = None if out["camera"] is None else astuple(out["camera"])
    for name in COUNTS:
        out[name] = _count(name, out[name])
    for name in NUMBERS:
        out[name] = _number(name, out[name])
    for name, length in TUPLES.items():
        out[name] = _several(name, out[name], length, whole=True)
    if any(side is not None and side < 0 for side in out["grid"]):
        raise ValueError(f"grid: expected numbers of cells, got {out['grid']}")
    return out


def checked_views(left: ArrayLike, right: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    """Both views as arrays, (H, W) or (H, W, 3) each; ValueError with both shapes where one is of another
    kind. The compiled part checks their sizes."""
    views = as_array(left), as_array(right)
    for name, view in zip(("left", "right"), views, strict=True):
        if not (view.ndim == 2 or (view.ndim == 3 and view.shape[2] in (3, 4))):
            raise ValueError(f"{name}: expected a view (H, W) or (H, W, 3), got left {views[0].shape} and right {views[1].shape}")
    return views


def as_array(view: ArrayLike) -> NDArray[Any]:
    """A view (H, W) as an array; one that is an array stays what it is."""
    return view if isinstance(view, np.ndarray) else np.asarray(view)


def checked_matching(options: Mapping[str, Any]) -> dict[str, Any]:
    """Those of `edge_disparity` and what is like it, of which each may be missing, in the same way."""
    out = dict(options)
    for name, value in options.items():
        if name in ("classes", "window", "prior_radius", "threads"):
            out[name] = _count(name, value)
        elif name in ("blur_sigma", "threshold", "min_support", "row_offset"):
            out[name] = _number(name, value)
        elif name in ("disparity_range", "row_range"):
            out[name] = _several(name, value, 2, whole=True)
        elif name in ("subpixel", "left_right_check"):
            out[name] = switch(name, value)
        elif name == "method":
            word(name, value, '"classes" or "sgm"')
    return out


def warn_of_rows(row_range: tuple[int, int]) -> None:
    """Warns that the views disagree at each of these row offsets, px."""
    least, greatest = row_range
    message = f"row_range: the views agree poorly with every row offset that was searched, {least} to {greatest}, and many disparities are wrong; widen the range or give row_offset"
    warnings.warn(message, UserWarning, stacklevel=3)


def whole_number(name: str, value: Any) -> int:
    """An integer, in its unit, that the compiled part can hold; TypeError or ValueError by name for what is
    none."""
    integer: int = converted(name, value, operator.index, "an integer")
    limit = LIMITS.get(name, DEFAULT_LIMIT)
    if abs(integer) > limit:
        raise ValueError(f"{name}: expected an integer up to {limit}, got {integer}")
    return integer


def _is_missing(name: str, value: Any) -> bool:
    return value is None and name in OPTIONAL


def _number(name: str, value: Any) -> float | None:
    return None if _is_missing(name, value) else real_number(name, value)


def _count(name: str, value: Any) -> int | None:
    if _is_missing(name, value):
        return None
    count = whole_number(name, value)
    if count < 0:
        raise ValueError(f"{name}: expected a number that is not negative, got {count}")
    return count


def _several(name: str, value: Any, length: int, *, whole: bool) -> tuple[Any, ...]:
    """A sequence of so many numbers, in its unit; the last of `grid` may be None."""
    expected = f"{length} numbers"
    if converted(name, value, len, expected) != length:
        raise ValueError(f"{name}: expected {expected}, got {len(value)}")
    numbers = converted(name, value, tuple, expected)
    convert = whole_number if whole else real_number
    return tuple(None if number is None and name == "grid" and at == 2 else convert(name, number) for at, number in enumerate(numbers))
