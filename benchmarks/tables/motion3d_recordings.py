"""3-D motion from recorded frames to numbers: a drive with true poses, and a car ahead with its range by
laser."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.rivals import motion3d as rivals
from benchmarks.scenes.drives import INTERPOLATED, K_DRIVE, drive, field, true_motion
from benchmarks.scores.motion3d import angle
from jacoflow import motion3d
from jacoflow._jacoflow import _motion3d_field_points

Array = NDArray[np.float64]
Row = dict[str, object]

BLOCK = 100
"""Side of the blocks, px, by which points are split into two halves that share no pixels but at the seams."""


def tracks(first: Array, second: Array) -> tuple[Array, Array]:
    """OpenCV's corners and their Lucas-Kanade displacement, checked forwards and backwards, px."""
    cv2 = rivals.cv2
    start = cv2.goodFeaturesToTrack(first, 2000, 0.01, 8)
    options = {"winSize": (21, 21), "maxLevel": 4}
    end, found, _ = cv2.calcOpticalFlowPyrLK(first, second, start, None, **options)
    back, again, _ = cv2.calcOpticalFlowPyrLK(second, first, end, None, **options)
    good = (found & again).ravel().astype(bool) & (
        np.linalg.norm((back - start).reshape(-1, 2), axis=1) < 0.5
    )
    points = start.reshape(-1, 2)[good].astype(float)
    return points, end.reshape(-1, 2)[good].astype(float) - points


def medians(
    data: Path,
    presets: Sequence[str] = ("fast", "balanced"),
    methods: Sequence[str] = tuple(rivals.METHODS),
    begin: int = 0,
) -> list[Row]:
    """Median errors over all pairs of the drive from `begin` on, and over those whose truth was measured; of
    these also the mean offset of the direction, to the right and down, and the scatter about it.

    An offset that every method shows, on flow of every kind, is one of the reference: of how the camera
    stands to what the poses were measured with.
    """
    images, poses = drive(data)
    errors: dict[str, list[tuple[float, float, float, float]]] = {}
    ok: Counter[str] = Counter()

    def add(name: str, direction: Array, true_direction: Array, turned: float) -> None:
        off = np.degrees(direction - true_direction)[:2]
        errors.setdefault(name, []).append(
            (angle(direction, true_direction), float(np.degrees(turned)), *off)
        )

    for index in range(begin, len(images) - 1):
        u, w, shift, turn = true_motion(poses, index)
        for preset in presets:
            found, _ = motion3d.estimate_field_motion(
                field(images[index], images[index + 1], preset), K_DRIVE
            )
            add(f"jacoflow, {preset} flow", found.translation, u, float(np.linalg.norm(found.rotation - w)))
            ok[f"jacoflow, {preset} flow"] += found.status == "ok"
        if rivals.cv2 is None:
            continue
        points, flow = tracks(images[index], images[index + 1])
        for name in methods:
            direction, rotation = rivals.two_view(points, flow, K_DRIVE, 0.5, rivals.METHODS[name])
            add(
                f"{name} on LK tracks",
                direction,
                shift,
                np.arccos(np.clip((np.trace(rotation.T @ turn) - 1) / 2, -1, 1)),
            )
        found = motion3d.estimate_motion(points, flow, K_DRIVE, robust=True)
        add("jacoflow on LK tracks", found.translation, u, float(np.linalg.norm(found.rotation - w)))
        ok["jacoflow on LK tracks"] += found.status == "ok"
    rows: list[Row] = []
    measured_from = max(0, INTERPOLATED - begin)
    for name, values in errors.items():
        every, third, measured = (np.median(part, 0) for part in (values, values[::3], values[measured_from:]))
        offsets = np.array(values)[measured_from:, 2:]
        mean, scatter = offsets.mean(0), offsets.std(0, ddof=1)
        rows.append(
            {
                "method": name,
                "direction, deg": round(every[0], 3),
                "rotation, deg": round(every[1], 4),
                "every third pair": f"{third[0]:.3f} / {third[1]:.4f}",
                "pairs with measured truth": f"{measured[0]:.3f} / {measured[1]:.4f}",
                "asked": "1.1 / 0.06" if name.startswith("5-point") else "",
                "ok": f"{ok[name]} of {len(values)}" if name in ok else "",
                "their offset, deg": f"{mean[0]:.2f}, {mean[1]:.2f}",
                "scatter about it": f"{scatter[0]:.2f}, {scatter[1]:.2f}",
            }
        )
    return rows


