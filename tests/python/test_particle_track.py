"""The particle tracker through Python: identities kept in a crossing, promises on random numbers, copies, odd
frames and errors.
"""

import copy
import pickle
import signal
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.ndimage import gaussian_filter

from jacoflow import _jacoflow, scenes
from jacoflow.track import ParticleStep, ParticleTracker, ParticleTracks, track_particles

FIRST, LAST = 43, 73
"""Frames of the scene between which its two people cross, at frame 58."""
FEW = {"n_particles": 100, "n_near": 200}


class Clip:
    """Frames (T, H, W, 3) and true boxes (T, K, 4) of part of a scene."""

    def __init__(self, name, first, last, seed=10):
        scene = scenes.TargetScene(name, random_state=seed)
        self.frames = np.stack([scene.frame(t) for t in range(first, last)])
        self.boxes = scene.boxes()[first:last]
        self.frames.flags.writeable = False


@pytest.fixture(scope="module")
def crossing():
    return Clip("people_handheld", FIRST, LAST)


@pytest.fixture(scope="module")
def apart():
    """Two people far from each other."""
    return Clip("people_static", 0, 8)


def everything(step):
    """All numbers of a step."""
    arrays = [step.ids, step.boxes, step.position, step.velocity, step.size, step.covariance, step.effective_sample_size, step.similarity, step.n_tracks]
    corners = step.tracks
    arrays += [step.degenerate, step.near, step.camera, corners.ids, corners.positions, corners.residuals, corners.p, corners.owner]
    return arrays + [array for number in step.ids for array in step.particles(number)]


def assert_same(one, other):
    assert (one.frame, one.status, one.reason) == (other.frame, other.status, other.reason)
    for a, b in zip(everything(one), everything(other), strict=True):
        assert a.dtype == b.dtype
        assert_array_equal(a, b)


def run(clip, count=None, **options):
    """Steps over a clip."""
    tracker = ParticleTracker(clip.frames[0], clip.boxes[0], **options)
    return [tracker.step, *(tracker.update(frame) for frame in clip.frames[1:count])]


def holds(boxes, points):
    """Whether each box (K, 4) holds its point (K, 2)."""
    inside = points - boxes[:, :2]
    return (inside > 0).all(axis=1) & (inside < boxes[:, 2:]).all(axis=1)


def overlap(one, other):
    """Intersection over union of boxes (K, 4)."""
    low = np.maximum(one[:, :2], other[:, :2])
    high = np.minimum(one[:, :2] + one[:, 2:], other[:, :2] + other[:, 2:])
    common = np.clip(high - low, 0, None).prod(axis=1)
    return common / (one[:, 2:].prod(axis=1) + other[:, 2:].prod(axis=1) - common)


def test_both_identities_survive_a_crossing(crossing):
    steps = run(crossing)
    assert holds(crossing.boxes[-1], steps[-1].position).all()
    assert overlap(crossing.boxes[-1], steps[-1].boxes).min() > 0.5
    near = np.array([step.near[0, 1] for step in steps])
    assert near.any() and not near[0] and not near[-1]
    assert any("occluded" in step.status or "coasting" in step.status for step in steps)
    assert steps[-1].status == ("tracking", "tracking")


