"""Arguments and files that no caller means: errors that name them, and no abort."""

import os
import pathlib
import subprocess
import sys
import textwrap
import threading
import types

import numpy as np
import pytest
import tifffile

import jacoflow
from jacoflow import FlowFilter, filters, io, mixture, motion3d, plot, scenes, segment, stereo, track

ROOT = pathlib.Path(__file__).parents[2]
FRAMES = [np.random.default_rng(k).integers(0, 256, (24, 32)).astype(np.uint8) for k in range(3)]


def endless(shape, kind=np.uint8):
    """A view of one sample, of any shape."""
    return np.broadcast_to(np.zeros((), kind), shape)


VIEWS = {
    "luminance": lambda frame: jacoflow.luminance(endless((2**17, 2**17, 3))),
    "quantise": lambda frame: jacoflow.quantise(frame),
    "smooth": lambda frame: jacoflow.smooth(frame, 1.0),
    "estimate": lambda frame: jacoflow.estimate([frame] * 3),
    "stack": lambda frame: jacoflow.estimate(np.broadcast_to(FRAMES[0], (2**36, *FRAMES[0].shape))),
    "estimator": lambda frame: jacoflow.FlowEstimator().push(frame),
    "filter": lambda frame: jacoflow.FlowFilter().push(frame),
    "mask": lambda frame: jacoflow.estimate(FRAMES, mask=endless(frame.shape, bool)),
    "corners": lambda frame: jacoflow.corners(frame),
    "frames": lambda frame: io.write_frames("/none/x.npy", [frame]),
    "colour frames": lambda frame: track.ParticleTracker(endless((2**18, 2**18, 3)), {}),
    "tracker": lambda frame: track.GradientTracker(frame),
    "stereo tracker": lambda frame: track.StereoTracker().update(frame, frame),
    "disparity": lambda frame: stereo.edge_disparity(frame, frame),
    "batch filter": lambda frame: filters.KalmanFilter(1, 1).batch_filter(endless((2**36, 1), np.float32)),
    "labels": lambda frame: segment.region_means(endless((2**18, 2**18), np.int32), frame),
    "values": lambda frame: segment.region_means([[1]], frame),
    "truths": lambda frame: segment.region_means([[1]], endless((2**18, 2**18), bool)),
    "map": lambda frame: plot.scalar_map(frame),
    "map of truths": lambda frame: plot.scalar_map(endless((2**18, 2**18), bool)),
    "map of doubles": lambda frame: plot.scalar_map(endless((2**18, 2**18), float)),
    "flow image": lambda frame: plot.flow_image(types.SimpleNamespace(flow=endless((2**18, 2**18, 2), float))),
    "curl": lambda frame: plot.curl(types.SimpleNamespace(jacobian=endless((2**17, 2**17, 2, 2), np.float32))),
    "wheel": lambda frame: plot.wheel_image(2**40),
    "boxes": lambda frame: track.ParticleTracker(np.zeros((9, 9, 3), np.uint8), endless((2**36, 4), np.float32)),
    "boxes of doubles": lambda frame: track.ParticleTracker(np.zeros((9, 9, 3), np.uint8), endless((2**36, 4), float)),
    "segments": lambda frame: segment.felzenszwalb(frame),
    "sensor": lambda frame: scenes.Sensor().apply(frame),
    "points": lambda frame: motion3d.estimate_motion(endless((2**36, 2), float), endless((2**36, 2), float)),
}


