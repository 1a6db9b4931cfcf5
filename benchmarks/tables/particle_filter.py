"""The particle filter beside the Kalman filter on a linear model, and its CPU time beside filterpy's
resampling and a NumPy filter.

python -m benchmarks.tables.particle_filter
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.scores import timing
from jacoflow.filters import KalmanFilter, ParticleFilter, resample

try:
    from filterpy import monte_carlo
except ImportError:
    monte_carlo = None

Array = NDArray[np.float64]
Row = dict[str, object]
SEEDS, PARTICLES = 12, 20_000
COLUMNS = (
    "mean, sd/sqrt(ESS)",
    "variances, %",
    "log evidence of a step",
    "of all steps together",
    "N / smallest ESS",
)
SCHEMES = ("systematic", "stratified", "residual", "multinomial")
F = np.array([[1.0, 1.0], [0.0, 1.0]])
Q = np.diag([0.05, 0.02])
R = 0.5
P0 = 4.0 * np.eye(2)
STEPS = 60
BARS = "mean 10 sd/sqrt(ESS), variances 15 %, log evidence .25"
"""Of the specification, for the worst step."""


def measurements(seed: int) -> Array:
    """Positions (STEPS,) of a constant-velocity motion, with noise of variance R."""
    rng = np.random.default_rng(seed)
    state = rng.multivariate_normal([0, 0], P0)
    positions = []
    for _ in range(STEPS):
        state = F @ state + rng.multivariate_normal([0, 0], Q)
        positions.append(state[0] + rng.normal(0, np.sqrt(R)))
    return np.array(positions)


def likelihood(z: float) -> Callable[[Array], Array]:
    """Log likelihood of the position z for particles (N, 2)."""
    return lambda x: -0.5 * ((z - x[..., 0]) ** 2 / R + np.log(2 * np.pi * R))


class NumpyFilter:
    """The same filter written in NumPy, with systematic resampling by searchsorted."""

    def __init__(self, particles: int, seed: int) -> None:
        self.rng = np.random.default_rng(1000 + seed)
        self.x = 2.0 * self.rng.normal(size=(particles, 2))
        self.weights = np.full(particles, 1 / particles)
        self.log_evidence = 0.0

    def predict(self, *, F: Array, Q: Array) -> None:
        self.x = self.x @ F.T + self.rng.normal(size=self.x.shape) * np.sqrt(np.diagonal(Q))

    def update(self, log_likelihood: Callable[[Array], Array]) -> None:
        logs = log_likelihood(self.x)
        weights = np.exp(logs - logs.max()) * self.weights
        self.log_evidence = float(logs.max() + np.log(weights.sum()))
        self.weights = weights / weights.sum()

    def resample(self, scheme: str) -> None:
        count = len(self.x)
        sums = np.cumsum(self.weights)
        sums[-1] = 1.0
        self.x = self.x[np.searchsorted(sums, (self.rng.random() + np.arange(count)) / count)]
        self.weights = np.full(count, 1 / count)

    @property
    def mean(self) -> Array:
        return self.weights @ self.x

    @property
    def covariance(self) -> Array:
        return np.cov(self.x.T, aweights=self.weights, ddof=0)

    @property
    def effective_sample_size(self) -> float:
        return float(1 / np.square(self.weights).sum())


def ours(particles: int, seed: int, threads: int | None = None) -> ParticleFilter:
    """Our filter at the model's start."""
    made = ParticleFilter(2, particles, random_state=seed, threads=threads)
    made.sample_gaussian([0.0, 0.0], P0)
    return made


def worst_step(filter_: ParticleFilter | NumpyFilter, scheme: str, seed: int) -> tuple[float, ...]:
    """Largest error of the mean in sd/sqrt(ESS), of variances (relative) and of the log evidence; error of
    its sum; N / smallest ESS."""
    kalman = KalmanFilter(2, 1)
    kalman.F, kalman.H, kalman.P, kalman.Q, kalman.R = F, np.array([[1.0, 0.0]]), P0, Q, R
    steps, total, fewest = [], 0.0, np.inf
    for z in measurements(seed):
        kalman.predict()
        kalman.update(z)
        filter_.predict(F=F, Q=Q)
        filter_.update(likelihood(z))
        true, unit = np.diagonal(kalman.P), np.sqrt(np.diagonal(kalman.P) / filter_.effective_sample_size)
        variance = np.abs(np.diagonal(filter_.covariance) / true - 1).max()
        evidence = float(filter_.log_evidence - kalman.log_likelihood)
        steps.append(((np.abs(filter_.mean - kalman.x) / unit).max(), variance, abs(evidence)))
        total += evidence
        fewest = min(fewest, float(filter_.effective_sample_size))
        filter_.resample(scheme)
    mean, variance, evidence = np.max(steps, axis=0)
    return float(mean), float(variance), float(evidence), abs(total), len(filter_.x) / fewest


