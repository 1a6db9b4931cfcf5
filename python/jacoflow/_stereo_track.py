"""The stereo tracker's classes; they are offered by `jacoflow.track`."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._brief import Brief, Rows
from ._checks import real_number, switch
from ._jacoflow import MissingDependencyError, _StereoTracker, _TrackGraph
from ._stereo_options import StereoCamera, as_array, checked, checked_views, warn_of_rows, whole_number

if TYPE_CHECKING:
    import networkx as _networkx  # type: ignore[import-untyped, unused-ignore]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class StereoCluster(Brief):
    """A cluster of edge pixels at one step. Lengths in px of the left view, depths as disparity (px), times
    in steps (velocities, per step: for the unit of the tracker's `step_time`, which by default is one); NaN
    where nothing was measured."""

    time: int
    """Step, from 0 (no unit)."""
    index: int
    """Component of the mixture (no unit)."""
    track_id: int
    """Track that the cluster is part of (no unit)."""
    group: int
    """Clusters of one group move as one object; the number is that of the group's oldest track (no unit)."""
    n_pixels: int
    """Edge pixels in it, no unit."""
    weight: float
    """Weight of the component, 0 to 1, no unit."""
    mean: Array
    """Mean (x, y) of the component, and the median disparity of the cluster's pixels, (3,), px."""
    covariance: Array
    """Covariance of (x, y, disparity), (3, 3), px^2: the component's, and a twelfth of a cell and of a
    disparity squared for what counting in voxels hides."""
    velocity: Array
    """Motion (u, v, w) since the last step, (3,), px/step and disparity/step: at `middle`, which `affine`
    begins with, and in depth the robust mean over its pixels. Of what grows or turns, `affine` says what each
    pixel does."""
    next_velocity: Array
    """Motion (u, v, w) to the next step, (3,), px/step and disparity/step, at `middle` and in depth the
    robust mean; known in the graph one step later, NaN before."""
    middle: Array
    """Medians along x and y, (2,), px, of its pixels; in "improved" of those on its own surface, without
    outliers and pixels of its outline that lie beyond it: so `velocity` is the median of the affine motion
    over these."""
    affine: Array
    """Motion in the picture since the last step as (u, v, u_x, v_x, u_y, v_y) at `middle`, (6,), px/step and
    1/step ("improved")."""
    next_affine: Array
    """Motion in the picture to the next step, in the same way, (6,), px/step and 1/step; known in the graph
    one step later."""
    residual: float
    """Truncated mean absolute difference of brightness that the motion leaves, in grey levels of 8 bits; one
    such level is the unit."""
    coasting: bool
    """Whether the motion is an extrapolation, because what was measured jumped or could not be measured (no
    unit)."""
    depth: float
    """Depth Z = f B / (d - d_infinity), in units of the baseline's; NaN unless the cameras are known."""
    metric_velocity: Array
    """Velocity (X, Y, Z) since the last step, (3,), in units of the baseline's per step; NaN unless the
    cameras are known."""


@dataclass(frozen=True, eq=False, repr=False)
class StereoStep(Rows):
    """All clusters of a step, and the N edge pixels of the left view that they are made of; lengths in px."""

    _ROWS = ("rows", "cols", "values", "cluster_of_pixel")

    time: int
    """Step, from 0 (no unit)."""
    clock: float
    """Time since the first step, in the unit of the tracker's `step_time`; `time` unless `dt` was given."""
    clusters: list[StereoCluster]
    """Clusters with edge pixels, by component; none where the views show no edges (no unit)."""
    rows: NDArray[np.uint32]
    """Rows of the edge pixels with a disparity, (N,), px."""
    cols: NDArray[np.uint32]
    """Their columns, (N,), px."""
    values: NDArray[np.float32]
    """Their disparities, (N,), px."""
    cluster_of_pixel: NDArray[np.uint32]
    """`index` of the cluster that each belongs to, (N,), no unit."""
    left_out: int
    """Disparities farther than 1.5 px outside of `disparity_range` (of the layers of `grid`, where these are
    more), which took no part; no unit."""
    row_offset: float
    """How many rows lower the right view shows a point, px, as these views were matched; NaN where
    disparities were given."""
    rows_doubtful: bool
    """Whether the row offset was searched and the views disagree with it: many disparities are wrong (no
    unit)."""
    rounds: int
    """Rounds of the mixture, no unit."""


@dataclass(frozen=True, eq=False, repr=False)
class StereoTrack(Rows):
    """One object's way through T steps, in px."""

    _ROWS = ("times", "positions", "velocities", "clock")

    times: NDArray[np.int64]
    """Steps at which it was seen, (T,), ascending, no unit."""
    positions: Array
    """`mean` (x, y, disparity) of its cluster there, (T, 3), px."""
    velocities: Array
    """Motion (u, v, w) since the step before, (T, 3), px/step and disparity/step (for the unit of time, if
    that is no step); NaN where not measured."""
    clock: Array
    """When that was, time since the first step, (T,), in the unit of the tracker's `step_time`: `times`
    unless `dt` was given."""


class TrackGraph:
    """Clusters of all steps and the arcs between them: equation (33) of the stereo paper. Nodes are pairs
    (step, component), no unit.

    An arc's score is `e(k, k') = e(k -> k') + e(k <- k')`, 0 to 2: the shares of both clusters' voxels that
    meet the other one, forwards and backwards in time.
    """

    def __init__(self, compiled: _TrackGraph | None = None) -> None:
        self._graph = _TrackGraph.from_json('{"format": "jacoflow track graph 1", "nodes": [], "arcs": []}') if compiled is None else compiled

    @property
    def nodes(self) -> dict[tuple[int, int], StereoCluster]:
        """Clusters by (step, component), no unit."""
        clusters = (StereoCluster(**node) for node in self._graph.nodes())
        return {(cluster.time, cluster.index): cluster for cluster in clusters}

    @property
    def arcs(self) -> dict[tuple[tuple[int, int], tuple[int, int]], tuple[float, float]]:
        """Shares (forward, backward), 0 to 1 (no unit), by the two clusters that an arc connects."""
        return {((time, start), (time + 1, end)): (forward, backward) for time, start, end, forward, backward in self._graph.arcs()}

    def follow(self, t: int, k: int, threshold: float = 0.4, backward: bool = False) -> list[tuple[int, int]]:
        """A track: the clusters (step, component), no unit, reached from (t, k) along arcs whose score is at
        least `threshold`, itself among them.

        Raises
        ------
        ValueError
            For a cluster that is not there, naming `node`, and a `threshold` outside of 0 to 2.
        """
        time, index = (whole_number("node", at) for at in (t, k))
        if time < 0 or index < 0:
            raise ValueError(f"node: expected a cluster of the graph, got ({t}, {k})")
        return self._graph.follow(time, index, real_number("threshold", threshold), switch("backward", backward))

    def to_networkx(self, flat: bool = False) -> _networkx.DiGraph[tuple[int, int]]:
        """As a `networkx.DiGraph`: nodes (step, component) with the attributes of `StereoCluster` (px,
        steps), edges with `forward`, `backward`, 0 to 1, and `score`.

        Arrays are lists there, which networkx' JSON (`node_link_data`) can hold. `flat`: every number is an
        attribute by itself, `mean_0` to `mean_2`, `covariance_0_0` and so on, which the formats that know no
        lists need (GraphML, GEXF, GML).

        Raises
        ------
        jacoflow.MissingDependencyError
            Without networkx.
        """
        try:
            import networkx
        except ImportError as error:
            raise MissingDependencyError('networkx is not installed; pip install "jacoflow[graph]"') from error
        graph: _networkx.DiGraph[tuple[int, int]] = networkx.DiGraph()
        for node in self._graph.nodes():
            graph.add_node((node["time"], node["index"]), **(_flat(node) if flat else _listed(node)))
        for (start, end), (forward, backward) in self.arcs.items():
            graph.add_edge(start, end, forward=forward, backward=backward, score=forward + backward)
        return graph

    def to_json(self) -> str:
        """As JSON text with every digit; what was not measured is null. Lengths in px."""
        return self._graph.to_json()

    @classmethod
    def from_json(cls, text: str) -> TrackGraph:
        """From the text that `to_json` gives, number for number; lengths in px. Raises `ValueError` naming
        `json` for any other text, and for a cluster or an arc that is there twice; `TypeError` for what is no
        text."""
        if not isinstance(text, str):
            raise TypeError(f"json: expected a text (str), got {type(text).__name__}")
        return cls(_TrackGraph.from_json(text))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TrackGraph) and bool(self._graph == other._graph)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"TrackGraph({len(self._graph.nodes())} clusters, {len(self._graph.arcs())} arcs)"

    def __reduce__(self) -> tuple[Any, ...]:
        return TrackGraph.from_json, (self.to_json(),)


