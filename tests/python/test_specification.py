"""The figures of WO2010/098160 and of its independent reference, through the public interface."""

import filterpy.kalman
import numpy as np
import pytest
from numpy.testing import assert_allclose

from grouped_options import grouped
import jacoflow
from jacoflow import scenes

X, Y, OMEGA = 60, 80, np.pi / 100
TRUTH = np.array([-OMEGA * Y, OMEGA * X, 0, OMEGA, -OMEGA, 0])
MARGIN = 16
"""Pixels around the watched one: more than the smoother reaches."""
NAMES = ("u", "v", "u_x", "v_x", "u_y", "v_y")

# Jets and motions with generic numbers for whatever is not zero: theorem 1's table.
H, H1, NONE = [0.3, 0.1, 0.2], [0.3, -0.15, 0.075], [0.0, 0.0, 0.0]
G, FLAT = [1.0, 2.0], [0.0, 0.0]
FLOW, REST = [0.7, -0.4], [0.0, 0.0]
M, ALPHA, TURN, STILL = [0.02, 0.03, -0.01, 0.05], [0.02, 0, 0, 0.02], [0, 0.03, -0.03, 0], [0.0] * 4


@pytest.mark.parametrize(
    ("gradient", "hessian", "flow", "jacobian", "single", "both"),
    [
        pytest.param(G, H, FLOW, M, 5, 6, id="generic"),
        pytest.param(G, H, FLOW, STILL, 5, 6, id="regular Hessian, flow, M = 0"),
        pytest.param(G, H, REST, M, 5, 6, id="regular Hessian, no flow, M generic"),
        pytest.param(FLAT, H, REST, M, 5, 6, id="regular Hessian, no flow, M generic, flat"),
        pytest.param(G, H, REST, ALPHA, 5, 6, id="regular Hessian, no flow, expansion, gradient"),
        pytest.param(FLAT, H, REST, ALPHA, 5, 5, id="regular Hessian, no flow, expansion, flat"),
        pytest.param(G, H, REST, STILL, 5, 5, id="regular Hessian, no motion"),
        pytest.param(FLAT, H, REST, STILL, 5, 5, id="regular Hessian, no motion, flat"),
        pytest.param(G, NONE, FLOW, TURN, 3, 6, id="no Hessian, rotation"),
        pytest.param(G, NONE, FLOW, M, 3, 6, id="no Hessian, M generic"),
        pytest.param(G, NONE, FLOW, ALPHA, 3, 3, id="no Hessian, expansion"),
        pytest.param(G, NONE, FLOW, STILL, 3, 3, id="no Hessian, M = 0"),
        pytest.param(G, H1, FLOW, M, 5, 6, id="Hessian of rank 1, generic"),
        pytest.param(FLAT, H1, FLOW, STILL, 3, 3, id="Hessian of rank 1, flat, M = 0"),
    ],
)
def test_ranks_of_theorem_1(gradient, hessian, flow, jacobian, single, both):
    found = jacoflow.classify([128.0, *gradient, *hessian], [*flow, *jacobian])
    assert (found.rank_single, found.rank) == (single, both)


def ramp(count, start=0.0):
    """Frames of the turning ramp (45) around the watched pixel, which lies at [MARGIN, MARGIN]."""
    side = 2 * MARGIN + 1
    return scenes.Scene("ramp", width=side, height=side, origin=(X - MARGIN, Y - MARGIN)).frames(count, start)


def measured(count):
    """As the patent's experiment has them: rounded down, smoothed by sigma 3."""
    return np.stack([jacoflow.smooth(jacoflow.quantise(frame), 3.0) for frame in ramp(count)])


@pytest.fixture(scope="module")
def sequence():
    return measured(400)


def watched(field):
    return np.stack([np.asarray(field.value(name))[..., 0] for name in NAMES], axis=-1)


