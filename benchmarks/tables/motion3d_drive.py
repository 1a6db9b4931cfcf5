"""The recorded drive: its own reference pair by pair, and how far errors of the flow are correlated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks import report
from benchmarks.scenes import drives
from benchmarks.tables.motion3d_recordings import on_drive
from jacoflow import motion3d

Array = NDArray[np.float64]
Row = dict[str, object]

FRAMES = {"pairs": 2, "three frames": 3}
"""Kinds of fields, and of how many frames each is made."""
DISTANCES = (32, 64, 128)
"""Distances, px, at which errors are correlated."""
SPACINGS = (32, 64)
"""Distances of points, px, whose motions are compared."""


def poses(data: Path, preset: str = "balanced") -> list[Row]:
    """Rotations pair by pair, beside the reference's.

    A camera on a car shakes by hundredths of a degree from pair to pair; in the first poses of the reference
    it does not. Those were interpolated and say nothing about single pairs.
    """
    images, reference = drives.drive(data)
    true = [drives.true_motion(reference, k) for k in range(len(images))]
    ours = [
        motion3d.estimate_field_motion(drives.field(images[k], images[k + 1], preset), drives.K_DRIVE)[0]
        for k in range(len(images) - 1)
    ]
    change = lambda rotations, k: round(float(np.degrees(np.linalg.norm(rotations[k] - rotations[k - 1]))), 4)
    rows: list[Row] = []
    for k in range(1, len(ours)):
        rows.append(
            {
                "pair": f"{k} to {k + 1}",
                "reference": "interpolated" if k < drives.INTERPOLATED else "measured",
                "reference turns otherwise than in the pair before, deg": change(
                    [w for _, w, _, _ in true], k
                ),
                "ours, deg": change([found.rotation for found in ours], k),
                "ours off the reference, deg": round(
                    float(np.degrees(np.linalg.norm(ours[k].rotation - true[k][1]))), 4
                ),
                "our deviation, deg": round(float(np.degrees(np.linalg.norm(ours[k].rotation_std))), 4),
            }
        )
    return rows


def correlation(
    errors: Array, points: Array, used: NDArray[np.bool_], distance: float
) -> tuple[float, float]:
    """Sum of products of errors so far apart along rows or columns of a grid, and what it would be if they
    were the same."""
    at = {tuple(place): error for place, error in zip(points[used].round(3), errors[used], strict=True)}
    products, squares = 0.0, 0.0
    for (x, y), error in at.items():
        for other in ((x + distance, y), (x, y + distance)):
            if other in at:
                products += error * at[other]
                squares += 0.5 * (error**2 + at[other] ** 2)
    return products, squares


def together(data: Path) -> list[Row]:
    """How far errors are correlated, and what that does to a motion, for fields of pairs and of three frames.

    Columns: default distance of points; correlations of residuals across epipolar lines beside the model's;
    factor by which the sum over correlated points widens the direction; scatter of directions about their
    mean offset from the reference, at pairs with a measured pose; residuals of the quarter of the points with
    the least variance, in units of the stated standard deviation (1 if that is true).
    """
    images, reference = drives.drive(data)
    rows: list[Row] = []
    for kind, count in FRAMES.items():
        fields = [
            jacoflow.flow(*images[k : k + count], method=jacoflow.CoarseToFine(preset="balanced"))
            for k in range(len(images) - count + 1)
        ]
        length = fields[0].correlation_length
        # A grid whose steps divide the distances, no closer than one correlation length.
        step = next(step for step in (8, 16, 32) if step >= length)
        sums = {distance: np.zeros(2) for distance in DISTANCES}
        widened, best = [], []
        for field in fields:
            found, points = motion3d.estimate_field_motion(field, drives.K_DRIVE, spacing=step)
            for distance in DISTANCES:
                sums[distance] += correlation(found.residuals, points, found.inliers, distance)
            usual, _ = motion3d.estimate_field_motion(field, drives.K_DRIVE)
            alone, _ = motion3d.estimate_field_motion(field, drives.K_DRIVE, correlation_length=0.0)
            widened.append(usual.direction_std / alone.direction_std)
            # So far apart that the points' covariances are their own.
            apart, places = motion3d.estimate_field_motion(field, drives.K_DRIVE, spacing=4 * length)
            x, y = places.astype(int).T
            variance = np.trace(field.covariance[y, x][:, :2, :2], axis1=1, axis2=2)
            least = apart.inliers & (variance <= np.quantile(variance[apart.inliers], 0.25))
            best.append(float(np.sqrt(np.mean(apart.residuals[least] ** 2))))
        row: Row = {
            "fields of": kind,
            "correlation length, px": round(length, 1),
            "distance of points, px": round(2 * length, 1),
        }
        for distance, (products, squares) in sums.items():
            model = 0.4 * np.exp(-0.25 * (distance / length) ** 2) + 0.6 * np.exp(-distance / length / 3.75)
            row[f"correlation at {distance} px"], row[f"model at {distance} px"] = (
                round(products / squares, 2),
                round(float(model), 2),
            )
        row["direction widened by"] = round(float(np.median(widened)), 2)
        row["residuals of the best points"] = round(float(np.median(best)), 2)
        for spacing in SPACINGS:
            offsets = []
            for k in range(drives.INTERPOLATED, len(fields)):
                found, _ = motion3d.estimate_field_motion(fields[k], drives.K_DRIVE, spacing=spacing)
                # The motion of three frames is that at the middle one.
                true = np.mean([drives.true_motion(reference, j)[0] for j in range(k, k + count - 1)], 0)
                offsets.append(np.degrees(found.translation - true)[:2])
            row[f"direction scatters at {spacing} px, deg"] = round(
                float(np.sqrt(np.var(offsets, axis=0, ddof=1).sum())), 2
            )
        rows.append(row)
    return rows


TABLES = {
    "poses": report.Table(
        "3-D motion: rotations of the drive and of its reference, pair by pair", on_drive(poses)
    ),
    "together": report.Table("3-D motion: errors that go together on the drive", on_drive(together)),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
