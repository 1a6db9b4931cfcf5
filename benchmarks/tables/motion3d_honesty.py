"""How often a 3-D motion with status `ok` is wrong, and how often its ellipses hold, on random scenes.

    python -m benchmarks.tables.motion3d_honesty [--trials 6000] [--robust]

Directions are uniform on the sphere, rotations up to 0.05 rad/frame, noise 1 to 30 % of the median
translational flow, 30 to 2000 points in a field of half width 0.15 to 1; no scene is one of the published
tables. `wrong`: status `ok`, and the direction more than 15 degrees and four of its standard deviations off.
`holds`: share of the `ok` ones whose 95 % ellipse of the direction holds the truth.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scenes import motion3d as scenes
from benchmarks.scores.motion3d import ELLIPSE, angle, far_off, squared
from jacoflow import motion3d

Array = NDArray[np.float64]
Row = dict[str, object]
TRIALS = 6000
WIDTHS = ((0.15, 0.3), (0.3, 0.6), (0.6, 1.0))
"""Classes of the half width of the field."""


def _waves(shape: Array, rng: np.random.Generator) -> Array:
    """Smooth depths: three waves."""
    waves = rng.normal(size=(3, 2)) * 2
    phases, sizes = rng.uniform(0, 2 * np.pi, 3), rng.uniform(0.05, 0.25, 3)
    return 1 + np.sin(shape @ waves.T + phases) @ sizes


def _objects(shape: Array, rng: np.random.Generator) -> Array:
    """Four discs before a wall."""
    nu = np.full(len(shape), 0.5)
    for centre, radius, depth in zip(
        rng.uniform(-1, 1, (4, 2)), rng.uniform(0.2, 0.5, 4), rng.uniform(0.7, 2, 4), strict=True
    ):
        nu[np.linalg.norm(shape - centre, axis=1) < radius] = depth
    return nu


def _street(shape: Array, rng: np.random.Generator) -> Array:
    """Ground below a horizon, houses on both sides, a far end."""
    ground, houses = (
        1.2 * np.maximum(shape[:, 1] - rng.uniform(-0.2, 0.2), 0),
        rng.uniform(0.5, 1) * np.maximum(np.abs(shape[:, 0]) - 0.3, 0),
    )
    return np.maximum(np.maximum(ground, houses), rng.uniform(0.05, 0.2))


DEPTHS: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "cloud": lambda shape, rng: rng.uniform(0.3, 1.7, len(shape)),
    "waves": _waves,
    "discs": _objects,
    "street": _street,
}
"""Inverse depths at places in [-1, 1]^2."""


@dataclass(frozen=True)
class Trial:
    """A scene, and what it is like."""

    depth: str
    half: float
    scene: scenes.Scene


def trial(seed: int) -> Trial:
    """Everything by chance."""
    rng = np.random.default_rng((seed, 11))
    depth = list(DEPTHS)[seed % len(DEPTHS)]
    low, high = WIDTHS[seed // len(DEPTHS) % len(WIDTHS)]
    half, n = rng.uniform(low, high), int(np.exp(rng.uniform(np.log(30), np.log(2000))))
    u, w = rng.normal(size=3), rng.normal(size=3)
    u, w = u / np.linalg.norm(u), rng.uniform(0, 0.05) * w / np.linalg.norm(w)
    shape = rng.uniform(-1, 1, (n, 2))
    nu = DEPTHS[depth](shape, rng)
    g, r = scenes.rows(half * shape)
    moved = nu[:, None] * (g @ u)
    noise_std = np.exp(rng.uniform(np.log(0.01), np.log(0.3))) * np.median(np.linalg.norm(moved, axis=1))
    return Trial(
        depth,
        half,
        scenes.Scene(half * shape, moved + r @ w + noise_std * rng.normal(size=(n, 2)), nu, u, w, float(noise_std)),
    )


@dataclass(frozen=True)
class Verdict:
    """Outcome of a trial."""

    status: str
    wrong: bool
    holds: bool


def verdict(each: Trial, robust: bool) -> Verdict:
    """Status of the estimate with known noise, whether it is wrong, whether its ellipse holds."""
    make = each.scene
    found = motion3d.estimate_motion(
        make.points, make.flow, noise_std=make.noise_std, placement="start", robust=robust
    )
    if found.status != "ok":
        return Verdict(found.status, False, False)
    distance = squared(found.tangent @ make.u, found.covariance[:2, :2])
    return Verdict("ok", far_off(found, make.u), angle(found.translation, make.u) < 90 and distance < ELLIPSE)


def table(trials: int = TRIALS, robust: bool = False) -> list[Row]:
    """One row for each kind of depth and each class of fields."""
    judged = [(each, verdict(each, robust)) for each in map(trial, range(trials))]
    classes = {depth: [v for each, v in judged if each.depth == depth] for depth in DEPTHS}
    classes |= {
        f"half width {low:g} to {high:g}": [v for each, v in judged if low <= each.half < high]
        for low, high in WIDTHS
    }
    rows: list[Row] = []
    for name, verdicts in {**classes, "all": [v for _, v in judged]}.items():
        statuses = Counter(v.status for v in verdicts)
        ok = max(1, statuses["ok"])
        others = ", ".join(
            f"{status} {count}" for status, count in sorted(statuses.items()) if status != "ok"
        )
        rows.append(
            {
                "scenes": name,
                "trials": len(verdicts),
                "ok": statuses["ok"],
                "wrong": sum(v.wrong for v in verdicts),
                "holds": round(sum(v.holds for v in verdicts) / ok, 3),
                "others": others,
            }
        )
    return rows


TABLES = {
    "honesty": report.Table(
        "3-D motion: what is said of scenes by chance",
        lambda o: table(report.trials(o, TRIALS, 12), o.robust),
    )
}
ARGUMENTS = {"--robust": {"action": "store_true", "help": "robust estimates of scenes without outliers"}}

if __name__ == "__main__":
    report.main(__doc__, TABLES, ARGUMENTS)
