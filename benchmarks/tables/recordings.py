"""Errors of flow and Jacobian on recordings with known truth, against OpenCV's flows and against no motion
at all."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

import jacoflow
from benchmarks import report
from benchmarks.rivals import flow as rivals
from benchmarks.scenes import recordings as samples
from benchmarks.scenes.recordings import Sample
from benchmarks.scores.flow import (
    BORDER,
    differences,
    end_point_error,
    inside,
    interior,
    intervals,
    jacobian_error,
    root_mean_square,
    usable,
)
from benchmarks.settings import RECORDINGS, Setting

Array = NDArray[np.floating]
Row = dict[str, object]
Readers = list[Callable[[Path], Sample]]


@dataclass(frozen=True)
class Asked:
    """What one setting for all recordings should attain: mean end-point error in px and error of the
    Jacobian in 1/frame."""

    reach: tuple[float, float]
    aim: tuple[float, float]

    def columns(self, which: int) -> Row:
        """Both figures of the flow (0) or of the Jacobian (1)."""
        what = ("end_point_error", "jacobian_error")[which]
        return {f"{what}_reach": self.reach[which], f"{what}_aim": self.aim[which]}


ASKED = {
    "RubberWhale": Asked((0.18, 0.020), (0.14, 0.017)),
    "Dimetrodon": Asked((0.13, 0.0175), (0.11, 0.015)),
    "Yosemite without sky": Asked((0.085, 0.0123), (0.07, 0.010)),
    "Urban2": Asked((0.43, 0.035), (0.36, 0.025)),
    "Venus": Asked((0.29, 0.0235), (0.26, 0.020)),
    "Sintel cave_2 final": Asked((1.75, 0.161), (1.68, 0.100)),
    "Sintel alley_1 clean": Asked((0.34, 0.038), (0.28, 0.030)),
    "PIV DNS_turbulence_00001": Asked((0.072, 0.016), (0.055, 0.013)),
    "PIV backstep_Re800_00001": Asked((0.038, 0.0034), (0.030, 0.0020)),
}


def score(sample: Sample, flow: Array, jacobian: Array) -> Row:
    """Mean end-point error (px) over the pixels with a truth, share of them that have an estimate, error
    of the Jacobian's entries (1/frame)."""
    mean, share = end_point_error(flow, sample.truth)
    asked = ASKED.get(sample.name)
    wrong = jacobian_error(jacobian, differences(sample.truth), usable(sample.truth))
    return {
        "share": share,
        "end_point_error": mean,
        **(asked.columns(0) if asked else {}),
        "jacobian_error": wrong,
        **(asked.columns(1) if asked else {}),
    }


def rival_rows(sample: Sample) -> list[Row]:
    """OpenCV's flows as they are, with the Jacobian after the Gaussian that suits it best."""
    truth, where = differences(sample.truth), usable(sample.truth)
    rows: list[Row] = []
    for method, run in rivals.RIVALS.items():
        flow = run(*sample.pair())
        setting, _, jacobian = rivals.best(
            rivals.gaussian_fits(flow), lambda _, j: jacobian_error(j, truth, where)
        )
        rows.append(
            {
                "sample": sample.name,
                "method": method,
                **score(sample, flow, jacobian),
                "best_sigma": setting["sigma"],
            }
        )
    return rows


def frames_for(sample: Sample, setting: Setting) -> list[samples.Picture]:
    """All frames of the sample, or its pair."""
    return sample.pair() if setting.frames == 2 else sample.frames


def table(data: Path, ours: list[Setting] = RECORDINGS, readers: Readers = samples.FLOWS) -> list[Row]:
    """One row for each recording and method, reached beside `ASKED`; a missing recording has a row that
    says so."""
    if samples.cv2 is None:
        return [{"sample": "all", "method": "skipped: OpenCV, which reads the pictures, is missing"}]
    rows: list[Row] = []
    found, missing = samples.read_all(readers, data)
    for sample in found:
        zero = np.zeros_like(sample.truth)
        rows.append(
            {"sample": sample.name, "method": "no motion", **score(sample, zero, np.zeros((*zero.shape, 2)))}
        )
        rows += rival_rows(sample)
        for setting in ours:
            rows.append(
                {
                    "sample": sample.name,
                    "method": setting.name,
                    **score(sample, *setting.estimate(frames_for(sample, setting))),
                }
            )
    return rows + [{"sample": line, "method": "skipped"} for line in missing]


def uncertainty(data: Path, presets: tuple[str, ...] = ("balanced", "fast", "accurate")) -> list[Row]:
    """Intervals of pairs and, in the preset `balanced`, of triples: `benchmarks.scores.flow.intervals`."""
    if samples.cv2 is None:
        return []
    rows: list[Row] = []
    found, missing = samples.read_all(samples.FLOWS + samples.LAYERED, data)
    for sample, preset in ((sample, preset) for sample in found for preset in presets):
        for count in (2, 3) if preset == "balanced" and len(sample.frames) > 2 else (2,):
            frames = sample.pair() if count == 2 else sample.frames
            method = jacoflow.CoarseToFine(preset=preset, time_scheme="pair" if count == 2 else None)
            found_field = jacoflow.flow(*frames, method=method)
            shares = intervals(found_field, sample.truth, sample.truth_std)
            rows.append({"sample": sample.name, "preset": preset, "frames": count, **shares})
    return rows + [{"sample": line, "preset": "skipped"} for line in missing]


