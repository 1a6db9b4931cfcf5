"""The stereo tracker on random sequences of people who cross or are hidden: clusters, tracks, motion,
outcomes of tests, time.

JACOFLOW_ABLATION=quick takes four sequences of each kind instead of ten.
"""

from __future__ import annotations

import os
import time

import numpy as np

from benchmarks.ablation import outcomes
from benchmarks.tables.stereo_tracking_chance import KINDS, comings_back, labels, scored

LARGER_IS_BETTER = ("purity", "recall", "path", "kept", "recognised", "tests")
TESTS = ("test_stereo_track.py", "test_stereo_track_scenes.py")
"""Tests of the tracker."""
FIRST_SEED = 300
"""Of the sequences; none of them is used elsewhere."""


def rows() -> dict[str, list[float]]:
    """One value for each sequence, the mean over its objects."""
    count = 4 if os.environ.get("JACOFLOW_ABLATION") == "quick" else 10
    figures = (
        "purity",
        "recall",
        "path",
        "kept",
        "recognised",
        "speed error",
        "depth error",
        "short tracks",
        "ms",
    )
    found: dict[str, list[float]] = {name: [] for name in figures}
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
            back = list(comings_back(scores, scene).values())
            found["purity"].append(scores.purity())
            found["recall"].append(float(np.mean([scores.recall(label) for label in objects])))
            found["path"].append(
                float(np.mean([scores.path(label) / max(1, scores.first_hidden(label)) for label in objects]))
            )
            found["kept"].append(float(np.mean([scores.id_share(label) for label in objects])))
            # Sequences without a return count as recognised: they change nothing in the difference.
            found["recognised"].append(float(np.mean(back)) if back else 1.0)
            found["speed error"].append(
                float(np.mean([np.hypot(*error[:2]) for error in errors])) if errors else 0.0
            )
            found["depth error"].append(float(np.mean([error[2] for error in errors])) if errors else 0.0)
            found["short tracks"].append(scores.short_tracks())
    found["tests"] = outcomes.passed(*TESTS)
    return found
