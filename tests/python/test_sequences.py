"""One field from a pair or a triple, T fields from T frames; units, times and double frames."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import jacoflow
from jacoflow import Status

U = 1.5


@pytest.fixture(scope="module")
def frames():
    scene = jacoflow.scenes.Scene("affine", width=72, height=56, random_state=3, u=U, v=-0.5, u_x=0.0, u_y=0.0, v_x=0.0, v_y=0.0)
    return scene.frames(6)


def inner(array):
    return np.asarray(array)[..., 12:-12, 12:-12]


@pytest.mark.parametrize("container", [np.stack, list, tuple, iter])
@pytest.mark.parametrize("count", [2, 3, 6])
def test_t_frames_give_t_fields_in_any_container(frames, container, count):
    field = jacoflow.estimate(container(frames[:count]))
    assert field.shape == (count, 56, 72) and field.frame_index == 0
    assert_allclose(inner(field.u)[:-1], U, atol=0.02)
    assert (field.status[-1] == Status.MISSING_FRAME).all() and np.isnan(field.u[-1]).all() and not field.valid[-1].any()
    dropped = jacoflow.estimate(container(frames[:count]), ends="drop")
    assert dropped.shape == (max(count - 2, 1), 56, 72) and dropped.frame_index == (0 if count == 2 else 1)
    first = dropped.frame_index
    assert_array_equal(dropped.flow, field.flow[first : first + len(dropped)])


def test_a_pair_and_a_triple_give_one_field(frames):
    pair, triple = jacoflow.flow(*frames[:2]), jacoflow.flow(*frames[:3])
    assert pair.shape == triple.shape == (56, 72) and (pair.frame_index, triple.frame_index) == (0, 1)
    assert_array_equal(pair.flow, jacoflow.estimate(frames[:2])[0].flow)
    assert_array_equal(triple.flow, jacoflow.estimate(frames[:3])[1].flow)


def test_methods_of_the_middle_frame_miss_both_ends(frames):
    field = jacoflow.estimate(frames, method="windowed")
    missing = (field.status == Status.MISSING_FRAME).all(axis=(1, 2))
    assert_array_equal(missing, [True, False, False, False, False, True])


def test_mistakes_are_named(frames):
    a, b, c, d = frames[:4]
    with pytest.raises(TypeError, match=r"jacoflow\.flow\(a, b\)"):
        jacoflow.estimate(a, b)
    with pytest.raises(ValueError, match="^ends: expected"):
        jacoflow.estimate(frames, ends="pad")
    with pytest.raises(ValueError, match="^frames: expected at least 2 frames, got 1 frame"):
        jacoflow.estimate([a])
    with pytest.raises(ValueError, match="^frames: expected 3 frames"):
        jacoflow.flow(a, b, method="instantaneous")
    with pytest.raises(TypeError):
        jacoflow.flow(a, b, c, d)


def test_displacement_accumulates_from_the_first_frame(frames):
    field = jacoflow.estimate(frames)
    paths = field.advect([[20.0, 28.0], [30.0, 30.0]])
    assert paths.shape == (6, 2, 2)
    assert_allclose(paths[:, 0, 0], 20 + U * np.arange(6), atol=0.05)


def test_double_frames_have_a_field_a_pair(frames):
    # The second recording is another scene: between the pairs there is no motion.
    other = np.ascontiguousarray(frames[:2, ::-1])
    field = jacoflow.estimate(np.concatenate([frames[:2], other]), pairs=True)
    assert field.shape == (2, 56, 72)
    assert_allclose(inner(field.u), U, atol=0.02)
    assert_allclose(inner(field.v[1]), 0.5, atol=0.02)
    with pytest.raises(ValueError, match="^frames: expected an even number"):
        jacoflow.estimate(frames[:3], pairs=True)
    with pytest.raises(ValueError, match="^pairs: "):
        jacoflow.estimate(frames, pairs=True, method="instantaneous")


def test_every_rate_is_per_second_and_every_length_in_its_unit(frames):
    plain = jacoflow.flow(*frames[:3])
    metric = jacoflow.flow(*frames[:3], fps=50.0, pixel_pitch=0.02, length_unit="mm")
    assert [metric.unit(name) for name in ("u", "u_x", "speed", "curl", "rotation_centre_x", "time_to_contact")] == ["mm/s", "1/s", "mm/s", "1/s", "mm", "s"]
    assert [plain.unit(name) for name in ("u", "u_x", "speed", "curl", "rotation_centre_x", "time_to_contact")] == ["px/frame", "1/frame", "px/frame", "1/frame", "px", "frame"]
    assert_allclose(metric.u, plain.u * np.float32(0.02 * 50), rtol=1e-5)
    assert_allclose(metric.std("u"), plain.std("u") * (0.02 * 50), rtol=1e-5)
    assert_allclose(metric.speed, np.hypot(metric.u, metric.v), rtol=1e-6)
    assert_allclose(metric.curl, plain.curl * 50, rtol=1e-4, atol=1e-4)
    assert_allclose(metric.measure("u").value, plain.measure("u").value, rtol=1e-6)
    # What counts pixels and frames converts by itself.
    start = [[30.0, 30.0]]
    assert_allclose(metric.advect(start), plain.advect(start), rtol=1e-6)
    with pytest.raises(ValueError, match="^length_unit: expected a pixel_pitch"):
        jacoflow.flow(*frames[:2], length_unit="mm")


def test_units_survive_files_and_pickles(frames, tmp_path):
    field = jacoflow.flow(*frames[:3], fps=50.0, pixel_pitch=0.02, length_unit="mm")
    field.save(tmp_path / "field.npz")
    field.save(tmp_path / "field.flo")
    for again in (jacoflow.FlowField.load(tmp_path / "field.npz"), pickle.loads(pickle.dumps(field))):
        assert (again.unit("u"), again.interval, again.frame_period) == ("mm/s", "forward", 0.02)
        assert_array_equal(again.curl, field.curl)
    assert_allclose(inner(jacoflow.io.read_flo(tmp_path / "field.flo")[..., 0].T).T, inner(field.u) / np.float32(0.02 * 50), rtol=1e-4)


def test_pictures_have_the_units_of_the_field(frames):
    pytest.importorskip("matplotlib").use("Agg")
    field = jacoflow.flow(*frames[:3], fps=50.0, pixel_pitch=0.02, length_unit="mm")
    axes = jacoflow.plot.flow_colour(field)
    assert "mm/s" in axes.child_axes[0].get_title()
    figure = jacoflow.plot.curl(field).get_figure()
    assert figure.axes[1].get_ylabel() == "1/s"


def test_times_of_frames_decide_rates(frames):
    # Frame 3 was lost: its neighbours are two periods apart.
    kept, period = [0, 1, 2, 4, 5], 0.04
    estimator = jacoflow.FlowEstimator()
    found = {}
    for index in kept:
        field = estimator.push(frames[index], time=1.0 + period * index)
        if field is not None:
            found[field.frame_index] = field
        estimator = pickle.loads(pickle.dumps(estimator))
    assert sorted(found) == [1, 2, 3]
    for field in found.values():
        assert field.unit("u") == "px/s"
        assert_allclose(inner(field.u), U / period, rtol=0.02)
    assert_allclose([found[k].frame_period for k in (1, 2, 3)], [period, 2 * period, period])


def test_backward_differences_go_by_the_last_step():
    """Steady motion; the second difference knows nothing of uneven steps."""
    motion = {"u": 5.0, "v": -2.0, "u_x": 0.0, "u_y": 0.0, "v_x": 0.0, "v_y": 0.0}
    scene = jacoflow.scenes.Scene("affine", width=96, height=72, **motion)
    estimator = jacoflow.FlowEstimator(method=jacoflow.Windowed(time_scheme="backward"))
    rng, times = np.random.default_rng(1), [0.0, 0.1, 0.2, 0.3, 0.37, 0.55, 0.6, 0.65]
    fields = [estimator.push(scene.frame(time) + rng.normal(size=(72, 96)), time=time) for time in times][2:]
    assert_allclose([field.frame_period for field in fields], np.diff(times)[1:], rtol=1e-9)
    assert_allclose([np.median(inner(field.u)) for field in fields], 5.0, rtol=0.2)


def test_fields_of_a_stack_are_those_of_their_frames(frames):
    """Index, time and correlation length too: the first field is that of a pair."""
    stack, first, later = jacoflow.estimate(frames[:4]), jacoflow.flow(*frames[:2]), jacoflow.flow(*frames[:3])
    for again in (stack, pickle.loads(pickle.dumps(stack))):
        assert [again[0].correlation_length, again[1].correlation_length] == [first.correlation_length, later.correlation_length]
        assert again[1].measure("u").std == later.measure("u").std
        assert again.frame_index == 0 and again[1:].frame_index == 1
    assert [field.frame_index for field in jacoflow.estimate(frames[:4], pairs=True)] == [0, 2]


def test_times_that_cannot_be_are_refused(frames):
    estimator = jacoflow.FlowEstimator()
    estimator.push(frames[0], time=2.0)
    for time, words in ((2.0, "after 2 s"), (np.nan, "finite"), (None, "every frame")):
        with pytest.raises(ValueError, match="^time: ") as error:
            estimator.push(frames[1], time=time)
        assert words in str(error.value)
    assert estimator.frames_pushed == 1


def test_a_lost_frame_costs_its_two_steps_only(frames):
    holed = frames.astype(np.float32)
    holed[2] = np.nan
    field = jacoflow.estimate(holed)
    for k in (0, 3, 4):
        assert_allclose(inner(field.u[k]), U, atol=0.02)
    for k in (1, 2):
        assert np.isnan(field.u[k]).all() and not field.valid[k].any()


@pytest.mark.parametrize("shown", ["a half that the third does not show", "a twentieth"])
def test_a_frame_that_shows_little_of_the_others_is_as_good_as_lost(frames, shown):
    first, third = (np.ones(frames[0].shape, bool) for _ in range(2))
    if shown == "a twentieth":
        first = np.random.default_rng(1).random(first.shape) < 0.05
    else:
        first[:, 30:], third[:, :30] = False, False
    before, middle, after = frames[:3].astype(np.float32)
    before, after = np.where(first, before, np.nan), np.where(third, after, np.nan)
    triple, pair = jacoflow.flow(before, middle, after), jacoflow.flow(middle, after)
    assert pair.valid.mean() > 0.4
    assert_array_equal(triple.u, pair.u)


def test_masks_may_move(frames):
    hidden = np.zeros(frames.shape, bool)
    for k in range(len(frames)):
        hidden[k, 20:30, 10 + 4 * k : 20 + 4 * k] = True
    field = jacoflow.estimate([np.ma.masked_array(frame, mask) for frame, mask in zip(frames, hidden, strict=True)])
    whole = jacoflow.estimate(frames)
    far = np.zeros(field.shape[1:], bool)
    far[40:50, 12:60] = True
    for k in range(5):
        assert np.isnan(field.u[k][hidden[k]]).all()
        assert_allclose(field.u[k][far], whole.u[k][far], atol=0.02)
