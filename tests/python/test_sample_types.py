"""Frames of any sample type are converted where that is exact, and refused where it is not."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import jacoflow

METHOD = "windowed"


def same(left, right):
    assert_array_equal(left.flow, right.flow)
    assert_array_equal(left.covariance, right.covariance)
    assert_array_equal(left.status, right.status)


@pytest.mark.parametrize(
    ("dtype", "core"),
    [
        ("int8", np.float32),
        ("int16", np.float32),
        (">i2", np.float32),
        ("float16", np.float32),
        ("int32", np.float64),
        ("uint32", np.float64),
        ("int64", np.float64),
        ("uint64", np.float64),
    ],
)
def test_other_types_are_converted_exactly(texture, dtype, core):
    frames = texture // 2
    same(jacoflow.estimate(frames.astype(dtype), method=METHOD), jacoflow.estimate(frames.astype(core), method=METHOD))
    streamed = jacoflow.FlowEstimator(method=METHOD)
    plain = jacoflow.FlowEstimator(method=METHOD)
    for frame in frames:
        given, want = streamed.push(frame.astype(dtype)), plain.push(frame.astype(core))
    same(given, want)
    colour = np.stack(frames, axis=-1)
    assert_array_equal(jacoflow.luminance(colour.astype(dtype)), jacoflow.luminance(colour.astype(core)))


def test_negative_samples_keep_their_sign(texture):
    signed = texture.astype(np.int16) - 300
    same(jacoflow.estimate(signed, method=METHOD), jacoflow.estimate(signed.astype(np.float32), method=METHOD))


def test_bool_frames_are_black_and_white(texture):
    frames = texture > 128
    same(jacoflow.estimate(frames, method=METHOD), jacoflow.estimate(frames.astype(np.uint8), method=METHOD))


@pytest.mark.parametrize("dtype", [np.int64, np.uint64])
def test_integers_that_float64_does_not_hold_are_refused(texture, dtype):
    frames = texture.astype(dtype)
    frames[1, 3, 4] = 2**53
    assert jacoflow.flow(*frames, method=METHOD).shape == frames[0].shape
    frames[1, 3, 4] = 2**53 + 1
    with pytest.raises(ValueError, match=r"frames: expected integers of at most 2\^53.*got 9007199254740993"):
        jacoflow.estimate(list(frames), method=METHOD)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int16", "int32", "float32", "float64"])
def test_masked_pixels_are_not_used(texture, dtype):
    frames = texture.astype(dtype)
    hidden = np.zeros(frames.shape, bool)
    hidden[:, 10:14, 20:25] = True
    spoilt = np.where(hidden, 99, frames).astype(dtype)
    masked = np.ma.array(spoilt, mask=hidden)
    want = spoilt.astype(np.float64 if dtype in ("int32", "float64") else np.float32)
    want[hidden] = np.nan
    for given in (masked, list(masked)):
        got, plain = (jacoflow.flow(*stack, method=METHOD) for stack in (given, want))
        same(got, plain)
    assert not got.valid[11, 22] and got.valid[30, 30]
    same(jacoflow.estimate(masked, method=METHOD)[1], plain)
    streamed = jacoflow.FlowEstimator(method=METHOD)
    same([streamed.push(frame) for frame in masked][-1], plain)
    assert_array_equal(masked.data, spoilt)


def test_a_masked_array_without_masked_pixels_is_used_whole(texture):
    same(jacoflow.estimate(np.ma.array(texture), method=METHOD), jacoflow.estimate(texture.astype(np.float32), method=METHOD))


@pytest.mark.parametrize("take", [jacoflow.segment.felzenszwalb, lambda frame: jacoflow.track.GradientTracker(frame, (10, 10, 13, 13))])
def test_others_take_other_types_too(take):
    frame = np.random.default_rng(0).integers(0, 255, (64, 64))
    take(frame)
    with pytest.raises(ValueError, match=r"2\^53"):
        take(frame + 2**60)


WHITE = {"uint8": 255, "uint16": 65535}


def raw(samples, dtype):
    return samples


def in_levels(samples, dtype):
    return samples / (WHITE.get(dtype, 255) // 255)


def in_shares(samples, dtype):
    return samples / np.float32(WHITE.get(dtype, 1))


def disparities(view, **options):
    found = jacoflow.stereo.edge_disparity(view, np.roll(view, -3, 1), disparity_range=(-8, 8), row_offset=0.0, **options)
    return found.disparity, found.score


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int16", "int32", "float32", "float64"])
@pytest.mark.parametrize(
    ("call", "unit"),
    [
        (lambda frame: [jacoflow.corners(frame, min_distance=3)], raw),
        (lambda frame: jacoflow.point_flow(frame, np.roll(frame, 1, 1), [[30.0, 20.0], [36.0, 33.0], [70.0, 70.0]]), raw),
        (lambda frame: [jacoflow.smooth(frame, 1.5)], raw),
        (lambda frame: [jacoflow.quantise(frame, 5)], raw),
        (lambda frame: [jacoflow.segment.felzenszwalb(frame, scale=100)], in_shares),
        (disparities, in_levels),
        (lambda frame: disparities(frame, method="classes"), in_levels),
        (jacoflow.stereo.edge_pixels, in_levels),
    ],
    ids=["corners", "point_flow", "smooth", "quantise", "felzenszwalb", "edge_disparity", "classes", "edge_pixels"],
)
def test_masked_pixels_are_nan_in_other_functions(call, unit, dtype):
    cells = np.random.default_rng(1).integers(0, 200, (12, 12)).repeat(8, 0).repeat(8, 1)
    samples = (cells * 257 if dtype == "uint16" else cells).astype(dtype)
    hidden = np.zeros(cells.shape, bool)
    hidden[30:38, 30:42] = True
    filled = unit(samples.astype(np.float64 if dtype in ("int32", "float64") else np.float32), dtype)
    filled[hidden] = np.nan
    masked = np.ma.array(np.where(hidden, 99, samples), mask=hidden)
    assert masked.dtype == samples.dtype
    for got, want in zip(call(masked), call(filled), strict=True):
        assert_array_equal(got, want)


def test_booleans_are_black_and_white_where_grey_levels_count():
    silhouettes = np.zeros((6, 140, 160), bool)
    for k, frame in enumerate(silhouettes):
        frame[60:90, 40 + 3 * k : 64 + 3 * k] = True
    for same in (lambda frames: frames.astype(float), lambda frames: frames.astype(np.uint8) * 255):
        one, other = (
            jacoflow.track.track(list(frames), bbox=(40, 60, 24, 30)) for frames in (silhouettes, same(silhouettes))
        )
        assert_array_equal(one.position, other.position)
        edges = jacoflow.stereo.edge_pixels(silhouettes[0])
        assert len(edges[0]) and np.array_equal(edges, jacoflow.stereo.edge_pixels(same(silhouettes)[0]))


def test_masked_values_have_no_part_in_means():
    labels, values = np.array([[0, 0, 1]]), np.ma.array([[1, 2, 3]], mask=[[False, True, True]])
    assert_array_equal(jacoflow.segment.region_means(labels, values), [1.0, np.nan])


@pytest.mark.parametrize("frame", [3, np.int64(3), np.array(3.0)])
def test_a_number_is_no_frame(frame):
    with pytest.raises(ValueError, match=r"^first: expected a frame \(H, W\), got shape \(\)"):
        jacoflow.flow(frame, frame)
    with pytest.raises(ValueError, match=r"^frames: expected a frame \(H, W\), got shape \(\)"):
        jacoflow.estimate([frame, frame])
