"""Points carried along by a field, with their covariance."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import jacoflow
from jacoflow import scenes

MOTION = {"u": 0.4, "v": -0.3, "u_x": 0.02, "v_x": 0.015, "u_y": -0.01, "v_y": 0.03}
MATRIX = np.array([[MOTION["u_x"], MOTION["u_y"]], [MOTION["v_x"], MOTION["v_y"]]])


def scene(**more):
    return scenes.Scene("affine", width=40, height=32, **MOTION, **more)


@pytest.fixture(scope="module")
def truth():
    """The true field of one frame, without covariance."""
    return scene().truth(0.0)


@pytest.fixture(scope="module")
def estimated():
    """An estimate with covariance, and the stack (T = 4) of a longer sequence."""
    frames = scene(random_state=4).frames(6)
    return jacoflow.flow(*frames[:3], method="windowed"), jacoflow.estimate(frames, method="windowed", ends="drop")


@pytest.fixture
def points():
    return np.random.default_rng(2).uniform((4, 4), (34, 26), (50, 2))


def test_affine_motion_is_exact(truth, points):
    site = truth.points[10, 12]
    flow = truth.flow[10, 12] + (points - site) @ MATRIX.T
    assert_allclose(truth.advect(points), points + flow, atol=1e-12)
    moved, covariance = truth.advect(points, np.zeros((2, 2)))
    assert_array_equal(moved, truth.advect(points))
    assert_array_equal(covariance, np.zeros((50, 2, 2)))


def test_a_site_moves_by_its_own_flow(estimated):
    field = estimated[0]
    sites = field.points[field.valid][::7]
    assert_allclose(field.advect(sites) - sites, field.flow[field.valid][::7], atol=1e-12)


def test_between_sites_of_a_coarse_grid_the_jacobian_counts():
    """A field on every fourth pixel is as exact for affine motion as a dense one; the bilinear mean of a
    curved one is not."""
    frames = list(scene(random_state=4).frames(3))
    coarse = jacoflow.flow(*frames, method="windowed", grid=jacoflow.SamplingGrid(stride=4, region=(4, 4, 29, 25)))
    assert np.isfinite(coarse.advect([[5.0, 5.5], [32.0, 28.0]])).all()
    assert np.isnan(coarse.advect([[3.9, 5.5], [32.1, 20.0], [20.0, 28.1]])).all()
    dense = jacoflow.flow(*frames, method="windowed")
    place = [[17.3, 14.8]]
    assert_allclose(coarse.advect(place), dense.advect(place), atol=0.02)


def test_covariance_against_monte_carlo(estimated):
    field = estimated[0]
    rng = np.random.default_rng(11)
    place = np.array([20.0, 16.0])
    spread = np.array([[0.09, 0.03], [0.03, 0.16]])
    _, got = field.advect(place[None], spread)
    starts = rng.multivariate_normal(place, spread, 20_000)
    errors = rng.multivariate_normal(np.zeros(2), field.covariance[16, 20][:2, :2], 20_000)
    jacobian = field.jacobian[16, 20]
    ends = starts + field.flow[16, 20] + (starts - place) @ jacobian.T + errors
    assert_allclose(got[0], np.cov(ends.T), rtol=0.05, atol=0.004)
    assert_allclose(got[0], got[0].T)
    step = np.eye(2) + jacobian
    assert_allclose(got[0], step @ spread @ step.T + field.covariance[16, 20][:2, :2], rtol=1e-9)


def test_a_model_without_derivatives_takes_the_slope_of_the_flow():
    frames = list(scene(random_state=4).frames(2))
    field = jacoflow.flow(*frames, method="lucas_kanade")
    _, spread = field.advect([[20.25, 16.5]], np.eye(2))
    moved = [field.advect([[20.25 + dx, 16.5 + dy]])[0] for dx, dy in ((0.01, 0), (-0.01, 0), (0, 0.01), (0, -0.01))]
    step = np.column_stack([(moved[0] - moved[1]) / 0.02, (moved[2] - moved[3]) / 0.02])
    least = step @ step.T
    assert (np.linalg.eigvalsh(spread[0] - least) > -1e-9).all()


def test_a_stack_carries_points_through_all_its_fields(estimated, points):
    stack = estimated[1]
    covariance = np.tile(0.01 * np.eye(2), (50, 1, 1))
    path, spread = stack.advect(points, covariance)
    assert path.shape == (5, 50, 2) and spread.shape == (5, 50, 2, 2)
    assert_array_equal(path[0], points)
    assert_array_equal(spread[0], covariance)
    here, matrices = points, covariance
    for index in range(4):
        here, matrices = stack[index].advect(here, matrices)
        assert_array_equal(path[index + 1], here)
        assert_array_equal(spread[index + 1], matrices)
    assert_array_equal(stack.advect(points), path)
    inside = np.isfinite(path[-1]).all(axis=-1)
    assert inside.any() and (np.trace(spread[-1][inside], axis1=1, axis2=2) > 0.02).all()


def test_what_left_the_field_stays_unknown():
    field = jacoflow.estimate(scene(random_state=4).frames(5), method="windowed", ends="drop")
    path = field.advect([[38.9, 30.9], [np.nan, 4.0], [-5.0, 4.0]])
    assert np.isnan(path[1:, 1:]).all() and np.isnan(path[-1]).any()


def test_no_points_are_no_mistake(truth, estimated):
    assert truth.advect(np.empty((0, 2))).shape == (0, 2)
    assert truth.advect([]).shape == (0, 2)
    assert estimated[1].advect([]).shape == (5, 0, 2)
    moved, covariance = truth.advect([], np.eye(2))
    assert moved.shape == (0, 2) and covariance.shape == (0, 2, 2)


def test_inputs_are_not_modified_and_any_numbers_are_taken(truth):
    points = np.array([[5, 6], [7, 8]])
    kept = points.copy()
    assert_array_equal(truth.advect(points), truth.advect(points.astype(float).tolist()))
    assert_array_equal(truth.advect(np.asfortranarray(points)), truth.advect(points[::1]))
    assert_array_equal(points, kept)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (([1.0, 2.0],), ValueError, r"points: expected shape \(N, 2\).*got \(2,\)"),
        ((np.zeros((3, 3)),), ValueError, "points: "),
        ((np.zeros((2, 2), complex),), TypeError, "points: expected real numbers"),
        ((["here"],), TypeError, "points: "),
        ((np.zeros((3, 2)), np.zeros((2, 2, 2))), ValueError, r"covariance: .*shape \(2, 2, 2\) for 3 points"),
        ((np.zeros((3, 2)), 1.0), ValueError, "covariance: "),
        ((np.zeros((3, 2)), [[1.0, 0.5], [0.0, 1.0]]), ValueError, "covariance: .*symmetric"),
        ((np.zeros((3, 2)), [[-1.0, 0.0], [0.0, 1.0]]), ValueError, "covariance: "),
        ((np.zeros((3, 2)), [[1.0, 2.0], [2.0, 1.0]]), ValueError, "covariance: "),
    ],
)
def test_mistakes_are_named(truth, arguments, error, message):
    with pytest.raises(error, match=message):
        truth.advect(*arguments)


def test_a_list_of_points_carries_nothing(texture):
    listed = jacoflow.flow(*texture, method="windowed", grid=jacoflow.SamplingGrid(points=[(10, 10), (20, 20)]))
    with pytest.raises(ValueError, match="field: expected one on a grid of pixels.*2 points"):
        listed.advect([[10.0, 10.0]])
