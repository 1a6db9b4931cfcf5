"""Six numbers a patch, flow and Jacobian, against flow alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scenes import motion3d as scenes
from benchmarks.scores.motion3d import angle, rms
from jacoflow import motion3d

Array = NDArray[np.float64]
Row = dict[str, object]

SIX = (
    (0.6, 200, 15, 0.5, (5.75, 5.02, 7.67, 5.14, 4.18, 4.16)),
    (0.6, 200, 7, 0.3, (2.94, 2.88, 3.56, 2.83, 2.60, 2.60)),
    (0.6, 10, 60, 0.15, (8.25, 8.30, 8.77, 8.16, 8.85, 7.78)),
    (0.2, 30, 60, 0.15, (16.9, 16.8, 11.7, 11.2, 16.1, 11.4)),
    (0.2, 100, 30, 0.15, (5.36, 5.36, 5.65, 5.14, 5.45, 5.16)),
)
"""Half width, patches, half size and noise in px; published: flow ML, flow with a normal prior, six
numbers ML, six shrunk, bounds."""


LAYOUTS, NEAREST = 400, 8
"""Random layouts of patches, and those of them whose bounds are nearest to the published ones."""


def six_bounds(make: scenes.Scene, covariance: Array) -> tuple[float, float]:
    """Bounds of the direction's standard deviation, degrees: of flow alone and of six numbers."""
    flow = motion3d.motion_bound(make.points, make.u, make.w, make.depths[:, 0], scenes.K, noise_std=make.noise_std)
    six = motion3d.motion_bound(
        make.points, make.u, make.w, make.depths, scenes.K, cov=covariance, jacobian=True
    )
    return float(flow.direction_std[0]), float(six.direction_std[0])


def like_the_published(
    h: float, n: int, radius: int, noise_std: float, asked: Sequence[float]
) -> tuple[list[int], str]:
    """Seeds of the layouts whose bounds are nearest to the published ones, and the range of the bounds of
    flow alone among 90 % of all."""
    bounds = np.array(
        [six_bounds(*scenes.patches("oblique", n, radius, noise_std, seed, h)[::2]) for seed in range(LAYOUTS)]
    )
    off = np.abs(np.log(bounds / asked[4:])).max(1)
    low, high = np.quantile(bounds[:, 0], (0.05, 0.95))
    return [int(seed) for seed in np.argsort(off)[:NEAREST]], f"{low:.2f} to {high:.2f}"


def six_numbers(trials: int) -> list[Row]:
    """Six numbers a patch against flow alone; the minimum nearest to the truth, rms degrees.

    The bounds of few patches differ by a factor of two between layouts: each case is given for random
    layouts, one for each trial, and for those with the published bounds.
    """
    rows: list[Row] = []
    for h, n, radius, noise_std, asked in SIX:
        case = f"oblique h={h} n={n} r={radius} sigma {noise_std} px"
        like, spread = like_the_published(h, n, radius, noise_std, asked)
        made = {
            "drawn anew": [scenes.patches("oblique", n, radius, noise_std, seed, h) for seed in range(trials)],
            "with the published bounds": [
                scenes.patches("oblique", n, radius, noise_std, like[t % NEAREST], h, t) for t in range(trials)
            ],
        }
        for layouts, drawn in made.items():
            rows.append(
                {
                    "case": case,
                    "layouts": layouts,
                    "trials": trials,
                    **six_row(drawn, asked),
                    "bounds of 90 % of layouts, flow": spread,
                }
            )
    return rows


def six_row(drawn: list[tuple[scenes.Scene, Array, Array]], asked: Sequence[float]) -> Row:
    """What patches with noise give beside the published figures."""
    columns: dict[str, list[float]] = {
        c: [] for c in ("flow ML", "flow prior", "six ML", "six shrunk", "CRLB flow", "CRLB six")
    }
    # Layouts that are drawn again, with other noise, have the same bounds.
    bounds: dict[bytes, tuple[float, float]] = {}
    for make, jacobian, covariance in drawn:
        layout = make.points.tobytes() + make.depths.tobytes()
        if layout not in bounds:
            bounds[layout] = six_bounds(make, covariance)
        near = {"placement": "start", "initial": (make.u, make.w), "method": "efficient"}
        flow = motion3d.estimate_motion(
            make.points, make.flow, scenes.K, noise_std=make.noise_std, smoother="prior", **near
        )  # type: ignore[arg-type]
        six = motion3d.estimate_motion(
            make.points, make.flow, scenes.K, cov=covariance, jacobian=jacobian, **near
        )  # type: ignore[arg-type]
        found = [
            angle(u, make.u)
            for u in (flow.ml.translation, flow.translation, six.ml.translation, six.translation)
        ]
        for values, value in zip(columns.values(), (*found, *bounds[layout]), strict=True):
            values.append(value)
    row: Row = {}
    for (column, values), figure in zip(columns.items(), asked, strict=True):
        row[column], row[f"{column} asked"] = round(rms(values), 2), figure
    # Layouts drawn differ, and their bounds with them: over the bound of their own layouts the errors can be
    # compared.
    for column, bound, (own, its) in (("flow ML", "CRLB flow", (0, 4)), ("six shrunk", "CRLB six", (3, 5))):
        row[f"{column} / bound"], row[f"{column} / bound asked"] = (
            round(rms(columns[column]) / rms(columns[bound]), 2),
            round(asked[own] / asked[its], 2),
        )
    return row


TABLES = {
    "six": report.Table(
        "3-D motion: Six numbers a patch against flow", lambda o: six_numbers(report.trials(o, 240))
    )
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
