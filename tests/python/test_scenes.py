"""Truth of the scenes: velocity, and what frames some time apart can tell of it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from jacoflow import Status, scenes


@pytest.fixture(scope="module")
def waves():
    return scenes.Scene("waves", width=40, height=32, random_state=2, speed=4.0, wavelength=64.0, carrier="speckle", origin=(5.0, -3.0))


def test_truth_between_frames_is_the_displacement(waves):
    field = waves.truth(1.0, between=(0, 1))
    for row, column in ((0, 0), (31, 12), (20, 39)):
        there = waves.displacement(5.0 + column, -3.0 + row, 1.0)
        assert_array_equal(field.flow[row, column], there)
    forward, backward, both = (waves.truth(1.0, between=b).flow for b in ((0, 1), (-1, 0), (-1, 1)))
    assert_allclose(both, (forward + backward) / 2, atol=1e-12)
    # Paths are curved: the velocity is something else.
    assert np.abs(waves.truth(1.0).flow - forward).max() > 0.05


def test_the_jacobian_between_frames_is_the_derivative_of_the_flow(waves):
    field = waves.truth(0.5, between=(-0.5, 0.5))
    along_y, along_x = np.gradient(field.flow, axis=(0, 1))
    differences = np.stack([along_x, along_y], axis=-1)
    assert_allclose(field.jacobian[1:-1, 1:-1], differences[1:-1, 1:-1], atol=2e-3)
    assert np.abs(field.jacobian).max() > 0.1


def test_matter_keeps_its_brightness_along_the_truth(waves):
    frame = waves.frame(0.0)
    moved = waves.truth(0.0, between=(0, 1)).flow
    for row, column in ((3, 4), (16, 30)):
        u, v = moved[row, column]
        shifted = scenes.Scene("waves", width=1, height=1, random_state=2, speed=4.0, wavelength=64.0, carrier="speckle", origin=(5.0 + column + u, -3.0 + row + v))
        assert shifted.frame(1.0)[0, 0] == pytest.approx(frame[row, column], abs=1e-6)


def test_scenes_with_edges_mark_what_has_no_truth_between_frames():
    scene = scenes.Scene("disc", width=48, height=40)
    field = scene.truth(0.0, between=(0, 1))
    assert_array_equal(field.status, scene.truth(0.0).status)
    assert (field.status == Status.MASKED).any() and np.isfinite(field.flow[field.valid]).all()


@pytest.mark.parametrize("between", [(1.0, 1.0), (0.0, float("nan"))])
def test_times_between_must_differ(waves, between):
    with pytest.raises(ValueError, match="between: .*two different times"):
        waves.truth(0.0, between=between)
