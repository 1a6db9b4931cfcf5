"""Angles, partly missing measurements, whole sequences and failing states of the generic filters."""

import pickle

import filterpy.kalman
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from jacoflow import NumericalError, scenes
from jacoflow.filters import (
    ExtendedKalmanFilter,
    KalmanFilter,
    MerweScaledSigmaPoints,
    ParticleFilter,
    UnscentedKalmanFilter,
)

LANDMARK = np.array([-20.0, 0.0])
NOISE_X, NOISE_Z = np.diag([1e-4, 1e-4, 1e-5]), np.diag([0.01, 0.0025])


def wrap(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def drive(states, dt):
    """Along the heading, turned; states (..., 3)."""
    x, y, heading = np.moveaxis(states, -1, 0)
    return np.stack([x + dt * np.cos(heading), y + dt * np.sin(heading), wrap(heading + 0.3 * dt)], axis=-1)


def sight(states):
    """Range and bearing of the landmark."""
    dx, dy = LANDMARK[0] - states[..., 0], LANDMARK[1] - states[..., 1]
    return np.stack([np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - states[..., 2])], axis=-1)


def subtract_states(a, b):
    difference = a - b
    difference[..., 2] = wrap(difference[..., 2])
    return difference


def subtract_sights(a, b):
    difference = a - b
    difference[..., 1] = wrap(difference[..., 1])
    return difference


def add_states(x, dx):
    total = x + dx
    total[..., 2] = wrap(total[..., 2])
    return total


def mean_of(points, weights, index):
    mean = np.tensordot(weights, points, (0, -2))
    sines, cosines = np.sin(points[..., index]) @ weights, np.cos(points[..., index]) @ weights
    mean[..., index] = np.arctan2(sines, cosines)
    return mean


def mean_state(points, weights):
    return mean_of(points, weights, 2)


def mean_sight(points, weights):
    return mean_of(points, weights, 1)


ANGLES = {
    "x_mean": mean_state,
    "z_mean": mean_sight,
    "residual_x": subtract_states,
    "residual_z": subtract_sights,
    "state_add": add_states,
}


def journey(count=60, seed=3):
    rng = np.random.default_rng(seed)
    truth = [np.array([0.0, 0.0, 3.0])]
    while len(truth) < count:
        truth.append(drive(truth[-1], 1.0))
    seen = sight(np.array(truth)) + rng.normal(size=(count, 2)) * [0.1, 0.05]
    return np.array(truth), np.stack([seen[:, 0], wrap(seen[:, 1])], axis=1)


def begin(filter_):
    filter_.x, filter_.P = [0.2, -0.2, 2.9], np.diag([0.1, 0.1, 0.05])
    filter_.Q, filter_.R = NOISE_X, NOISE_Z
    return filter_


def unscented(functions=ANGLES, **options):
    points = MerweScaledSigmaPoints(3, 0.5, 2.0, 0.0)
    return begin(UnscentedKalmanFilter(3, 2, 1.0, sight, drive, points, **functions, **options))


def extended(**options):
    functions = {name: ANGLES[name] for name in ("residual_x", "residual_z", "state_add")}
    return begin(ExtendedKalmanFilter(3, 2, **functions, **options))


def error(states, truth):
    return np.abs(subtract_states(np.array(states), truth)).max()


def reference_unscented():
    """filterpy's, whose functions get one point at a time."""
    points = filterpy.kalman.MerweScaledSigmaPoints(3, 0.5, 2.0, 0.0)
    renamed = {("x_mean_fn" if n == "x_mean" else "z_mean_fn" if n == "z_mean" else n): f for n, f in ANGLES.items()}
    reference = filterpy.kalman.UnscentedKalmanFilter(3, 2, 1.0, sight, drive, points, **renamed)
    reference.x, reference.P = np.array([0.2, -0.2, 2.9]), np.diag([0.1, 0.1, 0.05])
    reference.Q, reference.R = NOISE_X, NOISE_Z
    return reference, points


