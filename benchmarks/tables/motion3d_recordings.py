"""3-D motion from recorded frames to numbers: a drive with true poses, and a car ahead with its range by laser."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks.rivals import motion3d as rivals
from benchmarks.scenes import motion3d as scenes
from benchmarks.tables.motion3d_published import angle
from jacoflow import motion3d
from jacoflow._jacoflow import _motion3d_field_points

Array = NDArray[np.float64]
Row = dict[str, object]

K_DRIVE = np.array([[707.0912, 0, 601.8873], [0, 707.0912, 183.1104], [0, 0, 1]])
K_CAR = np.array([[721.5377, 0, 609.5593], [0, 721.5377, 172.8540], [0, 0, 1]])
BLOCK = 100
"""Side of the blocks, px, by which points are split into two halves that share no pixels but at the seams."""
CAR_SPACING = 8.0
"""Distance of the points on the car, px."""
TURNING = 5e-4
"""What the car ahead may turn by itself, rad/frame: 0.3 degrees a second, of one that keeps its lane."""
INTERPOLATED = 12
"""The drive's first so many true rotations were interpolated, and tell nothing of single pairs: but for the last of them they are one and the same to 0.001 degrees, while the camera shook by hundredths of a degree, as in the pairs that follow, whose changes ours follow to 0.02 degrees (`motion3d_drive.poses` prints both pair by pair)."""


def frames(folder: Path) -> list[NDArray[np.uint8]]:
    """Grey frames of a folder."""
    return [np.asarray(jacoflow.io.read_image(path, colour="luminance")) for path in sorted(folder.glob("*.png"))]


def field(first: Array, second: Array, preset: str) -> jacoflow.FlowField:
    """Coarse-to-fine flow of a pair."""
    return jacoflow.estimate([first, second], preset=preset)


def true_motion(poses: Array, index: int) -> tuple[Array, Array, Array, Array]:
    """(u, w, displacement, rotation matrix) of the scene from frame `index` to the next, from camera-to-world poses (T, 3, 4)."""
    (r0, t0), (r1, t1) = ((poses[k][:, :3], poses[k][:, 3]) for k in (index, index + 1))
    turn, shift = r1.T @ r0, r1.T @ (t0 - t1)
    angle_ = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    w = 0.5 * axis * (angle_ / np.sin(angle_) if angle_ > 1e-9 else 1)
    u = np.linalg.solve(scenes.exponential(w)[1], shift)
    return u / np.linalg.norm(u), w, shift / np.linalg.norm(shift), turn


def tracks(first: Array, second: Array) -> tuple[Array, Array]:
    """OpenCV's corners and their Lucas-Kanade displacement, checked forwards and backwards, px."""
    cv2 = rivals.cv2
    start = cv2.goodFeaturesToTrack(first, 2000, 0.01, 8)
    options = {"winSize": (21, 21), "maxLevel": 4}
    end, found, _ = cv2.calcOpticalFlowPyrLK(first, second, start, None, **options)
    back, again, _ = cv2.calcOpticalFlowPyrLK(second, first, end, None, **options)
    good = (found & again).ravel().astype(bool) & (np.linalg.norm((back - start).reshape(-1, 2), axis=1) < 0.5)
    points = start.reshape(-1, 2)[good].astype(float)
    return points, end.reshape(-1, 2)[good].astype(float) - points