def test_the_scene_is_the_patents():
    scene = scenes.Scene("ramp", width=100, height=100)
    t = 17.0
    assert_allclose(scene.frame(t)[80, 60], 0.2 * (60 * np.cos(OMEGA * t) + 80 * np.sin(OMEGA * t)) + 128, rtol=1e-12)
    assert_allclose(scene.motion(60, 80, t), TRUTH, atol=1e-12)
    assert_allclose([TRUTH[0], TRUTH[1]], [-2.513274, 1.884956], atol=1e-6)
    # A quarter turn takes (60, 80) to (-80, 60), not along the velocity.
    assert_allclose(scene.displacement(60, 80, t, 50), (-140, -20), atol=1e-9)


@pytest.mark.parametrize("start", [0.0, 37.0, 250.0])
def test_clean_backward_differences(start):
    field = jacoflow.estimate(ramp(12, start), method=jacoflow.Instantaneous(time_scheme="backward"), grid=jacoflow.SamplingGrid(points=[[MARGIN, MARGIN]]), ends="drop")
    expected = [-2.542467, 1.845170, -4.934396e-4, 3.1410759e-2, -3.1410759e-2, -4.934396e-4]
    assert_allclose(watched(field), np.tile(expected, (10, 1)), atol=1e-6)


def test_clean_central_differences():
    field = jacoflow.estimate(ramp(3), method="instantaneous", grid=jacoflow.SamplingGrid(points=[[MARGIN, MARGIN]]), ends="drop")
    assert field.frame_index == 1
    assert_allclose(watched(field), TRUTH[None], atol=5e-4)


def test_instantaneous_estimate_of_measured_frames_is_useless(sequence):
    """The patent's figure 3."""
    field = jacoflow.estimate(sequence, method=jacoflow.Instantaneous(time_scheme="backward"), grid=jacoflow.SamplingGrid(points=[[MARGIN, MARGIN]]), ends="drop")
    error = np.linalg.norm(watched(field)[:, :2] - TRUTH[:2], axis=1)
    assert 1.5 < np.nanmedian(error) < 4
    assert (error < 0.25).sum() < 0.15 * 400


def filtered(frames, **options):
    flow_filter = jacoflow.FlowFilter(**grouped(points=[[MARGIN, MARGIN]], **options))
    fields = [flow_filter.push(frame) for frame in frames]
    assert flow_filter.repairs == 0
    return np.stack([watched(field) for field in fields])


def settled(motion):
    """The frame after which both flow errors stay below 0.25."""
    bad = (np.abs(motion[:, :2] - TRUTH[:2]) >= 0.25).any(axis=1)
    return int(np.flatnonzero(bad)[-1])


@pytest.fixture(scope="module")
def augmented(sequence):
    return filtered(sequence)


def test_augmented_filter_settles_and_follows(augmented):
    assert 60 <= settled(augmented) <= 130
    error = augmented[200:] - TRUTH
    rms = np.sqrt((error**2).mean(axis=0))
    assert rms[0] <= 0.045 and rms[1] <= 0.065
    assert rms[3] <= 0.06 and rms[4] <= 0.06
    bias = error.mean(axis=0)
    assert 0.07 <= bias[2] <= 0.11 and 0.07 <= bias[5] <= 0.11


def test_augmented_filter_is_better_than_the_non_augmented_one(sequence, augmented):
    other = filtered(sequence, form="non_augmented")
    rms = [np.sqrt(((motion[200:, :2] - TRUTH[:2]) ** 2).mean(axis=0)) for motion in (augmented, other)]
    assert (rms[0] < rms[1]).all()
    assert_allclose(rms[1], [0.063, 0.079], rtol=0.25)


def test_first_states_of_the_augmented_filter(sequence):
    flow_filter = jacoflow.FlowFilter(grid=jacoflow.SamplingGrid(points=[[MARGIN, MARGIN]]))
    flow_filter.push(sequence[0])
    state = flow_filter.state[0]
    assert_allclose(state[:3], [139.52981, 0.20018528, 0], atol=1e-5)
    assert_allclose(state[6:], 0, atol=1e-9)
    field = flow_filter.push(sequence[1])
    assert abs(field.u[0] + 0.3596) < 0.002
    assert abs(field.v_y[0] - 0.0788) < 0.001


