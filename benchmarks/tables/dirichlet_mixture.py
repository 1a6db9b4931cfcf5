"""Dirichlet-process mixtures on random data with known clusters, beside scikit-learn's, in one process.

python -m benchmarks.tables.dirichlet_mixture
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scores import timing
from jacoflow.mixture import DirichletProcessGaussianMixture

Array = NDArray[np.float64]
Row = dict[str, object]
COMPONENTS = 12
"""Largest number of components of every method."""
SEEDS = 10
"""Random data sets of each kind."""
ACTIVE_SHARE = 0.005
"""Weight above which a component counts."""
LONG: dict[str, Any] = {"tol": 1e-6, "max_iter": 1000}
"""Rounds until variational Bayes has converged; it empties components slowly."""
CORRELATION = 0.8
"""Largest correlation of the axes of a blob, no unit."""
SPACING = 6.0
"""Distance between the centres of neighbouring blobs, standard deviations."""


def flow(rng: np.random.Generator) -> tuple[Array, NDArray[np.int64]]:
    """Flow vectors (440, 2) of a background, two moving objects and outliers, and their classes."""
    parts = [
        rng.normal((1.5, -0.6), 0.12, (350, 2)),
        rng.normal((3.0, -0.5), (0.4, 0.3), (40, 2)),
        rng.normal((-1.0, -0.5), (0.4, 0.3), (35, 2)),
        rng.uniform(-6, 6, (15, 2)),
    ]
    return np.concatenate(parts), np.repeat(np.arange(4), [len(part) for part in parts])


def blobs(rng: np.random.Generator) -> tuple[Array, NDArray[np.int64]]:
    """Five correlated clusters of 60 to 200 points, one in the middle and four around it, and their
    classes."""
    centres = SPACING * np.array([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]])
    parts = []
    for centre in centres:
        correlation = rng.uniform(-CORRELATION, CORRELATION)
        parts.append(
            rng.multivariate_normal(centre, [[1, correlation], [correlation, 1]], rng.integers(60, 201))
        )
    return np.concatenate(parts), np.repeat(np.arange(5), [len(part) for part in parts])


def one(rng: np.random.Generator) -> tuple[Array, NDArray[np.int64]]:
    """400 points of one Gaussian, and their class."""
    return rng.normal(size=(400, 2)), np.zeros(400, np.int64)


def small(rng: np.random.Generator) -> tuple[Array, NDArray[np.int64]]:
    """25 and 15 points at a distance of 7.3 standard deviations, and their classes."""
    labels = np.repeat([0, 1], [25, 15])
    return rng.normal(size=(40, 2)) + np.outer(labels, [7.3, 0.0]), labels


DATA: dict[str, Callable[[np.random.Generator], tuple[Array, NDArray[np.int64]]]] = {
    "flow": flow,
    "blobs": blobs,
    "one": one,
    "small": small,
}
"""Random data by name."""


def methods(seed: int) -> dict[str, Any]:
    """Mixtures by name, not yet fitted."""
    ours: dict[str, Any] = {"n_components": COMPONENTS, "random_state": seed, "threads": 1}
    out: dict[str, Any] = {
        "MAP-EM": DirichletProcessGaussianMixture(merge=False, **ours),
        "MAP-EM, merging": DirichletProcessGaussianMixture(**ours),
        "variational": DirichletProcessGaussianMixture(inference="vb", merge=False, **ours),
        "variational, long": DirichletProcessGaussianMixture(inference="vb", merge=False, **LONG, **ours),
        "variational, merging": DirichletProcessGaussianMixture(inference="vb", **ours),
    }
    try:
        from sklearn.mixture import BayesianGaussianMixture
    except ImportError:
        return out
    out["scikit-learn"] = BayesianGaussianMixture(
        n_components=COMPONENTS,
        weight_concentration_prior_type="dirichlet_process",
        weight_concentration_prior=1.0,
        random_state=seed,
    )
    return out


def adjusted_rand(first: NDArray[np.int64], second: NDArray[np.int64]) -> float:
    """Adjusted Rand index of two divisions (N,) of the same points (L. Hubert and P. Arabie, "Comparing
    partitions", 1985)."""

    def pairs(counts: Array) -> float:
        return float((counts * (counts - 1) / 2).sum())

    table = np.zeros((first.max() + 1, second.max() + 1))
    np.add.at(table, (first, second), 1)
    both, rows, columns, total = (
        pairs(table),
        pairs(table.sum(1)),
        pairs(table.sum(0)),
        len(first) * (len(first) - 1) / 2,
    )
    expected, largest = rows * columns / total, (rows + columns) / 2
    return 1.0 if largest == expected else (both - expected) / (largest - expected)


def quiet(mixture: Any, points: Array) -> Any:
    """Fits a mixture; scikit-learn's warnings of missing convergence are not shown."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mixture.fit(points)


def scores(data: str, method: str, seed: int) -> tuple[int, float, float]:
    """Number of components above `ACTIVE_SHARE`, largest weight and adjusted Rand index of one fit."""
    points, labels = DATA[data](np.random.default_rng(seed))
    mixture = quiet(methods(seed)[method], points)
    return (
        int((mixture.weights_ > ACTIVE_SHARE).sum()),
        float(mixture.weights_.max()),
        adjusted_rand(labels, mixture.predict(points)),
    )


def outcomes(seeds: int = 10) -> list[Row]:
    """One row for each kind of data: of every method the median number of components and its range over
    the seeds, the mean largest weight and the mean adjusted Rand index."""
    rows: list[Row] = []
    for data in DATA:
        row: Row = {"data": data}
        for method in methods(0):
            counts, weights, rands = zip(*(scores(data, method, seed) for seed in range(seeds)), strict=True)
            found = f"{np.median(counts):g} ({min(counts)}-{max(counts)})"
            row[method] = f"{found} {np.mean(weights):.3f} {np.mean(rands):.3f}"
        rows.append(row)
    return rows


def times(rounds: int = 3) -> list[Row]:
    """One row for each kind of data, seed 0: of every method milliseconds of a fit on one thread and how
    many times that scikit-learn takes."""
    rows: list[Row] = []
    for data, draw in DATA.items():
        points, _ = draw(np.random.default_rng(0))
        work: dict[str, Callable[[], object]] = {
            name: functools.partial(quiet, mixture, points) for name, mixture in methods(0).items()
        }
        spent = timing.race(work, rounds)
        reference = spent["scikit-learn"].busiest if "scikit-learn" in spent else float("nan")
        rows.append(
            {
                "data": data,
                **{
                    name: f"{1000 * time.busiest:.2f} ({reference / time.busiest:.0f})"
                    for name, time in spent.items()
                },
            }
        )
    return rows


TABLES = {
    "outcomes": report.Table(
        "Dirichlet-process mixtures: components (range), largest weight, adjusted Rand index",
        lambda o: outcomes(report.trials(o, SEEDS, 3)),
    ),
    "times": report.Table(
        "Dirichlet-process mixtures: milliseconds of a fit on one thread (scikit-learn's time over it)",
        lambda o: times(report.rounds(o)),
    ),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