def drive(data: Path) -> list[Row]:
    """Median errors over all pairs of the drive, and over those whose truth was measured; of these also the mean offset of the direction, to the right and down, and the scatter about it.

    An offset that every method shows, on flow of every kind, is one of the reference: of how the camera stands to what the poses were measured with.
    """
    folder = data / "kitti_odometry" / "KITTI_sequence_1"
    images, poses = frames(folder / "image_l"), np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)
    errors: dict[str, list[tuple[float, float, float, float]]] = {}
    ok: Counter[str] = Counter()

    def add(name: str, direction: Array, true_direction: Array, turned: float) -> None:
        off = np.degrees(direction - true_direction)[:2]
        errors.setdefault(name, []).append((angle(direction, true_direction), float(np.degrees(turned)), *off))

    for index in range(len(images) - 1):
        u, w, shift, turn = true_motion(poses, index)
        for preset in ("fast", "balanced"):
            found, _ = motion3d.estimate_field_motion(field(images[index], images[index + 1], preset), K_DRIVE)
            add(f"jacoflow, {preset} flow", found.translation, u, float(np.linalg.norm(found.rotation - w)))
            ok[f"jacoflow, {preset} flow"] += found.status == "ok"
        if rivals.cv2 is None:
            continue
        points, flow = tracks(images[index], images[index + 1])
        for name, method in rivals.METHODS.items():
            direction, rotation = rivals.two_view(points, flow, K_DRIVE, 0.5, method)
            add(f"{name} on LK tracks", direction, shift, np.arccos(np.clip((np.trace(rotation.T @ turn) - 1) / 2, -1, 1)))
        found = motion3d.estimate_motion(points, flow, K_DRIVE, robust=True)
        add("jacoflow on LK tracks", found.translation, u, float(np.linalg.norm(found.rotation - w)))
        ok["jacoflow on LK tracks"] += found.status == "ok"
    rows: list[Row] = []
    for name, values in errors.items():
        every, third, measured = (np.median(part, 0) for part in (values, values[::3], values[INTERPOLATED:]))
        offsets = np.array(values)[INTERPOLATED:, 2:]
        mean, scatter = offsets.mean(0), offsets.std(0, ddof=1)
        rows.append(
            {
                "method": name, "direction, deg": round(every[0], 3), "rotation, deg": round(every[1], 4), "every third pair": f"{third[0]:.3f} / {third[1]:.4f}",
                "pairs with measured truth": f"{measured[0]:.3f} / {measured[1]:.4f}", "asked": "1.1 / 0.06" if name.startswith("5-point") else "", "ok": f"{ok[name]} of {len(values)}" if name in ok else "",
                "their offset, deg": f"{mean[0]:.2f}, {mean[1]:.2f}", "scatter about it": f"{scatter[0]:.2f}, {scatter[1]:.2f}",
            }
        )  # fmt: skip
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


def halves_apart(points: Array, flow: Array, covariances: Array, first: NDArray[np.bool_], **options: float) -> float | None:
    """Squared deviation, over 5, of the difference of the motions of two halves; None unless both are told to be `ok`."""
    one, other = (motion3d.estimate_motion(points[half], flow[half], K_DRIVE, cov=covariances[half], robust=True, **options) for half in (first, ~first))  # type: ignore[arg-type]
    if (one.status, other.status) != ("ok", "ok"):
        return None
    difference = np.concatenate([one.tangent @ other.translation, other.rotation - one.rotation])
    return float(difference @ np.linalg.solve(one.covariance + other.covariance, difference)) / 5


def told(given: list[float | None]) -> dict[str, float | str]:
    """Mean, median and the share within the 95 % ellipsoid, of squared deviations over 5; how many pairs are `ok`."""
    values = np.array([value for value in given if value is not None])
    if not len(values):
        return {"ok": 0, "mean": "", "median": "", "share within 95 %": ""}
    return {
        "ok": len(values), "mean": round(float(values.mean()), 2), "median": round(float(np.median(values)), 2), "share within 95 %": round(float(np.mean(values < 11.07 / 5)), 2),
    }  # fmt: skip


def spacings(data: Path, spacings: Sequence[int] = SPACINGS) -> list[Row]:
    """Whether the covariance lies: motions of two halves of the picture should differ by what both covariances say, whatever the halves and however dense the points.

    Of true covariances the mean is 1, the median 0.87 and the share 0.95. Beside them the same with points taken for independent, whatever their distance. What all flow of a picture has in common is in both halves and left out. Halves of few points are often told as `few_points`; they do not count.
    """
    images = frames(data / "kitti_odometry" / "KITTI_sequence_1" / "image_l")
    rows: list[Row] = []
    for preset in ("fast", "balanced"):
        fields = [field(*images[index : index + 2], preset) for index in range(len(images) - 1)]
        length = fields[0].correlation_length
        for spacing in spacings:
            taken = [_motion3d_field_points(flow, float(spacing), None, None) for flow in fields]
            for name, split in HALVES.items():
                correlated, independent = [], []
                for points, vectors, covariances, (_, shared, *_) in taken:
                    first = split(*points.T)
                    correlated.append(halves_apart(points, vectors, covariances, first, shared=shared, correlation_length=length))
                    independent.append(halves_apart(points, vectors, covariances / shared, first))
                row: Row = {"flow": preset, "spacing, px": spacing, "correlation lengths": round(spacing / length, 1), "halves": name, "pairs": len(taken)}
                row |= told(correlated) | {f"{key}, taken for independent": value for key, value in told(independent).items()}
                rows.append(row)
    return rows


