"""How far a step from frame to frame may go: turns, enlargements and shifts of a texture, beside OpenCV.

    python -m benchmarks.tables.limits [--quick]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks import report
from benchmarks.rivals import flow as rivals
from benchmarks.scenes import recordings as samples
from benchmarks.scenes import steps

Row = dict[str, object]
TURNS, ENLARGEMENTS, SHIFTS = (5, 10, 15, 20, 30), (1.05, 1.1, 1.2, 1.3, 1.5), (8, 16, 32, 48, 64)
SEEDS = (0, 1, 2)
MARGIN = 24
"""Pixels at the edges that are left out."""


def cases() -> dict[str, tuple[NDArray[np.float64], tuple[float, float]]]:
    """Names of steps, their matrices and shifts."""
    turns = {f"turn by {degrees} degrees": (steps.turn(np.radians(degrees)), (0.0, 0.0)) for degrees in TURNS}
    larger = {f"enlargement by {factor:.2f}": (factor * np.eye(2), (0.0, 0.0)) for factor in ENLARGEMENTS}
    return turns | larger | {f"shift by {px} px": (np.eye(2), (float(px), 0.0)) for px in SHIFTS}


def limits(seeds: tuple[int, ...]) -> list[Row]:
    """Median end-point error, px, inside the frame; of ours with the share of sites that are `valid`, and of
    silent ones: valid, and off by more than a pixel and five standard deviations."""
    rows: list[Row] = []
    for name, (matrix, shift) in cases().items():
        truth = steps.flow(matrix, shift)
        y, x = np.mgrid[: steps.SIZE, : steps.SIZE]
        ends = np.stack([x, y], axis=-1) + truth
        inside = ((ends >= 0) & (ends < steps.SIZE)).all(axis=-1)
        inside[:MARGIN], inside[-MARGIN:], inside[:, :MARGIN], inside[:, -MARGIN:] = (False,) * 4
        found: dict[str, list[float]] = {}
        for seed in seeds:
            picture = steps.texture(seed)
            before, first, second = (
                steps.moved(picture, np.linalg.matrix_power(matrix, k), (k * shift[0], k * shift[1])) for k in (-1, 0, 1)
            )
            for what, field in (("pair", jacoflow.flow(first, second)), ("triple", jacoflow.flow(before, first, second))):
                error = np.linalg.norm(field.flow - truth, axis=-1)[inside]
                valid = field.valid[inside]
                std = np.hypot(field.std("u"), field.std("v"))[inside]
                found.setdefault(f"{what}, px", []).append(float(np.nanmedian(error)))
                found.setdefault(f"{what}, valid", []).append(float(valid.mean()))
                found.setdefault(f"{what}, silent", []).append(float((valid & (error > 1) & (error > 5 * std)).mean()))
            if samples.cv2 is not None:
                grey = [np.rint(frame).astype(np.uint8) for frame in (first, second)]
                for rival, run in rivals.RIVALS.items():
                    error = np.linalg.norm(run(*grey) - truth, axis=-1)[inside]
                    found.setdefault(rival, []).append(float(np.median(error)))
        rows.append({"step": name} | {key: float(np.mean(values)) for key, values in found.items()})
    return rows


TABLES = {
    "limits": report.Table("Limits of a step", lambda o: limits(SEEDS[: 1 if o.quick else len(SEEDS)])),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
