"""The particle filter beside the Kalman filter on a linear model, and its CPU time beside filterpy's resampling and a NumPy filter.

    python benchmarks/particle_filter.py [--rounds 10] [--seeds 5] [--particles 20000]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import timing
from jacoflow.filters import KalmanFilter, ParticleFilter, resample

try:
    from filterpy import monte_carlo
except ImportError:
    monte_carlo = None

Array = NDArray[np.float64]
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


def worst_step(scheme: str, particles: int, seed: int) -> tuple[float, float, float, float]:
    """Largest error of the mean in sd/sqrt(ESS), of variances (relative) and of the log evidence; error of the summed log evidence."""
    kalman = KalmanFilter(2, 1)
    kalman.F, kalman.H, kalman.P, kalman.Q, kalman.R = F, np.array([[1.0, 0.0]]), P0, Q, R
    ours = ParticleFilter(2, particles, random_state=seed)
    ours.sample_gaussian([0.0, 0.0], P0)
    steps, total = [], 0.0
    for z in measurements(seed):
        kalman.predict()
        kalman.update(z)
        ours.predict(F=F, Q=Q)
        ours.update(likelihood(z))
        true, unit = np.diagonal(kalman.P), np.sqrt(np.diagonal(kalman.P) / ours.effective_sample_size)
        variance = np.abs(np.diagonal(ours.covariance) / true - 1).max()
        evidence = float(ours.log_evidence - kalman.log_likelihood)
        steps.append(((np.abs(ours.mean - kalman.x) / unit).max(), variance, abs(evidence)))
        total += evidence
        ours.resample(scheme)
    mean, variance, evidence = np.max(steps, axis=0)
    return float(mean), float(variance), float(evidence), abs(total)


def accuracy(particles: int, seeds: int) -> None:
    """Prints the comparison with the Kalman filter: ranges over the seeds."""
    print(f"Worst of {STEPS} steps against the Kalman filter, N = {particles}, seeds 0-{seeds - 1} (bars: {BARS})\n")
    print("| scheme | mean, sd/sqrt(ESS) | variances | log evidence of a step | of all steps together |\n|---|---|---|---|---|")
    for scheme in SCHEMES:
        rows = np.array([worst_step(scheme, particles, seed) for seed in range(seeds)])
        low, high = rows.min(axis=0), rows.max(axis=0)
        percent = f"{100 * low[1]:.1f}-{100 * high[1]:.1f} %"
        print(f"| {scheme} | {low[0]:.1f}-{high[0]:.1f} | {percent} | {low[2]:.3f}-{high[2]:.3f} | {low[3]:.3f}-{high[3]:.3f} |")


def copies(draws: int = 20_000) -> None:
    """Prints mean and variance of the copies of four particles, n = 8."""
    weights = np.array([0.1, 0.2, 0.3, 0.4])
    print(f"\nCopies of w = .1 .2 .3 .4, n = 8, {draws} draws\n\n| scheme | mean | variance |\n|---|---|---|")
    for scheme in SCHEMES:
        counts = np.array([np.bincount(resample(weights, 8, scheme, random_state=k), minlength=4) for k in range(draws)])
        mean, variance = (" ".join(f"{v:.2f}" for v in values) for values in (counts.mean(0), counts.var(0)))
        print(f"| {scheme} | {mean} | {variance} |")


def numpy_filter(z: Array, particles: int) -> None:
    """The same cycle written in NumPy, systematic resampling by searchsorted."""
    rng = np.random.default_rng(0)
    x, deviation = rng.normal(size=(particles, 2)) * 2.0, np.sqrt(np.diagonal(Q))
    for value in z:
        x = x @ F.T + rng.normal(size=x.shape) * deviation
        log = likelihood(value)(x)
        weights = np.exp(log - log.max())
        weights /= weights.sum()
        positions = (rng.random() + np.arange(particles)) / particles
        sums = np.cumsum(weights)
        sums[-1] = 1.0
        x = x[np.searchsorted(sums, positions)]


def our_filter(z: Array, particles: int, threads: int) -> None:
    """The same cycle of ours, with the likelihood as a Python function."""
    ours = ParticleFilter(2, particles, threads=threads)
    ours.sample_gaussian([0.0, 0.0], P0)
    for value in z:
        ours.predict(F=F, Q=Q)
        ours.update(likelihood(value))
        ours.resample("systematic")


def speed(particles: int, rounds: int) -> None:
    """Prints CPU times of the busiest thread and their ratios to ours with one thread."""
    z = measurements(0)
    cycle = timing.race(
        {
            "ours, 1 thread": lambda: our_filter(z, particles, 1),
            "ours, 2 threads": lambda: our_filter(z, particles, 2),
            "NumPy": lambda: numpy_filter(z, particles),
        },
        rounds,
    )
    print(f"\nA cycle (predict, update, resample), N = {particles}\n\n| filter | us | ratio |\n|---|---|---|")
    for name, time in cycle.items():
        print(f"| {name} | {1e6 * time.busiest / STEPS:.0f} | {time.busiest / cycle['ours, 1 thread'].busiest:.2f} |")
    if monte_carlo is None:
        return
    weights = np.random.default_rng(0).random(particles) ** 3
    weights /= weights.sum()
    print(f"\nOne resampling, N = {particles}\n\n| scheme | ours, us | filterpy, us | ratio |\n|---|---|---|---|")
    for scheme in SCHEMES:
        rival = getattr(monte_carlo, f"{scheme}_resample")
        both = timing.race({"ours": lambda s=scheme: resample(weights, scheme=s), "filterpy": lambda r=rival: r(weights)}, rounds)
        ours, theirs = both["ours"].busiest, both["filterpy"].busiest
        print(f"| {scheme} | {1e6 * ours:.0f} | {1e6 * theirs:.0f} | {theirs / ours:.1f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--particles", type=int, default=20_000)
    options = parser.parse_args()
    accuracy(options.particles, options.seeds)
    copies()
    speed(options.particles, options.rounds)


if __name__ == "__main__":
    main()
