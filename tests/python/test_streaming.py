"""Streams: the same as batches, resumed from pickles and files, told about and stopped."""

import os
import pickle
import signal
import threading

import numpy as np
import pytest
from conftest import METHODS
from numpy.testing import assert_array_equal

from grouped_options import grouped
import jacoflow
from jacoflow import FlowEstimator, FlowFilter, scenes

FORMS = ["augmented", "non_augmented", "fast", "extended"]


@pytest.fixture(scope="module")
def frames():
    return scenes.Scene("affine", width=40, height=32, random_state=5).frames(6)


@pytest.mark.parametrize("method", METHODS)
def test_stream_equals_batch(frames, method):
    batch = jacoflow.estimate(frames, method=method, ends="drop")
    estimator = FlowEstimator(method=method)
    assert estimator.frames_needed == 3
    stream = [estimator.push(frame) for frame in frames]
    assert stream[:2] == [None, None] and estimator.frames_pushed == 6
    assert len(batch) == 4
    for one, other in zip(batch, stream[2:], strict=True):
        assert_array_equal(one.flow, other.flow)
        assert_array_equal(one.covariance, other.covariance)
        assert_array_equal(one.status, other.status)
        assert one.frame_index == other.frame_index


def test_lists_and_arrays(frames):
    assert jacoflow.flow(*frames[:3]).shape == (32, 40)
    assert jacoflow.flow(*frames[:3]).shape == (32, 40)
    assert jacoflow.estimate(frames[:3], ends="drop").shape == (1, 32, 40)
    assert jacoflow.estimate(list(frames), ends="drop").shape == (4, 32, 40)
    assert jacoflow.flow(*frames[:2], method="lucas_kanade").shape == (32, 40)
    pair = jacoflow.flow(*frames[:2])
    assert pair.shape == (32, 40) and pair.frame_index == 0
    with pytest.raises(ValueError, match="at least 3 frames"):
        jacoflow.estimate(list(frames[:2]), method="instantaneous")


def test_backward_fields_belong_to_the_newest_frame(frames):
    field = jacoflow.estimate(frames, method=jacoflow.Windowed(time_scheme="backward"), ends="drop")
    assert [each.frame_index for each in field] == [2, 3, 4, 5]


def test_preparation_is_done_on_the_way(frames):
    prepared = np.stack([jacoflow.smooth(jacoflow.quantise(frame), 1.5) for frame in frames])
    one = jacoflow.estimate(frames, method="lucas_kanade", preprocess=jacoflow.Preprocess(quantise=1.0, smooth=1.5), ends="drop")
    other = jacoflow.estimate(prepared, method="lucas_kanade", ends="drop")
    assert_array_equal(one.flow, other.flow)


def test_colour_is_luminance_on_request(frames):
    grey = np.clip(np.round(frames), 0, 255).astype(np.uint8)
    colour = np.stack([grey, grey, grey, np.full_like(grey, 255)], axis=-1)
    expected = jacoflow.estimate(grey, ends="drop")
    assert_array_equal(jacoflow.estimate(colour, preprocess=jacoflow.Preprocess(colour="luminance"), ends="drop").flow, expected.flow)
    listed = jacoflow.estimate([frame[..., :3] for frame in colour], preprocess=jacoflow.Preprocess(colour="luminance"), ends="drop")
    assert_array_equal(listed.flow, expected.flow)
    estimator = FlowEstimator(preprocess=jacoflow.Preprocess(colour="luminance"))
    assert_array_equal([estimator.push(frame) for frame in colour][2].flow, expected[0].flow)
    assert jacoflow.luminance(colour[0]).dtype == np.uint8


def test_reset_begins_anew(frames):
    estimator = FlowEstimator()
    for frame in frames[:3]:
        estimator.push(frame)
    estimator.reset()
    assert estimator.frames_pushed == 0 and estimator.push(frames[0][:20, :20]) is None
    flow_filter = FlowFilter()
    flow_filter.push(frames[0])
    flow_filter.reset()
    assert flow_filter.state is None and flow_filter.push(frames[0][:20, :20]).frame_index == 0


@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
def test_estimator_pickles_in_mid_stream(frames, dtype):
    frames = np.clip(np.round(frames), 0, 255).astype(dtype)
    mask = np.ones((32, 40), bool)
    one = FlowEstimator(grid=jacoflow.SamplingGrid(points=np.array([[4, 5], [20, 11]])), mask=mask, preprocess=jacoflow.Preprocess(smooth=1.0), fps=50.0, diagnostics=True)
    for frame in frames[:4]:
        one.push(frame)
    mask[:] = False
    other = pickle.loads(pickle.dumps(one))
    assert other.options.keys() == one.options.keys() and other.frames_pushed == 4
    for frame in frames[4:]:
        a, b = one.push(frame), other.push(frame)
        assert_array_equal(a.flow, b.flow)
        assert_array_equal(a.covariance, b.covariance)
        assert a.frame_index == b.frame_index
        assert a.valid.any()


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_filter_resumes_bit_for_bit(frames, form, precision, tmp_path):
    options = grouped(form=form, precision=precision, R=0.25, neighbourhood=(5, 5), stride=3, transition="exact")
    one = FlowFilter(**options)
    for frame in frames[:3]:
        one.push(frame)
    pickled = pickle.loads(pickle.dumps(one))
    one.save(tmp_path / "state.npz")
    loaded = FlowFilter(**options, threads=1)
    loaded.load(tmp_path / "state.npz")
    for frame in frames[3:]:
        expected = one.push(frame)
        for other in (pickled, loaded):
            field = other.push(frame)
            assert_array_equal(field.flow, expected.flow)
            assert_array_equal(field.covariance, expected.covariance)
            assert field.frame_index == expected.frame_index
    assert_array_equal(pickled.state, one.state)
    assert_array_equal(pickled.state_covariance, one.state_covariance)
    assert pickled.repairs == one.repairs


