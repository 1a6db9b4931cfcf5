"""Corners, and flow at points: against synthetic motion, and against OpenCV on recordings (skipped where
either is missing)."""

import os
from pathlib import Path

import jacoflow
import numpy as np
import pytest
from conftest import moving_texture
from hypothesis import given, settings
from hypothesis import strategies as st

DATA = Path(os.environ.get("JACOFLOW_DATA", Path(__file__).parents[2] / ".." / "shared" / "data"))
MOTION = (1.3, -0.8)


@pytest.fixture(scope="module")
def pair():
    """Two noise-free float64 frames (100, 140) in uniform motion."""
    return moving_texture(2, (*MOTION, 0, 0, 0, 0), width=140, height=100)


def test_corners_are_sharp_apart_and_away_from_existing_ones(pair):
    points = jacoflow.corners(pair[0], max_count=60, min_distance=9)
    assert points.shape == (60, 2) and points.dtype == np.float64
    away = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(60) * 99
    assert away.min() >= 9
    more = jacoflow.corners(pair[0], min_distance=9, existing=points)
    assert len(more) > 0
    assert np.linalg.norm(points[:, None] - more, axis=2).min() >= 9
    together = jacoflow.corners(pair[0], min_distance=9)
    np.testing.assert_array_equal(np.concatenate([points, more]), together)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_every_sample_type_has_the_same_corners_and_flow(pair, dtype):
    before, after = np.clip(np.round(pair), 0, 255).astype(dtype)
    reference = np.clip(np.round(pair), 0, 255).astype(np.uint8)
    points = jacoflow.corners(before)
    np.testing.assert_array_equal(points, jacoflow.corners(reference[0]))
    for got, want in zip(
        jacoflow.point_flow(before, after, points), jacoflow.point_flow(*reference, points), strict=True
    ):
        np.testing.assert_array_equal(got, want)


@settings(max_examples=25, deadline=None)
@given(u=st.floats(-3, 3), v=st.floats(-3, 3), scale=st.sampled_from([1 / 255, 1.0, 200.0]))
def test_uniform_motion_is_found_on_any_brightness_scale(u, v, scale):
    before, after = moving_texture(2, (u, v, 0, 0, 0, 0), width=140, height=100) * scale
    points = jacoflow.corners(before, max_count=80)
    flow, ok, error = jacoflow.point_flow(before, after, points, window=15)
    assert flow.shape == (len(points), 2) and ok.dtype == bool
    inside = np.all((points > 14) & (points < [125, 85]), axis=1)
    assert ok[inside].mean() > 0.9
    assert np.median(np.linalg.norm(flow[ok & inside] - [u, v], axis=1)) < 0.02
    assert np.all(error[ok] <= 0.7)


def test_without_the_way_back_nothing_is_compared(pair):
    points = jacoflow.corners(pair[0], max_count=50)
    flow, ok, error = jacoflow.point_flow(*pair, points, forward_backward=None)
    tested, kept, _ = jacoflow.point_flow(*pair, points)
    np.testing.assert_array_equal(flow, tested)
    assert np.isnan(error).all() and ok.sum() >= kept.sum()


def test_nan_has_no_corner_and_no_flow(pair):
    before, after = pair.copy()
    before[45:55, 60:70] = np.nan
    points = jacoflow.corners(before, min_distance=3)
    assert not np.any((np.abs(points - [64.5, 49.5]) < 6).all(axis=1))
    flow, ok, error = jacoflow.point_flow(before, after, [[65, 50], [20, 50], [-9, 4]], window=11)
    assert ok.tolist() == [False, True, False]
    assert np.isnan(flow[[0, 2]]).all() and np.isnan(error[[0, 2]]).all()


def test_no_points_have_no_flow(pair):
    flow, ok, error = jacoflow.point_flow(*pair, [])
    assert flow.shape == (0, 2) and ok.shape == error.shape == (0,)
    assert jacoflow.corners(np.zeros((30, 40), np.uint8)).shape == (0, 2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"window": 4}, "window: expected an odd integer"),
        ({"levels": 0}, "levels: expected"),
        ({"min_step": -1.0}, "min_step: expected"),
        ({"forward_backward": float("nan")}, "forward_backward: expected"),
        ({"guesses": np.zeros((2, 2))}, "guesses: expected 1 flows"),
        ({"guesses": np.zeros((1, 3))}, "guesses: expected shape .N, 2."),
    ],
)
def test_bad_options_of_the_flow_are_named(pair, options, message):
    with pytest.raises(ValueError, match=message):
        jacoflow.point_flow(*pair, [[20, 20]], **options)


def test_bad_frames_and_corners_are_named(pair):
    colour = np.zeros((20, 20, 3), np.uint8)
    with pytest.raises(ValueError, match=r"frame: .*luminance"):
        jacoflow.corners(colour)
    with pytest.raises(ValueError, match=r"after: .*luminance"):
        jacoflow.point_flow(pair[0], colour, [[1, 1]])
    with pytest.raises(ValueError, match="after: expected size"):
        jacoflow.point_flow(pair[0], pair[1][:-1], [[1, 1]])
    with pytest.raises(TypeError, match="before: expected an array of bool"):
        jacoflow.point_flow(pair[0].astype(complex), pair[1], [[1, 1]])
    with pytest.raises(ValueError, match="points: expected shape"):
        jacoflow.point_flow(*pair, [[1, 1, 1]])
    for option in ({"quality": 1.5}, {"min_distance": -1.0}, {"window": 2}):
        with pytest.raises(ValueError, match=f"{next(iter(option))}: expected"):
            jacoflow.corners(pair[0], **option)


@pytest.mark.parametrize("name", ["Crossing", "jogging"])
def test_recordings_agree_with_opencv(name):
    cv2 = pytest.importorskip("cv2")
    files = sorted((DATA / "track_otb" / name / "img").glob("*.jpg"))
    if len(files) < 50:
        pytest.skip(f"no recording in {DATA}")
    for at in (5, 20, 40):
        before, after = (cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files[at : at + 2])
        points = jacoflow.corners(before, max_count=400)
        flow, ok, _ = jacoflow.point_flow(before, after, points)
        options = {"winSize": (19, 19), "maxLevel": 2, "criteria": (3, 30, 0.01)}
        start = points.astype(np.float32).reshape(-1, 1, 2)
        there, status, _ = cv2.calcOpticalFlowPyrLK(before, after, start, None, **options)
        back, returned, _ = cv2.calcOpticalFlowPyrLK(after, before, there, None, **options)
        kept = (status & returned).ravel().astype(bool) & (np.linalg.norm((back - start)[:, 0], axis=1) <= 0.7)
        both = ok & kept
        difference = np.linalg.norm(flow[both] - (there - start)[both, 0], axis=1)
        assert np.median(difference) < 0.05
        assert abs(ok.mean() - kept.mean()) < 0.05
        assert both.sum() > 0.9 * kept.sum()
