"""Arrays in .npz, HDF5 and MATLAB files as frames, and files that only others read."""

import io as std_io
import pickle
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import jacoflow
from jacoflow import io

RNG = np.random.default_rng(6)
STACK = RNG.integers(0, 2000, (5, 12, 16)).astype(np.uint16)
COLOUR = RNG.integers(0, 256, (4, 12, 16, 3)).astype(np.uint8)


def save_npz(path, arrays):
    np.savez(path, **arrays)


def save_hdf5(path, arrays):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file[f"group/{name}" if name == "other" else name] = array


def in_matlab_order(array):
    return np.moveaxis(array, 0, -1) if array.ndim > 2 else array


def save_old_matlab(path, arrays):
    scipy = pytest.importorskip("scipy.io")
    scipy.savemat(path, {name: in_matlab_order(array) for name, array in arrays.items()})


def save_new_matlab(path, arrays):
    """As MATLAB 7.3: HDF5 with reversed axes behind a block of 512 bytes."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            file[name] = in_matlab_order(array).T
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


SAVERS = {"a.npz": save_npz, "a.h5": save_hdf5, "old.mat": save_old_matlab, "new.mat": save_new_matlab}


@pytest.fixture(params=list(SAVERS))
def saved(request, tmp_path):
    """A function that saves arrays in one of the formats, and returns the path."""

    def save(**arrays):
        SAVERS[request.param](tmp_path / request.param, arrays)
        return tmp_path / request.param

    return save


@pytest.mark.parametrize("share", [0.02, 0.5, 0.9])
def test_files_that_are_cut_off_are_damaged(saved, share):
    path = saved(frames=STACK)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(jacoflow.FormatError, match=path.name):
        list(io.frames(path))


def test_the_only_stack_is_read(saved):
    path = saved(frames=STACK, rate=np.array(25.0))
    reader = io.frames(path)
    assert reader.__length_hint__() == 5 and reader.frame_rate is None and reader.time is None
    got = list(reader)
    assert all(frame.dtype == np.uint16 for frame in got)
    assert_array_equal(got, STACK)
    assert_array_equal(list(io.frames(path, start=1, stop=5, step=2)), STACK[1:5:2])
    reader = io.frames(path, start=1)
    next(reader)
    assert_array_equal(list(pickle.loads(pickle.dumps(reader))), STACK[2:])


def test_a_single_frame_is_read(saved):
    assert_array_equal(list(io.frames(saved(picture=STACK[0]))), STACK[:1])


def test_several_arrays_need_a_name(saved):
    path = saved(left=STACK, right=STACK[::-1])
    with pytest.raises(jacoflow.FormatError, match=r"expected one array of frames, or its name as key=; the file holds left \(.*right"):
        io.frames(path)
    assert_array_equal(list(io.frames(path, key="right")), STACK[::-1])
    if path.suffix == ".h5":
        assert_array_equal(list(io.frames(path, key="/right")), STACK[::-1])
    with pytest.raises(ValueError, match=r"key: expected one of \['left', 'right'\], got 'middle'"):
        io.frames(path, key="middle")


def test_colour_is_treated_as_elsewhere(saved):
    path = saved(frames=COLOUR)
    with pytest.raises(jacoflow.FormatError, match="holds colour"):
        next(io.frames(path))
    assert_array_equal(list(io.frames(path, colour="rgb")), COLOUR)
    assert_array_equal(list(io.frames(path, colour="luminance")), [jacoflow.luminance(frame) for frame in COLOUR])
    grey = saved(frames=STACK)
    with pytest.raises(jacoflow.FormatError, match="colour is needed"):
        next(io.frames(grey, colour="rgb"))
    assert_array_equal(list(io.frames(grey, colour="rgb", grey="repeat")), np.repeat(STACK[..., None], 3, axis=3))


def test_mistakes_are_named(saved):
    path = saved(frames=STACK)
    for option, value in (("channel", 0), ("z", 1), ("colour", "green"), ("start", -1), ("step", 0)):
        with pytest.raises(ValueError, match=f"^{option}: expected"):
            io.frames(path, **{option: value})
    path.write_bytes(b"nothing of the kind" * 100)
    with pytest.raises(jacoflow.FormatError, match=path.name):
        io.frames(path)
    path.unlink()
    with pytest.raises(FileNotFoundError):
        io.frames(path)


@pytest.mark.parametrize("shape", [(2**40, 100, 100), (2**33, 1, 1), (2**62, 4, 4), (2**64 - 100, 1, 1), (2**70, 2, 2)])
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_an_archive_that_lies_about_its_size_is_damaged(shape, tmp_path):
    header = std_io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "|u1", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("frames.npy", header.getvalue() + bytes(100))
    with pytest.raises(jacoflow.FormatError, match="a.npz: "):
        io.frames(tmp_path / "a.npz")


def test_key_is_for_archives(tmp_path):
    np.save(tmp_path / "a.npy", STACK)
    with pytest.raises(ValueError, match="key: expected None"):
        io.frames(tmp_path / "a.npy", key="a")
    with pytest.raises(ValueError, match="channel: expected none, as only TIFF"):
        io.frames(tmp_path / "a.npy", channel=1)


@pytest.mark.parametrize("dtype", ["?", "i1", "u1", "<i2", ">i2", "<u2", ">u2", "i4", "u4", "i8", "u8", "f2", "f4", ">f4", "f8", ">f8"])
def test_samples_have_the_dtype_of_npy(dtype, tmp_path):
    array = (STACK % 2).astype(dtype)
    np.save(tmp_path / "a.npy", array)
    np.savez(tmp_path / "a.npz", array)
    expected, got = (next(io.frames(tmp_path / name)) for name in ("a.npy", "a.npz"))
    assert got.dtype == expected.dtype and got.dtype.isnative
    assert_array_equal(got, expected)


@pytest.mark.parametrize(("dtype", "value"), [("i8", 2**53 + 1), ("i8", -(2**63)), ("u8", 2**63)])
def test_integers_that_float64_does_not_hold_are_refused(dtype, value, tmp_path):
    array = np.full((2, 4, 5), value, dtype)
    np.save(tmp_path / "a.npy", array)
    np.savez(tmp_path / "a.npz", array)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(jacoflow.FormatError, match=rf"{name}: samples of 64 bits beyond 2\^53"):
            next(io.frames(tmp_path / name))


@pytest.mark.parametrize(("name", "module"), [("a.h5", "h5py"), ("new.mat", "h5py"), ("old.mat", "scipy")])
def test_missing_packages_are_named(name, module, tmp_path, monkeypatch):
    SAVERS[name](tmp_path / name, {"frames": STACK})
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, "scipy.io" if module == "scipy" else module, None)
    with pytest.raises(jacoflow.MissingDependencyError, match=f"needs {module}: pip install {module}"):
        io.frames(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "advice"),
    [("a.raw", "numpy.fromfile"), ("a.mraw", "pyMRAW"), ("a.cih", "pyMRAW"), ("a.cine", "pycine"), ("a.npz", "jacoflow.io.frames"), ("a.h5", "h5py"), ("a.mat", "scipy")],
)
def test_the_binary_says_what_can_be_done(name, advice, tmp_path):
    (tmp_path / name).write_bytes(b"x" * 64)
    command = [sys.executable, "-m", "jacoflow", "flow", str(tmp_path / name), "-o", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    is_read_in_python = name.rsplit(".", 1)[1] in ("npz", "h5", "mat")
    assert done.returncode == (3 if is_read_in_python else 1)
    assert advice in done.stderr and "ffmpeg" not in done.stderr
    if not is_read_in_python:
        with pytest.raises(jacoflow.FormatError, match=rf"{name}: .*{advice}"):
            io.frames(tmp_path / name)


@pytest.mark.parametrize("channels", [3, 4])
def test_one_colour_picture_is_not_taken_for_frames(saved, tmp_path, channels):
    picture = RNG.integers(0, 256, (12, 16, channels)).astype(np.uint8)
    # As MATLAB has it: savers move the first axis to the end.
    path = saved(picture=np.moveaxis(picture, -1, 0) if "mat" in saved(frames=STACK).suffix else picture)
    np.save(tmp_path / "a.npy", picture)
    for file in (path, tmp_path / "a.npy"):
        assert_array_equal(list(io.frames(file, colour="rgb")), [picture[..., :3]])
        assert_array_equal(list(io.frames(file, colour="luminance")), [jacoflow.luminance(picture)])
        if file.suffix == ".mat":
            assert_array_equal(list(io.frames(file)), np.moveaxis(picture, -1, 0))
            continue
        with pytest.raises(jacoflow.FormatError, match=rf"got shape \(12, 16, {channels}\): one colour picture, .*colour=\"luminance\""):
            next(io.frames(file))


def test_narrow_frames_in_matlab_are_frames(tmp_path):
    narrow = STACK[:, :, :3]
    save_old_matlab(tmp_path / "a.mat", {"frames": narrow})
    assert_array_equal(list(io.frames(tmp_path / "a.mat", colour="luminance")), narrow)


@pytest.mark.parametrize(("kind", "advice"), [("cell array", r"cat\(3, recording\{:\}\)"), ("sparse array", r"full\(recording\)")])
def test_other_variables_of_matlab_are_named(tmp_path, kind, advice):
    scipy_io = pytest.importorskip("scipy.io")
    sparse = pytest.importorskip("scipy.sparse")
    cells = np.empty(2, object)
    cells[:] = list(STACK[:2])
    values = {"cell array": cells, "sparse array": sparse.csc_matrix(np.eye(8))}
    scipy_io.savemat(tmp_path / "a.mat", {"recording": values[kind]})
    with pytest.raises(jacoflow.FormatError, match=rf"recording is a {kind}; expected an array of numbers. In MATLAB .*{advice}"):
        io.frames(tmp_path / "a.mat")


@pytest.mark.parametrize("key", [None, "recording"])
def test_a_struct_of_matlab_says_what_to_do(tmp_path, key):
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(tmp_path / "a.mat", {"recording": {"frames": STACK, "rate": 25.0}})
    with pytest.raises(jacoflow.FormatError, match=r"recording is a struct; expected an array of numbers. In MATLAB save .*loadmat"):
        io.frames(tmp_path / "a.mat", key=key)