@dataclass(frozen=True)
class Laser:
    """Ranges of the rear of the car ahead by laser, m, and the boxes of the returns, px, by frame."""

    ranges: dict[int, float]
    closings: dict[int, float]
    boxes: dict[int, tuple[int, int, int, int]]

    def published(self, first: int, last: int) -> tuple[float, float]:
        """Frames to contact between two frames as the file has it, mean range over mean closing speed, and its deviation: the speed is the slope of a line through nine ranges, whose scatter about it tells the slope's deviation."""
        between = range(first, last + 1)
        distance, closing = (float(np.mean([values[k] for k in between])) for values in (self.ranges, self.closings))
        spreads = [self.slope(range(k - 4, k + 5))[1] for k in between]
        return distance / closing, distance / closing**2 * float(np.mean(spreads))

    def recorded(self, first: int, last: int, frames: range) -> tuple[float, float]:
        """The same with the speed of one line through the ranges of the frames that were recorded."""
        closing, spread = self.slope(frames)
        distance = float(np.mean([self.ranges[k] for k in range(first, last + 1)]))
        return distance / closing, distance / closing**2 * spread

    def slope(self, frames: range) -> tuple[float, float]:
        """Closing speed by a line through the ranges, m/frame, and its deviation."""
        time, distance = np.array(frames, float), np.array([self.ranges[k] for k in frames])
        slope, offset = np.polyfit(time, distance, 1)
        rest = distance - slope * time - offset
        return -float(slope), float(np.sqrt((rest**2).sum() / (len(time) - 2) / ((time - time.mean()) ** 2).sum()))


def laser_ranges(folder: Path) -> Laser:
    """What the laser says."""
    lines = (line for line in (folder / "lidar_range.csv").read_text().splitlines() if not line.startswith("#"))
    rows = {int(row["frame"]): row for row in csv.DictReader(lines)}
    boxes = {}
    for frame, row in rows.items():
        x0, y0, x1, y1 = (round(float(row[key])) for key in ("u0", "v0", "u1", "v1"))
        # The rear's bumper and boot: the lower half of the returns' box lies on the shadow under the car, and above it the box is not higher than the returns were taken.
        boxes[frame] = (x0, y0 - (y1 - y0), x1 - x0, 3 * (y1 - y0) // 2)
    return Laser({k: float(row["Z_m"]) for k, row in rows.items()}, {k: float(row["closing_m_per_frame"]) for k, row in rows.items()}, boxes)


def car(data: Path) -> list[Row]:
    """Time to contact of the car ahead, in frames, beside the laser's, over one frame and over four: from its relative motion in space, and from the divergence of its flow, for a surface that faces the camera.

    The car is nearly a plane that fills 13 degrees: in so narrow a field a rotation looks like a sideways motion, and with the slant of the surface that trades against the approach. The rotation is the camera's, which the whole scene tells, and what the car turns itself.
    Between the frames 19 and 20 the laser's range falls by 0.15 m, twice as much as between any others: another part of the car is the nearest from there on. The speeds in the file around them are too high by that.
    """
    folder = data / "ttc_kitti_lidar"
    images, laser = frames(folder / "image_02"), laser_ranges(folder)
    names = [int(path.stem) for path in sorted((folder / "image_02").glob("*.png"))]
    rows: list[Row] = []
    for step in (1, 4):
        for index in range(len(names) - step):
            first, last = names[index], names[index + step]
            box, flow = laser.boxes[first], field(images[index], images[index + step], "balanced")
            scene, _ = motion3d.estimate_field_motion(flow, K_CAR)
            found, points = motion3d.estimate_field_motion(flow, K_CAR, spacing=CAR_SPACING, region=box, scene=scene, turning=TURNING * step)
            divergence, spread, _ = flow.region_mean("divergence", region=box)
            facing, facing_deviation = 2 * step / divergence, 2 * step * spread / divergence**2
            contact, deviation = -step / found.approach_rate, step * found.approach_rate_std / found.approach_rate**2
            published, recorded = laser.published(first, last), laser.recorded(first, last, range(names[0], names[-1] + 1))
            off = lambda value, own, truth: round((value - truth[0]) / float(np.hypot(own, truth[1])), 2)
            rows.append(
                {
                    "frames": f"{first} to {last}", "laser, its file": round(published[0], 1), "deviation of that": round(published[1], 1),
                    "laser, these frames": round(recorded[0], 1), "deviation of this": round(recorded[1], 1), "ours": round(contact, 1), "deviation": round(deviation, 1),
                    "off the file, deviations": off(contact, deviation, published), "off these frames, deviations": off(contact, deviation, recorded),
                    "points": len(points), "status": found.status, "scene's status": scene.status, "scene off straight ahead, deg": round(angle(scene.translation, np.array([0, 0, -1.0])), 1),
                    "from divergence": round(facing, 1), "its deviation": round(facing_deviation, 1), "it is off these frames": off(facing, facing_deviation, recorded),
                }
            )  # fmt: skip
    return rows
