"""Frames of video as they are coded: luma, depth, whether there is colour, and the rotation of the
display."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Formats whose first plane is luma: planar YUV and grey.
_LUMA_FIRST = ("yuv", "gray")


def depth(frame: Any) -> int:
    """Bits of a sample."""
    return int(max(component.bits for component in frame.format.components))


def upright(image: NDArray[Any], frame: Any) -> NDArray[Any]:
    """The image (H, W) or (H, W, 3) turned as the display matrix of the file says, by quarter turns."""
    quarters = round(getattr(frame, "rotation", 0) / 90) % 4
    return np.ascontiguousarray(np.rot90(image, quarters)) if quarters else image


def luma(frame: Any) -> NDArray[Any]:
    """Luma as coded, (H, W): uint8, or uint16 where it is deeper, shifted to the full scale of 16 bits.
    Packed and RGB formats are converted by ITU-R BT.601, limited range, as by ffmpeg."""
    return _plane(_planar(frame), 0)


def holds_colour(frame: Any) -> bool:
    """Whether any chroma differs from grey by more than the rounding of a conversion, a level of 8 bit."""
    planar = _planar(frame)
    if len(planar.planes) < 3:
        return False
    bits = depth(planar)
    middle, shift = 1 << (bits - 1), 16 - bits if bits > 8 else 0
    return any((np.abs((_plane(planar, k) >> shift).astype(int) - middle) > 1 << max(bits - 8, 0)).any() for k in (1, 2))


def _planar(frame: Any) -> Any:
    is_planar = frame.format.name.startswith(_LUMA_FIRST) and "yuyv" not in frame.format.name
    return frame if is_planar else frame.reformat(format="yuv444p16le" if depth(frame) > 8 else "yuv444p")


def _plane(frame: Any, index: int) -> NDArray[Any]:
    plane, bits = frame.planes[index], depth(frame)
    width, height = plane.width, plane.height
    rows = np.frombuffer(plane, np.uint8).reshape(-1, abs(plane.line_size))[:height]
    if bits <= 8:
        return rows[:, :width].copy()
    order = ">u2" if frame.format.name.endswith("be") else "<u2"
    samples = np.ascontiguousarray(rows[:, : 2 * width]).view(order).astype(np.uint16)
    shifted: NDArray[np.uint16] = samples << np.uint16(16 - bits)
    return shifted
