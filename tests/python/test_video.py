"""Compressed video: right frames, right brightness, files closed, clear refusals."""

import sys

import numpy as np
import pytest

import jacoflow
from jacoflow import video

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
