"""Bad input: the right exception, and a message that names the argument."""

import errno
import pickle
from pathlib import Path

import numpy as np
import pytest

from grouped_options import grouped
import jacoflow
from jacoflow import FlowEstimator, FlowField, FlowFilter, JacoflowError, filters, io, scenes, video

GOOD = np.zeros((3, 8, 10), np.uint8)


@pytest.mark.parametrize(
    ("frames", "error", "message"),
    [
        (GOOD[:1], ValueError, "frames: expected at least [23] frames, got 1 frame"),
        (GOOD[:0], ValueError, "frames: expected at least [23] frames, got 0 frames"),
        ([], ValueError, "frames: expected at least [23] frames, got 0 frames"),
        (list(GOOD[:1]), ValueError, "frames: expected at least [23] frames, got 1 frame"),
        (GOOD[0], ValueError, r"frames: expected a list of frames \(H, W\) or a stack \(T, H, W\), got an array of shape \(8, 10\)"),
        (GOOD[:, :2], ValueError, "frames: expected at least 3 x 3 pixels, got 10 x 2"),
        (GOOD[:, :, :1], ValueError, "frames: expected at least 3 x 3 pixels"),
        (GOOD[:, :0], ValueError, "frames: expected at least 3 x 3 pixels"),
        ([GOOD[0], GOOD[1], GOOD[2, :7]], ValueError, "frames: expected frames of one size"),
        ([GOOD[0], GOOD[1], GOOD[2].astype(np.uint16)], TypeError, "frames: expected uint8 like the first frame, got uint16"),
        (GOOD.astype(complex), TypeError, "frames: expected an array of bool, integers of 8 to 64 bits, float16, float32 or float64, got complex128"),
        (GOOD.astype(np.int64) + 2**54, ValueError, r"frames: expected integers of at most 2\^53, which float64 holds exactly, got .* \(int64\)"),
        (GOOD.astype(object), TypeError, "frames: .* got object"),
        (np.zeros((3, 8, 10, 3), np.uint8), ValueError, 'frames: .*colour="luminance"'),
        (np.zeros((8, 10, 3), np.uint8), ValueError, "frames: .*looks like one colour image"),
        ([np.zeros((8, 10, 3), np.uint8)] * 3, ValueError, r'frames: .*convert it with jacoflow.luminance.frame.*colour="luminance"'),
        ([np.zeros((8, 10, 2), np.uint8)] * 3, ValueError, r"frames: expected a frame \(H, W\), got shape \(8, 10, 2\)"),
        ("clip.mp4", TypeError, r"frames: expected an array, got the name of a file \(clip.mp4\); open it with jacoflow.io.frames\(path\)"),
        (Path("clip.mp4"), TypeError, r"frames: expected an array, got the name of a file \(clip.mp4\)"),
        (None, TypeError, "frames: expected an array, got None"),
        (object(), TypeError, "frames: expected an array, got object"),
        ([None, None, None], TypeError, "frames: expected an array, got None"),
        ({"frames": GOOD}, TypeError, "frames: expected an array, got dict"),
    ],
)
@pytest.mark.parametrize("method", ["windowed", "instantaneous"])
def test_frames_that_cannot_be_used(frames, error, message, method):
    with pytest.raises(error, match=message):
        jacoflow.estimate(frames, method=method)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((GOOD[0], GOOD[1].astype(np.uint16)), TypeError, "second: expected uint8 like the first frame, got uint16"),
        ((GOOD[0], GOOD[1], GOOD[2, :7]), ValueError, "third: expected frames of one size"),
        ((GOOD[0], GOOD[1, :0]), ValueError, "second: expected frames of one size"),
        ((GOOD[0, :0], GOOD[1, :0]), ValueError, "second: expected at least 3 x 3 pixels, got 10 x 0"),
        (([[1, 2], [3]], GOOD[1]), ValueError, "first: expected rows of equal length"),
        ((GOOD[0], [[1, 2], [3]]), ValueError, "second: expected rows of equal length"),
    ],
)
def test_single_frames_that_cannot_be_used_are_named(arguments, error, message):
    with pytest.raises(error, match="^" + message):
        jacoflow.flow(*arguments)


