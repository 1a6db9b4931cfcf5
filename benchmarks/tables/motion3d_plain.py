"""What a robust search costs where nothing is wrong: time of one estimate on one thread, beside OpenCV.

    python -m benchmarks.tables.motion3d_plain [--trials 24]

Points all over 640 x 480 px, f = 500 px, inverse depths .01 to .03, unknown noise of .02 to .1 px; a share of
the flow may be anything within 15 px. OpenCV's RANSAC is given twice the noise as its threshold.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.rivals.motion3d import cv2, two_view
from benchmarks.scenes import motion3d as scenes
from benchmarks.scores.motion3d import angle
from jacoflow import motion3d

Array = NDArray[np.float64]
CASES = ((1000, 0.0), (3000, 0.0), (1000, 0.4), (3000, 0.4))
"""Number of points and share of outliers."""
RANGE = 15.0
"""Largest component of an outlier's flow, px."""


def scene(seed: int, n: int, share: float = 0.0) -> tuple[Array, Array, Array, Array, float]:
    """(points, flow, translation, rotation, noise) of `n` points, the first `share` of them outliers."""
    rng = np.random.default_rng((seed, 77))
    u, w = scenes.motion(("oblique", "forward", "lateral", "off")[seed % 4])
    pixels, nu = rng.uniform([0, 0], [640, 480], (n, 2)), rng.uniform(0.01, 0.03, n)
    noise = float(rng.uniform(0.02, 0.1))
    flow = scenes.displaced(pixels, nu, u, 0.1 * w) - pixels + noise * rng.normal(size=(n, 2))
    outliers = int(share * n)
    flow[:outliers] = rng.uniform(-RANGE, RANGE, (outliers, 2))
    return pixels, flow, u, 0.1 * w, noise


def row(n: int, share: float, trials: int) -> dict[str, object]:
    """Median times, ms, and median error of the direction, degrees."""
    times: dict[str, list[float]] = {}
    errors: list[float] = []

    def timed(name: str, run: Callable[[], object]) -> object:
        begun = time.perf_counter()
        found = run()
        times.setdefault(name, []).append(1e3 * (time.perf_counter() - begun))
        return found

    for seed in range(trials):
        points, flow, u, _, noise = scene(seed, n, share)
        found = timed(
            "robust, ms", lambda: motion3d.estimate_motion(points, flow, scenes.K, robust=True, threads=1)
        )
        assert isinstance(found, motion3d.MotionEstimate)
        errors.append(angle(found.translation, u))
        if share == 0:
            timed("without robust, ms", lambda: motion3d.estimate_motion(points, flow, scenes.K, threads=1))
        if cv2 is not None:
            timed("OpenCV RANSAC, ms", lambda: two_view(points, flow, scenes.K, noise, "RANSAC"))
    medians = {name: float(np.median(values)) for name, values in times.items()}
    return {"points": n, "outliers": share, **medians, "error, degrees": float(np.median(errors))}


TABLES = {
    "plain": report.Table(
        "3-D motion: a scene without any difficulty",
        lambda o: [row(n, share, report.trials(o, 24, 4)) for n, share in CASES],
    )
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
