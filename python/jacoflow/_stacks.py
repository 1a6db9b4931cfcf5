"""Arrays in files of several kinds, as sequences of frames: .npz, HDF5, MATLAB, and TIFF through tifffile."""

from __future__ import annotations

import dataclasses
import importlib
import math
import os
import weakref
import zipfile
import zlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._jacoflow import FormatError, MissingDependencyError, luminance
from ._request import Request

Frame = NDArray[Any]

_COLOUR_MODELS = ("MINISWHITE", "MINISBLACK", "RGB", "PALETTE", "YCBCR", "CFA")
"""PhotometricInterpretation of TIFF whose values are grey, or come as RGB."""


_LARGEST_EXACT = 2**53
"""Magnitude up to which float64 holds every integer."""


class Stack:
    """Frames 0 to `count` of `get`, those of the request, by its rule for colour."""

    frame_rate: float | None = None
    time: float | None = None
    pixel_pitch: tuple[float, float] | None = None
    length_unit: str | None = None

    def __init__(self, request: Request, count: int, get: Callable[[int], Frame]) -> None:
        """`get(index)`: a frame (H, W), or (H, W, C) with C = 1, 3 or 4."""
        self._request, self._get = request, get
        self._indices = list(range(count)[request.start : request.stop : request.step])[::-1]

    def __length_hint__(self) -> int:
        return len(self._indices)

    def __next__(self) -> Frame:
        if not self._indices:
            raise StopIteration
        return _presented(self._get(self._indices.pop()), self._request)


def _samples(frame: Frame, request: Request) -> Frame:
    """A frame in the dtype of frames that holds its samples exactly, as of .npy files; in native byte
    order."""
    kind, size = frame.dtype.kind, frame.dtype.itemsize
    if kind not in "biuf" or size > 8:
        raise FormatError(f"{request.source}: holds samples of type {frame.dtype}; expected integers or floats of up to 64 bits")
    if size == 8 and kind in "iu" and not (-_LARGEST_EXACT <= int(frame.min(initial=0)) and int(frame.max(initial=0)) <= _LARGEST_EXACT):
        raise FormatError(f"{request.source}: samples of 64 bits beyond 2^53, which float64 does not hold exactly")
    narrow: dict[str, Any] = {"b": np.uint8, "u": np.uint8 if size == 1 else np.uint16, "i": np.float32, "f": np.float32}
    wide = size > (4 if kind == "f" else 2)
    return frame.astype(np.float64 if wide else narrow[kind], copy=False)


def _presented(frame: Frame, request: Request) -> Frame:
    """A frame by the rules for samples and for colour."""
    frame = _samples(frame, request)
    if frame.ndim == 3 and frame.shape[2] == 1:
        frame = frame[..., 0]
    if frame.ndim == 3 and frame.shape[2] not in (3, 4):
        raise FormatError(f"{request.source}: holds {frame.shape[2]} values a pixel; expected grey (1) or colour (3 or 4)")
    if request.colour == "rgb":
        if frame.ndim == 3:
            return np.ascontiguousarray(frame[..., :3])
        if request.grey != "repeat":
            raise FormatError(f"{request.source}: holds grey; colour is needed (red, green and blue)")
        return np.repeat(frame[..., None], 3, axis=2)
    if frame.ndim == 2:
        return np.ascontiguousarray(frame)
    if request.colour != "luminance":
        raise FormatError(f'{request.source}: holds colour; expected grey. Ask for luminance by colour="luminance"')
    return luminance(np.ascontiguousarray(frame[..., :3]))


def _stack(
    request: Request, shape: tuple[int, ...], get: Callable[[int], Frame], whole: Callable[[], Frame], *, is_time_last: bool = False
) -> Stack:
    """A stack (T, H, W) or (T, H, W, C), with `is_time_last` (H, W, T) or (H, W, C, T), or one frame (H, W),
    in colour (H, W, 3 or 4)."""
    match shape:
        case (_, _):
            return Stack(request, 1, lambda _: whole())
        case (_, _, 3 | 4) if request.colour in ("luminance", "rgb"):
            return Stack(request, 1, lambda _: whole())
        case (_, rows, 3 | 4 as columns) if rows > 4 and not is_time_last:
            raise FormatError(
                f"{request.source}: expected a stack (T, H, W), got shape {shape}: one colour picture, or frames {columns} px wide; "
                'for a picture ask for luminance by colour="luminance" (or "rgb"), or transpose a stack to (T, H, W)'
            )
    if is_time_last:
        shape = (*shape[-1:], *shape[:-1])
    match shape:
        case (count, _, _) | (count, _, _, 1 | 3 | 4):
            return Stack(request, count, get)
    raise FormatError(f"{request.source}: expected a stack (T, H, W), a frame (H, W) or colour (T, H, W, 3), got shape {shape}")


