"""Compressed video: right frames, right brightness, files closed, clear refusals."""

import os
import pickle
import struct
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

import jacoflow
from jacoflow import io, video

av = pytest.importorskip("av")

WIDTH, HEIGHT, COUNT, RATE = 64, 48, 12, 25


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A lossless grey clip whose frame k has brightness 20 + 10 k and a bright square walking right."""
    path = tmp_path_factory.mktemp("video") / "clip.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=RATE)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "gray"
        for index in range(COUNT):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture(index), format="gray")))
        container.mux(stream.encode())
    return path


def picture(index):
    image = np.full((HEIGHT, WIDTH), 20 + 10 * index, dtype=np.uint8)
    image[10:20, 4 * index : 4 * index + 8] = 250
    return image


@pytest.mark.parametrize("grey", ["luma", "bt601"])
def test_frames_come_back(clip, grey):
    images = list(video.frames(clip, grey=grey))
    assert len(images) == COUNT
    for index, image in enumerate(images):
        assert image.dtype == np.uint8 and image.shape == (HEIGHT, WIDTH)
        assert np.abs(image.astype(int) - picture(index)).max() <= 1


def test_start_stop_and_step_choose_frames(clip):
    chosen = [int(image[0, 0]) for image in video.frames(clip, start=3, stop=10, step=3)]
    assert chosen == [50, 80, 110]
    assert list(video.frames(clip, start=5, stop=5)) == []
    assert len(list(video.frames(clip, start=10))) == 2


def test_colour_on_request(clip):
    image = next(video.frames(clip, grey=None))
    assert image.shape == (HEIGHT, WIDTH, 3) and (image[..., 0] == image[..., 2]).all()


def test_header_and_times(clip):
    with video.Video(clip, step=2) as opened:
        assert opened.frame_rate == RATE and opened.size == (WIDTH, HEIGHT)
        times = [time for time, _ in opened.timed()]
    assert np.allclose(times, np.arange(0, COUNT, 2) / RATE, atol=2e-3)


def test_leaving_the_loop_closes_the_file(clip, monkeypatch):
    closed = []
    close = video.Video.close
    monkeypatch.setattr(video.Video, "close", lambda self: (closed.append(True), close(self))[1])
    generator = video.frames(clip)
    next(generator)
    generator.close()
    assert closed == [True]


def test_a_closed_video_says_so(clip):
    opened = video.Video(clip)
    opened.close()
    opened.close()
    with pytest.raises(ValueError, match="closed"):
        next(iter(opened))


def test_files_that_are_no_video(tmp_path):
    with pytest.raises(FileNotFoundError):
        video.frames(tmp_path / "absent.mp4")
    text = tmp_path / "notes.mp4"
    text.write_text("no video at all " * 100)
    with pytest.raises(jacoflow.FormatError, match=r"notes\.mp4"):
        video.frames(text)


@pytest.mark.parametrize("option", [{"start": -1}, {"stop": -2}, {"step": 0}, {"grey": "red"}])
def test_bad_options_are_named_before_anything_is_read(clip, option):
    with pytest.raises(ValueError, match=next(iter(option))):
        video.frames(clip, **option)


def test_missing_pyav_says_how_to_get_it(clip, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(jacoflow.MissingDependencyError, match="PyAV"):
        video.frames(clip)


def encode(path, codec, pix_fmt, images, layout, *, milliseconds=None, rotation=None, rate=RATE):
    """Writes `images`, arrays in `layout`, as a video; `milliseconds`: times of the frames."""
    frames = [av.VideoFrame.from_ndarray(image, format=layout) for image in images]
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate)
        stream.width, stream.height, stream.pix_fmt = frames[0].width, frames[0].height, pix_fmt
        if rotation is not None:
            stream.set_display_rotation(rotation)
        if milliseconds is not None:
            stream.codec_context.time_base = Fraction(1, 1000)
        for index, frame in enumerate(frames):
            if milliseconds is not None:
                frame.pts, frame.time_base = milliseconds[index], Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


PICTURES = [picture(index) for index in range(4)]
# Luma of limited range.
LIMITED = 16 + np.array(PICTURES, float) * 219 / 255


@pytest.mark.parametrize(("pix_fmt", "shift"), [("gray12le", 4), ("gray16le", 0), ("yuv420p10le", 6)])
def test_deep_video_keeps_its_depth(pix_fmt, shift, tmp_path):
    deep = [(image.astype(np.uint16) << 8 | 0x35) >> shift for image in PICTURES]
    if pix_fmt.startswith("yuv"):
        middle = np.full((HEIGHT // 2, WIDTH), 512, np.uint16)
        path = encode(tmp_path / "deep.mkv", "ffv1", pix_fmt, [np.concatenate([image, middle]) for image in deep], pix_fmt)
    else:
        path = encode(tmp_path / "deep.mkv", "ffv1", pix_fmt, deep, pix_fmt)
    coded = list(io.frames(path))
    assert all(frame.dtype == np.uint16 for frame in coded)
    np.testing.assert_array_equal(coded, [image << shift for image in deep])
    for grey in ("luma", "bt601"):
        images = list(video.frames(path, grey=grey))
        assert all(image.dtype == np.uint16 for image in images)
        # Levels between those of 8 bit.
        assert (np.array(images) % 257 != 0).any()
        if pix_fmt.startswith("gray"):
            assert np.abs(np.array(images, int) - np.array(coded, int)).max() <= 16
    assert next(video.frames(path, grey=None)).dtype == np.uint16


@pytest.mark.parametrize(("rotation", "turn"), [(90, 1), (-90, 3), (180, 2)])
def test_rotated_video_is_turned_everywhere(rotation, turn, tmp_path):
    path = encode(tmp_path / "phone.mkv", "ffv1", "gray", PICTURES, "gray", rotation=rotation)
    want = [np.rot90(image, turn) for image in PICTURES]
    np.testing.assert_array_equal(list(io.frames(path)), want)
    shapes = {image.shape for image in video.frames(path)}
    assert shapes == {want[0].shape}


@pytest.mark.parametrize(
    ("reader", "codec", "name"),
    [("io", "ffv1", "a.avi"), ("video", "ffv1", "a.avi"), ("io", "mjpeg", "a.avi"), ("program", "ffv1", "a.mkv")],
)
def test_a_video_that_is_cut_off_says_so(reader, codec, name, monkeypatch, tmp_path):
    pictures = [np.random.default_rng(k).integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8) for k in range(6)]
    path = encode(tmp_path / name, codec, "gray" if codec == "ffv1" else "yuvj420p", pictures, "gray")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    if reader == "program":
        ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
        (tmp_path / "ffmpeg").symlink_to(ffmpeg)
        monkeypatch.setitem(sys.modules, "av", None)
        monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(jacoflow.FormatError, match=rf"{name}: cut off"):
        list(video.frames(path) if reader == "video" else io.frames(path, colour="luminance"))


def test_a_video_that_is_not_decoded_names_a_remedy(tmp_path):
    # An animated WebP, whose frames the decoder does not read.
    side, frame = (7).to_bytes(3, "little"), bytes(16)
    chunks = b"VP8X" + struct.pack("<I", 10) + b"\2\0\0\0" + side + side + b"ANIM" + struct.pack("<I", 6) + bytes(6)
    chunks += b"ANMF" + struct.pack("<I", len(frame)) + frame
    path = tmp_path / "a.webp"
    path.write_bytes(b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WEBP" + chunks)
    with pytest.raises(jacoflow.FormatError, match="a.webp: decoding stopped .*; if another program shows the video, save .* PNG"):
        next(io.frames(path, colour="luminance"))


@pytest.mark.parametrize("begun", [0, 3000])
def test_times_of_a_variable_frame_rate(tmp_path, begun):
    """Times count from the first frame, as in the binary."""
    path = encode(tmp_path / "vfr.mkv", "ffv1", "gray", PICTURES, "gray", milliseconds=[begun, begun + 40, begun + 100, begun + 300])
    np.testing.assert_allclose([time for time, _ in io.frames(path).timed()], [0, 0.04, 0.1, 0.3], atol=1e-9)
    reader = io.frames(path, start=1, step=2)
    assert reader.time is None
    next(reader)
    assert reader.time == pytest.approx(0.04)


def test_io_frames_opens_uncompressed_and_palette_video(tmp_path):
    colour = [np.repeat(image[..., None], 3, axis=2) for image in PICTURES]
    avi = encode(tmp_path / "raw.avi", "rawvideo", "bgr24", colour, "rgb24")
    frames = list(io.frames(avi))
    assert len(frames) == 4 and frames[0].shape == (HEIGHT, WIDTH)
    assert np.abs(np.array(frames, float) - LIMITED).max() <= 1
    assert np.abs(np.array(list(io.frames(avi, colour="rgb")), int) - np.array(colour)).max() <= 2
    colour[1][:, :10, 0] = 255
    red = encode(tmp_path / "red.avi", "rawvideo", "bgr24", colour, "rgb24")
    with pytest.raises(jacoflow.FormatError, match="holds colour"):
        list(io.frames(red))
    assert len(list(io.frames(red, colour="luminance", start=1))) == 3
    gif = tmp_path / "clip.gif"
    imageio = pytest.importorskip("imageio.v3")
    imageio.imwrite(gif, np.array(PICTURES), duration=40)
    frames = list(io.frames(gif))
    assert len(frames) == 4
    assert np.abs(np.array(frames, float) - LIMITED).max() <= 2


def test_readers_of_video_pickle_where_they_stand(clip):
    reader = io.frames(clip, start=2, step=3)
    first = next(reader)
    assert reader.frame_rate == pytest.approx(RATE / 3)
    rest = list(pickle.loads(pickle.dumps(reader)))
    assert [int(image[0, 0]) for image in [first, *rest]] == [40, 70, 100, 130]


def test_without_any_decoder_both_are_named(clip, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(jacoflow.MissingDependencyError, match=r"clip\.mkv: .*PyAV \(pip install .*\) or the program ffmpeg"):
        io.frames(clip)


def test_the_program_ffmpeg_gives_the_same_frames(clip, monkeypatch, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "ffmpeg").symlink_to(ffmpeg)
    colour = [np.repeat(image[..., None], 3, axis=2) for image in PICTURES]
    files = [
        clip,
        encode(tmp_path / "raw.avi", "rawvideo", "bgr24", colour, "rgb24"),
        encode(tmp_path / "deep.mkv", "ffv1", "gray12le", [image.astype(np.uint16) << 4 | 5 for image in PICTURES], "gray12le"),
        encode(tmp_path / "deep_rgb.mkv", "ffv1", "gbrp16le", [image.astype(np.uint16) << 8 | 0x35 for image in colour], "rgb48le"),
        encode(tmp_path / "vfr.mkv", "ffv1", "gray", PICTURES, "gray", milliseconds=[0, 40, 100, 300]),
        encode(tmp_path / "phone.mkv", "ffv1", "gray", PICTURES, "gray", rotation=90),
    ]
    for path in files:
        with_pyav = list(io.frames(path).timed())
        assert with_pyav[0][1].dtype == (np.uint16 if path.name.startswith("deep") else np.uint8)
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, "av", None)
            patch.setenv("PATH", str(tmp_path / "bin"))
            with_program = list(io.frames(path).timed())
        assert len(with_pyav) == len(with_program)
        for (time, frame), (other_time, other) in zip(with_pyav, with_program, strict=True):
            assert time == pytest.approx(other_time, abs=1e-3), path
            np.testing.assert_array_equal(frame, other, str(path))


def walking(positions):
    """A texture that moves right by whole pixels."""
    wide = np.random.default_rng(2).uniform(0, 200, (HEIGHT, WIDTH + 40))
    for axis in (0, 1):
        wide = sum(np.roll(wide, k, axis) for k in (-1, 0, 1)) / 3
    return [np.ascontiguousarray(wide[:, 30 - x : 30 - x + WIDTH]).astype(np.uint8) for x in positions]


def test_estimate_goes_by_the_times_of_the_frames(tmp_path):
    milliseconds = [0, 40, 80, 160, 200, 240]
    path = encode(tmp_path / "vfr.mkv", "ffv1", "gray", walking([0, 1, 2, 4, 5, 6]), "gray", milliseconds=milliseconds)
    stack = jacoflow.estimate(io.frames(path))
    inside = (slice(12, -12), slice(12, -12))
    speeds = [np.median(field.u[inside]) for field in stack[:-1]]
    np.testing.assert_allclose(speeds, 25, rtol=0.01)
    assert [field.frame_period for field in stack[:-1]] == pytest.approx([0.04, 0.04, 0.08, 0.04, 0.04])
    # Lengths of steps are those of a field's own frames.
    again = pickle.loads(pickle.dumps(stack))
    np.testing.assert_array_equal(again[2].advect([[20.0, 20.0]]), stack[2].advect([[20.0, 20.0]]))
    assert stack[2].advect([[20.0, 20.0]])[0, 0] == pytest.approx(22, abs=0.1)
    given = jacoflow.estimate(io.frames(path), fps=10)
    assert {field.frame_period for field in given} == {0.1}


def test_the_binary_opens_uncompressed_and_palette_video(tmp_path):
    """1 px a frame, 25 frames a second."""
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    (tmp_path / "ffmpeg").symlink_to(ffmpeg)
    frames = walking(range(4))
    encode(tmp_path / "raw.avi", "rawvideo", "bgr24", [np.repeat(frame[..., None], 3, axis=2) for frame in frames], "rgb24")
    pytest.importorskip("imageio.v3").imwrite(tmp_path / "clip.gif", np.array(frames), duration=40)
    encode(tmp_path / "vfr.mkv", "ffv1", "gray", walking([0, 1, 2, 4, 5]), "gray", milliseconds=[0, 40, 80, 160, 200])
    environment = {**os.environ, "PATH": str(tmp_path)}

    def run(*arguments):
        command = [sys.executable, "-m", "jacoflow", *arguments]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True).stdout.splitlines()

    for name in ("raw.avi", "clip.gif"):
        row = run("measure", name, "--luminance", "--quantity", "u", "--region", "12,12,40,24")[1].split(",")
        assert row[1] == "0.04" and row[7] == "px/s" and float(row[5]) == pytest.approx(25, rel=0.01), row
    # Rows of fields and states have the times that the video has for their frames.
    times = {"flow": ["0.04", "0.08", "0.16"], "filter": ["0.0", "0.04", "0.08", "0.16", "0.2"]}
    for command, expected in times.items():
        header, *rows = run(command, "vfr.mkv", "--points", "32,24")
        assert header.startswith("frame,time_s,x,y,status,u,v")
        assert [float(row.split(",")[1]) for row in rows] == pytest.approx([float(time) for time in expected], abs=1e-3)


def test_an_approach_through_a_lossy_codec(tmp_path):
    """Contact 2.98 s after the frame of the field, in H.264 with its usual loss."""
    if "libx264" not in av.codecs_available:
        pytest.skip("PyAV without libx264")
    frames = jacoflow.scenes.Scene("plane", width=160, height=120, time_to_contact=2.98 * RATE + 2).frames(5)
    noisy = [np.clip(np.rint(frame + np.random.default_rng(k).normal(0, 2, frame.shape)), 0, 255).astype(np.uint8) for k, frame in enumerate(frames)]
    path = encode(tmp_path / "approach.mp4", "libx264", "yuv420p", noisy, "gray")
    frames = list(io.frames(path))
    for used in (frames[1:4], frames[2:4]):
        field = jacoflow.flow(*used, fps=RATE)
        region = (20, 20, 120, 80)
        found = field.measure("time_to_contact", region)
        value, std, _ = field.region_mean("time_to_contact", region)
        assert abs(found.value - 2.98) < 4 * found.std and found.std < 1, found
        assert abs(value - 2.98) < 4 * std and std < 2, (value, std)


def test_rounded_times_of_an_even_rate_are_even(tmp_path):
    milliseconds = [round(1000 * k / 30) for k in range(5)]
    path = encode(tmp_path / "even.mkv", "ffv1", "gray", walking(range(5)), "gray", milliseconds=milliseconds, rate=30)
    reader = io.frames(path)
    rate = reader.frame_rate
    assert rate == pytest.approx(30)
    assert {field.frame_period for field in jacoflow.estimate(reader)} == {1 / rate}
