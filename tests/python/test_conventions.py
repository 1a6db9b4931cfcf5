"""What every estimator promises: axes, gain, memory layout, damage by NaN, threads, pickling."""

import pickle

import numpy as np
import pytest
from conftest import METHODS, moving_texture
from numpy.testing import assert_allclose, assert_array_equal

from grouped_options import grouped
import jacoflow
from jacoflow import Status, scenes


def planes(field):
    """Every array of a field."""
    return [field.flow, field.jacobian, field.covariance, field.status, field.residual, field.rank, field.condition, field.window]


def assert_same(one, other):
    for a, b in zip(planes(one), planes(other), strict=True):
        assert (a is None) == (b is None)
        if a is not None:
            assert_array_equal(a, b)


@pytest.mark.parametrize("method", ["windowed", "instantaneous"])
@pytest.mark.parametrize("parameter", ["u_x", "v_x", "u_y", "v_y"])
def test_each_derivative_shows_in_its_own_place(method, parameter):
    """A pure stretch along x gives only u_x, and so on: row, column and sign of the Jacobian."""
    names = ("u", "v", "u_x", "v_x", "u_y", "v_y")
    motion = [0.02 if name == parameter else 0.0 for name in names]
    if method == "instantaneous":
        # A quadratic picture is what the per-pixel method is exact on; its second differences are tiny, hence
        # float64.
        scene_motion = np.array(motion)
        y, x = np.mgrid[0:21, 0:21] - 10.0
        jacobian = np.array([[scene_motion[2], scene_motion[4]], [scene_motion[3], scene_motion[5]]])

        def frame(t):
            back = np.linalg.matrix_power(np.eye(2) - jacobian, t) if t >= 0 else np.linalg.inv(np.eye(2) - jacobian)
            px, py = back[0, 0] * x + back[0, 1] * y, back[1, 0] * x + back[1, 1] * y
            return 100 + 3 * px - 2 * py + 0.4 * px**2 + 0.15 * px * py + 0.3 * py**2

        field = jacoflow.flow(frame(-1), frame(0), frame(1), method=method)
        tolerance, site = 1e-3, (slice(10, 11), slice(11, 12))
    else:
        field = jacoflow.flow(*moving_texture(motion=motion, width=64, height=64), method=method)
        tolerance, site = 4e-3, (slice(20, 44), slice(20, 44))
    for name in names[2:]:
        value = np.median(getattr(field, name)[site])
        assert abs(value - (0.02 if name == parameter else 0.0)) < tolerance, name
    row, column = {"u_x": (0, 0), "u_y": (0, 1), "v_x": (1, 0), "v_y": (1, 1)}[parameter]
    assert_array_equal(field.jacobian[..., row, column], getattr(field, parameter))


@pytest.mark.parametrize("method", METHODS)
def test_flow_points_right_and_down(method):
    frames = moving_texture(motion=(0.4, 0, 0, 0, 0, 0))
    field = jacoflow.flow(*frames, method=method)
    if method == "instantaneous":
        field = jacoflow.flow(*frames, method=jacoflow.Instantaneous(model="translational", neighbourhood=(7, 7)))
    assert np.nanmedian(field.u) > 0.25 and abs(np.nanmedian(field.v)) < 0.1
    field = jacoflow.flow(*moving_texture(motion=(0, 0.4, 0, 0, 0, 0)), method="windowed")
    assert np.nanmedian(field.v) > 0.25 and abs(np.nanmedian(field.u)) < 0.1


@pytest.mark.parametrize("method", METHODS)
def test_sample_types_of_the_same_picture_give_the_same_flow(method, texture):
    fields = {
        "uint8": jacoflow.flow(*texture, method=method),
        "uint16": jacoflow.flow(*texture.astype(np.uint16) * 257, method=method),
        "float32": jacoflow.flow(*texture.astype(np.float32) / 255, method=method),
        "float64": jacoflow.flow(*texture / 255, method=method),
    }
    reference = fields["float64"]
    assert reference.flow.dtype == np.float64 and fields["uint8"].flow.dtype == np.float32
    for name, field in fields.items():
        scale = np.nanmedian(np.abs(reference.flow))
        if method == "instantaneous":
            # Ill-conditioned pixels amplify the rounding of float32: compare where the equations are well
            # determined.
            difference = np.abs(field.flow - reference.flow)[field.valid & reference.valid]
            assert np.median(difference) < 1e-3 * scale, name
            continue
        assert_array_equal(field.status, reference.status, err_msg=name)
        assert_allclose(field.flow, reference.flow, rtol=2e-3, atol=2e-3 * scale, err_msg=name)


