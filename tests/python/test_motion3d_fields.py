"""The motion of what a flow field shows."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import jacoflow
from jacoflow import motion3d
from motion3d_support import scores


def textured_drive(height=96, width=128):
    """Two frames of a textured plane that comes nearer, f = 120 px."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:height, :width].astype(float)
    waves = [(rng.uniform(0.05, 0.45, 2), rng.uniform(0, 6.28), rng.uniform(4, 14)) for _ in range(40)]
    shade = lambda x, y: 128 + sum(a * np.sin(k[0] * x + k[1] * y + p) for k, p, a in waves)
    scale = 1.02
    middle_x, middle_y = width / 2, height / 2
    camera = np.array([[120.0, 0, middle_x], [0, 120, middle_y], [0, 0, 1]])
    return [shade(x, y), shade(middle_x + (x - middle_x) / scale, middle_y + (y - middle_y) / scale)], camera


def test_a_field_gives_the_motion_and_the_points():
    frames, camera = textured_drive()
    field = jacoflow.flow(*frames, method=jacoflow.Windowed(window_sigma=4.0))
    found, points = motion3d.estimate_field_motion(field, camera, robust=False)
    assert len(points) == len(found.inv_depth) >= 12
    assert np.diff(np.unique(points[:, 0])).min() >= max(8, 2 * field.correlation_length) - 1
    assert found.approach_rate == pytest.approx(-0.02, rel=0.15)
    with pytest.raises(ValueError, match="K: "):
        motion3d.estimate_field_motion(field, None)  # type: ignore[arg-type]
    coarse, fewer = motion3d.estimate_field_motion(field, camera, max_points=9)
    assert len(fewer) <= 9 and coarse.inv_depth.shape == (len(fewer),)
    _, inside = motion3d.estimate_field_motion(field, camera, region=(20, 10, 60, 50), spacing=8, robust=False)
    assert (inside >= [20, 10]).all() and (inside < [80, 60]).all() and len(inside) > 20
    _, few = motion3d.estimate_field_motion(field, camera, region=(20, 10, 60, 50), max_points=24, robust=False)
    assert 10 <= len(few) <= 24
    with pytest.raises(ValueError, match="^field"):
        motion3d.estimate_field_motion(jacoflow.estimate(np.stack([*frames, frames[1], frames[1]]), method="windowed"), camera)
    with pytest.raises(ValueError, match="^spacing"):
        motion3d.estimate_field_motion(field, camera, spacing=-1)


def test_a_field_has_a_map_of_times_to_contact():
    frames, camera = textured_drive()
    field = jacoflow.flow(*frames, method=jacoflow.Windowed(window_sigma=4.0))
    found, _ = motion3d.estimate_field_motion(field, camera, robust=False)
    contact, deviation, residual = motion3d.time_to_contact_map(field, found, camera)
    assert contact.shape == deviation.shape == residual.shape == field.shape
    assert_array_equal(np.isnan(contact), ~np.asarray(field.valid))
    y, x = np.mgrid[: field.shape[0], : field.shape[1]]
    away = np.isfinite(contact) & (np.hypot(x - 64, y - 48) > 20)
    assert np.median(contact[away]) == pytest.approx(1 / np.log(1.02), rel=0.05)
    assert np.mean(np.abs(1 / contact - np.log(1.02))[away] < 3 * (deviation / contact**2)[away]) > 0.9
    # A camera that only turns reaches nothing.
    still = dataclasses.replace(found, translation=np.full(3, np.nan))
    assert np.isinf(motion3d.time_to_contact_map(field, still, camera)[0][away]).all()
    with pytest.raises(ValueError, match="^field"):
        motion3d.time_to_contact_map(jacoflow.estimate(np.stack([*frames, frames[1], frames[1]]), method="windowed"), found, camera)
    with pytest.raises(ValueError, match="^placement"):
        motion3d.time_to_contact_map(field, found, camera, placement="end")


