"""What all pictures are made with: matplotlib where it is installed, axes, colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._checks import shown
from ._jacoflow import MissingDependencyError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIGNED_COLOURS = ("#163884", "#669ed6", "#f7f7f7", "#e48660", "#8c1422")
"""Blue below zero, white at zero, red above."""
_UNKNOWN = "#6e6e6e"


def pyplot_or_error() -> Any:
    """matplotlib.pyplot, or an error that says how to get it."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise MissingDependencyError('plotting needs matplotlib: pip install "jacoflow[plot]"') from error
    return pyplot


def axes_or_new(axes: Axes | None) -> Axes:
    """The axes given, or those of a new figure."""
    if axes is not None:
        check_parts("axes", axes, "matplotlib.axes.Axes", ("imshow", "quiver"))
        return axes
    new: Axes = pyplot_or_error().subplots(layout="constrained")[1]
    return new


def check_parts(name: str, value: object, kind: str, parts: tuple[str, ...]) -> None:
    """TypeError naming the argument for an object without the parts that are drawn."""
    if not all(hasattr(value, part) for part in parts):
        raise TypeError(f"{name}: expected an object like {kind}, got {type(value).__name__}")


def expect_colour(name: str, value: object) -> None:
    """ValueError naming the argument for what is no colour of matplotlib's."""
    pyplot_or_error()
    from matplotlib.colors import is_color_like

    if not is_color_like(value):
        raise ValueError(f"{name}: expected a colour as matplotlib takes it, got {shown(value)}")


def frame_extent(shape: tuple[int, ...]) -> tuple[float, float, float, float]:
    return (-0.5, shape[1] - 0.5, shape[0] - 0.5, -0.5)


def colour_map(signed: bool) -> Any:
    """Blue, white, red for signed values, dark to bright for others; unknown values in grey."""
    pyplot = pyplot_or_error()
    from matplotlib.colors import LinearSegmentedColormap

    base = LinearSegmentedColormap.from_list("signed", list(_SIGNED_COLOURS)) if signed else pyplot.get_cmap("viridis")
    return base.with_extremes(bad=_UNKNOWN)
