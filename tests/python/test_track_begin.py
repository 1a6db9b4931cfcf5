"""How the gradient tracker begins: boxes round what is no square, faint targets at rest, frames that show
nothing, and options and numbers that it does not take."""

import dataclasses

import numpy as np
import pytest
from test_track import follow, overlap, success

from benchmarks.scenes import tracking as tracking_scenes
from benchmarks.scenes.textures import background
from benchmarks.scenes.tracking import Plane, Scene, circle, disc, line, square
from benchmarks.scenes.tracking_begin import outlined
from jacoflow import track

KINDS = ("fractal:1,90,30", "smooth:4,90,20")


@pytest.mark.parametrize("speed", [0.1, 0.3, 1.0])
def test_a_faint_target_that_moves_is_not_taken_for_one_at_rest(speed):
    """What a slow one changes adds up."""
    for seed in range(2):
        path = np.stack([90 + speed * tracking_scenes.TIMES, np.full(51, 128.0)], axis=1)
        scene = Scene("faint", (Plane("flat:100", seed),), square(path, level=115.0))
        assert np.linalg.norm(follow(scene).position - path, axis=1).max() <= 1.0, seed


@pytest.mark.parametrize("level", [0, 128, 255])
@pytest.mark.parametrize("brightness", [20.0, 200.0])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_a_frame_that_shows_nothing_is_not_tracked_in_right_after_the_first(brightness, level, noise):
    scene = Scene("black", (Plane("smooth:4,90,20", 3),), square(circle(20.0), level=brightness))
    frames = scene.frames()
    for t in (1, 2):
        frames[t] = np.clip(np.rint(level + np.random.default_rng(t).normal(0, noise, frames[t].shape)), 0, 255)
    found = track.track(frames, scene.start_box)
    assert list(found.status[1:3]) == ["coasting", "coasting"] and "shows nothing" in found.reason[1]
    assert np.all(found.status[4:] == "tracking") and np.linalg.norm(found.position - scene.centres, axis=1)[4:].max() < 1.0


@pytest.mark.parametrize("value", [1e10, -1e18, 1e30, 1.7e308])
@pytest.mark.parametrize("white", [1.0, 255.0])
def test_numbers_that_are_no_brightness_do_no_harm_later(value, white):
    """A whole frame of them, or with them added, cannot be used; some pixels on the target are hidden; of
    either white of floats."""
    scene = tracking_scenes.simulation(1, "smooth:4,90,20", 20.0)
    frames = scene.frames() * (white / 255.0)
    x, y, w, h = scene.boxes[22].astype(int)
    frames[20] = value
    frames[21] += value
    frames[22, y : y + h, x : x + 5] = value
    found = track.track(frames, scene.start_box)
    assert set(found.status[20:22]) == {"coasting"} and set(found.reason[20:22]) == {"the frame cannot be used"}
    assert np.isfinite(found.position).all() and np.isfinite(found.covariance).all()
    assert np.all(found.status[26:] == "tracking") and np.linalg.norm(found.position - scene.centres, axis=1)[26:].max() < 3.0
    first = frames[0].copy()
    first[3, 4] = value
    assert track.GradientTracker(first, scene.start_box).result.status == "tracking"
    first[: len(first) * 3 // 5] = value
    with pytest.raises(ValueError, match="^frame: expected finite samples of at most 1e9 grey levels in half of the first frame"):
        track.GradientTracker(first, scene.start_box)


FRAME = np.full((64, 256), 90, np.uint8)


@pytest.mark.parametrize("switch", [True, np.True_])
def test_switches_are_no_numbers(switch):
    for arguments in ({"bbox": (20, 20, 13, switch)}, {"center": (20, switch)}):
        with pytest.raises(ValueError, match=f"^{next(iter(arguments))}: expected"):
            track.GradientTracker(FRAME, **arguments)
    with pytest.raises(TypeError, match="^alpha"):
        track.GaussMarkovFilter((0, 0), alpha=switch)


def test_points_may_be_anywhere_on_the_outer_pixels():
    """Pixels reach half a pixel beyond their centres."""
    for point in ((255.49, 10), (-0.5, 63.49), (0, -0.5)):
        assert track.GradientTracker(FRAME, center=point).result.status == "lost"
    for point in ((255.5, 10), (-0.51, 3), (3, 63.5), (np.nan, 3)):
        with pytest.raises(ValueError, match="^center"):
            track.GradientTracker(FRAME, center=point)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("outline", "side", "larger"), [("cross", 21.0, 1.3), ("diamond", 21.0, 1.2)])
def test_a_box_too_large_round_a_figure_that_does_not_fill_it_becomes_that_of_the_figure(outline, side, larger, kind):
    """Half of such a box or more is background: as long as that is missed, it is the box that is wrong, and
    nothing covers the target."""
    shares, near = [], []
    for seed in range(6):
        scene = outlined(outline, side, larger, kind, seed)
        found = follow(scene)
        shares.append(np.mean(found.status[1:] == "tracking"))
        near.append(np.mean(np.linalg.norm(found.position - scene.centres, axis=1) <= 4.0))
    assert np.mean(shares) >= 0.5 and np.mean(near) >= 0.85


@pytest.mark.parametrize("above", [10.0, 15.0, 20.0])
@pytest.mark.parametrize("kind", ["smooth:4,90,10", "smooth:4,90,20", "smooth:4,90,40"])
def test_a_faint_target_before_a_rough_background_is_followed_from_the_first_frame(kind, above):
    """Its speed is not known then, and the gradients from rest lead to the wrong side on some of these
    backgrounds."""
    for seed in (3, 8, 13):
        scene = Scene("faint", (Plane(kind, seed),), square(circle(20.0), level=90.0 + above))
        assert success(scene, follow(scene)) >= 0.9, seed


@pytest.mark.parametrize("larger", [1.2, 1.4])
def test_a_box_too_large_is_not_lost_before_rough_background(larger):
    """What the box holds besides the target says that nothing moved."""
    for seed in (3, 5, 7, 9):
        scene = stretched_about(larger, "smooth:2,128,40", seed)
        assert success(scene, follow(scene)) >= 0.85, seed


@pytest.mark.parametrize("speed", [0.8, 2.0])
def test_background_in_the_box_does_not_move_the_position_while_it_is_hidden_on_one_side(speed):
    """Behind a moving disc the background of the corners of its box is seen last; there they counted as
    target, and the position was 1.3 px off, 14 standard deviations."""
    for seed in range(2):
        path = line((70.0, 128.0), (speed, 0.0))
        scene = Scene("disc", (Plane("smooth:4,110,25", seed),), disc(path, np.full(51, 14.0), level=170.0))
        found = follow(scene)
        errors = np.abs(found.position - scene.centres)[4:]
        assert np.all(found.status == "tracking"), seed
        assert errors.max() <= 0.6 and np.max(errors / np.sqrt(found.covariance[4:, :, 0, 0])) <= 4.0, seed


def stretched_about(larger, kind, seed):
    """Simulation 1 begun with a box so many times as large as the target, about its centre."""
    scene = tracking_scenes.simulation(1, kind, 24.0 if seed % 2 else 12.0, seed=seed)
    x, y, w, h = scene.start_box
    return dataclasses.replace(scene, start=(x + w * (1 - larger) / 2, y + h * (1 - larger) / 2, w * larger, h * larger))
