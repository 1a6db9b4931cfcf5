"""How often covariances of 3-D motion hold where they are hardest to state.

    python -m benchmarks.tables.motion3d_coverage [--trials 400] [--cases CASE ...]

Long lenses, narrow fields with epipoles among the points, a moving object, few points with outliers in
unknown noise, many outliers, few near points before a far background, few patches, fast rotations; none is
one of the published tables. `wrong`: status `ok`, and more than 15 degrees and four standard deviations off.
`ellipsoid`, `ellipse`: shares of the `ok` estimates whose 95 % ellipsoid of all five unknowns, and whose 95 %
ellipse of the direction, hold the truth.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scenes import motion3d as scenes
from benchmarks.scores.motion3d import ELLIPSE, ELLIPSOID, angle, far_off, squared
from benchmarks.tables.motion3d_honesty import DEPTHS
from jacoflow import motion3d

Array = NDArray[np.float64]
Row = dict[str, object]
Estimated = tuple[motion3d.MotionEstimate, Array, Array]
"""An estimate, and the true direction and rotation."""
TRIALS = 400


def _by_chance(rng: np.random.Generator, turn: float = 0.04) -> tuple[Array, Array]:
    """A direction uniform on the sphere, a rotation of up to `turn` rad/frame about each axis."""
    u = rng.normal(size=3)
    return u / np.linalg.norm(u), rng.uniform(-turn, turn, 3)


def _flow(points: Array, nu: Array, u: Array, w: Array) -> Array:
    g, r = scenes.rows(points)
    return nu[:, None] * (g @ u) + r @ w


def long_lens(seed: int) -> Estimated:
    """Half width .15 to .2, 200 to 1000 points, noise of 1 to 10 % of the median translational flow."""
    rng = np.random.default_rng((seed, 21))
    half, n = rng.uniform(0.15, 0.2), int(np.exp(rng.uniform(np.log(200), np.log(1000))))
    (u, w), shape = _by_chance(rng), rng.uniform(-1, 1, (n, 2))
    nu = list(DEPTHS.values())[seed % len(DEPTHS)](shape, rng)
    moved = _flow(half * shape, nu, u, 0 * w)
    noise_std = float(np.exp(rng.uniform(np.log(0.01), np.log(0.1))) * np.median(np.linalg.norm(moved, axis=1)))
    flow = _flow(half * shape, nu, u, w) + noise_std * rng.normal(size=(n, 2))
    return motion3d.estimate_motion(half * shape, flow, noise_std=noise_std, placement="start"), u, w


def layout(
    seed: int, depth: str, u: tuple[float, float, float], half: float, n: int, noise_std: float, turning: bool
) -> Estimated:
    """Points in `[-half, half]^2` of one layout, without or with the published rotation."""
    rng = np.random.default_rng((seed, 26))
    shape = rng.uniform(-1, 1, (n, 2))
    direction, w = np.array(u) / np.linalg.norm(u), scenes.W0 * turning
    flow = _flow(half * shape, scenes.depths(depth, shape, rng), direction, w) + noise_std * rng.normal(
        size=(n, 2)
    )
    return motion3d.estimate_motion(half * shape, flow, noise_std=noise_std, placement="start"), direction, w


NARROW = (
    ("ground", (1.0, 0.0, 0.0), 0.25, 60, 0.03),
    ("ground", (1.0, 0.0, 0.0), 0.25, 200, 0.06),
    ("ground", (0.1, 1.0, 0.2), 0.15, 200, 0.03),
    ("ground", (1.0, 0.1, 0.2), 0.15, 200, 0.03),
    ("ground", (0.6, 0.2, 0.75), 0.25, 200, 0.03),
    ("smooth", (0.1, 1.0, 0.2), 0.15, 200, 0.03),
)
"""Depths, translation, half width, points and noise of narrow fields; of the last a rotation is known to a
radian only."""

AROUND = (
    ("smooth", (0.35, 0.25, 1.0), 0.6, 40, 0.03),
    ("smooth", (0.35, 0.25, 1.0), 0.6, 500, 0.1),
    ("smooth", (0.35, 0.25, 1.0), 1.0, 500, 0.1),
    ("smooth", (0.05, -0.03, 1.0), 1.0, 500, 0.1),
    ("layers", (0.05, -0.03, 1.0), 0.2, 500, 0.02),
)
"""The same with the epipole among the points."""


def mover(seed: int) -> Estimated:
    """Two views in pixels with a moving object on a tenth to a third of the points; noise .1 to .3 px,
    median flow 6 px."""
    rng = np.random.default_rng((seed, 22))
    depth, name = ("smooth", "uniform", "layers")[seed % 3], ("oblique", "forward", "off")[seed // 3 % 3]
    noise_std = rng.uniform(0.1, 0.3)
    make = scenes.two_views(
        depth, name, noise_std, 6, 40_000 + seed, n=int(rng.uniform(300, 1200)), mover=rng.uniform(0.1, 0.33)
    )
    return (
        motion3d.estimate_motion(make.points, make.flow, scenes.K, noise_std=noise_std, robust=True),
        make.u,
        make.w,
    )


def few_points(seed: int) -> Estimated:
    """20 to 60 points, 10 to 30 % of them outliers, in unknown noise of 1 to 5 % of the median
    translational flow."""
    rng = np.random.default_rng((seed, 23))
    n = int(rng.uniform(20, 61))
    (u, w), shape = _by_chance(rng), rng.uniform(-1, 1, (n, 2))
    nu = rng.uniform(0.5, 1.5, n)
    moved = _flow(0.6 * shape, nu, u, 0 * w)
    size = float(np.median(np.linalg.norm(moved, axis=1)))
    flow = _flow(0.6 * shape, nu, u, w) + rng.uniform(0.01, 0.05) * size * rng.normal(size=(n, 2))
    wrong = rng.uniform(size=n) < rng.uniform(0.1, 0.3)
    flow = np.where(wrong[:, None], rng.uniform(-4 * size, 4 * size, (n, 2)), flow)
    return motion3d.estimate_motion(0.6 * shape, flow, placement="start", robust=True), u, w


def outliers(seed: int, noise: float, share: float) -> Estimated:
    """1000 points, of which a share has any flow up to four times the median translational flow, of which
    `noise` is a share, too."""
    rng = np.random.default_rng((seed, 26))
    (u, w), shape = _by_chance(rng), rng.uniform(-1, 1, (1000, 2))
    nu = scenes.depths(("uniform", "smooth")[seed % 2], shape, rng)
    size = float(np.median(np.linalg.norm(_flow(0.6 * shape, nu, u, 0 * w), axis=1)))
    flow = _flow(0.6 * shape, nu, u, w) + noise * size * rng.normal(size=(1000, 2))
    flow = np.where(rng.uniform(size=(1000, 1)) < share, rng.uniform(-4 * size, 4 * size, (1000, 2)), flow)
    return (
        motion3d.estimate_motion(0.6 * shape, flow, noise_std=noise * size, placement="start", robust=True),
        u,
        w,
    )


FAR_NOISE = 0.2
"""Noise of two views of a far background, px."""


def _far_background(seed: int, wrong: float) -> tuple[Array, Array, Array, Array]:
    """Points, flow and motion of two views: a twentieth of 600 points moves by 20 px, the others, far
    away, by 1 to 2; of all, a share is `wrong`."""
    rng = np.random.default_rng((seed, 27))
    u, w = _by_chance(rng, 0.02)
    pixels = rng.uniform([0, 0], [640, 480], (600, 2))
    near = rng.uniform(size=600) < 0.05
    nu = np.where(near, rng.uniform(0.8, 1.2, 600), rng.uniform(0.05, 0.1, 600))
    g, _ = scenes.rows((pixels - [320, 240]) / 500)
    nu *= 20 / np.median(500 * np.linalg.norm(nu[near, None] * (g[near] @ u), axis=1))
    flow = scenes.displaced(pixels, nu, u, w) - pixels + FAR_NOISE * rng.normal(size=(600, 2))
    return pixels, np.where(rng.uniform(size=(600, 1)) < wrong, rng.uniform(-80, 80, (600, 2)), flow), u, w


def far_background(seed: int, wrong: float) -> Estimated:
    """Few near points before a far background."""
    pixels, flow, u, w = _far_background(seed, wrong)
    return motion3d.estimate_motion(pixels, flow, scenes.K, noise_std=FAR_NOISE, robust=True), u, w


def far_row(name: str, trials: int, wrong: float) -> Row:
    """The row of few near points before a far background, with errors beside those of OpenCV's MAGSAC
    where that is installed."""
    errors: list[float] = []
    theirs: list[float] = []

    def estimated() -> Iterator[Estimated]:
        for seed in range(trials):
            found, u, w = far_background(seed, wrong)
            errors.append(angle(found.translation, u))
            magsac = _magsac(*_far_background(seed, wrong)[:2])
            theirs.extend([] if magsac is None else [angle(magsac, u)])
            yield found, u, w

    told = row(name, estimated())
    rms = lambda values: round(float(np.sqrt(np.mean(np.square(values)))), 2) if values else float("nan")
    return told | {"rms, deg": rms(errors), "rms of MAGSAC, deg": rms(theirs)}


def _magsac(pixels: Array, flow: Array) -> Array | None:
    """The direction by OpenCV's MAGSAC; None where OpenCV is not installed or finds none."""
    try:
        import cv2
    except ImportError:
        return None
    essential, mask = cv2.findEssentialMat(
        pixels, pixels + flow, scenes.K, cv2.USAC_MAGSAC, 0.999, 2 * FAR_NOISE
    )
    if essential is None:
        return None
    return np.ravel(
        cv2.recoverPose(essential[:3], pixels, pixels + flow, scenes.K, distanceThresh=1e7, mask=mask)[2]
    )


