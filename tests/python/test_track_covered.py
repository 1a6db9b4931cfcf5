"""Small targets that go behind a bar: what is left of one at the bar's edge is not all of it, for every
shape, contrast and growth."""


import numpy as np
import pytest

from benchmarks.scenes.tracking import TIMES, Plane, Scene, figure, line
from benchmarks.scores import tracking as tracking_scores
from jacoflow import track

SIDE = 13.0


def behind_a_bar(seed, speed, shape="square", level=200.0, degrees=0.0, growth=0.0, kind="fractal:1,90,30", bar_level=40.0):
    """A target of 13 px that goes behind a bar of 20 px, growing by a share of its size a frame."""
    sides = SIDE * (1 + growth) ** TIMES
    path = line((60.0 if speed > 3 else 70.0, 128.0), (speed, 0.4))
    target = figure(path, np.stack([sides, sides], axis=1), level, angles=np.deg2rad(degrees) * TIMES, shape=shape)
    bar = figure(np.full((51, 2), (129.5, 127.5)), np.full((51, 2), (20.0, 256.0)), bar_level)
    return Scene("bar", (Plane(kind, seed),), target, others=(bar,))


def overlaps(scene):
    """(T - 1,), intersection over union with the truth."""
    found = track.track(scene.frames(), scene.start_box)
    return tracking_scores.overlap(np.asarray(found.box), scene.boxes)[1:]


@pytest.mark.parametrize(
    ("options", "seeds"),
    [({"speed": 3.5}, (0, 1, 14)), ({"speed": 2.4, "level": 150.0}, (1, 3)), ({"speed": 3.5, "shape": "disc"}, (0, 5)), ({"speed": 2.4, "degrees": 3.0}, (0, 7))],
    ids=["fast", "level 150", "disc", "turning"],
)
def test_a_small_target_comes_out_again_from_behind_a_bar(options, seeds):
    for seed in seeds:
        reached = overlaps(behind_a_bar(seed, **options))
        assert np.mean(reached > 0.5) >= 0.85 and reached[-8:].mean() >= 0.8, seed


@pytest.mark.parametrize("kind", ["fractal:1,90,30", "smooth:4,90,20"])
@pytest.mark.parametrize(
    ("level", "bar_level"), [(200.0, 40.0), (200.0, 90.0), (140.0, 220.0), (20.0, 90.0), (20.0, 250.0)]
)
def test_bars_and_targets_of_any_brightness(level, bar_level, kind):
    """Dark and bright targets behind bars that are darker, brighter, or as bright as the background: each of
    four backgrounds is gone through."""
    reached = [overlaps(behind_a_bar(seed, 2.4, level=level, kind=kind, bar_level=bar_level)) for seed in range(30, 34)]
    assert min(each[-8:].mean() for each in reached) >= 0.8
    assert np.mean([np.mean(each > 0.5) for each in reached]) >= 0.9 and min(np.mean(each > 0.5) for each in reached) >= 0.8


def test_the_rotation_of_a_disc_is_not_reported_while_it_is_covered_either():
    for seed in range(130, 134):
        scene = behind_a_bar(seed, 2.4, shape="disc")
        found = track.track(scene.frames(), scene.start_box)
        assert not found.rotation_observable[3:].any(), seed


@pytest.mark.parametrize("kind", ["fractal:1,90,30", "smooth:4,90,20"])
@pytest.mark.parametrize("seed", range(4))
def test_a_target_that_grows_comes_out_again_from_behind_a_bar(seed, kind):
    """By 1 % a frame, going in and behind it: the edge that covers it is not where it ends."""
    reached = overlaps(behind_a_bar(seed, 2.4, growth=0.01, kind=kind))
    assert np.mean(reached > 0.5) >= 0.65 and reached[-8:].mean() >= 0.7