def test_unscented_with_angles_equals_filterpy():
    (reference, points), ours = reference_unscented(), unscented()
    truth, seen = journey()
    assert np.abs(np.diff(truth[:, 2])).max() > np.pi, "headings cross the cut"
    for z in seen[1:]:
        reference.predict()
        reference.sigmas_f = points.sigma_points(reference.x, reference.P)
        reference.update(z)
        ours.predict()
        ours.update(z)
        assert_allclose(subtract_states(ours.x, reference.x), 0.0, atol=1e-9)
        assert_allclose(ours.P, reference.P, rtol=1e-7, atol=1e-12)
        assert_allclose(ours.mahalanobis, reference.mahalanobis, rtol=1e-6)
        assert_allclose(ours.log_likelihood, reference.log_likelihood, rtol=1e-7)


def test_angles_across_the_cut_do_not_disturb():
    truth, seen = journey()
    with_angles, extended_states = unscented().batch_filter(seen[1:]), []
    assert error(with_angles[0], truth[1:]) < 0.4
    one = extended()
    for z in seen[1:]:
        one.predict(lambda x: drive(x, 1.0))
        one.update(z, None, sight)
        extended_states.append(one.x)
    assert error(extended_states, truth[1:]) < 0.4
    without = unscented({}).batch_filter(seen[1:])[0]
    assert error(without, truth[1:]) > 1.0


def test_a_bearing_filter_across_the_cut_errs_by_its_noise():
    """An angle and its rate, the angle measured, with every filter."""
    rng = np.random.default_rng(1)
    truth = 2.8 + 0.05 * np.arange(40)
    seen = wrap(truth + 0.02 * rng.normal(size=40))[:, None]
    step = np.array([[1.0, 1.0], [0.0, 1.0]])

    def short_way(a, b):
        return wrap(a - b)

    linear = KalmanFilter(2, 1, residual_z=short_way)
    linear.F, linear.H = step, [[1.0, 0.0]]
    curved = ExtendedKalmanFilter(2, 1, residual_z=short_way)
    points = MerweScaledSigmaPoints(2, 0.5, 2.0, 0.0)
    sampled = UnscentedKalmanFilter(
        2, 1, 1.0, lambda x: x[..., :1], lambda x, dt: x @ step.T, points, residual_z=short_way
    )
    for each in (linear, curved, sampled):
        each.x, each.P, each.Q, each.R = [2.8, 0.0], np.diag([0.01, 0.01]), np.diag([1e-6, 1e-6]), 4e-4
    for k, z in enumerate(seen[1:], 1):
        linear.predict()
        linear.update(z)
        curved.predict(lambda x: x @ step.T)
        curved.update(z, None, lambda x: x[..., :1])
        sampled.predict()
        sampled.update(z)
        for each in (linear, curved, sampled):
            assert abs(wrap(each.x[0] - truth[k])) < 0.1


@pytest.mark.parametrize("make", [unscented, extended])
def test_functions_of_angles_are_vectorised_over_the_batch(make):
    _, seen = journey(20)
    one, many = make(), make(batch=3)
    for z in seen[1:]:
        for each, value in ((one, z), (many, np.tile(z, (3, 1)))):
            if isinstance(each, ExtendedKalmanFilter):
                each.predict(lambda x: drive(x, 1.0))
                each.update(value, None, sight)
            else:
                each.predict()
                each.update(value)
    # The functions' own sums round differently for other shapes.
    assert_allclose(many.x, np.tile(one.x, (3, 1)), rtol=1e-11)
    assert_allclose(many.P, np.tile(one.P, (3, 1, 1)), rtol=1e-9, atol=1e-15)


def test_functions_are_checked_and_their_errors_passed_on():
    ours = unscented()
    assert ours.z_mean is mean_sight and KalmanFilter(2, 1).residual_z is None
    with pytest.raises(TypeError, match="^residual_z: expected a function or None, got int"):
        ours.residual_z = 3
    before = ours.x.copy(), ours.P.copy()

    def broken(x, dx):
        raise RuntimeError("no way")

    ours.state_add = broken
    with pytest.raises(RuntimeError, match="no way"):
        ours.update([20.0, 0.1])
    ours.state_add = None
    ours.residual_z = lambda a, b: (a - b)[..., :1]
    with pytest.raises(ValueError, match=r"^residual_z: expected a function that returns shape \("):
        ours.update([20.0, 0.1])
    assert_array_equal(ours.x, before[0])
    assert_array_equal(ours.P, before[1])


