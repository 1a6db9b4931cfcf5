"""3-D motion of recordings with truth, from files; skipped where there are none."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import motion3d_recordings as recordings

DATA = Path(os.environ.get("JACOFLOW_DATA", "/nonexistent"))


@pytest.mark.skipif(not (DATA / "kitti_odometry").is_dir(), reason="no recordings")
def test_a_drive_is_better_than_five_points_on_tracks():
    rows = {str(row["method"]): row for row in recordings.drive(DATA)}
    ours = rows["jacoflow, balanced flow"]
    assert ours["direction, deg"] < 0.6
    assert float(str(ours["pairs with measured truth"]).split(" / ")[1]) < 0.06
    if "5-point RANSAC on LK tracks" in rows:
        assert ours["direction, deg"] < rows["5-point RANSAC on LK tracks"]["direction, deg"]


@pytest.mark.skipif(not (DATA / "ttc_kitti_lidar").is_dir(), reason="no recordings")
def test_time_to_contact_agrees_with_the_laser():
    rows = recordings.car(DATA)
    facing = np.abs([float(str(row["it is off"])) for row in rows])
    assert facing.max() < 3, rows
    off = np.array([float(str(row["off, deviations"])) for row in rows])
    assert np.nanmedian(np.abs(off)) < 3
    # Where the approach trades against a sideways motion that is told.
    assert all(row["status"] != "ok" for row, value in zip(rows, off, strict=True) if not abs(value) < 4), rows
