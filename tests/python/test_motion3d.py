"""Rigid 3-D motion: published values, agreement with a plain reference, conventions, statuses, errors."""

import dataclasses
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import jacoflow
from jacoflow import motion3d

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import motion3d_claims as claims
import motion3d_coverage as coverage
import motion3d_fixed as fixed
import motion3d_honesty as honesty
import motion3d_rivals as rivals
import motion3d_scenes as scenes
import motion3d_scores as scores
import motion3d_six as six

U, W = scenes.motion("oblique")


def scene(n=300, sigma=0.01, seed=0, depth="uniform", name="oblique"):
    return scenes.differential(depth, name, n, sigma, seed)


def start(make, **options):
    return motion3d.estimate_motion(make.points, make.flow, **{"sigma": make.sigma, "placement": "start", **options})


def test_published_values():
    flow = motion3d.predict_flow([[0.2, -0.1]], U, W, [0.8])
    assert_allclose(flow, [[0.337146, 0.206645]], atol=5e-7)
    around = motion3d.predict_flow([[0.48, -0.6, 0.64]], U, W, [0.8], projection="sphere")
    assert_allclose(around, [[0.222428, 0.472128, 0.275799]], atol=5e-7)
    for row in fixed.fixed_values():
        # Published to four digits, and to five in front of a 1.
        assert row["got"] == pytest.approx(row["asked"], rel=5e-4), row


def test_the_bound_is_that_of_a_plain_computation():
    """M and P written out from (18)."""
    make = scene(60)
    g, r = scenes.rows(make.points)
    t = g @ U
    s = np.linalg.norm(t, axis=1)
    p = np.stack([t[:, 1], -t[:, 0]], 1) / s[:, None]
    bound = motion3d.motion_bound(make.points, U, W, make.depths, sigma=0.1)
    along = np.einsum("ni,nij,aj->na", p, g, bound.tangent)
    d = np.concatenate([make.depths[:, None] * along, np.einsum("ni,nij->nj", p, r)], 1)
    m, noise = d.T @ d, np.zeros((5, 5))
    noise[:2, :2] = (along / s[:, None] ** 2).T @ along
    inverse = np.linalg.inv(m)
    assert_allclose(bound.crlb, 0.01 * inverse, rtol=1e-9)
    assert_allclose(bound.ml_covariance, 0.01 * inverse + 1e-4 * inverse @ noise @ inverse, rtol=1e-9)
    ideal = np.zeros((5, 5))
    ideal[:2, :2] = ((np.einsum("ni,ij,nj->n", d, inverse, d) / s**2)[:, None] * along).T @ along
    assert_allclose(bound.ideal_covariance, 0.01 * inverse + 1e-4 * inverse @ ideal @ inverse, rtol=1e-9)
    assert_allclose(bound.direction_std[0], np.degrees(np.sqrt(np.trace(bound.crlb[:2, :2]))))


@pytest.mark.parametrize("case", range(6))
def test_theory_is_met(case, monkeypatch):
    """ML follows (17) and not the bound: rms and both predictions within a fifth of the published, distances under each."""
    monkeypatch.setattr(scores, "THEORY", scores.THEORY[case : case + 1])
    row = scores.theory(200)[0]
    for name in ("ML rms", "(17)", "CRLB"):
        assert row[name] == pytest.approx(row[f"{name} asked"], rel=0.2), row
    for name in ("m(17)", "m(CRLB)"):
        assert row[name] == pytest.approx(row[f"{name} asked"], rel=0.25), row
    assert row["m(CRLB)"] > row["m(17)"]


def test_section_five_is_met():
    for row in scores.one_unknown(3000):
        for name in ("ML / (29)", "ones / (31)", "shrunk / its formula"):
            if row["n"] == 1000:
                assert row[name] == pytest.approx(1, abs=0.08), row
            elif name == "ML / (29)":
                assert 1.1 < row[name] < 1.5, row


