"""Recordings with known truth, as frames and arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

try:
    import cv2
except ImportError:
    cv2 = None

Array = NDArray[np.floating]
Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Sample:
    """Frames with a truth: two or three grey frames around the one the truth belongs to."""

    name: str
    frames: list[Picture]
    reference: int
    """Which of the frames the truth's pixels are those of; the truth is the motion from it to the next."""
    truth: Array
    """(H, W, 2), NaN where unknown."""
    truth_std: float = 0.0
    """Standard deviation, px, of the noise of a truth that was itself measured."""

    def pair(self) -> list[Picture]:
        """The frame the truth belongs to and the next."""
        return self.frames[self.reference : self.reference + 2]


def read_flo(path: Path) -> Array:
    """A Middlebury flow file (H, W, 2); unknown flow becomes NaN."""
    data = path.read_bytes()
    width, height = np.frombuffer(data, "<i4", 2, 4)
    flow = np.frombuffer(data, "<f4", 2 * width * height, 12).reshape(height, width, 2).astype(float)
    flow[np.abs(flow).max(axis=-1) > 1e9] = np.nan
    return flow


def detail(truth: Array) -> float:
    """Robust standard deviation, px, of what a Gaussian of 3 px removes: mostly noise of a measured truth."""
    left = [truth[..., c] - gaussian_filter(truth[..., c], 3) for c in (0, 1)]
    return float(np.nanmedian(np.abs(left)) / 0.6745)


def carried_back(truth: Array) -> Array:
    """The truth of the middle of both exposures, at the pixels where its particles are in the first frame."""
    row, column = np.indices(truth.shape[:2])
    first = truth
    for _ in range(8):
        at = (row + 0.5 * first[..., 1], column + 0.5 * first[..., 0])
        first = np.stack([map_coordinates(truth[..., c], at, mode="nearest") for c in (0, 1)], axis=-1)
    return first


def read_grey(path: Path) -> Picture:
    """A grey 8-bit picture."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise FileNotFoundError(path)
    return image


def _rubber_whale(data: Path) -> Sample:
    folder = data / "middlebury_flow" / "RubberWhale"
    frames = [read_grey(folder / f"frame{k:02d}.png") for k in (9, 10, 11)]
    truth = read_flo(folder / "flow10.flo")
    return Sample("RubberWhale", frames, 1, truth, detail(truth))


def _dimetrodon(data: Path) -> Sample:
    folder = data / "middlebury_flow" / "Dimetrodon"
    frames = [read_grey(folder / f"frame{k}.png") for k in (10, 11)]
    truth = read_flo(folder / "flow10.flo")
    return Sample("Dimetrodon", frames, 0, truth, detail(truth))


def _yosemite(data: Path) -> Sample:
    from scipy.io import loadmat

    folder = data / "yosemite"
    stored = loadmat(next(folder.rglob("correct_flow.mat")))
    flow = next(v for v in stored.values() if isinstance(v, np.ndarray) and v.shape == (252, 316, 2)).astype(
        float
    )
    sky = flow[..., 0] == 2.0
    truth = np.stack([flow[..., 0], -flow[..., 1]], axis=-1)
    truth[sky] = np.nan
    return Sample(
        "Yosemite without sky", [read_grey(next(folder.rglob(f"yos{k}.tif*"))) for k in (8, 9, 10)], 1, truth
    )


def _sintel(data: Path) -> Sample:
    folder = data / "sintel" / "clean" / "easy"
    frames = [read_grey(folder / f"frame_{k:04d}.png") for k in (1, 2, 3)]
    # Occluded pixels and those that leave the frame have a truth too, and count.
    return Sample("Sintel alley_1 clean", frames, 1, read_flo(folder / "gt" / "frame_0002.flo"))


def _piv(name: str) -> Callable[[Path], Sample]:
    def read(data: Path) -> Sample:
        folder = data / "piv_synthetic"
        truth = carried_back(read_flo(next(folder.rglob(f"{name}*flow.flo"))))
        pair = [read_grey(next(folder.rglob(f"{name}*img{k}.tif"))) for k in (1, 2)]
        return Sample(f"PIV {name}", pair, 0, truth)

    read.__name__ = f"_piv {name}"
    return read


def _layered(name: str, place: str, frames: tuple[str, ...], truth: str) -> Callable[[Path], Sample]:
    def read(data: Path) -> Sample:
        folder = data / place
        pictures = [read_grey(folder / frame) for frame in frames]
        return Sample(name, pictures, len(frames) - 2, read_flo(folder / truth))

    read.__name__ = f"_{name}"
    return read


LAYERED: list[Callable[[Path], Sample]] = [
    _layered("Urban2", "middlebury_flow/Urban2", ("frame09.png", "frame10.png", "frame11.png"), "flow10.flo"),
    _layered("Venus", "middlebury_flow/Venus", ("frame10.png", "frame11.png"), "flow10.flo"),
    _layered(
        "Sintel cave_2 final",
        "sintel/final/medium",
        ("frame_0001.png", "frame_0002.png", "frame_0003.png"),
        "gt/frame_0002.flo",
    ),
]
"""Recordings with large jumps of the flow at motion boundaries."""

FLOWS: list[Callable[[Path], Sample]] = [
    _rubber_whale,
    _dimetrodon,
    _yosemite,
    _sintel,
    _piv("DNS_turbulence_00001"),
    _piv("backstep_Re800_00001"),
]
"""Recordings with a dense flow."""


def read_strain(data: Path) -> tuple[Sample, Array]:
    """Sample 14 (L1) of the image-correlation challenge, and its exact u_x (W,) in 1/frame: u depends on x
    alone and v is zero."""
    folder = data / "dic_challenge" / "sample14"
    frames = [read_grey(folder / f"Sample14 {name}.tif") for name in ("Reference", "L1 Amp0.1b")]
    x, u, micro = np.loadtxt(folder / "command_L1.csv", delimiter=",", comments="#", unpack=True)
    height, width = frames[0].shape
    truth = np.zeros((height, width, 2))
    truth[..., 0] = np.interp(np.arange(width), x, u)
    return Sample("DIC sample 14 L1", frames, 0, truth), np.interp(np.arange(width), x, micro * 1e-6)


def read_all(readers: list[Callable[[Path], Sample]], data: Path) -> tuple[list[Sample], list[str]]:
    """The samples that are there, and a line about each that is not."""
    found, missing = [], []
    for read in readers:
        try:
            found.append(read(data))
        except (FileNotFoundError, StopIteration, ImportError) as problem:
            missing.append(f"{read.__name__.strip('_')}: {problem!r}")
    return found, missing


def read_boxes(path: Path) -> Array:
    """Lines x, y, width, height, with commas or blanks."""
    return np.array(
        [line.replace(",", " ").split() for line in path.read_text().splitlines() if line.strip()], float
    )


def from_corner_1(boxes: Array) -> Array:
    """Boxes whose corner is a pixel counted from 1, as ours: the side of the first pixel is at -0.5."""
    return boxes - (1.5, 1.5, 0.0, 0.0)


def read_video(path: Path) -> NDArray[np.uint8]:
    """Colour frames (T, H, W, 3), blue, green and red."""
    video = cv2.VideoCapture(str(path))
    frames: list[NDArray[np.uint8]] = []
    while (read := video.read())[0]:
        frames.append(read[1])
    video.release()
    if not frames:
        raise FileNotFoundError(path)
    return np.stack(frames)
