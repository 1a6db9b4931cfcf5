"""`temporal="recursive"`: streams and stacks, holes, options, pickles."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from grouped_options import grouped
import jacoflow
from jacoflow import FlowEstimator, Status, scenes

METHODS = ["windowed", "coarse_to_fine", "instantaneous"]


@pytest.fixture(scope="module")
def frames():
    """Nine uint8 frames (9, 56, 64) of a steady motion with 3 grey levels of noise."""
    scene = scenes.Scene("affine", width=64, height=56, random_state=4, u=0.2, v=-0.1)
    camera = scenes.Sensor(noise=3.0, rounding="nearest", saturate=True, random_state=2)
    stack = np.stack([camera.apply_u8(scene.frame(float(t)), t) for t in range(9)])
    stack.flags.writeable = False
    return stack


def arrays(field):
    return field.flow, field.jacobian, field.covariance, field.status


@pytest.mark.parametrize("method", METHODS)
def test_a_stream_is_the_stack_and_pickles_in_between(frames, method):
    options = {"method": method, "temporal": jacoflow.Recursive(forgetting=0.9)}
    stack = jacoflow.estimate(frames, **options, threads=1, ends="drop")
    estimator = FlowEstimator(**options, threads=2)
    got = []
    for frame in frames:
        field = estimator.push(frame)
        estimator = pickle.loads(pickle.dumps(estimator))
        if field is not None:
            got.append(field)
    assert len(got) == len(stack) == 7
    for one, other in zip(got, stack, strict=True):
        for a, b in zip(arrays(one), arrays(other), strict=True):
            assert_array_equal(a, b)
    assert estimator.options["temporal"] == options["temporal"]


@pytest.mark.parametrize("method", METHODS)
def test_it_starts_with_the_first_estimate_and_gets_surer(frames, method):
    plain = jacoflow.estimate(frames, method=method, ends="drop")
    fused = jacoflow.estimate(frames, method=method, temporal="recursive", ends="drop")
    for a, b in zip(arrays(plain[0]), arrays(fused[0]), strict=True):
        assert_array_equal(a, b)
    inner = np.s_[12:-12, 12:-12]
    assert np.nanmedian(fused[-1].std("u")[inner]) < 0.75 * np.nanmedian(plain[-1].std("u")[inner])
    if method != "instantaneous":
        truth = scenes.Scene("affine", width=64, height=56, random_state=4, u=0.2, v=-0.1).truth(4.0)
        error = [np.sqrt(np.mean((field.flow - truth.flow)[inner] ** 2)) for field in (plain[-1], fused[-1])]
        assert error[1] < 0.75 * error[0]


def test_forgetting_everything_is_no_memory(frames):
    plain = jacoflow.estimate(frames, precision="float64", ends="drop")
    fused = jacoflow.estimate(frames, precision="float64", temporal=jacoflow.Recursive(forgetting=1e-9), ends="drop")
    assert_allclose(fused.flow, plain.flow, atol=1e-6)


def test_precisions_agree_and_units_follow_the_pixel_pitch(frames):
    options = {"temporal": jacoflow.Recursive(forgetting=1.0)}
    double = jacoflow.estimate(frames, precision="float64", **options, ends="drop")
    single = jacoflow.estimate(frames, precision="float32", **options, ends="drop")
    close = np.abs(double.flow - single.flow)[double.valid] < 0.02 * double.std("u")[double.valid][:, None]
    assert close.mean() > 0.995
    scaled = jacoflow.estimate(frames, precision="float64", pixel_pitch=(0.5, 2.0), **options, ends="drop")
    assert_allclose(scaled.u, 0.5 * double.u, rtol=1e-6)
    assert_allclose(scaled.std("v_x"), 4.0 * double.std("v_x"), rtol=1e-6)


def test_points_are_those_of_the_whole(frames):
    whole = jacoflow.estimate(frames, temporal="recursive", ends="drop")
    points = jacoflow.estimate(frames, temporal="recursive", grid=jacoflow.SamplingGrid(points=[[30, 20], [24, 31]]), ends="drop")
    assert_allclose(points.flow[-1], whole.flow[-1][[20, 31], [30, 24]], rtol=1e-4, atol=1e-6)


def test_holes_are_predicted(frames):
    holed = frames.astype(np.float32)
    holed[4, 28, 30] = np.nan
    fields = jacoflow.estimate(holed, method="windowed", temporal="recursive", ends="drop")
    clean = jacoflow.estimate(frames, method="windowed", temporal="recursive", ends="drop")
    # Triples 2 to 4 see frame 4.
    status = fields.status[:, 28, 30]
    assert status.tolist() == [Status.OK] * 2 + [Status.PREDICTED] * 3 + [Status.OK] * 2
    deviation = fields.std("u")[:, 28, 30]
    # The last information before the hole, forgotten by 0.95 a frame.
    assert_allclose(deviation[2:5] / deviation[1:4], 0.95**-0.5, rtol=0.02)
    assert np.isfinite(fields.flow[:, 28, 30]).all() and fields.valid[3, 28, 30]
    assert_allclose(fields.flow[:, 3:6, 3:6], clean.flow[:, 3:6, 3:6], rtol=1e-4, atol=1e-5)
    # What has never been seen is not predicted.
    assert (fields.status[:, 0, 0] == Status.BORDER).all()


def test_reset_forgets(frames):
    estimator = FlowEstimator(temporal="recursive")
    first = [estimator.push(frame) for frame in frames[:5]][-1]
    estimator.reset()
    again = [estimator.push(frame) for frame in frames[:5]][-1]
    assert_array_equal(first.flow, again.flow)
    assert_array_equal(first.covariance, again.covariance)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"temporal": "kalman"}, "temporal: expected none or recursive"),
        ({"forgetting": 1.5}, "forgetting: expected a factor above 0"),
        ({"forgetting": float("nan")}, "forgetting"),
        ({"temporal": "recursive", "covariance": False}, "covariance"),
        ({"temporal": "recursive", "method": "lucas_kanade"}, "method.*affine"),
        ({"temporal": "recursive", "method": "instantaneous", "model": "translational"}, "method.*translational"),
    ],
)
def test_what_cannot_be_is_said_before_the_first_frame(options, words):
    with pytest.raises(ValueError, match=words):
        FlowEstimator(**grouped(**options))


def test_bias_that_does_not_average_out_is_reported():
    """Particles in a vortex: what windows lose of its bend is lost in every frame. After 23 frames the
    intervals still hold the truth."""
    shares = []
    for seed in range(3):
        scene = scenes.Scene("vortex", width=128, height=128, random_state=seed, carrier="particles")
        camera = scenes.Sensor(noise=1.0, rounding="nearest", saturate=True, random_state=seed)
        estimator = FlowEstimator(temporal="recursive")
        fields = [estimator.push(camera.apply_u8(scene.frame(float(t)), t)) for t in range(25)]
        truth = scene.truth(23.0, between=(0.0, 1.0))
        inner = np.s_[16:-16, 16:-16]
        deviation = np.stack([fields[-1].std("u"), fields[-1].std("v")], axis=-1)
        shares.append(np.mean((abs(fields[-1].flow - truth.flow) < 1.96 * deviation)[inner]))
    print(np.round(shares, 3))
    assert np.mean(shares) > 0.92
