"""Layouts, shapes of noise, planes and long displacements: what says `ok` is right, and as far off as it
says."""

import pytest

from motion3d_support import layouts

TRIALS = 150
OTHERS = {
    "a ring": 100,
    "three lines": 100,
    "a moving object, robust, axes of the noise 100 to 1": 100,
    "two views, plane, noise 0.05 of the displacement": 100,
    "a plane, axes of the noise 100 to 1": 200,
}
"""Fewer trials of rows that are farther from their bounds than the others, or cost more; more of one that is
seldom `ok`."""
LESS = (
    *("all over the picture", "a corner", "two clusters"),
    *("noise 5 to 1", " 1 to 1", "10 to 1", "20 to 1", "30 to 1", "50 to 1"),
    *("waves, noise 0.03 of the displacement", "waves, noise 0.1 of the displacement", "cloud, noise 0.1 of the displacement", "plane, noise 0.01 of the displacement"),
)
"""Ends of the names of rows left out: shorter axes of the noise, less of it, layouts and depths that are like
others. A moving object in even noise is in `test_motion3d_points`."""
ROWS = {part: [name for name in layouts.cases([part]) if not name.endswith(LESS)] for part in ("layouts", "noise", "objects", "planes", "views")}


def coverage_of(name: str) -> dict:
    """The row, with its counts as shares of its trials."""
    row = layouts.coverage_row(name, OTHERS.get(name, TRIALS))
    return {**row, "ok": row["ok"] / row["trials"], "wrong": row["wrong"] / row["trials"], "wrong of ok": row["wrong"] / row["ok"]}


@pytest.mark.parametrize("name", ROWS["layouts"] + ROWS["noise"])
def test_points_and_noise_of_any_layout_and_shape(name):
    row = coverage_of(name)
    assert row["ok"] >= 0.3 and row["wrong"] <= 1 / 150 and 0.89 <= row["ellipsoid"] <= 0.98, row


@pytest.mark.parametrize("name", ROWS["objects"])
def test_what_an_object_and_the_scene_nearly_share_is_not_the_scene(name):
    """Some have another motion down to the noise; the longer its axes, the more."""
    row = coverage_of(name)
    assert row["ok"] >= 1 / 6 and row["wrong of ok"] <= 0.22 and 0.7 <= row["ellipsoid"] <= 0.98, row


@pytest.mark.parametrize("name", ROWS["planes"])
def test_another_motion_of_a_plane_is_reported_in_any_noise(name):
    """About half of them have one."""
    row = coverage_of(name)
    assert row["ok"] >= 0.3 and row["wrong"] == 0 and 0.88 <= row["ellipsoid"] <= 0.98, row
    assert "ambiguous" in row["others"]


def test_minima_that_are_narrow_in_a_wide_picture_are_found():
    """One in 150 is a coin toss between motions that explain the flow alike."""
    (name,) = layouts.cases(["band"])
    row = coverage_of(name)
    assert row["ok"] >= 2 / 3 and row["wrong"] <= 0.01 and 0.88 <= row["ellipsoid"] <= 0.97, row


@pytest.mark.parametrize("name", ROWS["views"])
def test_long_displacements_in_large_noise_are_not_explained_by_large_turns(name):
    """Of a plane few motions are without another; their ellipsoids are too few to be counted."""
    row = coverage_of(name)
    assert row["wrong"] <= 0.01, row
    if "plane" not in name:
        assert row["ok"] >= 0.2 and 0.87 <= row["ellipsoid"] <= 0.98, row
