"""How well several targets were followed: success by the centre and the overlap, and the measures of
multiple object tracking."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.scores.tracking import overlap

try:
    import motmetrics
except ImportError:
    motmetrics = None

Array = NDArray[np.float64]
INSIDE = 0.8
"""Share of the frames in which the centre must lie in the target's own true box for a success."""
LAST = 10
"""Frames at the end over which the overlap must still be good for a success."""
LAST_OVERLAP = 0.3
"""Mean intersection over union there that a success needs."""
FOUND = 0.5
"""Intersection over union from which on a box counts as found."""
MEASURES = {
    "mota": "MOTA",
    "idf1": "IDF1",
    "num_switches": "switches",
    "num_false_positives": "false",
    "num_misses": "missed",
}
"""Measures of py-motmetrics and what the tables call them."""


def overlaps(boxes: Array, truth: Array) -> Array:
    """Intersection over union (T, K) of boxes (T, K, 4); 0 where there is no box, NaN where there is no
    truth."""
    known = np.isfinite(truth).all(axis=-1)
    result = overlap(boxes.reshape(-1, 4), truth.reshape(-1, 4)).reshape(known.shape)
    return np.where(known, np.nan_to_num(result), np.nan)


def held(boxes: Array) -> Array:
    """The boxes (T, K, 4), the last one standing where there is none."""
    result = boxes.copy()
    for t in range(1, len(result)):
        result[t] = np.where(np.isfinite(result[t]), result[t], result[t - 1])
    return result


def success(boxes: Array, truth: Array) -> list[dict[str, float]]:
    """Figures of each target: `success` (0 or 1: the centre in its true box in 80 % of the frames, and mean
    overlap of 0.3 in the last ten), mean `overlap` and mean `centre_error`, px. Where a tracker gives no box
    its last one stands."""
    boxes = held(boxes)
    shares = overlaps(boxes, truth)
    offsets = np.abs(boxes[..., :2] + boxes[..., 2:] / 2 - truth[..., :2] - truth[..., 2:] / 2)
    inside = (offsets <= truth[..., 2:] / 2).all(axis=-1).mean(axis=0)
    at_the_end = shares[-LAST:].mean(axis=0)
    return [
        {
            "success": float(inside[k] >= INSIDE and at_the_end[k] >= LAST_OVERLAP),
            "overlap": float(shares[:, k].mean()),
            "centre_error": float(np.hypot(*offsets[:, k].T).mean()),
        }
        for k in range(truth.shape[1])
    ]


def ended_at_truth(boxes: Array, truth: Array) -> Array:
    """The boxes (T, K, 4) without those after the last true box of their target."""
    known = np.isfinite(truth).all(axis=-1)
    last = len(known) - 1 - known[::-1].argmax(axis=0)
    after = np.arange(len(known))[:, None] > last
    return np.where(after[..., None], np.nan, boxes)


def multiple_object(boxes: Array, truth: Array) -> dict[str, float]:
    """MOTA, IDF1, identity switches, false and missed boxes by py-motmetrics, boxes found with an overlap of
    0.5 or more; empty without that package.

    K. Bernardin and R. Stiefelhagen, "Evaluating multiple object tracking performance: the CLEAR MOT
    metrics", 2008; E. Ristani et al., "Performance measures and a data set for multi-target, multi-camera
    tracking", 2016.
    """
    if motmetrics is None:
        return {}
    accumulator = motmetrics.MOTAccumulator(auto_id=True)
    for found, true in zip(boxes, truth, strict=True):
        targets, tracks = (np.flatnonzero(np.isfinite(each).all(axis=-1)) for each in (true, found))
        pairs = np.stack(np.meshgrid(targets, tracks, indexing="ij"), axis=-1).reshape(-1, 2)
        distance = 1 - overlap(true[pairs[:, 0]], found[pairs[:, 1]])
        distance[distance > 1 - FOUND] = np.nan
        accumulator.update(targets.tolist(), tracks.tolist(), distance.reshape(len(targets), len(tracks)))
    table = motmetrics.metrics.create().compute(accumulator, metrics=list(MEASURES), name="all")
    return {name: float(table.loc["all", measure]) for measure, name in MEASURES.items()}
