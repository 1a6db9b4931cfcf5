"""How good disparities at edge pixels are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Mask = NDArray[np.bool_]

REACH = 2
"""Edges are only localised to a pixel or two: the truth that suits best within this many px counts."""
WRONG = 1.0
"""Error that makes a disparity an outlier, px."""
FAR_OFF = 2.0
"""Error above which a disparity does not count in the mean, px."""
Counts = NDArray[np.float64]


def least_error(disparity: Array, truth: Array, reach: int = REACH) -> Array:
    """(H, W), least |disparity - truth| in px over the truths within `reach` px along both axes; NaN
    without disparity or truth."""
    height, width = truth.shape
    padded = np.pad(truth, reach, constant_values=np.nan)
    best = np.full(truth.shape, np.inf)
    for dy in range(2 * reach + 1):
        for dx in range(2 * reach + 1):
            best = np.fmin(best, np.abs(disparity - padded[dy : dy + height, dx : dx + width]))
    return np.where(np.isfinite(best), best, np.nan)


def count(disparity: Array, edges: Mask, truth: Array, visible: Mask) -> Counts:
    """(6,): edge pixels seen by both cameras, those of them with a disparity, outliers among these, those
    near enough to be averaged, the sum of their errors (px), and accepted pixels without a match."""
    seen, given = edges & visible, np.isfinite(disparity)
    accepted = seen & given
    error = least_error(disparity, truth)[accepted]
    near = error <= FAR_OFF
    false = int((edges & ~visible & given).sum())
    return np.array(
        [seen.sum(), accepted.sum(), (error > WRONG).sum(), near.sum(), error[near].sum(), false], dtype=float
    )


def figures(counts: Sequence[Counts]) -> dict[str, float]:
    """density: share of the edge pixels seen by both that have a disparity; MAE over errors up to 2 px;
    outliers: share over 1 px off; occluded: accepted pixels without a match, in accepted ones."""
    seen, accepted, wrong, near, total, false = np.sum(counts, axis=0)
    if seen == 0 or accepted == 0:
        return {"density": 0.0, "MAE": float("nan"), "outliers": float("nan"), "occluded": float("nan")}
    return {
        "density": accepted / seen,
        "MAE": total / max(near, 1.0),
        "outliers": wrong / accepted,
        "occluded": false / accepted,
    }