@pytest.mark.parametrize("case", [2, 3, 5, 6, 7, 8])
def test_smoothed_weights_are_worth_their_while(case):
    """1.3 times below maximum likelihood on the same noise, within a fifth of the published figure, and honest."""
    depth, name, n, sigma, h, asked = scores.PRACTICAL[case]
    errors, plain, inside = [], [], []
    for seed in range(150):
        make = scenes.differential(depth, name, n, sigma, seed, h)
        found = start(make)
        errors.append(scores.angle(found.translation, make.u))
        plain.append(scores.angle(found.ml.translation, make.u))
        inside.append(scores.squared(scores.error(make, found.translation, found.rotation, found.tangent), found.covariance) < 11.070)
    assert scores.rms(plain) > 1.3 * scores.rms(errors)
    assert scores.rms(errors) == pytest.approx(asked[2], rel=0.2)
    assert 0.88 <= np.mean(inside) <= 0.97


@pytest.mark.parametrize("case", [7, 8])
def test_maximum_likelihood_over_noisy_ground(case):
    """By name: direction and rotation within a fifth of the published figures, far above the bound that the depths' noise keeps it from; it tells so of itself, with the epipole beside the points and among them."""
    depth, name, n, sigma, h, asked = scores.PRACTICAL[case]
    errors, turns, bounds, inside = [], [], [], []
    for seed in range(150):
        make = scenes.differential(depth, name, n, sigma, seed, h)
        found = start(make, method="ml")
        assert found.method_used == "ml"
        errors.append(scores.angle(found.translation, make.u))
        turns.append(1e3 * np.linalg.norm(found.rotation - make.w))
        bounds.append(motion3d.motion_bound(make.points, make.u, make.w, make.depths, sigma=sigma).direction_std[0])
        inside.append(scores.squared(scores.error(make, found.translation, found.rotation, found.tangent), found.covariance) < 11.070)
    assert scores.rms(errors) == pytest.approx(asked[0], rel=0.2)
    assert scores.rms(turns) == pytest.approx(asked[7], rel=0.2)
    assert scores.rms(errors) > 1.5 * scores.rms(bounds)
    assert 0.88 <= np.mean(inside) <= 0.98


@pytest.mark.parametrize("case", range(11))
def test_two_views_in_pixels_beat_opencv(case, monkeypatch):
    """Never more than 5 % worse than any of OpenCV's, and three times better with 40 % outliers; right labels."""
    monkeypatch.setattr(scores, "PIXELS", scores.PIXELS[case : case + 1])
    row = scores.pixels(40)[0]
    ours, asked = (float(str(row[name]).split(" / ")[1]) for name in ("efficient", "efficient asked"))
    # The published errors of ground seen obliquely lie below their bound: a test of its own.
    assert ours < (1.45 if case == 5 else 1.2) * asked, row
    if case >= 7:
        assert row["right labels %"] > (98.5 if case == 9 else 99), row
    if rivals.cv2 is not None:
        for name in rivals.METHODS:
            theirs = float(str(row[name]).split(" / ")[1])
            assert ours <= theirs / 3 if "40%" in str(row["case"]) else ours <= 1.05 * theirs + 0.005, row


def test_two_views_in_pixels_make_an_essential_matrix():
    make = scenes.two_views("uniform", "oblique", 0.0, 4, 3)
    found = motion3d.estimate_motion(make.points, make.flow, scenes.K)
    eta = np.column_stack([make.points, np.ones(1000)]) @ np.linalg.inv(scenes.K).T
    after = np.column_stack([make.points + make.flow, np.ones(1000)]) @ np.linalg.inv(scenes.K).T
    essential = motion3d.essential_matrix(found)
    assert np.abs(np.einsum("ni,ij,nj->n", after, essential, eta)).max() < 2e-5
    turn, mean = scenes.exponential(make.w)
    shift = mean @ make.u
    cross = np.array([[0, -shift[2], shift[1]], [shift[2], 0, -shift[0]], [-shift[1], shift[0], 0]])
    assert_allclose(essential, cross @ turn, atol=2e-3)


def test_intrinsics_with_skew_change_nothing_but_the_unit():
    make = scene(200, 0.002)
    camera = np.array([[500.0, 7.0, 310.0], [0.0, 420.0, 255.0], [0.0, 0.0, 1.0]])
    pixels = np.column_stack([make.points, np.ones(200)]) @ camera.T
    flow = make.flow @ camera[:2, :2].T
    covariance = np.broadcast_to(make.sigma**2 * camera[:2, :2] @ camera[:2, :2].T, (200, 2, 2))
    there = motion3d.estimate_motion(pixels[:, :2], flow, camera, cov=covariance, placement="start")
    here = start(make)
    assert_allclose(there.translation, here.translation, atol=1e-9)
    assert_allclose(there.covariance, here.covariance, rtol=1e-6, atol=1e-14)
    assert_allclose(there.inv_depth, here.inv_depth, rtol=1e-6)


