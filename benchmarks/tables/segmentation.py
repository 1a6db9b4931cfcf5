"""Graph segmentation beside scikit-image's and OpenCV's, on the same pictures: agreement and time.

    python -m benchmarks.tables.segmentation [--data FOLDER]

Agreement: number of regions, and adjusted Rand index of our labels against scikit-image's, at scale /
min_size 150 / 30 and 300 / 60, sigma 0.8. Without `--data` (or JACOFLOW_DATA) only pictures that come with
scikit-image are used. Time: 720 x 480 colour px of 8 bits, scale 150, sigma 0.8, min_size 120. All run in
turns in this process; given are CPU time of the busiest thread and the median of the time on the clock.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median

import cv2
import numpy as np
import skimage.data
from numpy.typing import NDArray
from skimage.segmentation import felzenszwalb
from sklearn.metrics import adjusted_rand_score

from benchmarks import report
from benchmarks.scores import timing
from jacoflow import segment

Image = NDArray[np.uint8]
Row = dict[str, object]
SIGMA = 0.8
SETTINGS = ((150, 30), (300, 60))
"""Scale and smallest region, px."""
SIZE = (480, 720)
TIMED = (150, 120)
PHOTOGRAPHS = (
    "middlebury_flow/RubberWhale/frame10.png",
    "sintel/clean/easy/frame_0001.png",
    "stereo_stills/teddy/im2.png",
    "kitti2015/000000/frame1.png",
    "track_otb/Crossing/img/0001.jpg",
)
SCENES = 2
"""Number of synthetic scenes."""


def scene_frames(data: Path, scale: float) -> Iterator[tuple[str, Image]]:
    """One frame of each of the first scenes for the particle tracker."""
    folder = data / "particle_scenes"
    if not (folder / "scenes.py").exists():
        return
    sys.path.append(str(folder))
    import scenes

    for seed, name in enumerate(list(scenes.SCENES)[:SCENES]):
        yield f"scene {name}", scenes.make(name, seed=seed, scale=scale, T=2)[0][1]


def pictures(data: Path | None) -> Iterator[tuple[str, Image]]:
    """Names and RGB images."""
    for name in ("astronaut", "coffee"):
        yield name, getattr(skimage.data, name)()
    if data is None:
        return
    for name in PHOTOGRAPHS:
        if (data / name).exists():
            yield name, np.ascontiguousarray(cv2.imread(str(data / name))[..., ::-1])
    yield from scene_frames(data, 0.5)


def agreement(data: Path | None) -> list[Row]:
    """One row for each picture and setting."""
    rows: list[Row] = []
    for name, image in pictures(data):
        for scale, min_size in SETTINGS:
            ours = segment.felzenszwalb(image, scale, SIGMA, min_size)
            theirs = felzenszwalb(image, scale, SIGMA, min_size)
            index = adjusted_rand_score(theirs.ravel(), ours.ravel())
            regions = {"regions": int(ours.max()) + 1, "scikit-image": int(theirs.max()) + 1}
            rows.append(
                {
                    "picture": name,
                    "scale": scale,
                    "min_size": min_size,
                    **regions,
                    "adjusted_rand_index": f"{index:.6f}",
                }
            )
    return rows


def timed_picture(data: Path | None) -> Image:
    """A frame of the first scene at full size, or a part of a photograph."""
    for _, image in scene_frames(data, 1.0) if data else ():
        return image
    return np.ascontiguousarray(cv2.resize(skimage.data.astronaut(), (SIZE[1], SIZE[1]))[: SIZE[0]])


def times(data: Path | None, rounds: int) -> list[Row]:
    """One row for each contestant: times in ms, and those of the others over ours on one thread."""
    image = timed_picture(data)
    scale, min_size = TIMED
    cv2.setNumThreads(1)
    graph = cv2.ximgproc.segmentation.createGraphSegmentation(SIGMA, scale, min_size)
    work: dict[str, Callable[[], object]] = {
        "jacoflow, 1 thread": lambda: segment.felzenszwalb(image, scale, SIGMA, min_size, threads=1),
        "jacoflow, 2 threads": lambda: segment.felzenszwalb(image, scale, SIGMA, min_size, threads=2),
        "scikit-image": lambda: felzenszwalb(image, scale, SIGMA, min_size),
        "OpenCV": lambda: graph.processImage(image),
    }
    for contestant in work.values():
        contestant()
    measured: dict[str, list[timing.Time]] = {name: [] for name in work}
    for _ in range(rounds):
        for name, contestant in work.items():
            measured[name].append(timing.once(contestant))
    best = {name: min(time.busiest for time in runs) for name, runs in measured.items()}
    middle = {name: median(time.busiest for time in runs) for name, runs in measured.items()}
    clock = {name: median(time.wall for time in runs) for name, runs in measured.items()}
    base = next(iter(work))
    return [
        {
            "method": name,
            "cpu_ms_min": 1000 * best[name],
            "cpu_ms_median": 1000 * middle[name],
            "clock_ms_median": 1000 * clock[name],
            "times_ours_min": best[name] / best[base],
            "times_ours_median": middle[name] / middle[base],
        }
        for name in work
    ]


TABLES = {
    "agreement": report.Table("Graph segmentation, agreement", lambda o: agreement(o.data)),
    "times": report.Table("Graph segmentation, time", lambda o: times(o.data, report.rounds(o))),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