@pytest.mark.parametrize("name", VIEWS)
def test_what_memory_does_not_hold_is_an_error(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((MemoryError, FileNotFoundError)) as error:
        VIEWS[name](endless((2**18, 2**18)))
    if type(error.value) is MemoryError:
        assert "expected what fits into memory, got " in str(error.value)
    assert not list(tmp_path.iterdir())


def test_points_in_pixels_need_the_camera_matrix():
    points = np.array([[100.0, 80.0], [200.0, 10.0], [5.0, 5.0], [50.0, 90.0], [20.0, 30.0], [70.0, 10.0]])
    for call in (
        lambda: motion3d.estimate_motion(points, points * 0.01),
        lambda: motion3d.estimate_motion(points, points * 0.01, jacobian=np.zeros((6, 2, 2)), cov=np.array([np.eye(6)] * 6)),
        lambda: motion3d.motion_bound(points, (0, 0, 1), (0, 0, 0), np.ones(6), noise_std=0.1),
    ):
        with pytest.raises(ValueError, match=r"^K: expected the camera matrix for points in px.*got none, and the point \(100, 80\)"):
            call()
    assert motion3d.estimate_motion(points, points * 0.01, np.array([[100.0, 0, 100], [0, 100, 50], [0, 0, 1]])).status


@pytest.mark.parametrize(
    ("call", "shape"),
    [
        (lambda: jacoflow.smooth(np.zeros((2, 3, 4, 5)), 1.0), "(2, 3, 4, 5)"),
        (lambda: jacoflow.smooth(np.zeros(7), 1.0), "(7,)"),
        (lambda: jacoflow.estimate(np.zeros((4, 5))), "(4, 5)"),
        (lambda: jacoflow.estimate(FRAMES, mask=np.ones((2, 3, 4), bool)), "(2, 3, 4)"),
        (lambda: io.write_flo("x.flo", np.zeros((4, 5))), "(4, 5)"),
        (lambda: motion3d.estimate_motion(np.zeros((4, 5)), np.zeros((4, 5))), "(4, 5)"),
        (lambda: jacoflow.corners(FRAMES[0], existing=np.zeros((4, 5))), "(4, 5)"),
        (lambda: segment.felzenszwalb(np.zeros((4, 5, 6, 7))), "(4, 5, 6, 7)"),
    ],
)
def test_shapes_are_printed_as_python_does(call, shape):
    with pytest.raises(ValueError) as error:
        call()
    assert shape in str(error.value) and "[" not in str(error.value)


HUGE = {
    "max_count": lambda n: jacoflow.corners(FRAMES[0], max_count=n),
    "window": lambda n: jacoflow.corners(FRAMES[0], window=n),
    "levels": lambda n: jacoflow.point_flow(*FRAMES[:2], [[5.0, 5.0]], levels=n),
    "random_state": lambda n: scenes.Scene("affine", random_state=n),
    "width": lambda n: scenes.Scene("affine", width=n),
    "index": lambda n: scenes.Sensor().apply(FRAMES[0], n),
    "start": lambda n: io.frames("x.npy", start=n),
    "threads": lambda n: jacoflow.estimate(FRAMES, threads=n),
    "n_components": lambda n: mixture.VariationalGaussianMixture(n).fit(np.zeros((5, 2))),
    "order": lambda n: __import__("jacoflow.reference").reference.derivative_kernels(n),
    "search": lambda n: track.StereoTracker(search=n),
    "n_particles": lambda n: track.ParticleTracker(np.zeros((9, 9, 3), np.uint8), {}, n_particles=n),
    "prior_radius": lambda n: stereo.edge_disparity(*FRAMES[:2], prior=np.zeros((24, 32)), prior_radius=n),
    "min_size": lambda n: segment.felzenszwalb(FRAMES[0], min_size=n),
}


@pytest.mark.parametrize("name", HUGE)
@pytest.mark.parametrize("number", [-1, -(2**40), -(2**70)])
def test_negative_integers_are_refused_by_name(name, number):
    with pytest.raises(ValueError, match=f"^{name}: expected"):
        HUGE[name](number)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: jacoflow.smooth(FRAMES[0], 10**400), "blur_sigma"),
        (lambda: jacoflow.quantise(FRAMES[0], 10**400), "step"),
        (lambda: jacoflow.corners(FRAMES[0], max_count=2**70), "max_count"),
        (lambda: jacoflow.estimate(FRAMES, fps=10**400), "fps"),
        (lambda: jacoflow.estimate(FRAMES, noise=10**400), "noise"),
        (lambda: scenes.Scene("affine", random_state=2**70), "random_state"),
        (lambda: scenes.Scene("affine").frame(10**400), "t"),
        (lambda: io.write_frames("x.npy", FRAMES, frame_rate=10**400), "frame_rate"),
        (lambda: mixture.VariationalGaussianMixture(2).fit([[10**400, 1], [2, 3]]), "X"),
    ],
)
def test_numbers_beyond_their_type_are_refused_by_name(call, name):
    with pytest.raises(ValueError, match=f"^{name}: expected"):
        call()


