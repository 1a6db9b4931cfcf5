"""Frames out of compressed video with PyAV (an optional part: `pip install "jacoflow[video]"`).

    for frame in jacoflow.video.frames("clip.mp4", stop=100):
        field = estimator.push(frame)
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _coded
from ._checks import path_of
from ._jacoflow import FormatError, MissingDependencyError

__all__ = ["Video", "frames"]


def frames(
    path: str | os.PathLike[str],
    *,
    start: int = 0,
    stop: int | None = None,
    step: int = 1,
    grey: Literal["luma", "bt601"] | None = "luma",
) -> Iterator[NDArray[Any]]:
    """The frames of a video one by one, as grey arrays (H, W), uint8 or, where the video has more than 8 bit,
    uint16; memory stays bounded for any length, and the file is closed when the loop ends or is left. Frames
    are turned as the file says for the display (phones).

    Parameters
    ----------
    path
        The video file.
    start, stop, step
        Frames `start`, `start + step`, ... before `stop`, counted from 0 in the order they are shown.
    grey
        "luma": the video's own brightness, stretched to 0..255 or 0..65535 (fast). "bt601": 0.299 R + 0.587 G
        + 0.114 B, rounded. None: colour, arrays (H, W, 3) of red, green, blue.

    Raises
    ------
    MissingDependencyError
        PyAV is not installed.
    FormatError
        The file is no video that can be decoded, or is cut off.
    """
    # Checked here and not at the first frame, so that mistakes show where they are made.
    video = Video(path, start=start, stop=stop, step=step, grey=grey)
    return _until_done(video)


def _until_done(video: Video) -> Iterator[NDArray[Any]]:
    with video:
        for _, image in video.timed():
            yield image


class Video:
    """A video file, open for reading: a context manager, and an iterable of arrays (H, W), uint8 or uint16.
    Parameters as in `frames`.

    >>> with jacoflow.video.Video("clip.mp4") as video:  # doctest: +SKIP
    ...     print(video.frame_rate, video.size)
    ...     for time, image in video.timed():
    ...         ...
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        start: int = 0,
        stop: int | None = None,
        step: int = 1,
        grey: Literal["luma", "bt601"] | None = "luma",
    ) -> None:
        """Opens the file and reads its header; shapes and units as in `frames`."""
        for name, value in (("start", start), ("stop", stop), ("step", step)):
            if not isinstance(value, int | np.integer) and not (name == "stop" and value is None):
                raise TypeError(f"{name}: expected an integer, got {type(value).__name__}")
        if start < 0:
            raise ValueError(f"start: expected 0 or more frames, got {start}")
        if stop is not None and stop < 0:
            raise ValueError(f"stop: expected 0 or more frames, got {stop}")
        if step < 1:
            raise ValueError(f"step: expected a positive number of frames, got {step}")
        if grey not in ("luma", "bt601", None):
            raise ValueError(f"grey: expected 'luma', 'bt601' or None, got {grey!r}")
        self._av = _pyav()
        self._path = path_of("path", path)
        self._start, self._stop, self._step, self._grey = start, stop, step, grey
        self._container: Any = self._open()

    def _open(self) -> Any:
        try:
            container = self._av.open(self._path)
        except FileNotFoundError:
            raise
        except (self._av.FFmpegError, ValueError) as error:
            raise FormatError(f"{self._path}: not a video that can be decoded ({error})") from error
        if not container.streams.video:
            container.close()
            raise FormatError(f"{self._path}: holds no video stream")
        container.streams.video[0].thread_type = "AUTO"
        return container

    @property
    def _stream(self) -> Any:
        if self._container is None:
            raise ValueError(f"{self._path}: the video is closed")
        return self._container.streams.video[0]

    @property
    def frame_rate(self) -> float | None:
        """Frames a second of the file (before `step`); None where the file does not say. The frame period in
        s is `step / frame_rate`."""
        rate = self._stream.average_rate
        return float(rate) if rate else None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of a frame as coded, px; a video that is shown turned by a quarter has frames of
        (height, width)."""
        return self._stream.width, self._stream.height

    @property
    def length(self) -> int | None:
        """Number of frames in the file (before `start`, `stop`, `step`); None where the file does not say."""
        count = self._stream.frames
        return int(count) if count else None

    def timed(self) -> Iterator[tuple[float | None, NDArray[Any]]]:
        """The frames with their time in s since the first frame of the video (None where the file has none):
        pairs (time, array (H, W))."""
        stream, begun = self._stream, None
        if self._stop is not None and self._stop <= self._start:
            return
        try:
            for index, frame in enumerate(self._decoded(stream)):
                begun = frame.time if index == 0 else begun
                if index >= self._start and (index - self._start) % self._step == 0:
                    time = None if frame.time is None or begun is None else frame.time - begun
                    yield time, _coded.upright(self._image(frame), frame)
                if self._stop is not None and index + 1 >= self._stop:
                    return
        except self._av.FFmpegError as error:
            raise FormatError(
                f"{self._path}: decoding stopped ({error}); if another program shows the video, save its frames there as a "
                "folder of PNG files"
            ) from error

    def _decoded(self, stream: Any) -> Iterator[Any]:
        """The frames; `FormatError` where the file is cut off amid one, which decoders fill up."""
        count = 0
        for packet in self._container.demux(stream):
            if packet.is_corrupt:
                raise FormatError(f"{self._path}: cut off or damaged after {count} frames")
            for frame in packet.decode():
                count += 1
                yield frame

    def _image(self, frame: Any) -> NDArray[Any]:
        is_deep = _coded.depth(frame) > 8
        if self._grey == "luma":
            luma: NDArray[Any] = frame.to_ndarray(format="gray16le" if is_deep else "gray")
            return luma
        colour: NDArray[Any] = frame.to_ndarray(format="rgb48le" if is_deep else "rgb24")
        if self._grey is None:
            return colour
        weighted = colour @ np.array([0.299, 0.587, 0.114])
        rounded: NDArray[Any] = np.rint(weighted).astype(colour.dtype)
        return rounded

    def __iter__(self) -> Iterator[NDArray[Any]]:
        """The frames, arrays (H, W)."""
        for _, image in self.timed():
            yield image

    def close(self) -> None:
        """Closes the file; a second time does nothing."""
        if self._container is not None:
            self._container.close()
            self._container = None

    def __enter__(self) -> Video:
        """The video itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Closes the file."""
        self.close()


def _pyav() -> Any:
    """PyAV, or an error that says how to get it."""
    try:
        import av
    except ImportError as error:
        raise MissingDependencyError('reading compressed video needs PyAV: pip install "jacoflow[video]"') from error
    return av
