"""Recorded pairs of views with a known disparity: two stills of Middlebury, one pair of KITTI 2012."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.recordings import read_all, read_grey
from benchmarks.tables import stereo

try:
    import cv2
except ImportError:
    cv2 = None

Named = tuple[str, stereo.Pair]


def _raw(path: Path) -> NDArray[np.floating]:
    """Samples of a grey file of 8 or 16 bit."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(path)
    return image.astype(float)


def _pair(folder: Path, views: tuple[str, str], truth: str, scale: float, disparity_range: tuple[int, int]) -> stereo.Pair:
    """Views and disparity of which 0 is unknown: there nothing is judged."""
    disparity = _raw(folder / truth) / scale
    known = disparity > 0
    left, right = (read_grey(folder / view) for view in views)
    return stereo.Pair(left, right, np.where(known, disparity, np.nan), known, disparity_range)


def _tsukuba(data: Path) -> Named:
    folder = next((data / "stereo_stills").rglob("disp3.pgm")).parent
    views = tuple(next(folder.glob(f"{name}.*")).name for name in ("im3", "im4"))
    return "tsukuba", _pair(folder, (views[0], views[1]), "disp3.pgm", 16.0, (0, 20))


def _teddy(data: Path) -> Named:
    folder = next((data / "stereo_stills").rglob("disp2.png")).parent
    return "teddy", _pair(folder, ("im2.png", "im6.png"), "disp2.png", 4.0, (0, 63))


def _kitti(data: Path) -> Named:
    folder = data / "kitti2012"
    name = "000151_10.png"
    return "KITTI 2012 000151, not occluded", _pair(folder, (f"image_0/{name}", f"image_1/{name}"), f"disp_noc/{name}", 256.0, (0, 127))


READERS: list[Callable[[Path], Named]] = [_tsukuba, _teddy, _kitti]


def rows(data: Path, rounds: int) -> list[dict[str, object]]:
    """One row for each recording and method: rows of these cameras are aligned, only edge pixels with a known truth count, best truth within 2 px."""
    if cv2 is None:
        return [{"recording": "skipped: OpenCV, which reads the pictures, is missing"}]
    chosen = [
        stereo.ours("classes, rows given", method="classes", align=True),
        stereo.ours("sgm, rows given", method="sgm", align=True),
        stereo.opencv("OpenCV SGBM", stereo.semi_global, False),
        stereo.opencv("OpenCV BM 15", stereo.block_matching, False),
    ]
    found, missing = read_all(READERS, data)
    table: list[dict[str, object]] = [{"recording": f"skipped {line}"} for line in missing]
    for name, pair in found:
        for _, row in stereo.judge([pair], chosen, rounds):
            # What has no known truth says nothing of occlusions.
            row.pop("occluded")
            table.append({"recording": name, **row})
    return table
