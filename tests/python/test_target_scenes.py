"""Colour scenes of several targets: boxes, cover, camera and determinism, through Python."""

import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from jacoflow import scenes

NAMES = list(scenes.target_scenes())


@pytest.mark.parametrize("name", NAMES)
def test_every_scene_has_frames_and_boxes_of_one_length(name):
    scene = scenes.TargetScene(name, scale=0.25, frames=4)
    frames, boxes = scene.frames(), scene.boxes()
    assert frames.shape == (4, 120, 180, 3) and frames.dtype == np.uint8 and boxes.shape == (4, scene.n_targets, 4)
    assert (len(scene), scene.size, scene.name) == (4, (180, 120), name)
    assert_array_equal(frames[2], scene.frame(2))
    assert len(scenes.TargetScene(name, scale=0.25)) >= 80
    # Every target begins inside the picture.
    centres = boxes[0, :, :2] + boxes[0, :, 2:] / 2
    assert ((centres > 0) & (centres < np.array(scene.size) - 1)).all()


def changed(scene, t, target):
    """(H, W), pixels that a target changes where nothing is before it."""
    return (scene.frame(t, targets=[target]) != scene.frame(t, targets=[])).any(axis=-1)


@settings(max_examples=15, deadline=None)
@given(name=st.sampled_from(NAMES), seed=st.integers(0, 2**40), share=st.floats(0, 1), scale=st.sampled_from([0.2, 0.5, 0.8]))
def test_boxes_hold_the_pixels_of_their_targets(name, seed, share, scale):
    scene = scenes.TargetScene(name, random_state=seed, noise=0.0, scale=scale)
    t = round(share * (len(scene) - 1))
    for target, (left, top, width, height) in enumerate(scene.boxes()[t]):
        rows, columns = np.nonzero(changed(scene, t, target))
        # Wheels stand out of a turned car's box, in proportion to the scale: by 1 px at the smallest.
        margin = 5 * scale
        inside = (columns > left - margin) & (columns < left + width + margin)
        inside &= (rows > top - margin) & (rows < top + height + margin)
        assert inside.sum() >= 0.94 * len(rows)


def test_a_nearer_target_covers_a_farther_one():
    scene = scenes.TargetScene("people_handheld", noise=0.0)
    boxes = scene.boxes()
    t = int(np.abs(boxes[:, 0, 0] - boxes[:, 1, 0]).argmin())
    far, near = scene.drawing_order
    both = scene.frame(t)
    same = (both == scene.frame(t, targets=[near])).all(axis=-1)
    assert same[changed(scene, t, near)].mean() > 0.7
    same = (both == scene.frame(t, targets=[far])).all(axis=-1)
    assert same[changed(scene, t, far)].mean() < 0.5


def test_targets_have_one_palette():
    """Joint histograms of hue and saturation of both boxes agree: colour does not distinguish the targets."""
    scene = scenes.TargetScene("people_static", noise=0.0)
    shares = []
    for target in (0, 1):
        pixels = scene.frame(10)[changed(scene, 10, target)]
        histogram = np.histogramdd(pixels, bins=6, range=[(0, 256)] * 3)[0]
        shares.append(histogram / histogram.sum())
    assert np.minimum(*shares).sum() > 0.8


def test_the_camera_motion_is_the_worlds():
    """World, sampled where the camera's motion puts it, is the frame before."""
    from scipy.ndimage import map_coordinates

    scene = scenes.TargetScene("zoom_roll", noise=0.0)
    motion, rows_columns = scene.camera_motion(), np.indices((240, 360), float)
    assert motion.shape == (len(scene) - 1, 2, 3)
    y, x = rows_columns[:, 20:-20, 20:-20]
    for t in (0, 31, 98):
        before, after = (scene.frame(each, targets=[])[..., 1].astype(float) for each in (t, t + 1))
        u, v = motion[t] @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
        moved = map_coordinates(after, [v, u], order=1).reshape(x.shape)
        still = after[20:-20, 20:-20]
        wanted = before[20:-20, 20:-20]
        assert np.sqrt(np.mean((moved - wanted) ** 2)) < 0.4 * np.sqrt(np.mean((still - wanted) ** 2))


def test_a_static_camera_does_not_move():
    motion = scenes.TargetScene("people_static", scale=0.2).camera_motion()
    assert_allclose(motion, np.broadcast_to([[1, 0, 0], [0, 1, 0]], motion.shape), atol=1e-12)


def test_scenes_are_the_same_on_any_number_of_threads():
    program = "import sys; from jacoflow import scenes; sys.stdout.buffer.write(scenes.TargetScene('approach', random_state=3, frames=3).frames().tobytes())"
    outputs = [
        subprocess.run([sys.executable, "-c", program], env={**os.environ, "JACOFLOW_THREADS": threads}, capture_output=True, check=True).stdout
        for threads in ("1", "3")
    ]
    assert outputs[0] == outputs[1] == scenes.TargetScene("approach", random_state=3, frames=3).frames().tobytes()


def test_seeds_are_recordings_and_scenes_are_values():
    options = {"random_state": 5, "scale": 0.3, "noise": 1.0, "frames": 3, "colour_cast": 0.2}
    scene = scenes.TargetScene("pillar", **options)
    for twin in (scenes.TargetScene("pillar", **options), copy.copy(scene), pickle.loads(pickle.dumps(scene))):
        assert twin == scene and hash(twin) == hash(scene)
        assert_array_equal(twin.frames(), scene.frames())
    other = scenes.TargetScene("pillar", **{**options, "random_state": 6})
    assert other != scene and (other.frames() != scene.frames()).mean() > 0.5
    assert repr(scene) == 'TargetScene("pillar", random_state=5, scale=0.3)'


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "people"}, "name: expected one of people_handheld, .* got \"people\""),
        ({"scale": 0.0}, "scale: expected 0.1 to 8, got 0"),
        ({"noise": -1.0}, "noise: expected a finite number"),
        ({"frames": 0}, "frames: expected a positive integer up to 1000000, got 0"),
        ({"frames": 10**9}, "frames: expected a positive integer up to 1000000, got 1000000000"),
        ({"frames": -3}, "frames: expected a positive integer, got -3"),
        ({"colour_cast": 1.5}, "colour_cast: expected 0 to 1, got 1.5"),
    ],
)
def test_unusable_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        scenes.TargetScene(**{"name": "pillar", **options})


def test_frames_and_targets_that_are_not_there_are_named():
    scene = scenes.TargetScene("pillar", scale=0.2, frames=2)
    with pytest.raises(ValueError, match="t: expected a frame from 0 to 1, got 2"):
        scene.frame(2)
    with pytest.raises(ValueError, match="targets: expected indices from 0 to 1, got 2"):
        scene.frame(0, targets=[2])
