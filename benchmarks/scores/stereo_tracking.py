"""Clusters of edge pixels beside the objects of a scene: purity, recall, paths, tracks, errors of motion.

The truth of a sequence is one `Truth` a step. The output of a tracker is one `Clustering` a step (edge pixels
with the component of each) and the nodes and arcs of its graph.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Integers = NDArray[np.integer]

VISIBLE = 0.25
"""Share of an object's greatest area below which it counts as hidden."""
PURE = 0.8
"""Share of a cluster's pixels with one label from which on its motion is compared with that object's."""
GROSS = (2.0, 1.0)
"""Errors of the motion above which it is gross: px/step in the picture, disparity/step."""


@dataclass(frozen=True)
class Truth:
    """A step of a scene."""

    label: Integers
    """(H, W)."""
    motion: Array
    """(u, v, w) to the next step, (H, W, 3), px and disparity."""


@dataclass(frozen=True)
class Clustering:
    """What a tracker said of a step."""

    rows: Integers
    columns: Integers
    component: Integers
    """Of each of the N edge pixels."""


@dataclass(frozen=True)
class Node:
    """A cluster of the graph."""

    track_id: int
    velocity: Array | None
    """(u, v, w) to the next step, px and disparity; None: not measured."""
    group: int = 0
    """Clusters of one group are one object."""
    affine: Array | None = None
    """(u, v, u_x, v_x, u_y, v_y) to the next step at `middle`."""
    middle: Array | None = None
    """(x, y), px."""

    def motion(self, x: Integers, y: Integers) -> Array:
        """What it says of pixels (x, y): (N, 3), px and disparity."""
        assert self.velocity is not None
        motions = np.tile(np.asarray(self.velocity, float), (len(x), 1))
        if self.affine is not None and self.middle is not None:
            u, v, u_x, v_x, u_y, v_y = self.affine
            dx, dy = x - self.middle[0], y - self.middle[1]
            motions[:, 0], motions[:, 1] = u + u_x * dx + u_y * dy, v + v_x * dx + v_y * dy
        return motions


@dataclass(frozen=True)
class Graph:
    """Nodes by (step, component); scores of arcs by (step, from, to)."""

    nodes: dict[tuple[int, int], Node]
    arcs: dict[tuple[int, int, int], float]


@dataclass(frozen=True)
class Cluster:
    """A cluster seen with the truth: its majority label, that label's share, how many pixels, the label's
    pixels among them and their true motion."""

    label: int
    purity: float
    pixels: int
    rows: Integers
    columns: Integers
    motion: Array
    place: Array
    """Their medians along x and y, px."""
    motion_at: Array
    """An affine map of their true motion, (3, 3): from (x - place, y - place, 1) to (u, v, w), by least
    squares; exact where they are of one plane or of what grows."""


def told(truth: Truth, clustering: Clustering) -> dict[int, Cluster]:
    """Every cluster of a step by its component."""
    out = {}
    labels = truth.label[clustering.rows, clustering.columns]
    motions = truth.motion[clustering.rows, clustering.columns]
    # Pixels by component, in their order.
    order = np.argsort(clustering.component, kind="stable")
    components, begins = np.unique(clustering.component[order], return_index=True)
    for component, mine in zip(components, np.split(order, begins[1:]), strict=True):
        values, counts = np.unique(labels[mine], return_counts=True)
        major = values[np.argmax(counts)]
        right = mine[labels[mine] == major]
        motion = np.median(motions[right], axis=0)
        share = float(counts.max() / counts.sum())
        rows, columns = clustering.rows[right], clustering.columns[right]
        place = np.array([np.median(columns), np.median(rows)])
        offsets = np.stack([columns - place[0], rows - place[1], np.ones(len(rows))], axis=1)
        motion_at = np.linalg.lstsq(offsets, motions[right], rcond=None)[0]
        out[int(component)] = Cluster(
            int(major), share, len(mine), rows, columns, motion, place, motion_at
        )
    return out


