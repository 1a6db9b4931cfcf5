"""Trackers of frames with masked pixels."""

import pickle

import numpy as np
import pytest

from jacoflow.scenes import TargetScene
from jacoflow.track import GradientTracker, ParticleTracker, StereoTracker

HEIGHT, WIDTH = 90, 120


def texture(random_state):
    noise = np.random.default_rng(random_state).normal(size=(HEIGHT + 40, WIDTH + 80))
    for axis in (0, 1):
        noise = sum(np.roll(noise, k, axis) for k in range(-2, 3))
    return 100 + 30 * noise / noise.std()


def scene(count, step=1.5):
    """A square of a texture of its own before a textured wall: frames (T, H, W) of floats, 0 to 255,
    centres."""
    wall, own = texture(0)[20 : 20 + HEIGHT, 40 : 40 + WIDTH], texture(1)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    frames, centres = [], []
    for t in range(count):
        centre = np.array([25 + step * t, 40 + 0.5 * t])
        dx, dy = x - centre[0], y - centre[1]
        i, j = np.floor(dx).astype(int) + 60, np.floor(dy).astype(int) + 50
        fx, fy = dx - np.floor(dx), dy - np.floor(dy)
        i, j = np.clip(i, 0, own.shape[1] - 2), np.clip(j, 0, own.shape[0] - 2)
        moved = (1 - fx) * (1 - fy) * own[j, i] + fx * (1 - fy) * own[j, i + 1] + (1 - fx) * fy * own[j + 1, i] + fx * fy * own[j + 1, i + 1]
        cover = np.clip(9.5 - np.abs(dx), 0, 1) * np.clip(9.5 - np.abs(dy), 0, 1)
        frames.append(np.clip((1 - cover) * wall + cover * (60 + moved), 0, 255))
        centres.append(centre)
    return np.array(frames), np.array(centres)


def masks(count, random_state=3):
    """A band that is never seen, and in each frame blocks that are missing: a tenth of the picture."""
    rng = np.random.default_rng(random_state)
    hidden = np.zeros((count, HEIGHT, WIDTH), bool)
    hidden[:, :9] = True
    for mask in hidden[1:]:
        for _ in range(6):
            x, y = rng.integers(0, WIDTH - 8), rng.integers(9, HEIGHT - 8)
            mask[y : y + 8, x : x + 8] = True
    return hidden


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_a_target_is_followed_through_masked_pixels(dtype):
    frames, centres = scene(30)
    hidden = masks(len(frames))
    gain = 257 if dtype == "uint16" else 1
    frames = np.round(frames * gain).astype(dtype)
    fill = {"uint8": 0, "uint16": 65535, "float32": 1e20}[dtype]
    seen = np.ma.masked_array(np.where(hidden, np.array(fill, dtype), frames), hidden)
    bbox = (*(centres[0] - 9.5), 19, 19)
    errors = {}
    for name, sequence in (("whole", frames), ("masked", seen)):
        tracker = GradientTracker(sequence[0], bbox=bbox)
        found = [tracker.update(frame) for frame in sequence[1:]]
        # Where blocks cover it.
        assert {result.status for result in found} <= {"tracking", "occluded"}, name
        errors[name] = np.linalg.norm([result.position for result in found] - centres[1:], axis=1)
    assert errors["whole"].max() < 0.6
    assert errors["masked"].max() < 0.9