def patches(seed: int, n: int = 6) -> Estimated:
    """Patches of half size 60 px with flow and Jacobian, f = 500 px, noise of .02 to .15 px, half width .2
    to .6."""
    rng = np.random.default_rng((seed, 24))
    name = ("oblique", "forward", "lateral", "off")[seed % 4]
    make, jacobian, covariance = scenes.patches(
        name, n, 60, rng.uniform(0.02, 0.15), 50_000 + seed, rng.uniform(0.2, 0.6)
    )
    found = motion3d.estimate_motion(
        make.points, make.flow, scenes.K, cov=covariance, jacobian=jacobian, placement="start"
    )
    return found, make.u, make.w


def turns(seed: int, turn: float, robust: bool) -> Estimated:
    """Two exact views of 800 points that turn by `turn` rad about an axis by chance, .2 px of noise,
    median flow of 6 px; with `robust` 30 % outliers."""
    rng = np.random.default_rng((seed, 25))
    make = scenes.two_views("smooth", "oblique", 0.0, 6.0, 60_000 + seed, n=800)
    axis = rng.normal(size=3)
    w = turn * axis / np.linalg.norm(axis)
    flow = (
        scenes.displaced(make.points, make.depths, make.u, w)
        - make.points
        + rng.normal(0, 0.2, make.flow.shape)
    )
    if robust:
        flow = np.where(rng.uniform(size=(800, 1)) < 0.3, rng.uniform(-80, 80, flow.shape), flow)
    return motion3d.estimate_motion(make.points, flow, scenes.K, noise_std=0.2, robust=robust), make.u, w


