"""The particle tracker: targets that may look alike, cross and hide each other, followed in colour frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._brief import Rows
from ._jacoflow import _ParticleStep, _ParticleTracker
from ._particle_options import checked, checked_box, checked_boxes, checked_camera, checked_id

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ParticleCorners(Rows):
    """The N corners that were followed from the frame before; lengths in px."""

    _ROWS = ("ids", "positions", "residuals", "p", "owner")

    ids: NDArray[np.int64]
    """Their numbers, (N,), no unit: a corner keeps its number as long as it is followed."""
    positions: Array
    """Where they are, (N, 2), px."""
    residuals: Array
    """How they move relative to the background, (N, 2), px/frame."""
    p: Array
    """Probability of not being background, (N,), no unit."""
    owner: NDArray[np.int64]
    """The target that each belongs to, (N,), -1: none; no unit."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False, repr=False)
class ParticleStep(Rows):
    """The K targets at one frame, in ascending order of their ids. Lengths in px, times in frames.

    It stays what it is when the tracker goes on, and pickles. For that it holds the particles (56 bytes each)
    and shares with the tracker one copy of the frame, from which `foreground` and `segments` are made when
    they are first used; `without` drops them.
    """

    _ROWS = ("ids", "boxes", "position", "velocity", "size", "covariance", "effective_sample_size", "similarity", "n_tracks", "degenerate", "status", "reason")

    frame: int
    """Index of the frame, 0 for the one that the tracker began with (no unit)."""
    ids: NDArray[np.int64]
    """Numbers of the targets, (K,), no unit."""
    boxes: Array
    """Left, top, width and height, (K, 4), px, with left = x - width / 2."""
    position: Array
    """Centres (x, y), (K, 2), px."""
    velocity: Array
    """Velocities relative to the scene (in paper mode to the picture), (K, 2), px/frame."""
    size: Array
    """Widths and heights, (K, 2), px."""
    covariance: Array
    """Covariance of the particles: x, y (px), u, v (px/frame), width, height (px), (K, 6, 6)."""
    effective_sample_size: Array
    """1 / sum of squared weights before the particles are drawn again, (K,), particles."""
    similarity: Array
    """Likeness of the colours to the first frame's, .9 quantile over the particles, 0 to 1, (K,), no unit."""
    n_tracks: NDArray[np.int64]
    """How many corner tracks belong to each target, (K,), no unit."""
    degenerate: NDArray[np.bool_]
    """Whether no particle had a weight: the estimate is then the prediction, (K,), no unit."""
    near: NDArray[np.bool_]
    """Which targets are near each other, (K, K), no unit."""
    status: tuple[str, ...]
    """K words: "tracking", "occluded" (near and covered, or colours unlike), "coasting" (hidden), "out" (the
    centre, carried on by one frame, leaves the picture) or "lost" (hidden for more than 30 frames).
    """
    reason: tuple[str, ...]
    """Why each status is what it is, K strings; empty if there is nothing to be said (no unit)."""
    camera: Array
    """Motion of the background since the frame before, (2, 3): (x', y') = camera @ (x, y, 1), px; the
    identity in paper mode.
    """
    tracks: ParticleCorners
    """The corners followed from the frame before; none in the first frame; lengths in px."""
    _compiled: _ParticleStep = field(repr=False)

    def __len__(self) -> int:
        return len(self.ids)

    def index(self, id: int) -> int:
        """Place of a target among the K of this step, no unit; KeyError where it is not there."""
        found = np.flatnonzero(self.ids == id)
        if not len(found):
            raise KeyError(id)
        return int(found[0])

    def particles(self, id: int) -> tuple[Array, Array]:
        """Particles of a target, (N, 6): centre x, y (px), velocity u, v (px/frame), width, height (px); and
        their weights, (N,), no unit.

        Raises
        ------
        ValueError
            For an `id` that is not there, and for a step that does not keep its particles.
        """
        found = self._compiled.particles(checked_id(id))
        if found is None:
            raise ValueError("keep_particles: expected a step that keeps its particles, got one that does not")
        return found

    @cached_property
    def foreground(self) -> NDArray[np.float32]:
        """What is not background, (H, W), 0 to 1, no unit. Density of the corners that do not move with the
        background, averaged over the segments, divided by its maximum; 0 without such corners.

        ValueError for a step that does not keep its frame.
        """
        return self._of_frame(self._compiled.foreground)

    @cached_property
    def segments(self) -> NDArray[np.int32]:
        """Segments of the frame (of the last one that showed anything), labels (H, W) from 0, no unit.
        ValueError as `foreground`.
        """
        return self._of_frame(self._compiled.segments)

    def _of_frame(self, make: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        if not self._compiled.keeps_frame():
            raise ValueError("keep_frames: expected a step that keeps its frame, got one that does not")
        return make()

    def without(self, *, frame: bool = True, particles: bool = True) -> ParticleStep:
        """The same step without its frame, without its particles or without both, for little memory (no
        unit): then `foreground` and `segments`, or `particles`, are not to be had.
        """
        return step_of(self._compiled.keeping(not frame, not particles))

    def __reduce__(self) -> tuple[Callable[[_ParticleStep], ParticleStep], tuple[_ParticleStep]]:
        return step_of, (self._compiled,)


def step_of(compiled: _ParticleStep) -> ParticleStep:
    """A step, in px and frames, of its compiled part."""
    fields = compiled.as_dict()
    return ParticleStep(tracks=ParticleCorners(**fields.pop("tracks")), _compiled=compiled, **fields)


class ParticleTracker:
    """Follows targets that look alike, cross and hide each other before a moving camera: a filter for each.

    Source: K. Takechi, S. Fukui, Y. Iwahori, "Robust tracking by a particle filter with a probabilistic
    background model". A particle holds centre, velocity and size; it is weighed by colour (histograms of
    bands), velocity (near the prediction) and corners that must move with the target. Deterministic: a seed
    fixes everything, bit for bit, on any number of threads, and a target does not depend on others that are
    never near. It pickles, also in midstream.

    It needs texture: a target with fewer than about 4 corners falls back on colour and velocity. The
    background must be what most of the picture shows; else give `camera` to `update`.

    Parameters
    ----------
    frame : array (H, W, 3) of uint8, uint16, float32 or float64, red, green, blue
        The first frame, at least 8 x 8 px. White is 255 or 65535; of floats it is 1, or 255 from the
        first frame on that holds such levels. Pixels that are masked (numpy.ma) or not finite are not
        counted.
    boxes : array (K, 4) or dict id -> box
        Left, top, width, height, px, of the targets in it; rows have the ids 0 to K - 1. May be empty. A box
        may reach over the border. The colours of a box are compared in 8 bands from top to bottom; one of
        fewer than 8 rows has as many bands as rows, but at least 3.
    mode : "improved" or "paper"
        "improved" (default): hidden targets are recognised, corners remember whose they are, particles ride
        on the camera's motion. "paper": the published method, with a foreground map and a distance factor.
    n_particles, n_near : int
        Particles of a target, and while another target is near; at least 8.
    scale : float
        Factor of all lengths; default H / 480.
    likelihoods : sequence of "colour", "velocity", "distance", "tracks", "foreground"
        Factors of a particle's weight; default the mode's: the first two with "tracks" ("improved"), or with
        "distance" and "foreground" ("paper").
    resampling : "multinomial", "stratified", "systematic" or "residual"
        How particles are drawn.
    ess_threshold : float
        They are drawn when the effective sample size is below this share of their number; default 1: in every
        frame.
    foreground : "ratio", "posterior", "literal" or "affine"
        What makes a corner foreground in paper mode: 1 - N / max N of the background's flow, 1 - its
        responsibility, 1 - N as printed, or 1 - the probability of following an affine motion.
    segmentation : dict of scale, sigma, min_size
        Of the foreground map: scale (default 150, grey levels), sigma (default 0.8 px), smallest region
        (px^2, default 120 scale^2).
    grey : "error" or "value"
        "value": frames (H, W) are taken as red = green = blue, so that brightness takes the place of colour.
        Default: they are refused.
    random_state : int
        Seed of all random numbers.
    threads : int
        Number of threads; default the environment's, else all.

    Raises
    ------
    ValueError
        For a frame that is too small or not (H, W, 3), a box that is not finite, has no area or lies outside,
        an id that is used twice and options out of range; each message names the argument.
    TypeError
        For another dtype.

    Examples
    --------
    >>> from jacoflow.scenes import TargetScene
    >>> scene = TargetScene("people_static", scale=0.25, frames=80)
    >>> tracker = ParticleTracker(scene.frame(0), scene.boxes()[0], n_particles=100, n_near=200)
    >>> for t in range(1, 4):
    ...     step = tracker.update(scene.frame(t))
    >>> step.ids.tolist(), step.status, step.boxes.shape
    ([0, 1], ('tracking', 'tracking'), (2, 4))
    """

    def __init__(
        self,
        frame: ArrayLike,
        boxes: ArrayLike | Mapping[int, ArrayLike],
        *,
        mode: Literal["improved", "paper"] = "improved",
        n_particles: int = 1000,
        n_near: int = 2000,
        scale: float | None = None,
        likelihoods: Sequence[str] | None = None,
        resampling: Literal["multinomial", "stratified", "systematic", "residual"] = "multinomial",
        ess_threshold: float = 1.0,
        foreground: Literal["ratio", "posterior", "literal", "affine"] = "ratio",
        segmentation: Mapping[str, float | None] | None = None,
        grey: Literal["error", "value"] = "error",
        random_state: int = 0,
        threads: int | None = None,
    ) -> None:
        options = {name: value for name, value in locals().items() if name not in ("self", "frame", "boxes", "__class__")}
        given = checked(options)
        self._tracker = _ParticleTracker(as_frame(frame), checked_boxes(boxes), given)
        names = ("scale", "sigma", "min_size")
        self._options = {**given, "segmentation": dict(zip(names, given["segmentation"], strict=True))}

    def update(self, frame: ArrayLike, camera: ArrayLike | None = None) -> ParticleStep:
        """The targets in the next frame, an array (H, W, 3) as large as the first.

        A frame without finite pixels is one in which nothing was seen: targets move on, nothing is learned.
        `camera`: the background's motion since the frame before where it is known, (2, 3): (x', y') = camera
        @ (x, y, 1), px; default: measured.

        Raises
        ------
        ValueError
            For a frame of another size, naming both, and a `camera` that is not finite.
        """
        return step_of(self._tracker.update(as_frame(frame), checked_camera(camera)))

    def add(self, bbox: ArrayLike, id: int | None = None) -> int:
        """Adds a target at the last frame by its box (left, top, width, height), px; returns its number, by
        default the next one. A target that is out of the picture may be added again under its own.

        Raises
        ------
        ValueError
            For a `bbox` that is not finite, has no area or lies outside, and an `id` that is in use.
        """
        return self._tracker.add(checked_box("bbox", bbox), None if id is None else checked_id(id))

    def remove(self, id: int) -> None:
        """Removes the target with this number (no unit). ValueError where there is none."""
        self._tracker.remove(checked_id(id))

    @property
    def step(self) -> ParticleStep:
        """The targets at the last frame; lengths in px."""
        return step_of(self._tracker.step())

    @property
    def options(self) -> dict[str, Any]:
        """The options it was made with, by name, in their units."""
        return {**self._options, "segmentation": dict(self._options["segmentation"])}


def as_frame(frame: ArrayLike) -> NDArray[Any]:
    """A frame (H, W, 3) as an array; a masked one stays what it is, and is refused."""
    return frame if isinstance(frame, np.ndarray) else np.asarray(frame)