@pytest.mark.parametrize("mask", [memoryview(b"ab"), np])
@pytest.mark.parametrize("kind", [FlowFilter, FlowEstimator])
def test_options_that_cannot_be_copied_are_named(kind, mask):
    with pytest.raises(TypeError, match=f"^mask: expected an object that can be copied, such as an array, got {type(mask).__name__}"):
        kind(mask=mask)


def test_names_of_files_are_no_frames():
    with pytest.raises(TypeError, match=r"got the name of a file \(a.png\); open it with jacoflow.io.frames"):
        jacoflow.flow("a.png", "b.png")
    with pytest.raises(TypeError, match=r"got the name of a file \(a.avi\); open it with jacoflow.io.frames"):
        jacoflow.track.track("a.avi", bbox=(1, 2, 9, 9))


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"method": "magic"}, ValueError, "method: "),
        ({"method": jacoflow.Preprocess()}, TypeError, "method: expected jacoflow.CoarseToFine or .*, got Preprocess"),
        ({"method": 3}, TypeError, "method: .*, got int"),
        ({"model": "cubic", "method": "instantaneous"}, ValueError, "model: "),
        ({"time_scheme": "later"}, ValueError, "time_scheme: "),
        ({"neighbourhood": (2, 3), "method": "windowed"}, ValueError, "neighbourhood: "),
        ({"neighbourhood": (0, 3), "method": "windowed"}, ValueError, "neighbourhood: expected a positive integer"),
        ({"neighbourhood": [[0, 0], [1, 0], [0, 1]], "method": "instantaneous"}, ValueError, "neighbourhood: "),
        ({"neighbourhood": "big", "method": "windowed"}, ValueError, "neighbourhood: "),
        ({"neighbourhood_sigma": -1.0, "method": "windowed"}, ValueError, "neighbourhood_sigma: "),
        ({"window_sigma": 0.0, "method": "windowed"}, ValueError, "window_sigma: "),
        ({"rows": "some", "method": "windowed"}, ValueError, "rows: "),
        ({"rank_deficient": "guess", "method": "windowed"}, ValueError, "rank_deficient: "),
        ({"smooth": -1.0}, ValueError, "smooth: "),
        ({"smooth": float("nan")}, ValueError, "smooth: "),
        ({"quantise": 0.0}, ValueError, "quantise: "),
        ({"colour": "green"}, ValueError, "colour: "),
        ({"points": [[1, 2, 3]]}, ValueError, r"points: expected shape \(N, 2\)"),
        ({"points": [[1.5, 2.0]]}, TypeError, "points: expected integers, got float64"),
        ({"points": [[-1, 2]]}, ValueError, r"points: .*got \(-1, 2\)"),
        ({"points": [[10, 2]]}, ValueError, r"points: .*got \(10, 2\)"),
        ({"points": [[1, 2]], "stride": 2}, ValueError, "points: expected points without stride"),
        ({"region": (0, 0, 11, 2)}, ValueError, "region: "),
        ({"region": (-1, 0, 4, 4)}, ValueError, "region: "),
        ({"region": (0, 0)}, (TypeError, ValueError), "region"),
        ({"stride": 0}, ValueError, "stride: expected a positive integer, got 0"),
        ({"stride": -2}, ValueError, "stride: expected a positive integer, got -2"),
        ({"stride": 1.5}, TypeError, "stride"),
        ({"mask": np.ones((8, 9), bool)}, ValueError, "mask: "),
        ({"mask": np.ones((8, 10), np.uint8)}, TypeError, "mask: expected a boolean array"),
        ({"mask": np.ones(8, bool)}, ValueError, r"mask: expected shape \(H, W\)"),
        ({"fps": 0.0}, ValueError, "fps: "),
        ({"fps": 1e300}, ValueError, r"fps: expected a positive number of frames per second \(1e-20 to 1e20\)"),
        ({"pixel_pitch": 1e-300}, ValueError, "pixel_pitch: "),
        ({"pixel_pitch": 0.0}, ValueError, "pixel_pitch: "),
        ({"pixel_pitch": "mm"}, TypeError, "pixel_pitch: "),
        ({"noise": -1.0}, ValueError, "noise: "),
        ({"precision": "float16"}, ValueError, "precision: "),
        ({"threads": 0}, ValueError, "threads: expected a positive integer, got 0"),
        ({"threads": -1}, ValueError, "threads: "),
        ({"simd": "mmx"}, ValueError, "simd: "),
        ({"iterations": 0, "method": "horn_schunck"}, ValueError, "iterations: "),
        ({"smoothness": -1.0, "method": "horn_schunck"}, ValueError, "smoothness: "),
        ({"unknown": 1}, TypeError, "unknown"),
    ],
)
def test_options_that_cannot_be_used(options, error, message):
    with pytest.raises(error, match=message):
        jacoflow.estimate(GOOD, **grouped(**options))


