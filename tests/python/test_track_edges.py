"""Edge cases of the gradient tracker: wrong boxes, starts beside the target, windows larger than the frame,
targets that stop, crawl, leave and return."""

import dataclasses

import numpy as np
import pytest
from test_track import follow, overlap, success

from benchmarks.scenes import tracking as tracking_scenes
from benchmarks.scenes import tracking_hard as tracking_hard_scenes
from benchmarks.scenes.tracking import TIMES, Plane, Scene, circle, figure
from jacoflow import track

HARD = {scene.name: scene for scene in tracking_hard_scenes.further()}
SIMULATION = {scene.name: scene for scene in tracking_scenes.simulations()}


@pytest.mark.parametrize(("right", "down", "larger"), [(2, -2, 1), (-2, 2, 1), (2, 2, 1), (0, 0, 1.4), (0, 0, 0.6), (1, -1, 1.2), (-2, 0, 1.3), (0, 2, 0.7)])
def test_support_adapts_to_wrong_boxes(right, down, larger):
    """Box off by 2 px or by 40 % of its size: the target is held all the same, in Simulation 1 on several
    backgrounds, slow and fast."""
    for kind, radius in (("flat:90", 20.0), ("smooth:4,90,20", 8.0), ("smooth:2,128,40", 20.0), ("fractal:1,90,30", 8.0)):
        scene = tracking_scenes.simulation(1, kind, radius, seed=4)
        x, y, w, h = scene.start_box
        wrong = dataclasses.replace(scene, start=(x + right + w * (1 - larger) / 2, y + down + h * (1 - larger) / 2, w * larger, h * larger))
        found = follow(wrong)
        off = np.linalg.norm(found.position - scene.centres, axis=1)
        # An even target does not show where in it a smaller box is, until its edges are learned.
        assert off[1:].max() <= (3.0 if larger >= 1 else 4.0) and np.median(off[8:]) <= 1.0, (kind, radius)
        assert success(wrong, found) >= 0.98, (kind, radius)


def test_starts_five_px_beside_the_centre_find_the_box():
    """Only a point near the target is given: its box is found in two frames, and it is followed to the
    end."""
    overlaps = []
    for number, scene in enumerate(SIMULATION.values()):
        angle = number * 2.4
        found = track.track(scene.frames(), center=scene.centres[0] + 5 * np.array([np.cos(angle), np.sin(angle)]))
        begun = np.flatnonzero(found.status != "lost")[0]
        assert begun == 1, scene.name
        overlaps.append(overlap(found.box[1:2], scene.boxes[1:2])[0])
        assert np.linalg.norm(found.position - scene.centres, axis=1)[3:].max() <= 3.0, scene.name
    assert np.mean(overlaps) >= 0.85


def test_stated_deviations_hold_the_centre():
    """Within two stated deviations in 95 % of frames would be right for independent errors; those of the
    learned outline stay from frame to frame. While it is being learned, in the first ten frames, its middle
    may still move, and large targets say so."""
    held = []
    for scene in SIMULATION.values():
        found = follow(scene)
        deviations = np.sqrt(found.covariance[:, :, 0, 0])
        held.append((np.abs(found.position - scene.centres) < 2 * deviations)[1:].mean())
        # The specification's range for targets of one size; it says itself that growing ones are stated too
        # sure of.
        assert held[-1] >= 0.92 or scene.name.startswith("S3"), scene.name
        assert deviations[5:].max() <= 0.9 and deviations[10:].max() <= 0.45, scene.name
    assert np.mean(held) >= 0.95


def test_a_target_that_stops_is_held():
    scene = HARD["stops at 20 for good"]
    layered = follow(scene)
    assert np.linalg.norm(layered.position - scene.centres, axis=1)[1:].max() <= 0.5 and np.all(layered.status == "tracking")


def test_layers_keep_a_target_that_crawls():
    scene = HARD["0.3 px/frame"]
    assert success(scene, follow(scene)) == 1.0


