"""Mistakes are refused by name, and tell what would have been right."""

import numpy as np
import pytest

import jacoflow
from jacoflow import motion3d
from motion3d_support import U, W, scene, start

MISTAKES = [
    ({"points": np.zeros((5, 3))}, "points"),
    ({"flow": np.zeros((4, 2))}, "flow"),
    ({"K": np.eye(2)}, "K"),
    ({"K": np.zeros((3, 3))}, "K"),
    ({"noise_std": 0.0}, "noise_std"),
    ({"noise_std": -1.0}, "noise_std"),
    ({"noise_std": 1e-300}, "noise_std"),
    ({"noise_std": 1e300}, "noise_std"),
    ({"cov": np.ones((5, 2))}, "cov"),
    ({"noise_std": 1.0, "cov": np.ones((5, 2, 2))}, "cov"),
    ({"method": "best"}, "method"),
    ({"placement": "end"}, "placement"),
    ({"projection": "cube"}, "projection"),
    ({"smoother": "spline"}, "smoother"),
    ({"random_state": -1}, "random_state"),
    ({"threads": 0}, "threads"),
    ({"weight_inv_depth": np.ones(3)}, "weight_inv_depth"),
    ({"initial": (np.ones(2), np.zeros(3))}, "initial"),
    ({"initial": (np.ones(3), np.zeros(3)), "robust": True}, "initial"),
    ({"rotation_prior": (np.zeros(3), np.zeros((3, 3)))}, "rotation_prior"),
    ({"rotation_prior": (np.zeros(2), np.eye(3))}, "rotation_prior"),
    ({"rotation_prior": (np.zeros(3), np.eye(2))}, "rotation_prior"),
    ({"jacobian": np.zeros((5, 2, 2))}, "cov"),
    ({"jacobian": np.zeros((5, 2)), "cov": np.zeros((5, 6, 6))}, "jacobian"),
    ({"jacobian": np.zeros((5, 2, 2)), "noise_std": 1.0}, "noise_std"),
    ({"jacobian": np.zeros((5, 2, 2)), "noise_std": 1.0, "cov": np.tile(np.eye(6), (5, 1, 1))}, "cov"),
    ({"jacobian": np.zeros((5, 2, 2)), "projection": "sphere", "cov": np.tile(np.eye(6), (5, 1, 1))}, "projection"),
    ({"weight_inv_depth": -np.ones(5)}, "weight_inv_depth"),
    ({"weight_inv_depth": np.zeros(5)}, "weight_inv_depth"),
]


@pytest.mark.parametrize(("change", "word"), MISTAKES, ids=[f"{word}-{k}" for k, (_, word) in enumerate(MISTAKES)])
def test_mistakes_are_refused_by_name(change, word):
    arguments = {"points": np.zeros((5, 2)), "flow": np.zeros((5, 2)), **change}
    with pytest.raises(ValueError, match=rf"^{word}\b"):
        motion3d.estimate_motion(**arguments)


def test_arguments_of_another_kind_are_refused():
    with pytest.raises(TypeError, match=r"^points\b"):
        motion3d.estimate_motion([["a", "b"]], np.zeros((1, 2)))
    with pytest.raises(TypeError, match=r"^noise_std\b"):
        motion3d.estimate_motion(np.zeros((5, 2)), np.zeros((5, 2)), noise_std="much")
    for wrong in ({"robust": "no"}, {"robust": 1}, {"robust": None}, {"points_per_independent_sample": "2"}, {"points_per_independent_sample": None}, {"points_per_independent_sample": [1, 2]}, {"correlation_length": "1"}, {"correlation_length": None}, {"threads": "2"}, {"threads": True}, {"random_state": True}, {"noise_std": "0.3"}, {"noise_std": True}, {"random_state": 1.5}, {"threads": 2.0}, {"initial": 5}, {"rotation_prior": 3}):
        with pytest.raises(TypeError, match=f"^{next(iter(wrong))}: "):
            motion3d.estimate_motion(np.zeros((5, 2)), np.zeros((5, 2)), **wrong)
    for name in ("method", "placement", "projection", "smoother"):
        with pytest.raises(TypeError, match=f"^{name}: "):
            motion3d.estimate_motion(np.zeros((5, 2)), np.zeros((5, 2)), **{name: None})
    with pytest.raises(TypeError, match="^jacobian: "):
        motion3d.estimate_motion(np.zeros((5, 2)), np.zeros((5, 2)), jacobian=np.zeros((5, 2, 2), complex), cov=np.tile(np.eye(6), (5, 1, 1)))
    for wrong in ({"threads": 2**70}, {"points_per_independent_sample": 0.5, "noise_std": 1.0}, {"points_per_independent_sample": float("nan"), "noise_std": 1.0}, {"correlation_length": float("inf")}, {"threads": -1}, {"random_state": -1}, {"points": [[1, 2], [3]]}, {"correlation_length": -1}, {"cov": -np.tile(np.eye(2), (5, 1, 1))}, {"cov": np.zeros((5, 2, 2))}, {"cov": np.tile([[1, 0.5], [0, 1]], (5, 1, 1))}, {"initial": ([0, 0, 0], W)}, {"K": [[-500, 0, 0], [0, -500, 0], [0, 0, 1]]}, {"K": [[500, 0, 0], [9, 500, 0], [0, 0, 1]]}):
        with pytest.raises(ValueError, match=f"^{next(iter(wrong))}: "):
            motion3d.estimate_motion(**{"points": np.zeros((5, 2)), "flow": np.zeros((5, 2)), **wrong})
    with pytest.raises(ValueError, match="^inv_depth: "):
        motion3d.motion_bound(np.random.default_rng(1).random((6, 2)), U, W, np.full(6, np.nan), noise_std=0.1)
    with pytest.raises(jacoflow.NotObservableError):
        motion3d.motion_bound(np.zeros((6, 2)), U, W, np.ones(6), noise_std=0.1)
    with pytest.raises(ValueError, match="^noise_std"):
        motion3d.motion_bound(np.zeros((6, 2)), U, W, np.ones(6))


