"""Flow from elsewhere: as the start of an estimate, and as a field of its own."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import logm

import jacoflow
from jacoflow import scenes

SHIFT = (132.0, -99.0)
"""Farther than blocks are searched for."""


def shifted(shift, state, size=400):
    """Speckle that moves by `shift` px everywhere."""
    still = dict.fromkeys(("u_x", "v_x", "u_y", "v_y"), 0.0)
    return scenes.Scene(
        "affine", width=size, height=size, random_state=state, carrier="speckle", u=shift[0], v=shift[1], **still
    )


def speckle_pair(shift, size=400, state=7):
    """Two frames of speckle moved by `shift` px, 8 bit with noise."""
    scene = shifted(shift, state, size)
    camera = scenes.Sensor(noise=1.0, rounding="nearest", saturate=True, random_state=state)
    return [camera.apply_u8(scene.frame(float(t)), index=t) for t in range(2)]


def constant(shift, size=400):
    return np.broadcast_to(np.array(shift, dtype=float), (size, size, 2)).copy()


def inner_error(field, shift, margin=140):
    """End-point errors of pixels that stay in the frame."""
    inner = slice(margin, -margin)
    return np.linalg.norm(np.asarray(field.flow)[inner, inner] - np.array(shift), axis=-1)


@pytest.fixture(scope="module")
def pair():
    return speckle_pair(SHIFT)


def test_a_motion_of_165_px_is_found_from_a_start_that_is_wrong_by_2(pair):
    plain = jacoflow.flow(*pair)
    assert np.median(inner_error(plain, SHIFT)) > 5, "the plain estimator misses it: nothing is shown"
    start = constant((SHIFT[0] + 1.6, SHIFT[1] - 1.2))
    start[::3, ::5] = np.nan
    field = jacoflow.flow(*pair, initial=start)
    error = inner_error(field, SHIFT)
    assert np.median(error) < 0.05 and np.mean(error > 0.5) < 0.01
    inner = slice(140, -140)
    assert np.median(field.std("u")[inner, inner]) < 0.2
    assert np.median(np.abs(field.jacobian[inner, inner])) < 0.01
    # What leaves the frame moves like what stays.
    assert np.median(np.linalg.norm(field.flow[:60, -80:] - SHIFT, axis=-1)) < 3
    # The result is a start, too.
    again = jacoflow.flow(*pair, initial=field)
    assert np.median(inner_error(again, SHIFT)) < 0.05


def test_three_frames_start_from_a_flow():
    shift = (-70.0, 45.0)
    scene = shifted(shift, 3)
    frames = [np.clip(np.rint(scene.frame(t)), 0, 255).astype(np.uint8) for t in (-1.0, 0.0, 1.0)]
    field = jacoflow.flow(*frames, initial=constant((shift[0] - 1.5, shift[1] + 1.0)))
    assert np.median(inner_error(field, shift)) < 0.05


def test_a_useless_start_changes_nothing():
    scene = scenes.Scene(
        "affine", width=192, height=160, random_state=11, carrier="noise", u=5.3, v=-3.1, u_y=0.02, v_x=-0.01
    )
    camera = scenes.Sensor(noise=1.0, rounding="nearest", saturate=True, random_state=11)
    frames = [camera.apply_u8(scene.frame(float(t)), index=t) for t in range(2)]
    truth = scene.truth(0.0, between=(0.0, 1.0)).flow
    random = np.random.default_rng(5)
    shape = (160, 192, 2)

    def error(**options):
        field = jacoflow.flow(*frames, **options)
        return np.sqrt(np.mean((field.flow - truth)[16:-16, 16:-16] ** 2))

    plain = error()
    for start in (
        np.zeros(shape),
        random.normal(0, 20, shape),
        np.full(shape, np.nan),
        np.full(shape, 1e30),
        np.broadcast_to([40.0, 40.0], shape),
    ):
        assert error(initial=start) < 1.05 * plain + 0.002


def test_starts_that_do_not_fit_are_refused_by_name(pair):
    with pytest.raises(ValueError, match=r"initial: expected shape \(H, W, 2\)"):
        jacoflow.estimate(pair, initial=np.zeros((400, 400)))
    with pytest.raises(ValueError, match="initial: expected a flow of the frames' size, 400 x 400, got 300 x 400"):
        jacoflow.estimate(pair, initial=np.zeros((400, 300, 2)))
    with pytest.raises(ValueError, match="initial: expected method coarse_to_fine, got windowed"):
        jacoflow.estimate(pair, method="windowed", initial=np.zeros((400, 400, 2)))
    stack = jacoflow.estimate(np.array([f[:64, :64] for f in (*pair, *pair)]), ends="drop")
    with pytest.raises(ValueError, match="initial: expected one field"):
        jacoflow.estimate(pair, initial=stack)


def affine_flow(height=60, width=80):
    """A rotation with expansion about the origin, and its Jacobian."""
    jacobian = np.array([[0.01, -0.03], [0.02, 0.005]])
    y, x = np.mgrid[:height, :width]
    return np.einsum("ij,hwj->hwi", jacobian, np.stack([x, y], axis=-1)), np.broadcast_to(
        jacobian, (height, width, 2, 2)
    )


def test_a_field_of_arrays_has_all_that_an_estimate_has():
    flow, jacobian = affine_flow()
    root = np.random.default_rng(1).normal(size=(6, 6)) * 0.01
    covariance = np.broadcast_to(root @ root.T, (*flow.shape[:2], 6, 6))
    field = jacoflow.FlowField.from_arrays(flow, covariance, jacobian)
    assert_allclose(field.flow, flow)
    assert_allclose(field.jacobian, jacobian)
    assert_allclose(field.covariance, covariance, atol=1e-15)
    assert_allclose(field.std("u"), np.sqrt(covariance[..., 0, 0]))
    rate = logm(np.eye(2) + jacobian[0, 0])
    # d trace log(I + J) = trace((I + J)^-1 dJ).
    gradient = np.concatenate([[0, 0], np.linalg.inv(np.eye(2) + jacobian[0, 0]).ravel()])
    assert_allclose(field.std("divergence"), np.sqrt(gradient @ covariance @ gradient))
    assert_allclose(field.value("curl"), rate[1, 0] - rate[0, 1])
    assert field.valid.all()
    moved = field.advect([[10.0, 20.0]])
    assert_allclose(moved[..., :2].reshape(-1, 2)[-1], [10, 20] + flow[20, 10], atol=1e-9)
    assert_allclose(field.region_mean("divergence", [10, 10, 30, 20])[0], np.trace(rate), atol=1e-9)


def test_flow_alone_makes_a_field():
    flow, _ = affine_flow()
    flow[5, 7] = np.nan
    variance = np.broadcast_to(np.diag([0.01, 0.04]), (*flow.shape[:2], 2, 2))
    field = jacoflow.FlowField.from_arrays(flow.astype(np.float32), variance)
    assert not field.valid[5, 7] and field.valid.sum() == flow[..., 0].size - 1
    assert_allclose(field.std("v")[field.valid], 0.2)
    assert np.all(field.jacobian[field.valid] == 0)
    assert jacoflow.FlowField.from_arrays(flow).covariance is None


def test_arrays_that_do_not_fit_are_refused_by_name():
    flow, jacobian = affine_flow()
    make = jacoflow.FlowField.from_arrays
    with pytest.raises(ValueError, match=r"flow: expected shape \(H, W, 2\)"):
        make(flow[..., 0])
    with pytest.raises(ValueError, match=r"jacobian: expected shape \(60, 80, 2, 2\)"):
        make(flow, jacobian=jacobian[:-1])
    with pytest.raises(ValueError, match=r"covariance: expected shape \(60, 80, 6, 6\)"):
        make(flow, np.zeros((60, 80, 2, 2)), jacobian)
    bad = [
        (-np.eye(2), "variances of at least 0, got a negative one"),
        (np.array([[1e-4, 2e-4], [2e-4, 1e-4]]), "positive semi-definite matrices, got an indefinite one"),
        (np.diag([1e-4, np.nan]), "finite values where the flow is known, got another"),
    ]
    for matrix, words in bad:
        covariance = np.tile(1e-4 * np.eye(2), (60, 80, 1, 1))
        covariance[3, 4] = matrix
        with pytest.raises(ValueError, match=rf"^covariance: expected {words} at pixel \(4, 3\)"):
            make(flow, covariance)
    with pytest.raises(ValueError, match="interval: expected one of forward, central, instant"):
        make(flow, interval="backward")


def test_what_is_masked_is_unknown():
    flow = np.ma.masked_greater(np.arange(24.0).reshape(3, 4, 2), 20)
    covariance = np.ma.masked_array(np.tile(np.eye(2), (3, 4, 1, 1)))
    covariance[2, 2:] = np.ma.masked
    field = jacoflow.FlowField.from_arrays(flow, covariance)
    assert list(np.flatnonzero(~field.valid)) == [10, 11]
    assert np.all(field.std("u")[field.valid] == 1)
    with pytest.raises(ValueError, match=r"^covariance: expected finite values where the flow is known, got another at pixel \(2, 2\)"):
        jacoflow.FlowField.from_arrays(flow.data, covariance)


def test_arrays_say_over_which_time_the_flow_is_taken():
    # An enlargement by 1.2 a frame, as a step forward and as the mean of two steps.
    y, x = np.mgrid[:20, :30].astype(float)
    rates = {"forward": 0.2, "central": (1.2 - 1 / 1.2) / 2, "instant": np.log(1.2)}
    for interval, rate in rates.items():
        jacobian = np.broadcast_to(rate * np.eye(2), (20, 30, 2, 2))
        field = jacoflow.FlowField.from_arrays(rate * np.stack([x, y], -1), None, jacobian, interval=interval)
        assert_allclose(field.divergence, 2 * np.log(1.2), rtol=1e-12)


def test_an_infinite_initial_flow_is_refused():
    frames = jacoflow.scenes.Scene("affine", width=40, height=30, u=0.5).frames(2)
    initial = np.zeros((30, 40, 2))
    initial[3, 4, 1] = np.inf
    with pytest.raises(ValueError, match="^initial: expected a finite flow"):
        jacoflow.flow(*frames, initial=initial)


def test_motion_from_somebody_elses_flow():
    """A camera that approaches slanted ground: the field of arrays is as good as an estimate."""
    height, width, focal = 96, 128, 100.0
    y, x = np.mgrid[:height, :width] - np.array([height / 2, width / 2])[:, None, None]
    depth = 10.0 + 0.04 * x + 2.0 * np.sin(x / 15) * np.cos(y / 12)
    translation = np.array([0.05, -0.02, 0.2])
    along = [(coordinate * translation[2] - focal * t) / depth for coordinate, t in ((x, translation[0]), (y, translation[1]))]
    flow = np.stack(along, axis=-1) + np.random.default_rng(2).normal(0, 0.01, (height, width, 2))
    covariance = np.broadcast_to(1e-4 * np.eye(2), (height, width, 2, 2))
    field = jacoflow.FlowField.from_arrays(flow, covariance)
    camera = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    found, _ = jacoflow.motion3d.estimate_field_motion(field, camera)
    direction = found.translation / np.linalg.norm(found.translation)
    assert abs(direction @ translation) / np.linalg.norm(translation) > 0.99