def test_what_leaves_the_picture_is_out_and_comes_back_by_itself():
    scene = HARD["leaves the picture and returns"]
    found = follow(scene)
    assert found.status[-1] == "tracking"
    assert np.linalg.norm(found.position[-1] - scene.centres[-1]) < 1
    gone = track.track(scene.frames()[:25], scene.start_box)
    tracker = track.GradientTracker(scene.frames()[0], scene.start_box)
    for frame in (*scene.frames()[1:25], *[scene.frames()[25]] * 30):
        result = tracker.update(frame)
        assert np.isfinite(result.position).all() and np.isfinite(result.covariance).all()
    assert len(gone) == 25 and result.status == "lost"


def test_out_lasts_and_has_no_velocity():
    frames = np.full((45, 64, 128), 90, np.uint8)
    for t in range(45):
        frames[t, 26:39, 100 + 3 * t : 113 + 3 * t] = 200
    found = track.track(frames, (99.5, 25.5, 13, 13))
    out = np.flatnonzero(found.status == "out")
    assert len(out) >= 8 and np.all(np.diff(out) == 1) and np.all(found.status[out[-1] + 1 :] == "lost")
    assert not found.velocity[out].any()
    np.testing.assert_allclose(found.box[out, 0] + found.box[out, 2] / 2, found.position[out, 0])


@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_a_target_like_its_background_coasts(noise):
    frames = np.clip(np.rint(90 + np.random.default_rng(1).normal(0, noise, (20, 40, 40))), 0, 255).astype(np.uint8)
    found = track.track(frames, (10, 10, 13, 13))
    assert np.isfinite(found.position).all() and np.isfinite(found.covariance).all()
    assert np.linalg.norm(found.position - found.position[0], axis=1).max() < 1
    assert "tracking" not in found.status[1:] and found.status[-1] == "lost"
    variances = found.covariance[:, 0, 0, 0]
    assert variances[-1] > variances[1] > variances[0]


def textured(height, width, sigma=3.0, mean=90.0, deviation=30.0):
    """A background."""
    from scipy.ndimage import gaussian_filter

    rough = gaussian_filter(np.random.default_rng(3).standard_normal((height, width)), sigma, mode="wrap")
    return np.clip(mean + deviation * rough / rough.std(), 0, 255)


