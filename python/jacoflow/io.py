"""Frames in, frames and flow out.

Frames are arrays (H, W), or (H, W, 3) in colour, in the file's dtype and levels; flow is (H, W, 2) in
px/frame. Every file is written under a temporary name and renamed when it is whole. Files that cannot be
opened raise OSError, damaged ones `jacoflow.FormatError`, each with the path.
"""

import os
from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._checks import path_of
from ._jacoflow import (
    FlowField,
    _read_disparity,
    _read_flow,
    _read_image,
    _read_pfm,
    _write_disparity,
    _write_flow,
    _write_frames,
    _write_pfm,
)
from ._readers import FrameReader
from ._request import Request

__all__ = [
    "FrameReader",
    "frames",
    "read_disparity",
    "read_flo",
    "read_image",
    "read_kitti",
    "read_npz",
    "read_pfm",
    "write_disparity",
    "write_flo",
    "write_frames",
    "write_kitti",
    "write_npz",
    "write_pfm",
]

_Path = str | os.PathLike[str]


def frames(
    source: _Path,
    *,
    colour: Literal["error", "luminance", "rgb"] | None = None,
    grey: Literal["error", "repeat"] | None = None,
    channel: int | None = None,
    z: int | Literal["time"] | None = None,
    key: str | None = None,
    start: int = 0,
    stop: int | None = None,
    step: int = 1,
) -> FrameReader:
    """Iterates over the frames of a source, in their own dtype and levels; memory stays bounded for any
    length.

    `source`: a folder of PNG, TIFF, BMP, PGM, PPM and JPEG files (natural order), a pattern such as
    "frames/*.png", one image, a .txt list of images, a .y4m file, "-" (Y4M on standard input), a .npy stack
    (T, H, W) or (T, H, W, 3), a .npz or HDF5 file (.h5, with h5py) with such a stack, a MATLAB file (.mat,
    with scipy or, from version 7.3 on, h5py) with an array (H, W, T), or a video (through PyAV, else through
    an ffmpeg on the PATH; see also `jacoflow.video`). `key`: the name of the array where a file holds
    several. Frames `start`, `start + step`, ... below `stop` (indices, no unit); default all.

    The pages of a TIFF file (also BigTIFF) are its frames, those of reduced resolution aside. Where ImageJ or
    OME-XML name channels or slices, `channel` and `z` (indices) choose one of each, and without them the file
    is refused with `FormatError`; `z="time"` takes the slices for frames. Each file of a folder or list must
    hold one picture, of the chosen channel and slice. Samples of int8, int16 and float16 come as float32,
    those of wider integers as float64 (`FormatError` beyond 2^53). Other kinds of TIFF are read through
    tifffile where that is installed, else refused with `MissingDependencyError`.

    TIFF, Y4M and .npy files are recognised by their first bytes under any name, other files by the name,
    which must be UTF-8. Recordings that no installed package helps with (.raw, .cih, .cine) are refused with
    `FormatError`, which says how to convert them.

    Frames are grey, arrays (H, W); colour is refused unless `colour="luminance"`. With `colour="rgb"` they
    are arrays (H, W, 3) of red, green and blue; grey is then refused with `FormatError` unless
    `grey="repeat"`, which takes its level for all three. With either of the two an array
    (H, W, 3 or 4) is one picture; without them it is refused as ambiguous, except in .mat, where it is 3 or 4
    frames. Y4M is converted by ITU-R BT.601, limited range unless its header says XCOLORRANGE=FULL.

    Levels are the file's where its white is 255 or 65535, or unknown (floats, arrays); others are brought to
    the white of uint8 or uint16 (PNM of another maximum, PNG and TIFF of under 8 bits, Y4M of 9 to 15). TIFF
    of 12 bits keeps its levels, 0 to 4095 in uint16. Video is luma as coded, most often 16 to 235, that of
    RGB (GIF) too; where it is cut off amid a frame it ends with `FormatError`. JPEG and PNG are turned as
    their EXIF data say for the display, TIFF is not.

    >>> import tempfile, numpy as np
    >>> from jacoflow import io
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     io.write_frames(f"{folder}/stack.npy", np.zeros((4, 8, 10), np.uint8))
    ...     [frame.shape for frame in io.frames(f"{folder}/stack.npy", step=2)]
    4
    [(8, 10), (8, 10)]
    """
    return FrameReader(Request(path_of("source", source), colour, grey, channel, z, key, start, stop, step))