def test_covariances_are_worth_their_while():
    """Aperture-like noise: deviations of 0.2 and 0.04 along random axes."""
    errors = {"one sigma": [], "covariances": []}
    for seed in range(12):
        rng = np.random.default_rng(seed)
        make = scene(500, 0.0, seed, "smooth")
        angle = rng.uniform(0, np.pi, 500)
        axes = np.stack([np.stack([np.cos(angle), -np.sin(angle)], -1), np.stack([np.sin(angle), np.cos(angle)], -1)], 1)
        noise = np.einsum("nij,nj->ni", axes, rng.normal(size=(500, 2)) * [0.2, 0.04])
        covariance = np.einsum("nij,j,nkj->nik", axes, np.array([0.2, 0.04]) ** 2, axes)
        flow = make.flow + noise
        errors["one sigma"].append(scores.angle(motion3d.estimate_motion(make.points, flow, placement="start").translation, U))
        errors["covariances"].append(scores.angle(motion3d.estimate_motion(make.points, flow, cov=covariance, placement="start").translation, U))
    assert scores.rms(errors["covariances"]) < 0.6 * scores.rms(errors["one sigma"])


def test_unknown_noise_is_estimated():
    make = scenes.two_views("uniform", "oblique", 0.3, 4, 5, outliers=0.4)
    found = motion3d.estimate_motion(make.points, make.flow, scenes.K, robust=True)
    assert found.sigma == pytest.approx(0.3, rel=0.15)
    assert np.mean(found.inliers == make.inliers) > 0.97
    assert motion3d.estimate_motion(make.points[make.inliers], make.flow[make.inliers], scenes.K).sigma == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize("robust", [False, True])
def test_arrays_of_any_kind(robust):
    make = scene(200, 0.01, 3)
    usual = start(make, robust=robust)
    wide = np.full((400, 4), np.nan)
    wide[::2, ::2] = make.points
    strided = motion3d.estimate_motion(wide[::2, ::2], np.asfortranarray(make.flow), sigma=0.01, placement="start", robust=robust)
    assert_array_equal(strided.translation, usual.translation)
    lists = motion3d.estimate_motion(make.points.tolist(), make.flow.tolist(), sigma=0.01, placement="start", robust=robust)
    assert_array_equal(lists.inv_depth, usual.inv_depth)
    single = motion3d.estimate_motion(make.points.astype("f4"), make.flow.astype("f4"), sigma=0.01, placement="start", robust=robust)
    assert_allclose(single.translation, usual.translation, atol=1e-3)
    again = start(make, robust=robust, threads=1)
    assert_array_equal(again.covariance, start(make, robust=robust, threads=3).covariance)
    assert_array_equal(make.points, scene(200, 0.01, 3).points)


def test_results_pickle_and_tell_the_camera():
    found = start(scene())
    copy = pickle.loads(pickle.dumps(found))
    assert_array_equal(copy.inv_depth, found.inv_depth)
    assert copy.status == found.status == "ok" and found.method_used == "efficient" and not found.fell_back
    assert_array_equal(found.camera_translation, -found.translation)
    assert found.direction_std == pytest.approx(np.degrees(np.sqrt(np.trace(found.covariance[:2, :2]))))
    assert_allclose(found.tangent @ found.translation, 0, atol=1e-12)
    assert start(scene(20)).method_used == "ml"


def test_time_to_contact_and_focus():
    make = scene(800, 0.003, 2, "smooth", "forward")
    turned = start(scenes.Scene(make.points, make.flow, make.depths, make.u, make.w, make.sigma))
    truth = -1 / (make.depths * make.u[2])
    contact, deviation = motion3d.time_to_contact(turned), motion3d.time_to_contact_std(turned)
    assert np.median(np.abs(contact - truth) / deviation) < 1.2
    assert np.mean(np.abs(contact - truth) < 3 * deviation) > 0.9
    focus, covariance = motion3d.focus_of_expansion(turned)
    off = focus - make.u[:2] / make.u[2]
    assert off @ np.linalg.solve(covariance, off) < 20
    camera = np.array([[500.0, 0, 320], [0, 400, 240], [0, 0, 1]])
    there, spread = motion3d.focus_of_expansion(turned, camera)
    assert_allclose(there, [500 * focus[0] + 320, 400 * focus[1] + 240])
    assert_allclose(spread, covariance * np.outer([500, 400], [500, 400]))
    mean = -1 / turned.approach_rate
    assert mean == pytest.approx(-1 / np.average(make.depths * make.u[2]), rel=0.2)


