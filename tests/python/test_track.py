"""The gradient tracker: what it reaches on scenes with exact truth, its edge cases, and its parts."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.scenes import tracking as tracking_scenes
from benchmarks.scenes import tracking_hard as tracking_hard_scenes
from jacoflow import track

PUBLISHED = {scene.name: scene for scene in tracking_scenes.published()}
HARD = {scene.name: scene for scene in (*tracking_hard_scenes.table(), *tracking_hard_scenes.further())}


def overlap(a, b):
    """Intersection over union of boxes (T, 4)."""
    low, high = np.maximum(a[:, :2], b[:, :2]), np.minimum(a[:, :2] + a[:, 2:], b[:, :2] + b[:, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=1)
    return common / (a[:, 2] * a[:, 3] + b[:, 2] * b[:, 3] - common)


def follow(scene, **options):
    return track.track(scene.frames(), scene.start_box, **options)


def success(scene, found):
    return np.mean(overlap(found.box, scene.boxes)[scene.scored] > 0.5)


@pytest.mark.parametrize("name", PUBLISHED)
def test_layers_are_as_good_as_published(name):
    """Success 1, centre .10 px (.20 for the growing disc), step .08 px, scale .06, angle 5 degrees."""
    scene = PUBLISHED[name]
    found = follow(scene)
    assert success(scene, found) == 1.0
    assert np.median(np.linalg.norm(found.position - scene.centres, axis=1)[1:]) <= (0.2 if name.startswith("S3") else 0.1)
    assert np.mean(found.status == "tracking") >= 0.95
    steps = np.diff(scene.centres, axis=0)
    assert np.sqrt(np.mean((found.displacement[6:] - steps[5:]) ** 2, axis=0)).max() <= 0.08
    assert np.abs(found.scale - scene.scales).max() <= 0.06
    if scene.angles is not None:
        assert np.abs(found.rotation - scene.angles).max() <= np.radians(5)
    else:
        assert np.abs(found.rotation).max() <= np.radians(5) and not found.rotation_observable.all()


@pytest.mark.parametrize("name", [name for name in HARD if "twin" not in name and "two background" not in name])
def test_hard_scenes_are_followed(name):
    assert success(HARD[name], follow(HARD[name])) >= 0.9


@pytest.fixture(scope="module")
def scene():
    return PUBLISHED["S1 smooth:4,90,20 R 16, whole pixels"]


def test_uncertainty_holds_the_error(scene):
    found = follow(scene)
    errors = np.abs(found.position - scene.centres)[1:]
    deviations = np.sqrt(found.covariance[1:, :, 0, 0])
    assert np.mean(errors < 2 * deviations) >= 0.9
    assert np.linalg.eigvalsh(found.covariance).min() > 0


def test_frames_that_cannot_be_used_are_missed(scene):
    frames = scene.frames()[:20].astype(np.float32)
    frames[7, 3, 5] = np.nan
    frames[8, : frames.shape[1] * 3 // 5] = np.nan
    frames[9] = np.inf
    found = track.track(frames, scene.start_box)
    assert_array_equal(found.status[8:10], "coasting")
    assert found.reason[8] == "the frame cannot be used" and np.isnan(found.displacement[8]).all()
    assert found.status[12] == "tracking" and np.isfinite(found.position).all()
    assert found.covariance[9, 0, 0, 0] > found.covariance[7, 0, 0, 0]


def test_what_is_not_seen_coasts_and_is_lost():
    blank = np.full((64, 64), 90, np.uint8)
    first = blank.copy()
    first[20:33, 20:33] = 200
    tracker = track.GradientTracker(first, (19.5, 19.5, 13, 13))
    states = [tracker.update(blank).status for _ in range(20)]
    assert states[0] == "coasting" and states[-1] == "lost"
    again = tracker.update(first)
    assert again.status == "tracking" and again.reacquired and np.linalg.norm(again.position - 26) < 1


def test_the_first_object_that_moves_is_found_without_a_box(scene):
    frames = scene.frames()
    for start in ({}, {"center": scene.centres[0] + 5}):
        found = track.track(frames, **start)
        assert found.status[0] == "lost" and found.reason[0] == "nothing has moved yet"
        assert np.mean(overlap(found.box, scene.boxes)[2:] > 0.5) == 1.0
    still = track.track(np.repeat(frames[:1], 5, axis=0))
    assert_array_equal(still.status, "lost")


def test_sample_types_and_strides_do_not_matter(scene):
    frames = scene.frames()[:12]
    one = track.track(frames, scene.start_box)
    wide = np.zeros((12, 256, 512), np.uint8)
    wide[:, :, ::2] = frames
    for other in (frames.astype(np.float64), frames.astype(np.float32), frames.astype(np.uint16) * 257, wide[:, :, ::2], np.asfortranarray(frames)):
        assert_allclose(track.track(other, scene.start_box).position, one.position, atol=1e-9)
    assert_allclose(track.track(frames / 255.0, scene.start_box).position, one.position, atol=1e-6)


def test_results_are_those_of_the_stream_and_pickle(scene):
    frames = scene.frames()[:6]
    whole = track.track(frames, scene.start_box)
    tracker = track.GradientTracker(frames[0], scene.start_box)
    single = [tracker.update(frame) for frame in frames[1:]]
    assert len(whole) == 6 and [r.status for r in whole] == ["tracking"] * 6
    assert_array_equal(whole.position[1:], [r.position for r in single])
    back = pickle.loads(pickle.dumps(single[-1]))
    assert_array_equal(back.covariance, single[-1].covariance)


FRAME = np.full((40, 50), 90, np.uint8)


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({"frame": FRAME[:, :15]}, "frame"),
        ({"frame": np.full((40, 50), np.nan)}, "frame"),
        ({"frame": FRAME[0]}, "frame"),
        ({"frame": np.zeros((0, 0), np.uint8)}, "frame"),
        ({"frame": np.zeros((40, 50, 3), np.uint8)}, "frame"),
        ({"bbox": (5, 5, 2, 9)}, "bbox"),
        ({"bbox": (60, 5, 9, 9)}, "bbox"),
        ({"bbox": (5, np.nan, 9, 9)}, "bbox"),
        ({"bbox": (5, 5, 9)}, "bbox"),
        ({"bbox": None, "center": (99, 3)}, "center"),
        ({"center": (9, 9)}, "center"),
        ({"model": "rigid"}, "model"),
        ({"camera": "moving"}, "camera"),
        ({"camera": "\ud800"}, r"^camera: expected .*, got '\\ud800'"),
        ({"model": "\ud800"}, r"^model: expected .*, got '\\ud800'"),
    ],
)
def test_errors_name_the_argument(arguments, names):
    given = {"frame": FRAME, "bbox": (10, 10, 9, 9), **arguments}
    with pytest.raises(ValueError, match=names):
        track.GradientTracker(given.pop("frame"), given.pop("bbox"), **given)


def test_later_frames_have_the_size_of_the_first():
    tracker = track.GradientTracker(FRAME, (10, 10, 9, 9))
    with pytest.raises(ValueError, match="frame"):
        tracker.update(FRAME[:-1])
    with pytest.raises(TypeError, match="frame"):
        tracker.update(FRAME.astype(complex))
    with pytest.raises(ValueError, match="frames"):
        track.track([], (10, 10, 9, 9))
    with pytest.raises(TypeError, match="frames"):
        track.track(None, (10, 10, 9, 9))
