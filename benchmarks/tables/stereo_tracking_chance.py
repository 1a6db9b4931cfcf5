"""The stereo tracker on random scenes of people who cross: whether a hidden object is recognised.

    python -m benchmarks.tables.stereo_tracking_chance [--trials 60]

- `crossing`: the layout of the scene `crossing` with random places, speeds, depths, sizes and textures.
- `passing`: a person is hidden for some steps by a pillar, by another person or by two; noise of 1 to 4 grey
  levels.

An object counts if it is visible for at least three steps before it is hidden and for two after that. Paths
last until an object is hidden; `kept` is the share of the steps at which an object is visible with one and
the same track.
"""

from __future__ import annotations

import numpy as np

from benchmarks import report
from benchmarks.scenes.stereo import Scene
from benchmarks.scenes.stereo_chance import KINDS, labels
from benchmarks.scores.stereo_tracking import Scores
from benchmarks.tables.stereo_tracking import follow
from jacoflow.track import StereoTracker

Row = dict[str, object]
SEQUENCES = 60
"""Of each kind."""
HISTORY = 3
"""Steps before it is hidden at which an object must have been seen."""


def scored(scene: Scene, seed: int) -> Scores:
    """What the tracker makes of a sequence."""
    return follow(
        scene, scene.sequence(), StereoTracker(disparity_range=scene.disparity_range, random_state=seed), False
    )[0]


def comings_back(scores: Scores, scene: Scene) -> dict[int, bool]:
    """Of each object that was hidden and came back, seen long enough before and after: whether it was
    recognised."""
    told = {
        label: scores.recognised(label) for label in labels(scene) if scores.first_hidden(label) >= HISTORY
    }
    return {label: recognised for label, recognised in told.items() if recognised is not None}


def row(kind: str, sequences: int) -> Row:
    """One row of the table."""
    back, kept, paths, recalls, purities = [], [], [], [], []
    for seed in range(sequences):
        scene = KINDS[kind](seed)
        scores = scored(scene, seed)
        back += list(comings_back(scores, scene).values())
        purities.append(scores.purity())
        for label in labels(scene):
            kept.append(scores.id_share(label))
            recalls.append(scores.recall(label))
            paths.append(scores.path(label) / max(1, scores.first_hidden(label)))
    means = {
        name: float(np.mean(values))
        for name, values in {"purity": purities, "recall": recalls, "path": paths, "kept": kept}.items()
    }
    return {"sequences": kind, "number": sequences, **means, "recognised": f"{sum(back)} of {len(back)}"}


def table(sequences: int) -> list[Row]:
    """One row for each kind of sequences."""
    return [row(kind, sequences) for kind in KINDS]


TABLES = {
    "chance": report.Table(
        "Stereo tracking, sequences by chance", lambda o: table(report.trials(o, SEQUENCES, 1))
    )
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