@pytest.mark.parametrize("method", METHODS)
def test_memory_layout_does_not_matter(method, texture):
    reference = jacoflow.flow(*texture, method=method, diagnostics=True)
    wide = np.zeros((3, 80, 96), np.uint8)
    wide[:, ::2, ::2] = texture
    variants = {
        "strided": [frame[::2, ::2] for frame in wide],
        "fortran": [np.asfortranarray(frame) for frame in texture],
        "reversed": [np.ascontiguousarray(frame[::-1, ::-1])[::-1, ::-1] for frame in texture],
        "writable": [frame.copy() for frame in texture],
        "stack": texture,
        "transposed stack": np.ascontiguousarray(texture.transpose(2, 1, 0)).transpose(2, 1, 0),
    }
    for name, frames in variants.items():
        before = [np.array(frame) for frame in frames]
        field = jacoflow.estimate(frames, method=method, diagnostics=True, ends="drop")
        assert_same(field[0], reference)
        for now, then in zip(frames, before, strict=True):
            assert_array_equal(now, then, err_msg=f"{name}: the input was changed")


def test_misaligned_frames_are_read(texture):
    frames = texture.astype(np.float32)
    raw = np.zeros(frames.nbytes + 1, np.uint8)
    shifted = raw[1:].view(np.float32).reshape(frames.shape)
    shifted[...] = frames
    assert not shifted.flags.aligned
    assert_same(jacoflow.flow(*shifted), jacoflow.flow(*frames))


@pytest.mark.parametrize(("method", "reach"), [("windowed", 20), ("instantaneous", 1), ("lucas_kanade", 14)])
def test_a_block_of_nan_damages_only_what_touches_it(method, reach):
    frames = moving_texture(width=96, height=96)
    clean = jacoflow.flow(*frames, method=method)
    frames[1, 40:60, 40:60] = np.nan
    dirty = jacoflow.flow(*frames, method=method)
    far = np.ones((96, 96), bool)
    far[40 - reach : 60 + reach, 40 - reach : 60 + reach] = False
    assert_array_equal(dirty.flow[far], clean.flow[far])
    assert_array_equal(dirty.status[far], clean.status[far])
    assert (dirty.status[42:58, 42:58] == Status.NON_FINITE).all()
    assert np.isnan(dirty.flow[42:58, 42:58]).all()
    assert np.isnan(dirty.flow[~dirty.valid]).all() and np.isfinite(dirty.flow[dirty.valid]).all()


@pytest.mark.parametrize("method", METHODS)
def test_threads_do_not_change_a_bit(method, texture):
    one = jacoflow.estimate(texture, method=method, threads=1, diagnostics=True, ends="drop")
    two = jacoflow.estimate(texture, method=method, threads=2, diagnostics=True, ends="drop")
    assert_same(one, two)


def test_filter_threads_do_not_change_a_bit(texture):
    fields = []
    for threads in (1, 2):
        flow_filter = jacoflow.FlowFilter(threads=threads, profile=jacoflow.FilterProfile(form="non_augmented"))
        fields.append([flow_filter.push(frame) for frame in texture][-1])
    assert_same(*fields)


def double(points, dt):
    return points * (1 - dt)


def first(points):
    return points[..., :1]


def public_objects(texture):
    """One of every public class."""
    sigma = jacoflow.filters.MerweScaledSigmaPoints(2)
    estimator = jacoflow.FlowEstimator(grid=jacoflow.SamplingGrid(points=[[10, 10]]), method=jacoflow.Windowed(neighbourhood=(5, 3)), mask=np.ones((40, 48), bool))
    estimator.push(texture[0])
    return [
        jacoflow.estimate(texture, ends="drop"),
        jacoflow.flow(*texture, method=jacoflow.Instantaneous(model="translational"), grid=jacoflow.SamplingGrid(region=(4, 4, 30, 20), stride=3)),
        estimator,
        jacoflow.Status.OK,
        jacoflow.Condition.BOTH,
        jacoflow.observability(texture),
        jacoflow.classify([1, 2, 3, 4, 5, 6], [1, 0, 0, 0, 0, 0]),
        scenes.Scene("disc", width=32, height=32, carrier="speckle", rpm=10.0, random_state=4),
        scenes.Sensor(noise=2.0, rounding="nearest", saturate=True, random_state=1),
        sigma,
        jacoflow.filters.KalmanFilter(2, 1),
        jacoflow.filters.ExtendedKalmanFilter(2, 1, batch=3),
        jacoflow.filters.ParticleFilter(2, 30, batch=3, random_state=5),
        jacoflow.filters.UnscentedKalmanFilter(2, 1, 0.1, first, double, sigma),
        jacoflow.FormatError("x"),
        jacoflow.FlowFilter(profile="measured", grid=jacoflow.SamplingGrid(points=[[10, 10]])),
    ]