def test_depths_of_any_unit_leave_the_time_to_contact_alone():
    make = scene(400, 0.01, 2, "smooth", "forward")
    usual, scaled = (start(make, weight_inv_depth=factor * make.depths) for factor in (1, 50))
    assert_allclose(scaled.translation, usual.translation, atol=1e-9)
    assert_allclose(scaled.time_to_contact, usual.time_to_contact, rtol=1e-6)
    assert_allclose(scaled.time_to_contact_std, usual.time_to_contact_std, rtol=1e-4)


def test_the_focus_is_nowhere_in_sideways_motion():
    found = start(scene(sigma=1e-7, name="lateral"), method="ml")
    sideways = motion3d.MotionEstimate(**{**vars(found), "translation": np.array([1.0, 0.0, 0.0])})
    assert motion3d.focus_of_expansion(sideways) is None


def test_degenerate_scenes_have_their_status():
    make = scene()
    few = motion3d.estimate_motion(make.points[:4], make.flow[:4])
    assert few.status == "too_few_points" and np.isnan(few.translation).all() and few.inv_depth.shape == (4,)
    assert motion3d.estimate_motion(np.empty((0, 2)), np.empty((0, 2))).status == "too_few_points"
    rng = np.random.default_rng(0)
    _, r = scenes.rows(make.points)
    turning = motion3d.estimate_motion(make.points, r @ W + rng.normal(0, 0.01, (300, 2)), sigma=0.01, placement="start")
    assert turning.status == "rotation_only" and np.isnan(turning.translation).all()
    assert_array_equal(turning.inv_depth, 0)
    assert np.isinf(turning.time_to_contact).all()
    assert_allclose(turning.rotation, W, atol=4 * turning.rotation_std.max())
    plane = 0.9 + 0.3 * make.points[:, 0] - 0.2 * make.points[:, 1]
    g, _ = scenes.rows(make.points)
    flat = motion3d.estimate_motion(make.points, plane[:, None] * (g @ U) + r @ W + rng.normal(0, 0.005, (300, 2)), sigma=0.005, placement="start")
    assert flat.status == "ambiguous" and len(flat.alternatives) >= 1
    both = [flat.translation, flat.alternatives[0].translation]
    normal = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
    for truth in (U, normal):
        assert min(scores.angle(u, truth) for u in both) < 4


def test_the_sphere_is_a_screen_like_the_plane():
    """Outliers, rows that are not finite, rotations alone and the two motions of a plane."""
    rng = np.random.default_rng(0)
    make = scenes.sphere("oblique", 500, 0.1, 3)
    along = lambda values, eta: values - (values * eta).sum(1, keepdims=True) * eta
    outliers = rng.uniform(size=500) < 0.3
    flow = np.where(outliers[:, None], along(rng.uniform(-4, 4, (500, 3)), make.points), make.flow)
    flow[7] = np.nan
    found = motion3d.estimate_motion(make.points, flow, sigma=0.1, projection="sphere", robust=True)
    assert found.status == "ok" and scores.angle(found.translation, U) < 4 * found.direction_std < 8
    assert np.mean(found.inliers == ~outliers) > 0.97 and np.isnan(found.inv_depth[7])
    eta = make.points[make.points[:, 2] > 0.75]
    noise = along(0.003 * rng.normal(size=eta.shape), eta)
    turning = np.cross(eta, np.cross(np.cross(W, eta), eta))
    still = motion3d.estimate_motion(eta, turning + noise, sigma=0.003, projection="sphere")
    assert still.status == "rotation_only" and scores.angle(still.rotation, W) < 5
    normal = np.array([0.3, -0.2, 0.9])
    plane = turning + np.cross(eta, (eta @ normal)[:, None] * np.cross(U, eta)) + noise
    flat = motion3d.estimate_motion(eta, plane, sigma=0.003, projection="sphere")
    both = [flat.translation, *(other.translation for other in flat.alternatives)]
    assert flat.status == "ambiguous"
    for truth in (U, normal):
        assert min(scores.angle(u, truth) for u in both) < 5


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


