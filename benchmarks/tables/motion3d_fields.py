"""How often the covariance of the motion of a flow field holds: random rendered rooms with exact truth.

    python -m benchmarks.tables.motion3d_fields [--trials 40] [--only fields errors]

Two frames of 320 x 240 px, f = 300 px, noise of 1.5 and 5 grey levels, flow by both methods with windows;
motions are estimated robustly (default), from all points, and from patches of 48 px. `quick`: translational
flow of about 2 px, too fast for the windowed method; `slow`: a quarter of it. Columns as in
`motion3d_coverage`. `errors`: what the errors of one field have in common.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np

import jacoflow
from benchmarks import report
from benchmarks.scenes import rooms
from benchmarks.tables.motion3d_coverage import Estimated, Row, row
from jacoflow import motion3d
from jacoflow._jacoflow import _motion3d_field_points

TRIALS = 40
Method = Literal["coarse_to_fine", "windowed"]
METHODS: tuple[Method, ...] = ("coarse_to_fine", "windowed")
NOISES = (1.5, 5.0)
STEPS = {"quick": 0.02, "slow": 0.005}
"""How far the camera moves between both frames, in units of which walls are 1.2 to 3 away."""
TURN = 0.3
"""Most that it turns, in shares of that."""
WAYS: dict[str, dict[str, Any]] = {
    "default": {},
    "robust=False": {"robust": False},
    "patches=48": {"patches": 48},
}


def field(method: Method, noise: float, step: float, seed: int) -> tuple[jacoflow.FlowField, rooms.Room]:
    """The flow field of a room, and this."""
    made = rooms.room(seed, step, TURN * step)
    return jacoflow.flow(*rooms.frames(made, noise, seed), method=method), made


def fields(
    method: Method, noise: float, step: float, trials: int
) -> list[tuple[jacoflow.FlowField, rooms.Room]]:
    """Flow fields of rooms, and these."""
    return [field(method, noise, step, seed) for seed in range(trials)]


def estimated(seen: list[tuple[jacoflow.FlowField, rooms.Room]], way: str) -> Iterator[Estimated]:
    """Their motions, estimated in one way, and the true ones."""
    for field, made in seen:
        yield motion3d.estimate_field_motion(field, rooms.K, **WAYS[way])[0], made.u, made.w


def table(trials: int = TRIALS, only: list[Method] | None = None) -> list[Row]:
    """One row for each method, noise, speed and way."""
    rows: list[Row] = []
    for method in only or METHODS:
        for speed, step in STEPS.items():
            for noise in NOISES:
                seen = fields(method, noise, step, trials)
                rows += [
                    row(f"{method}, {speed}, noise {noise:g}, {way}", estimated(seen, way)) for way in WAYS
                ]
    return rows


def in_common(field: jacoflow.FlowField, made: rooms.Room) -> tuple[float, float, float]:
    """Mean error of a field in standard deviations of one point, what independent errors would make it, and
    excess length.

    The mean error is the root mean square of both components; the excess length of the flow is in units of
    what its covariances state. The tenth of the points with the largest errors, occluded ones, is left out.
    """
    points, flow, covariances, (_, shared, _, scale, _) = _motion3d_field_points(field, None, None, None)
    true, covariances = made.flow(points), covariances / shared
    errors, information = flow - true, np.linalg.inv(covariances)
    squares = np.einsum("ki,kij,kj->k", errors, information, errors)
    kept = squares <= np.quantile(squares, 0.9)
    roots = np.linalg.cholesky(information[kept]).transpose(0, 2, 1)

    def fit(columns: rooms.Array) -> tuple[rooms.Array, rooms.Array]:
        rows = (roots @ columns).reshape(-1, columns.shape[2])
        inverse = np.linalg.inv(rows.T @ rows)
        return inverse @ rows.T @ np.einsum("kij,kj->ki", roots, errors[kept]).reshape(-1), inverse

    one = np.broadcast_to(np.eye(2), (int(kept.sum()), 2, 2))
    mean, inverse = fit(one)
    longer = fit(np.concatenate([true[kept, :, None], one], axis=2))[0][0]
    deviation = np.sqrt(np.median(np.trace(covariances, axis1=1, axis2=2)) / 2)
    return (
        float(np.sqrt(np.mean(mean**2)) / deviation),
        float(np.sqrt(np.trace(inverse) / 2) / deviation),
        float(longer / scale),
    )


def errors(trials: int = TRIALS, only: list[Method] | None = None) -> list[Row]:
    """One row for each method, noise and speed: root mean squares over rooms."""
    rows: list[Row] = []
    for method in only or METHODS:
        for speed, step in STEPS.items():
            for noise in NOISES:
                seen = [in_common(field, made) for field, made in fields(method, noise, step, trials)]
                mean, independent, longer = np.sqrt(np.mean(np.square(seen), axis=0))
                name = f"{method}, {speed}, noise {noise:g}"
                rows.append(
                    {
                        "flow": name,
                        "rooms": trials,
                        "mean error, deviations of a point": round(mean, 2),
                        "if independent": round(independent, 2),
                        "too long, in units of the stated error": round(longer, 2),
                    }
                )
    return rows


TABLES = {
    "fields": report.Table(
        "3-D motion: flow fields of rendered rooms", lambda o: table(report.trials(o, TRIALS))
    ),
    "errors": report.Table(
        "3-D motion: what the errors of a picture's flow have in common",
        lambda o: errors(report.trials(o, TRIALS)),
    ),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
