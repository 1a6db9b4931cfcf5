"""The stereo tracker on a recording: five pairs of KITTI 2012 from a driving car, with the known flow of one
of them.

    python -m benchmarks.tables.stereo_tracking_recordings --data FOLDER [--picture FILE]

The affine motion of its cluster predicts where each edge pixel of pair 10 is in pair 11. Where the true flow
is known the table has the end-point error and the outliers as KITTI counts them (more than 3 px and 5 % off).
`best affine` is the median error that is left if each cluster's affine motion is fitted to the true flow of
its pixels: the cost of the size of the clusters alone. With the usual 16 components one holds the whole road;
the second row has three times as many, and a search range for the near objects of this recording (120 px and
8 disparities a step).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scenes.recordings import read_grey
from jacoflow import plot
from jacoflow.track import StereoCamera, StereoStep, StereoTracker

try:
    import cv2
except ImportError:
    cv2 = None

Array = NDArray[np.floating]
FRAMES = range(7, 12)
SEQUENCE = "000151"
FOCAL, BASELINE = 721.5377, 0.53715
"""Of the recording's cameras, px and m."""
KNOWN = 10 - FRAMES[0]
"""The step with a known flow, to the one after it."""


@dataclass(frozen=True)
class Recording:
    """Pairs of views, and the truth of one of them."""

    pairs: list[tuple[NDArray[np.uint8], NDArray[np.uint8]]]
    flow: Array
    """(H, W, 2), px, NaN where unknown."""
    disparity: Array
    """(H, W), px, NaN where unknown."""


def read(data: Path) -> Recording:
    """The recording in a folder of recordings."""
    folder = data / "kitti2012"
    pairs = []
    for index in FRAMES:
        left, right = (
            read_grey(folder / f"image_{camera}" / f"{SEQUENCE}_{index:02d}.png") for camera in (0, 1)
        )
        pairs.append((left, right))
    # OpenCV turns the order of the channels round: valid, v, u.
    valid, v, u = np.moveaxis(
        cv2.imread(str(folder / "flow_occ" / f"{SEQUENCE}_10.png"), cv2.IMREAD_UNCHANGED).astype(float), -1, 0
    )
    flow = np.where(valid[..., None] > 0, (np.stack([u, v], axis=-1) - 32768) / 64, np.nan)
    disparity = cv2.imread(str(folder / "disp_occ" / f"{SEQUENCE}_10.png"), cv2.IMREAD_UNCHANGED) / 256.0
    return Recording(pairs, flow, np.where(disparity > 0, disparity, np.nan))


SETTINGS: dict[str, dict[str, Any]] = {
    "improved, 16 components": {"mode": "improved"},
    "improved, 48 components, search 16": {"mode": "improved", "n_components": 48, "search": 16},
    "paper, 12 components": {"mode": "paper"},
    "paper, 48 components, search 16": {"mode": "paper", "n_components": 48, "search": 16},
}
"""Options of the tracker, by name."""
DRAWN = "improved, 48 components, search 16"


def follow(recording: Recording, settings: str) -> tuple[StereoTracker, list[StereoStep]]:
    """The tracker after the recording, and its steps."""
    tracker = StereoTracker(
        **SETTINGS[settings], disparity_range=(0, 127), row_offset=0.0, camera=StereoCamera(FOCAL, BASELINE)
    )
    return tracker, [tracker.update(left, right) for left, right in recording.pairs]


def motion_of_pixels(tracker: StereoTracker, step: StereoStep) -> Array:
    """What the clusters of a step say of the motion of their pixels to the next one, (N, 2), px; NaN where
    they say nothing."""
    motion = np.full((len(step.rows), 2), np.nan)
    for cluster in step.clusters:
        told, mine = tracker.graph.nodes[step.time, cluster.index], step.cluster_of_pixel == cluster.index
        motion[mine] = told.next_velocity[:2]
        if np.isfinite(told.next_affine).all():
            u, v, u_x, v_x, u_y, v_y = told.next_affine
            dx, dy = step.cols[mine] - told.middle[0], step.rows[mine] - told.middle[1]
            motion[mine] = np.stack([u + u_x * dx + u_y * dy, v + v_x * dx + v_y * dy], axis=-1)
    return motion


