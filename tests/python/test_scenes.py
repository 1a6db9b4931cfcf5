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


def test_paths_that_are_integrated_have_a_longest_duration():
    """1e5 steps: 25000 frames of `turbulence`, which takes 4 steps a frame."""
    scene = scenes.Scene("turbulence", width=4, height=3)
    for call, name in (
        (lambda: scene.frame(1e9), "t"),
        (lambda: scene.frames(2, start=-1e9), "start"),
        (lambda: scene.frames(2, start=25000.0), "count"),
        (lambda: scene.truth(0.0, between=(0, 1e9)), "between"),
        (lambda: scene.displacement(1.0, 2.0, 0.0, 1e7), "duration"),
    ):
        with pytest.raises(ValueError, match=f"^{name}: expected .*times? in frames, within 25000 of 0, got "):
            call()
    assert np.isfinite(scene.displacement(1.0, 2.0, 1e9, 1000.0)).all()
    # The steps are shorter in faster waves.
    with pytest.raises(ValueError, match="^duration: expected a time in frames, within [0-9]+ of 0, got 20000"):
        scenes.Scene("waves", width=4, height=3, speed=8.0).displacement(1.0, 2.0, 0.0, 20000.0)
    # Closed forms hold for any time.
    assert np.isfinite(scenes.Scene("ramp", width=4, height=3).truth(0.0, between=(0, 1e9)).flow).all()


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
def test_times_and_places_that_are_not_finite_are_refused_by_name(waves, bad):
    for call, name in (
        (lambda: waves.frame(bad), "t"),
        (lambda: waves.frames(2, start=bad), "start"),
        (lambda: waves.truth(bad), "t"),
        (lambda: waves.truth(bad, between=(0, 1)), "t"),
        (lambda: waves.motion(bad, 0.0, 0.0), "x"),
        (lambda: waves.motion(0.0, bad, 0.0), "y"),
        (lambda: waves.motion(0.0, 0.0, bad), "t"),
        (lambda: waves.displacement(0.0, bad, 0.0), "y"),
        (lambda: waves.displacement(0.0, 0.0, bad), "t"),
        (lambda: waves.displacement(0.0, 0.0, 0.0, bad), "duration"),
    ):
        with pytest.raises(ValueError, match=f"^{name}: expected a .*finite|^{name}: expected a time in frames, within"):
            call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: scenes.Scene("affine").truth(0.0, between=(1,)), "between: expected two numbers up to 1.8e308, got (1,)"),
        (lambda: scenes.Scene("affine", origin=(1, 2, 3)), "origin: expected two numbers up to 1.8e308, got (1, 2, 3)"),
    ],
)
def test_pairs_of_another_length_are_refused_by_name(call, message):
    with pytest.raises(ValueError) as error:
        call()
    assert str(error.value) == message
