"""Arguments of the particle tracker, checked by name before the compiled part takes them."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._checks import check_memory, is_word, numbers, real_number, word

MAX_ID = 2**63 - 2
"""Greatest number of a target, no unit."""
LIMITS = {"random_state": 2**64 - 1, "threads": 2**31 - 1}
"""Greatest values, no unit, of integers that are not counts of particles."""
MAX_PARTICLES = 10**8
"""Maximum number of particles of a target, no unit: more would take all memory."""
BOX_BYTES = 256
"""Memory of a target's number and box as objects of Python, bytes."""
WORDS = {
    "mode": '"improved" or "paper"',
    "resampling": '"multinomial", "stratified", "systematic" or "residual"',
    "foreground": '"ratio", "posterior", "literal" or "affine"',
    "grey": '"error" or "value"',
}
"""Options, no unit, that are words, and the words; which ones there are the compiled part checks."""
SEGMENTATION: dict[str, Any] = {"scale": 150.0, "sigma": 0.8, "min_size": None}
"""Entries of `segmentation` (grey levels, px, px^2) and their defaults."""
_SWITCHES = (bool, np.bool_)
"""They count as 0 and 1 in Python, and are no numbers here."""


def checked(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options, each in the unit it had, as the compiled part takes them; what is of another kind is
    refused by name.
    """
    out = dict(options)
    for name, expected in WORDS.items():
        word(name, out[name], expected)
    for name in ("n_particles", "n_near"):
        out[name] = _integer(name, out[name], MAX_PARTICLES)
    out["random_state"] = _integer("random_state", out["random_state"], LIMITS["random_state"])
    out["threads"] = None if out["threads"] is None else _integer("threads", out["threads"], LIMITS["threads"])
    out["scale"] = None if out["scale"] is None else _real("scale", out["scale"])
    out["ess_threshold"] = _real("ess_threshold", out["ess_threshold"])
    out["likelihoods"] = None if out["likelihoods"] is None else _names("likelihoods", out["likelihoods"])
    out["segmentation"] = _segmentation(out["segmentation"])
    return out


def _integer(name: str, value: Any, most: int) -> int:
    """An integer, in its unit, from 0 to `most`."""
    try:
        if isinstance(value, _SWITCHES):
            raise TypeError
        integer = operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected an integer, got {value!r}") from None
    if not 0 <= integer <= most:
        raise ValueError(f"{name}: expected an integer from 0 to {most}, got {integer}")
    return integer


def _real(name: str, value: Any) -> float:
    """A number, in its unit, that is not a switch."""
    if isinstance(value, _SWITCHES):
        raise TypeError(f"{name}: expected a number, got {value!r}")
    return real_number(name, value)


def _names(name: str, value: Any) -> list[str]:
    """Names of likelihoods or parts, no unit."""
    # An iterator is read once: reading it for the check alone would leave no names.
    names: list[Any] = [None] if isinstance(value, str) or not isinstance(value, Iterable) else list(value)
    if not all(is_word(each) for each in names):
        raise ValueError(f"{name}: expected a sequence of names, got {value!r}")
    return names


def _segmentation(value: Any) -> tuple[float, float, int | None]:
    """Scale (grey levels), sigma (px) and smallest region (px^2), from a dict that may lack some, or None."""
    given = {} if value is None else value
    if not isinstance(given, Mapping):
        raise ValueError(f"segmentation: expected a dict of scale, sigma and min_size, got {value!r}")
    for name in given:
        if name not in SEGMENTATION:
            raise ValueError(f"segmentation: expected scale, sigma and min_size, got {name!r}")
    entries = {**SEGMENTATION, **given}
    area = entries["min_size"]
    least = None if area is None else _integer("segmentation", area, LIMITS["threads"])
    return _real("segmentation", entries["scale"]), _real("segmentation", entries["sigma"]), least


def checked_id(value: Any) -> int:
    """A number of a target, no unit."""
    return _integer("id", value, MAX_ID)


def checked_box(name: str, value: ArrayLike) -> list[float]:
    """Left, top, width and height, px."""
    return numbers(name, value, "(left, top, width, height), px", (4,)).tolist()  # type: ignore[no-any-return]


def checked_camera(value: ArrayLike | None) -> list[list[float]] | None:
    """An affine motion (2, 3) of the background, px; None: not known."""
    return None if value is None else numbers("camera", value, "an affine map (2, 3), px", (2, 3)).tolist()


def checked_boxes(value: Any) -> list[tuple[int, list[float]]]:
    """Targets' numbers and boxes, px, from an array (K, 4), of which they are the rows, or a dict."""
    if isinstance(value, Mapping):
        pairs = [(checked_id(number), checked_box("boxes", box)) for number, box in value.items()]
        return sorted(pairs)
    try:
        empty = len(value) == 0
    except TypeError:
        empty = False
    if empty:
        return []
    array = numbers("boxes", value, "an array (K, 4) of left, top, width, height, px, or a dict id -> box", (None, 4))
    check_memory("boxes", BOX_BYTES * len(array))
    return [(number, box.tolist()) for number, box in enumerate(array)]