HALVES: dict[str, Callable[[Array, Array], NDArray[np.bool_]]] = {
    "checkerboard, 100 px": lambda x, y: (x // BLOCK + y // BLOCK) % 2 == 0,
    "checkerboard, 200 px": lambda x, y: (x // (2 * BLOCK) + y // (2 * BLOCK)) % 2 == 0,
    "left and right": lambda x, y: x < np.mean(x),
    "top and bottom": lambda x, y: y < np.mean(y),
}
"""Ways to halve the picture, by name."""
SPACINGS = (8, 16, 24, 32, 48)
"""Distances of points, px, from one correlation length of a pair on."""


def halves_apart(
    points: Array, flow: Array, covariances: Array, first: NDArray[np.bool_], **options: float
) -> float | None:
    """Squared Mahalanobis distance, over 5, between the motions of two halves; None unless both are `ok`."""
    one, other = (
        motion3d.estimate_motion(
            points[half], flow[half], K_DRIVE, cov=covariances[half], robust=True, **options
        )
        for half in (first, ~first)
    )  # type: ignore[arg-type]
    if (one.status, other.status) != ("ok", "ok"):
        return None
    difference = np.concatenate([one.tangent @ other.translation, other.rotation - one.rotation])
    return float(difference @ np.linalg.solve(one.covariance + other.covariance, difference)) / 5


def summary(given: list[float | None]) -> dict[str, float | str]:
    """Number of `ok` pairs; mean, median and share within the 95 % ellipsoid of squared distances over 5."""
    values = np.array([value for value in given if value is not None])
    if not len(values):
        return {"ok": 0, "mean": "", "median": "", "share within 95 %": ""}
    return {
        "ok": len(values),
        "mean": round(float(values.mean()), 2),
        "median": round(float(np.median(values)), 2),
        "share within 95 %": round(float(np.mean(values < 11.07 / 5)), 2),
    }


def spacings(
    data: Path,
    spacings: Sequence[int] = SPACINGS,
    presets: Sequence[str] = ("fast", "balanced"),
    every: int = 1,
    independent: Sequence[str] = tuple(HALVES),
) -> list[Row]:
    """Whether motions of two halves of the image differ by what both covariances say, for dense and sparse
    points.

    Of true covariances the mean is 1, the median 0.87 and the share 0.95. Beside them the same with points
    taken for independent, for the halves in `independent`. Of all pairs one in `every` is used. Errors that
    all flow of an image has in common are in both halves and do not count. Halves of few points are often
    `few_points`; they do not count either.
    """
    images, _ = drive(data)
    rows: list[Row] = []
    for preset in presets:
        fields = [field(*images[index : index + 2], preset) for index in range(0, len(images) - 1, every)]
        length = fields[0].correlation_length
        for spacing in spacings:
            taken = [_motion3d_field_points(flow, float(spacing), None, None) for flow in fields]
            for name, split in HALVES.items():
                correlated, alone = [], []
                for points, vectors, covariances, (_, shared, *_) in taken:
                    first = split(*points.T)
                    correlated.append(
                        halves_apart(
                            points,
                            vectors,
                            covariances,
                            first,
                            points_per_independent_sample=shared,
                            correlation_length=length,
                        )
                    )
                    if name in independent:
                        alone.append(halves_apart(points, vectors, covariances / shared, first))
                row: Row = {
                    "flow": preset,
                    "spacing, px": spacing,
                    "correlation lengths": round(spacing / length, 1),
                    "halves": name,
                    "pairs": len(taken),
                }
                row |= summary(correlated)
                if name in independent:
                    row |= {f"{key}, taken for independent": value for key, value in summary(alone).items()}
                rows.append(row)
    return rows


def on_drive(rows: Callable[[Path], list[Row]]) -> Callable[[report.Options], list[Row]]:
    """Rows of the drive, where the recording is."""
    return lambda o: rows(o.data) if o.data is not None and (o.data / "kitti_odometry").is_dir() else []


TABLES = {
    "drive": report.Table("3-D motion: a drive with true poses, medians", on_drive(medians)),
    "spacings": report.Table(
        "3-D motion: do halves of the picture differ by what their covariances say?", on_drive(spacings)
    ),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
