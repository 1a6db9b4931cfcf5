"""Edge disparity on the synthetic stereo scenes: density, errors and time of each pair of views."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

import jacoflow
from benchmarks.scenes import stereo as scenes
from benchmarks.scores.stereo import count, figures

LARGER_IS_BETTER = ("density",)
SEEDS = (101, 102, 103)
"""Of the scenes' textures and noise; none of them is used elsewhere."""
SCENES = ("crossing", "curved", "cart", "small")


def rows() -> dict[str, list[float]]:
    """One value for each scene, seed and step."""
    found: dict[str, list[float]] = {"density": [], "MAE": [], "outliers": [], "occluded": [], "ms": []}
    for name in SCENES:
        for seed in SEEDS:
            scene = replace(scenes.SCENES[name](), seed=seed, steps=2)
            for shown in scene.sequence():
                begun = time.process_time()
                result = jacoflow.stereo.edge_disparity(
                    shown.left, shown.right, disparity_range=scene.disparity_range, threads=1
                )
                found["ms"].append(1e3 * (time.process_time() - begun))
                edges = np.zeros(shown.left.shape, bool)
                edges[jacoflow.stereo.edge_pixels(shown.left)] = True
                reached = figures([count(result.disparity, edges, shown.disparity, shown.visible)])
                for key in ("density", "MAE", "outliers", "occluded"):
                    found[key].append(float(reached[key]))
    return found
