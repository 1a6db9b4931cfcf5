"""Time to contact of the car ahead, beside its range by laser."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks import report
from benchmarks.scenes.drives import K_CAR, field, frames, laser_ranges
from benchmarks.scores.motion3d import angle
from jacoflow import motion3d

Row = dict[str, object]
CAR_SPACING = 8.0
"""Distance of the points on the car, px."""
TURNING = 5e-4
"""What the car ahead may turn by itself, rad/frame: 0.3 degrees a second, of one that keeps its lane."""


def car(data: Path) -> list[Row]:
    """Time to contact of the car ahead, frames, beside the laser's, over one frame and over four.

    From the car's motion in space, and from the divergence of its flow for a surface parallel to the image.
    The car is nearly a plane that fills 13 degrees: a rotation looks like a lateral motion, which trades with
    the slant of the surface against the approach. So the rotation is the camera's, from the whole scene, and
    the car's own is bounded. Between frames 19 and 20 the laser's range falls by 0.15 m, twice as much as
    elsewhere: from there on another part of the car is the nearest, and the speeds in the file around them
    are too high.
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
            found, points = motion3d.estimate_field_motion(
                flow, K_CAR, spacing=CAR_SPACING, region=box, scene=scene, object_rotation_std=TURNING * step
            )
            divergence, spread, _ = flow.region_mean("divergence", region=box)
            facing, facing_deviation = 2 * step / divergence, 2 * step * spread / divergence**2
            contact, deviation = (
                -step / found.approach_rate,
                step * found.approach_rate_std / found.approach_rate**2,
            )
            published, recorded = (
                laser.published(first, last),
                laser.recorded(first, last, range(names[0], names[-1] + 1)),
            )
            off = lambda value, own, truth: round((value - truth[0]) / float(np.hypot(own, truth[1])), 2)
            rows.append(
                {
                    "frames": f"{first} to {last}",
                    "laser, its file": round(published[0], 1),
                    "deviation of that": round(published[1], 1),
                    "laser, these frames": round(recorded[0], 1),
                    "deviation of this": round(recorded[1], 1),
                    "ours": round(contact, 1),
                    "deviation": round(deviation, 1),
                    "off the file, deviations": off(contact, deviation, published),
                    "off these frames, deviations": off(contact, deviation, recorded),
                    "points": len(points),
                    "status": found.status,
                    "scene's status": scene.status,
                    "scene off straight ahead, deg": round(
                        angle(scene.translation, np.array([0, 0, -1.0])), 1
                    ),
                    "from divergence": round(facing, 1),
                    "its deviation": round(facing_deviation, 1),
                    "it is off these frames": off(facing, facing_deviation, recorded),
                }
            )
    return rows


def rows(options: report.Options) -> report.Rows:
    """Those of `car`, where the recording is."""
    is_there = options.data is not None and (options.data / "ttc_kitti_lidar").is_dir()
    return car(options.data) if is_there else []


TABLES = {"car": report.Table("3-D motion: time to contact of the car ahead", rows)}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