MISTAKES = [
    ({"points": np.zeros((5, 3))}, "points"),
    ({"flow": np.zeros((4, 2))}, "flow"),
    ({"K": np.eye(2)}, "K"),
    ({"K": np.zeros((3, 3))}, "K"),
    ({"sigma": 0.0}, "sigma"),
    ({"sigma": -1.0}, "sigma"),
    ({"sigma": 1e-300}, "sigma"),
    ({"sigma": 1e300}, "sigma"),
    ({"cov": np.ones((5, 2))}, "cov"),
    ({"sigma": 1.0, "cov": np.ones((5, 2, 2))}, "cov"),
    ({"method": "best"}, "method"),
    ({"placement": "end"}, "placement"),
    ({"projection": "cube"}, "projection"),
    ({"smoother": "spline"}, "smoother"),
    ({"seed": -1}, "seed"),
    ({"threads": 0}, "threads"),
    ({"weight_inv_depth": np.ones(3)}, "weight_inv_depth"),
    ({"initial": (np.ones(2), np.zeros(3))}, "initial"),
    ({"initial": (np.ones(3), np.zeros(3)), "robust": True}, "initial"),
    ({"rotation_prior": (np.zeros(3), np.zeros((3, 3)))}, "rotation_prior"),
    ({"rotation_prior": (np.zeros(2), np.eye(3))}, "rotation_prior"),
    ({"rotation_prior": (np.zeros(3), np.eye(2))}, "rotation_prior"),
    ({"jacobian": np.zeros((5, 2, 2))}, "cov"),
    ({"jacobian": np.zeros((5, 2)), "cov": np.zeros((5, 6, 6))}, "jacobian"),
    ({"jacobian": np.zeros((5, 2, 2)), "sigma": 1.0}, "sigma"),
]


@pytest.mark.parametrize(("change", "word"), MISTAKES, ids=[f"{word}-{k}" for k, (_, word) in enumerate(MISTAKES)])
def test_mistakes_are_refused_by_name(change, word):
    arguments = {"points": np.zeros((5, 2)), "flow": np.zeros((5, 2)), **change}
    with pytest.raises(ValueError, match=rf"^{word}\b"):
        motion3d.estimate_motion(**arguments)


def test_arguments_of_another_kind_are_refused():
    with pytest.raises(TypeError, match=r"^points\b"):
        motion3d.estimate_motion([["a", "b"]], np.zeros((1, 2)))
    with pytest.raises(TypeError, match=r"^sigma\b"):
        motion3d.estimate_motion(np.zeros((5, 2)), np.zeros((5, 2)), sigma="much")
    for wrong in ({"robust": "no"}, {"robust": 1}, {"robust": None}, {"shared": "2"}, {"shared": None}, {"shared": [1, 2]}, {"correlation_length": "1"}, {"correlation_length": None}, {"threads": "2"}, {"threads": True}, {"seed": True}, {"sigma": "0.3"}, {"sigma": True}, {"seed": 1.5}, {"threads": 2.0}, {"initial": 5}, {"rotation_prior": 3}):
        with pytest.raises(TypeError, match=f"^{next(iter(wrong))}: "):
            motion3d.estimate_motion(np.zeros((5, 2)), np.zeros((5, 2)), **wrong)
    for name in ("method", "placement", "projection", "smoother"):
        with pytest.raises(TypeError, match=f"^{name}: "):
            motion3d.estimate_motion(np.zeros((5, 2)), np.zeros((5, 2)), **{name: None})
    with pytest.raises(TypeError, match="^jacobian: "):
        motion3d.estimate_motion(np.zeros((5, 2)), np.zeros((5, 2)), jacobian=np.zeros((5, 2, 2), complex), cov=np.tile(np.eye(6), (5, 1, 1)))
    for wrong in ({"threads": 2**70}, {"shared": 0.5, "sigma": 1.0}, {"shared": float("nan"), "sigma": 1.0}, {"correlation_length": float("inf")}, {"threads": -1}, {"seed": -1}, {"points": [[1, 2], [3]]}, {"correlation_length": -1}, {"cov": -np.tile(np.eye(2), (5, 1, 1))}, {"cov": np.zeros((5, 2, 2))}, {"cov": np.tile([[1, 0.5], [0, 1]], (5, 1, 1))}, {"initial": ([0, 0, 0], W)}, {"K": [[-500, 0, 0], [0, -500, 0], [0, 0, 1]]}, {"K": [[500, 0, 0], [9, 500, 0], [0, 0, 1]]}):
        with pytest.raises(ValueError, match=f"^{next(iter(wrong))}: "):
            motion3d.estimate_motion(**{"points": np.zeros((5, 2)), "flow": np.zeros((5, 2)), **wrong})
    with pytest.raises(ValueError, match="^inv_depth: "):
        motion3d.motion_bound(np.random.default_rng(1).random((6, 2)), U, W, np.full(6, np.nan), sigma=0.1)
    with pytest.raises(jacoflow.NotObservableError):
        motion3d.motion_bound(np.zeros((6, 2)), U, W, np.ones(6), sigma=0.1)
    with pytest.raises(ValueError, match="^sigma"):
        motion3d.motion_bound(np.zeros((6, 2)), U, W, np.ones(6))