def accuracy(particles: int, seeds: int) -> list[Row]:
    """The comparison with the Kalman filter: median of the seeds' worst steps (largest)."""
    rows: list[Row] = []
    for scheme in (*SCHEMES, "NumPy, systematic"):
        begin = NumpyFilter if scheme.startswith("NumPy") else ours
        worst = [worst_step(begin(particles, seed), scheme, seed) for seed in range(seeds)]
        figures = np.array(worst) * [1, 100, 1, 1, 1]
        cells = zip(COLUMNS, np.median(figures, axis=0), figures.max(axis=0), (1, 1, 3, 3, 1), strict=True)
        rows.append({"filter": scheme} | {name: f"{m:.{d}f} ({most:.{d}f})" for name, m, most, d in cells})
    return rows


def copies(draws: int = 20_000) -> list[Row]:
    """Mean and variance of the copies of four particles, n = 8."""
    weights = np.array([0.1, 0.2, 0.3, 0.4])
    rows: list[Row] = []
    for scheme in SCHEMES:
        drawn = (resample(weights, 8, scheme, random_state=k) for k in range(draws))
        counts = np.array([np.bincount(each, minlength=4) for each in drawn])
        mean, variance = (" ".join(f"{v:.2f}" for v in values) for values in (counts.mean(0), counts.var(0)))
        rows.append({"scheme": scheme, "mean": mean, "variance": variance})
    return rows


def cycle(filter_: ParticleFilter | NumpyFilter, z: Array) -> None:
    """Follows all measurements."""
    for value in z:
        filter_.predict(F=F, Q=Q)
        filter_.update(likelihood(value))
        filter_.resample("systematic")


def cycles(particles: int, rounds: int) -> list[Row]:
    """CPU time of the busiest thread for one cycle of prediction, update and resampling."""
    z = measurements(0)
    times = timing.race(
        {
            "ours, 1 thread": lambda: cycle(ours(particles, 0, 1), z),
            "ours, 2 threads": lambda: cycle(ours(particles, 0, 2), z),
            "NumPy": lambda: cycle(NumpyFilter(particles, 0), z),
        },
        rounds,
    )
    base = times["ours, 1 thread"].busiest
    return [
        {"filter": name, "us": 1e6 * time.busiest / STEPS, "ratio": time.busiest / base}
        for name, time in times.items()
    ]


def resampling(particles: int, rounds: int) -> list[Row]:
    """CPU time of one resampling beside filterpy's."""
    if monte_carlo is None:
        return []
    weights = np.random.default_rng(0).random(particles) ** 3
    weights /= weights.sum()
    rows: list[Row] = []
    for scheme in SCHEMES:
        rival = getattr(monte_carlo, f"{scheme}_resample")
        times = timing.race(
            {"ours": lambda s=scheme: resample(weights, scheme=s), "filterpy": lambda r=rival: r(weights)},
            rounds,
        )
        own, theirs = times["ours"].busiest, times["filterpy"].busiest
        rows.append(
            {"scheme": scheme, "ours, us": 1e6 * own, "filterpy, us": 1e6 * theirs, "ratio": theirs / own}
        )
    return rows


TABLES = {
    "accuracy": report.Table(
        f"Particle filter, worst of {STEPS} steps against the Kalman filter: median of seeds (largest); "
        f"required: {BARS}",
        lambda o: accuracy(PARTICLES, report.trials(o, SEEDS)),
    ),
    "copies": report.Table("Particle filter, copies of weights .1 .2 .3 .4, n = 8", lambda _: copies()),
    "cycles": report.Table("Particle filter, time of a cycle", lambda o: cycles(PARTICLES, report.rounds(o))),
    "resampling": report.Table(
        "Particle filter, time of a resampling", lambda o: resampling(PARTICLES, report.rounds(o))
    ),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
