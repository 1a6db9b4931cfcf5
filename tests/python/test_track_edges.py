"""Edge cases of the gradient tracker: wrong boxes, starts beside the target, windows larger than the frame, targets that stop, crawl, leave and return."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from jacoflow import track

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import tracking_hard_scenes
import tracking_scenes
from test_track import follow, overlap, success

HARD = {scene.name: scene for scene in tracking_hard_scenes.further()}
SIMULATION = {scene.name: scene for scene in tracking_scenes.simulations()}


@pytest.mark.parametrize(("right", "down", "larger"), [(2, -2, 1), (-2, 2, 1), (2, 2, 1), (0, 0, 1.4), (0, 0, 0.6), (1, -1, 1.2), (-2, 0, 1.3), (0, 2, 0.7)])
def test_support_adapts_to_wrong_boxes(right, down, larger):
    """Box off by 2 px or by 40 % of its size: the target is held all the same, in Simulation 1 on two backgrounds."""
    for kind in ("smooth:4,90,20", "fractal:1,90,30"):
        scene = tracking_scenes.simulation(1, kind, 20.0)
        x, y, w, h = scene.start_box
        wrong = dataclasses.replace(scene, start=(x + right + w * (1 - larger) / 2, y + down + h * (1 - larger) / 2, w * larger, h * larger))
        found = follow(wrong)
        assert np.linalg.norm(found.position - scene.centres, axis=1)[1:].max() <= 3.0, kind
        assert success(wrong, found) >= 0.98, kind


def test_starts_five_px_beside_the_centre_find_the_box():
    """Only a point near the target is given: its box is found in two frames, and it is followed to the end."""
    overlaps = []
    for number, scene in enumerate(SIMULATION.values()):
        angle = number * 2.4
        found = track.track(scene.frames(), center=scene.centres[0] + 5 * np.array([np.cos(angle), np.sin(angle)]))
        begun = np.flatnonzero(found.status != "lost")[0]
        assert begun == 1, scene.name
        overlaps.append(overlap(found.box[1:2], scene.boxes[1:2])[0])
        assert np.linalg.norm(found.position - scene.centres, axis=1)[3:].max() <= 3.0, scene.name
    assert np.mean(overlaps) >= 0.85


@pytest.mark.parametrize("method", ["local", "paper"])
def test_windows_larger_than_the_frame_are_clipped(method):
    frames = np.full((12, 40, 48), 90, np.uint8)
    for t in range(12):
        frames[t, 14:27, 8 + t : 21 + t] = 200
    found = track.track(frames, (7.5, 13.5, 13, 13), method=method, fov=101)
    assert np.isfinite(found.position).all() and found.status[-1] == "tracking"
    assert np.linalg.norm(found.position[-1] - (14 + 11, 20)) <= 3.0


def test_a_target_that_stops_is_held_by_the_rule_for_it():
    scene = HARD["stops at 20 for good"]
    still = follow(scene, method="local")
    assert np.linalg.norm(still.position - scene.centres, axis=1)[25:].max() <= 1.9
    assert np.all(still.status[25:] != "tracking") and np.all(np.abs(still.velocity[-1]) < 0.05)
    layered = follow(scene)
    assert np.linalg.norm(layered.position - scene.centres, axis=1)[1:].max() <= 0.5 and np.all(layered.status == "tracking")


def test_layers_keep_a_target_that_crawls():
    scene = HARD["0.3 px/frame"]
    assert success(scene, follow(scene)) == 1.0


def test_what_leaves_the_picture_is_out_and_comes_back_by_itself():
    scene = HARD["leaves the picture and returns"]
    found = follow(scene)
    assert {"out", "coasting"} & set(found.status) and found.status[-1] == "tracking"
    assert np.linalg.norm(found.position[-1] - scene.centres[-1]) < 1
    gone = track.track(scene.frames()[:25], scene.start_box)
    tracker = track.GradientTracker(scene.frames()[0], scene.start_box)
    for frame in (*scene.frames()[1:25], *[scene.frames()[25]] * 30):
        result = tracker.update(frame)
        assert np.isfinite(result.position).all() and np.isfinite(result.covariance).all()
    assert len(gone) == 25 and result.status == "lost"


@pytest.mark.parametrize("method", ["layered", "local"])
def test_a_target_like_its_background_gives_no_nonsense(method):
    frames = np.full((10, 40, 40), 90, np.uint8)
    found = track.track(frames, (10, 10, 13, 13), method=method)
    assert np.isfinite(found.position).all() and np.isfinite(found.covariance).all()
    assert np.linalg.norm(found.position - found.position[0], axis=1).max() < 1


@pytest.mark.parametrize(("first", "last"), [(180, 252), (180, 108)])
def test_light_on_the_target_alone_may_change_by_forty_percent(first, last):
    levels = np.linspace(first, last, 51)
    scene = tracking_hard_scenes.scene("light", tracking_scenes.square(tracking_scenes.circle(20.0), level=levels))
    assert success(scene, follow(scene)) >= 0.98


def test_every_frame_size_is_followed_alike():
    """From the smallest frame to a wide one; the same numbers for a target that is moved to another place."""
    small = np.full((8, 16, 16), 90, np.uint8)
    for t in range(8):
        small[t, 4:10, 2 + t : 8 + t] = 200
    wide = np.full((8, 1040, 40), 90, np.uint8)
    wide[:, 600:616, 10:26] = small
    for frames, corner in ((small, (1.5, 3.5)), (wide, (11.5, 603.5))):
        found = track.track(frames, (*corner, 6, 6))
        assert found.status[-1] == "tracking"
        np.testing.assert_allclose(found.position[-1] - corner, (3 + 7, 3), atol=0.3)