@pytest.mark.parametrize(
    ("call", "name"),
    [
        *((lambda draw=draw: draw(np.zeros((4, 5))), "field") for draw in (plot.flow_image, plot.flow_colour, plot.quiver, plot.divergence, plot.curl, plot.overview)),
        (lambda: plot.disparity(np.zeros((4, 5))), "found"),
        (lambda: plot.clusters(None), "step"),
        (lambda: plot.track_graph({}), "graph"),
        (lambda: io.write_npz("x.npz", np.zeros((4, 5, 2))), "field"),
        (lambda: __import__("jacoflow.reference").reference.mean_flow(np.zeros((4, 5, 2))), "flow"),
    ],
)
def test_objects_of_another_class_are_refused_by_name(call, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TypeError, match=f"^{name}: expected"):
        call()
    assert not list(tmp_path.iterdir())


def test_text_that_is_not_unicode_is_refused_by_name(tmp_path):
    field = jacoflow.flow(*FRAMES[:2])
    with pytest.raises(ValueError, match=r"^options: expected valid Unicode text, got 'made by \\ud800'"):
        io.write_npz(tmp_path / "field.npz", field, options="made by \ud800")
    with pytest.raises(ValueError, match="^name: expected valid Unicode text, got "):
        scenes.Scene("\ud800")
    assert not list(tmp_path.iterdir())


def test_motions_that_no_frame_can_show_are_refused():
    with pytest.raises(ValueError, match="^speed: expected at most 16 wavelengths a frame"):
        scenes.Scene("waves", speed=1e6)
    for name, parameter in (("waves", "speed"), ("vortex", "circulation"), ("affine", "u")):
        with pytest.raises(ValueError, match=f"^{parameter}: expected a number from -1e9 to 1e9, got 1e18"):
            scenes.Scene(name, **{parameter: 1e18})