@pytest.mark.parametrize("protocol", [2, pickle.HIGHEST_PROTOCOL])
def test_everything_pickles(texture, protocol):
    for each in public_objects(texture):
        copy = pickle.loads(pickle.dumps(each, protocol))
        assert type(copy) is type(each)
        if isinstance(each, jacoflow.FlowField):
            assert_same(copy, each)
            assert_array_equal(copy.points, each.points)
            assert (copy.frame_index, copy.model, copy.parameters) == (each.frame_index, each.model, each.parameters)
        elif isinstance(each, scenes.Scene):
            assert_array_equal(copy.frame(1.5), each.frame(1.5))
        elif isinstance(each, scenes.Sensor):
            assert_array_equal(copy.apply(texture[0], 3), each.apply(texture[0], 3))
        elif isinstance(each, jacoflow.ObservabilityMap):
            assert_array_equal(copy.rank, each.rank)
        elif not isinstance(each, BaseException):
            assert repr(copy) == repr(each)


def test_views_share_memory_and_are_read_only(texture):
    stack = jacoflow.estimate(np.concatenate([texture, texture]), ends="drop")
    assert np.shares_memory(stack.flow, stack.u) and np.shares_memory(stack[2].jacobian, stack.jacobian)
    for array in (stack.flow, stack.jacobian, stack.status, stack[1].u):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.flags.writeable = True
    flow = stack[1].flow
    expected = flow.copy()
    del stack
    assert_array_equal(flow, expected)


def test_other_byte_orders_iterators_and_lists_of_four_are_taken():
    scene = scenes.Scene("affine", width=40, height=32)
    frames = scene.frames(3).astype(np.float32)
    plain = jacoflow.flow(*frames, grid=jacoflow.SamplingGrid(region=(4, 4, 20, 20)))
    swapped = jacoflow.flow(*frames.astype(">f4"), grid=jacoflow.SamplingGrid(region=[4, 4, 20, 20]))
    iterated = jacoflow.flow(*(frame for frame in frames), grid=jacoflow.SamplingGrid(region=np.array([4, 4, 20, 20])))
    assert_array_equal(swapped.flow, plain.flow)
    assert_array_equal(iterated.flow, plain.flow)


def test_value_objects_equal_their_copies():
    things = [
        scenes.Scene("vortex", width=30, height=20, core=5.0),
        scenes.Sensor(noise=2.0, random_state=3),
        jacoflow.filters.MerweScaledSigmaPoints(4, 0.5, 2.0, 0.0),
    ]
    others = [
        scenes.Scene("vortex", width=30, height=20, core=6.0),
        scenes.Sensor(noise=2.0, random_state=4),
        jacoflow.filters.MerweScaledSigmaPoints(4, 0.6, 2.0, 0.0),
    ]
    for thing, other in zip(things, others, strict=True):
        copy = pickle.loads(pickle.dumps(thing))
        assert copy == thing and hash(copy) == hash(thing) and thing != other and thing != 3


def test_a_field_is_true_and_a_stack_can_be_sliced():
    stack = jacoflow.estimate(scenes.Scene("affine", width=32, height=24).frames(6), ends="drop")
    assert stack and stack[0] and len(stack[1:3]) == 2 and len(stack[4:]) == 0
    assert_array_equal(stack[1:3].flow, stack.flow[1:3])
    assert_array_equal(pickle.loads(pickle.dumps(stack[1:3])).flow, stack.flow[1:3])
    assert stack[1:][0].frame_index == 2
    with pytest.raises(IndexError, match="step 1"):
        stack[::2]


@pytest.mark.parametrize("method", METHODS)
def test_a_pixel_without_data_damages_only_what_touches_it(method):
    """No-data values of 1e9 and more are usual; a threshold taken from the whole frame would hide everything
    else."""
    frames = moving_texture(width=96, height=96).astype(np.float32)
    clean = jacoflow.flow(*frames, method=method)
    frames[1, 50, 50] = 3e9
    dirty = jacoflow.flow(*frames, method=method)
    if method == "horn_schunck":
        assert dirty.valid.mean() > 0.9
        return
    far = np.ones((96, 96), bool)
    far[50 - 40 : 50 + 41, 50 - 40 : 50 + 41] = False
    assert_array_equal(dirty.status[far], clean.status[far])
    if method == "coarse_to_fine":
        # Scales of noise are those of the whole frame, and coarse levels see far.
        assert np.abs(dirty.flow[far] - clean.flow[far]).max() < 0.02
        return
    assert_array_equal(dirty.flow[far], clean.flow[far])