def test_messages_say_where_an_argument_belongs():
    flow, estimate = jacoflow.flow, jacoflow.estimate
    for call in (lambda: estimate(GOOD, "windowed"), lambda: flow(*GOOD[:2], "windowed"), lambda: flow(*GOOD, "windowed")):
        with pytest.raises(TypeError, match='^method: expected as a keyword, method="windowed", got '):
            call()
    for preset in ("fast", "balanced", "accurate"):
        with pytest.raises(ValueError, match=rf'^method: expected a method or CoarseToFine\(preset="{preset}"\), got '):
            flow(*GOOD[:2], method=preset)
    moving = r"^mask: expected shape \(H, W\), got \(3, 8, 10\); .* masked arrays, numpy.ma.array\(frames, mask=hidden\)"
    with pytest.raises(ValueError, match=moving):
        estimate(GOOD, mask=np.ones(GOOD.shape, bool))
    for call in (lambda: FlowFilter(precision="float16"), lambda: estimate(GOOD, precision="float16")):
        with pytest.raises(ValueError, match='^precision: expected "float32" or "float64", got "float16"$'):
            call()


@pytest.mark.parametrize("progress", ["yes", 3])
def test_progress_of_a_wrong_kind(progress):
    with pytest.raises(TypeError, match="progress: expected None, True or a function"):
        jacoflow.estimate(GOOD, progress=progress)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"profile": "best"}, ValueError, "profile: "),
        ({"form": "square"}, ValueError, "form: "),
        ({"transition": "euler"}, ValueError, "transition: "),
        ({"Q": [1.0, 2.0]}, ValueError, r"Q: expected twelve numbers, shape \(12,\), got shape \(2,\)"),
        ({"Q": [-1.0] * 12}, ValueError, "Q: "),
        ({"Q": ["a"] * 12}, TypeError, "Q: expected real numbers"),
        ({"R": 0.0}, ValueError, "R: "),
        ({"x0": [np.nan] * 12}, ValueError, "x0: "),
        ({"P0": [0.0] * 12}, ValueError, "P0: "),
        ({"alpha": 0.0}, ValueError, "alpha: "),
        ({"full_scale": 0.0}, ValueError, "full_scale: "),
        ({"mask": np.ones((3, 3), bool)}, ValueError, "mask: "),
    ],
)
def test_filter_options_that_cannot_be_used(options, error, message):
    with pytest.raises(error, match=message):
        FlowFilter(**grouped(**options)).push(GOOD[0])


@pytest.mark.parametrize("make", [FlowEstimator, FlowFilter])
def test_a_stream_refuses_a_frame_unlike_the_first_and_goes_on(make):
    frames = scenes.Scene("affine", width=32, height=24).frames(4)
    stream, reference = make(), make()
    for frame in frames[:2]:
        stream.push(frame)
        reference.push(frame)
    for bad, error in (
        (frames[2][:20], ValueError),
        (frames[2].astype(np.float32), TypeError),
        (frames[2].astype(np.int16), TypeError),
        (frames, ValueError),
    ):
        with pytest.raises(error, match="frame"):
            stream.push(bad)
    for frame in frames[2:]:
        np.testing.assert_array_equal(stream.push(frame).flow, reference.push(frame).flow)


