"""Promises of the interface of 3-D motion: which method runs when, what a sideways motion has no answer to,
and that Python goes on meanwhile."""

import threading

import numpy as np
import pytest

from benchmarks.scenes import motion3d as scenes
from jacoflow import motion3d


@pytest.mark.parametrize(("n", "used"), [(29, "ml"), (30, "efficient")])
def test_auto_smooths_depths_from_thirty_points_on(n, used):
    make = scenes.differential("uniform", "oblique", n, 0.003, 2)
    run = lambda **options: motion3d.estimate_motion(make.points, make.flow, noise_std=0.003, placement="start", **options)
    found, named = run(), run(method=used)
    assert found.method_used == used and run(method="auto").method_used == used
    np.testing.assert_array_equal(found.translation, named.translation)
    np.testing.assert_array_equal(found.covariance, named.covariance)


def with_direction(u):
    """A result whose direction is `u` to the last digit."""
    make = scenes.differential("uniform", "lateral", 60, 1e-6, 1)
    found = motion3d.estimate_motion(make.points, make.flow, noise_std=1e-6, placement="start")
    return motion3d.MotionEstimate(**{**vars(found), "translation": np.array(u)})


@pytest.mark.parametrize(("u_z", "there"), [(0.0, False), (9e-10, False), (-9e-10, False), (1.1e-9, True), (-1.1e-9, True)])
def test_the_focus_is_nowhere_below_a_billionth(u_z, there):
    told = motion3d.focus_of_expansion(with_direction([1.0, 0.0, u_z]))
    assert (told is not None) == there
    if told is not None:
        assert told[0] == pytest.approx([1 / u_z, 0], rel=1e-9)


def test_a_motion_along_the_picture_never_arrives():
    """The same flow everywhere, from the motion that explains it exactly: `u_z = 0` to the last digit."""
    points = scenes.differential("uniform", "lateral", 200, 0.0, 3).points
    found = motion3d.estimate_motion(points, np.tile([0.25, 0.0], (200, 1)), noise_std=0.01, placement="start", initial=([1.0, 0.0, 0.0], [0.0, 0.0, 0.0]))
    assert found.status == "ok" and found.translation[2] == 0
    assert np.isposinf(motion3d.time_to_contact(found)).all() and np.isposinf(motion3d.time_to_contact_std(found)).all()
    assert motion3d.focus_of_expansion(found) is None


def test_python_goes_on_while_a_motion_is_estimated():
    """A thread that sleeps a thousandth of a second between counts goes on counting during a large estimate:
    with the interpreter locked it would wake once or twice, before and after."""
    make = scenes.differential("smooth", "oblique", 200_000, 0.1, 1)
    counts, done, begun = [0], threading.Event(), threading.Event()

    def count():
        begun.set()
        while not done.wait(1e-3):
            counts[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    begun.wait()
    before = counts[0]
    motion3d.estimate_motion(make.points, make.flow, noise_std=0.1, placement="start")
    within = counts[0] - before
    done.set()
    thread.join()
    assert within > 20, within
