"""Results that print in a few lines however many points they hold, and come as tables on request."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

MAX_PRINTED = 9
"""Numbers of an array that are printed themselves."""
LONGEST = 60
"""Characters of any other value that are printed."""


class Brief:
    """A dataclass (with `repr=False`) that shows small values, and the shape of large ones."""

    def __repr__(self) -> str:
        shown = [f"{field.name}={_shown(getattr(self, field.name))}" for field in fields(self) if field.repr]  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(shown)})"


class Rows(Brief):
    """The same for results with arrays of one row for each of N points, frames or targets."""

    _ROWS: ClassVar[tuple[str, ...]] = ()
    """Names of the arrays with N rows, in their units."""

    def table(self) -> dict[str, NDArray[Any]]:
        """A column (N,) for each number of a row, as for `pandas.DataFrame(result.table())`, in the units of
        the attributes; those of an array with several numbers a row end in their indices: `boxes_0` to
        `boxes_3`."""
        return columns({name: getattr(self, name) for name in self._ROWS})


def columns(arrays: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Columns (N,) of arrays with N rows, in their units; None is left out."""
    out: dict[str, NDArray[Any]] = {}
    for name, values in arrays.items():
        if values is None:
            continue
        array = np.asarray(values)
        flat = array.reshape(len(array), math.prod(array.shape[1:]))
        for column, at in enumerate(np.ndindex(array.shape[1:])):
            out["_".join([name, *map(str, at)])] = flat[:, column]
    return out


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if value.size > MAX_PRINTED:
            return f"<{value.shape} {value.dtype}>"
        return np.array2string(value, separator=", ", precision=4).replace("\n", "")
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Brief):
        return f"{type(value).__name__}(...)"
    if isinstance(value, Sequence | Mapping) and not isinstance(value, str):
        text = repr(value) if all(isinstance(each, str | int | float) for each in value) else ""
        return text if 0 < len(text) <= LONGEST or not len(value) else f"<{len(value)} {_kind(value)}>"
    text = repr(value)
    return text if len(text) <= LONGEST else f"<{type(value).__name__}>"


def _kind(value: Any) -> str:
    """The type of the entries, by the first."""
    return type(next(iter(value.values() if isinstance(value, Mapping) else value))).__name__