def test_small_and_odd_frames_of_a_stream():
    with pytest.raises(ValueError, match="3 x 3"):
        estimator = FlowEstimator()
        for _ in range(3):
            estimator.push(np.zeros((2, 9)))
    with pytest.raises(ValueError, match="frame"):
        FlowFilter().push(np.zeros((2, 9)))


def test_flat_frames_are_no_error():
    for method in ("windowed", "instantaneous", "lucas_kanade", "horn_schunck"):
        field = jacoflow.flow(*([np.full((48, 48), 7, np.uint8)] * 3), method=method)
        if method != "horn_schunck":
            assert not field.valid.any() and np.isnan(field.flow).all()
            assert (field.status[20:-20, 20:-20] == jacoflow.Status.UNOBSERVABLE).all()


def test_a_frame_without_samples_is_named_in_its_neighbours():
    """Not as if there were no texture."""
    frames = scenes.Scene("affine", width=64, height=48).frames(3)
    frames[1] = np.nan
    for field in (jacoflow.flow(*frames[:2]), jacoflow.flow(*frames[1:]), jacoflow.flow(*frames)):
        assert (field.status == jacoflow.Status.NON_FINITE).all() and not field.valid.any()


def test_sixteen_bit_extremes_do_not_overflow():
    frames = np.clip(scenes.Scene("affine", width=48, height=48).frames(3) / 255, 0, 1)
    wide = np.round(frames * 65535).astype(np.uint16)
    assert wide.max() > 60000
    narrow = jacoflow.flow(*frames)
    full = jacoflow.flow(*wide)
    np.testing.assert_allclose(full.flow[10:-10, 10:-10], narrow.flow[10:-10, 10:-10], atol=2e-3)


@pytest.mark.parametrize(
    ("call", "kind", "code"),
    [
        (lambda path: jacoflow.FlowField.load(path / "none.npz"), FileNotFoundError, errno.ENOENT),
        (lambda path: jacoflow.FlowField.load(path / "none.flo"), FileNotFoundError, errno.ENOENT),
        (lambda path: jacoflow.io.frames(path / "none"), FileNotFoundError, errno.ENOENT),
        (lambda path: jacoflow.io.write_flo(path / "no" / "x.flo", np.zeros((3, 3, 2))), FileNotFoundError, errno.ENOENT),
    ],
)
def test_files_that_are_not_there(call, kind, code, tmp_path):
    with pytest.raises(kind) as caught:
        call(tmp_path)
    assert caught.value.errno == code
    assert isinstance(caught.value.filename, str) and str(tmp_path) in caught.value.filename
    assert "PosixPath" not in str(caught.value)


def test_damaged_files_are_format_errors(tmp_path):
    for name in ("x.npz", "x.flo", "x.png", "x.pfm"):
        path = tmp_path / name
        path.write_bytes(b"not what the name says")
        with pytest.raises(jacoflow.FormatError, match=name):
            jacoflow.FlowField.load(path)
    with pytest.raises(ValueError, match="path: expected one of the extensions"):
        jacoflow.FlowField.load(tmp_path / "x.doc")


def test_exceptions_have_one_base_and_pickle():
    for kind in (jacoflow.FormatError, jacoflow.NotObservableError, jacoflow.NumericalError, jacoflow.MissingDependencyError):
        assert issubclass(kind, JacoflowError) and kind.__module__ == "jacoflow"
        copy = pickle.loads(pickle.dumps(kind("why")))
        assert type(copy) is kind and copy.args == ("why",)


@pytest.mark.parametrize("what", ["nothing", "disc disc"])
def test_unknown_scenes_are_listed(what):
    with pytest.raises(ValueError, match="name: expected one of ramp"):
        scenes.Scene(what)
    with pytest.raises(ValueError, match="parameter: expected one of"):
        scenes.Scene("affine", wind=1.0)
    with pytest.raises(ValueError, match="noise: "):
        scenes.Sensor(noise=-1.0)
    with pytest.raises(ValueError, match="rounding: "):
        scenes.Sensor(rounding="up")


