"""Errors of flow and Jacobian on recordings with known truth, against OpenCV's Farneback flow and against no motion at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacoflow

try:
    import cv2
except ImportError:
    cv2 = None

Array = NDArray[np.floating]
BORDER = 12
"""Left out of the Jacobian's error along each side, px."""
SETTINGS = ((1.5, 4.0), (2.5, 6.0))
"""Our settings, the same for every recording: smoothing and window, px. One level reaches motions of a few px, no more."""
SMOOTHING = 3.0
"""Gaussian before a flow without a Jacobian is differentiated, px."""


@dataclass
class Sample:
    """Frames with a truth: two or three grey frames around the one the truth belongs to."""

    name: str
    frames: list[NDArray[np.uint8]]
    reference: int
    """Which of the frames the truth's pixels are those of."""
    truth: Array
    """(H, W, 2), NaN where unknown."""


def read_flo(path: Path) -> Array:
    """A Middlebury flow file (H, W, 2); unknown flow becomes NaN."""
    data = path.read_bytes()
    width, height = np.frombuffer(data, "<i4", 2, 4)
    flow = np.frombuffer(data, "<f4", 2 * width * height, 12).reshape(height, width, 2).astype(float)
    flow[np.abs(flow).max(axis=-1) > 1e9] = np.nan
    return flow


def read_grey(path: Path) -> NDArray[np.uint8]:
    """A grey 8-bit picture."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise FileNotFoundError(path)
    return image


def _rubber_whale(data: Path) -> Sample:
    folder = data / "middlebury_flow" / "RubberWhale"
    frames = [read_grey(folder / f"frame{k:02d}.png") for k in (9, 10, 11)]
    return Sample("RubberWhale", frames, 1, read_flo(folder / "flow10.flo"))


def _dimetrodon(data: Path) -> Sample:
    folder = data / "middlebury_flow" / "Dimetrodon"
    return Sample("Dimetrodon", [read_grey(folder / f"frame{k}.png") for k in (10, 11)], 0, read_flo(folder / "flow10.flo"))


def _yosemite(data: Path) -> Sample:
    from scipy.io import loadmat

    folder = data / "yosemite"
    stored = loadmat(next(folder.rglob("correct_flow.mat")))
    flow = next(v for v in stored.values() if isinstance(v, np.ndarray) and v.shape == (252, 316, 2)).astype(float)
    sky = flow[..., 0] == 2.0
    truth = np.stack([flow[..., 0], -flow[..., 1]], axis=-1)
    truth[sky] = np.nan
    return Sample("Yosemite without sky", [read_grey(next(folder.rglob(f"yos{k}.tif*"))) for k in (8, 9, 10)], 1, truth)


def _piv(name: str) -> Callable[[Path], Sample]:
    def read(data: Path) -> Sample:
        folder = data / "piv_synthetic"
        truth = read_flo(next(folder.rglob(f"{name}*flow.flo")))
        pair = [read_grey(next(folder.rglob(f"{name}*img{k}.tif"))) for k in (1, 2)]
        return Sample(f"PIV {name}", pair, 0, truth)

    return read


SAMPLES: list[Callable[[Path], Sample]] = [
    _rubber_whale,
    _dimetrodon,
    _yosemite,
    _piv("DNS_turbulence_00001"),
    _piv("backstep_Re800_00001"),
]


def differences(flow: Array) -> Array:
    """Jacobian (H, W, 2, 2) of a flow by central differences."""
    along_y, along_x = np.gradient(flow, axis=(0, 1))
    return np.stack([along_x, along_y], axis=-1)


def usable(truth: Array) -> NDArray[np.bool_]:
    """Where the Jacobian is compared: away from the frame's edge (12 px), from unknown truth (4 px) and from motion boundaries."""
    known = np.isfinite(truth).all(axis=-1)
    near_unknown = ~known
    for _ in range(4):
        padded = np.pad(near_unknown, 1)
        near_unknown = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:] | near_unknown
    steep = np.abs(differences(np.where(known[..., None], truth, 0.0))).max(axis=(-2, -1)) >= 0.3
    mask = ~near_unknown & ~steep
    inside = np.zeros_like(mask)
    inside[BORDER:-BORDER, BORDER:-BORDER] = True
    return mask & inside


def score(sample: Sample, flow: Array, jacobian: Array | None) -> dict[str, float]:
    """Mean end-point error (px), root-mean-square error of the Jacobian's entries (1/frame), share of the truth's pixels that have an estimate."""
    known = np.isfinite(sample.truth).all(axis=-1)
    have = known & np.isfinite(flow).all(axis=-1)
    error = np.hypot(*np.moveaxis(flow - sample.truth, -1, 0))
    where = usable(sample.truth) & have
    if jacobian is None:
        smooth = cv2.GaussianBlur(np.where(np.isfinite(flow), flow, 0.0), (0, 0), SMOOTHING)
        jacobian = differences(smooth)
    wrong = (jacobian - differences(sample.truth))[where & np.isfinite(jacobian).all(axis=(-2, -1))]
    return {
        "share": float(have.sum() / known.sum()),
        "end_point_error": float(error[have].mean()),
        "jacobian_error": float(np.sqrt((wrong**2).mean())),
    }


def table(data: Path) -> list[dict[str, object]]:
    """One row for each recording and method; recordings that are not there get a row that says so."""
    rows: list[dict[str, object]] = []
    if cv2 is None:
        return [{"sample": "all", "method": "skipped: OpenCV, which reads the pictures, is missing"}]
    for read in SAMPLES:
        try:
            sample = read(data)
        except (FileNotFoundError, StopIteration, ImportError) as problem:
            rows.append({"sample": getattr(read, "__name__", "?").strip("_"), "method": f"skipped: {problem!r}"})
            continue
        zero = np.zeros_like(sample.truth)
        first, second = sample.frames[sample.reference], sample.frames[sample.reference + 1]
        farneback = cv2.calcOpticalFlowFarneback(first, second, None, 0.5, 5, 15, 3, 5, 1.1, 0).astype(float)
        for method, flow, jacobian in (
            ("no motion", zero, np.zeros((*zero.shape, 2))),
            ("OpenCV Farneback, 5 levels", farneback, None),
            *(windowed(sample, smooth, window) for smooth, window in SETTINGS),
        ):
            rows.append({"sample": sample.name, "method": method, **score(sample, flow, jacobian)})
    return rows


def windowed(sample: Sample, smooth: float, window: float) -> tuple[str, Array, Array]:
    """Our windowed field of the sample's frames, single level: central in time for three frames, between the two of a pair."""
    field = jacoflow.estimate(sample.frames, method="windowed", smooth=smooth, window_sigma=window, covariance=False, precision="float64")
    name = f"jacoflow windowed, single level, smoothed {smooth:g} px, window {window:g} px"
    return name, field.flow.astype(float), field.jacobian.astype(float)