def test_a_step_says_what_it_promises(crossing):
    first, *_, step = run(crossing, 4, **FEW)
    assert isinstance(step, ParticleStep) and len(step) == 2 and step.frame == 3 and first.frame == 0
    height, width = crossing.frames.shape[1:3]
    shapes = {"ids": (2,), "boxes": (2, 4), "position": (2, 2), "velocity": (2, 2), "size": (2, 2), "covariance": (2, 6, 6), "camera": (2, 3), "near": (2, 2)}
    for name, shape in shapes.items():
        assert getattr(step, name).shape == shape, name
    assert_allclose(step.boxes[:, :2] + step.boxes[:, 2:] / 2, step.position)
    assert_array_equal(step.boxes[:, 2:], step.size)
    assert_allclose(first.boxes, crossing.boxes[0])
    for at, number in enumerate(step.ids):
        particles, weights = step.particles(number)
        assert particles.shape == (100, 6) and weights.sum() == pytest.approx(1)
        assert_allclose(weights @ particles, [*step.position[at], *step.velocity[at], *step.size[at]])
        assert_allclose(np.cov(particles.T, aweights=weights, bias=True), step.covariance[at], rtol=1e-9, atol=1e-9)
        assert step.effective_sample_size[at] == pytest.approx(1 / (weights**2).sum())
        assert step.n_tracks[at] == (step.tracks.owner == number).sum()
    corners = step.tracks
    assert len(corners) > 50 and len(first.tracks) == 0 and (np.diff(corners.ids) > 0).all()
    assert ((corners.p >= 0) & (corners.p <= 1)).all() and set(corners.owner) <= {-1, 0, 1}
    assert ((corners.positions > -1) & (corners.positions < [width, height])).all()
    assert step.foreground.shape == step.segments.shape == (height, width)
    assert (step.foreground.dtype, step.segments.dtype) == (np.float32, np.int32)
    assert step.foreground.min() >= 0 and step.foreground.max() == 1 and first.foreground.max() == 0
    assert step.foreground is step.foreground
    # Every segment has one value.
    for label in range(0, step.segments.max() + 1, 10):
        assert np.ptp(step.foreground[step.segments == label]) == 0
    assert step.index(1) == 1
    with pytest.raises(KeyError):
        step.index(5)


def test_a_step_stays_when_the_tracker_goes_on(crossing):
    frame = crossing.frames[1].copy()
    tracker = ParticleTracker(crossing.frames[0], crossing.boxes[0], **FEW)
    step = tracker.update(frame)
    later = pickle.loads(pickle.dumps(step))
    now = run(crossing, 2, **FEW)[-1]
    foreground, segments = now.foreground, now.segments
    # The caller's buffer may be used again.
    frame[:] = 0
    tracker.update(crossing.frames[2])
    for each in (step, later, copy.deepcopy(step)):
        assert_same(each, now)
        assert_array_equal(each.foreground, foreground)
        assert_array_equal(each.segments, segments)
    poor = step.without(particles=False)
    assert_array_equal(poor.particles(0)[0], step.particles(0)[0])
    with pytest.raises(ValueError, match="^keep_frames: expected a step that keeps its frame"):
        _ = poor.foreground
    for each in (step.without(frame=False), pickle.loads(pickle.dumps(step.without(frame=False)))):
        assert_array_equal(each.segments, segments)
        with pytest.raises(ValueError, match="^keep_particles: expected"):
            each.particles(0)


def test_threads_do_not_change_a_bit(crossing):
    for options in ({}, {"mode": "paper"}):
        runs = [run(crossing, 6, threads=threads, **FEW, **options) for threads in (1, 2, 4)]
        for others in runs[1:]:
            for one, other in zip(runs[0], others, strict=True):
                assert_same(one, other)
            assert_array_equal(runs[0][-1].foreground, others[-1].foreground)


def test_each_likelihood_weighs(apart):
    """Without any, all particles inside the picture weigh the same; each takes some weight away."""
    frames = apart.frames[:3]
    free = track_particles(frames, apart.boxes[0], likelihoods=(), **FEW)[-1]
    assert_allclose(free.effective_sample_size, 100)
    for name in ("colour", "velocity", "tracks", "foreground"):
        step = track_particles(frames, apart.boxes[0], likelihoods=[name], **FEW)[-1]
        assert (step.effective_sample_size < 99).all() and np.isfinite(step.boxes).all(), name
    # Nothing is near: there is no distance to keep.
    assert_array_equal(track_particles(frames, apart.boxes[0], likelihoods=["distance"], **FEW)[-1].boxes, free.boxes)
    near = {0: apart.boxes[0][0], 1: apart.boxes[0][0] + [12, 0, 0, 0]}
    assert (track_particles(frames, near, likelihoods=["distance"], **FEW)[-1].effective_sample_size < 190).all()


def test_the_seed_decides(crossing):
    one, other, same = (run(crossing, 3, random_state=seed, **FEW)[-1] for seed in (0, 1, 0))
    assert_same(one, same)
    assert (one.boxes != other.boxes).all()