def seen(picture, rng):
    """With noise, as a camera tells it."""
    return np.clip(np.rint(picture + rng.normal(0, 2, picture.shape)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("speed", [2, 7, 10])
def test_velocity_is_in_the_picture_whether_the_camera_follows_the_target_or_not(speed):
    scene, rng, frames = textured(128, 400), np.random.default_rng(1), []
    for t in range(16):
        picture = scene[:, 50 + speed * t : 178 + speed * t].copy()
        picture[58:71, 58:71] = 200
        frames.append(seen(picture, rng))
    last = track.track(frames, (57.5, 57.5, 13, 13)).results[-1]
    np.testing.assert_allclose(last.velocity, (0, 0), atol=0.3)
    np.testing.assert_allclose(last.scene_velocity, (speed, 0), atol=0.3)


@pytest.mark.parametrize("side", [8, 13, 30, 60])
@pytest.mark.parametrize("step", [1, 2, 4, 8])
def test_even_targets_of_any_size_are_found_without_a_box(side, step):
    frames = np.full((12, 200, 300), 90, np.uint8)
    for t in range(12):
        frames[t, 85 : 85 + side, 65 + step * t : 65 + side + step * t] = 200
    found = track.detect_moving_target(frames[0], frames[1])
    # What moves by its own length may as well be a hole that moves the other way.
    if step < side:
        np.testing.assert_allclose(found.box, (64.5 + step, 84.5, side, side), atol=1.01)
    followed = track.track(frames)
    assert step == side or np.linalg.norm(followed.position[-1] - (65 + 11 * step + side / 2 - 0.5, 84.5 + side / 2)) < 1.5


def test_the_first_object_that_moves_is_found_under_a_moving_camera():
    scene, rng, frames = textured(128, 400), np.random.default_rng(1), []
    for t in range(30):
        picture = scene[:, 100 + 2 * t : 228 + 2 * t].copy()
        picture[58:71, 24 + t : 37 + t] = 220
        frames.append(seen(picture, rng))
    found = track.track(frames, center=(30, 64))
    assert np.linalg.norm(found.position[-1] - (59, 64)) < 1


@pytest.mark.parametrize("jump", [10, 18, 22, 25, 30])
def test_a_jump_does_not_send_the_filter_away(jump):
    scene, rng, frames = textured(200, 300, 4.0, 90.0, 20.0), np.random.default_rng(1), []
    for t in range(60):
        x = 40 + t + (jump if t >= 20 else 0)
        picture = scene.copy()
        picture[60:73, x : x + 13] = 200
        frames.append(seen(picture, rng))
    found = track.track(frames, (39.5, 59.5, 13, 13))
    assert np.linalg.norm(found.position[-1] - (40 + 59 + jump + 6, 66)) < 1 and found.status[-1] == "tracking"


def test_strong_noise_is_learnt_from_the_first_pair():
    rng = np.random.default_rng(2)
    scene, frames = textured(128, 128, 4.0, 90.0, 20.0), []
    for t in range(40):
        picture = scene.copy()
        picture[58:71, 40 + t : 53 + t] = 200
        frames.append(np.clip(np.rint(picture + rng.normal(0, 35, picture.shape)), 0, 255).astype(np.uint8))
    found = track.track(frames, (39.5, 57.5, 13, 13))
    assert np.mean(np.linalg.norm(found.position - np.stack([46 + np.arange(40), np.full(40, 64)], axis=1), axis=1) < 3) > 0.9


@pytest.mark.parametrize(
    ("arguments", "names"),
    [({"bbox": (0, 0, 1e9, 1e9)}, "bbox"), ({"bbox": (0, 0, 200, 9)}, "bbox"), ({"bbox": (-9, 10, 8, 5)}, "bbox")],
)
def test_more_errors_name_the_argument(arguments, names):
    frame = np.full((64, 64), 90, np.uint8)
    with pytest.raises(ValueError, match=names):
        track.GradientTracker(frame, **{"bbox": (20, 20, 13, 13), **arguments})


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
        np.testing.assert_allclose(found.position[-1] - corner, (3 + 7, 3), atol=0.5)


def test_an_ellipse_that_breathes_is_held_by_the_affine_model():
    scene = tracking_hard_scenes.breathing_ellipse()
    assert success(scene, follow(scene, model="affine")) >= 0.98


def breathing(seed, period, share):
    """An ellipse whose width and height swing against each other, on a circle."""
    swing = share * np.sin(2 * np.pi * TIMES / period)
    target = figure(circle(20.0), 16 * np.stack([1 + swing, 1 - swing], axis=1), 200.0, shape="disc")
    return Scene("breathing", (Plane("fractal:1,90,30", seed),), target)


@pytest.mark.parametrize("period", [20, 25, 40])
def test_an_ellipse_that_breathes_is_held_by_the_similarity_model_too(period):
    """A similarity alone becomes smaller and smaller; it is left where the outline goes on beyond it."""
    shares = [success(scene, follow(scene)) for scene in (breathing(seed, period, 0.45) for seed in (5, 21, 33))]
    assert min(shares) >= 0.8 and np.mean(shares) >= 0.88


def test_the_box_of_a_target_that_turns_out_of_the_plane_is_that_of_its_outline():
    scene = tracking_hard_scenes.turn_out_of_plane()
    assert success(scene, follow(scene)) >= 0.98


def plain(path, side, bar=0, seed=0):
    """Frames of a plain square along a path (T, 2), with a bar so wide over it where there is one."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:160, :192]
    behind = gaussian_filter(rng.normal(size=x.shape), 3, mode="wrap")
    behind = 90 + 20 * behind / behind.std()
    for right, down in path:
        share = np.clip((side + 1) / 2 - abs(x - right), 0, 1) * np.clip((side + 1) / 2 - abs(y - down), 0, 1)
        frame = behind * (1 - share) + 200 * share
        frame[:, 80 : 80 + bar] = 130
        yield np.clip(np.rint(frame + rng.normal(0, 2, frame.shape)), 0, 255).astype(np.uint8)


def box_about(centre, side):
    """Box of a square about its centre."""
    return (centre[0] - side / 2, centre[1] - side / 2, side, side)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("bar", [8, 15])
@pytest.mark.parametrize("side", [25, 33, 51])
def test_a_large_plain_target_passes_behind_a_bar(side, bar, seed):
    """The bar's edge stands for the target's own and would hold it back: a strip of a large target is
    little."""
    path = np.stack([30 + 1.5 * np.arange(80), np.full(80, 80.0)], axis=1)
    found = track.track(plain(path, side, bar, seed), box_about(path[0], side))
    errors = np.linalg.norm(found.position - path, axis=1)
    assert {"occluded"} <= set(found.status) <= {"tracking", "occluded", "coasting"}
    assert errors.max() < (side / 2 if side < 33 else 2.0) and errors[-15:].max() < 0.5


@pytest.mark.parametrize("side", [21, 61])
@pytest.mark.parametrize("turn", ["stop", "corner", "back"])
def test_a_large_plain_target_that_turns_is_not_taken_for_a_covered_one(side, turn):
    there, after = 1.5 * np.minimum(np.arange(60), 30), 1.5 * np.maximum(np.arange(60) - 30, 0)
    right, down = {"stop": (0, 0), "corner": (0, 1), "back": (-1, 0)}[turn]
    path = np.stack([40 + there + right * after, 70 + down * after], axis=1)
    found = track.track(plain(path, side), box_about(path[0], side))
    assert np.linalg.norm(found.position - path, axis=1).max() < 0.6 and np.mean(found.status == "tracking") > 0.95


@pytest.mark.parametrize("spoilt", ["a hundred times as bright", "a thousand times as bright", "five frames of noise"])
def test_wild_frames_are_passed_over_and_not_learnt(spoilt):
    rng = np.random.default_rng(1)
    scene, frames = textured(128, 160), []
    for t in range(45):
        picture = scene.copy()
        picture[58:71, 30 + t : 43 + t] = 200
        frames.append(picture + rng.normal(0, 2, picture.shape))
    wild = range(20, 25) if "noise" in spoilt else range(20, 21)
    for t in wild:
        frames[t] = rng.normal(90, 60, frames[t].shape) if "noise" in spoilt else frames[t] * (100 if "hundred" in spoilt else 1000)
    results = track.track(frames, (29.5, 57.5, 13, 13)).results
    for t, result in enumerate(results):
        assert np.linalg.norm(result.position - (36 + t, 64)) < 0.3, t
        assert result.status == ("coasting" if t in wild else "tracking"), t
    assert all("nothing like" in results[t].reason for t in wild)
    deviation = [float(np.sqrt(result.covariance[0, 0, 0])) for result in results]
    assert deviation[wild[-1]] > 2 * deviation[19] and deviation[-1] < 1.1 * deviation[19]


def test_a_scene_that_stays_another_one_is_taken_as_it_is():
    """What lasts is no wild frame: the target that comes through a cut is found again."""
    rng = np.random.default_rng(1)
    scenes, frames = (textured(128, 160), textured(128, 160)[::-1, ::-1]), []
    for t in range(60):
        picture = scenes[int(t >= 20)].copy()
        picture[58:71, 30 + t : 43 + t] = 220
        frames.append(seen(picture, rng))
    found = track.track(frames, (29.5, 57.5, 13, 13))
    assert set(found.status[20:28]) == {"coasting"} and found.status[-1] == "tracking"
    assert np.linalg.norm(found.position[-1] - (36 + 59, 64)) < 1.0
