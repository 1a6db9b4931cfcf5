"""Options of the stereo tracker, checked by name before the compiled part takes them."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

COUNTS = ("n_components", "max_iter", "warm_max_iter", "n_init", "random_state", "search", "luminance_levels", "patience", "coast", "threads")
"""Counts, no unit; None where the default depends on the mode."""
NUMBERS = (
    "weight_concentration_prior", "mean_precision_prior", "degrees_of_freedom_prior", "covariance_prior", "prune_weight", "row_offset", "arc_threshold", "reseed_below", "least_overlap", "focal", "baseline", "d_infinity",
)  # fmt: skip
"""Numbers, in the units that `StereoTracker` tells; None where one may be missing."""
TUPLES = {"disparity_range": 2, "row_range": 2, "grid": 3, "tolerance": 3, "tolerance_per_step": 3, "jump": 2, "group_limits": 3}
"""How many numbers (no unit) each of these holds."""
WORDS = {"mode": '"improved" or "paper"', "matching": '"classes" or "sgm"'}
"""Words, no unit, and what they may be."""
SWITCHES = ("recognition", "grouping")
"""Switches, no unit; None where the default depends on the mode."""
OPTIONAL = frozenset({"n_components", "threads", "row_offset", "focal", "baseline", "matching"})
"""Names (no unit) of those that may be None."""


def checked(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options, each in the unit it had, as the compiled part takes them; what is of another kind, length or sign is refused by name."""
    out = dict(options)
    for name, expected in WORDS.items():
        if not (isinstance(out[name], str) or (out[name] is None and name in OPTIONAL)):
            raise ValueError(f"{name}: expected {expected}, got {out[name]!r}")
    for name in SWITCHES:
        if out[name] not in (None, True, False):
            raise TypeError(f"{name}: expected True, False or None, got {out[name]!r}")
        out[name] = None if out[name] is None else bool(out[name])
    for name in COUNTS:
        out[name] = _converted(name, out[name], operator.index, "an integer")
        if out[name] is not None and out[name] < 0:
            raise ValueError(f"{name}: expected a number that is not negative, got {out[name]}")
    for name in NUMBERS:
        out[name] = _converted(name, out[name], float, "a number")
    if out["tol"] is not None and not isinstance(out["tol"], str):
        out["tol"] = _converted("tol", out["tol"], float, '"auto", a number or None')
    for name, length in TUPLES.items():
        numbers = _converted(name, out[name], tuple, f"{length} numbers")
        if len(numbers) != length:
            raise ValueError(f"{name}: expected {length} numbers, got {len(numbers)}")
        whole = name in ("disparity_range", "row_range", "grid")
        out[name] = tuple(
            None if number is None and name == "grid" and at == 2 else _converted(name, number, operator.index if whole else float, "an integer" if whole else "a number", optional=False)
            for at, number in enumerate(numbers)
        )
    if any(side is not None and side < 0 for side in out["grid"]):
        raise ValueError(f"grid: expected numbers of cells, got {out['grid']}")
    return out


def _converted(name: str, value: Any, convert: Callable[[Any], Any], expected: str, *, optional: bool = True) -> Any:
    """A value converted, or None where an option may be missing."""
    if value is None and optional and name in OPTIONAL:
        return None
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        return convert(value)
    except TypeError:
        raise TypeError(f"{name}: expected {expected}, got {value!r}") from None
