"""Recorded drives: one with true poses (KITTI odometry), and one behind a car whose range a laser
measured."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks.scenes.motion3d import exponential

Array = NDArray[np.float64]
K_DRIVE = np.array([[707.0912, 0, 601.8873], [0, 707.0912, 183.1104], [0, 0, 1]])
K_CAR = np.array([[721.5377, 0, 609.5593], [0, 721.5377, 172.8540], [0, 0, 1]])
INTERPOLATED = 12
"""Number of interpolated rotations at the beginning of the drive; they say nothing about single pairs.

All but the last of them are equal to 0.001 degrees, while the camera shook by hundredths of a degree, as in
the pairs that follow (`tables/motion3d_drive.py` prints both pair by pair).
"""


def frames(folder: Path) -> list[NDArray[np.uint8]]:
    """Grey frames of a folder."""
    return [
        np.asarray(jacoflow.io.read_image(path, colour="luminance")) for path in sorted(folder.glob("*.png"))
    ]


def field(first: Array, second: Array, preset: str) -> jacoflow.FlowField:
    """Coarse-to-fine flow of a pair."""
    return jacoflow.flow(first, second, method=jacoflow.CoarseToFine(preset=preset))


def drive(data: Path) -> tuple[list[NDArray[np.uint8]], Array]:
    """Frames, and camera-to-world poses (T, 3, 4)."""
    folder = data / "kitti_odometry" / "KITTI_sequence_1"
    return frames(folder / "image_l"), np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)


def true_motion(poses: Array, index: int) -> tuple[Array, Array, Array, Array]:
    """(u, w, displacement, rotation matrix) of the scene from frame `index` to the next, from
    camera-to-world poses (T, 3, 4)."""
    (r0, t0), (r1, t1) = ((poses[k][:, :3], poses[k][:, 3]) for k in (index, index + 1))
    turn, shift = r1.T @ r0, r1.T @ (t0 - t1)
    angle_ = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    w = 0.5 * axis * (angle_ / np.sin(angle_) if angle_ > 1e-9 else 1)
    u = np.linalg.solve(exponential(w)[1], shift)
    return u / np.linalg.norm(u), w, shift / np.linalg.norm(shift), turn


@dataclass(frozen=True)
class Laser:
    """Ranges of the rear of the car ahead by laser, m, and the boxes of the returns, px, by frame."""

    ranges: dict[int, float]
    closings: dict[int, float]
    boxes: dict[int, tuple[int, int, int, int]]

    def published(self, first: int, last: int) -> tuple[float, float]:
        """Frames to contact between two frames as the file has it, and its standard deviation.

        Mean range over mean closing speed; the speed is the slope of a line through nine ranges, whose
        scatter about the line gives the standard deviation of the slope.
        """
        between = range(first, last + 1)
        distance, closing = (
            float(np.mean([values[k] for k in between])) for values in (self.ranges, self.closings)
        )
        spreads = [self.slope(range(k - 4, k + 5))[1] for k in between]
        return distance / closing, distance / closing**2 * float(np.mean(spreads))

    def recorded(self, first: int, last: int, frames: range) -> tuple[float, float]:
        """The same with the speed of one line through the ranges of the frames that were recorded."""
        closing, spread = self.slope(frames)
        distance = float(np.mean([self.ranges[k] for k in range(first, last + 1)]))
        return distance / closing, distance / closing**2 * spread

    def slope(self, frames: range) -> tuple[float, float]:
        """Closing speed by a line through the ranges, m/frame, and its standard deviation."""
        time, distance = np.array(frames, float), np.array([self.ranges[k] for k in frames])
        slope, offset = np.polyfit(time, distance, 1)
        rest = distance - slope * time - offset
        return -float(slope), float(
            np.sqrt((rest**2).sum() / (len(time) - 2) / ((time - time.mean()) ** 2).sum())
        )


def laser_ranges(folder: Path) -> Laser:
    """What the laser says."""
    lines = (
        line for line in (folder / "lidar_range.csv").read_text().splitlines() if not line.startswith("#")
    )
    rows = {int(row["frame"]): row for row in csv.DictReader(lines)}
    boxes = {}
    for frame, row in rows.items():
        x0, y0, x1, y1 = (round(float(row[key])) for key in ("u0", "v0", "u1", "v1"))
        # The rear's bumper and boot: the lower half of the returns' box lies on the shadow under the car, and
        # above it the box is not higher than the returns were taken.
        boxes[frame] = (x0, y0 - (y1 - y0), x1 - x0, 3 * (y1 - y0) // 2)
    return Laser(
        {k: float(row["Z_m"]) for k, row in rows.items()},
        {k: float(row["closing_m_per_frame"]) for k, row in rows.items()},
        boxes,
    )