@pytest.mark.parametrize("mode", ["improved", "paper"])
def test_a_target_does_not_depend_on_others_that_are_never_near(apart, mode):
    def last(boxes):
        tracker = ParticleTracker(apart.frames[0], boxes, mode=mode, **FEW)
        steps = [tracker.update(frame) for frame in apart.frames[1:]]
        assert not any(step.near[step.index(4)].any() for step in steps)
        return steps[-1]

    left, right = apart.boxes[0]
    alone = last({4: left})
    for boxes in ({4: left, 9: right}, {1: right, 4: left}, {0: right + [0, -60, 0, 0], 4: left, 11: right}):
        step = last(boxes)
        at = step.index(4)
        for name in ("boxes", "covariance", "similarity", "effective_sample_size", "n_tracks"):
            assert_array_equal(getattr(step, name)[at], getattr(alone, name)[0], err_msg=name)
        assert_array_equal(step.particles(4)[0], alone.particles(4)[0])


@pytest.mark.parametrize("options", [{}, {"mode": "paper", "threads": 2}, {"resampling": "systematic", "ess_threshold": 0.5, "random_state": 3}])
def test_a_pickled_tracker_goes_on_bit_for_bit(crossing, options):
    tracker = ParticleTracker(crossing.frames[10], crossing.boxes[10], **FEW, **options)
    for frame in crossing.frames[11:14]:
        tracker.update(frame)
    copies = [pickle.loads(pickle.dumps(tracker, protocol)) for protocol in (2, pickle.HIGHEST_PROTOCOL)] + [copy.deepcopy(tracker)]
    for other in copies:
        assert other.options == tracker.options
        assert_same(other.step, tracker.step)
    for frame in crossing.frames[14:18]:
        step = tracker.update(frame)
        for other in copies:
            assert_same(other.update(frame), step)
    assert {each.add([20, 20, 10, 30]) for each in (tracker, *copies)} == {2}


