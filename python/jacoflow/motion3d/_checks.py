"""Kinds of arguments, checked before they reach the compiled module, which checks their values: each message
names the argument."""

from __future__ import annotations

import operator
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def word(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{name}: expected a word, got {value!r}")
    return value


def kind(name: str, value: object, *kinds: type) -> None:
    if not isinstance(value, kinds):
        raise TypeError(f"{name}: expected a {' or a '.join(kind.__name__ for kind in kinds)}, got {type(value).__name__}")


def pair(name: str, given: tuple[ArrayLike, ArrayLike] | None) -> tuple[ArrayLike, ArrayLike] | None:
    if given is None:
        return None
    try:
        parts = tuple(given)
    except TypeError:
        raise TypeError(f"{name}: expected two arrays, got {given!r}") from None
    if len(parts) != 2:
        raise ValueError(f"{name}: expected two arrays, got {len(parts)}")
    return parts[0], parts[1]


def number(name: str, value: float) -> float:
    """A real number not a value that Python would convert to one."""
    if not isinstance(value, str | bytes | bool | np.bool_ | complex):
        try:
            return float(value)
        except (TypeError, ValueError, OverflowError):
            pass
    raise TypeError(f"{name}: expected a number, got {value!r}")


def whole(name: str, value: int) -> int:
    """An integer of 64 bits."""
    if isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected an integer, got {value!r}")
    try:
        integer = operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected an integer, got {value!r}") from None
    if abs(integer) > sys.maxsize:
        raise ValueError(f"{name}: expected an integer of 64 bits, got {integer}")
    return integer


def optional(convert: Callable[[str, Any], Any]) -> Callable[[str, Any], Any]:
    """The check of an option that may be None."""
    return lambda name, value: None if value is None else convert(name, value)


def layout(K: ArrayLike | None, noise_std: float | None, cov: ArrayLike | None, projection: str) -> dict[str, Any]:
    """How points are given, as the compiled module takes it."""
    word("projection", projection)
    return {"K": K, "noise_std": optional(number)("noise_std", noise_std), "cov": cov, "projection": projection}
