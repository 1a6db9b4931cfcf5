"""Arguments of the particle tracker that cannot be used: each is named, with what was expected and what
came."""

import numpy as np
import pytest

from jacoflow.track import ParticleTracker, track_particles

FRAME = np.zeros((30, 40, 3), np.uint8)
BOX = (5.0, 5.0, 8.0, 12.0)


@pytest.mark.parametrize(
    ("boxes", "message"),
    [
        ([(5, 5, 0, 12)], r"boxes: expected left, top, width and height of a box with an area inside the 40 x 30 picture, got \(5, 5, 0, 12\) for target 0"),
        ([BOX, (5, 5, -3, 12)], r"boxes: expected .*, got \(5, 5, -3, 12\) for target 1"),
        ([(60, 5, 8, 12)], r"boxes: expected .*inside the 40 x 30 picture"),
        ([(np.nan, 5, 8, 12)], r"boxes: expected .*got \(NaN, 5, 8, 12\)"),
        ({3: (5, 5, 8, np.inf)}, r"boxes: expected .* for target 3"),
        (BOX, r"boxes: expected an array \(K, 4\) .*, got shape \(4,\)"),
        ([[1, 2, 3]], r"boxes: expected .*got shape \(1, 3\)"),
        ([["a"] * 4], r"boxes: expected .*got \[\["),
        (None, r"boxes: expected .*got None"),
        ({0: [1, 2]}, r"boxes: expected \(left, top, width, height\), px, got shape \(2,\)"),
        ({-1: BOX}, r"id: expected an integer from 0 to \d+, got -1"),
    ],
)
def test_boxes_that_cannot_be_followed_are_named(boxes, message):
    with pytest.raises(ValueError, match="^" + message):
        ParticleTracker(FRAME, boxes)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode": "fast"}, 'mode: expected one of improved, paper, got "fast"'),
        ({"mode": None}, 'mode: expected "improved" or "paper", got None'),
        ({"mode": "\ud800"}, r"mode: expected .*, got '\\ud800'"),
        ({"likelihoods": ["\ud800"]}, r"likelihoods: expected a sequence of names, got \['\\ud800'\]"),
        ({"n_particles": 0}, "n_particles: expected at least 8 particles, got 0"),
        ({"n_near": -1}, "n_near: expected an integer from 0 to 100000000, got -1"),
        ({"n_particles": 10**30}, "n_particles: expected an integer from 0 to 100000000, got 1000"),
        ({"scale": 0.0}, "scale: expected a positive number up to 100, got 0"),
        ({"likelihoods": ("colour", "speed")}, "likelihoods: expected names among colour, velocity, distance, tracks, foreground, got speed"),
        ({"likelihoods": "colour"}, "likelihoods: expected a sequence of names, got 'colour'"),
        ({"likelihoods": 3}, "likelihoods: expected a sequence of names, got 3"),
        ({"resampling": "best"}, 'resampling: expected one of .*, got "best"'),
        ({"ess_threshold": 1.5}, "ess_threshold: expected a share from 0 to 1, got 1.5"),
        ({"foreground": "ratios"}, "foreground: expected .*, got"),
        ({"segmentation": {"scale": -1}}, "segmentation: expected a scale that is a finite number, at least 0, got -1"),
        ({"segmentation": {"sigma": np.nan}}, "segmentation: expected a sigma that is a finite number"),
        ({"segmentation": {"min_size": -1}}, "segmentation: expected an integer from 0 to"),
        ({"segmentation": {"size": 3}}, "segmentation: expected scale, sigma and min_size, got 'size'"),
        ({"segmentation": 3}, "segmentation: expected a dict of"),
        ({"grey": "mean"}, 'grey: expected "error", "value", got "mean"'),
        ({"random_state": -1}, "random_state: expected an integer from 0 to"),
        ({"threads": 0}, "threads: expected a positive integer, got 0"),
    ],
)
def test_options_out_of_range_are_named(options, message):
    with pytest.raises(ValueError, match="^" + message):
        ParticleTracker(FRAME, [BOX], **options)


