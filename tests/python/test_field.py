"""The result object: arrays, derived quantities with their spread, points and regions, files."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import logm

import jacoflow
from jacoflow import FlowField, Status, scenes


def rate(m):
    """The rate of the motion that makes the step, [[L_xx, L_xy], [L_yx, L_yy]], 1/frame."""
    return logm(np.eye(2) + np.array([[m[2], m[4]], [m[3], m[5]]])).real


def of_rate(formula):
    return lambda m: formula(*rate(m).ravel())


QUANTITIES = {
    "divergence": of_rate(lambda xx, xy, yx, yy: xx + yy),
    "curl": of_rate(lambda xx, xy, yx, yy: yx - xy),
    "shear_magnitude": of_rate(lambda xx, xy, yx, yy: np.hypot(xx - yy, xy + yx)),
    "shear_axis": of_rate(lambda xx, xy, yx, yy: 0.5 * np.arctan2(xy + yx, xx - yy)),
    "angular_velocity": of_rate(lambda xx, xy, yx, yy: 0.5 * (yx - xy)),
    "speed": lambda m: np.hypot(m[0], m[1]),
    "time_to_contact": of_rate(lambda xx, xy, yx, yy: 1 / (1 - np.exp(-(xx + yy) / 2))),
    "centre_distance": lambda m: np.linalg.norm(np.linalg.solve([[m[2], m[4]], [m[3], m[5]]], m[:2])),
}
NAMES = ("u", "v", "u_x", "v_x", "u_y", "v_y")


@pytest.fixture(scope="module")
def field():
    return jacoflow.flow(*scenes.Scene("affine", width=56, height=48, random_state=2).frames(3), diagnostics=True)


def test_shapes_and_kinds(field):
    assert field.shape == (48, 56)
    assert field.flow.shape == (48, 56, 2) and field.jacobian.shape == (48, 56, 2, 2)
    assert field.covariance.shape == (48, 56, 6, 6)
    assert field.status.dtype == np.uint8 and field.valid.dtype == bool
    assert field.rank.shape == field.condition.shape == field.residual.shape == (48, 56)
    assert field.points.shape == (48, 56, 2) and tuple(field.points[5, 7]) == (7, 5)
    assert (field.frame_index, field.frame_size, field.model) == (1, (56, 48), "affine")
    assert field.parameters == NAMES
    assert repr(field).startswith('FlowField(shape=(48, 56), model="affine", dtype=float64, frame_index=1, valid=')
    with pytest.raises(TypeError, match="single field"):
        len(field)
    with pytest.raises(TypeError, match="single field"):
        field[0]


def test_flow_and_jacobian_hold_the_planes(field):
    for axis, name in enumerate("uv"):
        assert_array_equal(field.flow[..., axis], getattr(field, name))
    matrix = [[field.u_x, field.u_y], [field.v_x, field.v_y]]
    for row in range(2):
        for column in range(2):
            assert_array_equal(field.jacobian[..., row, column], matrix[row][column])


@pytest.mark.parametrize("name", QUANTITIES)
def test_derived_quantities_and_their_spread(field, name):
    """Values by their formula; spread against the covariance carried through a numerical gradient."""
    site = (24, 28)
    motion = np.array([getattr(field, n)[site] for n in NAMES])
    function = QUANTITIES[name]
    assert_allclose(getattr(field, name)[site], function(motion), rtol=1e-9)
    assert_array_equal(field.value(name), getattr(field, name))
    steps = 1e-6 * np.eye(6)
    gradient = np.array([(function(motion + step) - function(motion - step)) / 2e-6 for step in steps])
    expected = np.sqrt(gradient @ field.covariance[site] @ gradient)
    assert_allclose(field.std(name)[site], expected, rtol=1e-4)


def test_parameters_have_values_and_spread_too(field):
    for index, name in enumerate(NAMES):
        assert_array_equal(field.value(name), getattr(field, name))
        valid = field.valid
        assert_allclose(field.std(name)[valid], np.sqrt(field.covariance[valid][:, index, index]), rtol=1e-12)
    assert field.unit("u") == "px/frame" and field.unit("divergence") == "1/frame"


def test_rotation_centre():
    frames = scenes.Scene("ramp", width=40, height=40, origin=(10, 20)).frames(3)
    field = jacoflow.flow(*frames, method="instantaneous", fps=100.0)
    inside = (slice(2, -2), slice(2, -2))
    assert_allclose(field.rotation_centre[inside], np.broadcast_to([-10.0, -20.0], (36, 36, 2)), atol=1e-3)
    assert_allclose(field.rpm[inside], 100 * 60 / 200, rtol=1e-4)
    assert_allclose(field.angular_velocity[inside], 100 * np.pi / 100, rtol=1e-4)
    assert field.unit("angular_velocity") == "rad/s"
    value, std, count = field.region_mean("rpm", (5, 5, 20, 20))
    assert abs(value - 30) < 0.01 and std >= 0 and count == 400
    median, _, _ = field.region_mean("rpm", aggregate="median")
    assert abs(median - 30) < 0.01


@pytest.mark.parametrize(("count", "smooth", "least"), [(3, None, 0.5), (3, 1.5, 0.1), (2, None, 0.5)])
def test_the_deviation_of_a_regions_mean_holds_its_error(count, smooth, least):
    """Neighbouring estimates share pixels: 1,600 of them are not 1,600 independent ones. Of smoothed frames
    deviations are stated on the wide side."""
    motion = dict(u=0.1, v=0.05, u_x=0.003, v_x=0.006, u_y=-0.006, v_y=0.003)
    ratios = []
    for texture in range(4):
        scene = scenes.Scene("affine", width=72, height=72, random_state=texture, **motion)
        clean, truth = [scene.frame(t) for t in (-1.0, 0.0, 1.0)], scene.truth(0.0, between=(0.0, 1.0))
        for seed in range(12):
            camera = scenes.Sensor(noise=3.0, random_state=seed)
            frames = [camera.apply(frame, index) for index, frame in enumerate(clean)][3 - count :]
            seen = jacoflow.flow(*frames, preprocess=jacoflow.Preprocess(smooth=smooth))
            for name in ("divergence", "curl"):
                value, std, sites = seen.region_mean(name, (16, 16, 40, 40))
                assert sites == 1600
                ratios.append((value - truth.value(name)[36, 36]) / std)
    spread = np.sqrt(np.mean(np.square(ratios)))
    print(f"error of a region's mean over its deviation: {spread:.3f}")
    assert least < spread < 1.2


@pytest.mark.parametrize("name", ["affine", "plane"])
def test_the_deviation_of_a_regions_mean_holds_the_bias_of_clean_frames(name):
    """Without noise all estimates are biased alike; averaging does not help, and the deviation may not
    pretend so."""
    ratios = []
    for seed in range(4):
        scene = scenes.Scene(name, width=96, height=96, random_state=seed)
        camera = scenes.Sensor(noise=0.0, rounding="nearest", saturate=True)
        seen = jacoflow.flow(*[camera.apply_u8(scene.frame(t), index=k) for k, t in enumerate((-1.0, 0.0, 1.0))])
        truth = scene.truth(0.0, between=(0.0, 1.0))
        value, std, _ = seen.region_mean("divergence", (16, 16, 64, 64))
        ratios.append((value - truth.value("divergence")[48, 48]) / std)
        assert std < 0.6 * np.nanmedian(seen.std("divergence"))
    # Deviations of such small frames are told on the wide side, but they are no blank cheque.
    assert 0.05 < np.sqrt(np.mean(np.square(ratios))) < 1.5


def test_a_regions_mean_of_a_parameter(field):
    value, std, count = field.region_mean("u", (8, 8, 4, 4))
    window = field.value("u")[8:12, 8:12]
    assert window.min() <= value <= window.max() and std > 0 and count == 16
    with pytest.raises(ValueError, match="^name: expected one of u, v, "):
        field.region_mean("w")


def test_what_cannot_be_asked(field):
    with pytest.raises(ValueError, match="name: expected one of u, v, "):
        field.value("beauty")
    with pytest.raises(ValueError, match="quantity: |frame period|fps"):
        field.rpm  # noqa: B018
    bare = jacoflow.flow(*scenes.Scene("affine", width=32, height=32).frames(3), covariance=False)
    assert bare.covariance is None and bare.residual is None and bare.rank is None
    with pytest.raises(ValueError, match="covariance=True"):
        bare.std("u")
    with pytest.raises(ValueError, match="aggregate: "):
        field.region_mean("divergence", aggregate="mode")
    with pytest.raises(ValueError, match="region: "):
        field.region_mean("divergence", (-1, 0, 3, 3))


def test_frame_rate_and_pixel_pitch_scale_results():
    frames = list(scenes.Scene("affine", width=48, height=48).frames(3))
    plain = jacoflow.flow(*frames)
    scaled = jacoflow.flow(*frames, fps=1 / 0.5, pixel_pitch=(2.0, 4.0))
    inside = plain.valid
    assert_allclose(scaled.u[inside], 2 * plain.u[inside] / 0.5, rtol=1e-9)
    assert_allclose(scaled.v[inside], 4 * plain.v[inside] / 0.5, rtol=1e-9)
    assert_allclose(scaled.u_y[inside], plain.u_y[inside] * 2 / 4 / 0.5, rtol=1e-9)
    assert_allclose(scaled.v_x[inside], plain.v_x[inside] * 4 / 2 / 0.5, rtol=1e-9)
    assert_allclose(scaled.divergence[inside], plain.divergence[inside] / 0.5, rtol=1e-9)
    assert (scaled.frame_period, scaled.pixel_pitch) == (0.5, (2.0, 4.0))


@pytest.mark.parametrize("method", ["windowed", "instantaneous"])
def test_points_regions_and_strides_are_parts_of_the_whole(method):
    frames = list(scenes.Scene("affine", width=48, height=40).frames(3))
    whole = jacoflow.flow(*frames, method=method)
    pixels = np.array([[5, 4], [20, 30], [47, 39], [0, 0]])
    points = jacoflow.flow(*frames, method=method, grid=jacoflow.SamplingGrid(points=pixels))
    assert points.shape == (4,) and points.flow.shape == (4, 2) and points.covariance.shape == (4, 6, 6)
    assert_array_equal(points.points, pixels)
    region = jacoflow.flow(*frames, method=method, grid=jacoflow.SamplingGrid(region=(10, 6, 20, 12)))
    strided = jacoflow.flow(*frames, method=method, grid=jacoflow.SamplingGrid(stride=4))
    strided_region = jacoflow.flow(*frames, method=method, grid=jacoflow.SamplingGrid(region=(3, 2, 30, 21), stride=5))
    for part in (points, region, strided, strided_region):
        x, y = part.points[..., 0], part.points[..., 1]
        assert_array_equal(part.status, whole.status[y, x])
        assert_allclose(part.flow, whole.flow[y, x], rtol=1e-6, atol=1e-9)
    assert region.shape == (12, 20) and strided.shape == (10, 12) and strided_region.shape == (5, 6)
    none = jacoflow.flow(*frames, method=method, grid=jacoflow.SamplingGrid(points=np.zeros((0, 2), int)))
    assert none.shape == (0,) and none.flow.shape == (0, 2) and none.divergence.shape == (0,)


def test_masked_pixels_say_so():
    frames = list(scenes.Scene("affine", width=48, height=48).frames(3))
    mask = np.ones((48, 48), bool)
    mask[20:30, 20:30] = False
    for method in ("windowed", "instantaneous"):
        field = jacoflow.flow(*frames, method=method, mask=mask)
        assert (field.status[22:28, 22:28] == Status.MASKED).all()
        assert np.isnan(field.flow[22:28, 22:28]).all()


def test_other_models_leave_derivatives_zero():
    frames = list(scenes.Scene("affine", width=40, height=40, u_x=0, v_x=0, u_y=0, v_y=0).frames(3))
    field = jacoflow.flow(*frames, method=jacoflow.Instantaneous(model="translational", neighbourhood=(5, 5)))
    assert field.parameters == ("u", "v") and field.model == "translational"
    assert (field.jacobian[field.valid] == 0).all() and np.isnan(field.jacobian[~field.valid]).all()
    assert field.covariance.shape == (40, 40, 6, 6)
    accelerating = jacoflow.flow(*frames, method=jacoflow.Instantaneous(model="accelerating", neighbourhood=(5, 5)))
    assert accelerating.parameters[2:] == ("u_t", "v_t")
    assert accelerating.value("u_t").shape == accelerating.std("v_t").shape == (40, 40)


def test_minimum_norm_is_marked():
    frames = list(np.tile(np.arange(20.0), (3, 20, 1)))
    field = jacoflow.flow(*frames, method=jacoflow.Instantaneous(rank_deficient="min_norm"))
    assert (field.status[2:-2, 2:-2] == Status.MIN_NORM).all()
    assert np.isfinite(field.flow[2:-2, 2:-2]).all() and not field.valid.any()


def test_status_codes_are_those_of_the_core():
    from jacoflow import _jacoflow

    assert [status.name.lower() for status in Status] == list(_jacoflow._status_names())


@pytest.mark.parametrize("extension", ["npz", "flo", "png", "pfm"])
def test_files_round_trip(field, tmp_path, extension):
    path = tmp_path / f"field.{extension}"
    field.save(path)
    back = FlowField.load(path)
    assert_array_equal(back.valid, field.valid)
    if extension == "npz":
        assert back.flow.dtype == field.flow.dtype
        for name in ("flow", "jacobian", "covariance", "status", "residual", "rank", "condition", "window"):
            assert_array_equal(getattr(back, name), getattr(field, name))
        assert np.load(path)["jacobian"].shape == (48, 56, 2, 2)
    else:
        tolerance = 1 / 128 + 1e-6 if extension == "png" else 1e-6
        assert_allclose(back.flow, np.where(field.valid[..., None], field.flow, np.nan), atol=tolerance)
    single = jacoflow.flow(*scenes.Scene("affine", width=32, height=32).frames(3).astype(np.float32))
    single.save(path)
    assert FlowField.load(path).flow.dtype == np.float32


def test_points_and_stacks_go_to_npz(tmp_path):
    frames = scenes.Scene("affine", width=32, height=32).frames(4)
    points = jacoflow.flow(*frames[:3], grid=jacoflow.SamplingGrid(points=[[3, 4], [10, 11]]))
    points.save(tmp_path / "points.npz")
    back = FlowField.load(tmp_path / "points.npz")
    assert_array_equal(back.points, points.points)
    assert_array_equal(back.flow, points.flow)
    stack = jacoflow.estimate(frames, ends="drop")
    stack.save(tmp_path / "stack")
    names = sorted(path.name for path in (tmp_path / "stack").iterdir())
    assert names == ["flow_000001.npz", "flow_000002.npz"]
    assert_array_equal(FlowField.load(tmp_path / "stack" / names[1]).flow, stack[1].flow)
    with pytest.raises(ValueError, match="path: "):
        stack.save(tmp_path / "stack.npz")


def test_a_stack_is_saved_in_parts_and_over_a_longer_run(tmp_path):
    stack = jacoflow.estimate(scenes.Scene("affine", width=32, height=32).frames(6))
    for first in (0, 2, 4):
        stack[first : first + 2].save(tmp_path / "run")
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == [f"flow_{k:06}.npz" for k in range(6)]
    stack[:2].save(tmp_path / "run")
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["flow_000000.npz", "flow_000001.npz"]


def test_indexing_a_stack():
    stack = jacoflow.estimate(scenes.Scene("affine", width=32, height=32).frames(5), ends="drop")
    assert len(stack) == 3 and stack.flow.shape == (3, 32, 32, 2)
    assert_array_equal(stack[-1].flow, stack.flow[2])
    assert [field.frame_index for field in stack] == [1, 2, 3]
    with pytest.raises(IndexError, match="index 3"):
        stack[3]
    for index in (2**63, -(2**63) - 1):
        with pytest.raises(IndexError, match=f"^index {index}: the stack has 3 fields"):
            stack[index]
    with pytest.raises(TypeError, match="^index: expected an integer or a slice, got list"):
        stack[[0, 2]]