@pytest.mark.parametrize(("variable", "value"), [("THREADS", "abc"), ("THREADS", "0"), ("THREADS", "-1"), ("SIMD", "abc")])
def test_a_useless_environment_is_named_unless_an_option_overrides_it(monkeypatch, variable, value):
    frames = list(np.zeros((3, 8, 10), np.uint8))
    monkeypatch.setenv(f"JACOFLOW_{variable}", value)
    message = f"JACOFLOW_{variable}: expected .*{value}"
    with pytest.raises(ValueError, match=message):
        jacoflow.estimate(frames)
    with pytest.raises(ValueError, match=message):
        FlowFilter().push(frames[0])
    jacoflow.flow(*frames, threads=1, simd="scalar")
    monkeypatch.setenv(f"JACOFLOW_{variable}", "")
    jacoflow.flow(*frames)


@pytest.mark.parametrize("name", ["stride", "threads", "iterations"])
def test_integers_beyond_64_bits_are_taken_for_the_largest(name):
    method = "horn_schunck" if name == "iterations" else "windowed"
    options = {name: -(10**30)}
    with pytest.raises(ValueError, match=f"{name}: "):
        jacoflow.estimate(np.zeros((3, 16, 16), np.float32), **grouped(method=method, **options))


def test_options_are_named_as_the_user_wrote_them():
    frames = np.zeros((3, 16, 16), np.float32)
    for options, name in [
        (dict(smooth=np.inf), "smooth"),
        (dict(method="lucas_kanade", window_sigma=0.0), "window_sigma"),
        (dict(method="windowed", window_sigma=1e300), "window_sigma"),
        (dict(method="windowed", time_scheme="foo"), "time_scheme: expected central, backward or pair"),
        (dict(region=[0, 0, 99, 99]), "region"),
    ]:
        with pytest.raises(ValueError, match=f"^{name}") as error:
            jacoflow.estimate(frames, **grouped(**options))
        assert len(str(error.value)) < 400
    with pytest.raises(TypeError, match="^region: expected four integers"):
        jacoflow.estimate(frames, grid=jacoflow.SamplingGrid(region="abcd"))
    with pytest.raises(ValueError) as error:
        jacoflow.estimate(frames, grid=jacoflow.SamplingGrid(region=(0, 0, 2**70, 3)))
    assert str(error.value) == f"region: expected four integers (x, y, width, height) of 64 bits, got (0, 0, {2**70}, 3)"
    field = jacoflow.estimate(frames, ends="drop")[0]
    with pytest.raises(ValueError, match="^region: "):
        field.region_mean("curl", (0, 0, 600, 5))


@pytest.mark.parametrize("n", [2**40, 2**62])
def test_selections_beyond_memory_are_refused(n):
    with pytest.raises(MemoryError, match="^n: "):
        jacoflow.filters.resample([0.5, 0.5], n)


def test_frames_beyond_memory_are_refused():
    scene = jacoflow.scenes.Scene("affine", width=64, height=48)
    for count in (10**12, 10**30):
        with pytest.raises(MemoryError, match="^count: "):
            scene.frames(count)
    with pytest.raises(ValueError, match="^count: "):
        scene.frames(-1)
    assert scene.frames(0).shape == (0, 48, 64)


@pytest.mark.parametrize("method", ["coarse_to_fine", "instantaneous", "lucas_kanade"])
def test_noise_that_no_covariance_can_hold_is_refused(method):
    y, x = np.mgrid[:40, :40]
    frames = [(120 + 40 * np.sin(0.4 * (x - t)) * np.cos(0.3 * y)).astype(np.float32) for t in range(3)]
    with pytest.raises(ValueError, match="noise: expected"):
        jacoflow.estimate(frames, noise=1e30, method=method)
    field = jacoflow.flow(*frames, noise=1e12, method=method)
    assert field.valid.any() and np.isfinite(field.covariance[field.valid]).all()