def half_known():
    ours = KalmanFilter(2, 2, batch=4)
    ours.H, ours.R, ours.P = np.eye(2), np.diag([0.5, 0.5]), [[1.0, 0.5], [0.5, 1.0]]
    return ours


@pytest.mark.parametrize("masked", [False, True])
def test_missing_components_do_not_cost_the_others(masked):
    z = np.array([[1.0, 2.0], [1.0, np.nan], [np.nan, 2.0], [np.nan, np.nan]])
    if masked:
        z = np.ma.array(np.nan_to_num(z), mask=np.isnan(z))
    ours = half_known()
    ours.update(z)
    first, second = KalmanFilter(2, 1), KalmanFilter(2, 1)
    for each, row, value in ((first, [[1.0, 0.0]], 1.0), (second, [[0.0, 1.0]], 2.0)):
        each.H, each.R, each.P = row, 0.5, [[1.0, 0.5], [0.5, 1.0]]
        each.update(value)
    assert_allclose(ours.x[1:3], [first.x, second.x], rtol=1e-15)
    assert_allclose(ours.P[1:3], [first.P, second.P], rtol=1e-15)
    assert_allclose(ours.log_likelihood[1:], [first.log_likelihood, second.log_likelihood, 0.0], rtol=1e-15)
    assert_array_equal(ours.y[1:], [[1.0, 0.0], [0.0, 2.0], [0.0, 0.0]])
    assert_array_equal(ours.P[3], [[1.0, 0.5], [0.5, 1.0]])
    assert (ours.P[0].diagonal() < ours.P[1].diagonal()).all()
    single = KalmanFilter(2, 1)
    single.H = [[1.0, 0.0]]
    single.update(np.ma.masked)
    assert_array_equal(single.P, np.eye(2))


def linear_pair(cls=KalmanFilter):
    made = cls(2, 1)
    made.F, made.H = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    made.Q, made.R = np.diag([1e-4, 1e-2]), np.array([[0.1]])
    return made


@pytest.mark.parametrize("update_first", [False, True])
def test_linear_sequences_equal_filterpy(update_first):
    zs = 0.5 * np.cos(0.1 * np.arange(40)) + 0.05 * np.random.default_rng(0).normal(size=40)
    zs = [*zs[:10], None, *zs[11:]]
    rs = [np.array([[0.1 + 0.01 * k]]) for k in range(40)]
    fs = [np.array([[1.0, 0.1 + 0.001 * k], [0.0, 1.0]]) for k in range(40)]
    reference, ours = linear_pair(filterpy.kalman.KalmanFilter), linear_pair()
    expected = reference.batch_filter(zs, Fs=fs, Rs=rs, update_first=update_first)
    got = ours.batch_filter(zs, Fs=fs, Rs=rs, update_first=update_first)
    for mine, theirs in zip(got, expected, strict=True):
        assert_allclose(mine, theirs.reshape(mine.shape), rtol=1e-9, atol=1e-13)
    expected = reference.rts_smoother(expected[0], expected[1], Fs=fs, Qs=[reference.Q] * 40)
    for mine, theirs in zip(ours.rts_smoother(got[0], got[1], Fs=fs), expected, strict=True):
        assert_allclose(mine, theirs.reshape(mine.shape), rtol=1e-7, atol=1e-11)
    assert_allclose(ours.log_likelihood, reference.log_likelihood, rtol=1e-9)
    assert_allclose(ours.mahalanobis, reference.mahalanobis, rtol=1e-8)


