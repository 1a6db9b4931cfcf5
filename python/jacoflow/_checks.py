"""Arguments, checked by name before they are used."""

from __future__ import annotations

import inspect
import operator
import os
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def real_number(name: str, value: Any) -> float:
    """A number, in its unit; TypeError by name for what is none."""
    number: float = converted(name, value, float, "a number")
    return number


def positive_number(name: str, value: Any) -> float:
    """A number above 0, in its unit; ValueError by name for another."""
    number = real_number(name, value)
    if not (number > 0 and np.isfinite(number)):
        raise ValueError(f"{name}: expected a number above 0, got {number}")
    return number


def positive_integer(name: str, value: Any) -> int:
    """An integer above 0, in its unit; ValueError by name for another."""
    integer: int = converted(name, value, operator.index, "an integer")
    if integer < 1:
        raise ValueError(f"{name}: expected a positive integer, got {integer}")
    return integer


def switch(name: str, value: Any) -> bool:
    """True or False, not a value that counts as one of them (no unit); TypeError by name for another."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected True or False, got {value!r}")
    return bool(value)


def known_options(function: str, kind: type, options: Iterable[str]) -> None:
    """Refuses options that a class does not take (no unit), in the name of the function called."""
    known = [name for name in inspect.signature(kind).parameters if name not in ("frame", "boxes")]
    for name in options:
        if name not in known:
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}; expected one of {', '.join(known)}")


def numbers(name: str, value: Any, expected: str, shape: tuple[int | None, ...] | None = None) -> NDArray[np.float64]:
    """Real numbers, in their unit, as an array of a shape in which None is any length; without `shape` of
    any."""
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name}: expected {expected}, got {shown(value)}")
    if shape is not None and (array.ndim != len(shape) or any(length not in (None, got) for length, got in zip(shape, array.shape, strict=True))):
        raise ValueError(f"{name}: expected {expected}, got shape {array.shape}")
    check_memory(name, 8 * array.size)
    return array.astype(np.float64, copy=False)


def check_memory(name: str, size: int) -> None:
    """MemoryError by name for more bytes than can be had: a view of one number may have any shape."""
    try:
        np.empty(size, np.uint8)
    except (MemoryError, ValueError):
        raise MemoryError(f"{name}: expected what fits into memory, got {size} bytes") from None


def converted(name: str, value: Any, convert: Callable[[Any], Any], expected: str) -> Any:
    """What `convert` makes of a value, in its unit; TypeError by name where it cannot."""
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        return convert(value)
    except (TypeError, OverflowError):
        raise TypeError(f"{name}: expected {expected}, got {shown(value)}") from None


def word(name: str, value: Any, expected: str) -> str:
    """A word, no unit; ValueError by name for another object. The compiled part knows which words there
    are."""
    if not is_word(value):
        raise ValueError(f"{name}: expected {expected}, got {value!r}")
    return str(value)


def is_word(value: Any) -> bool:
    """Whether a value (no unit) is printable text: the compiled part takes no lone surrogates."""
    return isinstance(value, str) and value.isprintable()


def path_of(name: str, value: str | os.PathLike[str]) -> str:
    """A path as a string; TypeError by name for another object."""
    path = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(path, str):
        raise TypeError(f"{name}: expected a path (a string or os.PathLike), got {type(value).__name__}")
    return path


def shown(value: Any) -> str:
    """A value in a message: a long one is cut, an array is its shape."""
    if isinstance(value, np.ndarray) and value.size > 9:
        return f"an array {value.shape} of {value.dtype}"
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