def test_larger_neighbourhood_cures_the_bias():
    raw = [jacoflow.quantise(frame) for frame in ramp(400)]
    error = filtered(raw, profile="measured")[200:] - TRUTH
    rms = np.sqrt((error**2).mean(axis=0))
    assert rms[0] < 0.02 and rms[1] < 0.045 and (rms[2:] < 0.004).all()


def rate(q):
    """q' of (11) with the signs that (4) and (21) require, along the last axis."""
    _, ix, iy, ixx, ixy, iyy, u, v, u_x, v_x, u_y, v_y = q.T
    rates = np.zeros_like(q)
    # One by one: `np.stack` takes longer than all of this, and filterpy calls it for every sigma point.
    rates[..., 0] = -(ix * u + iy * v)
    rates[..., 1] = -(ixx * u + ixy * v + ix * u_x + iy * v_x)
    rates[..., 2] = -(ixy * u + iyy * v + ix * u_y + iy * v_y)
    rates[..., 3] = -(2 * ixx * u_x + 2 * ixy * v_x)
    rates[..., 4] = -(ixx * u_y + ixy * (u_x + v_y) + iyy * v_x)
    rates[..., 5] = -(2 * ixy * u_y + 2 * iyy * v_y)
    return rates


def runge_kutta(q, dt):
    k1 = rate(q)
    k2 = rate(q + 0.5 * dt * k1)
    k3 = rate(q + 0.5 * dt * k2)
    k4 = rate(q + dt * k3)
    return q + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


OFFSETS = [(ex, ey) for ey in (-1, 0, 1) for ex in (-1, 0, 1)]
B = np.array([[1, ex, ey, ex * ex / 2, ex * ey, ey * ey / 2] + [0] * 6 for ex, ey in OFFSETS], dtype=float)


def brightness(q):
    return q @ B.T


Q = np.diag([1e-1, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-1, 1e-1, 1e-3, 1e-3, 1e-3, 1e-3])


def test_non_augmented_filter_equals_filterpy_for_400_frames(sequence):
    """Same sigma points, redrawn after the prediction: the dense filter, and the generic one beside it."""
    sigma = filterpy.kalman.MerweScaledSigmaPoints(12, 1.0, 2.0, 0.0)
    reference = filterpy.kalman.UnscentedKalmanFilter(12, 9, 1.0, brightness, runge_kutta, sigma)
    generic = jacoflow.filters.UnscentedKalmanFilter(
        12, 9, 1.0, brightness, runge_kutta, jacoflow.filters.MerweScaledSigmaPoints(12, 1.0, 2.0, 0.0)
    )
    for each in (reference, generic):
        each.Q, each.R = Q, 1e-3 * np.eye(9)
    dense = jacoflow.FlowFilter(grid=jacoflow.SamplingGrid(points=[[MARGIN, MARGIN]]), profile=jacoflow.FilterProfile(form="non_augmented"))
    for frame in sequence:
        z = frame[MARGIN - 1 : MARGIN + 2, MARGIN - 1 : MARGIN + 2].ravel()
        reference.predict()
        reference.sigmas_f = sigma.sigma_points(reference.x, reference.P)
        reference.update(z)
        generic.predict()
        generic.update(z)
        dense.push(frame)
        scale = np.abs(reference.x).max()
        assert_allclose(dense.state[0], reference.x, rtol=1e-6, atol=1e-6)
        assert_allclose(generic.x, reference.x, rtol=1e-6, atol=1e-9 * scale)
    assert_allclose(dense.state_covariance[0], reference.P, rtol=1e-5, atol=1e-8)
    assert_allclose(generic.P, reference.P, rtol=1e-5, atol=1e-8)