def test_a_frame_that_is_mostly_masked_counts_as_not_seen():
    frames, centres = scene(8)
    hidden = np.zeros(frames.shape, bool)
    hidden[4, :, : WIDTH * 3 // 4] = True
    seen = np.ma.masked_array(frames.astype(np.uint8), hidden)
    tracker = GradientTracker(seen[0], bbox=(*(centres[0] - 9.5), 19, 19))
    found = [tracker.update(frame) for frame in seen[1:]]
    assert found[3].reason == "the frame cannot be used"
    assert np.isnan(found[3].displacement).all()
    assert np.linalg.norm(found[-1].position - centres[-1]) < 0.6
    with pytest.raises(ValueError, match="frame: expected finite samples .* in half of the first frame"):
        GradientTracker(seen[4], bbox=(10, 10, 20, 20))


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_the_particle_tracker_does_not_count_masked_pixels(dtype):
    frames, centres = scene(12)
    gain = 257 if dtype == "uint16" else 1
    tint = np.array([1.0, 0.7, 0.5])
    plain = np.round(frames[..., None] * gain * tint).astype(dtype)
    hidden = np.repeat(masks(len(frames))[..., None], 3, axis=-1)
    hidden[0] = False
    seen = np.ma.masked_array(np.where(hidden, 0, plain), hidden)
    tracker = ParticleTracker(plain[0], boxes=[(*(centres[0] - 9.5), 19, 19)], random_state=1)
    for t, frame in enumerate(seen[1:], 1):
        step = tracker.update(frame)
        if t == 5:
            tracker = pickle.loads(pickle.dumps(tracker))
    assert np.linalg.norm(step.position[0] - centres[-1]) < 4


def test_the_stereo_tracker_takes_masked_views():
    frames, _ = scene(3)
    left = np.round(frames).astype(np.uint16) * 257
    right = np.roll(left, -4, axis=2)
    hidden = np.zeros(left.shape, bool)
    hidden[:, :9] = True
    masked, nan = StereoTracker(), StereoTracker()
    for one, other, mask in zip(left, right, hidden, strict=True):
        step = masked.update(np.ma.masked_array(one, mask), np.ma.masked_array(other, mask))
        floats = [np.where(mask, np.nan, view / np.float32(65535)).astype(np.float32) for view in (one, other)]
        same = nan.update(*floats)
        np.testing.assert_array_equal(step.cols, same.cols)
        np.testing.assert_allclose(step.values, same.values)
    assert len(step.cols) and step.rows.min() >= 8


@pytest.mark.parametrize("gain", [1, 1 / 255])
def test_the_type_of_particle_frames_may_change(gain):
    frames, centres = scene(6)
    plain = np.round(np.repeat(frames[..., None], 3, axis=-1)).astype(np.uint8)
    boxes = [(*(centres[0] - 9.5), 19, 19)]
    same, other = ParticleTracker(plain[0], boxes), ParticleTracker(plain[0], boxes)
    for frame in plain[1:]:
        step, changed = same.update(frame), other.update(frame.astype(np.float64) * gain)
        np.testing.assert_allclose(changed.boxes, step.boxes, atol=1e-3)


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_masked_integers_after_floats_are_as_bright(dtype):
    frames, centres = scene(8)
    tracker = GradientTracker(frames[0], bbox=(*(centres[0] - 9.5), 19, 19))
    whole = np.ma.masked_array(np.round(frames * (257 if dtype == "uint16" else 1)).astype(dtype), np.zeros(frames.shape, bool))
    found = [tracker.update(frame) for frame in whole[1:]]
    assert {result.status for result in found} == {"tracking"}
    assert found[-1].gain == pytest.approx(1, abs=0.05)


def test_a_box_that_the_first_frame_does_not_show_is_refused():
    frames, centres = scene(1)
    frames[0, 25:60, 10:50] = np.nan
    with pytest.raises(ValueError, match=r"^bbox: expected a box of which the first frame shows at least half, got 0 of \d+ samples"):
        GradientTracker(frames[0], bbox=(*(centres[0] - 9.5), 19, 19))


def test_scattered_missing_pixels_leave_corners():
    scenes = TargetScene("people_static", scale=0.5, frames=20)
    boxes, rng = np.array(scenes.boxes()[:20]), np.random.default_rng(1)
    for t in range(20):
        frame = scenes.frame(t)
        hidden = np.repeat((rng.random(frame.shape[:2]) < 0.02)[..., None], 3, axis=2)
        seen = np.ma.masked_array(frame, hidden)
        if t == 0:
            tracker = ParticleTracker(seen, boxes[0])
        else:
            step = tracker.update(seen)
    assert set(step.reason) == {""}
    assert np.linalg.norm(step.position - boxes[19][:, :2] - boxes[19][:, 2:] / 2, axis=1).max() < 12
