"""The generic filters against filterpy, in batches, with missing measurements and failing callbacks."""

import pickle

import filterpy.kalman
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from jacoflow import NumericalError
from jacoflow.filters import ExtendedKalmanFilter, KalmanFilter, MerweScaledSigmaPoints, ParticleFilter, UnscentedKalmanFilter

TRANSITION = np.array([[1.0, 0.1], [0.0, 1.0]])


def fx(points, dt):
    """A pendulum; points (..., 2)."""
    angle, speed = points[..., 0], points[..., 1]
    return np.stack([angle + dt * speed, speed - dt * np.sin(angle)], axis=-1)


def fx_noisy(points, noise, dt):
    return fx(points, dt) + noise


def hx(points):
    return np.sin(points[..., :1])


def measurements(count=60, seed=0):
    return 0.5 * np.cos(0.1 * np.arange(count)) + 0.05 * np.random.default_rng(seed).normal(size=count)


def unscented(**options):
    points = MerweScaledSigmaPoints(2, 0.5, 2.0, 1.0)
    made = UnscentedKalmanFilter(2, 1, 0.1, hx, fx_noisy if options.get("augmented") else fx, points, **options)
    made.Q = np.diag([1e-4, 1e-3])
    made.R = 0.01
    return made


@pytest.mark.parametrize("redraw", [True, False])
def test_unscented_equals_filterpy(redraw):
    """filterpy 2 redraws its points after the prediction, filterpy 1 did not; both are set by hand here."""
    sigma = filterpy.kalman.MerweScaledSigmaPoints(2, 0.5, 2.0, 1.0)
    reference = filterpy.kalman.UnscentedKalmanFilter(2, 1, 0.1, hx, fx, sigma)
    reference.Q, reference.R = np.diag([1e-4, 1e-3]), np.array([[0.01]])
    ours = unscented(redraw=redraw)
    for z in measurements():
        propagated = fx(sigma.sigma_points(reference.x, reference.P), 0.1)
        reference.predict()
        reference.sigmas_f = sigma.sigma_points(reference.x, reference.P) if redraw else propagated
        reference.update(z)
        ours.predict()
        ours.update(z)
        assert_allclose(ours.x, reference.x, rtol=1e-9, atol=1e-12)
        assert_allclose(ours.P, reference.P, rtol=1e-8, atol=1e-12)
        assert_allclose(ours.K, reference.K, rtol=1e-8, atol=1e-12)
        assert_allclose(ours.log_likelihood, reference.log_likelihood, rtol=1e-8)


def test_sigma_points_equal_filterpy():
    reference = filterpy.kalman.MerweScaledSigmaPoints(3, 0.3, 2.0, 0.5)
    ours = MerweScaledSigmaPoints(3, 0.3, 2.0, 0.5)
    mean, covariance = np.array([1.0, 2.0, 3.0]), np.diag([1.0, 2.0, 3.0]) + 0.1
    assert_allclose(ours.sigma_points(mean, covariance), reference.sigma_points(mean, covariance), rtol=1e-12)
    assert_allclose(ours.Wm, reference.Wm, rtol=1e-12)
    assert_allclose(ours.Wc, reference.Wc, rtol=1e-12)
    assert ours.num_sigmas() == reference.num_sigmas()


def test_linear_filter_equals_filterpy():
    reference, ours = filterpy.kalman.KalmanFilter(2, 1), KalmanFilter(2, 1)
    for each in (reference, ours):
        each.F, each.H = TRANSITION.copy(), np.array([[1.0, 0.0]])
        each.Q, each.R = np.diag([1e-4, 1e-2]), np.array([[0.1]])
        each.P *= 10.0
    for z in measurements():
        reference.predict()
        reference.update(z)
        ours.predict()
        ours.update(z)
    assert_allclose(ours.x, reference.x[:, 0], rtol=1e-10)
    assert_allclose(ours.P, reference.P, rtol=1e-9)
    assert_allclose(ours.S, reference.S, rtol=1e-9)


