"""The motion of what a flow field shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike

from .._jacoflow import FlowField, _motion3d_contact_map, _motion3d_estimate_field
from ._checks import Array, kind, number, optional, whole, word
from ._estimate import OPTIONS, options_of
from ._results import MotionEstimate, SystematicEffect, estimate_of

FIELD_OWN = {
    "noise_std": "has covariances of its own",
    "cov": "has covariances of its own",
    "jacobian": "has a Jacobian of its own, which patches= uses",
    "projection": "is one of the plane",
}
"""Options of `estimate_motion` that a field has of its own, and which it has."""


def estimate_field_motion(
    field: FlowField,
    K: ArrayLike,
    *,
    spacing: float | None = None,
    max_points: int | None = None,
    region: Sequence[int] | None = None,
    scene: MotionEstimate | None = None,
    object_rotation_std: float = 1e-3,
    patches: int | None = None,
    **options: Any,
) -> tuple[MotionEstimate, Array]:
    """The rigid motion of the scene in a flow field, from its own covariances, and the points (N, 2), px,
    that it was estimated from; with `patches` from the Jacobian, too.

    Parameters
    ----------
    field : FlowField
        One field (not a stack) with a covariance, in any units.
    K : array (3, 3)
        Camera matrix, px.
    spacing : px or None
        Least distance of the points along rows and columns; default: twice the field's `correlation_length`,
        but at least 8 px, and closer where a `region` would have fewer than 30 points. Never below the
        `correlation_length`. Points closer than 4 correlation lengths `l`, which share windows, get larger
        covariances: times `4 pi l^2 / spacing^2`. Errors go together farther still; the motion's covariance
        sums that where residuals show it (`correlation_length` of `estimate_motion`), and has in it that all
        flow may be too short or too long by one share, up to what would be the whole error of the quarter of
        the field's points that determine it best (`flow_scale_std`), and that it may be off by one
        displacement, of 0.4 deviations of a point (`flow_bias_std`).
    max_points : int or None
        Most points, of the `region` if there is one; the grid is made coarser to keep to it.
    region : (x, y, width, height), px, or None
        Only points in this rectangle: those of one object, whose motion relative to the camera is then found.
    scene : MotionEstimate or None
        The motion of the whole scene. Its rotation, which is the camera's, is then what is known beforehand
        of the object's rotation in `region`: in a narrow field a rotation looks like a sideways motion, and
        with a slanted surface that trades against the approach.
    object_rotation_std : float, rad/frame
        Standard deviation of the object's own rotation, per axis; it matters only with `scene`.
    patches : px or None
        Side of square windows, at least 8 px, each of which becomes one patch with the six numbers at its
        middle, flow and Jacobian, from a fit of second order to those of its pixels; the points returned are
        the middles. Covariances are those of independent pixels times the pixels over the disjoint windows in
        the patch, of the area `58 l^2` over which errors go together, and more where flow has edges in it.
        Six numbers pay for 2 to 10 large patches (60 px and more) seen through a long lens. Windows lie side
        by side in the frame or `region`; those of which less than half is valid are left out. Not with
        `spacing`, `max_points`, `scene` and `robust`.
    **options
        Those of `estimate_motion` but `noise_std`, `cov`, `jacobian` and `projection`, which are the field's
        own; `robust` is True by default without `patches`.

    Raises
    ------
    ValueError
        For a stack and a field without a covariance, for a `scene` without a `region` or whose rotation is
        not known, for no `K`, and for options that do not fit.
    TypeError
        For a `field` or `scene` that is none, and for options that are not known.
    """
    kind("field", field, FlowField)
    for name, value in options.items():
        if name in FIELD_OWN:
            if value is not None and (name, value) != ("projection", "plane"):
                raise ValueError(f"{name}: expected none, as a field {FIELD_OWN[name]}, got {value!r}")
        elif name not in OPTIONS:
            raise TypeError(f"{name}: expected an option of estimate_field_motion or of estimate_motion, got one that neither has")
    if scene is not None:
        kind("scene", scene, MotionEstimate)
    chosen = {
        "spacing": optional(number)("spacing", spacing),
        "max_points": optional(whole)("max_points", max_points),
        "region": region,
        "patches": optional(whole)("patches", patches),
        "scene": scene and (scene.status, scene.rotation, scene.covariance),
        "object_rotation_std": number("object_rotation_std", object_rotation_std),
    }
    found, points = _motion3d_estimate_field(field, K, chosen, options_of({"robust": patches is None, **options}))
    return estimate_of(found), points


def time_to_contact_map(
    field: FlowField, result: MotionEstimate, K: ArrayLike, *, placement: Literal["midpoint", "start"] = "midpoint"
) -> tuple[Array, Array, Array]:
    """Frames to contact at every pixel of a flow field, (H, W), their standard deviations, frames, and
    residuals, in units of noise.

    Each pixel has the time to contact of its point, `-1 / (nu u_z)` with the inverse depth of its own flow:
    positive when approaching, infinite where the motion has no translation, NaN where the field is not valid.
    Times count from half way between the frames with "midpoint". The deviations are those of the pixel's own
    flow and of the motion, with what both have in common (`result.systematic_errors`); errors of neighbours
    go together over the field's `correlation_length`. A residual beyond 3 shows an object that moves by
    itself, whose time to contact is another one: see `region` of `estimate_field_motion`.

    Parameters
    ----------
    field : FlowField
        One field (not a stack) with a covariance, in any units.
    result : MotionEstimate
        The motion of its scene, from `estimate_field_motion`.
    K : array (3, 3)
        Camera matrix, px.
    placement : "midpoint" or "start"
        As in `estimate_motion`.

    Raises
    ------
    ValueError
        For a stack and a field without a covariance, and for a matrix that is none of a camera.
    """
    kind("field", field, FlowField)
    kind("result", result, MotionEstimate)
    word("placement", placement)
    common = result.systematic_errors
    kind("result.systematic_errors", common, SystematicEffect)
    values = {
        "translation": result.translation,
        "rotation": result.rotation,
        "tangent": result.tangent,
        "covariance": result.covariance,
        "scale": common.scale,
        "displacements": common.displacements,
        "moves": common.motion,
    }
    return _motion3d_contact_map(field, K, values, placement)