def test_damaged_pickles_are_refused(crossing):
    tracker = ParticleTracker(crossing.frames[0], crossing.boxes[0], n_particles=8, n_near=8)
    restore, (state, grey) = tracker._tracker.__reduce__()
    assert restore is _jacoflow._restore_particle_tracker and grey is False
    for at in (0, 5, 17, len(state) // 2, len(state) - 1):
        damaged = bytearray(state)
        damaged[at] ^= 1
        for broken in (bytes(damaged), state[:at]):
            with pytest.raises(ValueError, match="^state: expected the bytes of a pickled particle tracker, got "):
                restore(broken, False)
            with pytest.raises(ValueError, match="^state: "):
                _jacoflow._restore_particle_step(broken)


def test_sample_types_agree(crossing):
    levels = crossing.frames[::2]
    kinds = {
        "uint8": levels,
        "uint16": levels.astype(np.uint16) * 257,
        "float32": levels.astype(np.float32) / 255,
        "float64": levels / 255,
        "float64 levels": levels.astype(float),
    }
    for name, frames in kinds.items():
        last = track_particles(frames, crossing.boxes[0])[-1]
        assert holds(crossing.boxes[-2], last.position).all(), name
        assert overlap(crossing.boxes[-2], last.boxes).min() > 0.5, name


def test_memory_layout_does_not_matter(crossing):
    reference = run(crossing, 3, **FEW)
    wide = np.zeros((3, 480, 720, 6), np.uint8)
    wide[:, ::2, ::2, ::2] = crossing.frames[:3]
    variants = {
        "strided": [frame[::2, ::2, ::2] for frame in wide],
        "fortran": [np.asfortranarray(frame) for frame in crossing.frames[:3]],
        "blue first": [np.ascontiguousarray(frame[..., ::-1])[..., ::-1] for frame in crossing.frames[:3]],
        "upside down": [np.ascontiguousarray(frame[::-1])[::-1] for frame in crossing.frames[:3]],
        "planes": [np.ascontiguousarray(frame.transpose(2, 0, 1)).transpose(1, 2, 0) for frame in crossing.frames[:3]],
        "lists": [frame.tolist() for frame in crossing.frames[:3].astype(float)],
    }
    for name, frames in variants.items():
        steps = track_particles(frames, crossing.boxes[0], keep_particles=True, **FEW)
        if name == "lists":
            # Numbers of Python are float64: grey levels, as those of uint8.
            assert_allclose(steps[-1].boxes, reference[-1].boxes, atol=1)
            continue
        for one, other in zip(steps, reference, strict=True):
            assert_same(one, other)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_pixels_that_are_not_finite_are_not_counted(crossing, value):
    frames = crossing.frames[::2].astype(np.float32)
    frames[:, 10:40, 20:160] = value
    frames[:, 150:152, ::7, 1] = value
    last = track_particles(frames, crossing.boxes[0])[-1]
    assert holds(crossing.boxes[-2], last.position).all()
    x, y = last.tracks.positions.T
    assert not ((x > 21) & (x < 158) & (y > 11) & (y < 38)).any()


def test_repeated_and_dropped_frames_change_no_identity(crossing):
    order = [0, 1, 2, 3, 3, *range(4, 12), *range(13, LAST - FIRST)]
    steps = track_particles(crossing.frames[order], crossing.boxes[0])
    assert holds(crossing.boxes[-1], steps[-1].position).all()
    # The same frame once more: nothing has moved.
    assert abs(steps[4].tracks.residuals).max() < 0.05 and abs(steps[4].camera - np.eye(2, 3)).max() < 0.01


def test_a_frame_that_shows_nothing_is_passed_over(apart):
    frames = apart.frames.astype(np.float32)
    frames[4] = np.nan
    steps = track_particles(frames, apart.boxes[0], keep_frames=True)
    blind = steps[4]
    assert blind.status == ("coasting", "coasting") and blind.reason == ("the frame shows nothing",) * 2
    assert_allclose(blind.position, steps[3].position + steps[3].velocity, atol=1)
    assert np.isfinite(blind.covariance).all() and len(blind.tracks) == 0 and blind.foreground.max() == 0
    assert steps[-1].status == ("tracking", "tracking") and holds(apart.boxes[-1], steps[-1].position).all()
    nothing = ParticleTracker(np.full((40, 50, 3), np.nan, np.float32), [[10, 10, 8, 12]])
    step = nothing.update(np.full((40, 50, 3), np.nan, np.float32))
    assert step.status == ("coasting",) and np.isfinite(step.boxes).all()


def test_textureless_frames_leave_targets_where_they_are():
    frame = np.full((60, 80, 3), 90, np.uint8)
    frame[20:44, 30:42] = 200, 40, 40
    for mode in ("improved", "paper"):
        step = track_particles([frame] * 6, [[29.5, 19.5, 12, 24]], mode=mode)[-1]
        assert np.isfinite(step.covariance).all() and abs(step.position - [35.5, 31.5]).max() < 3, mode


def test_a_cut_lets_all_targets_coast(apart):
    other = Clip("cars_handheld", 0, 1, seed=4).frames[0]
    tracker = ParticleTracker(apart.frames[0], apart.boxes[0], **FEW)
    for frame in apart.frames[1:]:
        before = tracker.update(frame)
    assert (before.n_tracks > 0).all()
    step = tracker.update(other)
    assert step.status == ("coasting", "coasting") and step.reason == ("the scene was cut",) * 2
    assert (step.n_tracks == 0).all() and (step.tracks.owner == -1).all()


def test_corners_that_survive_a_cut_are_not_taken_for_the_background():
    """The target alone stays in view while the scenery changes with every frame."""
    rng = np.random.default_rng(0)
    textures = gaussian_filter(rng.normal(size=(12, 120, 160, 3)), (0, 1.5, 1.5, 0))
    textures = np.clip(128 + 300 * textures, 0, 255).astype(np.uint8)

    def frame(t):
        image = textures[max(t - 5, 0)].copy()
        image[40:70, 20 + 2 * t : 50 + 2 * t] = textures[11, :30, :30]
        return image

    tracker = ParticleTracker(frame(0), [[20, 40, 30, 30]], **FEW)
    steps = [tracker.update(frame(t)) for t in range(1, 16)]
    assert [step.reason[0] for step in steps[5:]] == ["the scene was cut"] * 10
    assert all(np.array_equal(step.camera, np.eye(2, 3)) for step in steps[5:])
    # Nobody measures it: at 2 px a frame, it is where the velocity of the frames before takes it.
    assert_allclose(steps[-1].boxes[0, 0], 50, atol=5)


def test_a_known_camera_counts_through_frames_that_show_nothing(apart):
    # The camera turns left by 3 px a frame; one frame is lost on the way.
    frames = [np.roll(frame, 3 * t, axis=1).astype(np.float32) for t, frame in enumerate(apart.frames)]
    camera = [[1, 0, 3], [0, 1, 0]]
    tracker = ParticleTracker(frames[0], apart.boxes[0], **FEW)
    for t in range(1, 6):
        frame = np.full_like(frames[t], np.nan) if t == 3 else frames[t]
        step = tracker.update(frame, camera=camera)
        if t == 4:
            np.testing.assert_allclose(step.camera, [[1, 0, 6], [0, 1, 0]], atol=1e-12)
    background = step.tracks.p < 0.5
    assert np.abs(np.median(step.tracks.residuals[background], axis=0)).max() < 0.1


def test_nothing_shown_for_long_is_lost(apart):
    tracker = ParticleTracker(apart.frames[0].astype(np.float32), apart.boxes[0], **FEW)
    nothing = np.full(apart.frames[0].shape, np.nan, np.float32)
    statuses = [tracker.update(nothing).status[0] for _ in range(40)]
    assert statuses[0] == "coasting" and set(statuses[30:]) <= {"lost", "out"}


@pytest.mark.parametrize("options", [{}, {"mode": "paper"}, {"likelihoods": ("colour", "velocity")}])
def test_a_cut_ends_when_the_scene_comes_back(apart, options):
    other = Clip("cars_handheld", 0, 1, seed=4).frames[0]
    tracker = ParticleTracker(apart.frames[0], apart.boxes[0], **FEW, **options)
    for frame in [*apart.frames[1:4], other, *apart.frames[4:]]:
        step = tracker.update(frame)
    assert "coasting" not in step.status


def panned(clip, count):
    """The camera turns right by 10 px a frame until the left person is gone."""
    return [clip.frames[0][:, 10 + 10 * t : 210 + 10 * t] for t in range(count)]


def test_targets_leave_and_may_be_added_again(apart):
    frames = panned(apart, 14)
    left = apart.boxes[0][0] - [10, 0, 0, 0]
    tracker = ParticleTracker(frames[0], {3: left})
    steps = [tracker.update(frame) for frame in frames[1:]]
    statuses = [step.status[0] for step in steps]
    gone = statuses.index("out")
    assert set(statuses[gone:]) == {"out"} and "out" not in statuses[:gone]
    # The true centre, carried on by one frame.
    x = left[0] + left[2] / 2 - 10 * (gone + 2)
    assert -20 <= x < 0 and steps[0].camera[0, 2] == pytest.approx(-10, abs=0.05)
    assert_array_equal(steps[-1].boxes, steps[-2].boxes)
    assert tracker.add([60, 80, 20, 60], id=3) == 3
    assert tracker.step.status == ("tracking",) and tracker.update(frames[-1]).status != ("out",)
    with pytest.raises(ValueError, match=r"^id: expected a number that is not in use, got 3$"):
        tracker.add([60, 80, 20, 60], id=3)


def test_targets_come_and_go(apart):
    tracker = ParticleTracker(apart.frames[0], [])
    assert len(tracker.step) == 0 and tracker.step.boxes.shape == (0, 4) and len(tracker.update(apart.frames[1])) == 0
    assert tracker.add(apart.boxes[1][1]) == 0 and tracker.add(apart.boxes[1][0], id=7) == 7
    step = tracker.update(apart.frames[2])
    assert tracker.add(tuple(apart.boxes[2][0] + [-40, 0, 0, 0])) == 8
    added = tracker.step
    # What is said of the others stays.
    for name in ("boxes", "covariance", "n_tracks", "similarity"):
        assert_array_equal(getattr(added, name)[:2], getattr(step, name))
    assert_array_equal(added.near[:2, :2], step.near)
    assert added.status[:2] == step.status and len(added.tracks) == len(step.tracks)
    assert added.ids.tolist() == [0, 7, 8]
    tracker.remove(7)
    assert tracker.step.ids.tolist() == [0, 8] and 7 not in tracker.step.tracks.owner
    assert_array_equal(tracker.step.boxes, added.boxes[[0, 2]])
    assert tracker.update(apart.frames[3]).ids.tolist() == [0, 8]
    with pytest.raises(ValueError, match=r"^id: expected one of the numbers in use \(0, 8\), got 7"):
        tracker.remove(7)


def test_who_is_near_whom_survives_additions_and_removals(apart):
    left, right = apart.boxes[0]
    tracker = ParticleTracker(apart.frames[0], {3: left, 7: left}, **FEW)
    assert tracker.update(apart.frames[1]).near.tolist() == [[False, True], [True, False]]
    tracker.add(right, id=5)
    assert tracker.step.near.tolist() == [[False, False, True], [False, False, False], [True, False, False]]
    assert_array_equal(tracker.update(apart.frames[2]).near, [[False, False, True], [False, False, False], [True, False, False]])
    tracker.remove(5)
    assert tracker.step.near.tolist() == [[False, True], [True, False]]
    tracker.remove(3)
    assert tracker.step.near.tolist() == [[False]]


def test_two_targets_in_one_box_and_boxes_of_few_rows(apart):
    box = apart.boxes[0][0]
    step = track_particles(apart.frames[:3], {0: box, 1: box}, **FEW)[-1]
    assert step.near.tolist() == [[False, True], [True, False]]
    low = track_particles(apart.frames[:3], [[*box[:3], 2.0], [*box[:3], 5.0]], **FEW)[-1]
    assert np.isfinite(low.boxes).all()
    half_outside = track_particles(apart.frames[:3], [[-10, 80, 27, 66]], **FEW)[-1]
    assert np.isfinite(half_outside.boxes).all()


def test_a_known_camera_is_taken(apart):
    frames = panned(apart, 4)
    shift = np.array([[1, 0, -10], [0, 1, 0.0]])
    tracker = ParticleTracker(frames[0], [apart.boxes[0][0] - [10, 0, 0, 0]])
    for frame in frames[1:]:
        step = tracker.update(frame, camera=shift)
        assert_allclose(step.camera, shift, atol=1e-12)
    assert np.median(np.linalg.norm(step.tracks.residuals, axis=1)) < 0.05
    paper = ParticleTracker(frames[0], [apart.boxes[0][0] - [10, 0, 0, 0]], mode="paper", **FEW)
    assert_allclose(paper.update(frames[1]).camera, np.eye(2, 3))


def test_grey_frames_need_the_option(crossing):
    grey = crossing.frames[:6, ..., 1]
    with pytest.raises(ValueError, match=r"^frame: expected a colour frame \(H, W, 3\), got a grey frame \(240, 360\); colour is needed"):
        ParticleTracker(grey[0], crossing.boxes[0])
    one = track_particles(grey, crossing.boxes[0], grey="value", **FEW, keep_particles=True)
    same = track_particles(np.repeat(grey[..., None], 3, axis=3), crossing.boxes[0], **FEW, keep_particles=True)
    assert_same(one[-1], same[-1])


def test_a_sequence_gives_tracks(crossing, tmp_path):
    seen = []
    left, right = crossing.boxes[0]
    starts = {0: {2: right}, 3: {5: crossing.boxes[3][0]}}
    tracks = track_particles(iter(crossing.frames[:8]), starts, progress=lambda done, total: seen.append((done, total)), **FEW)
    assert isinstance(tracks, ParticleTracks) and len(tracks) == 8 == len(list(tracks)) and len(tracks[2:4]) == 2
    assert seen == [*((done, 0) for done in range(1, 9)), (8, 8)]
    assert tracks.ids.tolist() == [2, 5] and tracks[2].ids.tolist() == [2] and tracks[3].ids.tolist() == [2, 5]
    late = tracks.track(5)
    assert (len(late), late.id, late.present.tolist()) == (8, 5, [False] * 3 + [True] * 5)
    assert np.isnan(late.boxes[:3]).all() and np.isnan(late.covariance[:3]).all() and late.status[2:4] == ("", "tracking")
    assert (late.n_tracks[:3] == -1).all() and late.covariance.shape == (8, 6, 6)
    for t in range(3, 8):
        assert_array_equal(late.boxes[t], tracks[t].boxes[1])
    with pytest.raises(ValueError, match=r"^id: expected a target that occurs \(2, 5\), got 0"):
        tracks.track(0)
    pickled = pickle.loads(pickle.dumps(tracks))
    for name in ("a", "b"):
        (tracks if name == "a" else pickled).save_mot(tmp_path / f"{name}.txt")
        (tracks if name == "a" else pickled).save_csv(str(tmp_path / f"{name}.csv"))
    for form in ("txt", "csv"):
        assert (tmp_path / f"a.{form}").read_text() == (tmp_path / f"b.{form}").read_text()
    lines = np.loadtxt(tmp_path / "a.txt", delimiter=",")
    assert lines.shape == (8 + 5, 10)
    assert_array_equal(lines[:, :2][-2:], [[8, 2], [8, 5]])
    assert_allclose(lines[-1, 2:6], late.boxes[-1] + [1.5, 1.5, 0, 0], atol=5.1e-4)
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    assert header.startswith("target,frame,time,status,") and header.endswith(",similarity,n_tracks,degenerate") and len(rows) == 13
    assert float(rows[-1].split(",")[header.split(",").index("x")]) == late.position[-1, 0]


def test_files_are_those_of_the_command(crossing, tmp_path):
    frames = crossing.frames[:6]
    np.save(tmp_path / "sequence.npy", frames)
    boxes = [argument for box in crossing.boxes[0] for argument in ("--bbox", ",".join(repr(float(side)) for side in box))]
    command = [sys.executable, "-m", "jacoflow", "track", "sequence.npy", "--method", "particle", *boxes, "--n-particles", "100", "--mot", "a.txt", "--csv", "a.csv"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    tracks = track_particles(frames, dict(enumerate(crossing.boxes[0], start=1)), **FEW)
    tracks.save_mot(tmp_path / "b.txt")
    tracks.save_csv(tmp_path / "b.csv")
    for form in ("txt", "csv"):
        assert (tmp_path / f"a.{form}").read_text() == (tmp_path / f"b.{form}").read_text()
    with pytest.raises(OSError, match="none"):
        tracks.save_mot(tmp_path / "none" / "a.txt")


def test_hidden_targets_have_no_confidence_and_lost_ones_no_line(apart, tmp_path):
    blind = np.full_like(apart.frames[0], np.nan, np.float32)
    frames = [*apart.frames[:2].astype(np.float32), blind]
    tracks = track_particles(frames, apart.boxes[0], **FEW)
    tracks.save_mot(tmp_path / "a.txt")
    lines = np.loadtxt(tmp_path / "a.txt", delimiter=",")
    assert (lines[:4, 6] > 0.3).all() and (lines[4:, 6] == 0).all() and len(lines) == 6
    gone = track_particles(panned(apart, 13), [apart.boxes[0][0] - [10, 0, 0, 0]])
    gone.save_mot(tmp_path / "b.txt")
    assert len(np.loadtxt(tmp_path / "b.txt", delimiter=",")) == sum(step.status != ("out",) for step in gone) < 13


def test_interruption_stops_between_frames(apart):
    def frames():
        for t, frame in enumerate(apart.frames):
            if t == 3:
                signal.raise_signal(signal.SIGINT)
            yield frame

    seen = []
    # A shell that starts the tests in the background has them ignore the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            track_particles(frames(), apart.boxes[0], progress=lambda done, total: seen.append(done), **FEW)
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [1, 2, 3]


def test_the_line_of_progress(capsys, apart):
    track_particles(apart.frames[:3], apart.boxes[0], progress=True, n_particles=8, n_near=8)
    assert capsys.readouterr().err == "\r1/3 frames\r2/3 frames\r3/3 frames\n"
    track_particles(iter(apart.frames[:2]), apart.boxes[0], progress=True, n_particles=8, n_near=8)
    assert capsys.readouterr().err == "\r1 frames\r2 frames\r2/2 frames\n"
