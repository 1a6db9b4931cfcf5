"""Parts of the gradient tracker that stand for themselves: the Gauss-Markov filter and the first object that
moves."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

from jacoflow import track


def by_matrices(alpha, q, r, rows, measured, start):
    """Equations (12) to (24) with matrices; one axis."""
    f, h = np.array([[1, 1, 0.5], [0, 1, 1], [0, 0, alpha]]), np.array(rows)
    x, p = np.array([start, 0.0, 0.0]), np.diag([1.0, 4.0, 1.0])
    gain = None
    for z in measured:
        x, p = f @ x, f @ p @ f.T + np.diag([0, 0, q])
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(r))
        x, p = x + gain @ (z - h @ x), (np.eye(3) - gain @ h) @ p
    return x, p, gain


def test_filter_is_that_of_the_paper():
    rng = np.random.default_rng(1)
    z = np.cumsum(rng.normal(1.0, 0.5, (40, 2, 2)), axis=0) * (1, 0.1)
    for measures, lag in (("instant", 0.0), ("mean", -0.5 / 0.8)):
        kalman = track.GaussMarkovFilter((3.0, -1.0), measures=measures)
        for t in range(40):
            kalman.predict()
            kalman.update(position=z[t, :, 0], velocity=z[t, :, 1])
        for axis, start in enumerate((3.0, -1.0)):
            x, p, _ = by_matrices(0.8, 0.5, (1.0, 0.25), [[1, 0, 0], [0, 1, lag]], z[:, axis], start)
            got = kalman.position[axis], kalman.velocity[axis], kalman.acceleration[axis]
            assert_allclose(got, x, rtol=1e-9, atol=1e-12)
            assert_allclose(kalman.covariance[axis], p, rtol=1e-9, atol=1e-12)


def test_steady_state_is_the_published_one():
    _, _, gain = by_matrices(0.8, 0.5, (1.0, 0.25), [[1, 0, 0], [0, 1, 0]], np.zeros((300, 2)), 0.0)
    assert_allclose(gain, [[0.3543, 0.3795], [0.0949, 0.7517], [-0.0079, 0.4635]], atol=1e-3)
    kalman = track.GaussMarkovFilter((0, 0), measures="instant")
    for _ in range(300):
        kalman.predict()
        kalman.update(position=(0, 0), velocity=(0, 0))
    assert_allclose(np.diagonal(kalman.covariance, axis1=1, axis2=2), [[0.3543, 0.1879, 0.629]] * 2, atol=1e-3)


def test_mean_step_as_velocity_is_better_on_a_circle():
    """What flow measures is the mean since the frame before; radius 24 px, deviations of .05 px."""
    errors = {}
    for period in (50, 25):
        rng, t = np.random.default_rng(0), np.arange(400)
        angle = 2 * np.pi * t / period
        places = 24 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        true = 24 * 2 * np.pi / period * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
        for measures in ("mean", "instant"):
            kalman, off = track.GaussMarkovFilter(places[0], q=0.05, measures=measures), []
            for k in range(1, 400):
                kalman.predict()
                kalman.update(
                    position=places[k] + rng.normal(0, 0.05, 2), velocity=places[k] - places[k - 1] + rng.normal(0, 0.05, 2),
                    position_variance=0.05**2, velocity_variance=0.05**2,
                )  # fmt: skip
                off.append(kalman.velocity - true[k])
            errors[period, measures] = np.sqrt(np.mean(np.square(off[50:])))
    published = {(50, "mean"): 0.087, (50, "instant"): 0.101, (25, "mean"): 0.299, (25, "instant"): 0.379}
    assert errors == pytest.approx(published, rel=0.05)


def test_innovation_is_chi_squared_and_rows_may_be_missing():
    rng = np.random.default_rng(2)
    kalman, squares = track.GaussMarkovFilter((0, 0), q=1e-6, start=(1e-6, 1e-6, 1e-6)), []
    for _ in range(2000):
        kalman.predict()
        squares.append(kalman.update(position=rng.normal(0, 1, 2), velocity=rng.normal(0, 0.5, 2)))
    assert np.mean(squares) == pytest.approx(4.0, rel=0.1)
    kalman.predict()
    before = kalman.covariance
    assert kalman.update() == 0.0
    assert_allclose(kalman.covariance, before)
    assert kalman.update(velocity=(0, 0)) >= 0 and np.linalg.eigvalsh(kalman.covariance).min() > 0


@pytest.mark.parametrize(
    ("arguments", "names"),
    [({"alpha": 0.0}, "alpha"), ({"alpha": 1.1}, "alpha"), ({"q": -1.0}, "q"), ({"start": (1, -1, 1)}, "start"), ({"start": (1, 1)}, "start"), ({"measures": "flow"}, "measures"), ({"position": (1, np.nan)}, "position")],
)
def test_errors_of_the_filter_name_the_argument(arguments, names):
    with pytest.raises(ValueError, match=names):
        track.GaussMarkovFilter(arguments.pop("position", (0, 0)), **arguments)
    kalman = track.GaussMarkovFilter((0, 0))
    for wrong in ({"position": (np.inf, 0)}, {"position": (0, 0), "position_variance": 0.0}, {"velocity": (0, 0, 0)}):
        with pytest.raises(ValueError, match=r"position|velocity|variance"):
            kalman.update(**wrong)


def test_what_moves_first_is_found_with_its_box():
    rng = np.random.default_rng(4)
    first = np.full((60, 130), 90.0)
    second = first.copy()
    first[20:33, 20:33] = 200
    second[22:35, 23:36] = 200
    first[45:52, 100:107], second[45:52, 101:108] = 160, 160
    first, second = (np.clip(np.rint(frame + rng.normal(0, 2, frame.shape)), 0, 255).astype(np.uint8) for frame in (first, second))
    largest = track.detect_moving_target(first, second)
    assert_allclose(largest.box, (22.5, 21.5, 13, 13), atol=1.01)
    assert_allclose(largest.displacement, (3, 2))
    other = track.detect_moving_target(first, second, center=(103, 48))
    assert_allclose(other.box, (100.5, 44.5, 7, 7), atol=1.01)
    assert track.detect_moving_target(first, first) is None
    with pytest.raises(ValueError, match="second"):
        track.detect_moving_target(first, second[:-1])


FRAME = np.full((32, 32), 90, np.uint8)


@pytest.mark.parametrize(("value", "error"), [(-1, ValueError), (1.5, TypeError), ("x", TypeError)])
def test_threads_of_the_stereo_tracker_are_refused_by_name(value, error):
    with pytest.raises(error, match="threads"):
        track.StereoTracker(threads=value)


@pytest.mark.parametrize("box", ["abcd", 3.0, (1, 2, 3), [None, 1, 2, 3], object()])
def test_boxes_are_refused_by_name(box):
    with pytest.raises(ValueError, match="bbox: expected"):
        track.GradientTracker(FRAME, box)


def test_the_filter_names_its_arguments():
    for position in (None, "ab", (1, 2, 3)):
        with pytest.raises(ValueError, match="position: expected"):
            track.GaussMarkovFilter(position)
    with pytest.raises(ValueError, match="start: expected"):
        track.GaussMarkovFilter((1, 2), start=None)
    point = track.GaussMarkovFilter((1, 2))
    for variance in (-1.0, (1.0, 0.0), (1, 2, 3), None, "x"):
        with pytest.raises(ValueError, match="position_variance: expected"):
            point.update(position=(1, 2), position_variance=variance)
        with pytest.raises(ValueError, match="velocity_variance: expected"):
            point.update(velocity=(1, 2), velocity_variance=variance)


@pytest.mark.parametrize("measures", ["mean", "instant"])
def test_a_pickled_filter_goes_on_as_the_first(measures):
    first = track.GaussMarkovFilter((3, 4), alpha=0.7, q=0.3, start=(1, 2, 3), measures=measures)
    first.predict()
    first.update((3.5, 4.5), (1.0, 0.5))
    second = pickle.loads(pickle.dumps(first))
    for each in (first, second):
        each.predict()
        each.update((4.5, 5.0), (1.0, 0.25), position_variance=0.5)
    assert np.array_equal(first.covariance, second.covariance) and np.array_equal(first.acceleration, second.acceleration)
    assert np.array_equal(first.position, second.position) and np.array_equal(first.velocity, second.velocity)


def test_results_pickle():
    tracker = track.GradientTracker(FRAME, (9, 9, 9, 9))
    assert np.array_equal(pickle.loads(pickle.dumps(tracker.result)).box, tracker.result.box)