@pytest.mark.parametrize(("method", "needed"), [("coarse_to_fine", 2), ("windowed", 2), ("lucas_kanade", 2), ("instantaneous", 3)])
def test_a_lone_frame_names_how_many_suffice(method, needed):
    with pytest.raises(ValueError, match=f"frames: expected at least {needed} frames, got 1 frame"):
        jacoflow.estimate([GOOD[0]], method=method)


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: jacoflow.smooth(GOOD[0], 1.0, threads=-1), "threads"),
        (lambda: jacoflow.corners(GOOD[0], threads=-1), "threads"),
        (lambda: jacoflow.segment.felzenszwalb(np.zeros((8, 10, 3), np.uint8), threads=-1), "threads"),
        (lambda: jacoflow.stereo.edge_pixels(GOOD[0], threads=-1), "threads"),
        (lambda: jacoflow.track.StereoTracker(threads=-1), "threads"),
        (lambda: scenes.Scene("vortex", width=-1), "width"),
    ],
)
def test_negative_counts_are_named(call, argument):
    with pytest.raises(ValueError, match=f"^{argument}: expected .*, got -1$"):
        call()


def test_a_frame_of_another_dtype_is_the_frame_that_was_pushed():
    estimator = FlowEstimator()
    estimator.push(GOOD[0])
    with pytest.raises(TypeError, match="^frame: expected uint8 like the first frame, got uint16"):
        estimator.push(GOOD[1].astype(np.uint16))


@pytest.mark.parametrize("dtype", [bool, np.uint8, ">u2", np.uint16, np.int16, np.int64])
def test_integers_with_and_without_a_mask_are_of_one_type(dtype):
    frames = (scenes.Scene("affine", width=48, height=40).frames(3) > 100).astype(dtype) * (1 if dtype is bool else 90)
    hidden = np.zeros(frames[0].shape, bool)
    hidden[20, 20] = True
    for kinds in ((0, 1, 0), (1, 0, 1)):
        mixed = [np.ma.masked_array(frame, hidden) if kind else frame for frame, kind in zip(frames, kinds, strict=True)]
        all_masked = jacoflow.estimate([np.ma.masked_array(frame, hidden & bool(kind)) for frame, kind in zip(frames, kinds, strict=True)])
        field = jacoflow.estimate(mixed)
        np.testing.assert_array_equal(field.flow, all_masked.flow)
        stream, filter_ = FlowEstimator(), FlowFilter()
        pushed = [pickle.loads(pickle.dumps(stream)).push(frame) if k == 2 else stream.push(frame) for k, frame in enumerate(mixed)]
        np.testing.assert_array_equal(pushed[2].flow, field[1].flow)
        filtered = [filter_.push(frame) for frame in mixed]
        np.testing.assert_array_equal(filtered[0].status == jacoflow.Status.NON_FINITE, FlowFilter().push(mixed[0]).status == 2)
        assert filter_.smooth(mixed).shape == (3, 40, 48)


def test_a_mask_does_not_make_floats_of_integers():
    masked = np.ma.masked_array(GOOD[1], mask=GOOD[1] > 250)
    with pytest.raises(TypeError, match="^frames: expected uint8 like the first frame, got float32"):
        jacoflow.estimate([masked, GOOD[0].astype(np.float32)])
    with pytest.raises(TypeError, match="^frame: expected uint8 like the first frame, got uint16"):
        filter_ = FlowFilter()
        filter_.push(masked)
        filter_.push(GOOD[0].astype(np.uint16))


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("threads", 1.5, "expected an integer, got float"),
        ("threads", "2", "expected an integer, got str"),
        ("covariance", 1, "expected True or False, got int"),
        ("covariance", "yes", "expected True or False, got str"),
        ("diagnostics", 1, "expected True or False, got int"),
        ("precision", 32, "expected a string, got int"),
        ("length_unit", 1, "expected a string, got int"),
        ("simd", True, "expected a string, got bool"),
    ],
)
def test_options_of_another_type_are_named(option, value, message):
    calls = [lambda: jacoflow.estimate(GOOD, **{option: value}), lambda: jacoflow.flow(*GOOD, **{option: value})]
    calls += [lambda: FlowEstimator(**{option: value})]
    if option != "diagnostics":
        calls += [lambda: FlowFilter(**{option: value})]
    for call in calls:
        with pytest.raises(TypeError, match=f"^{option}: {message}"):
            call()