def bytes_of(width, height, seed):
    """Three frames as an 8-bit camera sees them."""
    return np.clip(np.round(moving_texture(width=width, height=height, seed=seed)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("options", [{}, {"method": "windowed"}, {"smooth": 1.5}, {"method": "instantaneous", "smooth": 1.0}, {"method": "horn_schunck", "smooth": 1.0}])
def test_what_lies_under_the_mask_does_not_matter(options):
    frames = bytes_of(64, 56, seed=4)
    mask = np.ones((56, 64), bool)
    mask[20:30, 25:40] = False
    others = np.where(mask, frames, 255 - frames).astype(np.uint8)
    one, other = (jacoflow.estimate(stack, mask=mask, **grouped(**options), ends="drop") for stack in (frames, others))
    assert_same(one, other)
    assert one.valid.mean() > 0.3
    filters = [jacoflow.FlowFilter(mask=mask, preprocess=jacoflow.Preprocess(smooth=1.0)) for _ in range(2)]
    for pair in zip(frames, others, strict=True):
        one, other = (filter.push(frame) for filter, frame in zip(filters, pair, strict=True))
        assert_array_equal(one.flow, other.flow)


def test_the_default_smoothing_may_be_written_out():
    frames = bytes_of(64, 56, seed=5)
    assert_same(jacoflow.estimate(frames, method="windowed", ends="drop"), jacoflow.estimate(frames, method="windowed", preprocess=jacoflow.Preprocess(smooth=1.5), ends="drop"))


@pytest.mark.parametrize("options", [{}, {"noise": 1.0}, {"noise": 1.0, "smooth": 0}])
def test_neither_axis_comes_first(options):
    frames = [frame.astype(float) for frame in bytes_of(64, 56, seed=6)]
    one = jacoflow.flow(*frames, **grouped(method="windowed", **options))
    other = jacoflow.flow(*[np.ascontiguousarray(frame.T) for frame in frames], **grouped(method="windowed", **options))
    known = one.valid & other.valid.T
    assert known.mean() > 0.5
    for name, mirrored in {"u": "v", "v": "u", "u_x": "v_y", "v_x": "u_y", "u_y": "v_x", "v_y": "u_x"}.items():
        assert_allclose(one.value(name)[known], other.value(mirrored).T[known], rtol=1e-6, atol=1e-9)
        assert_allclose(one.std(name)[known], other.std(mirrored).T[known], rtol=1e-6)


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_covariances_are_positive_definite_where_little_is_known(noise):
    """A grating leaves the motion along its lines open: the matrices are nearly singular, in single
    precision."""
    y, x = np.mgrid[:64, :72]
    camera = scenes.Sensor(noise=noise, rounding="nearest", saturate=True, random_state=2)
    gratings = [100 + 50 * np.sin((x + 0.7 * y - 0.3 * t) / 4) for t in (-1, 0, 1)]
    field = jacoflow.flow(*[camera.apply_u8(grating, index=k) for k, grating in enumerate(gratings)])
    covariance = field.covariance[field.valid].astype(float)
    assert len(covariance) > 1000 and field.covariance.dtype == np.float32
    scale = np.sqrt(np.einsum("nii->ni", covariance))
    assert np.linalg.eigvalsh(covariance / (scale[:, :, None] * scale[:, None, :])).min() > 0


def test_a_still_scene_has_the_deviation_of_rounding():
    frame = bytes_of(64, 56, seed=7)[0]
    field = jacoflow.flow(*([frame] * 3))
    deviation = field.std("u")[field.valid]
    assert abs(field.u[field.valid]).max() == 0 and 1e-4 < np.median(deviation) < 0.05 and deviation.min() > 0


@pytest.mark.parametrize("value", [3.4e38, 1e30])
def test_what_overflows_is_no_estimate(value):
    frames = [frame.astype(np.float32) for frame in bytes_of(96, 88, seed=8)]
    frames[1][40, 50] = value
    field = jacoflow.flow(*frames)
    assert np.isfinite(field.covariance[field.valid]).all() and field.valid.mean() > 0.3
