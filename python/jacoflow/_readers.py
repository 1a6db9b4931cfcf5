"""Which reader opens which file, and what `jacoflow.io.frames` returns."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from . import _coded, _stacks, video
from ._jacoflow import FormatError, MissingDependencyError, _kind_of, _open_frames
from ._request import Request

_STACKS: dict[str, Callable[[Request], FrameSource]] = {
    ".npz": _stacks.open_npz,
    ".h5": _stacks.open_hdf5,
    ".hdf5": _stacks.open_hdf5,
    ".mat": _stacks.open_matlab,
}
# Kinds of source, in the words of the compiled part: what only decoders of video read, TIFF by its content,
# and what the compiled part does not read (None: nothing there, or a name that is not UTF-8).
_VIDEO, _TIFF, _UNREAD = "ffmpeg", "tiff", ("unreadable", None)


class FrameSource(Protocol):
    """Frames one by one, with what is known of them."""

    def __next__(self) -> NDArray[Any]: ...
    def __length_hint__(self) -> int: ...
    @property
    def frame_rate(self) -> float | None: ...
    @property
    def time(self) -> float | None: ...
    @property
    def pixel_pitch(self) -> tuple[float, float] | None: ...
    @property
    def length_unit(self) -> str | None: ...


class FrameReader:
    """Reads frames (H, W), or (H, W, 3) with colour="rgb", one by one from the source of
    `jacoflow.io.frames`; memory stays bounded. Samples keep the file's dtype and grey levels.
    """

    def __init__(self, request: Request) -> None:
        """Made by `jacoflow.io.frames`, whose arguments `request` holds."""
        self._request = request
        self._delivered = 0
        self._source = _open(request)

    def __iter__(self) -> FrameReader:
        """The reader itself."""
        return self

    def __next__(self) -> NDArray[Any]:
        """The next frame."""
        frame = next(self._source)
        self._delivered += 1
        return frame

    def __length_hint__(self) -> int:
        """Frames left (a count, no unit), where that is known without reading them, else 0."""
        return self._source.__length_hint__()

    @property
    def frame_rate(self) -> float | None:
        """Frames per second as read (with `step` taken into account), where the source says so, else None: of
        video and Y4M the header's, of TIFF those of ImageJ (finterval, else fps) and OME-XML
        (TimeIncrement)."""
        return self._source.frame_rate

    @property
    def time(self) -> float | None:
        """Time in s of the last of the frames read: its own time stamp (video, OME-XML) or by the frame rate;
        None where the source says neither, and before the first frame."""
        return self._source.time

    @property
    def pixel_pitch(self) -> tuple[float, float] | None:
        """Width and height of a pixel in `length_unit`, where the source says so, else None: of TIFF those of
        ImageJ (resolution with a unit of length) and OME-XML (PhysicalSizeX, PhysicalSizeY)."""
        return self._source.pixel_pitch

    @property
    def length_unit(self) -> str | None:
        """Unit of `pixel_pitch` as the source spells it, else None."""
        return self._source.length_unit

    def timed(self) -> Iterator[tuple[float | None, NDArray[Any]]]:
        """The frames that are left with their times (`time`, s): pairs (time, array (H, W))."""
        for frame in self:
            yield self.time, frame

    def __repr__(self) -> str:
        """The source by its name."""
        return f"FrameReader({self._request.source!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        """Opens the source again at the next frame; TypeError for standard input."""
        if self._request.source == "-":
            raise TypeError("standard input cannot be pickled")
        start = self._request.start + self._delivered * self._request.step
        return FrameReader, (dataclasses.replace(self._request, start=start),)


def _open(request: Request) -> FrameSource:
    path, planes = request.source, (request.channel, request.z)
    options = (request.colour, request.grey, *planes, request.start, request.stop, request.step)
    kind = _kind_of(path, *options)
    suffix = Path(path).suffix.lower()
    if suffix in _STACKS and kind in _UNREAD:
        _expect_no_planes(request)
        return _STACKS[suffix](request)
    if request.key is not None:
        raise ValueError(f"key: expected None, as only .npz, .h5 and .mat files hold named arrays, got {request.key!r}")
    if kind == _VIDEO:
        _expect_no_planes(request)
        return _open_video(request)
    if kind == _TIFF:
        return _open_tiff(request, options)
    return _open_frames(path, *options)


def _expect_no_planes(request: Request) -> None:
    for name, value in (("channel", request.channel), ("z", request.z)):
        if value is not None:
            raise ValueError(f"{name}: expected None, as only TIFF files name such an axis, got {value!r}")


def _open_tiff(request: Request, options: tuple[Any, ...]) -> FrameSource:
    """The built-in reader; tifffile where that does not know the file's kind."""
    try:
        next(_open_frames(request.source, *options), None)
    except MissingDependencyError:
        fallback = _stacks.open_tifffile(request)
        if fallback is None:
            raise
        return fallback
    return _open_frames(request.source, *options)


def _open_video(request: Request) -> FrameSource:
    """PyAV where it is installed, else the program ffmpeg."""
    try:
        return VideoSource(request)
    except MissingDependencyError:
        pass
    try:
        return _open_frames(
            request.source, request.colour, request.grey, None, None, request.start, request.stop, request.step
        )
    except MissingDependencyError as error:
        message = 'reading video needs PyAV (pip install "jacoflow[video]") or the program ffmpeg on the PATH; neither is there'
        raise MissingDependencyError(f"{request.source}: {message}") from error


class _CodedVideo(video.Video):
    """Frames as the program ffmpeg gives them: luma as coded, or red, green and blue."""

    def __init__(self, request: Request) -> None:
        """The video of a request."""
        super().__init__(request.source, start=request.start, stop=request.stop, step=request.step, grey=None)
        self._colour = request.colour

    def _image(self, frame: Any) -> NDArray[Any]:
        if self._colour == "rgb":
            return super()._image(frame)
        if self._colour != "luminance" and _coded.holds_colour(frame):
            raise FormatError(f'{self._path}: holds colour; expected grey. Ask for luminance (its luma) by colour="luminance"')
        return _coded.luma(frame)


class VideoSource:
    """Frames of a video through PyAV."""

    pixel_pitch: tuple[float, float] | None = None
    length_unit: str | None = None

    def __init__(self, request: Request) -> None:
        """Opens the file and reads its header."""
        self._video = _CodedVideo(request)
        rate = self._video.frame_rate
        self.frame_rate = rate / request.step if rate else None
        self.time: float | None = None
        self._frames = self._video.timed()

    def __length_hint__(self) -> int:
        return 0

    def __next__(self) -> NDArray[Any]:
        try:
            self.time, frame = next(self._frames)
        except StopIteration:
            self._video.close()
            raise
        return frame