class Scores:
    """Everything that is measured of one sequence; steps are counted from 0."""

    def __init__(self, truths: Sequence[Truth], clusterings: Sequence[Clustering], graph: Graph) -> None:
        self.truths, self.clusterings, self.graph = truths, clusterings, graph
        self.told = [told(*step) for step in zip(truths, clusterings, strict=True)]
        self._seen: dict[int, list[bool]] = {}

    def purity(self) -> float:
        """Share of edge pixels in clusters of their own majority label."""
        clusters = [cluster for step in self.told for cluster in step.values()]
        return sum(c.purity * c.pixels for c in clusters) / max(1, sum(c.pixels for c in clusters))

    def seen(self, label: int) -> list[bool]:
        """At which steps enough of an object is visible."""
        if label not in self._seen:
            areas = [int((truth.label == label).sum()) for truth in self.truths]
            self._seen[label] = [area >= VISIBLE * max(areas) for area in areas]
        return self._seen[label]

    def recall(self, label: int) -> float:
        """Share of an object's edge pixels in clusters where it is the majority, over the steps at which
        it is visible."""
        right, all_ = 0, 0
        for truth, clustering, clusters, seen in zip(
            self.truths, self.clusterings, self.told, self.seen(label), strict=True
        ):
            if seen:
                mine = truth.label[clustering.rows, clustering.columns] == label
                components, counts = np.unique(clustering.component[mine], return_counts=True)
                right += sum(
                    int(n) for k, n in zip(components, counts, strict=True) if clusters[int(k)].label == label
                )
                all_ += int(mine.sum())
        return right / max(1, all_)

    def first_hidden(self, label: int) -> int:
        """Steps until the object is hidden for the first time."""
        seen = self.seen(label)
        return seen.index(False) if False in seen else len(seen)

    def largest(self, time: int, label: int) -> int | None:
        """The largest cluster of an object."""
        mine = {k: c.pixels for k, c in self.told[time].items() if c.label == label}
        return max(mine, key=lambda k: mine[k]) if mine else None

    def on(self, time: int, component: int | None, label: int) -> bool:
        """Whether a cluster is there and is the object's."""
        cluster = None if component is None else self.told[time].get(component)
        return cluster is not None and cluster.label == label

    def _steps(self, label: int, where: Sequence[int | None]) -> int:
        """Over how many steps from the first the given clusters stay on an object."""
        count = 0
        for time, component in enumerate(where):
            if not self.on(time, component, label):
                break
            count += 1
        return count

    def path(self, label: int) -> int:
        """Over how many steps the chain of strongest arcs from the object's largest cluster stays on it,
        until it is hidden."""
        at = self.largest(0, label)
        chain = [at]
        for time in range(self.first_hidden(label) - 1):
            leaving = {to: score for (t, k, to), score in self.graph.arcs.items() if (t, k) == (time, at)}
            at = max(leaving, key=lambda to: leaving[to]) if leaving else None
            chain.append(at)
        return self._steps(label, chain)

    def index_kept(self, label: int) -> int:
        """Over how many steps the component that is the object's largest cluster at first stays on it,
        until it is hidden."""
        return self._steps(label, [self.largest(0, label)] * self.first_hidden(label))

    def id_kept(self, label: int) -> int:
        """Over how many steps from the first the track of its largest cluster at first stays on it."""
        first = self.largest(0, label)
        if first is None:
            return 0
        wanted = self.graph.nodes[0, first].track_id
        by_step = [
            {node.track_id: k for (t, k), node in self.graph.nodes.items() if t == time}
            for time in range(len(self.told))
        ]
        return self._steps(label, [ids.get(wanted) for ids in by_step])

    def id_share(self, label: int) -> float:
        """Share of the steps at which an object is visible where the track that is a main one of it most
        often is: one whose cluster has at least half as many of its pixels as its largest cluster."""
        times = [time for time, seen in enumerate(self.seen(label)) if seen]
        tracks = [track for time in times for track in self._main_tracks(time, label)]
        return max((tracks.count(track) for track in tracks), default=0) / max(1, len(times))

    def _main_tracks(self, time: int, label: int) -> set[int]:
        """Tracks of the object's largest cluster and of those at least half as large."""
        sizes = {k: cluster.pixels for k, cluster in self.told[time].items() if cluster.label == label}
        return {
            self.graph.nodes[time, k].track_id for k, size in sizes.items() if 2 * size >= max(sizes.values())
        }

    def _track(self, time: int, label: int) -> int | None:
        """Track of the object's largest cluster."""
        largest = self.largest(time, label)
        return None if largest is None else self.graph.nodes[time, largest].track_id

    def recognised(self, label: int) -> bool | None:
        """Whether the object's largest cluster, from the third step on after it was hidden until it is hidden
        again, is on one of the tracks that its main clusters had at the last three steps before that (two
        things may have been one object all along). Steps at which it has no cluster of its own, which
        `recall` counts, are left out. None where it never comes back for two steps."""
        seen = self.seen(label)
        hidden = self.first_hidden(label)
        back = next((t for t in range(hidden, len(seen)) if seen[t]), None)
        if back is None or hidden == 0:
            return None
        gone = next((t for t in range(back, len(seen)) if not seen[t]), len(seen))
        if gone - back < 2:
            return None
        before = {
            track for time in range(max(0, hidden - 3), hidden) for track in self._main_tracks(time, label)
        }
        own = [time for time in range(back, gone) if self.largest(time, label) is not None]
        return bool(own) and all(self._track(time, label) in before for time in own[2:] or own[-1:])

    def short_tracks(self) -> float:
        """Share of the tracks that last one step, of those that do not begin at the last one."""
        steps: dict[int, list[int]] = defaultdict(list)
        for (time, _), node in sorted(self.graph.nodes.items()):
            steps[node.track_id].append(time)
        begun = [times for times in steps.values() if times[0] < len(self.told) - 1]
        return sum(len(times) == 1 for times in begun) / max(1, len(begun))

    def grouped(self, label: int) -> tuple[float, float, float]:
        """Share of an object's edge pixels in its largest cluster, in its largest group, and share of that
        group's pixels that are the object's; means over the steps after the first at which it is visible."""
        shares = []
        for time, (truth, clustering, seen) in enumerate(
            zip(self.truths, self.clusterings, self.seen(label), strict=True)
        ):
            if time == 0 or not seen:
                continue
            mine = truth.label[clustering.rows, clustering.columns] == label
            components, places = np.unique(clustering.component, return_inverse=True)
            groups = np.array([self.graph.nodes[time, int(k)].group for k in components])[places]
            _, of_clusters = np.unique(clustering.component[mine], return_counts=True)
            names, of_groups = np.unique(groups[mine], return_counts=True)
            if len(of_groups):
                largest = groups == names[np.argmax(of_groups)]
                shares.append(
                    (
                        of_clusters.max() / mine.sum(),
                        of_groups.max() / mine.sum(),
                        (largest & mine).sum() / largest.sum(),
                    )
                )
        first, second, third = np.mean(shares, axis=0) if shares else (0.0, 0.0, 0.0)
        return float(first), float(second), float(third)

    def groups(self) -> float:
        """Groups of a step after the first, mean."""
        counts = [
            len({node.group for (t, _), node in self.graph.nodes.items() if t == time})
            for time in range(1, len(self.told))
        ]
        return float(np.mean(counts))

    def motion_errors(self, told: Literal["affine", "velocity", "median"] = "affine") -> dict[int, Array]:
        """|error| of (u, v, w) of every pure cluster, (N, 3), px and disparity, by the label of its majority.

        `affine`: median of the affine motion over the label's pixels beside the median of the truth there.
        `velocity`: velocity beside the truth of the label at the cluster's `middle`, where that is known.
        `median`: velocity beside the median of the truth; one row of pixels too many makes .06
        px where the motion varies.
        """
        errors = defaultdict(list)
        for time, clusters in enumerate(self.told[:-1]):
            for component, cluster in clusters.items():
                node = self.graph.nodes[time, component]
                if cluster.purity >= PURE and node.velocity is not None:
                    said = (
                        np.median(node.motion(cluster.columns, cluster.rows), axis=0)
                        if told == "affine"
                        else node.velocity
                    )
                    true = cluster.motion
                    if told == "velocity" and node.middle is not None:
                        true = np.array([*(node.middle - cluster.place), 1.0]) @ cluster.motion_at
                    errors[cluster.label].append(np.abs(said - true))
        return {label: np.array(values) for label, values in errors.items()}


def gross(errors: Array) -> float:
    """Share of motions (N, 3) that are off by more than the gross errors, in the picture by the length of
    the error."""
    off = (np.hypot(errors[:, 0], errors[:, 1]) > GROSS[0]) | (errors[:, 2] > GROSS[1])
    return float(off.mean())


def gross_along(errors: Array) -> float:
    """The same, in the picture by the error along x or along y: of motions in whole cells of 8 px, one of
    22 px/step is off by 2 px along x, and by its length whenever anything is left along y."""
    off = (errors[:, :2] > GROSS[0]).any(axis=1) | (errors[:, 2] > GROSS[1])
    return float(off.mean())
