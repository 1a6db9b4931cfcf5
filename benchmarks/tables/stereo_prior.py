"""What it saves and costs to look for disparities only near those of the step before.

    python -m benchmarks.tables.stereo_prior

Candidates are within 3 px of the disparity that the step before leads to, moved by the true motion: the best
that any prediction could do. On a fence of one grey, whose pales look alike, on one that is textured, and on
people who cross. Outliers are edge pixels more than 1 px off the best truth within 2 px. Times are wall time
of matching with a known row offset.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks import report
from benchmarks.rivals.stereo import edge_pixels
from benchmarks.scenes import stereo as stereo_scenes
from benchmarks.scores.stereo import count, figures

Row = dict[str, object]


def led_to(before: NDArray[np.floating], shown: stereo_scenes.Step) -> NDArray[np.float32]:
    """Where the disparities of a step, (H, W), px, are at the next one: moved, and spread to the 5 x 5 px
    about each place, nearer ones over farther; NaN elsewhere."""
    height, width = before.shape
    rows, columns = np.nonzero(np.isfinite(before))
    u, v, w = shown.motion[rows, columns].T
    values = before[rows, columns] + w
    order = np.argsort(values)
    x, y = np.rint(columns + u).astype(int)[order], np.rint(rows + v).astype(int)[order]
    out = np.full(before.shape, np.nan, np.float32)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            inside = (x + dx >= 0) & (x + dx < width) & (y + dy >= 0) & (y + dy < height)
            out[(y + dy)[inside], (x + dx)[inside]] = values[order][inside]
    return out


def prior_row(scene: stereo_scenes.Scene, method: str, with_prior: bool) -> Row:
    """Quality and time of matching, with and without what the step before says."""
    found, counts, times = None, [], []
    sequence = scene.sequence()
    for t, shown in enumerate(sequence):
        prior = led_to(found, sequence[t - 1]) if with_prior and found is not None else None
        begun = time.perf_counter()
        found = jacoflow.stereo.edge_disparity(
            shown.left,
            shown.right,
            disparity_range=scene.disparity_range,
            row_offset=scene.row_offset,
            method=method,
            prior=prior,
        ).disparity
        if t > 0:
            times.append(time.perf_counter() - begun)
            counts.append(count(found, edge_pixels(shown.left), shown.disparity, shown.visible))
    return {
        "scene": scene.name,
        "method": method,
        "prior": "within 3 px" if with_prior else "none",
        **figures(counts),
        "ms": 1e3 * float(np.median(times)),
    }


def table() -> list[Row]:
    """One row for each scene, method and prior."""
    scenes = stereo_scenes.fence(), stereo_scenes.textured_fence(), stereo_scenes.crossing()
    return [
        prior_row(scene, method, with_prior)
        for scene in scenes
        for method in ("classes", "sgm")
        for with_prior in (False, True)
    ]


TABLES = {
    "prior": report.Table(
        "Disparity of edge pixels, looked for near those of the step before", lambda _: table()
    )
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
