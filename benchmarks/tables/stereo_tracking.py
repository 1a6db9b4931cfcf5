"""The stereo tracker on synthetic scenes, both modes, beside the specification's figures.

    python -m benchmarks.tables.stereo_tracking [--only crossing cart] [--modes improved paper] [--trials 3]

Shares of edge pixels:

- purity: in clusters of their own majority label;
- recall: of an object's, in clusters where it is the majority;
- grouped: of an object's, in its largest cluster and in its largest group; then of that group, the object's.

Numbers of steps until an object is hidden, least (mean) over the runs:

- path: the chain of strongest arcs stays on the object;
- index: its component stays the same;
- id: its track stays the same from the first step on;
- kept: share of the steps at which the object is visible with one track;
- recognised: runs in which it has the track from before it was hidden again within three steps.

Errors are medians of |error| of (u, v, w), px and disparity a step, over clusters that are at least 80 %
pure. `speed` is the affine motion at the object's pixels beside the median of the truth there, `velocity` is
`next_velocity` beside the truth at `middle`, `median` is `next_velocity` beside the median over the object.
Gross errors are above 2 px or 1 disparity, counted along x and y, and by length.

Seeds are those of textures, noise and mixture; the first is the specification's. The mode of the paper starts
its mixture at random in every step, so each texture is followed from several starts. Times are medians, on
the clock and of all threads together.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scenes import stereo as stereo_scenes
from benchmarks.scores.stereo_tracking import Clustering, Graph, Node, Scores, Truth, gross, gross_along
from jacoflow.track import StereoCluster, StereoTracker

Row = dict[str, object]
STARTS = {"paper": 8, "improved": 1}
"""Starts of the mixture from which each texture is followed."""

ASKED = {
    ("crossing", "paper"): ".946; .685 .857 .942; path 6-7/9 10-11/11 16/16; index 2-3 2-4 3-6; "
    "recognised 0 of 3; speed 0: 3.0 0 0 (100 %), 3: 2.0 .07 .40 (53 %)",
    ("crossing", "improved"): ".978; .912 .951 .992; path 9/9 11/11 16/16; index 9 11 16; "
    "recognised 3 of 3; speed 0: .003 .003 .011 (1.1 %), 3: .014 .005 .012 (0 %)",
    ("curved", "paper"): ".968; .979 .947; path 10/10 10/10; speed 1: 2.3 .85 .47",
    ("curved", "improved"): ".982; .999 .979; path 10/10 10/10; speed 1: .005 .006 .013",
    ("cart", "paper"): ".933; .952 .929; path 8/8; speed 1: 1.4 3.9 0",
    ("cart", "improved"): ".972; .976 .979; path 8/8 (10/10 by id); speed 1: .008 .008 .011",
    ("small", "paper"): ".949; .951 .934; speed 1: 1.0 0 0, 2: 1.6 .08 .30",
    ("small", "improved"): ".966; .971 .967; speed 1: .004 .002 .019, 2: .004 .004 .009",
}
"""Purity; recall of each object; then the rest, as the specification has it."""
MOTIONS: dict[str, Literal["affine", "velocity", "median"]] = {
    "speed": "affine",
    "velocity": "velocity",
    "median": "median",
}
"""Rows of motions, and what is compared in them."""


@dataclass(frozen=True)
class Cost:
    """Time of a step, s."""

    wall: float
    cpu: float
    """Of all threads together."""
    rounds: tuple[float, float]
    """Rounds of the mixture in the first step, and the mean of those after it."""


def follow(
    scene: stereo_scenes.Scene, sequence: Sequence[stereo_scenes.Step], tracker: StereoTracker, from_truth: bool
) -> tuple[Scores, Cost]:
    """Scores of a sequence, and the time of a step, the median."""
    clusterings, costs, rounds = [], [], []
    rng = np.random.default_rng(scene.seed)
    for shown in sequence:
        disparity = edges_of_truth(shown, rng) if from_truth else None
        wall, cpu = time.perf_counter(), time.process_time()
        step = (
            tracker.update(shown.left, shown.right)
            if disparity is None
            else tracker.update_disparity(shown.left, disparity)
        )
        costs.append((time.perf_counter() - wall, time.process_time() - cpu))
        rounds.append(step.rounds)
        clusterings.append(Clustering(step.rows, step.cols, step.cluster_of_pixel))
    nodes = {key: node_of(cluster) for key, cluster in tracker.graph.nodes.items()}
    arcs = {(t, start, end): sum(shares) for ((t, start), (_, end)), shares in tracker.graph.arcs.items()}
    truths = [Truth(shown.label, shown.motion) for shown in sequence]
    return Scores(truths, clusterings, Graph(nodes, arcs)), Cost(
        *map(float, np.median(costs, axis=0)), (float(rounds[0]), float(np.mean(rounds[1:])))
    )


def node_of(cluster: StereoCluster) -> Node:
    """What the scores need of a cluster."""
    velocity, affine = [
        None if np.isnan(value).any() else value for value in (cluster.next_velocity, cluster.next_affine)
    ]
    return Node(cluster.track_id, velocity, cluster.group, affine, cluster.middle)


def edges_of_truth(shown: stereo_scenes.Step, rng: np.random.Generator) -> NDArray[np.float32]:
    """True disparities, (H, W), px, with a little noise, at the pixels where the left view is steep; NaN
    elsewhere: the tracker alone."""
    gradient = np.hypot(*np.gradient(shown.left.astype(float)))
    noisy = shown.disparity + rng.normal(0, 0.12, shown.disparity.shape)
    return np.where(shown.visible & (gradient > np.quantile(gradient, 0.93)), noisy, np.nan).astype(
        np.float32
    )


def sequences(
    scene: stereo_scenes.Scene, mode: str, textures: int, starts: int, from_truth: bool
) -> list[list[tuple[Scores, Cost]]]:
    """Each texture from each start."""
    disparity_range, components = scene.disparity_range, 16 if mode == "improved" else 12
    out = []
    for texture in range(textures):
        sequence = replace(scene, seed=scene.seed + 20 * texture).sequence()
        trackers = [
            StereoTracker(
                mode,
                n_components=components,
                disparity_range=disparity_range,
                random_state=texture + textures * start,
            )
            for start in range(starts)
        ]
        out.append([follow(scene, sequence, tracker, from_truth) for tracker in trackers])
    return out


def of_object(label: int, textures: Sequence[Sequence[Scores]], steps: int, grouping: bool) -> Row:
    """How one object was found and followed."""
    scores = [score for sequences in textures for score in sequences]
    hidden = scores[0].first_hidden(label)
    row: Row = {f"recall {label}": float(np.mean([score.recall(label) for score in scores]))}
    lasting = {
        "path": (Scores.path, hidden),
        "index": (Scores.index_kept, hidden),
        "id": (Scores.id_kept, steps),
    }
    for what, (kept, most) in lasting.items():
        counts = [kept(score, label) for score in scores]
        row[f"{what} {label}"] = f"{min(counts)}/{most} ({np.mean(counts):.1f})"
    row[f"kept {label}"] = " ".join(
        f"{np.mean([score.id_share(label) for score in sequences]):.2f}" for sequences in textures
    )
    back = [score.recognised(label) for score in scores]
    if None not in back:
        row[f"recognised {label}"] = f"{sum(map(bool, back))} of {len(back)}"
    if grouping:
        row[f"grouped {label}"] = " ".join(
            f"{np.mean(share):.2f}" for share in zip(*(score.grouped(label) for score in scores), strict=True)
        )
    return row


def of_motion(
    what: str, told: Literal["affine", "velocity", "median"], labels: Sequence[int], scores: Sequence[Scores]
) -> Row:
    """Errors of the motion of each object."""
    row: Row = {}
    errors = [score.motion_errors(told) for score in scores]
    for label in labels:
        of_label = [error[label] for error in errors if label in error]
        if of_label:
            medians = np.mean([np.median(error, axis=0) for error in of_label], axis=0)
            along, by_length = (
                100 * np.mean([share(error) for error in of_label]) for share in (gross_along, gross)
            )
            row[f"{what} {label}"] = (
                " ".join(f"{value:.3f}" for value in medians)
                + f" ({along:.1f} %, by length {by_length:.1f} %)"
            )
    return row


def scored(scene: stereo_scenes.Scene, mode: str, seeds: int, starts: int, from_truth: bool) -> Row:
    """One row of the table."""
    labels = [int(label) for label in sorted({layer.label for layer in scene.layers} - {0})]
    followed = sequences(scene, mode, seeds, starts, from_truth)
    textures = [[score for score, _ in sequences] for sequences in followed]
    scores = [score for sequences in textures for score in sequences]
    row: Row = {
        "scene": scene.name,
        "mode": mode,
        "sequences": len(scores),
        "purity": float(np.mean([score.purity() for score in scores])),
    }
    for label in labels:
        row |= of_object(label, textures, scene.steps, mode == "improved")
    for what, told in MOTIONS.items():
        row |= of_motion(what, told, [0, *labels], scores)
    if mode == "improved":
        row["groups"] = float(np.mean([score.groups() for score in scores]))
    row["short tracks"] = float(np.mean([score.short_tracks() for score in scores]))
    costs = [cost for sequences in followed for _, cost in sequences]
    row["ms a step"] = 1e3 * float(np.median([cost.wall for cost in costs]))
    row["ms, all threads"] = 1e3 * float(np.median([cost.cpu for cost in costs]))
    row["rounds, first step / later"] = " / ".join(
        f"{np.mean(each):.0f}" for each in zip(*(cost.rounds for cost in costs), strict=True)
    )
    row["asked"] = ASKED.get((scene.name, mode), "-")
    return row


SCENES = {
    name: stereo_scenes.SCENES[name]
    for name in ("crossing", "curved", "cart", "passing", "pillar", "tiny", "small")
}


SEEDS = 3
"""Textures of each scene."""


def table(name: str, options: report.Options) -> list[Row]:
    """One row for each mode; the paper's only on the scenes of the specification. `quick`: one seed, one
    start."""
    modes = [mode for mode in options.modes if mode == "improved" or (name, mode) in ASKED]
    seeds = options.trials or (1 if options.quick else SEEDS)
    return [
        scored(SCENES[name](), mode, seeds, 1 if options.quick else STARTS[mode], False) for mode in modes
    ]


TABLES = {
    name: report.Table(f"Stereo tracking, {name}", lambda o, name=name: table(name, o)) for name in SCENES
}
ARGUMENTS = {"--modes": {"nargs": "+", "choices": ("improved", "paper"), "default": ("improved", "paper")}}

if __name__ == "__main__":
    report.main(__doc__, TABLES, ARGUMENTS)