def test_switches_are_booleans_of_python_or_numpy():
    for value in (1, "yes", 0.0, np.int64(1)):
        with pytest.raises(TypeError, match="^pairs: expected True or False, got "):
            jacoflow.estimate(GOOD[:2], pairs=value)
        with pytest.raises(TypeError, match="^subpixel: expected True or False, got "):
            jacoflow.stereo.edge_disparity(np.zeros((24, 24)), np.zeros((24, 24)), subpixel=value)
    frames = scenes.Scene("affine", width=48, height=40).frames(2)
    field = jacoflow.estimate(frames, pairs=np.True_, covariance=np.False_, diagnostics=np.True_)
    assert field.shape == (1, 40, 48) and field.covariance is None
    with pytest.raises(TypeError, match="^forgetting: expected a number .*, got str"):
        FlowEstimator(temporal=jacoflow.Recursive(forgetting="x"))


def test_what_is_measured_is_called_name():
    field = jacoflow.flow(*scenes.Scene("affine", width=48, height=40).frames(2))
    for call in (field.measure, field.region_mean, field.value, field.std, field.unit):
        with pytest.raises(TypeError, match="^name: expected a string, got int"):
            call(3)
    for call in (field.measure, field.region_mean, field.value, field.std):
        with pytest.raises(ValueError, match="^name: expected a field with a frame period .fps. for rpm, got one without$"):
            call("rpm")
    with pytest.raises(ValueError, match="frame period .fps. for rpm"):
        field.rpm


def test_an_option_that_a_tracker_does_not_have_is_of_the_function_called():
    with pytest.raises(TypeError, match=r"^track\(\) got an unexpected keyword argument 'box'; expected one of bbox, center, model, camera$"):
        jacoflow.track.track(np.zeros((2, 40, 40), np.uint8), box=(1, 2, 9, 9))
    with pytest.raises(TypeError, match=r"^track_particles\(\) got an unexpected keyword argument 'box'; expected one of mode, "):
        jacoflow.track.track_particles(np.zeros((2, 40, 40, 3), np.uint8), [(1, 2, 9, 9)], box=1)


def test_parameters_of_a_scene_are_numbers():
    with pytest.raises(TypeError, match="^u_x: expected a number, got <class 'str'>"):
        scenes.Scene("affine", u_x="x")


def test_covariances_that_are_not_symmetric_are_refused():
    covariance = np.zeros((3, 4, 2, 2))
    covariance[...] = np.eye(2)
    covariance[1, 2, 0, 1] = 0.5
    with pytest.raises(ValueError, match=r"^covariance: expected symmetric matrices, got an asymmetric one at pixel \(2, 1\)"):
        jacoflow.FlowField.from_arrays(np.zeros((3, 4, 2)), covariance)


def test_a_unit_has_a_name():
    with pytest.raises(ValueError, match='^length_unit: expected the name of a unit, such as mm, got " "'):
        FlowEstimator(pixel_pitch=0.1, length_unit=" ")


def test_colour_frames_are_refused_with_the_option_that_takes_them():
    with pytest.raises(ValueError, match=r'^frames: expected .*pass preprocess=Preprocess\(colour="luminance"\)'):
        jacoflow.estimate(np.zeros((4, 24, 32, 3), np.uint8))
    with pytest.raises(ValueError, match=r'^first: expected a grey frame .*pass preprocess=Preprocess\(colour="luminance"\)'):
        jacoflow.flow(*np.zeros((2, 24, 32, 3), np.uint8))


SCENE = scenes.Scene("affine", width=32, height=24)
FIELD = jacoflow.flow(*SCENE.frames(2))
WORD, NUMBER, INTEGER, PATH = "a string", "a number", "an integer", r"a path \(a string or os.PathLike\)"


