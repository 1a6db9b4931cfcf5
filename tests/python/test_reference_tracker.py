"""The loop of the gradient tracker's source, and its parts; needs a build with the feature `reference`."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import jacoflow
from jacoflow import _jacoflow, reference, track

from benchmarks.scenes import tracking as tracking_scenes
from benchmarks.scenes import tracking_hard as tracking_hard_scenes
from benchmarks.scenes.tracking import circle, line, square
from test_track import PUBLISHED, success
from test_track_edges import HARD, seen, textured
from test_track_parts_hidden import SHAPE, box_about, held, movie, straight

pytestmark = pytest.mark.skipif(not hasattr(_jacoflow, "_reference_tracker"), reason="built without the feature reference")

FRAME = np.full((64, 256), 90, np.uint8)


def followed(scene, **options):
    return reference.track(scene.frames(), scene.start_box, **options)


def test_mean_flow_has_one_set_for_both_axes():
    flow, valid = np.zeros((6, 8, 2)), np.ones((6, 8), bool)
    flow[2:4, 1:3] = (2.0, 0.1)
    flow[2:4, 4] = (0.4, -1.0)
    flow[0, 0], valid[0, 0] = (9.0, 9.0), False
    found = reference.mean_flow(reference.PixelFlow(flow, valid))
    assert found.count == 6
    assert_allclose(found.velocity, ((4 * 2.0 + 2 * 0.4) / 6, (4 * 0.1 - 2 * 1.0) / 6))
    assert_allclose(found.centroid, ((4 * 1.5 + 2 * 4) / 6, 2.5))
    none = reference.mean_flow(reference.PixelFlow(flow, valid), min_speed=50.0)
    assert none.count == 0 and np.isnan(none.centroid).all() and not none.velocity.any()
    with pytest.raises(ValueError, match="min_speed"):
        reference.mean_flow(reference.PixelFlow(flow, valid), min_speed=-1.0)
    with pytest.raises(ValueError, match="valid"):
        reference.mean_flow(reference.PixelFlow(flow, valid[:-1]))


@pytest.mark.parametrize("name", ["order", "window"])
@pytest.mark.parametrize(("value", "error"), [(-1, ValueError), (0, ValueError), (-(10**30), ValueError), (2.5, TypeError), ("x", TypeError)])
def test_integers_are_refused_by_name(name, value, error):
    with pytest.raises(error, match=name):
        reference.local_flow(FRAME, FRAME, **{name: value})
    with pytest.raises(error, match=name):
        reference.ReferenceTracker(FRAME, (9, 9, 9, 9), **{name: value})
    with pytest.raises(error, match="search_window"):
        reference.ReferenceTracker(FRAME, (9, 9, 9, 9), search_window=value)
    with pytest.raises(error, match="order"):
        reference.derivative_kernels(value)


@pytest.mark.parametrize(("flow", "valid", "name"), [((8, 9), (8, 9), "flow"), ((8, 9, 3), (8, 9), "flow"), ((8, 9, 2), (9, 8), "valid"), ((8, 9, 2), (8,), "valid")])
def test_mean_flow_refuses_other_shapes(flow, valid, name):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        reference.mean_flow(reference.PixelFlow(np.zeros(flow), np.zeros(valid, bool)))


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_repaired_loop_keeps_its_line_of_sight(name):
    """Within 3 px in every frame, centre 1.6 px, velocity .50 px/frame."""
    scene = PUBLISHED[name]
    found = followed(scene, method="local")
    assert np.linalg.norm(found.window_center - scene.centres, axis=1).max() <= 3.0
    assert np.median(np.linalg.norm(found.position - scene.centres, axis=1)) <= 1.6
    steps = np.diff(scene.centres, axis=0)
    assert np.sqrt(np.mean((found.velocity[6:] - steps[5:]) ** 2, axis=0)).max() <= 0.5


def test_the_text_to_the_letter_follows_on_a_flat_background_and_loses_elsewhere():
    """Line of sight within 3 px, raw velocity within .06 px/frame there."""
    flat = PUBLISHED["S1 flat:90 R 16, whole pixels, no noise"]
    found = followed(flat, method="paper")
    assert np.linalg.norm(found.window_center - flat.centres, axis=1).max() <= 3.0
    steps = np.diff(flat.centres, axis=0)
    assert np.sqrt(np.mean((found.displacement[6:] - steps[5:]) ** 2, axis=0)).max() <= 0.06
    soft = PUBLISHED["S1 smooth:4,90,20 R 16, whole pixels"]
    assert np.mean(np.linalg.norm(followed(soft, method="paper").position - soft.centres, axis=1) <= 3.0) < 0.5


def test_one_step_has_the_published_gain():
    """Texture of 2 px correlation length; order 4 nearly right in one step, order 2 too large."""
    from benchmarks.tables import tracking_parts as tracking_flow

    for step, four, two in zip(tracking_flow.STEPS, *(tracking_flow.GAINS[order] for order in (4, 2)), strict=True):
        first, second = tracking_flow.shifted_texture(step)
        inside = np.s_[14:-14, 14:-14]
        for order, want in ((4, four), (2, two)):
            flow = reference.local_flow(first, second, window=5, order=order, min_sigma=0.0, cond_max=1e9, step_max=1e9)
            assert np.nanmean(flow.flow[inside][..., 0]) == pytest.approx(want, abs=0.005), (step, order)


def test_what_moves_first_is_looked_for_with_a_still_camera_in_every_method():
    for method in ("local", "paper"):
        assert reference.ReferenceTracker(FRAME, method=method, camera="none").result.status == "lost"


@pytest.mark.parametrize("method", ["local", "paper"])
def test_windows_larger_than_the_frame_are_clipped(method):
    frames = np.full((12, 40, 48), 90, np.uint8)
    for t in range(12):
        frames[t, 14:27, 8 + t : 21 + t] = 200
    found = reference.track(frames, (7.5, 13.5, 13, 13), method=method, search_window=101)
    assert np.isfinite(found.position).all() and found.status[-1] == "tracking"
    assert np.linalg.norm(found.position[-1] - (14 + 11, 20)) <= 3.0


def test_the_window_is_as_large_as_the_target_needs():
    """A window of 51 px on an even target of 80 px would see no edge of it."""
    frames = np.random.default_rng(2).normal(90, 2, (25, 220, 260)).astype(np.uint8)
    for t in range(25):
        frames[t, 60:140, 40 + 2 * t : 120 + 2 * t] += 80
    box = (39.5, 59.5, 80, 80)
    found = reference.track(frames, box, method="local")
    assert np.linalg.norm(found.position[-1] - (79.5 + 48, 99.5)) <= 3.0 and np.all(found.status[5:] == "tracking")
    small = reference.track(frames, box, method="local", search_window=51)
    assert np.linalg.norm(small.position[-1] - (79.5 + 48, 99.5)) > 3.0


def test_local_follows_what_is_too_fast_for_one_gradient_step():
    scene = next(scene for scene in tracking_hard_scenes.hard() if scene.name == "9 px/frame")
    found = followed(scene, method="local")
    assert success(scene, found) >= 0.9
    assert np.linalg.norm(found.position - scene.centres, axis=1)[5:].max() <= 6.0


@pytest.mark.parametrize(("step", "noise"), [(2, 8), (1, 4)])
def test_what_counts_as_motion_is_distinguished_from_the_background_and_not_from_the_target(step, noise):
    ground, side, rng = textured(200, 256, sigma=4.0, deviation=20.0), 13, np.random.default_rng(5)
    frames, centres = [], []
    for t in range(40):
        picture, left, top = ground.copy(), 54 + step * t, 89 + round(8 * np.sin(t / 9))
        picture[top : top + side, left : left + side] = 200.0
        frames.append(np.clip(np.rint(picture + noise * rng.standard_normal(picture.shape)), 0, 255).astype(np.uint8))
        centres.append((left + side // 2, top + side // 2))
    found = reference.track(frames, (53.5, 88.5, side, side), method="local", min_speed="auto")
    errors = np.linalg.norm(found.position - centres, axis=1)
    assert np.mean(errors < 3.0) > 0.9, errors


@pytest.mark.parametrize("level", [140.0, 200.0])
@pytest.mark.parametrize("pan", [(-3.0, 1.0), (-1.0, 0.0), (-1.5, 0.5), (2.0, 2.0)])
def test_local_does_not_claim_the_scene_for_its_target(pan, level):
    """Under a camera that moves all that is in the window does; what is said to be tracked must be the
    target."""
    scene = tracking_hard_scenes.scene("pan", square(circle(20.0), level=level), motion=line((0.0, 0.0), pan))
    found = followed(scene, method="local")
    far = np.linalg.norm(found.position - scene.centres, axis=1) > 10.0
    assert np.mean((found.status == "tracking") & far) <= 0.15


def test_options_of_local_flow_are_refused_by_name():
    frame = np.full((32, 32), 90, np.uint8)
    for name in ("window", "order", "cond_max", "min_sigma", "step_max"):
        with pytest.raises(TypeError, match=f"^{name}: expected"):
            reference.local_flow(frame, frame, **{name: None})


@pytest.mark.parametrize(("name", "value"), [("search_window", 51.5), ("order", "a"), ("window", 5.0), ("min_speed", [1, 2])])
def test_numbers_of_another_kind_are_refused_by_name(name, value):
    frame = np.full((64, 64), 90, np.uint8)
    with pytest.raises(TypeError, match=f"^{name}: expected .*got"):
        reference.ReferenceTracker(frame, (20, 20, 13, 13), **{name: value})


@pytest.mark.parametrize("side", [21, 31, 41, 61])
def test_local_holds_large_even_targets_by_their_ends(side):
    path = straight((1.5, 0.3))
    found = reference.track(movie(path, side), box_about(path[0], side), method="local")
    errors = np.linalg.norm(found.position - path, axis=1)
    assert errors.max() < 2.0 and np.median(errors) < 0.8 and held(found, path) > 0.9


@pytest.mark.parametrize("side", [21, 31, 41])
@pytest.mark.parametrize("down", [False, True])
def test_local_knows_where_a_target_is_that_is_half_out(side, down):
    """Its visible end tells it, and not the mean of what is left."""
    there = 1.5 * (np.minimum(np.arange(80), 40) - np.maximum(np.arange(80) - 50, 0))
    path = np.stack([100 + 0 * there, SHAPE[0] - 61 + there] if down else [SHAPE[1] - 61 + there, 70 + 0 * there], axis=1)
    found = reference.track(movie(path, side), box_about(path[0], side), method="local")
    errors = np.linalg.norm(found.position - path, axis=1)
    assert errors.max() < 6.0 and np.median(errors) < 1.2 and errors[-5:].mean() < 2.0


def test_a_target_that_stops_is_held():
    scene = HARD["stops at 20 for good"]
    still = followed(scene)
    assert np.linalg.norm(still.position - scene.centres, axis=1)[25:].max() <= 1.7
    assert np.all(still.status[25:] != "tracking") and np.all(np.abs(still.velocity[-1]) < 0.05)


def test_huge_windows_are_clipped():
    frames = np.full((4, 64, 64), 90, np.uint8)
    for side in (5000, 2**40, 2**63):
        assert len(reference.track(frames, (20, 20, 13, 13), search_window=side)) == 4


@pytest.mark.parametrize(("name", "value"), [("search_window", 3), ("control", "smooth"), ("order", 5), ("window", 4), ("min_speed", -1.0), ("min_speed", "x"), ("method", "csrt")])
def test_errors_name_the_argument(name, value):
    with pytest.raises(ValueError, match=f"^{name}: expected"):
        reference.ReferenceTracker(FRAME, (20, 20, 13, 13), **{name: value})


def test_a_field_that_is_none_is_named():
    with pytest.raises(TypeError, match="^flow: expected a PixelFlow, got NoneType"):
        reference.mean_flow(None)


def test_a_build_without_the_loop_says_so(monkeypatch):
    monkeypatch.delattr(_jacoflow, "_reference_tracker")
    with pytest.raises(jacoflow.MissingDependencyError, match="expected a build with the feature `reference`"):
        reference.ReferenceTracker(FRAME, (20, 20, 13, 13))