PLACES = np.random.default_rng(1).uniform(-0.5, 0.5, (6, 2))
AROUND = np.column_stack([PLACES, np.ones(6)]) / np.linalg.norm(np.column_stack([PLACES, np.ones(6)]), axis=1, keepdims=True)
SIX = np.tile(np.eye(6), (6, 1, 1))
SURFACES = np.tile([1.0, 0.1, 0.1], (6, 1))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"noise_std": 0.1, "jacobian": True, "inv_depth": SURFACES}, ["noise_std: ", "cov (N, 6, 6)"]),
        ({"noise_std": 0.1, "cov": SIX, "jacobian": True, "inv_depth": SURFACES}, ["cov: ", "noise_std", "both"]),
        ({"noise_std": 0.1, "cov": np.tile(np.eye(2), (6, 1, 1))}, ["cov: ", "noise_std", "both"]),
        ({"points": AROUND, "cov": SIX, "jacobian": True, "inv_depth": SURFACES, "projection": "sphere"}, ["projection: ", "jacobian", "sphere"]),
        ({"noise_std": 0.1, "points": np.empty((0, 2)), "inv_depth": np.empty(0)}, ["points: ", "5 points", "got 0"]),
        ({"noise_std": 0.1, "points": np.where(np.arange(6)[:, None] < 3, np.nan, PLACES)}, ["points: ", "finite", "got 3"]),
        ({"cov": np.full((6, 2, 2), np.nan)}, ["cov: ", "finite"]),
        ({"cov": SIX[:1], "points": PLACES[:1], "inv_depth": SURFACES[:1], "jacobian": True}, ["points: ", "2 points", "got 1"]),
        ({"noise_std": 0.1, "translation": [0, 0, 0]}, ["translation: ", "direction", "(0, 0, 0)"]),
        ({"noise_std": 0.1, "translation": [1e300, np.nan, 1]}, ["translation: ", "(1e300, NaN, 1)"]),
        ({"noise_std": 0.1, "rotation": [0, np.inf, 0]}, ["rotation: ", "(0, inf, 0)"]),
        ({"noise_std": 1e300}, ["noise_std: ", "got 1e300"]),
        ({"cov": np.tile([[-1e300, 0], [0, 1e-9]], (6, 1, 1))}, ["cov: ", "at point 0 (-1e300, 0, 0, 1e-9)"]),
        ({"noise_std": 0.1, "K": [[1e300, 0, 0], [0, -1e300, 0], [0, 0, 1]]}, ["K: ", "1e300 and -1e300"]),
        ({"noise_std": 0.1, "points": 3 * AROUND, "projection": "sphere"}, ["points: ", "length 1"]),
    ],
)
def test_mistakes_of_a_bound_are_refused_by_name_in_short_words(change, words):
    arguments = {"points": PLACES, "translation": U, "rotation": W, "inv_depth": np.ones(6), **change}
    with pytest.raises(ValueError) as raised:
        motion3d.motion_bound(**arguments)
    message = str(raised.value)
    assert message.startswith(words[0]) and all(word in message for word in words), message
    assert len(message) < 200 and not any(mark in message for mark in ("Some(", "{", "0000")), message


def test_mistakes_of_an_estimate_are_reported_in_short_words():
    for change, word in (
        ({"rotation_prior": (np.zeros(3), -1e300 * np.eye(3))}, "-1e300"),
        ({"initial": (np.array([1e300, np.nan, 0]), np.zeros(3))}, "(1e300, NaN, 0) and (0, 0, 0)"),
        ({"noise_std": 1e-300}, "1e-300"),
        ({"points_per_independent_sample": 1e-200, "noise_std": 1.0}, "1e-200"),
    ):
        with pytest.raises(ValueError) as raised:
            motion3d.estimate_motion(PLACES, np.zeros((6, 2)), **change)
        message = str(raised.value)
        assert message.startswith(next(iter(change))) and word in message, message
        assert "{" not in message and "Some" not in message and "0000" not in message, message


@pytest.mark.parametrize("wrong", [1, 0, "yes", None, np.array(True)])
def test_switches_are_true_or_false(wrong):
    with pytest.raises(TypeError, match="^jacobian: "):
        motion3d.motion_bound(PLACES, U, W, np.ones(6), noise_std=0.1, jacobian=wrong)
    with pytest.raises(TypeError, match="^whole_frame: "):
        motion3d.predict_flow(PLACES, U, W, np.ones(6), whole_frame=wrong)


def test_depths_for_the_weights_lie_before_the_camera():
    make = scene()
    with pytest.raises(ValueError, match="^weight_inv_depth: .*positive"):
        start(make, weight_inv_depth=-make.depths)
    some = np.where(np.arange(300) < 10, np.nan, make.depths)
    assert start(make, weight_inv_depth=some).status == "ok"
