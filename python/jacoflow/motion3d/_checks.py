"""Arguments checked before they reach the compiled module: each message names the argument."""

from __future__ import annotations

import operator
import sys
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def word(name: str, value: object) -> None:
    if not isinstance(value, str):
        raise TypeError(f"{name}: expected a word, got {value!r}")


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


def unless_default(usual: float, value: float) -> float | None:
    """None for the usual value, which needs nothing of the other options."""
    return None if value == usual else value


def whole(name: str, value: int) -> int:
    if isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected an integer, got {value!r}")
    try:
        return operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected an integer, got {value!r}") from None


def count(name: str, value: int) -> int:
    count = whole(name, value)
    if not 1 <= count <= sys.maxsize:
        raise ValueError(f"{name}: expected a positive integer, got {count}")
    return count


def switch(name: str, value: bool) -> bool:
    """True or False, not a value with a truth: any text is true."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected True or False, got {value!r}")
    return bool(value)


def layout(K: ArrayLike | None, noise_std: float | None, cov: ArrayLike | None, projection: str, six: bool) -> dict[str, Any]:
    """How points are given, as the compiled module takes it; `six`: with Jacobians, so that each has six numbers."""
    word("projection", projection)
    deviation = None if noise_std is None else number("noise_std", noise_std)
    if deviation is not None and cov is not None:
        raise ValueError("cov: expected either noise_std or cov, got both")
    if six and projection == "sphere":
        raise ValueError('projection: expected "plane" with a jacobian, whose six numbers a patch are those of the plane, got "sphere"')
    if six and deviation is not None:
        raise ValueError("noise_std: expected None with a jacobian, for which cov (N, 6, 6) is needed, got a number")
    return {"K": K, "noise_std": deviation, "cov": cov, "projection": projection, "six": six}


def six(flow: ArrayLike, jacobian: ArrayLike) -> Array:
    """(N, 6) numbers (u, v, u_x, v_x, u_y, v_y), px/frame and 1/frame."""
    flow, slopes = real("flow", flow), real("jacobian", jacobian)
    if flow.ndim != 2 or flow.shape[1] != 2:
        raise ValueError(f"flow: expected shape (N, 2), got shape {flow.shape}")
    if slopes.shape != (len(flow), 2, 2):
        raise ValueError(f"jacobian: expected shape ({len(flow)}, 2, 2), got shape {slopes.shape}")
    return np.concatenate([flow, slopes.transpose(0, 2, 1).reshape(-1, 4)], axis=1)


def real(name: str, given: ArrayLike) -> Array:
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise ValueError(f"{name}: expected rows of equal length, got {error}") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name}: expected real numbers, got {array.dtype}")
    return array.astype(float)