@pytest.mark.parametrize(
    ("argument", "expected", "call"),
    [
        ("ends", WORD, lambda: jacoflow.estimate(GOOD, ends=3)),
        ("time", NUMBER, lambda: FlowEstimator().push(GOOD[0], time="now")),
        ("aggregate", WORD, lambda: FIELD.region_mean("u", aggregate=3)),
        ("interval", WORD, lambda: FlowField.from_arrays(FIELD.flow, interval=3)),
        ("options", WORD, lambda: FIELD.save("a.npz", options=3)),
        ("scheme", WORD, lambda: filters.resample([0.5, 0.5], scheme=3)),
        ("scheme", WORD, lambda: filters.ParticleFilter(1, 10).resample(3)),
        ("random_state", INTEGER, lambda: filters.ParticleFilter(1, 10, random_state="x")),
        ("dim_x", INTEGER, lambda: filters.KalmanFilter("2", 1)),
        ("ids", "integers", lambda: filters.ParticleFilter(1, 10, ids=["x"])),
        ("ids", "1 integers", lambda: filters.ParticleFilter(1, 10, ids=3)),
        ("points", "MerweScaledSigmaPoints", lambda: filters.UnscentedKalmanFilter(1, 1, 1.0, abs, abs, "x")),
        ("scale", NUMBER, lambda: jacoflow.segment.felzenszwalb(GOOD[0], scale="x")),
        ("sigma", NUMBER, lambda: jacoflow.segment.felzenszwalb(GOOD[0], sigma="x")),
        ("n", INTEGER, lambda: filters.MerweScaledSigmaPoints("2")),
        ("alpha", NUMBER, lambda: filters.MerweScaledSigmaPoints(2, alpha="x")),
        ("name", WORD, lambda: scenes.Scene(3)),
        ("width", INTEGER, lambda: scenes.Scene("affine", width="a")),
        ("carrier", WORD, lambda: scenes.Scene("affine", carrier=3)),
        ("count", INTEGER, lambda: SCENE.frames("3")),
        ("name", WORD, lambda: scenes.parameters(3)),
        ("rounding", WORD, lambda: scenes.Sensor(rounding=3)),
        ("name", WORD, lambda: scenes.TargetScene(3)),
        ("frames", INTEGER, lambda: scenes.TargetScene("people_handheld", frames="3")),
        ("time_scheme", WORD, lambda: jacoflow.observability(GOOD, time_scheme=3)),
        ("colour", WORD, lambda: io.frames("a.png", colour=3)),
        ("stop", INTEGER, lambda: io.frames("a.png", stop="3")),
        ("channel", INTEGER, lambda: io.frames("a.tif", channel="3")),
        ("source", PATH, lambda: io.frames(3)),
        ("source", PATH, lambda: io.frames(["a.png"])),
        ("path", PATH, lambda: io.read_image(3)),
        ("path", PATH, lambda: io.read_flo(3)),
        ("path", PATH, lambda: io.write_pfm(3, GOOD[0])),
        ("path", PATH, lambda: io.read_disparity(3)),
        ("path", PATH, lambda: io.write_frames(3, GOOD)),
        ("path", PATH, lambda: FIELD.save(3)),
        ("path", PATH, lambda: FlowField.load(3)),
        ("path", PATH, lambda: FlowFilter().load(3)),
    ],
)
def test_arguments_of_another_type_are_named(argument, expected, call):
    with pytest.raises(TypeError, match=rf"^{argument}: expected {expected}.*, got (int|str|list)\b"):
        call()


def test_the_path_of_a_video_is_named():
    pytest.importorskip("av")
    with pytest.raises(TypeError, match=f"^path: expected {PATH}, got int$"):
        video.frames(3)


def test_the_type_of_a_mask_is_named():
    mask = np.full((24, 32), 255, np.uint8)
    for call in (FIELD.region_mean, FIELD.measure):
        with pytest.raises(TypeError, match=r"^region: expected a boolean mask \(H, W\) or corners \(N, 2\), got uint8 of shape \(24, 32\)$"):
            call("u", mask)
        call("u", mask > 0)


@pytest.mark.parametrize(("frames", "got"), [((GOOD,), "one argument"), ([*GOOD, GOOD[0]], "4 arguments")])
def test_flow_takes_two_or_three_frames(frames, got):
    message = rf"^first, second, third: expected two or three frames \(H, W\), got {got}; for a stack .* call jacoflow.estimate\(frames\)$"
    with pytest.raises(TypeError, match=message):
        jacoflow.flow(*frames)