@pytest.mark.parametrize("analytic", [True, False])
def test_extended_filter_equals_filterpy(analytic):
    reference, ours = filterpy.kalman.ExtendedKalmanFilter(2, 1), ExtendedKalmanFilter(2, 1)

    def jacobian(x):
        return np.array([[np.cos(x[..., 0]), 0.0]])

    reference.x = np.zeros(2)
    reference.F = TRANSITION
    for each in (reference, ours):
        each.Q, each.R = np.diag([1e-4, 1e-2]), np.array([[0.1]])
    for z in measurements():
        reference.predict()
        reference.update(np.array([z]), jacobian, hx)
        ours.predict(lambda x: x @ TRANSITION.T, (lambda x: TRANSITION) if analytic else None)
        ours.update(z, jacobian if analytic else None, hx)
    assert_allclose(ours.x, reference.x, rtol=1e-6)
    assert_allclose(ours.P, reference.P, rtol=1e-6)


@pytest.mark.parametrize("augmented", [False, True])
def test_a_batch_equals_single_filters(augmented):
    batch = unscented(batch=3, augmented=augmented)
    singles = [unscented(augmented=augmented) for _ in range(3)]
    starts = np.array([[0.1, 0.0], [0.2, -0.1], [0.0, 0.3]])
    batch.x = starts
    for single, start in zip(singles, starts, strict=True):
        single.x = start
    series = np.stack([measurements(20, seed) for seed in range(3)], axis=1)
    for z in series:
        batch.predict()
        batch.update(z[:, None])
        for single, value in zip(singles, z, strict=True):
            single.predict()
            single.update(value)
    assert batch.x.shape == (3, 2) and batch.P.shape == (3, 2, 2) and batch.log_likelihood.shape == (3,)
    assert_array_equal(batch.x, [single.x for single in singles])
    assert_array_equal(batch.P, [single.P for single in singles])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("R", -1.0),
        ("P", [[1, 2], [2, 1]]),
        ("P", [[1, 5], [0, 1]]),
        ("Q", np.full((2, 2), np.nan)),
        ("x", [np.inf, 0.0]),
    ],
)
def test_what_is_no_covariance_or_mean_is_refused(name, value):
    ours = KalmanFilter(2, 1)
    ours.H = [[1.0, 0.0]]
    before = getattr(ours, name).copy()
    with pytest.raises(ValueError, match=f"^{name}: "):
        setattr(ours, name, value)
    assert_array_equal(getattr(ours, name), before)
    getattr(ours, name)[...] = value
    with pytest.raises(ValueError, match=f"^{name}: "):
        ours.predict() if name != "R" else ours.update(0.3)
    with pytest.raises(ValueError, match="^z: "):
        KalmanFilter(2, 1).update([np.inf])


def test_sizes_beyond_memory_are_refused():
    for call, name in (
        (lambda: KalmanFilter(10**6, 1), "dim_x"),
        (lambda: KalmanFilter(4, 10**6), "dim_z"),
        (lambda: KalmanFilter(4, 2, batch=10**15), "batch"),
        (lambda: ExtendedKalmanFilter(10**6, 1), "dim_x"),
        (lambda: MerweScaledSigmaPoints(10**6), "n"),
        (lambda: MerweScaledSigmaPoints(3, 0.1, 2.0, -3.0), "kappa"),
    ):
        with pytest.raises(ValueError, match=f"^{name}: "):
            call()
    with pytest.raises(ValueError, match="^x: "):
        MerweScaledSigmaPoints(2).sigma_points([np.nan, 0.0], np.eye(2))


def test_missing_measurements_leave_the_prediction():
    ours = unscented(batch=2)
    ours.predict()
    before = ours.x.copy(), ours.P.copy()
    ours.update([[np.nan], [0.4]])
    assert_array_equal(ours.x[0], before[0][0])
    assert (ours.x[1] != before[0][1]).any()
    ours.predict()
    before = ours.x.copy()
    ours.update(None)
    assert_array_equal(ours.x, before)


def test_arrays_may_be_changed_in_place_and_are_checked():
    ours = unscented()
    ours.P *= 4.0
    ours.P[0, 1] = ours.P[1, 0] = 0.5
    ours.predict()
    assert ours.P[0, 0] > 3.0
    given = np.array([1.0, 2.0])
    ours.x = given
    ours.x[0] = 5.0
    assert given[0] == 1.0, "what the user passed must not be shared"
    for name, value in (("x", np.zeros(3)), ("P", np.zeros((2, 3))), ("Q", np.eye(3)), ("R", np.eye(2))):
        with pytest.raises(ValueError, match=name):
            setattr(ours, name, value)
    with pytest.raises(TypeError, match="x: expected real numbers, got complex"):
        ours.x = np.array([1j, 2j])
    with pytest.raises(ValueError, match="z"):
        ours.update([1.0, 2.0])