CASES: dict[str, dict[str, Callable[[int], Estimated]]] = {
    "long": {"long lens, half width .15 to .2": long_lens},
    "narrow": {
        f"{depth}, u {u}, half width {half:g}, {n} points, noise {noise_std:g}": (
            lambda seed, of=(depth, u, half, n, noise_std): layout(seed, *of, turning=False)
        )
        for depth, u, half, n, noise_std in NARROW
    },
    "around": {
        f"{depth}, u {u}, half width {half:g}, {n} points, noise {noise_std:g}": (
            lambda seed, of=(depth, u, half, n, noise_std): layout(seed, *of, turning=True)
        )
        for depth, u, half, n, noise_std in AROUND
    },
    "mover": {"a moving object, robust": mover},
    "few": {"20 to 60 points, outliers, unknown noise": few_points},
    "outliers": {
        f"{share:.0%} outliers, noise {noise:g} of the flow": (
            lambda seed, n=noise, s=share: outliers(seed, n, s)
        )
        for share in (0.4, 0.6)
        for noise in (0.05, 0.1, 0.2, 0.3)
    },
    "patches": {
        "6 patches with Jacobians": patches,
        "10 patches with Jacobians": lambda seed: patches(seed, 10),
        "30 patches with Jacobians": lambda seed: patches(seed, 30),
    },
    "turns": {
        f"two views that turn by {turn:g} rad{', 30 % outliers' if robust else ''}": (
            lambda seed, t=turn, r=robust: turns(seed, t, r)
        )
        for turn in (0.05, 0.12, 0.17, 0.25)
        for robust in (False, True)
    },
}
"""Scenes by the name of their part."""


def row(name: str, estimated: Iterator[Estimated]) -> Row:
    """How often the estimates of one kind of scene hold."""
    statuses: Counter[str] = Counter()
    ellipsoids, ellipses, errors, wrong = [], [], [], 0
    for found, u, w in estimated:
        statuses[found.status] += 1
        if found.status != "ok":
            continue
        off = np.concatenate([found.tangent @ u, w - found.rotation])
        near = angle(found.translation, u) < 90
        wrong += far_off(found, u)
        ellipsoids.append(near and squared(off, found.covariance) < ELLIPSOID)
        ellipses.append(near and squared(off[:2], found.covariance[:2, :2]) < ELLIPSE)
        errors.append(angle(found.translation, u))
    others = ", ".join(f"{status} {count}" for status, count in sorted(statuses.items()) if status != "ok")
    share = lambda held: round(float(np.mean(held)), 3) if held else float("nan")
    return {
        "scenes": name,
        "trials": sum(statuses.values()),
        "ok": statuses["ok"],
        "wrong": wrong,
        "ellipsoid": share(ellipsoids),
        "ellipse": share(ellipses),
        "median, deg": round(float(np.median(errors)), 2) if errors else float("nan"),
        "others": others,
    }


def table(trials: int = TRIALS, only: list[str] | None = None) -> list[Row]:
    """One row for each kind of scene."""
    rows = [
        row(name, map(make, range(trials)))
        for part, kinds in CASES.items()
        if only is None or part in only
        for name, make in kinds.items()
    ]
    if only is None or "outliers" in only:
        rows += [
            far_row(f"5 % near points before a far background, {wrong:.0%} outliers", trials, wrong)
            for wrong in (0.0, 0.2)
        ]
    return rows


TABLES = {
    "coverage": report.Table(
        "3-D motion: where covariances are hardest to state",
        lambda o: table(report.trials(o, TRIALS, 12), o.cases),
    )
}
ARGUMENTS = {"--cases": {"nargs": "+", "choices": list(CASES), "help": "parts of the table"}}

if __name__ == "__main__":
    report.main(__doc__, TABLES, ARGUMENTS)