def test_files_that_may_not_grow_have_the_code_of_the_system(tmp_path):
    """Nothing is left, and the archive that cannot be ended prints nothing of its own."""
    pytest.importorskip("resource")
    script = """
        import errno, resource, signal, sys
        import numpy as np
        import jacoflow
        frames = [np.random.default_rng(k).integers(0, 256, (60, 80)).astype(np.uint8) for k in range(2)]
        field = jacoflow.flow(*frames)
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
        for name, write in {"x.npz": field.save, "x.y4m": lambda path: jacoflow.io.write_frames(path, frames)}.items():
            try:
                write(f"{sys.argv[1]}/{name}")
            except OSError as error:
                assert error.errno == errno.EFBIG and error.filename.endswith(name), error
            else:
                raise AssertionError(name)
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert not list(tmp_path.iterdir())


def test_a_single_field_has_no_index():
    field = jacoflow.flow(*FRAMES[:2])
    for index in (0, "u", slice(2)):
        with pytest.raises(TypeError, match="^index: expected a stack of fields, got a single field"):
            field[index]


@pytest.mark.parametrize("array", ["mean", "root", "noise_scale"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308])
def test_states_that_no_filter_leaves_are_refused(array, value, tmp_path):
    filter_, path = FlowFilter(precision="float64"), tmp_path / "state.npz"
    filter_.push(FRAMES[0])
    filter_.save(path)
    arrays = dict(np.load(path))
    arrays[array].flat[3] = value
    np.savez(path, **arrays)
    with pytest.raises(jacoflow.FormatError, match=f"array '{array}' holds .*, expected numbers from"):
        filter_.load(path)
    arrays["root"].flat[0] = -1.0
    arrays[array].flat[3] = 0.0
    np.savez(path, **arrays)
    with pytest.raises(jacoflow.FormatError, match="array 'root' holds -1e0, expected numbers from 0"):
        filter_.load(path)
    assert filter_.push(FRAMES[1]).valid.any()


def test_a_run_that_fails_leaves_the_earlier_one(tmp_path):
    io.write_frames(tmp_path, FRAMES)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def broken():
        yield FRAMES[1]
        raise RuntimeError("the camera stopped")

    with pytest.raises(RuntimeError, match="the camera stopped"):
        io.write_frames(tmp_path, broken())
    with pytest.raises(TypeError):
        io.write_frames(tmp_path, [frame / 255 for frame in FRAMES])
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    # A run may take the place of what it is made of.
    assert io.write_frames(tmp_path, (frame // 2 for frame in io.frames(tmp_path))) == len(FRAMES)
    np.testing.assert_array_equal(next(io.frames(tmp_path)), FRAMES[0] // 2)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_no_hdf5_file(tmp_path):
    pytest.importorskip("h5py")
    os.mkfifo(tmp_path / "pipe.h5")
    with pytest.raises(jacoflow.FormatError, match="pipe.h5: expected a file"):
        io.frames(tmp_path / "pipe.h5")


def test_a_shorter_run_leaves_nothing_of_a_longer_one(tmp_path):
    (tmp_path / "frame_x.png").write_bytes(b"mine")
    io.write_frames(tmp_path, FRAMES)
    io.write_frames(tmp_path, FRAMES[:1])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frame_000000.png", "frame_x.png"]
    fields = jacoflow.estimate(np.array(FRAMES * 2), method="windowed")
    fields.save(tmp_path / "fields")
    fields[:2].save(tmp_path / "fields")
    assert len(list((tmp_path / "fields").iterdir())) == 2
    with pytest.raises(ValueError, match="^path: expected .*an empty name"):
        io.write_frames("", FRAMES)


def test_an_object_of_two_threads_says_so():
    frames = [np.random.default_rng(k).integers(0, 256, (400, 500)).astype(np.uint8) for k in range(3)]
    for make in (jacoflow.FlowEstimator, jacoflow.FlowFilter):
        shared, errors, begin = make(), [], threading.Barrier(4)

        def work(shared=shared, errors=errors, begin=begin):
            begin.wait()
            for frame in frames:
                try:
                    shared.push(frame)
                except RuntimeError as error:
                    errors.append(str(error))

        threads = [threading.Thread(target=work) for _ in range(4)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        wanted = f"{make.__name__}: expected one thread, got a call while another thread works with it; make one for each"
        assert set(errors) == {wanted}


def test_filters_of_wrong_sizes_name_them():
    for make in (filters.KalmanFilter, filters.ExtendedKalmanFilter):
        with pytest.raises(ValueError, match="dim_x"):
            make(0, 1)


def test_a_picture_as_large_as_memory_is_described(tmp_path):
    """Less than a megabyte that is 900 million pixels: 900 MB, and no more than that."""
    import struct
    import zlib

    side = 30_000
    packer = zlib.compressobj(1)
    rows = b"".join(packer.compress(bytes(side + 1)) for _ in range(side)) + packer.flush()
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)), (b"IDAT", rows), (b"IEND", b"")]
    path = tmp_path / "large.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks))
    page = tmp_path / "large.tif"
    strip = zlib.compress(bytes(1000 * side))
    tifffile.imwrite(page, iter([strip] * (side // 1000)), shape=(side, side), dtype=np.uint8, compression="zlib", rowsperstrip=1000)
    limited = "import resource, sys; import jacoflow.__main__ as program; resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]) << 20,) * 2); {}"
    info = "sys.argv = ['jacoflow', 'info', sys.argv[2]]; sys.exit(program.main())"
    read = """
try:
    program.sys.modules['jacoflow'].io.read_image(sys.argv[2])
except MemoryError as error:
    print(error)
"""

    def run(what, megabytes, file):
        return subprocess.run([sys.executable, "-c", limited.format(what), str(megabytes), str(file)], capture_output=True, text=True, check=False)

    ended = run(info, 3000, path)
    assert ended.returncode == 0 and f"width         {side}" in ended.stdout, ended.stderr
    # With less memory than that it is an error.
    for file in (path, page):
        words = f"{file}: expected what fits into memory"
        ended = run(info, 900, file)
        assert ended.returncode == 1 and words in ended.stderr, ended.stderr
        ended = run(read, 900, file)
        assert ended.returncode == 0 and ended.stdout.startswith(words), ended.stderr


def test_the_fuzzer_finds_nothing():
    """1500 files and calls made at random; `make fuzz` goes on for about an hour."""
    ended = subprocess.run([sys.executable, str(ROOT / "tests/fuzz"), "--cases", "1500", "--seed", "1"], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout


def test_the_fuzzer_knows_every_public_function(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(ROOT / "tests/fuzz"))
    import calls

    assert calls.public() <= set(calls.Recipes(tmp_path).all)