def textured_drive():
    """Two frames of a textured plane that comes nearer, f = 120 px."""
    rng = np.random.default_rng(1)
    height, width = 96, 128
    y, x = np.mgrid[:height, :width].astype(float)
    waves = [(rng.uniform(0.05, 0.45, 2), rng.uniform(0, 6.28), rng.uniform(4, 14)) for _ in range(40)]
    shade = lambda x, y: 128 + sum(a * np.sin(k[0] * x + k[1] * y + p) for k, p, a in waves)
    scale = 1.02
    return [shade(x, y), shade(64 + (x - 64) / scale, 48 + (y - 48) / scale)], np.array([[120.0, 0, 64], [0, 120, 48], [0, 0, 1]])


def test_a_field_gives_the_motion_and_the_points():
    frames, camera = textured_drive()
    field = jacoflow.estimate(frames, method="windowed", window_sigma=4.0)
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
    field = jacoflow.estimate(frames, method="windowed", window_sigma=4.0)
    found, _ = motion3d.estimate_field_motion(field, camera, robust=False)
    contact, deviation, residual = motion3d.time_to_contact_map(field, found, camera)
    assert contact.shape == deviation.shape == residual.shape == field.shape
    assert_array_equal(np.isnan(contact), ~(np.asarray(field.valid) & (np.asarray(field.status) != jacoflow.Status.INCONSISTENT)))
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


def test_displacements_over_a_whole_frame_are_placed_half_way():
    """Within half of the published figures, whose layout is not told; at the start they are larger by 20 times and more."""
    for row in claims.displacements(12):
        for what in ("start, mrad", "midpoint, deg", "midpoint, mrad"):
            assert row[what] == pytest.approx(row[f"{what} asked"], rel=0.55), row
        assert row["start, deg"] > 10 * row["midpoint, deg"] and row["start, mrad"] > 20 * row["midpoint, mrad"], row
        assert row["exact, deg"] < 1e-6 and row["exact, mrad"] < 1e-6, row


@pytest.mark.parametrize("options", [{}, {"method": "ml"}, {"sigma": 1e-6}, {"robust": True}, {"robust": True, "sigma": 1e-6}])
def test_two_exact_views_give_the_exact_motion(options):
    """However fast they turn; the depths are those half way, and predict the displacement."""
    for ratio, turn in ((0.02, 0.02), (0.02, 0.3), (0.2, 0.1), (0.2, 0.3)):
        make = claims.displaced(ratio, turn, 1, 300)
        found = motion3d.estimate_motion(make.points, make.flow, **options)
        assert np.radians(scores.angle(found.translation, make.u)) < 1e-8, (ratio, turn)
        assert_allclose(found.rotation, make.w, atol=1e-8)
        half, mean = scenes.exponential(make.w / 2)
        middle = np.column_stack([make.points, np.ones(300)]) @ half.T / make.depths[:, None] + mean @ make.u / 2
        assert_allclose(found.inv_depth, 1 / middle[:, 2], rtol=1e-5)
        moved = motion3d.predict_flow(make.points, found.translation, found.rotation, found.inv_depth, whole_frame=True)
        assert_allclose(moved, make.flow, atol=1e-7)