def _chosen(request: Request, shapes: Mapping[str, tuple[int, ...]]) -> str:
    """The array named by the request, else the only one with the axes of frames."""
    if request.key is not None:
        if request.key in shapes:
            return request.key
        raise ValueError(f"key: expected one of {sorted(shapes)}, got {request.key!r}")
    candidates = [name for name, shape in shapes.items() if 2 <= len(shape) <= 4 and math.prod(shape) > 1]
    if len(candidates) == 1:
        return candidates[0]
    listed = ", ".join(f"{name} {shapes[name]}" for name in sorted(shapes)) or "none"
    raise FormatError(f"{request.source}: expected one array of frames, or its name as key=; the file holds {listed}")


def _package(request: Request, name: str, what: str) -> Any:
    """An optional package, or an error that says how to get it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.split(".")[0]
        raise MissingDependencyError(f"{request.source}: reading {what} needs {package}: pip install {package}") from error


def open_npz(request: Request) -> Stack:
    """The stack (T, H, W) in a .npz archive."""
    try:
        with open(request.source, "rb") as file, np.load(file, allow_pickle=False) as archive:
            if not hasattr(archive, "files"):
                raise FormatError(f"{request.source}: no .npz archive")
            arrays = {name: archive[name] for name in archive.files if request.key in (None, name)}
            shapes = {name: np.shape(array) for name, array in arrays.items() if array.dtype.kind in "biuf"}
            if request.key is not None and request.key not in shapes:
                shapes = dict.fromkeys(archive.files, ())
    except FileNotFoundError:
        raise
    except MemoryError as error:
        # NumPy allocates what a header states before it reads any of it.
        raise FormatError(f"{request.source}: holds, or is cut off and only states, an array that memory does not hold ({error})") from error
    except (OSError, OverflowError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise FormatError(f"{request.source}: no .npz archive of plain arrays ({error})") from error
    array = arrays[_chosen(request, shapes)]
    return _stack(request, array.shape, array.__getitem__, lambda: array)


def open_hdf5(request: Request) -> Stack:
    """The data set (T, H, W) in an HDF5 file."""
    # Names may begin at the root, as h5py writes them.
    request = dataclasses.replace(request, key=request.key and request.key.lstrip("/"))
    sets = _hdf5_sets(request)
    data = sets[_chosen(request, {name: each.shape for name, each in sets.items()})]
    return _stack(request, data.shape, data.__getitem__, lambda: np.asarray(data))


def open_matlab(request: Request) -> Stack:
    """The array (H, W, T), rows x columns x time, in a MATLAB file; colour (H, W, 3, T) or (H, W, 3)."""
    with open(request.source, "rb") as file:
        head = file.read(128)
    # HDF5 behind a block of its own, whose text says so.
    if b"MATLAB 7.3" in head:
        sets = _hdf5_sets(request)
        # Axes are in the reverse order there.
        data = sets[_chosen(request, {name: each.shape for name, each in sets.items()})]
        shape = data.shape[::-1]
        get: Callable[[int], Frame] = lambda k: np.asarray(data[k]).T
        whole: Callable[[], Frame] = lambda: np.asarray(data).T
    else:
        array = _old_matlab(request)
        shape = array.shape
        get, whole = (lambda k: array[..., k]), (lambda: array)
    return _stack(request, shape, get, whole, is_time_last=True)


def _old_matlab(request: Request) -> Frame:
    matlab = _package(request, "scipy.io", "MATLAB files before 7.3")
    kinds = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("u", "") for bits in (8, 16, 32, 64))}
    listed = _readable(request, "MATLAB", lambda: matlab.whosmat(request.source))
    shapes = {name: shape for name, shape, kind in listed if kind in kinds}
    for name, _, kind in listed:
        if name not in shapes and (name == request.key or (request.key is None and not shapes)):
            kind, taken = {
                "struct": (kind, f"frames = {name}.frames; "),
                "cell": ("cell array", f"frames = cat(3, {name}{{:}}); "),
                "sparse": ("sparse array", f"frames = full({name}); "),
            }.get(kind, (kind, ""))
            raise FormatError(
                f"{request.source}: {name} is a {kind}; expected an array of numbers. In MATLAB save the frames as "
                f"a variable of their own ({taken}save('frames.mat', 'frames')), or in "
                f"Python take them out of scipy.io.loadmat(path, simplify_cells=True)[{name!r}] and pass the array"
            )
    name = _chosen(request, shapes)
    array: Frame = _readable(request, "MATLAB", lambda: matlab.loadmat(request.source, variable_names=[name])[name])
    return array


def _hdf5_sets(request: Request) -> dict[str, Any]:
    """The data sets of numbers in a file by name; they keep it open."""
    h5py = _package(request, "h5py", "HDF5 (also MATLAB 7.3)")
    if os.path.exists(request.source) and not os.path.isfile(request.source):
        raise FormatError(f"{request.source}: expected a file, as HDF5 is not read in order")
    try:
        file = h5py.File(request.source, "r")
    except FileNotFoundError:
        raise
    except OSError as error:
        raise FormatError(f"{request.source}: no HDF5 file that can be read ({error})") from error
    sets: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "biuf":
            sets[name] = item

    file.visititems(visit)
    return sets


def open_tifffile(request: Request) -> Stack | None:
    """A TIFF through tifffile, for kinds that the built-in reader does not know; None where tifffile is not
    installed. Its series must be along time, the channel and slice of the request aside."""
    try:
        tifffile: Any = importlib.import_module("tifffile")
    except ImportError:
        return None
    file = _readable(request, "TIFF", lambda: tifffile.TiffFile(request.source))
    try:
        series = _readable(request, "TIFF", lambda: file.series[0])
        stack = Stack(request, *_series_frames(request, series))
    except BaseException:
        file.close()
        raise
    weakref.finalize(stack, file.close)
    return stack


def _readable(request: Request, kind: str, read: Callable[[], Any]) -> Any:
    """What a package reads, or `FormatError`: of damaged files it raises errors of many types."""
    try:
        return read()
    except (FileNotFoundError, MemoryError):
        raise
    except Exception as error:
        raise FormatError(f"{request.source}: no {kind} file that can be read ({error})") from error


def _series_frames(request: Request, series: Any) -> tuple[int, Callable[[int], Frame]]:
    """Number of frames of a series of tifffile, of the channel and slice of the request, and the frames."""
    if (model := getattr(series.keyframe.photometric, "name", "none")) not in _COLOUR_MODELS:
        raise FormatError(f"{request.source}: holds colours of the model {model}; expected grey or RGB")
    own = len(series.keyframe.shape)
    outer = list(zip(series.axes[:-own], series.shape[:-own], strict=True))
    places: NDArray[Any] = np.arange(len(series.pages)).reshape([length for _, length in outer])
    for axis, option, index in (("C", "channel", request.channel), ("Z", "z", request.z)):
        where = [k for k, (letter, _) in enumerate(outer) if letter == axis]
        if not where or index == "time":
            continue
        length = outer[where[0]][1]
        if index is None and length > 1:
            raise FormatError(f"{request.source}: holds {length} planes along {axis}; choose one with {option}=0 to {option}={length - 1}")
        if index is not None and int(index) >= length:
            raise ValueError(f"{option}: expected an index below {length}, got {index}")
        places = np.take(places, [int(index or 0)], axis=where[0])
        outer[where[0]] = (axis, 1)
    if sum(length > 1 for _, length in outer) > 1:
        raise FormatError(f"{request.source}: holds planes along the axes {''.join(letter for letter, _ in outer)}; expected time alone")
    pages = places.ravel()
    is_planar = series.axes[-own:].startswith("S")

    def get(k: int) -> Frame:
        image: Frame = _readable(request, "TIFF", lambda: series.pages[int(pages[k])].asarray())
        if image.dtype.kind not in "biuf":
            raise FormatError(f"{request.source}: holds samples of type {image.dtype}; expected integers or floats")
        return np.moveaxis(image, 0, -1) if is_planar else image

    return len(pages), get