def test_names_may_come_from_an_iterator():
    tracker = ParticleTracker(FRAME, [BOX], n_particles=8, n_near=8, likelihoods=iter(["colour"]))
    assert tracker.options["likelihoods"] == ["colour"]


@pytest.mark.parametrize(("name", "value"), [("n_particles", 1.5), ("n_near", True), ("scale", "large"), ("ess_threshold", None), ("random_state", "0"), ("threads", 2.0)])
def test_options_of_another_type_are_named(name, value):
    with pytest.raises(TypeError, match=f"^{name}: expected"):
        ParticleTracker(FRAME, [BOX], **{name: value})


@pytest.mark.parametrize(
    ("frame", "error", "message"),
    [
        (np.zeros((30, 41, 3), np.uint8), ValueError, r"frame: expected a frame as large as the first one, 40 x 30 px, got 41 x 30 px"),
        (np.zeros((30, 40, 4), np.uint8), ValueError, r"frame: expected a colour frame \(H, W, 3\), got shape \(30, 40, 4\)"),
        (np.zeros((2, 30, 40, 3), np.uint8), ValueError, r"frame: expected a colour frame \(H, W, 3\), got shape"),
        (np.zeros((30, 40), np.uint8), ValueError, r"frame: expected a colour frame .*colour is needed"),
        (np.zeros((30, 40, 3), complex), TypeError, r"frame: expected an array of bool, integers of 8 to 64 bits, float16, float32 or float64, got complex128"),
        (None, TypeError, r"frame: expected|frame: "),
    ],
)
def test_frames_of_another_kind_are_named(frame, error, message):
    tracker = ParticleTracker(FRAME, [BOX], n_particles=8, n_near=8)
    with pytest.raises((ValueError, TypeError) if frame is None else error, match="^(?:" + message + ")"):
        tracker.update(frame)
    # Nothing has changed.
    assert tracker.step.frame == 0 and tracker.update(FRAME).frame == 1


def test_other_arguments_are_named():
    with pytest.raises(ValueError, match="^frame: expected a picture of at least 8 x 8 px, got 7 x 30 px"):
        ParticleTracker(np.zeros((30, 7, 3), np.uint8), [])
    tracker = ParticleTracker(FRAME, [BOX], n_particles=8, n_near=8)
    for camera in (np.eye(3), [1, 2], "left", np.full((2, 3), np.nan), np.zeros((2, 3)), [[-1, 0, 0], [0, 1, 0]], np.full((2, 3), 1e300)):
        with pytest.raises(ValueError, match="^camera: expected an affine map"):
            tracker.update(FRAME, camera)
    for box in ([1, 2], [np.nan] * 4, [50, 50, 4, 4], None, "box"):
        with pytest.raises(ValueError, match="^bbox: expected"):
            tracker.add(box)
    for call in (tracker.remove, lambda id: tracker.add(BOX, id), tracker.step.particles):
        with pytest.raises(TypeError, match="^id: expected an integer, got 'a'"):
            call("a")
        with pytest.raises(ValueError, match="^id: expected"):
            call(-2)
    with pytest.raises(ValueError, match="^frames: expected at least one frame, got none"):
        track_particles([], [BOX])
    with pytest.raises(TypeError, match="^frames: expected an array"):
        track_particles(3, [BOX])
    with pytest.raises(ValueError, match="^boxes: expected frames from 0 to 1, got 2"):
        track_particles([FRAME, FRAME], {2: {0: BOX}})
    with pytest.raises(ValueError, match="^boxes: expected frames counted from 0, got -1"):
        track_particles([FRAME, FRAME], {-1: {0: BOX}})
    with pytest.warns(UserWarning, match="^boxes: a target starts at frame 2, but there are 2 frames"):
        track_particles(iter([FRAME, FRAME]), {0: {0: BOX}, 2: {1: BOX}}, n_particles=8, n_near=8)
    with pytest.raises(TypeError, match="^progress: expected None, True or a function"):
        track_particles([FRAME], [BOX], progress=3)
    with pytest.raises(ValueError, match="^id: expected a number that is not in use, got 0"):
        track_particles([FRAME, FRAME], {0: {0: BOX}, 1: {0: BOX}}, n_particles=8, n_near=8)