def test_unscented_sequences_equal_filterpy():
    (reference, _), ours = reference_unscented(), unscented()
    _, seen = journey()
    means, covariances = ours.batch_filter(seen[1:])
    # filterpy adds the correction without `state_add`: compared as angles.
    expected = reference.rts_smoother(means.copy(), covariances.copy())
    got = ours.rts_smoother(means, covariances)
    assert_allclose(subtract_states(got[0], expected[0]), 0.0, atol=1e-8)
    assert_allclose(got[1], expected[1], rtol=1e-6, atol=1e-12)
    assert_allclose(got[2], expected[2], rtol=1e-6, atol=1e-10)


def test_smoothing_narrows_and_agrees_over_the_batch():
    truth, seen = journey()
    ours = unscented(batch=2)
    means, covariances = ours.batch_filter(np.stack([seen[1:]] * 2, axis=1), dts=1.0)
    assert means.shape == (59, 2, 3) and covariances.shape == (59, 2, 3, 3)
    smoothed, narrowed, gains = ours.rts_smoother(means, covariances, dts=[1.0] * 59)
    one = unscented()
    single = one.rts_smoother(*one.batch_filter(seen[1:]))
    for mine, alone in zip((smoothed, narrowed, gains), single, strict=True):
        assert_allclose(mine[:, 1], alone, rtol=1e-9, atol=1e-12)

    def rms(states):
        return np.sqrt((subtract_states(states[:, 0], truth[1:])[:40] ** 2).mean())

    assert rms(smoothed) < rms(means)
    variances = np.diagonal(covariances, axis1=-2, axis2=-1), np.diagonal(narrowed, axis1=-2, axis2=-1)
    assert (variances[1][:-1] < variances[0][:-1]).all()
    flat = extended()
    states = flat.batch_filter(seen[1:], lambda x: drive(x, 1.0), None, sight)
    assert_allclose(
        subtract_states(flat.rts_smoother(*states, lambda x: drive(x, 1.0))[0], smoothed[:, 0]), 0.0, atol=0.05
    )


def test_sequences_of_wrong_length_are_refused_by_name():
    ours = linear_pair()
    for call, name in (
        (lambda: ours.batch_filter([1.0, 2.0], Rs=[0.1]), "Rs"),
        (lambda: ours.batch_filter([1.0, [2.0, 3.0]]), "zs"),
        (lambda: ours.rts_smoother(np.zeros((3, 1)), np.zeros((3, 2, 2))), "Xs"),
        (lambda: ours.rts_smoother(np.zeros((3, 2)), np.zeros((2, 2, 2))), "Ps"),
        (lambda: ours.rts_smoother(np.zeros((3, 2)), -np.ones((3, 2, 2))), "Ps"),
        (lambda: ours.rts_smoother(np.zeros((3, 2)), np.zeros((3, 2, 2)), Fs=[np.eye(3)] * 3), "Fs"),
    ):
        with pytest.raises(ValueError, match=f"^{name}: "):
            call()
    with pytest.raises(TypeError, match="^zs: expected a sequence"):
        ours.batch_filter(3)


@pytest.mark.parametrize(("q", "r", "p0"), [(1e10, 1e-12, 1e12), (0.0, 1e-13, 1e6), (1.0, 0.0, 1e6)])
def test_covariances_stay_definite_however_far_apart_the_noises_are(q, r, p0):
    points = MerweScaledSigmaPoints(2, 0.1, 2.0, 1.0)
    step = np.array([[1.0, 0.1], [0.0, 1.0]])
    ours = UnscentedKalmanFilter(2, 1, 1.0, lambda x: x[..., :1], lambda x, dt: x @ step.T, points)
    ours.Q, ours.R, ours.P = q, r, p0
    _, covariances = ours.batch_filter(np.sin(0.1 * np.arange(200)))
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    assert (variances >= 0.0).all() and not ours.failed
    if r > 0.0:
        scale = np.sqrt(variances)
        correlations = covariances / (scale[:, :, None] * scale[:, None, :])
        assert np.linalg.eigvalsh(correlations).min() > -1e-15