def test_a_saved_filter_is_taken_up_only_where_it_fits(frames, tmp_path):
    one = FlowFilter()
    with pytest.raises(ValueError, match="has seen a frame"):
        one.save(tmp_path / "early.npz")
    one.push(np.clip(frames[0], 0, 255).astype(np.uint8))
    one.save(tmp_path / "state.npz")
    with pytest.raises(ValueError, match="same options"):
        FlowFilter(profile=jacoflow.FilterProfile(R=0.5)).load(tmp_path / "state.npz")
    with pytest.raises(ValueError, match="same options"):
        FlowFilter(preprocess=jacoflow.Preprocess(smooth=3.0)).load(tmp_path / "state.npz")
    other = FlowFilter()
    other.load(tmp_path / "state.npz")
    with pytest.raises(ValueError, match="full scale"):
        other.push(frames[1].astype(np.uint16))
    (tmp_path / "bad.npz").write_bytes(b"PK nothing")
    with pytest.raises(jacoflow.FormatError, match="bad.npz"):
        other.load(tmp_path / "bad.npz")
    with pytest.raises(FileNotFoundError):
        other.load(tmp_path / "none.npz")
    good = (tmp_path / "state.npz").read_bytes()
    for at in range(500, len(good), len(good) // 40):
        damaged = bytearray(good)
        damaged[at] ^= 0x11
        (tmp_path / "damaged.npz").write_bytes(damaged)
        try:
            other.load(tmp_path / "damaged.npz")
        except (jacoflow.FormatError, ValueError) as error:
            assert "float64" not in str(error), "the state is of single precision"
        else:
            assert_array_equal(other.state, one.state)


def test_fast_is_the_25_points_with_the_motion_first(frames):
    options = {"precision": "float64", "grid": jacoflow.SamplingGrid(points=[[12, 10], [20, 14]])}
    fast, same, default = (
        FlowFilter(profile=jacoflow.FilterProfile(form="fast"), **options),
        FlowFilter(profile=jacoflow.FilterProfile(form="non_augmented", square_root="motion_first"), **options),
        FlowFilter(profile=jacoflow.FilterProfile(form="non_augmented"), **options),
    )
    for frame in frames:
        for one in (fast, same, default):
            one.push(frame)
    np.testing.assert_allclose(fast.state, same.state, rtol=1e-8, atol=1e-8)
    assert not np.allclose(fast.state, default.state, rtol=1e-8, atol=1e-8)
    with pytest.raises(ValueError, match="square_root"):
        FlowFilter(profile=jacoflow.FilterProfile(form="fast", square_root="brightness_first")).push(frames[0])
    with pytest.raises(ValueError, match="square_root"):
        FlowFilter(profile=jacoflow.FilterProfile(square_root="upwards"))


def test_filter_grey_levels_do_not_depend_on_the_sample_type(frames):
    narrow = np.clip(np.round(frames), 0, 255).astype(np.uint8)
    fields = []
    for sequence, options in (
        (narrow, {}),
        (narrow.astype(np.uint16) * 257, {}),
        (narrow.astype(np.float32), {}),
        (narrow.astype(np.float32) / 255, {"full_scale": 1.0}),
    ):
        flow_filter = FlowFilter(**grouped(profile="measured", precision="float64", **options))
        fields.append([flow_filter.push(frame) for frame in sequence][-1])
    for field in fields[1:]:
        np.testing.assert_allclose(field.flow, fields[0].flow, rtol=1e-3, atol=1e-4)


def test_progress_is_reported(frames, capsys):
    told = []
    jacoflow.estimate(frames, progress=lambda done, total: told.append((done, total)), ends="drop")
    assert told == [(k, 6) for k in range(1, 7)]
    jacoflow.estimate(frames, progress=True, ends="drop")
    assert "6/6 frames\n" in capsys.readouterr().err
    jacoflow.estimate(frames, progress=False, ends="drop")
    assert capsys.readouterr().err == ""


def test_an_exception_in_progress_stops_the_work(frames):
    def stop(done, total):
        if done == 2:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        jacoflow.estimate(frames, progress=stop)


def test_control_c_stops_the_work(frames):
    done = []
    # A shell that starts the tests in the background has them ignore the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def press(count, total):
        done.append(count)
        if count == 4:
            os.kill(os.getpid(), signal.SIGINT)

    try:
        with pytest.raises(KeyboardInterrupt):
            jacoflow.estimate(np.tile(frames, (50, 1, 1)), progress=press)
    finally:
        signal.signal(signal.SIGINT, before)
    assert 4 <= done[-1] < 10


def test_the_interpreter_goes_on_meanwhile():
    """While the core works, Python threads run: a counter moves during one call."""
    frames = list(scenes.Scene("affine", width=320, height=240).frames(3))
    counter, running = [0], threading.Event()
    running.set()

    def count():
        while running.is_set():
            counter[0] += 1

    seen = []
    thread = threading.Thread(target=count)
    thread.start()
    try:
        estimator = FlowEstimator()
        for frame in frames[:2]:
            estimator.push(frame)
        for _ in range(2):
            before = counter[0]
            estimator.push(frames[2])
            seen.append(counter[0] - before)
    finally:
        running.clear()
        thread.join()
    # With the lock held the other thread could get in at most at the call's two ends.
    assert max(seen) > 100
