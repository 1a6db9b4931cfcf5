"""Matchers of edge pixels behind one interface: ours, and OpenCV's SGBM and BM."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import shift

import jacoflow
from benchmarks.scenes.stereo_pairs import Mask, Pair, Picture

try:
    import cv2
except ImportError:
    cv2 = None


@dataclass(frozen=True)
class Matcher:
    """A name and a function from a pair to disparities (H, W), px, NaN where there is none."""

    name: str
    match: Callable[[Pair], NDArray[np.floating]]
    asked: str | None = None
    """Key of `ASKED`."""


def edge_pixels(left: Picture) -> Mask:
    """(H, W), where the left view has edges: all methods are judged there."""
    rows, columns = jacoflow.stereo.edge_pixels(left)
    edges = np.zeros(left.shape, bool)
    edges[rows, columns] = True
    return edges


def ours(name: str, asked: str | None = None, align: bool = False, **options: object) -> Matcher:
    """One of our methods; `align`: with the true row offset."""

    def match(pair: Pair) -> NDArray[np.floating]:
        told = {"row_offset": pair.row_offset} if align else {}
        return jacoflow.stereo.edge_disparity(
            pair.left, pair.right, disparity_range=pair.disparity_range, **told, **options
        ).disparity

    return Matcher(name, match, asked)


def _with_opencv(pair: Pair, make: Callable[[int, int], object], align: bool) -> NDArray[np.floating]:
    """OpenCV's disparity; what it has no answer for is NaN. Views are widened so that every column can be
    matched."""
    low, high = pair.disparity_range
    number = int(np.ceil((high - low + 1) / 16)) * 16
    right = pair.right
    if align and pair.row_offset:
        right = np.rint(shift(right.astype(float), (-pair.row_offset, 0), order=1, mode="nearest")).astype(
            np.uint8
        )
    margin = max(abs(low), abs(low + number)) + 16
    wide = [
        cv2.copyMakeBorder(view, 0, 0, margin, margin, cv2.BORDER_REPLICATE) for view in (pair.left, right)
    ]
    raw = make(low, number).compute(wide[0], wide[1]).astype(float) / 16
    raw = raw[:, margin:-margin]
    return np.where(raw < low, np.nan, raw)


def semi_global(low: int, number: int) -> object:
    """SGBM with 5 x 5 blocks and the penalties of its manual."""
    return cv2.StereoSGBM_create(
        minDisparity=low,
        numDisparities=number,
        blockSize=5,
        P1=8 * 25,
        P2=32 * 25,
        disp12MaxDiff=1,
        uniquenessRatio=5,
        speckleWindowSize=50,
        speckleRange=2,
    )


def block_matching(low: int, number: int) -> object:
    """Block matching, 15 x 15."""
    matcher = cv2.StereoBM_create(numDisparities=number, blockSize=15)
    matcher.setMinDisparity(low)
    return matcher


def opencv(name: str, make: Callable[[int, int], object], align: bool) -> Matcher:
    """One of OpenCV's."""
    return Matcher(name, lambda pair: _with_opencv(pair, make, align))


def matchers() -> list[Matcher]:
    """Every method."""
    found = [
        ours("classes", "paper", method="classes"),
        ours("classes, support 0.6", "paper, support 0.6", method="classes", min_support=0.6),
        ours("sgm, row offset given", "sgm", align=True, method="sgm"),
        ours("sgm, row offset estimated", "sgm", method="sgm"),
    ]
    if cv2 is not None:
        found += [
            opencv("OpenCV SGBM", semi_global, False),
            opencv("OpenCV SGBM, rows aligned", semi_global, True),
            opencv("OpenCV BM 15, rows aligned", block_matching, True),
        ]
    return found