def best_affine(step: StereoStep, flow: Array) -> Array:
    """Errors (N,), px, of the affine motion of each cluster that is nearest to the true flow (N, 2) of its
    pixels, found by weighting them over and over; NaN where there is no truth, or too little of it."""
    error = np.full(len(flow), np.nan)
    known = np.isfinite(flow).all(axis=-1)
    for index in np.unique(step.cluster_of_pixel):
        mine = (step.cluster_of_pixel == index) & known
        if mine.sum() < 20:
            continue
        places = np.stack(
            [
                np.ones(mine.sum()),
                step.cols[mine] - step.cols[mine].mean(),
                step.rows[mine] - step.rows[mine].mean(),
            ],
            axis=-1,
        )
        weights = np.ones(len(places))
        for _ in range(20):
            map_ = np.linalg.lstsq(places * weights[:, None], flow[mine] * weights[:, None], rcond=None)[0]
            left = np.hypot(*(flow[mine] - places @ map_).T)
            weights = 1 / (1 + left)
        error[mine] = left
    return error


def row(recording: Recording, settings: str) -> dict[str, object]:
    """How well the tracker does."""
    begun = time.perf_counter()
    tracker, steps = follow(recording, settings)
    spent = 1e3 * (time.perf_counter() - begun) / len(steps)
    step = steps[KNOWN]
    truth = recording.flow[step.rows, step.cols]
    known = np.isfinite(truth).all(axis=-1)
    said = motion_of_pixels(tracker, step)[known]
    error = np.hypot(*(said - truth[known]).T)
    told = np.isfinite(error)
    wrong = (error > 3) & (error > 0.05 * np.hypot(*truth[known].T))
    off = np.abs(step.values - recording.disparity[step.rows, step.cols])
    lengths = [len(track.times) for track in tracker.tracks.values()]
    return {
        "mode": settings,
        "edge pixels": len(step.rows),
        "with known flow": int(known.sum()),
        "told": float(told.mean()),
        "median error": float(np.nanmedian(error)),
        "outliers": float(wrong[told].mean()),
        "best affine": float(np.nanmedian(best_affine(step, truth))),
        "median speed": float(np.median(np.hypot(*truth[known].T))),
        "disparity MAE": float(np.nanmean(off)),
        "disparity off by 3 px": float((off[np.isfinite(off)] > 3).mean()),
        "clusters": len(step.clusters),
        "tracks through all pairs": sum(length == len(steps) for length in lengths),
        "ms a step": spent,
    }


def rows(data: Path) -> list[dict[str, object]]:
    """One row for each of `SETTINGS`."""
    if cv2 is None:
        return [{"mode": "skipped: OpenCV, which reads the pictures, is missing"}]
    try:
        recording = read(data)
    except FileNotFoundError as missing:
        return [{"mode": f"skipped: {missing}"}]
    return [row(recording, settings) for settings in SETTINGS]


def draw(data: Path, out: Path) -> None:
    """Disparities, clusters by track and by group, and the graph, at the pair with a known flow."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    recording = read(data)
    tracker, steps = follow(recording, DRAWN)
    step, left = steps[KNOWN], recording.pairs[KNOWN][0]
    figure, axes = pyplot.subplots(4, 1, figsize=(14, 20), layout="constrained", height_ratios=(1, 1, 1, 0.8))
    disparity = np.full(left.shape, np.nan)
    disparity[step.rows, step.cols] = step.values
    axes[0].imshow(0.6 * left, cmap="gray", vmin=0, vmax=255)
    points = axes[0].scatter(
        step.cols, step.rows, c=step.values, s=1.5, marker="s", linewidths=0, cmap="turbo"
    )
    figure.colorbar(points, ax=axes[0], label="disparity, px")
    for each, by in zip(axes[1:3], ("track", "group"), strict=True):
        plot.clusters(step, left=left, axes=each, by=by)
    plot.track_graph(tracker.graph, axes=axes[3])
    figure.savefig(out, dpi=80)


def table(options: report.Options) -> report.Rows:
    """The rows; draws the picture that `--picture` asks for."""
    if options.data is None:
        return []
    if options.picture is not None:
        draw(options.data, options.picture)
    return rows(options.data)


TABLES = {"recordings": report.Table("Stereo tracking, recordings", table)}
ARGUMENTS = {"--picture": {"type": Path, "help": "file of a picture of the clusters"}}

if __name__ == "__main__":
    report.main(__doc__, TABLES, ARGUMENTS)
