"""Frames and flow in and out of files."""

import os
import pickle
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import jacoflow
from jacoflow import io


@pytest.fixture
def frames():
    return np.random.default_rng(1).integers(0, 256, (5, 12, 16)).astype(np.uint8)


@pytest.mark.parametrize("name", ["stack.npy", "clip.y4m", "folder"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_frames_round_trip(frames, name, dtype, tmp_path):
    frames = frames.astype(dtype) * (257 if dtype == np.uint16 else 1)
    path = tmp_path / name
    assert io.write_frames(path, frames, frame_rate=50.0) == 5
    reader = io.frames(path)
    back = list(reader)
    assert all(frame.dtype == dtype for frame in back)
    assert_array_equal(back, frames)
    if name.endswith("y4m"):
        assert reader.frame_rate == 50.0


@pytest.mark.parametrize(
    ("rate", "header"),
    [
        (24, "F24:1"),
        (30000 / 1001, "F30000:1001"),
        (29.97, "F30000:1001"),
        (12.5, "F25:2"),
        (1 / 3600, "F1:3600"),
        (1 / 86400, "F1:86400"),
        (1e-9, "F1:1000000000"),
    ],
)
def test_frame_rates_of_y4m(frames, rate, header, tmp_path):
    path = tmp_path / "clip.y4m"
    io.write_frames(path, frames, frame_rate=rate)
    assert header in path.read_bytes().split(b"\n")[0].decode().split()
    assert io.frames(path).frame_rate == pytest.approx(rate, rel=1.001e-6)


@pytest.mark.parametrize("rate", [1e300, 1e-10])
def test_frame_rates_that_y4m_cannot_hold_are_refused(frames, rate, tmp_path):
    with pytest.raises(ValueError, match="^frame_rate: expected from 1/2147483647 to 2147483647 frames per second, .*, got 1e"):
        io.write_frames(tmp_path / "clip.y4m", frames, frame_rate=rate)
    assert not list(tmp_path.iterdir())


def test_any_dtype_goes_into_a_stack(frames, tmp_path):
    for dtype in (np.float32, np.float64):
        io.write_frames(tmp_path / "stack.npy", (frame.astype(dtype) for frame in frames))
        assert_array_equal(np.load(tmp_path / "stack.npy"), frames.astype(dtype))
    with pytest.raises((ValueError, TypeError), match="frame"):
        io.write_frames(tmp_path / "clip.y4m", frames.astype(np.float32))
    assert not (tmp_path / "clip.y4m").exists()


def test_parts_of_a_source(frames, tmp_path):
    io.write_frames(tmp_path / "stack.npy", frames)
    assert_array_equal(list(io.frames(tmp_path / "stack.npy", start=1, step=2)), frames[1::2])
    assert_array_equal(list(io.frames(tmp_path / "stack.npy", stop=2)), frames[:2])
    for option in ({"start": -1}, {"step": 0}, {"stop": -1}):
        with pytest.raises(ValueError, match=next(iter(option))):
            io.frames(tmp_path / "stack.npy", **option)


def test_readers_pickle_where_they_stand(frames, tmp_path):
    io.write_frames(tmp_path / "folder", frames)
    reader = io.frames(tmp_path / "folder", stop=4)
    next(reader)
    other = pickle.loads(pickle.dumps(reader))
    assert_array_equal(list(other), frames[1:4])
    assert_array_equal(list(reader), frames[1:4])


def test_a_source_feeds_an_estimator(tmp_path):
    frames = np.clip(np.round(jacoflow.scenes.Scene("affine", width=32, height=32).frames(4)), 0, 255).astype(np.uint8)
    io.write_frames(tmp_path / "folder", frames)
    estimator = jacoflow.FlowEstimator()
    streamed = [estimator.push(frame) for frame in io.frames(tmp_path / "folder")]
    assert_array_equal(streamed[-1].flow, jacoflow.estimate(frames, ends="drop")[1].flow)


def test_an_error_in_the_middle_leaves_no_file(frames, tmp_path):
    def broken():
        yield frames[0]
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        io.write_frames(tmp_path / "stack.npy", broken())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("write", "read", "name"), [(io.write_flo, io.read_flo, "x.flo"), (io.write_kitti, io.read_kitti, "x.png")])
def test_flow_round_trip(write, read, name, tmp_path):
    flow = np.random.default_rng(2).normal(0, 5, (7, 9, 2)).astype(np.float32)
    flow[2, 3] = np.nan
    write(tmp_path / name, flow)
    np.testing.assert_allclose(read(tmp_path / name), flow, atol=1 / 128 + 1e-6)
    with pytest.raises(ValueError, match="flow: expected shape"):
        write(tmp_path / name, flow[..., 0])


@pytest.mark.parametrize("shape", [(4, 6), (4, 6, 3)])
def test_float_maps_round_trip(shape, tmp_path):
    values = np.random.default_rng(3).normal(size=shape).astype(np.float32)
    io.write_pfm(tmp_path / "x.pfm", values)
    assert_array_equal(io.read_pfm(tmp_path / "x.pfm"), values)


def test_images(frames, tmp_path):
    io.write_frames(tmp_path / "folder", frames[:1])
    (path,) = (tmp_path / "folder").iterdir()
    assert_array_equal(io.read_image(path), frames[0])


@pytest.mark.parametrize(("largest", "levels"), [(255, [0, 1, 100]), (100, [0, 3, 255]), (65535, [0, 1, 100]), (1023, [0, 64, 6406])])
@pytest.mark.parametrize("kind", ["P2", "P5"])
def test_white_of_a_pgm_is_that_of_the_dtype(largest, levels, kind, tmp_path):
    samples = np.array([0, 1, 100], np.uint8 if largest < 256 else ">u2")
    body = b"0 1 100\n" if kind == "P2" else samples.tobytes()
    (tmp_path / "a.pgm").write_bytes(f"{kind}\n3 1\n{largest}\n".encode() + body)
    assert_array_equal(io.read_image(tmp_path / "a.pgm"), [levels])


@pytest.mark.parametrize(("orientation", "turned"), [(1, lambda a: a), (3, lambda a: a[::-1, ::-1]), (6, lambda a: np.rot90(a, -1)), (8, np.rot90)])
def test_photographs_are_turned_as_they_say(orientation, turned, tmp_path):
    image = pytest.importorskip("PIL.Image")
    levels = np.add.outer(np.arange(32), 3 * np.arange(48)).astype(np.uint8)
    exif = image.Exif()
    exif[0x0112] = orientation
    image.fromarray(levels).save(tmp_path / "a.jpg", quality=100, exif=exif)
    (frame,) = io.frames(tmp_path / "a.jpg")
    assert frame.shape == turned(levels).shape
    assert np.abs(frame - turned(levels).astype(float)).max() < 3


def test_animated_png_is_no_picture(frames, tmp_path):
    image = pytest.importorskip("PIL.Image")
    first, *others = map(image.fromarray, frames)
    first.save(tmp_path / "a.png", save_all=True, append_images=others)
    with pytest.raises(jacoflow.FormatError, match="animated PNG, of several pictures"):
        io.read_image(tmp_path / "a.png")


@pytest.mark.parametrize("kind", range(1, 7))
def test_several_pictures_in_one_pnm_are_not_one(kind, tmp_path):
    samples = 8 * 6 * (3 if kind in (3, 6) else 1)
    pixels = b"0 " * samples + b"\n# a comment: P2\n" if kind < 4 else bytes(samples // 8 if kind == 4 else samples)
    picture = f"P{kind}\n8 6\n{'' if kind in (1, 4) else '255'}\n".encode().replace(b"\n\n", b"\n") + pixels
    (tmp_path / "one.pnm").write_bytes(picture + b"\n")
    assert io.read_image(tmp_path / "one.pnm", colour="luminance").shape == (6, 8)
    (tmp_path / "two.pnm").write_bytes(picture + picture)
    with pytest.raises(jacoflow.FormatError, match="several PGM or PPM pictures in one file"):
        io.read_image(tmp_path / "two.pnm", colour="luminance")


@pytest.mark.parametrize(
    "content", [b"P2\n2 1\n100\n7 101\n", b"P5\n2 1\n100\n\x07\x65", b"P5\n2 1\n1000\n\x00\x07\x03\xe9", b"P3\n1 1\n9\n1 2 10\n", b"P6\n1 1\n9\n\1\2\12"]
)
def test_samples_above_the_maximum_of_a_pgm_are_refused(content, tmp_path):
    (tmp_path / "a.pnm").write_bytes(content)
    with pytest.raises(jacoflow.FormatError, match="holds a sample of (101|1001|10); expected at most (100|1000|9), the maximum in its header"):
        io.read_image(tmp_path / "a.pnm", colour="luminance")


@pytest.mark.parametrize("saved", ["a.npy", "a.y4m"])
@pytest.mark.parametrize("name", ["a", "a.dat", "a.npz", "a.tif"])
def test_stacks_are_read_under_any_name(frames, saved, name, tmp_path):
    frames = [frame.astype(np.uint8) for frame in frames]
    io.write_frames(tmp_path / saved, frames)
    (tmp_path / saved).rename(tmp_path / name)
    assert_array_equal(list(io.frames(tmp_path / name)), frames)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
@pytest.mark.parametrize("suffix", [b".npy", b".tif", b".y4m"])
def test_names_that_are_not_utf8_are_refused_by_argument(frames, suffix, tmp_path):
    path = os.fsdecode(os.fsencode(tmp_path) + b"/n\xe9" + suffix)
    with open(path, "wb") as file:
        np.save(file, np.array(frames))
    with pytest.raises(ValueError, match="^source: expected a name in UTF-8"):
        io.frames(path)
    with pytest.raises(ValueError, match="^path: expected a name in UTF-8"):
        io.write_frames(path, frames)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_archives_are_read_under_names_that_are_not_utf8(frames, tmp_path):
    path = os.fsdecode(os.fsencode(tmp_path) + b"/n\xe9.npz")
    with open(path, "wb") as file:
        np.savez(file, np.array(frames))
    assert_array_equal(list(io.frames(path)), frames)


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_a_field_with_damaged_variances_is_refused(value, tmp_path):
    path = tmp_path / "field.npz"
    field = jacoflow.flow(*jacoflow.scenes.Scene("affine", width=32, height=32).frames(3), covariance=True)
    assert field.valid[16, 16]
    field.save(path)
    io.read_npz(path)
    arrays = dict(np.load(path))
    arrays["covariance"][0, 16, 16] = value
    np.savez(path, **arrays)
    with pytest.raises(jacoflow.FormatError, match=r"field\.npz: .*'covariance' holds .* at row 16, column 16"):
        io.read_npz(path)


def test_a_field_of_negative_width_is_named(tmp_path):
    (tmp_path / "a.flo").write_bytes(np.float32(202021.25).tobytes() + np.array([-5, 7], "<i4").tobytes())
    with pytest.raises(jacoflow.FormatError, match="a field of -5 x 7 px"):
        io.read_flo(tmp_path / "a.flo")


@pytest.mark.parametrize("name", ["a.npy", "a.y4m", "a"])
def test_no_frames_make_no_file(name, tmp_path):
    with pytest.raises(ValueError, match=r"^frames: expected at least one frame \(H, W\), got none"):
        io.write_frames(tmp_path / name, iter([]))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.npy", "a.y4m", "a", "a/b"])
def test_frames_that_end_in_an_error_leave_nothing(name, frames, tmp_path):
    def broken():
        yield frames[0]
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        io.write_frames(tmp_path / name, broken())
    assert not list(tmp_path.iterdir())


@pytest.fixture
def colour_frames():
    return np.random.default_rng(4).integers(0, 256, (4, 10, 12, 3)).astype(np.uint8)


@pytest.mark.parametrize("name", ["stack.npy", "clip.y4m", "folder"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_colour_round_trips(colour_frames, name, dtype, tmp_path):
    frames = colour_frames.astype(dtype) * (257 if dtype == np.uint16 else 1)
    assert io.write_frames(tmp_path / name, frames, frame_rate=50.0) == 4
    back = np.array(list(io.frames(tmp_path / name, colour="rgb")))
    assert back.dtype == dtype and back.shape == frames.shape
    # Y4M rounds luma and chroma: at most (1 + 1.772) / 2 levels before the last rounding.
    apart = np.abs(back.astype(int) - frames).max()
    assert apart <= (1 if name.endswith("y4m") else 0)
    part = list(io.frames(tmp_path / name, colour="rgb", start=1, step=2))
    assert_array_equal(part, back[1::2])


def test_colour_stacks_hold_floats_in_any_order(colour_frames, tmp_path):
    values = np.asfortranarray(colour_frames / 255.0)
    np.save(tmp_path / "stack.npy", values)
    assert_array_equal(list(io.frames(tmp_path / "stack.npy", colour="rgb")), values)
    io.write_frames(tmp_path / "again.npy", list(values))
    assert_array_equal(np.load(tmp_path / "again.npy"), values)


def test_colour_images(colour_frames, tmp_path):
    io.write_frames(tmp_path / "folder", colour_frames[:1])
    (path,) = (tmp_path / "folder").iterdir()
    assert_array_equal(io.read_image(path, colour="rgb"), colour_frames[0])
    assert_array_equal(io.read_image(path, colour="luminance"), jacoflow.luminance(colour_frames[0]))
    with pytest.raises(jacoflow.FormatError, match="holds colour"):
        io.read_image(path)


def test_grey_says_that_colour_is_needed(frames, tmp_path):
    io.write_frames(tmp_path / "folder", frames)
    for name in ("stack.npy", "clip.y4m", "folder"):
        io.write_frames(tmp_path / name, frames)
        with pytest.raises(jacoflow.FormatError, match="colour is needed"):
            next(io.frames(tmp_path / name, colour="rgb"))
        repeated = list(io.frames(tmp_path / name, colour="rgb", grey="repeat"))
        assert_array_equal(repeated, np.repeat(frames[..., None], 3, axis=3))


def test_colour_readers_pickle_where_they_stand(frames, colour_frames, tmp_path):
    io.write_frames(tmp_path / "colour", colour_frames)
    reader = io.frames(tmp_path / "colour", colour="rgb")
    next(reader)
    assert_array_equal(list(pickle.loads(pickle.dumps(reader))), colour_frames[1:])
    io.write_frames(tmp_path / "grey", frames)
    reader = pickle.loads(pickle.dumps(io.frames(tmp_path / "grey", colour="rgb", grey="repeat")))
    assert next(reader).shape == (*frames[0].shape, 3)


def test_wrong_colour_arguments_are_named(frames, colour_frames, tmp_path):
    io.write_frames(tmp_path / "folder", frames)
    for options, name in [({"colour": "green"}, "colour"), ({"colour": "rgb", "grey": "no"}, "grey"), ({"grey": "repeat"}, "grey")]:
        with pytest.raises(ValueError, match=f"^{name}: expected"):
            io.frames(tmp_path / "folder", **options)
    with pytest.raises(ValueError, match="frames: expected a colour frame .*colour is needed"):
        io.write_frames(tmp_path / "mixed.npy", [colour_frames[0], frames[0]])
    with pytest.raises(ValueError, match="frames: expected a grey frame"):
        io.write_frames(tmp_path / "mixed.npy", [frames[0], colour_frames[0]])
    assert not (tmp_path / "mixed.npy").exists()
