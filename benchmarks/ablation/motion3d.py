"""3-D motion: wrong estimates with status `ok`, misses of their ellipsoids, lost estimates, errors and time
of random scenes by group, and the time of a scene without any difficulty."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import motion3d as scenes
from benchmarks.scores.motion3d import angle, squared
from benchmarks.tables import motion3d_claims as claims
from benchmarks.tables import motion3d_coverage as coverage
from benchmarks.tables import motion3d_honesty as honesty
from benchmarks.tables import motion3d_layouts as layouts
from benchmarks.tables import motion3d_plain
from jacoflow import motion3d

Array = NDArray[np.float64]
LARGER_IS_BETTER = ()
FIRST = 20_000
"""Seed of the first scene; the kept tables use smaller ones."""
SCENES = 200
"""Scenes of each kind."""
FAR_OFF, DEVIATIONS, ELLIPSOID = 15.0, 4.0, 11.070
"""Degrees and standard deviations beyond which an `ok` is wrong; 95 % of chi squared with five degrees."""


def random_scene(seed: int, robust: bool) -> coverage.Estimated:
    """A scene of the honesty table."""
    make = honesty.trial(seed).scene
    found = motion3d.estimate_motion(make.points, make.flow, noise_std=make.noise_std, placement="start", robust=robust)
    return found, make.u, make.w


def plain(seed: int, n: int) -> coverage.Estimated:
    """A scene without any difficulty."""
    points, flow, u, w, _ = motion3d_plain.scene(seed, n)
    return motion3d.estimate_motion(points, flow, scenes.K, robust=True, threads=1), u, w


def exact(seed: int) -> coverage.Estimated:
    """Two views without noise that turn fast, of a camera that moves by a fiftieth to a fifth of the
    depth."""
    rng = np.random.default_rng((seed, 78))
    make = claims.displaced(rng.choice([0.02, 0.1, 0.2]), rng.uniform(0.02, 0.3), seed, 200)
    found = motion3d.estimate_motion(make.points, make.flow, noise_std=1e-6, robust=True, threads=1)
    return found, make.u, make.w


def narrow(seed: int) -> coverage.Estimated:
    """Two views of 10 degrees, of a camera that goes forward among clusters of near and far points, nearly
    without noise."""
    rng, half = np.random.default_rng((seed, 79)), np.tan(np.radians(5.0))
    clusters = rng.uniform(-0.8 * half, 0.8 * half, (3, 2))
    points = clusters[np.arange(20) % 3] + rng.uniform(-0.15 * half, 0.15 * half, (20, 2))
    inv_depth = 1 / rng.choice([5.0, 15.0], 20)
    u, w, noise_std = np.array([0.0, 0.0, -1.0]), 0.02 * rng.normal(size=3), 1e-4 * half
    flow = motion3d.predict_flow(points, u, w, inv_depth, whole_frame=True) + noise_std * rng.normal(size=(20, 2))
    return motion3d.estimate_motion(points, flow, noise_std=noise_std, threads=1), u, w


def few(seed: int) -> coverage.Estimated:
    """20 points without outliers in much unknown noise: some of them agree by chance far better than all
    do."""
    make = scenes.differential("uniform", "oblique", 20, 0.1, seed)
    found = motion3d.estimate_motion(make.points, make.flow, placement="start", robust=True, threads=1)
    return found, make.u, make.w


def ahead(seed: int) -> coverage.Estimated:
    """300 points of a wide field in much noise, of a camera that goes forward to a curved wall: the epipole
    lies among them."""
    make = scenes.differential("smooth", "forward", 300, 0.1, seed, 1.0)
    found = motion3d.estimate_motion(
        make.points, make.flow, noise_std=make.noise_std, placement="start", threads=1
    )
    return found, make.u, make.w


GROUPS: dict[str, list[Callable[[int], coverage.Estimated]]] = {
    "random": [lambda seed: random_scene(seed, False), lambda seed: random_scene(seed, True)],
    "objects": [lambda seed, ratio=ratio: layouts.moving_object(seed, ratio) for ratio in (1.0, 20.0, 100.0)]
    + [coverage.mover],
    "outliers": [lambda seed, share=share: coverage.outliers(seed, 0.2, share) for share in (0.4, 0.6)]
    + [coverage.few_points, lambda seed: coverage.far_background(seed, 0.2)],
    "many outliers": [lambda seed: coverage.outliers(seed, 0.3, 0.6)],
    "planes": [lambda seed, ratio=ratio: layouts.plane(seed, ratio) for ratio in (1.0, 30.0)],
    "views": [lambda seed, depth=depth: layouts.views(seed, depth, 0.05) for depth in ("waves", "plane")],
    "exact": [exact],
    "narrow": [narrow],
    "few": [few],
    # Rare differences need more scenes.
    "ahead": [lambda seed, more=more: ahead(seed + more) for more in range(0, 5000, 1000)],
    "lenses": [coverage.long_lens, layouts.band],
    "patches": [coverage.patches],
    "plain": [lambda seed: plain(seed, 1000)],
}  # fmt: skip
"""Kinds of scenes by the name of their rows."""


def rows() -> dict[str, list[float]]:
    """One value for each scene: error as the logarithm of degrees, time of the group's estimates in ms."""
    found: dict[str, list[float]] = {}
    for name, kinds in GROUPS.items():
        for figures in (judged(make, FIRST + seed) for make in kinds for seed in range(SCENES)):
            for figure, value in figures:
                found.setdefault(f"{name}: {figure}", []).append(value)
    return found


def judged(make: Callable[[int], coverage.Estimated], seed: int) -> Iterator[tuple[str, float]]:
    """Figures of one scene."""
    begun = time.process_time()
    found, u, w = make(seed)
    passed = 1e3 * (time.process_time() - begun)
    error, is_ok = angle(found.translation, u), found.status == "ok"
    off = np.concatenate([found.tangent @ u, w - found.rotation])
    yield "wrong", float(is_ok and error > max(FAR_OFF, DEVIATIONS * found.direction_std))
    yield "missed", float(is_ok and not (error < 90 and squared(off, found.covariance) < ELLIPSOID))
    yield "not ok", float(not is_ok)
    yield "log error", float(np.log(np.clip(np.nan_to_num(error, nan=90.0), 1e-2, 90.0)))
    yield "ms", passed
