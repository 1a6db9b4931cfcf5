"""Disparity of the edge pixels of two views.

Disparity is `d = x_left - x_right` in px, large near the cameras, and negative where cameras that converge
look far. A point at (x, y) in the left view is at (x - d, y + row_offset) in the right one. Source: the
stereo paper ("tracking of moving objects in stereo sequences by fusing disparity and luminance"), equations
(1) to (5), and semi-global matching (H. Hirschmueller, 2008) of edge pixels alone.

>>> import numpy as np
>>> from jacoflow import stereo
>>> cells = np.random.default_rng(1).integers(0, 200, (12, 18)).repeat(8, 0).repeat(8, 1).astype(np.uint8)
>>> found = stereo.edge_disparity(cells[:, 5:133], cells[:, 8:136], disparity_range=(-8, 8), row_offset=0.0)
>>> round(float(np.median(found.values)), 1)
3.0
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._brief import Rows
from ._jacoflow import _edge_disparity, _edge_pixels, _estimate_row_offset
from ._stereo_options import checked_matching, checked_views, warn_of_rows

__all__ = ["EdgeDisparity", "edge_disparity", "edge_pixels", "estimate_row_offset"]


@dataclass(frozen=True, eq=False, repr=False)
class EdgeDisparity(Rows):
    """Disparities of the left view's edge pixels, N of them, in px."""

    _ROWS = ("rows", "cols", "values", "score")

    disparity: NDArray[np.float32]
    """`x_left - x_right` of every left pixel, (H, W), px; NaN where there is none."""
    rows: NDArray[np.uint32]
    """Rows of the pixels that have one, (N,), px, from above to below."""
    cols: NDArray[np.uint32]
    """Their columns, (N,), px."""
    values: NDArray[np.float32]
    """Their disparities, (N,), px."""
    score: NDArray[np.float32]
    """How well both views agree there, (N,), 0 to 1 (no unit): share of the window's classed pixels whose
    class agrees, or 1 less the matching cost over its truncation."""
    row_offset: float
    """How many rows lower the right view shows a point, px: the one given, the estimate, or the most frequent
    one of the class matching."""


def edge_disparity(
    left: ArrayLike,
    right: ArrayLike,
    *,
    disparity_range: tuple[int, int] = (-40, 24),
    row_range: tuple[int, int] = (-4, 4),
    row_offset: float | None = None,
    method: Literal["classes", "sgm"] = "sgm",
    subpixel: bool = True,
    left_right_check: bool = True,
    prior: ArrayLike | None = None,
    prior_radius: int = 3,
    blur_sigma: float = 2.0,
    threshold: float = 2.0,
    classes: int = 12,
    window: int = 17,
    min_support: float = 0.3,
    threads: int | None = None,
) -> EdgeDisparity:
    """Disparity of the edge pixels of the left view, px.

    Parameters
    ----------
    left, right : arrays (H, W) or (H, W, 3) of uint8, uint16, float32 or float64
        Two views of one size, at least 17 x 17 px. Brightness is taken on the scale 0 to 255: uint16 is
        divided by 257, floats are taken for shares of white unless at least half of what is not dark (above
        0.1) exceeds 1.5; hot patches decide nothing. Colour is turned into luminance. A sample that is masked
        or not finite leaves no edge pixel where the gradient's kernel reaches it, and harms no other.
    disparity_range : (least, greatest), whole px, both included
        Candidates, at most 1024. Those that leave the right view are not admissible.
    row_range : (least, greatest), rows, both included
        Row offsets that are searched where `row_offset` is None.
    row_offset : rows, or None
        How many rows lower the right view shows a point. None: searched at every pixel by "classes",
        estimated beforehand (`estimate_row_offset`) for "sgm", which takes as long again: estimate it once
        for a camera. "classes" rounds it to whole rows.
    method : "classes" or "sgm"
        "classes": the paper's. Signed gradient directions in 12 classes; the candidate with most agreement in
        a window. Whole px. "sgm": gradients compared in 5 x 5 px and smoothed along chains of edge pixels
        from eight sides; fewer mistakes, fractions of a px, faster.
    subpixel : bool
        "sgm": refine to fractions of a px: where two lines of equal slope through the least cost and its
        neighbours meet, then Lucas-Kanade steps along x in 9 x 9 px, kept within 1 px of that.
    left_right_check : bool
        "sgm": keep only what matching from the right view confirms to 1 px.
    prior : array (H, W) or None
        Expected disparities, px, NaN where nothing is expected: only those within `prior_radius` px of them
        are candidates there.
    prior_radius : px
        See `prior`.
    blur_sigma : px
        Standard deviation of the Gaussian behind the edges.
    threshold : grey levels/px
        Least slope of an edge.
    classes, window, min_support : count, px, share
        Of "classes": how many directions, the window's side (odd), the least share of its classed pixels that
        must agree.
    threads : count, or None
        Threads; the result is bit-identical for any number. None: the environment variable JACOFLOW_THREADS,
        else every processor.

    Returns
    -------
    EdgeDisparity
        Empty, not an error, where there are no edges, as in a view of NaN.

    ValueError names an argument that is out of range or views that do not fit, with both shapes. A
    UserWarning says where views with edges disagree at every row offset in `row_range`: cameras that are
    farther apart in height, or views that do not belong together. What is then found is mostly wrong.

    "sgm" compares gradients, after the right view is multiplied by the ratio of both views' contrasts where
    that is below .92 or above 1.08 and alike for the greatest 1 to 8 % of the differences in brightness.
    A bias makes no difference. Contrasts that differ from place to place, or are cut off at white, are not
    evened out: "classes" looks at directions alone.
    """
    disparity, rows, cols, values, score, (offset, doubtful) = _edge_disparity(*checked_views(left, right), _options(locals()))
    if doubtful:
        warn_of_rows(row_range)
    return EdgeDisparity(disparity, rows, cols, values, score, offset)


def estimate_row_offset(
    left: ArrayLike,
    right: ArrayLike,
    *,
    disparity_range: tuple[int, int] = (-40, 24),
    row_range: tuple[int, int] = (-4, 4),
    blur_sigma: float = 2.0,
    threshold: float = 2.0,
    classes: int = 12,
    window: int = 17,
    min_support: float = 0.3,
    threads: int | None = None,
) -> float:
    """How many rows (px, with fractions) lower the right view shows a point.

    The most frequent row offset of the class matching, then twice: disparity by "sgm", then Lucas-Kanade
    steps along y over all matched edge pixels, robustly weighted. Arguments and units are those of
    `edge_disparity`. 0.0 where nothing can be matched; ValueError and UserWarning as there.
    """
    rows, doubtful = _estimate_row_offset(*checked_views(left, right), _options(locals()))
    if doubtful:
        warn_of_rows(row_range)
    return rows


def edge_pixels(view: ArrayLike, *, blur_sigma: float = 2.0, threshold: float = 2.0, threads: int | None = None) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Rows and columns, (N,) each, px, of the edge pixels of a view (H, W) or (H, W, 3): where
    `edge_disparity` looks for a match.

    They have a gradient (Gaussian of `blur_sigma` px) of at least `threshold` grey levels/px and are the
    steepest along its direction.
    """
    return _edge_pixels(view, **_options(locals()))


def _options(arguments: dict[str, Any]) -> dict[str, Any]:
    """The keyword options among a function's arguments, in their units; what is of another kind, length or
    sign is refused by name."""
    return checked_matching({name: value for name, value in arguments.items() if name not in ("left", "right", "view")})
