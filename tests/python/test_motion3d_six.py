"""Six numbers a patch."""

import numpy as np
import pytest

from jacoflow import motion3d
from motion3d_support import scenes, scores, six


def test_six_numbers_a_patch():
    make, jacobian, covariance = scenes.patches("oblique", 60, 60, 0.05, 1, 0.3)
    found = motion3d.estimate_motion(make.points, make.flow, scenes.K, cov=covariance, jacobian=jacobian, placement="start")
    bound = motion3d.motion_bound(make.points, make.u, make.w, make.depths, scenes.K, cov=covariance, jacobian=True)
    flow = motion3d.motion_bound(make.points, make.u, make.w, make.depths[:, 0], scenes.K, cov=covariance[:, :2, :2])
    assert found.status == "ok" and scores.angle(found.translation, make.u) < 4 * bound.direction_std[0]
    assert bound.direction_std[0] < flow.direction_std[0]
    assert found.surface_slopes.shape == (60, 2) and found.inv_depth.shape == (60,)
    two = [0, 1]
    pair = motion3d.estimate_motion(make.points[two], make.flow[two], scenes.K, cov=covariance[two], jacobian=jacobian[two], placement="start")
    assert pair.status == "few_points"
    one = motion3d.estimate_motion(make.points[:1], make.flow[:1], scenes.K, cov=covariance[:1], jacobian=jacobian[:1])
    assert one.status == "too_few_points"


def test_two_exact_patches_are_enough():
    """Flow alone needs five points."""
    errors = []
    for seed in range(5):
        make, jacobian, covariance = scenes.patches("oblique", 2, 60, 1e-7, seed, 0.5)
        found = motion3d.estimate_motion(make.points, make.flow, scenes.K, cov=covariance, jacobian=jacobian, placement="start")
        nearest = min([found.translation, *(a.translation for a in found.alternatives)], key=lambda u: scores.angle(u, make.u))
        errors.append(scores.angle(nearest, make.u))
    assert np.median(errors) < 1e-2


@pytest.mark.parametrize("case", [1, 3])
def test_six_numbers_on_layouts_with_the_published_bounds(case):
    """Shrunk slants and flow alone within a fifth of the published figures; six numbers worse without
    shrinking where patches are small."""
    h, n, radius, noise_std, asked = six.SIX[case]
    like, _ = six.like_the_published(h, n, radius, noise_std, asked)
    row = six.six_row([scenes.patches("oblique", n, radius, noise_std, like[t % len(like)], h, t) for t in range(160)], asked)
    for name in ("CRLB flow", "CRLB six"):
        assert row[name] == pytest.approx(row[f"{name} asked"], rel=0.03), row
    for name in ("flow ML", "flow prior", "six ML", "six shrunk"):
        assert row[name] == pytest.approx(row[f"{name} asked"], rel=0.2), row
    if n == 200:
        assert row["six ML"] > 1.15 * row["six shrunk"], row


@pytest.mark.parametrize("common", [0.0, 0.05])
def test_rates_of_patches_are_as_sure_as_they_say(common):
    """With what the motion is off by, its rotation too, and with a displacement of all flow."""
    u, w = np.array([0.3, 0.2, -0.93]) / np.linalg.norm([0.3, 0.2, -0.93]), [0.01, -0.01, 0.005]
    held = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        pixels, depths = rng.uniform([0, 0], [320, 240], (20, 2)), rng.uniform(0.005, 0.02, 20)
        # Walls that face the camera.
        flow, right, below = (motion3d.predict_flow(pixels + step, u, w, depths, scenes.K) for step in np.array([[0, 0], [1e-3, 0], [0, 1e-3]]))
        jacobian = np.stack([right - flow, below - flow], axis=-1) / 1e-3 + 0.0006 * rng.normal(size=(20, 2, 2))
        flow = flow + 0.02 * rng.normal(size=(20, 2)) + common * rng.normal(size=2)
        cov = np.diag([0.02**2] * 2 + [0.0006**2] * 4) + np.zeros((20, 1, 1))
        found = motion3d.estimate_motion(pixels, flow, scenes.K, jacobian=jacobian, cov=cov, placement="start", method="ml", flow_bias_std=common)
        rate = -1 / found.time_to_contact
        held.append(np.abs(rate - depths * u[2]) < 1.96 * found.time_to_contact_std * rate**2)
    assert 0.91 < np.mean(held) < 0.98
