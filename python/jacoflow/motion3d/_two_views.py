"""What a motion does to points."""

from __future__ import annotations

from typing import Literal

from numpy.typing import ArrayLike

from .._checks import switch
from .._jacoflow import _motion3d_essential, _motion3d_predict
from ._checks import Array, kind, word
from ._results import MotionEstimate, MotionSolution


def predict_flow(
    points: ArrayLike,
    translation: ArrayLike,
    rotation: ArrayLike,
    inv_depth: ArrayLike,
    K: ArrayLike | None = None,
    *,
    projection: Literal["plane", "sphere"] = "plane",
    whole_frame: bool = False,
) -> Array:
    """Flow of points under a motion: (N, 2), px/frame with K, else per frame; on the sphere (N, 3).

    Instantaneous flow (1) where the points are, or (`whole_frame`) the exact displacement of points of the
    first view to the second as the motion is steady over the frame, `X_2 = exp([w]x) X_1 + V(w) u`: what a
    result of `estimate_motion` with placement "midpoint" says that the flow was.

    Parameters
    ----------
    points : array (N, 2), px with K, else on the plane at distance 1; (N, 3), unit bearings, on the sphere
        Where.
    translation, rotation : arrays (3,), the latter in rad/frame
        The motion. The translation need not have length 1: inverse depths are in units of its length.
    inv_depth : array (N,)
        Inverse depths; with `whole_frame` half way in time, as `estimate_motion` returns them.
    K : array (3, 3) or None
        Camera matrix, px.
    projection : "plane" or "sphere"
        The screen.
    whole_frame : bool
        Displacements over the whole frame, on the plane only; NaN where a point would be behind the camera.

    Raises
    ------
    ValueError
        For shapes and values that do not fit.
    """
    return _motion3d_predict(points, inv_depth, translation, rotation, K, word("projection", projection), switch("whole_frame", whole_frame))


def essential_matrix(result: MotionEstimate | MotionSolution) -> Array:
    """The essential matrix `[t]x Rot` (3, 3), no unit, of the two views: `eta_2 @ E @ eta_1 = 0`, with `Rot =
    exp([w]x)` and `t = V(w) u`, as the motion is steady over the frame."""
    kind("result", result, MotionEstimate, MotionSolution)
    return _motion3d_essential(result.translation, result.rotation)
