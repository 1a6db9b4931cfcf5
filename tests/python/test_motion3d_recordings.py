"""3-D motion of recordings with truth, from files; skipped where there are none."""

import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks.tables import motion3d_car
from benchmarks.tables import motion3d_recordings as recordings

DATA = Path(os.environ.get("JACOFLOW_DATA", "/nonexistent"))


@pytest.fixture(scope="module")
def remembered():
    """Flow takes longer than all else: both tests of the drive look at some of the same pairs."""
    known, compute = {}, recordings.field

    def field(first, second, preset):
        if preset != "balanced":
            return compute(first, second, preset)
        key = first.tobytes(), second.tobytes()
        if key not in known:
            known[key] = compute(first, second, preset)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recordings, "field", field)
        yield


@pytest.mark.usefixtures("remembered")
@pytest.mark.skipif(not (DATA / "kitti_odometry").is_dir(), reason="no recordings")
def test_a_drive_is_better_than_five_points_on_tracks():
    """Four pairs before the reference was measured, and all with a measured one."""
    rows = {str(row["method"]): row for row in recordings.medians(DATA, ("balanced",), ("5-point RANSAC",), begin=8)}
    ours = rows["jacoflow, balanced flow"]
    assert ours["direction, deg"] < 0.6
    assert float(str(ours["pairs with measured truth"]).split(" / ")[1]) < 0.06
    if "5-point RANSAC on LK tracks" in rows:
        assert ours["direction, deg"] < rows["5-point RANSAC on LK tracks"]["direction, deg"]


@pytest.mark.usefixtures("remembered")
@pytest.mark.skipif(not (DATA / "kitti_odometry").is_dir(), reason="no recordings")
def test_halves_of_the_picture_differ_by_what_their_covariances_say():
    """Ten pairs and four ways to halve: of 9 that are right, two outside of 95 % ellipsoids by chance are
    rarer than one in ten."""
    rows = recordings.spacings(DATA, spacings=(16,), every=2, independent=("left and right",))
    for row in rows:
        assert row["ok"] >= 9 and row["share within 95 %"] >= 0.88 and row["mean"] < 1.2, row
    # Taken for independent points most pairs are refused, and the covariances of the others are too small.
    taken = [row for row in rows if row["halves"] == "left and right"]
    assert sum(row["ok, taken for independent"] for row in taken) < 0.5 * sum(row["ok"] for row in taken), rows
    assert np.mean([row["mean, taken for independent"] for row in taken if row["ok, taken for independent"]]) > 2, rows


@pytest.fixture(scope="module")
def cars():
    if not (DATA / "ttc_kitti_lidar").is_dir():
        pytest.skip("no recordings")
    return motion3d_car.car(DATA)


def test_time_to_contact_agrees_with_the_laser(cars):
    trusted = [row for row in cars if row["status"] != "ill_conditioned"]
    assert len(trusted) >= 10
    off = np.array([row["off these frames, deviations"] for row in trusted], float)
    assert np.abs(off).max() < 2 and np.sqrt(np.mean(off**2)) < 1.2, cars
    # The speeds in the file are too high where the range jumps before the first frame.
    assert np.median(np.abs([float(str(row["off the file, deviations"])) for row in cars])) < 1.5


def test_the_whole_scene_moves_straight_ahead_or_it_is_reported(cars):
    """A tank lorry overtakes on a quarter of the picture: together with the other side it would fit a
    sideways motion."""
    for row in cars:
        straight = float(str(row["scene off straight ahead, deg"])) < 3
        assert straight or row["scene's status"] != "ok", row
        assert straight, row