def test_a_state_that_fails_is_marked_and_the_others_go_on():
    ours, alone = KalmanFilter(1, 1, batch=3), KalmanFilter(1, 1)
    for each in (ours, alone):
        each.H, each.Q = [[1.0]], 0.0
    ours.R = np.array([1.0, 0.0, 1.0])[:, None, None]
    ours.P = np.array([1.0, 0.0, 1.0])[:, None, None]
    for z in (0.5, 0.7):
        ours.predict()
        ours.update([[z]] * 3)
        alone.predict()
        alone.update(z)
    assert_array_equal(ours.failed, [False, True, False])
    assert_array_equal(ours.x, [alone.x, [0.0], alone.x])
    assert_array_equal(pickle.loads(pickle.dumps(ours)).failed, ours.failed)
    ours.P = 1.0
    assert not ours.failed.any()
    alone.P, alone.R = 0.0, 0.0
    with pytest.raises(NumericalError, match="S of state 0 is not positive definite"):
        alone.update(1.0)


def test_a_step_out_of_the_range_of_numbers_is_no_fault_of_a_function():
    largest = 1.7e308

    def limit(R, x=0.0):
        ours = KalmanFilter(2, 1, batch=2)
        ours.P, ours.Q, ours.H, ours.R = 0.0, 0.01, [[1.0, 0.0]], R
        ours.x = [[x, 0.0], [0.0, 0.0]]
        ours.predict()
        return ours

    for ours, z in ((limit(1e-300), [[largest], [1.0]]), (limit(1.0, -largest), [[largest], [1.0]])):
        ours.update(z)
        assert_array_equal(ours.failed, [True, False])
        with pytest.raises(NumericalError, match="state 0 has outgrown the range of numbers"):
            ours.x = np.tile(ours.x[0], (2, 1))
            ours.update(np.tile(z[0], (2, 1)))
    alone = KalmanFilter(2, 1)
    alone.H, alone.state_add = [[1.0, 0.0]], lambda x, dx: x + np.inf
    with pytest.raises(ValueError, match="^state_add: expected a function with finite results, got inf"):
        alone.update(1.0)


def test_smoothers_take_any_iterables():
    ours = KalmanFilter(2, 1)
    ours.H = [[1.0, 0.0]]
    means, covariances, _, _ = ours.batch_filter(z for z in ([1.0], [2.0], [3.0]))
    listed = ours.rts_smoother(means, covariances)
    for found, expected in zip(ours.rts_smoother(iter(means), (P for P in covariances)), listed, strict=True):
        assert_array_equal(found, expected)
    with pytest.raises(TypeError, match="^Xs: expected real numbers, got set"):
        ours.rts_smoother({1.0}, covariances)


def test_numbers_beyond_doubles_are_shown():
    ours = KalmanFilter(2, 1)
    with pytest.raises(ValueError, match="^z: expected numbers up to 1.8e308, got 1000"):
        ours.update(10**400)
    with pytest.raises(TypeError, match="^z: expected real numbers, got dict"):
        ours.update({})


@pytest.mark.parametrize(("value", "shown"), [(2**70, str(2**70)), (10**30, "1e30"), (10**400, "one above 2.127"), (-(2**70), str(-(2**70)))])
def test_integers_beyond_64_bits_are_shown(value, shown):
    for call, name in (
        (lambda: KalmanFilter(value, 1), "dim_x"),
        (lambda: scenes.Scene("turbulence", width=value), "width"),
    ):
        with pytest.raises(ValueError, match=rf"^{name}: expected a positive integer.*, got {shown}$"):
            call()


@pytest.mark.parametrize("value", [-1, 10**30, -(10**30)])
def test_integers_out_of_range_are_refused_by_name(value):
    points = MerweScaledSigmaPoints(2)
    for call, name in (
        (lambda: KalmanFilter(value, 1), "dim_x"),
        (lambda: KalmanFilter(2, value), "dim_z"),
        (lambda: KalmanFilter(2, 1, batch=value), "batch"),
        (lambda: ExtendedKalmanFilter(2, value), "dim_z"),
        (lambda: ExtendedKalmanFilter(2, 1, batch=value), "batch"),
        (lambda: UnscentedKalmanFilter(value, 1, 0.1, sight, drive, points), "dim_x"),
        (lambda: UnscentedKalmanFilter(2, 1, 0.1, sight, drive, points, batch=value), "batch"),
        (lambda: MerweScaledSigmaPoints(value), "n"),
        (lambda: ParticleFilter(value, 10), "dim_x"),
        (lambda: ParticleFilter(2, value), "n_particles"),
        (lambda: ParticleFilter(2, 10, ids=[value]), "ids"),
    ):
        with pytest.raises(ValueError, match=f"^{name}: "):
            call()


