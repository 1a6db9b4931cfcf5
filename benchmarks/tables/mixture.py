"""A round of the weighted variational mixture beside scikit-learn's, on the same points, and how far both
agree.

python -m benchmarks.tables.mixture
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scores import timing
from jacoflow.mixture import VariationalGaussianMixture

try:
    from sklearn.mixture import BayesianGaussianMixture
except ImportError:
    BayesianGaussianMixture = object

Array = NDArray[np.float64]
Row = dict[str, object]
SETTINGS = ((12, 5000, 3), (12, 5000, 2), (30, 5000, 3), (12, 50000, 3), (8, 5000, 10))
"""Components, points, dimensions."""
FEW, MANY = 2, 42
"""Rounds of the two fits whose difference in time is that of `MANY - FEW` rounds."""


class FromResponsibilities(BayesianGaussianMixture):  # type: ignore[misc]
    """scikit-learn's mixture, begun with given responsibilities."""

    resp: Array

    def _initialize_parameters(self, X: Array, random_state: object, xp: object = None) -> None:
        self._initialize(X, self.resp)


def case(components: int, count: int, dimensions: int) -> tuple[Array, Array]:
    """Points (N, D) about as many centres as there are components, and responsibilities (N, K) that know
    half of the truth: from random ones rounding decides between optima."""
    rng = np.random.default_rng(0)
    centres = rng.normal(0, 10, (components, dimensions))
    labels = rng.integers(components, size=count)
    points = centres[labels] + rng.normal(0, 2, (count, dimensions))
    return points, 0.5 * np.eye(components)[labels] + 0.5 * rng.dirichlet(np.ones(components), count)


def ours(points: Array, shares: Array, rounds: int, threads: int) -> VariationalGaussianMixture:
    """A fit of ours."""
    mixture = VariationalGaussianMixture(
        shares.shape[1], covariance_prior=0.1, tol=None, max_iter=rounds, threads=threads
    )
    return mixture.fit(points, resp=shares)


def theirs(points: Array, shares: Array, rounds: int) -> FromResponsibilities:
    """The same fit of scikit-learn's, whose first round is its initialisation."""
    d = points.shape[1]
    mixture = FromResponsibilities(
        n_components=shares.shape[1],
        weight_concentration_prior_type="dirichlet_distribution",
        weight_concentration_prior=0.1,
        mean_precision_prior=1e-3,
        mean_prior=points.mean(0),
        degrees_of_freedom_prior=d + 9.1,
        covariance_prior=0.1 * np.eye(d),
        reg_covar=0,
        max_iter=rounds - 1,
        tol=0,
    )
    mixture.resp = shares
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mixture.fit(points)
    return mixture


def table(rounds: int = 10) -> list[Row]:
    """One row for each of `SETTINGS`: milliseconds of a round, and the largest relative difference of the
    covariances after `MANY`."""
    rows: list[Row] = []
    for components, count, dimensions in SETTINGS:
        points, shares = case(components, count, dimensions)
        work: dict[tuple[str, int], Callable[[], object]] = {}
        for many in (FEW, MANY):
            for threads in (1, 2):
                work[f"jacoflow, {threads} thread{'s' * (threads > 1)}", many] = lambda n=many, t=threads: (
                    ours(points, shares, n, t)
                )
            if BayesianGaussianMixture is not object:
                work["scikit-learn", many] = lambda n=many: theirs(points, shares, n)
        times = timing.race(work, rounds)
        spent = {
            name: 1000 * (times[name, MANY].busiest - times[name, FEW].busiest) / (MANY - FEW)
            for name, many in work
            if many == MANY
        }
        reference = spent.get("scikit-learn", float("nan"))
        difference = float("nan")
        if "scikit-learn" in spent:
            ours_, theirs_ = (
                ours(points, shares, MANY, 1).covariances_,
                theirs(points, shares, MANY).covariances_,
            )
            difference = float(np.abs(ours_ / theirs_ - 1).max())
        for name, milliseconds in spent.items():
            rows.append(
                {
                    "components": components,
                    "points": count,
                    "dimensions": dimensions,
                    "method": name,
                    "milliseconds_per_round": milliseconds,
                    "times_scikit-learn": reference / milliseconds,
                    "largest_relative_difference": difference if name.startswith("jaco") else "",
                }
            )
    return rows


TABLES = {"rounds": report.Table("Weighted mixtures, a round", lambda o: table(report.rounds(o)))}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
