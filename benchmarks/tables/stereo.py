"""Disparity of edge pixels: ours beside OpenCV's semi-global matching and block matching.

    python -m benchmarks.tables.stereo [--quick] [--data FOLDER] [--only drawn prior recordings]

Drawn scenes with exact truth (:mod:`stereo_scenes`), some steps of each; then recordings with a known disparity. All methods are judged at the same edge pixels
of the left view, those of section 2.2 of the specification, each at a given resolution and none with a mask of its own. OpenCV matches whole rows: on drawn scenes, whose cameras are not
aligned, it is shown both as it is and with the right view moved by the true row offset. Between them :mod:`stereo_prior`: a fence whose pales look alike.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import shift

import jacoflow
from benchmarks import report
from benchmarks.scenes import stereo as stereo_scenes
from benchmarks.scores.stereo import Counts, Mask, count, figures
from benchmarks.scores.timing import race

try:
    import cv2
except ImportError:
    cv2 = None

Row = dict[str, object]
Picture = NDArray[np.uint8]
NAMES = ("drawn", "prior", "recordings")
STEPS = {"crossing": (0, 5, 10, 15), "curved": (0, 3, 6, 9), "cart": (0, 3, 6, 9), "small": (0, 2, 4)}
"""Steps that are averaged over."""
ASKED = {
    "paper": {
        "crossing": (0.958, 0.150, 0.035, 0.055), "curved": (0.965, 0.225, 0.031, 0.034),
        "cart": (0.970, 0.099, 0.033, 0.049), "small": (0.969, 0.089, 0.025, 0.050),
    },
    "paper, support 0.6": {
        "crossing": (0.861, 0.122, 0.011, 0.017), "curved": (0.889, 0.206, 0.013, 0.012),
        "cart": (0.897, 0.075, 0.015, 0.024), "small": (0.879, 0.069, 0.007, 0.019),
    },
    "sgm": {
        "crossing": (0.940, 0.097, 0.003, 0.014), "curved": (0.956, 0.098, 0.002, 0.012),
        "cart": (0.957, 0.087, 0.004, 0.018), "small": (0.951, 0.083, 0.003, 0.015),
    },
}  # fmt: skip
"""Figures of the specification: density, MAE, outliers, occluded."""


@dataclass(frozen=True)
class Pair:
    """Two views and what is known of them."""

    left: Picture
    right: Picture
    truth: NDArray[np.floating]
    visible: Mask
    disparity_range: tuple[int, int]
    row_offset: float = 0.0


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
    """One of our methods; `align`: told the true row offset."""

    def match(pair: Pair) -> NDArray[np.floating]:
        told = {"row_offset": pair.row_offset} if align else {}
        return jacoflow.stereo.edge_disparity(pair.left, pair.right, disparity_range=pair.disparity_range, **told, **options).disparity

    return Matcher(name, match, asked)


def _with_opencv(pair: Pair, make: Callable[[int, int], object], align: bool) -> NDArray[np.floating]:
    """OpenCV's disparity; what it has no answer for is NaN. Views are widened so that every column can be matched."""
    low, high = pair.disparity_range
    number = int(np.ceil((high - low + 1) / 16)) * 16
    right = pair.right
    if align and pair.row_offset:
        right = np.rint(shift(right.astype(float), (-pair.row_offset, 0), order=1, mode="nearest")).astype(np.uint8)
    margin = max(abs(low), abs(low + number)) + 16
    wide = [cv2.copyMakeBorder(view, 0, 0, margin, margin, cv2.BORDER_REPLICATE) for view in (pair.left, right)]
    raw = make(low, number).compute(wide[0], wide[1]).astype(float) / 16
    raw = raw[:, margin:-margin]
    return np.where(raw < low, np.nan, raw)


def semi_global(low: int, number: int) -> object:
    """SGBM with 5 x 5 blocks and the penalties of its manual."""
    return cv2.StereoSGBM_create(
        minDisparity=low, numDisparities=number, blockSize=5, P1=8 * 25, P2=32 * 25, disp12MaxDiff=1, uniquenessRatio=5, speckleWindowSize=50, speckleRange=2
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


def scene_pairs(scene: stereo_scenes.Scene) -> list[Pair]:
    """The steps of a scene that are averaged over."""
    film = scene.film()
    steps = [film[t] for t in STEPS[scene.name]]
    return [Pair(s.left, s.right, s.disparity, s.visible, scene.disparity_range, scene.row_offset) for s in steps]


def judge(pairs: list[Pair], chosen: list[Matcher], rounds: int) -> list[tuple[Matcher, Row]]:
    """Figures and time of every method over the pairs."""
    edges = [edge_pixels(pair.left) for pair in pairs]
    times = race({each.name: (lambda each=each: each.match(pairs[0])) for each in chosen}, rounds)
    rows: list[tuple[Matcher, Row]] = []
    for each in chosen:
        counts: list[Counts] = [count(each.match(pair), edge, pair.truth, pair.visible) for pair, edge in zip(pairs, edges, strict=True)]
        spent = times[each.name]
        rows.append((each, {"method": each.name, **figures(counts), "ms, wall": 1e3 * spent.wall, "ms, busiest thread": 1e3 * spent.busiest}))
    return rows


def drawn(names: list[str], rounds: int) -> list[Row]:
    """One row for each scene and method, and what is asked of ours."""
    rows: list[Row] = []
    for name in names:
        for each, row in judge(scene_pairs(stereo_scenes.SCENES[name]()), matchers(), rounds):
            rows.append({"scene": name, **row})
            if each.asked is not None:
                figures_asked = dict(zip(("density", "MAE", "outliers", "occluded"), ASKED[each.asked][name], strict=True))
                rows.append({"scene": name, "method": f"{each.name}: asked", **figures_asked})
    return rows


def sections(quick: bool, data: Path | None, names: tuple[str, ...] = NAMES) -> dict[str, list[Row]]:
    """The tables, by title."""
    rounds = 3 if quick else 7
    found: dict[str, list[Row]] = {}
    if "drawn" in names:
        found["Disparity of edge pixels, scenes with exact truth"] = drawn(["crossing", "small"] if quick else list(STEPS), rounds)
    if "prior" in names:
        from benchmarks.tables import stereo_prior

        found["Disparity of edge pixels, looked for near those of the step before"] = stereo_prior.table()
    if "recordings" in names and data is not None:
        from benchmarks.tables import stereo_recordings

        found["Disparity of edge pixels, recordings"] = stereo_recordings.rows(data, rounds)
    return found


def main() -> None:
    """Prints the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two scenes, fewer rounds")
    parser.add_argument("--data", type=Path, help="folder of recordings with truth")
    parser.add_argument("--only", choices=NAMES, nargs="+", default=NAMES, help="tables to print")
    options = parser.parse_args()
    for title, rows in sections(options.quick, options.data, tuple(options.only)).items():
        print(f"## {title}\n\n" + "\n".join(report.table_lines(rows)) + "\n")


if __name__ == "__main__":
    main()