def _listed(node: dict[str, Any]) -> dict[str, Any]:
    """A node's attributes with lists for arrays."""
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in node.items()}


def _flat(node: dict[str, Any]) -> dict[str, Any]:
    """A node's attributes with a number for each entry of an array."""
    out = {}
    for name, value in node.items():
        if isinstance(value, np.ndarray):
            out.update({"_".join([name, *map(str, at)]): float(entry) for at, entry in np.ndenumerate(value)})
        else:
            out[name] = value
    return out


class StereoTracker:
    """Tracks all moving objects before two cameras, which may move themselves: nothing is learned or marked
    beforehand.

    Source: the stereo paper ("tracking of moving objects in stereo sequences by fusing disparity and
    luminance", with a variational mixture of Gaussians). Edge pixels with a disparity are counted in voxels
    of (x, y, disparity), clustered by a mixture weighted with the counts, and followed to the next step in
    the picture and in depth; overlaps of the clusters in both directions of time are arcs of a graph. It is
    deterministic for any number of threads. It pickles, also in mid-stream.

    Parameters
    ----------
    mode : "improved" or "paper"
        "improved" (default): motion is measured to fractions of a pixel by affine Lucas-Kanade and carries
        the mixture's components along, so that a component is a track; hidden tracks are recognised, clusters
        that move alike are grouped; the exposure of both cameras may change from step to step.
        "paper": the paper's text, with a new mixture at each step, motion in whole cells and tracks along the
        strongest arcs.
    n_components : int
        Components of the mixture; default 16 ("paper": 12). One cluster moves affinely: where that is true of
        small pieces only, as of a street seen from a car, take 48 or so, and a larger `search`.
    disparity_range, row_range : (int, int), px
        Smallest and largest disparity, and row offset of the right view, that are searched.
    row_offset : float, px
        Row offset; default: estimated at the first suitable step and again where later ones contradict it
        ("improved"), or searched at every pixel ("paper").
    grid : (rows, columns, layers)
        Cells along y and x over the picture, and layers of one disparity each; layers None: the length of
        `disparity_range`, and no fewer.
    search : int
        How far templates and depths are searched, cells and disparities; default 8. A larger change of
        disparity in one step is not measured.
    camera : StereoCamera
        The cameras. With them, clusters have a depth and a velocity in space.
    step_time : float
        Time between ordinary steps, in the unit of `dt` in `update` and of velocities; default 1: steps. With
        times in seconds and 30 frames a second, give 1/30.
    random_state : int
        Seed of the fits.
    threads : int
        Number of threads; default the environment's, else all.

    Raises
    ------
    ValueError
        For options out of range; the message names the option.

    Examples
    --------
    >>> tracker = StereoTracker(grid=(30, 40, None), disparity_range=(-8, 8), n_components=4, row_offset=0.0)
    >>> cells = np.random.default_rng(1).integers(0, 200, (12, 20)).repeat(8, 0).repeat(8, 1).astype(np.uint8)
    >>> for t in range(3):
    ...     step = tracker.update(cells[:, 10 - 2 * t : 138 - 2 * t], cells[:, 13 - 2 * t : 141 - 2 * t])
    >>> largest = max(step.clusters, key=lambda cluster: cluster.n_pixels)
    >>> largest.velocity.round(1).tolist()[0], round(float(largest.mean[2]))
    (2.0, 3)
    """

    def __init__(
        self,
        mode: Literal["improved", "paper"] = "improved",
        *,
        n_components: int | None = None,
        disparity_range: tuple[int, int] = (-40, 24),
        row_range: tuple[int, int] = (-4, 4),
        row_offset: float | None = None,
        grid: tuple[int, int, int | None] = (60, 80, None),
        search: int = 8,
        camera: StereoCamera | None = None,
        step_time: float = 1.0,
        random_state: int = 0,
        threads: int | None = None,
    ) -> None:
        options = {name: value for name, value in locals().items() if name not in ("self", "__class__")}
        given = checked(options)
        self._tracker = _StereoTracker(given)
        self._disparity_range, self._row_range = given["disparity_range"], given["row_range"]

    def update(self, left: ArrayLike, right: ArrayLike, dt: float | None = None) -> StereoStep:
        """The next step from both views, arrays (H, W) or (H, W, 3) of uint8, uint16, float32 or float64, at
        least 17 px along each axis and as large as those before.

        Pixels that are masked (numpy.ma) or not finite leave no edges round them; views without edges give a
        step without clusters. Of videos, `zip(video.frames(left), video.frames(right))` makes pairs; frames
        that hold both views are cut by `numpy.split(frame, 2, axis=1)` (side by side) or `axis=0`
        (top-bottom); where each was squeezed to half its width or height, disparities and motion along that
        axis are in squeezed pixels (the binary stretches them: `--layout half-side-by-side`).

        `dt`: time since the last step, in the unit of `step_time`, from a millionth to a million of it;
        default one ordinary step, 2 where a frame is missing. Velocities are then still for the unit of time;
        predictions and limits in steps refer to that time. Of the first step it means nothing.

        Raises
        ------
        ValueError
            For views of different size or of another size than before, naming both shapes, and a `dt` that is
            not above 0 or out of its range.

        Warns
        -----
        UserWarning
            Where views with edges disagree at every row offset in `row_range`; the disparities are then
            mostly wrong.
        """
        step = _step(self._tracker.update(*checked_views(left, right), _waited(dt)))
        if step.rows_doubtful:
            warn_of_rows(self._row_range)
        return step

    def update_disparity(self, left: ArrayLike, disparity: ArrayLike, dt: float | None = None) -> StereoStep:
        """The next step from the left view (H, W) and disparities found elsewhere, (H, W), px, `x_left -
        x_right`, NaN for pixels that shall take no part; `dt` as in `update`.

        Disparities farther than 1.5 px outside of the layers of the grid, which are those of
        `disparity_range` unless `grid` has more, take no part either: `StereoStep.left_out` counts them.

        Raises
        ------
        ValueError
            As `update`.

        Warns
        -----
        UserWarning
            Where disparities were left out.
        """
        step = _step(self._tracker.update_disparity(as_array(left), as_array(disparity), _waited(dt)))
        if step.left_out:
            all_of_them = step.left_out + len(step.rows)
            warnings.warn(f"disparity: {step.left_out} of {all_of_them} are outside of disparity_range, {self._disparity_range}, and were left out", UserWarning, stacklevel=2)
        return step

    @property
    def row_offset(self) -> float | None:
        """How many rows lower the right view shows a point, px: the one given, or what was found as long as
        the views agree with it; None where nothing is known ("classes" searches it at every pixel)."""
        return self._tracker.row_offset()

    @property
    def graph(self) -> TrackGraph:
        """Clusters of all steps so far and their arcs; lengths in px."""
        return TrackGraph(self._tracker.graph())

    @property
    def tracks(self) -> dict[int, StereoTrack]:
        """Tracks by id; lengths in px."""
        return {track: StereoTrack(*parts) for track, parts in self._tracker.tracks().items()}


def _waited(dt: float | None) -> float | None:
    return None if dt is None else real_number("dt", dt)


def _step(fields: dict[str, Any]) -> StereoStep:
    clusters = [StereoCluster(**cluster) for cluster in fields.pop("clusters")]
    return StereoStep(clusters=clusters, **fields)