WINDOW = 48
"""Side of the windows in which `left_by_truth` measures, px."""


def left_by_truth(sample: Sample) -> Array:
    """How far the next frame lies off after it was brought back along the truth, px, (n, 2): one step of
    Lucas and Kanade in each window that lies in the interior. A truth without errors leaves what noise, light
    and occlusion do in such windows, whatever the estimators."""
    first, second = (np.asarray(frame, dtype=float) for frame in sample.pair())
    if first.ndim == 3:
        first, second = first.mean(axis=-1), second.mean(axis=-1)
    rows, columns = np.indices(first.shape)
    u, v = np.moveaxis(np.nan_to_num(sample.truth), -1, 0)
    back = map_coordinates(second, [rows + v, columns + u], order=3, mode="nearest")
    gradients = np.stack(np.gradient(0.5 * (first + back))[::-1], axis=-1)
    weight, where = np.outer(*[np.hanning(WINDOW)] * 2), interior(sample.truth)
    left = []
    for y, x in itertools.product(*(range(0, n - WINDOW + 1, WINDOW // 2) for n in first.shape)):
        window = np.s_[y : y + WINDOW, x : x + WINDOW]
        if where[window].mean() > 0.97:
            along = gradients[window].reshape(-1, 2)
            weighted = along * weight.reshape(-1, 1)
            change = (back - first)[window]
            change = change - (weight * change).sum() / weight.sum()
            # Without texture nothing is off.
            left.append(np.linalg.lstsq(weighted.T @ along, -weighted.T @ change.ravel())[0])
    return np.array(left).reshape(-1, 2)


def truth(data: Path) -> list[Row]:
    """Mean and root mean square of what the truth leaves of each recording, px: `left_by_truth`."""
    if samples.cv2 is None:
        return []
    found, missing = samples.read_all(samples.FLOWS + samples.LAYERED, data)
    rows: list[Row] = []
    for sample in found:
        left = left_by_truth(sample)
        row: Row = {"sample": sample.name, "windows": len(left)}
        for component, name in enumerate("uv"):
            row[f"mean {name}"] = float(left[:, component].mean())
            row[f"rms {name}"] = root_mean_square(left[:, component])
        rows.append(row)
    return rows + [{"sample": line, "windows": "skipped"} for line in missing]


def strain(data: Path, ours: list[Setting] = RECORDINGS) -> list[Row]:
    """Image correlation: root mean square error of u (px, all pixels) and of u_x (1/frame, off the edge).

    OpenCV's rows have the Gaussians that suit u and u_x best, each chosen with the truth. Specified for ours:
    below both of them (`reach`), half of the better one (`aim`).
    """
    if samples.cv2 is None:
        return []
    try:
        sample, slope = samples.read_strain(data)
    except (OSError, ImportError) as problem:
        return [{"sample": "DIC", "method": f"skipped: {problem!r}"}]
    along, where = sample.truth[..., 0], inside(sample.truth.shape[:2], BORDER)

    def of_u(flow: Array, _jacobian: Array) -> float:
        return root_mean_square((flow[..., 0] - along)[np.isfinite(flow[..., 0])])

    def of_slope(_flow: Array, jacobian: Array) -> float:
        return root_mean_square((jacobian[..., 0, 0] - slope)[where & np.isfinite(jacobian[..., 0, 0])])

    rows: list[Row] = [
        {
            "sample": sample.name,
            "method": "no motion",
            "u_error": root_mean_square(along),
            "u_x_error": root_mean_square(np.where(where, slope, 0.0)[where]),
        }
    ]
    peers: list[Row] = []
    for method, run in rivals.RIVALS.items():
        flow = run(*sample.pair())
        fits = list(rivals.gaussian_fits(flow))
        (u_setting, *u_fit), (slope_setting, *slope_fit) = (
            rivals.best(iter(fits), error) for error in (of_u, of_slope)
        )
        peers.append(
            {
                "sample": sample.name,
                "method": method,
                "u_error": of_u(*u_fit),
                "u_x_error": of_slope(*slope_fit),
                "u_error_unsmoothed": of_u(flow, flow),
            }
        )
        peers[-1] |= {"best_sigma_u": u_setting["sigma"], "best_sigma": slope_setting["sigma"]}
    for setting in ours:
        estimate = setting.estimate(frames_for(sample, setting))
        row: Row = {
            "sample": sample.name,
            "method": setting.name,
            "share": float(np.isfinite(estimate[0]).all(axis=-1).mean()),
        }
        for name, error in (("u_error", of_u), ("u_x_error", of_slope)):
            reach = min(float(str(peer[name])) for peer in peers)
            row |= {name: error(*estimate), f"{name}_reach": reach, f"{name}_aim": reach / 2}
        rows.append(row)
    return rows[:1] + peers + rows[1:]


TABLES = {
    "flow": report.Table("Accuracy on recordings", lambda o: [] if o.data is None else table(o.data)),
    "layered": report.Table(
        "Accuracy at motion boundaries",
        lambda o: [] if o.data is None else table(o.data, readers=samples.LAYERED),
    ),
    "uncertainty": report.Table(
        "Intervals on recordings", lambda o: [] if o.data is None else uncertainty(o.data)
    ),
    "truth": report.Table(
        "What the truth leaves of the recordings", lambda o: [] if o.data is None else truth(o.data)
    ),
    "strain": report.Table(
        "Strain from image correlation", lambda o: [] if o.data is None else strain(o.data)
    ),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
