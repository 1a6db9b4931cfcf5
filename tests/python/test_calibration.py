"""What `estimate` says by default, against exact truth: its errors lie within its deviations, and are smaller than the baselines'."""

import numpy as np
import pytest

import jacoflow
from jacoflow import scenes

MARGIN = 20
CASES = [("affine", "noise"), ("affine", "speckle"), ("affine", "particles"), ("vortex", "noise"), ("vortex", "particles"), ("plane", None)]


def camera_frames(scene, noise, seed):
    camera = scenes.Sensor(noise=noise, rounding="nearest", saturate=True, seed=seed)
    return [camera.apply_u8(scene.frame(t), index) for index, t in enumerate((-1.0, 0.0, 1.0))]


def inner(field, truth):
    inside = np.zeros(field.shape, bool)
    inside[MARGIN:-MARGIN, MARGIN:-MARGIN] = True
    return inside & field.valid & truth.valid


def flow_error(field, truth, known):
    return np.sqrt(np.mean(np.sum((field.flow - truth.flow)[known] ** 2, axis=-1)))


@pytest.mark.parametrize("noise", [0.0, 2.0])
@pytest.mark.parametrize(("name", "carrier"), CASES)
def test_errors_lie_within_their_deviations(name, carrier, noise):
    scene = scenes.Scene(name, width=112, height=96, seed=3, carrier=carrier)
    field, truth = jacoflow.estimate(camera_frames(scene, noise, 1)), scene.truth(0.0)
    known = inner(field, truth)
    assert known.sum() > 0.99 * (112 - 2 * MARGIN) * (96 - 2 * MARGIN)
    for parameter in (*field.parameters, "divergence", "curl"):
        error = (field.value(parameter) - truth.value(parameter))[known]
        deviation = field.std(parameter)[known]
        assert (np.abs(error) < 2 * deviation).mean() > 0.88, parameter


@pytest.mark.parametrize(("name", "carrier"), CASES)
def test_the_default_beats_the_baselines(name, carrier):
    scene = scenes.Scene(name, width=112, height=96, seed=3, carrier=carrier)
    frames, truth = camera_frames(scene, 1.0, 1), scene.truth(0.0)
    ours = jacoflow.estimate(frames)
    known = inner(ours, truth)
    for method in ("lucas_kanade", "horn_schunck"):
        other = jacoflow.estimate(frames, method=method)
        assert flow_error(ours, truth, known) < flow_error(other, truth, known & other.valid), method


@pytest.mark.parametrize("carrier", ["noise", "speckle", "particles"])
def test_the_flow_is_not_drawn_to_zero(carrier):
    """Slope of the estimate over the truth, on a vortex seen in 8 bits."""
    scene = scenes.Scene("vortex", width=112, height=96, seed=5, carrier=carrier)
    field, truth = jacoflow.estimate(camera_frames(scene, 1.0, 1)), scene.truth(0.0)
    known = inner(field, truth)
    slope = np.sum((field.flow * truth.flow)[known]) / np.sum(truth.flow[known] ** 2)
    assert abs(slope - 1) < 0.05