def write_frames(path: _Path, frames: Iterable[NDArray[Any]], *, frame_rate: float = 25.0) -> int:
    """Writes frames (H, W), or (H, W, 3) in colour, of one size and dtype, in their levels; returns how many.

    `path`: *.npy (any dtype), *.y4m (uint8, uint16), or a folder for numbered PNG files (uint8, uint16),
    which appear together, at the end, and replace those of an earlier call. `frame_rate` in frames/s is noted
    where the format has room for it.
    """
    return _write_frames(path, frames, frame_rate)


def read_image(
    path: _Path,
    *,
    colour: Literal["error", "luminance", "rgb"] | None = None,
    grey: Literal["error", "repeat"] | None = None,
    channel: int | None = None,
    z: int | None = None,
) -> NDArray[Any]:
    """Reads an image (PNG, TIFF, BMP, PGM, PPM, JPEG) as an array (H, W) of grey levels, or (H, W, 3) with
    `colour="rgb"`; `colour`, `grey`, `channel` and `z` as in `frames`."""
    return _read_image(path, colour, grey, channel, z)


def read_flo(path: _Path) -> NDArray[np.float32]:
    """Reads a Middlebury .flo file: float32 array (H, W, 2), px/frame, NaN where unknown."""
    return _read_flow(path, "flo")


def write_flo(path: _Path, flow: ArrayLike) -> None:
    """Writes flow (H, W, 2), px/frame, as a Middlebury .flo file; NaN as unknown (1e10)."""
    _write_flow(path, flow, "flo")


def read_kitti(path: _Path) -> NDArray[np.float32]:
    """Reads a KITTI flow PNG: float32 array (H, W, 2), px/frame, NaN where invalid."""
    return _read_flow(path, "kitti")


def write_kitti(path: _Path, flow: ArrayLike) -> None:
    """Writes flow (H, W, 2), px/frame, as a KITTI PNG in steps of 1/64 px; NaN and what the format cannot
    hold become invalid."""
    _write_flow(path, flow, "kitti")


def read_pfm(path: _Path) -> NDArray[np.float32]:
    """Reads a .pfm file: float32 array (H, W) or (H, W, 3), in the unit of the file."""
    return _read_pfm(path)


def write_pfm(path: _Path, values: ArrayLike) -> None:
    """Writes an array (H, W) or (H, W, 3), in any unit, as float32 .pfm."""
    _write_pfm(path, values)


def read_disparity(path: _Path) -> NDArray[np.float32]:
    """Reads disparity: float32 array (H, W), px, NaN where there is none; .npz, .pfm (infinite where there is
    none) or .png (KITTI, 16 bit)."""
    return _read_disparity(path)


def write_disparity(path: _Path, disparity: ArrayLike) -> int:
    """Writes disparity (H, W), px, NaN or infinite where there is none, by the name's ending; returns how
    many values the format could not hold.

    .npz and .pfm hold all; .png is the KITTI benchmark's, 16 bit in steps of 1/256 px, for disparities above
    0 and below 256 px.

    >>> import tempfile, numpy as np
    >>> from jacoflow import io
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     io.write_disparity(f"{folder}/d.png", np.array([[1.5, np.nan, -3.0]], np.float32))
    ...     io.read_disparity(f"{folder}/d.png")
    1
    array([[1.5, nan, nan]], dtype=float32)
    """
    return _write_disparity(path, disparity)


def read_npz(path: _Path) -> FlowField:
    """Reads a field (H, W) with all its planes, in the units it was written in."""
    return FlowField.load(path)


def write_npz(path: _Path, field: FlowField, *, options: str = "") -> None:
    """Writes a field (H, W) with all its planes and units, and `options` (free text on how it was made)."""
    if not isinstance(field, FlowField):
        raise TypeError(f"field: expected a FlowField, got {type(field).__name__}")
    field.save(path, options=options)
