"""How often 3-D motion holds for unusual layouts, shapes of noise, planes, and long displacements in large
noise.

    python -m benchmarks.tables.motion3d_layouts [--trials 400] [--cases CASE ...]

Directions are uniform on the sphere, rotations up to 0.05 rad/frame, noise 0.3 to 20 % of the median
translational flow, 20 to 1000 points in a field of half width 0.2 to 1; depths are a cloud, waves, discs, a
street or a wall with 3 % relief.

- `objects`: a moving object on a tenth to a third of the points, half as near again; noise .3 to 10 %, robust
  search.
- `planes`: exact planes, noise of 1 % of the flow; the twin solution differs only in points behind the
  camera.
- `band`: a tenth as high as wide, up to 160 degrees of it visible.
- `views`: two views, translation of a tenth of the depth, noise as a share of the displacements.

Columns as in `motion3d_coverage`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scenes import motion3d as scenes
from benchmarks.tables.motion3d_coverage import Estimated, Row, row
from benchmarks.tables.motion3d_honesty import DEPTHS
from jacoflow import motion3d

Array = NDArray[np.float64]
TRIALS = 400


def _wall(shape: Array, rng: np.random.Generator) -> Array:
    """Nearly a plane: a slanted wall and what stands out of it by 3 %."""
    return (1 + shape @ rng.uniform(-0.4, 0.4, 2)) * (1 + 0.03 * rng.normal(size=len(shape)))


SURFACES = [*DEPTHS.values(), _wall]


def _ring(n: int, rng: np.random.Generator) -> Array:
    """Along the edge of the picture only."""
    angle, radius = rng.uniform(0, 2 * np.pi, n), rng.uniform(0.85, 1, n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)


def _rows(n: int, rng: np.random.Generator) -> Array:
    """On three lines of the picture."""
    return np.stack([rng.uniform(-1, 1, n), rng.choice([-0.5, 0.1, 0.6], n)], 1)


LAYOUTS: dict[str, Callable[[int, np.random.Generator], Array]] = {
    "all over the picture": lambda n, rng: rng.uniform(-1, 1, (n, 2)),
    "a corner": lambda n, rng: rng.uniform(0.4, 1, (n, 2)),
    "a cluster anywhere": lambda n, rng: rng.uniform(-0.7, 0.7, 2) + rng.normal(0, 0.15, (n, 2)),
    "two clusters": lambda n, rng: rng.choice([-0.7, 0.7], (n, 1)) + rng.normal(0, 0.1, (n, 2)),
    "a ring": _ring,
    "three lines": _rows,
}
"""Places in [-1, 1]^2."""

RATIOS = (5.0, 20.0, 50.0, 200.0)
"""Longest over shortest axis of the noise of a point."""


def estimated(seed: int, layout: str, ratio: float = 1.0) -> Estimated:
    """A random scene with points of one layout, noise of one shape in any orientation, with known
    covariances."""
    rng = np.random.default_rng((seed, 31))
    half, n = rng.uniform(0.2, 1), int(np.exp(rng.uniform(np.log(20), np.log(1000))))
    u, w = _unit(rng), rng.uniform(0, 0.05) * _unit(rng)
    shape = LAYOUTS[layout](n, rng)
    nu = np.maximum(SURFACES[seed % len(SURFACES)](shape, rng), 0.02)
    g, r = scenes.rows(half * shape)
    moved = nu[:, None] * (g @ u)
    noise_std = np.exp(rng.uniform(np.log(0.003), np.log(0.2))) * np.median(np.linalg.norm(moved, axis=1))
    roots = _roots(n, ratio, float(noise_std), rng)
    flow = moved + r @ w + np.einsum("kij,kj->ki", roots, rng.normal(size=(n, 2)))
    return (
        motion3d.estimate_motion(half * shape, flow, cov=roots @ roots.transpose(0, 2, 1), placement="start"),
        u,
        w,
    )


def moving_object(seed: int, ratio: float) -> Estimated:
    """A random scene with a moving object; robust."""
    rng = np.random.default_rng((seed, 35))
    half, n = rng.uniform(0.2, 1), int(np.exp(rng.uniform(np.log(60), np.log(1000))))
    u, w = _unit(rng), rng.uniform(0, 0.05) * _unit(rng)
    shape = LAYOUTS[list(LAYOUTS)[seed % len(LAYOUTS)]](n, rng)
    nu = np.maximum(SURFACES[seed // len(LAYOUTS) % len(SURFACES)](shape, rng), 0.02)
    near = np.argsort(np.linalg.norm(shape - shape[rng.integers(n)], axis=1))[
        : int(n * rng.uniform(0.1, 0.33))
    ]
    g, r = scenes.rows(half * shape)
    moved = nu[:, None] * (g @ u)
    noise_std = float(np.exp(rng.uniform(np.log(0.003), np.log(0.1))) * np.median(np.linalg.norm(moved, axis=1)))
    flow = moved + r @ w
    flow[near] = 1.5 * nu[near, None] * (g[near] @ _unit(rng)) + r[near] @ (0.03 * _unit(rng))
    roots = _roots(n, ratio, noise_std, rng)
    flow += np.einsum("kij,kj->ki", roots, rng.normal(size=(n, 2)))
    return (
        motion3d.estimate_motion(
            half * shape, flow, cov=roots @ roots.transpose(0, 2, 1), placement="start", robust=True
        ),
        u,
        w,
    )


def plane(seed: int, ratio: float) -> Estimated:
    """300 points of a wall."""
    rng = np.random.default_rng((seed, 32))
    points = rng.uniform(-0.5, 0.5, (300, 2))
    nu = 1 + points @ rng.uniform(-0.8, 0.8, 2)
    u, w = _unit(rng), 0.03 * _unit(rng)
    g, r = scenes.rows(points)
    moved = nu[:, None] * (g @ u)
    roots = _roots(300, ratio, 0.01 * float(np.median(np.linalg.norm(moved, axis=1))), rng)
    flow = moved + r @ w + np.einsum("kij,kj->ki", roots, rng.normal(size=(300, 2)))
    return (
        motion3d.estimate_motion(points, flow, cov=roots @ roots.transpose(0, 2, 1), placement="start"),
        u,
        w,
    )


def band(seed: int) -> Estimated:
    """A nearly flat surface in a band across a wide image, with lateral motion."""
    rng = np.random.default_rng((seed, 33))
    n, half = int(np.exp(rng.uniform(np.log(30), np.log(2000)))), np.tan(np.radians(rng.uniform(55, 80)))
    shape = rng.uniform([-1, -0.1], [1, 0.1], (n, 2))
    phases = rng.uniform(0, 2 * np.pi, 2)
    nu = 1 + 0.1 * np.sin(2 * shape[:, 0] + phases[0]) * np.cos(2 * shape[:, 1] + phases[1])
    u, w = np.append(_unit(rng)[:2], 0.0), rng.uniform(0, 0.05) * _unit(rng)
    u /= np.linalg.norm(u)
    g, r = scenes.rows(half * shape)
    moved = nu[:, None] * (g @ u)
    noise_std = float(np.exp(rng.uniform(np.log(0.002), np.log(0.1))) * np.median(np.linalg.norm(moved, axis=1)))
    return (
        motion3d.estimate_motion(
            half * shape, moved + r @ w + noise_std * rng.normal(size=(n, 2)), noise_std=noise_std, placement="start"
        ),
        u,
        w,
    )


def views(seed: int, depth: str, noise: float) -> Estimated:
    """Two exact views in pixels, f = 500, of a field of 15 to 70 degrees; the camera moves by a tenth of
    the depth and turns by .03 rad."""
    rng = np.random.default_rng((seed, 34))
    n, half = int(np.exp(rng.uniform(np.log(50), np.log(3000)))), np.tan(np.radians(rng.uniform(7.5, 35)))
    shape = LAYOUTS[("all over the picture", "a corner", "a cluster anywhere")[seed % 3]](n, rng)
    nu = 0.1 * np.maximum(
        1 + 0.5 * shape @ rng.uniform(-1, 1, 2) if depth == "plane" else DEPTHS[depth](shape, rng), 0.05
    )
    u, w = _unit(rng), 0.03 * _unit(rng)
    pixels = [320, 240] + 500 * half * shape
    still = scenes.displaced(pixels, 0 * nu, u, w)
    moved = scenes.displaced(pixels, nu, u, w)
    noise_std = noise * float(np.median(np.linalg.norm(moved - still, axis=1)))
    flow = moved - pixels + noise_std * rng.normal(size=(n, 2))
    return motion3d.estimate_motion(pixels, flow, scenes.K, noise_std=noise_std), u, w


VIEWS = (("waves", 0.03), ("waves", 0.1), ("cloud", 0.1), ("cloud", 0.3), ("plane", 0.01), ("plane", 0.05))
"""Depths and noise, as a share of the displacement, of two views."""


def _unit(rng: np.random.Generator) -> Array:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def _roots(n: int, ratio: float, noise_std: float, rng: np.random.Generator) -> Array:
    """Roots of covariances with `noise_std` as the geometric mean of their axes."""
    angle = rng.uniform(0, np.pi, n)
    turned = np.stack(
        [np.stack([np.cos(angle), -np.sin(angle)], 1), np.stack([np.sin(angle), np.cos(angle)], 1)], 1
    )
    return turned * (noise_std * np.array([ratio**0.5, ratio**-0.5]))


def cases(only: list[str] | None = None) -> dict[str, Callable[[int], Estimated]]:
    """What is tried, by the name of its row."""
    parts: dict[str, dict[str, Callable[[int], Estimated]]] = {
        "layouts": {name: (lambda seed, name=name: estimated(seed, name)) for name in LAYOUTS},
        "noise": {
            f"all over the picture, axes of the noise {ratio:g} to 1": (
                lambda seed, ratio=ratio: estimated(seed, "all over the picture", ratio)
            )
            for ratio in RATIOS
        },
        "objects": {
            f"a moving object, robust, axes of the noise {ratio:g} to 1": (
                lambda seed, ratio=ratio: moving_object(seed, ratio)
            )
            for ratio in (1.0, 20.0, 100.0)
        },
        "planes": {
            f"a plane, axes of the noise {ratio:g} to 1": (lambda seed, ratio=ratio: plane(seed, ratio))
            for ratio in (1.0, 10.0, 30.0, 100.0)
        },
        "band": {"a nearly flat band, 110 to 160 degrees wide": band},
        "views": {
            f"two views, {depth}, noise {noise:g} of the displacement": (
                lambda seed, depth=depth, noise=noise: views(seed, depth, noise)
            )
            for depth, noise in VIEWS
        },
    }
    return {
        name: make
        for part, kinds in parts.items()
        if only is None or part in only
        for name, make in kinds.items()
    }


def coverage_row(name: str, trials: int) -> Row:
    """One row."""
    return row(name, map(cases()[name], range(trials)))


def table(trials: int = TRIALS, only: list[str] | None = None) -> list[Row]:
    """One row for each of what is tried."""
    return [coverage_row(name, trials) for name in cases(only)]


TABLES = {
    "layouts": report.Table(
        "3-D motion: where the points lie, what shape their noise has, planes and long displacements",
        lambda o: table(report.trials(o, TRIALS, 12), o.cases),
    )
}
ARGUMENTS = {
    "--cases": {
        "nargs": "+",
        "choices": ["layouts", "noise", "objects", "planes", "band", "views"],
        "help": "parts of the table",
    }
}

if __name__ == "__main__":
    report.main(__doc__, TABLES, ARGUMENTS)
