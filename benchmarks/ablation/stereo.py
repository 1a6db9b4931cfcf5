"""The stereo tracker on random sequences of people who cross or are hidden: clusters, tracks, motion,
outcomes of tests, time; tracks where some frames come twice, as after a change of the frame rate; and tracks
of three boxes of 20 to 32 px.

JACOFLOW_ABLATION=quick takes four sequences of each kind instead of forty.
"""

from __future__ import annotations

import os
import time
from dataclasses import replace

import numpy as np

from benchmarks.ablation import outcomes
from benchmarks.scenes.stereo import Scene, tiny
from benchmarks.scores.stereo_tracking import Scores
from benchmarks.tables.stereo_tracking import follow
from benchmarks.tables.stereo_tracking_chance import KINDS, comings_back, labels, scored
from jacoflow.track import StereoTracker

LARGER_IS_BETTER = (
    "purity", "recall", "path", "kept", "recognised", "repeated, kept", "repeated, recognised", "tiny, kept",
    "tests",
)  # fmt: skip
TESTS = ("test_stereo_track.py", "test_stereo_track_scenes.py")
"""Tests of the tracker."""
FIRST_SEED = 300
"""Of the sequences; none of them is used elsewhere."""
REPEATED = (4, 9, 13)
"""Steps that come twice."""
TINY = 12
"""Sequences of tiny boxes, at most."""


def rows() -> dict[str, list[float]]:
    """One value for each sequence, the mean over its objects."""
    count = 4 if os.environ.get("JACOFLOW_ABLATION") == "quick" else 40
    found: dict[str, list[float]] = {
        name: [] for name in (*LARGER_IS_BETTER[:-1], "speed error", "depth error", "short tracks", "ms")
    }
    for kind, scene_of in KINDS.items():
        for seed in range(FIRST_SEED, FIRST_SEED + count):
            scene = scene_of(seed)
            begun = time.process_time()
            scores = scored(scene, seed)
            found["ms"].append(1e3 * (time.process_time() - begun) / scene.steps)
            objects = labels(scene)
            errors = [
                np.median(each, axis=0) for label, each in scores.motion_errors("velocity").items() if label
            ]
            found["purity"].append(scores.purity())
            found["recall"].append(float(np.mean([scores.recall(label) for label in objects])))
            found["path"].append(
                float(np.mean([scores.path(label) / max(1, scores.first_hidden(label)) for label in objects]))
            )
            found["kept"].append(float(np.mean([scores.id_share(label) for label in objects])))
            found["recognised"].append(recognised(scores, scene))
            found["speed error"].append(
                float(np.mean([np.hypot(*error[:2]) for error in errors])) if errors else 0.0
            )
            found["depth error"].append(float(np.mean([error[2] for error in errors])) if errors else 0.0)
            found["short tracks"].append(scores.short_tracks())
        for seed in range(FIRST_SEED, FIRST_SEED + count):
            scene = scene_of(seed)
            steps = [step for k, step in enumerate(scene.sequence()) for _ in range(1 + (k in REPEATED))]
            tracker = StereoTracker(disparity_range=scene.disparity_range, random_state=seed)
            scores = follow(scene, steps, tracker, False)[0]
            found["repeated, kept"].append(float(np.mean([scores.id_share(label) for label in labels(scene)])))
            found["repeated, recognised"].append(recognised(scores, scene))
    for seed in range(FIRST_SEED, FIRST_SEED + min(count, TINY)):
        scene = replace(tiny(), seed=seed)
        scores = scored(scene, seed)
        found["tiny, kept"].append(float(np.mean([scores.id_share(label) for label in labels(scene)])))
    found["tests"] = outcomes.passed(*TESTS)
    return found


def recognised(scores: Scores, scene: Scene) -> float:
    """Share of the returns of objects that are recognised; 1 without any, which changes no difference."""
    back = list(comings_back(scores, scene).values())
    return float(np.mean(back)) if back else 1.0
