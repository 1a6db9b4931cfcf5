"""What a recorded drive says of its own reference; skipped where there is none."""

import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks.tables import motion3d_drive as driving
from benchmarks.tables import motion3d_recordings as recordings

DATA = Path(os.environ.get("JACOFLOW_DATA", "/nonexistent"))


def test_errors_of_a_grid_are_correlated_at_their_distance():
    """Errors that are the same in stripes: whole along them, none across two."""
    x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    points, rng = np.column_stack([x.ravel(), y.ravel()]), np.random.default_rng(1)
    stripes = rng.normal(size=40)[y.ravel().astype(int)]
    used = rng.uniform(size=1600) < 0.9
    products, squares = driving.correlation(stripes, points, used, 3.0)
    assert products / squares == pytest.approx(0.5, abs=0.15)
    same, whole = driving.correlation(np.ones(1600), points, used, 3.0)
    assert same == pytest.approx(whole)
    assert driving.correlation(stripes, points, used, 100.0) == (0.0, 0.0)


@pytest.mark.skipif(not (DATA / "kitti_odometry").is_dir(), reason="no recordings")
def test_the_reference_was_interpolated_where_it_is_not_used():
    """The camera shook all the while: in the pairs that were measured our rotations change as the reference's
    do, before by as much, and the reference's by nothing."""
    rows = driving.poses(DATA, "fast")
    turned, ours = (np.array([row[name] for row in rows]) for name in ("reference turns otherwise than in the pair before, deg", "ours, deg"))
    measured = np.array([row["reference"] == "measured" for row in rows])
    assert measured.sum() == len(rows) + 1 - recordings.INTERPOLATED
    # The last of the first ones begins what was measured.
    assert turned[~measured][:-1].max() < 0.001 and turned[measured].min() > 0.01
    assert np.median(ours[~measured]) > 0.03
    assert np.abs(ours - turned)[measured].max() < 0.03