@pytest.mark.parametrize("common", [{"flow_scale_std": 0.5}, {"flow_bias_std": 0.5}])
@pytest.mark.parametrize("form", [{"robust": False}, {"patches": 48}])
def test_a_map_has_the_errors_that_all_flow_has_in_common(common, form):
    # Patches that fit into the smaller picture leave the direction uncertain by more than 15 degrees.
    frames, camera = textured_drive(192, 256) if "patches" in form else textured_drive()
    field = jacoflow.flow(*frames, method=jacoflow.Windowed(window_sigma=4.0))
    found, points = motion3d.estimate_field_motion(field, camera, **form, **common)
    without, _ = motion3d.estimate_field_motion(field, camera, **form, **dict.fromkeys(common, 0.0))
    if "flow_scale_std" in common:
        assert np.median(found.time_to_contact_std / without.time_to_contact_std) > 1.5
    else:
        assert found.direction_std > 1.5 * without.direction_std
    x, y = np.round(points).astype(int).T
    _, deviation, _ = motion3d.time_to_contact_map(field, found, camera)
    assert np.nanmedian(deviation[y, x] / found.time_to_contact_std) == pytest.approx(1, abs=0.3 if "patches" in form else 0.1)
    known = found.systematic_errors
    assert_allclose(np.linalg.eigvalsh(found.covariance - known.motion.T @ known.motion) > 0, True)
    (name, value), = common.items()
    if name == "flow_scale_std":
        assert known.scale == value
    else:
        assert_allclose(known.displacements, np.diag(value / np.diag(camera)[:2]), rtol=1e-12)


def test_options_that_a_field_does_not_have_are_refused_by_name():
    frames, camera = textured_drive()
    field = jacoflow.flow(*frames, method=jacoflow.Windowed(window_sigma=4.0))
    whole, _ = motion3d.estimate_field_motion(field, camera, robust=False)
    box = (20, 10, 60, 50)
    for wrong, words in (
        ({"noise_std": 0.1}, ["noise_std: ", "covariances of its own", "0.1"]),
        ({"cov": np.ones((3, 2, 2))}, ["cov: ", "covariances of its own"]),
        ({"jacobian": np.ones((3, 2, 2))}, ["jacobian: ", "patches"]),
        ({"projection": "sphere"}, ["projection: ", "sphere"]),
        ({"scene": whole}, ["scene: ", "region"]),
        ({"scene": whole, "region": box, "object_rotation_std": -1.0}, ["object_rotation_std: ", "positive"]),
        ({"object_rotation_std": np.nan}, ["object_rotation_std: ", "positive"]),
        ({"scene": whole, "region": box, "rotation_prior": (np.zeros(3), np.eye(3))}, ["rotation_prior: ", "scene"]),
        ({"scene": dataclasses.replace(whole, rotation=np.full(3, np.nan)), "region": box}, ["scene: ", "rotation is known"]),
        ({"patches": 7}, ["patches: ", "at least 8"]),
        ({"patches": 0}, ["patches: ", "positive"]),
        ({"patches": 32, "robust": True}, ["robust: ", "patch"]),
        ({"patches": 32, "scene": whole, "region": box}, ["scene: ", "patches"]),
        ({"patches": 32, "spacing": 8.0}, ["spacing: ", "patches"]),
        ({"patches": 32, "max_points": 8}, ["max_points: ", "patches"]),
        ({"patches": 32, "rotation_prior": (np.zeros(3), np.eye(3))}, ["rotation_prior: ", "six numbers"]),
    ):
        with pytest.raises(ValueError) as raised:
            motion3d.estimate_field_motion(field, camera, **wrong)
        assert str(raised.value).startswith(words[0]) and all(word in str(raised.value) for word in words), raised.value
    for wrong, word in (({"scene": 3, "region": box}, "scene"), ({"scene": 3}, "scene"), ({"roubst": True}, "roubst"), ({"patches": 3.5}, "patches"), ({"robust": "no"}, "robust")):
        with pytest.raises(TypeError, match=f"^{word}: "):
            motion3d.estimate_field_motion(field, camera, **wrong)