@pytest.mark.parametrize("make", [unscented, extended, linear_pair, half_known])
def test_filters_with_functions_pickle(make):
    one = make()
    if make is linear_pair:
        one.residual_z = np.subtract
    other = pickle.loads(pickle.dumps(one))
    for name in ("residual_x", "residual_z", "state_add", "x_mean", "z_mean"):
        assert getattr(other, name, None) is getattr(one, name, None)
    for name in ("x", "P", "Q", "R", "y", "S", "K", "log_likelihood", "mahalanobis", "failed"):
        assert_array_equal(getattr(other, name), getattr(one, name))
    assert repr(other) == repr(one) and len(repr(one)) < 100


@pytest.mark.parametrize("name", ["Fs", "Hs", "Qs", "Rs"])
def test_items_of_a_sequence_are_refused_by_its_name_before_the_first_step(name):
    ours = KalmanFilter(2, 1)
    for item, error in ((np.ones((3, 3)), ValueError), ("x", TypeError)):
        with pytest.raises(error, match=f"^{name}: expected"):
            ours.batch_filter([1.0, 2.0], **{name: [None, item]})
    assert_array_equal(ours.P, np.eye(2))
    if name == "Qs":
        with pytest.raises(ValueError, match="^Qs: expected"):
            ours.rts_smoother(np.zeros((2, 2)), np.zeros((2, 2, 2)), Qs=[None, np.ones((3, 3))])


def test_sizes_and_switches_are_named():
    points = MerweScaledSigmaPoints(2)
    for make in (KalmanFilter, ExtendedKalmanFilter, lambda *sizes, **rest: UnscentedKalmanFilter(*sizes, 1.0, np.copy, np.copy, points, **rest)):
        for arguments, rest, name in (((2.5, 1), {}, "dim_x"), ((2, "1"), {}, "dim_z"), ((2, 1), {"batch": 1.5}, "batch")):
            with pytest.raises(TypeError, match=f"^{name}: expected an integer, got (float|str)"):
                make(*arguments, **rest)
    with pytest.raises(TypeError, match="^update_first: expected True or False, got int"):
        KalmanFilter(2, 1).batch_filter([1.0], update_first=1)
    with pytest.raises(TypeError, match="^redraw: expected True or False, got int"):
        UnscentedKalmanFilter(2, 1, 1.0, np.copy, np.copy, points, redraw=1)


@pytest.mark.parametrize("batch", [None, 3])
def test_no_measurements_are_smoothed_to_none(batch):
    points = MerweScaledSigmaPoints(2, 0.5, 2.0, 1.0)
    linear, extended = KalmanFilter(2, 1, batch=batch), ExtendedKalmanFilter(2, 1, batch=batch)
    unscented_one = UnscentedKalmanFilter(2, 1, 0.1, lambda x: x[..., :1], lambda x, dt: x, points, batch=batch)
    lead = () if batch is None else (batch,)
    for smooth in (linear.rts_smoother, unscented_one.rts_smoother, lambda *given: extended.rts_smoother(*given, lambda x: x)):
        for given in (linear.batch_filter([])[:2], ([], [])):
            smoothed, *matrices = smooth(*given)
            assert smoothed.shape == (0, *lead, 2)
            assert all(array.shape == (0, *lead, 2, 2) for array in matrices)
    with pytest.raises(ValueError, match="^Ps: expected 0 arrays of shape"):
        linear.rts_smoother([], np.zeros((1, *lead, 2, 2)))