def test_displacements_are_predicted_in_pixels():
    make = scenes.two_views("smooth", "oblique", 0.0, 6, 3)
    half, mean = scenes.exponential(make.w / 2)
    eta = np.column_stack([make.points, np.ones(1000)]) @ np.linalg.inv(scenes.K).T
    nu = 1 / (eta @ half.T / make.depths[:, None] + mean @ make.u / 2)[:, 2]
    moved = motion3d.predict_flow(make.points, make.u, make.w, nu, scenes.K, whole_frame=True)
    assert_allclose(moved, make.flow, atol=1e-9)
    instant = motion3d.predict_flow(make.points, make.u, make.w, nu, scenes.K)
    assert 0.01 < np.abs(instant - make.flow).max() < 3
    with pytest.raises(ValueError, match="^whole_frame: "):
        motion3d.predict_flow([[0, 0, 1]], make.u, make.w, [1], projection="sphere", whole_frame=True)


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("turn", [0.12, 0.17, 0.25])
def test_covariances_hold_in_fast_turns(turn, robust):
    """The flow placed half way has ellipsoids of which none or hardly any hold (`claims.turning`)."""
    row = coverage.row("", (coverage.turns(seed, turn, robust) for seed in range(150)))
    assert row["ok"] > 120 and 0.88 <= row["ellipsoid"] <= 0.985 and row["median, deg"] < 0.9, row


@pytest.mark.parametrize("noise", [0.05, None])
def test_a_camera_that_only_turns_fast_is_told(noise):
    axis = W / np.linalg.norm(W)
    for turn in (0.15, 0.25):
        for robust in (False, True):
            rng = np.random.default_rng(3)
            pixels = rng.uniform([0, 0], [640, 480], (300, 2))
            flow = scenes.displaced(pixels, np.zeros(300), U, turn * axis) - pixels + rng.normal(0, 0.05, (300, 2))
            if robust:
                flow = np.where(rng.uniform(size=(300, 1)) < 0.3, rng.uniform(-90, 90, (300, 2)), flow)
            found = motion3d.estimate_motion(pixels, flow, scenes.K, sigma=noise, robust=robust)
            assert found.status == "rotation_only", (turn, robust)
            assert np.abs(found.rotation - turn * axis).max() < 5 * found.rotation_std.max()


def test_a_variance_of_nothing_does_not_decide_alone():
    make = scene(300, 0.01, 4)
    covariance = np.tile(make.sigma**2 * np.eye(2), (300, 1, 1))
    usual = motion3d.estimate_motion(make.points, make.flow, cov=covariance, placement="start")
    for robust in (False, True):
        covariance[17] = 1e-20 * np.eye(2)
        found = motion3d.estimate_motion(make.points, make.flow, cov=covariance, placement="start", robust=robust)
        assert found.status == "ok" and scores.angle(found.translation, usual.translation) < usual.direction_std
        assert found.direction_std == pytest.approx(usual.direction_std, rel=0.1)
    make, jacobian, covariance = scenes.patches("oblique", 60, 60, 0.05, 1, 0.3)
    covariance = covariance.copy()
    covariance[5] *= 1e-18
    found = motion3d.estimate_motion(make.points, make.flow, scenes.K, cov=covariance, jacobian=jacobian, placement="start")
    assert found.status == "ok" and scores.angle(found.translation, make.u) < 4 * found.direction_std < 20


@pytest.mark.parametrize("turn", [0, 1])
def test_few_points_that_stand_still_are_told(turn):
    """Noise alone, or a rotation, in noise that is not told: no outliers are made of it."""
    for n in (12, 20, 40):
        told, held = 0, 0
        for seed in range(30):
            rng = np.random.default_rng((seed, n))
            points = rng.uniform(-0.6, 0.6, (n, 2))
            flow = turn * scenes.rows(points)[1] @ W + 0.001 * rng.normal(size=(n, 2))
            found = motion3d.estimate_motion(points, flow, robust=True)
            if found.status == "rotation_only":
                told += 1
                off = found.rotation - turn * W
                held += off @ np.linalg.solve(found.covariance[2:, 2:], off) < 11.34
        assert told >= 24 and held >= 0.8 * told, (n, told, held)
    points = np.random.default_rng(1).uniform(-0.6, 0.6, (12, 2))
    assert motion3d.estimate_motion(points, np.zeros((12, 2)), robust=True).status == "rotation_only"