def test_the_rotation_of_a_scene_is_that_of_an_object_in_it():
    """As the prior that says the same by hand."""
    frames, camera = textured_drive()
    field = jacoflow.flow(*frames, method=jacoflow.Windowed(window_sigma=4.0))
    whole, _ = motion3d.estimate_field_motion(field, camera, robust=False)
    box = (20, 10, 60, 50)
    by_scene, _ = motion3d.estimate_field_motion(field, camera, region=box, scene=whole, object_rotation_std=0.002, robust=False)
    prior = (whole.rotation, whole.covariance[2:, 2:] + 0.002**2 * np.eye(3))
    by_hand, _ = motion3d.estimate_field_motion(field, camera, region=box, rotation_prior=prior, robust=False)
    alone, _ = motion3d.estimate_field_motion(field, camera, region=box, robust=False)
    assert_array_equal(by_scene.rotation, by_hand.rotation)
    assert_array_equal(by_scene.covariance, by_hand.covariance)
    assert by_scene.rotation_std[:2].max() < alone.rotation_std[:2].max()


CAMERA = np.array([[500.0, 0, 160], [0, 500, 120], [0, 0, 1]])


def two_views(seed, noise):
    """Two frames of a smooth textured scene, f = 500 px, 320 x 240 px, and the motion of the scene between
    them: exact, as points of the first view move to the second."""
    rng = np.random.default_rng(seed)
    u = np.array([0.6, 0.2, 0.75]) + 0.2 * rng.normal(size=3)
    u, w = u / np.linalg.norm(u), 0.002 * rng.normal(size=3)
    waves = [(rng.uniform(0.1, 0.6), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi), rng.uniform(4, 12)) for _ in range(60)]
    shade = lambda x, y: 128 + sum(a * np.sin(k * (np.cos(d) * x + np.sin(d) * y) + p) for k, d, p, a in waves)
    phase = rng.uniform(0, 2 * np.pi)
    y, x = np.mgrid[:240, :320].astype(float)

    def moved(x, y):
        nu = 0.006 * (1 + 0.4 * np.sin((x - 160) / 55 + phase) + 0.3 * np.cos((y - 120) / 70 - phase))
        points = np.stack([x, y], -1).reshape(-1, 2)
        return (points + motion3d.predict_flow(points, u, w, nu.ravel(), CAMERA, whole_frame=True)).T.reshape(2, *x.shape)

    # The second frame shows at each pixel what came there.
    from_x, from_y = x, y
    for _ in range(12):
        to_x, to_y = moved(from_x, from_y)
        from_x, from_y = from_x + x - to_x, from_y + y - to_y
    return [shade(x, y) + noise * rng.normal(size=x.shape), shade(from_x, from_y) + noise * rng.normal(size=x.shape)], u, w


def test_two_patches_of_a_field_determine_a_motion():
    frames, u, _ = two_views(3, 1.0)
    field = jacoflow.flow(*frames, method=jacoflow.CoarseToFine(preset="fast"))
    found, middles = motion3d.estimate_field_motion(field, CAMERA, patches=150)
    assert len(middles) == 2 and found.status == "few_points" and found.inv_depth.shape == (2,)
    assert_array_equal(middles, [[84.5, 119.5], [234.5, 119.5]])
    assert scores.angle(found.translation, u) < 2 * found.direction_std < 30
    one, _ = motion3d.estimate_field_motion(field, CAMERA, patches=100, region=(60, 60, 120, 120))
    assert one.status == "too_few_points" and np.isnan(one.translation).all()
    inside, middles = motion3d.estimate_field_motion(field, CAMERA, patches=40, region=(60, 60, 125, 85))
    assert len(middles) == 6 and ((middles > [60, 60]) & (middles < [185, 145])).all() and np.isfinite(inside.translation).all()
