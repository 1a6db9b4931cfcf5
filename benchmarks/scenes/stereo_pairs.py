"""Single pairs of views with a known disparity: steps of the synthetic scenes, two stills of Middlebury,
one pair of KITTI."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.recordings import read_grey
from benchmarks.scenes.stereo import Scene

try:
    import cv2
except ImportError:
    cv2 = None

Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]
STEPS = {"crossing": (0, 5, 10, 15), "curved": (0, 3, 6, 9), "cart": (0, 3, 6, 9), "small": (0, 2, 4)}
"""Steps that are averaged over."""


@dataclass(frozen=True)
class Pair:
    """Two views and what is known of them."""

    left: Picture
    right: Picture
    truth: NDArray[np.floating]
    visible: Mask
    disparity_range: tuple[int, int]
    row_offset: float = 0.0


Named = tuple[str, Pair]


def scene_pairs(scene: Scene) -> list[Pair]:
    """The steps of a scene that are averaged over."""
    sequence = scene.sequence()
    steps = [sequence[t] for t in STEPS[scene.name]]
    return [
        Pair(s.left, s.right, s.disparity, s.visible, scene.disparity_range, scene.row_offset) for s in steps
    ]


def _raw(path: Path) -> NDArray[np.floating]:
    """Samples of a grey file of 8 or 16 bit."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(path)
    return image.astype(float)


def _pair(
    folder: Path, views: tuple[str, str], truth: str, scale: float, disparity_range: tuple[int, int]
) -> Pair:
    """Views and disparity of which 0 is unknown: there nothing is judged."""
    disparity = _raw(folder / truth) / scale
    known = disparity > 0
    left, right = (read_grey(folder / view) for view in views)
    return Pair(left, right, np.where(known, disparity, np.nan), known, disparity_range)


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
    return "KITTI 2012 000151, not occluded", _pair(
        folder, (f"image_0/{name}", f"image_1/{name}"), f"disp_noc/{name}", 256.0, (0, 127)
    )


READERS: list[Callable[[Path], Named]] = [_tsukuba, _teddy, _kitti]