@pytest.mark.parametrize("part", ["long", "mover", "few", "patches"])
def test_covariances_hold_where_they_are_hard_to_state(part):
    for row in coverage.table(200, [part]):
        assert row["ok"] >= 60 and 0.87 <= row["ellipsoid"] <= 0.98, row


def test_what_the_text_says_besides_its_tables():
    got = {row["what"]: row for part in (claims.aperture, claims.exact_points, claims.rotations_alone, claims.biases) for row in part(60)}
    for name in ("covariances", "a scalar sigma"):
        row = got[f"aperture-like noise, {name}: rms, deg"]
        assert row["got"] == pytest.approx(row["asked"], rel=0.25), row
    assert got["aperture-like noise, covariances, smoothed weights: rms, deg"]["got"] < 3.2
    assert got["6 exact points: the true motion picked"]["got"] == "100%"
    for flow, share in ((0, 1), (2, 0)):
        assert got[f"translational flow of {flow} sigma: share told as rotation_only"]["got"] == pytest.approx(share, abs=0.07)
    for flow in (1, 2):
        row = got[f"translational flow of {flow} sigma: deviations above noise"]
        assert row["got"] == pytest.approx(row["asked"], rel=0.25), row
    bias = {name: float(str(got[f"smooth oblique n=1000 sigma 0.1, bias of {name}, deg"]["got"]).split(" ")[0]) for name in ("efficient", "linear")}
    assert bias["efficient"] < 0.8 and bias["linear"] > 30


@pytest.mark.parametrize("robust", [False, True])
def test_what_is_said_of_scenes_by_chance_holds(robust):
    """No published scene among them. Over 6000 of them 94 % of the ellipses hold, and four of 5427 `ok` are wrong."""
    rows = {row["scenes"]: row for row in honesty.table(1200, robust)}
    assert rows["all"]["ok"] > 1000 and rows["all"]["wrong"] <= 3
    for row in rows.values():
        assert 0.9 < row["holds"] < 0.97, row


def test_ground_seen_obliquely_is_published_below_its_bound():
    """Two views of the ground, 0.5 px: the published rms of 24 trials lies below the bound; ours comes as near to what true depths in the weights reach as anyone's could."""
    case = next(case for case in scores.PIXELS if case[:4] == ("ground", "oblique", 0.5, 2))
    errors, ideal, bounds = [], [], []
    for seed in range(240):
        make = scenes.two_views("ground", "oblique", 0.5, 2, seed)
        run = lambda make=make, **options: motion3d.estimate_motion(make.points, make.flow, scenes.K, sigma=0.5, method="efficient", **options)
        errors.append(scores.angle(run().translation, make.u))
        ideal.append(scores.angle(run(initial=(make.u, make.w), weight_inv_depth=make.depths).translation, make.u))
        bounds.append(motion3d.motion_bound(make.points, make.u, make.w, make.depths, scenes.K, sigma=0.5).direction_std[0])
    published = float(case[5][1].split(" / ")[1])
    assert published < scores.rms(bounds) < scores.rms(errors) < 1.2 * scores.rms(bounds)
    assert scores.rms(errors) < 1.06 * scores.rms(ideal)


@pytest.mark.parametrize("case", range(5))
def test_six_numbers_on_layouts_with_the_published_bounds(case):
    """Shrunk slants and flow alone within a fifth of the published figures; six numbers worse without shrinking where patches are small. Of ten patches the published errors of flow lie below their bound: a quarter."""
    h, n, radius, sigma, asked = six.SIX[case]
    like, _ = six.like_the_published(h, n, radius, sigma, asked)
    row = six.six_row([scenes.patches("oblique", n, radius, sigma, like[t % len(like)], h, t) for t in range(240)], asked)
    for name in ("CRLB flow", "CRLB six"):
        assert row[name] == pytest.approx(row[f"{name} asked"], rel=0.03), row
    for name in ("flow ML", "flow prior", "six ML", "six shrunk"):
        assert row[name] == pytest.approx(row[f"{name} asked"], rel=0.25 if n == 10 else 0.2), row
    if n == 200:
        assert row["six ML"] > 1.15 * row["six shrunk"], row
