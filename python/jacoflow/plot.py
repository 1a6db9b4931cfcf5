"""Pictures of flow fields with matplotlib (an optional part: `pip install "jacoflow[plot]"`).

Every function takes a `FlowField`, or anything with the arrays `flow` (H, W, 2) and `jacobian` (H, W, 2, 2),
draws into `axes` (new ones where None is given) and returns them. Image coordinates: x right, y down, pixel
centres at whole numbers. Unknown (NaN) values are shown in grey or black.

`flow_image` and `wheel_image` need numpy only. `disparity`, `clusters` and `track_graph` draw what
`jacoflow.stereo` and `jacoflow.track.StereoTracker` find.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ._checks import check_memory, numbers, positive_integer, positive_number
from ._figures import axes_or_new, check_parts, colour_map, expect_colour, frame_extent, pyplot_or_error
from ._jacoflow import FlowField
from ._stereo_plot import clusters, disparity, track_graph

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "FieldLike",
    "clusters",
    "curl",
    "disparity",
    "divergence",
    "flow_colour",
    "flow_image",
    "overview",
    "quiver",
    "scalar_map",
    "track_graph",
    "wheel_image",
]

_CORNERS = ((15, (255, 0, 0)), (6, (255, 255, 0)), (4, (0, 255, 0)), (11, (0, 255, 255)), (13, (0, 0, 255)), (6, (255, 0, 255)))
"""How many hues lie between neighbouring corners of the wheel (S. Baker et al., "A database and evaluation
methodology for optical flow", 2011)."""


class FieldLike(Protocol):
    """What a picture is made of, arrays (H, W, ...): `FlowField` is one."""

    @property
    def flow(self) -> NDArray[Any]:
        """Flow (u, v), array (H, W, 2), px/frame."""

    @property
    def jacobian(self) -> NDArray[Any]:
        """[[u_x, u_y], [v_x, v_y]], array (H, W, 2, 2), 1/frame."""


def flow_image(field: FieldLike, *, max_speed: float | None = None) -> NDArray[np.uint8]:
    """Colours of a flow, uint8 array (H, W, 3): direction is hue (right red, down yellow), speed is
    saturation, at rest is white, unknown is black.

    `max_speed` (px/frame, or the field's unit) is the speed of full saturation, by default the 99th
    percentile; faster is darker.
    """
    flow = _flow(field)
    return _colours(flow[..., 0], flow[..., 1], _full_speed(flow, max_speed))


def wheel_image(size: int = 96) -> NDArray[np.uint8]:
    """The key to `flow_image`, uint8 array (size, size, 3), size in px: the colour at an offset from the
    middle is that of flow in that direction."""
    size = positive_integer("size", size)
    check_memory("size", 24 * size**2)
    offsets = (np.arange(size) - (size - 1) / 2) / (size / 2)
    v, u = np.meshgrid(offsets, offsets, indexing="ij")
    image = _colours(u, v, 1.0)
    image[np.hypot(u, v) > 1] = 255
    return image


def flow_colour(field: FieldLike, *, axes: Axes | None = None, max_speed: float | None = None, legend: bool = True) -> Axes:
    """Draws `flow_image` of a flow (H, W, 2), px/frame or the field's unit; `legend` adds the colour wheel
    with its full speed in the lower right corner."""
    axes = axes_or_new(axes)
    image = flow_image(field, max_speed=max_speed)
    axes.imshow(image, extent=_extent(field, image.shape[:2]), interpolation="nearest")
    speed = _full_speed(_flow(field), max_speed)
    axes.set_title("flow")
    if legend:
        inset = axes.inset_axes((0.84, 0.02, 0.14, 0.14))
        inset.imshow(wheel_image())
        inset.set_axis_off()
        inset.set_title(f"{speed:.3g} {_unit(field, 'u', 'px/frame')}", fontsize="x-small", pad=2)
    return axes


def quiver(
    field: FieldLike,
    *,
    axes: Axes | None = None,
    frame: NDArray[Any] | None = None,
    step: int | None = None,
    scale: float | None = None,
    colour: str = "#ffb000",
) -> Axes:
    """Draws arrows of a flow (H, W, 2), or of points (N, 2), over `frame`, a grey array (H, W) of the size of
    the field's frames, if given.

    One arrow every `step` sites (default: about 24 along the longer side); an arrow is `scale` times the flow
    long (default: the longest arrows just fit their distance). Px throughout.
    """
    flow = _part(field, "flow") * _pixels(field)
    axes = axes_or_new(axes)
    expect_colour("colour", colour)
    if flow.ndim not in (2, 3) or flow.shape[-1] != 2:
        raise ValueError(f"field: expected flow of shape (H, W, 2) or (N, 2), got {flow.shape}; index a stack first")
    x, y = _positions(field, flow.shape[:-1])
    if frame is not None:
        size = getattr(field, "frame_size", None)
        expected, shape = ("a grey frame (H, W)", (None, None)) if size is None else (f"the field's frame, shape {size[::-1]}", size[::-1])
        axes.imshow(numbers("frame", frame, expected, shape), cmap="gray", interpolation="nearest")
    # Sites without flow belong to the picture too.
    axes.update_datalim(np.column_stack((np.ravel(x), np.ravel(y))))
    if flow.ndim == 3:
        step = max(1, round(max(flow.shape[:2]) / 24)) if step is None else step
        step = positive_integer("step", step)
        part = (slice(step // 2, None, step), slice(step // 2, None, step))
        x, y, flow = x[part], y[part], flow[part]
    known = np.isfinite(flow).all(axis=-1)
    x, y, flow = x[known], y[known], flow[known]
    if scale is not None:
        scale = positive_number("scale", scale)
    else:
        longest = np.percentile(np.hypot(flow[:, 0], flow[:, 1]), 98) if len(flow) else 0.0
        distance = _spacing(x, y)
        scale = float(distance / longest) if longest > 0 else 1.0
    axes.quiver(x, y, flow[:, 0] * scale, flow[:, 1] * scale, color=colour, angles="xy", scale_units="xy", scale=1, width=0.003)
    if frame is None:
        axes.set_aspect("equal")
        if not axes.yaxis_inverted():
            axes.invert_yaxis()
    axes.set_title(f"flow, arrows x {scale:.3g}")
    return axes


def scalar_map(
    values: NDArray[Any],
    *,
    axes: Axes | None = None,
    field: FieldLike | None = None,
    limit: float | None = None,
    signed: bool = True,
    label: str = "",
    unit: str = "",
) -> Axes:
    """Draws any plane (H, W) with a colour bar: blue, white, red about zero when `signed`, else dark to
    bright from zero.

    `limit` (in the values' unit) is the end of the scale, by default the 98th percentile of the absolute
    values. `field` places the plane in the image when it has a region or stride. `label` and `unit` are words
    for the title and the bar.
    """
    given = np.asarray(values)
    given = given.view(np.uint8) if given.dtype == bool else given
    values = numbers("values", given, "an array (H, W)", (None, None))
    # The plane and its absolute values.
    check_memory("values", 2 * values.nbytes)
    axes = axes_or_new(axes)
    finite = np.abs(values[np.isfinite(values)])
    if limit is None:
        limit = (float(np.percentile(finite, 98)) if finite.size else 0.0) or 1.0
    limit = positive_number("limit", limit)
    extent = _extent(field, values.shape) if field is not None else frame_extent(values.shape)
    shown = axes.imshow(values, cmap=colour_map(signed), vmin=-limit if signed else 0.0, vmax=limit, extent=extent, interpolation="nearest")
    bar = axes.get_figure(root=True).colorbar(shown, ax=axes, shrink=0.8)  # type: ignore[union-attr]
    bar.set_label(unit)
    axes.set_title(label)
    return axes


def divergence(field: FieldLike, *, axes: Axes | None = None, limit: float | None = None) -> Axes:
    """Draws the divergence of a field (H, W), in its unit, else u_x + v_y, 1/frame: red where the picture
    expands. `limit` as in `scalar_map`."""
    jacobian = _jacobian(field)
    values = getattr(field, "divergence", jacobian[..., 0, 0] + jacobian[..., 1, 1])
    unit = _unit(field, "divergence", "1/frame")
    return scalar_map(values, axes=axes, field=field, limit=limit, label="divergence", unit=unit)


def curl(field: FieldLike, *, axes: Axes | None = None, limit: float | None = None) -> Axes:
    """Draws the curl of a field (H, W), in its unit, else v_x - u_y, 1/frame: red where the picture turns
    clockwise on the screen. `limit` as in `scalar_map`."""
    jacobian = _jacobian(field)
    values = getattr(field, "curl", jacobian[..., 1, 0] - jacobian[..., 0, 1])
    unit = _unit(field, "curl", "1/frame")
    return scalar_map(values, axes=axes, field=field, limit=limit, label="curl", unit=unit)


def overview(field: FieldLike, *, frame: NDArray[Any] | None = None, figure: Figure | None = None) -> Figure:
    """Four panels of a field (H, W): colours, arrows over `frame` (grey array (H, W), optional), divergence
    and curl, in the field's units. Returns the figure."""
    if figure is None:
        pyplot = pyplot_or_error()
        figure = pyplot.figure(figsize=(11, 8), layout="constrained")
    check_parts("figure", figure, "matplotlib.figure.Figure", ("subplots",))
    panels = figure.subplots(2, 2)
    flow_colour(field, axes=panels[0, 0])
    quiver(field, axes=panels[0, 1], frame=frame)
    divergence(field, axes=panels[1, 0])
    curl(field, axes=panels[1, 1])
    return figure


def _unit(field: FieldLike, name: str, default: str) -> str:
    """The unit of a parameter or quantity, where the field knows it."""
    return field.unit(name) if isinstance(field, FlowField) else default


def _pixels(field: FieldLike) -> NDArray[np.float64]:
    """What makes px/frame of the flow's (u, v), array (2,)."""
    period = getattr(field, "frame_period", None)
    pixels: NDArray[np.float64] = (1.0 if period is None else period) / np.array(getattr(field, "pixel_pitch", (1.0, 1.0)), dtype=float)
    return pixels


def _part(field: FieldLike, name: str) -> NDArray[np.float64]:
    """An array of the field."""
    array = getattr(field, name, None)
    if array is None:
        raise TypeError(f"field: expected a FlowField, or another object with `{name}`, got {type(field).__name__}")
    return numbers(f"field.{name}", array, "an array of numbers")


def _flow(field: FieldLike) -> NDArray[np.float64]:
    flow = _part(field, "flow")
    if flow.ndim != 3 or flow.shape[2] != 2:
        raise ValueError(f"field: expected flow of shape (H, W, 2), got {flow.shape}; index a stack first, draw points with quiver")
    return flow


def _jacobian(field: FieldLike) -> NDArray[np.float64]:
    jacobian = _part(field, "jacobian")
    if jacobian.ndim != 4 or jacobian.shape[2:] != (2, 2):
        raise ValueError(f"field: expected a Jacobian of shape (H, W, 2, 2), got {jacobian.shape}; index a stack first")
    return jacobian


def _full_speed(flow: NDArray[np.float64], max_speed: float | None) -> float:
    """The speed of full saturation, px/frame."""
    if max_speed is not None:
        return positive_number("max_speed", max_speed)
    speeds = np.hypot(flow[..., 0], flow[..., 1])
    speeds = speeds[np.isfinite(speeds)]
    full = float(np.percentile(speeds, 99)) if speeds.size else 1.0
    return full if full > 0 else 1.0


def _wheel() -> NDArray[np.float64]:
    """The 55 hues from red through yellow, green, cyan, blue and magenta, array (55, 3), 0 to 1."""
    hues = []
    for corner, (steps, start) in enumerate(_CORNERS):
        end = np.array(_CORNERS[(corner + 1) % len(_CORNERS)][1], dtype=float)
        hues += [(np.array(start) * (1 - k / steps) + end * k / steps) / 255 for k in range(steps)]
    return np.array(hues)


def _colours(u: NDArray[np.float64], v: NDArray[np.float64], full: float) -> NDArray[np.uint8]:
    speed = np.hypot(u, v) / full
    known = np.isfinite(speed)
    wheel = _wheel()
    turn = np.where(known, np.arctan2(-v, -u), 0.0) / (2 * np.pi) + 0.5
    place = turn * (len(wheel) - 1)
    first = np.minimum(place.astype(int), len(wheel) - 1)
    part = (place - first)[..., None]
    hue = wheel[first] * (1 - part) + wheel[(first + 1) % len(wheel)] * part
    strength = np.where(known, speed, 0.0)[..., None]
    value = np.where(strength <= 1, 1 - strength * (1 - hue), 0.75 * hue)
    value[~known] = 0
    image: NDArray[np.uint8] = np.floor(255 * value).astype(np.uint8)
    return image


def _positions(field: FieldLike, shape: tuple[int, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pixel coordinates of the sites: `field.points` where it has them, else the array's own indices."""
    points = getattr(field, "points", None)
    if points is not None and np.shape(points)[:-1] == tuple(shape):
        points = np.asarray(points, dtype=float)
        return points[..., 0], points[..., 1]
    if len(shape) != 2:
        raise ValueError("field: expected `points` (N, 2) beside a flow of shape (N, 2)")
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]].astype(float)
    return x, y


def _spacing(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Typical distance between neighbouring arrows, px."""
    if len(x) < 2:
        return 10.0
    area = max(float(np.ptp(x)), 1.0) * max(float(np.ptp(y)), 1.0)
    return float(np.sqrt(area / len(x)))


def _extent(field: FieldLike, shape: tuple[int, ...]) -> tuple[float, float, float, float]:
    """Left, right, bottom, top of an image of the sites, px."""
    x, y = _positions(field, shape)
    if x.size == 0:
        return frame_extent(shape)
    dx = (x[0, -1] - x[0, 0]) / max(shape[1] - 1, 1) or 1.0
    dy = (y[-1, 0] - y[0, 0]) / max(shape[0] - 1, 1) or 1.0
    return (x[0, 0] - dx / 2, x[0, -1] + dx / 2, y[-1, 0] + dy / 2, y[0, 0] - dy / 2)
