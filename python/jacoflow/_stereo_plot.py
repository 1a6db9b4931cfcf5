"""Pictures of disparities, clusters and their graph; they are offered by `jacoflow.plot`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._checks import numbers, real_number
from ._figures import axes_or_new, check_parts, colour_map, frame_extent

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._stereo_track import StereoStep, TrackGraph
    from .stereo import EdgeDisparity

_GOLDEN = 0.618033988749895
"""Hues of numbers that follow each other are this share of the wheel apart: none of many is near another."""
_NODE = 60.0
"""Area of a node of the mean weight, points squared."""


def identity_colours(numbers: ArrayLike) -> NDArray[np.float64]:
    """Colours of track or group numbers (N,), array (N, 3), 0 to 1 (no unit): the same number always has the
    same one."""
    hues = np.asarray(numbers, float) * _GOLDEN % 1.0
    corners = np.abs((hues[..., None] * 6 + np.array([0.0, 4.0, 2.0])) % 6 - 3) - 1
    colours: NDArray[np.float64] = 0.15 + 0.8 * np.clip(corners, 0, 1)
    return colours


def disparity(found: EdgeDisparity, *, left: ArrayLike | None = None, axes: Axes | None = None, limits: tuple[float, float] | None = None) -> Axes:
    """Draws the N edge pixels of an `EdgeDisparity` coloured by disparity, px, over `left`, a grey array (H,
    W), if given; `limits` (least, greatest), px, of the colours."""
    check_parts("found", found, "EdgeDisparity", ("disparity", "rows", "cols", "values"))
    if limits is not None:
        limits = tuple(numbers("limits", limits, "two numbers, least and greatest", (2,)))
    axes = axes_or_new(axes)
    _background(axes, left, found.disparity.shape)
    if limits is None:
        limits = tuple(np.percentile(found.values, (1, 99))) if len(found.values) else (0.0, 1.0)
    points = axes.scatter(found.cols, found.rows, c=found.values, s=1.5, marker="s", linewidths=0, cmap=colour_map(signed=False), vmin=limits[0], vmax=limits[1])
    figure: Any = axes.figure
    figure.colorbar(points, ax=axes, label="disparity, px")
    axes.set_title("disparity")
    return axes


def clusters(step: StereoStep, *, left: ArrayLike | None = None, axes: Axes | None = None, by: str = "track", arrows: float = 1.0) -> Axes:
    """Draws the N edge pixels of a `StereoStep` in the colours of their tracks or groups (`by` "track" or
    "group"), with the number of each, over `left`, a grey array (H, W).

    Arrows are `arrows` times the motion since the last step, px; 0 draws none.
    """
    check_parts("step", step, "StereoStep", ("rows", "cols", "clusters", "cluster_of_pixel"))
    if by not in ("track", "group"):
        raise ValueError(f'by: expected "track" or "group", got {by!r}')
    arrows = real_number("arrows", arrows)
    axes = axes_or_new(axes)
    shape = (int(max(step.rows, default=0)) + 1, int(max(step.cols, default=0)) + 1)
    _background(axes, left, shape)
    numbers = {cluster.index: cluster.track_id if by == "track" else cluster.group for cluster in step.clusters}
    if numbers:
        colours = identity_colours([numbers[int(k)] for k in step.cluster_of_pixel])
        axes.scatter(step.cols, step.rows, c=colours, s=1.5, marker="s", linewidths=0)
    for cluster in step.clusters:
        (x, y), (u, v), number = cluster.mean[:2], cluster.velocity[:2], numbers[cluster.index]
        axes.annotate(str(number), (x, y), color="white", ha="center", va="center", fontsize="small", bbox={"boxstyle": "round,pad=0.15", "fc": identity_colours([number])[0], "ec": "white", "lw": 0.5})
        if arrows > 0 and np.isfinite([u, v]).all():
            axes.annotate("", (x + arrows * u, y + arrows * v), (x, y), arrowprops={"arrowstyle": "->", "color": "white", "lw": 1.2})
    axes.set_title(f"{by}s at step {step.time}")
    return axes


def track_graph(graph: TrackGraph, *, axes: Axes | None = None, threshold: float = 0.4) -> Axes:
    """Draws a `TrackGraph` over time: steps to the right, a row for each component (no unit); nodes in the
    colour of their track, as large as their number of pixels; arcs with a score of at least `threshold` (0 to
    2), as thick as their score."""
    check_parts("graph", graph, "TrackGraph", ("nodes", "arcs"))
    threshold = real_number("threshold", threshold)
    axes = axes_or_new(axes)
    nodes = graph.nodes
    for ((t0, k0), (t1, k1)), (forward, backward) in graph.arcs.items():
        score = forward + backward
        if score >= threshold:
            axes.plot([t0, t1], [k0, k1], color=identity_colours([nodes[t0, k0].track_id])[0], linewidth=1.5 * score, alpha=0.7, zorder=1)
    if nodes:
        places = np.array(list(nodes), float)
        pixels = np.array([node.n_pixels for node in nodes.values()], float)
        colours = identity_colours([node.track_id for node in nodes.values()])
        axes.scatter(places[:, 0], places[:, 1], s=_NODE * pixels / pixels.mean(), c=colours, edgecolors="black", linewidths=0.5, zorder=2)
    axes.set_xlabel("step")
    axes.set_ylabel("component")
    axes.invert_yaxis()
    axes.set_title("tracks")
    return axes


def _background(axes: Axes, left: ArrayLike | None, shape: tuple[int, ...]) -> None:
    """The view in grey, darkened so that colours stand out; black without one."""
    image = np.zeros(shape) if left is None else numbers("left", left, "a view (H, W) or (H, W, 3)")
    if image.ndim == 3:
        image = image[..., :3] @ np.array([0.299, 0.587, 0.114])
    if image.ndim != 2:
        raise ValueError(f"left: expected a view (H, W) or (H, W, 3), got shape {image.shape}")
    top = float(np.nanmax(image)) if image.size else 1.0
    axes.imshow(0.6 * image, cmap="gray", vmin=0, vmax=top or 1.0, interpolation="nearest", extent=frame_extent(image.shape))