def test_a_failing_callback_raises_its_own_error_and_changes_nothing():
    ours = unscented()
    ours.predict()
    before = ours.x.copy(), ours.P.copy()

    def broken(points, dt=0.0):
        raise RuntimeError("no idea")

    with pytest.raises(RuntimeError, match="no idea"):
        ours.predict(fx=broken)
    with pytest.raises(RuntimeError, match="no idea"):
        ours.update(0.1, hx=broken)
    with pytest.raises(ValueError, match=r"fx: expected a function that returns shape \("):
        ours.predict(fx=lambda points, dt: points[:-1])
    with pytest.raises(ValueError, match="fx: expected a function with finite results"):
        ours.predict(fx=lambda points, dt: points * np.nan)
    assert_array_equal(ours.x, before[0])
    assert_array_equal(ours.P, before[1])

    def nested(points, dt):
        ours.predict()
        return points

    with pytest.raises(RuntimeError, match="in the middle of a step"):
        ours.predict(fx=nested)


def test_numerical_failure_is_reported():
    points = MerweScaledSigmaPoints(2)
    with pytest.raises(NumericalError, match="P is not positive definite"):
        points.sigma_points([0.0, 0.0], -np.eye(2))


@pytest.mark.parametrize("arguments", [(0, 1), (1, 0)])
def test_empty_dimensions_are_refused(arguments):
    with pytest.raises(ValueError, match="dim_"):
        KalmanFilter(*arguments)


def step(each, z):
    if isinstance(each, ExtendedKalmanFilter):
        each.predict(lambda x: x @ TRANSITION.T)
        each.update(z, None, hx)
    else:
        each.predict()
        each.update(z)


@pytest.mark.parametrize(
    "make",
    [
        lambda: unscented(),
        lambda: unscented(redraw=False),
        lambda: unscented(augmented=True),
        lambda: ExtendedKalmanFilter(2, 1),
        lambda: KalmanFilter(2, 1),
    ],
)
def test_filters_pickle_mid_stream(make):
    one = make()
    for z in measurements(5):
        step(one, z)
    if isinstance(one, UnscentedKalmanFilter):
        one.predict()
    other = pickle.loads(pickle.dumps(one))
    assert repr(other) == repr(one)
    for each in (one, other):
        each.update(0.3, None, hx) if isinstance(each, ExtendedKalmanFilter) else each.update(0.3)
        for z in measurements(5, 7):
            step(each, z)
    assert_array_equal(one.x, other.x)
    assert_array_equal(one.P, other.P)
    assert one.repairs == other.repairs


FUNCTIONS = {
    "ukf hx": (lambda: UnscentedKalmanFilter(2, 1, 0.1, 5, fx, MerweScaledSigmaPoints(2, 0.5, 2.0, 1.0)), "hx", "int"),
    "ukf fx": (lambda: UnscentedKalmanFilter(2, 1, 0.1, hx, None, MerweScaledSigmaPoints(2, 0.5, 2.0, 1.0)), "fx", "NoneType"),
    "ukf attribute": (lambda: setattr(unscented(), "hx", 5), "hx", "int"),
    "ukf predict": (lambda: unscented().predict(fx=5), "fx", "int"),
    "ukf update": (lambda: unscented().update(0.1, hx=5), "hx", "int"),
    "ekf predict": (lambda: ExtendedKalmanFilter(2, 1).predict(None), "fx", "NoneType"),
    "ekf transition's Jacobian": (lambda: ExtendedKalmanFilter(2, 1).predict(lambda x: x, np.eye(2)), "FJacobian", "ndarray"),
    "ekf measurement": (lambda: ExtendedKalmanFilter(2, 1).update(0.1, None, 5), "Hx", "int"),
    "ekf measurement's Jacobian": (lambda: ExtendedKalmanFilter(2, 1).update(0.1, 5, hx), "HJacobian", "int"),
    "particles": (lambda: ParticleFilter(2, 10).predict(5), "transition", "int"),
}


@pytest.mark.parametrize(("call", "name", "got"), FUNCTIONS.values(), ids=FUNCTIONS)
def test_what_is_no_function_is_named(call, name, got):
    with pytest.raises(TypeError, match=f"^{name}: expected a function, got {got}"):
        call()
