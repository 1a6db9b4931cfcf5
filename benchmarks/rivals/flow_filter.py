"""The affine-flow unscented filter of WO2010/098160, written a second time: NumPy and filterpy, one pixel,
nothing shared with jacoflow.

It is the yardstick for the compiled filter. Run it to see the reference experiment (embodiment 2: the
brightness ramp turning about the origin, quantised and smoothed, watched at (60, 80)) in numbers:

    python -m benchmarks.rivals.flow_filter [--save FOLDER]

State ``q = (I, Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y)``; measurement: the nine brightness values
around the pixel, row by row.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

Array = NDArray[np.float64]

PROCESS_NOISE = np.array([1e-1, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-1, 1e-1, 1e-3, 1e-3, 1e-3, 1e-3])
"""Diagonal of Q, the patent's constants."""
MEASUREMENT_NOISE = 1e-3
"""Variance of each of the nine brightness values, the patent's constant."""
OMEGA = np.pi / 100
"""Angular velocity of the ramp, rad/frame."""
PIXEL = (60, 80)
"""The pixel (x, y) that is watched."""


def ramp(t: float, origin: tuple[int, int], size: int = 64) -> Array:
    """Brightness of the turning ramp at time ``t`` (frames) in a ``size`` x ``size`` window whose corner
    is the scene point ``origin``; (45)."""
    y, x = np.mgrid[0:size, 0:size].astype(float)
    return 0.2 * ((x + origin[0]) * np.cos(OMEGA * t) + (y + origin[1]) * np.sin(OMEGA * t)) + 128.0


def true_motion(pixel: tuple[int, int] = PIXEL) -> Array:
    """``(u, v, u_x, v_x, u_y, v_y)`` of the turning ramp at ``pixel``; (46)."""
    return np.array([-OMEGA * pixel[1], OMEGA * pixel[0], 0.0, OMEGA, -OMEGA, 0.0])


def smooth(image: Array, sigma: float, truncate: float = 4.0) -> Array:
    """Separable Gaussian of ``sigma`` px, cut at ``truncate`` sigma, mirrored borders (d c b a | a b c d)."""
    radius = int(truncate * sigma + 0.5)
    taps = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    taps /= taps.sum()
    for axis in (0, 1):
        padding = [(0, 0), (0, 0)]
        padding[axis] = (radius, radius)
        padded = np.pad(image, padding, mode="symmetric")
        image = np.apply_along_axis(lambda line: np.convolve(line, taps, mode="valid"), axis, padded)
    return image


def ramp_measurements(frames: int, quantise: bool = True, sigma: float | None = 3.0) -> Array:
    """The nine brightness values around the watched pixel for ``frames`` frames, shape (frames, 9)."""
    origin = (PIXEL[0] - 32, PIXEL[1] - 32)
    rows = []
    for t in range(frames):
        image = ramp(t, origin)
        if quantise:
            image = np.floor(image)
        if sigma is not None:
            image = smooth(image, sigma)
        rows.append(image[31:34, 31:34].ravel())
    return np.array(rows)


def observation_matrix() -> Array:
    """Rows ``[1, ex, ey, ex^2/2, ex ey, ey^2/2]`` for the nine offsets, then zeros for the motion; shape
    (9, 12); (40)-(43)."""
    rows = [[1, x, y, x * x / 2, x * y, y * y / 2, 0, 0, 0, 0, 0, 0] for y in (-1, 0, 1) for x in (-1, 0, 1)]
    return np.array(rows, dtype=float)


def rate(q: Array) -> Array:
    """``q'`` of the affine-flow system (11) for one state (12,). Plain numbers: for twelve of them that is
    several times faster than arrays."""
    _, ix, iy, ixx, ixy, iyy, u, v, u_x, v_x, u_y, v_y = q.tolist()
    return np.array(
        (
            -(ix * u + iy * v),
            -(ixx * u + ixy * v + ix * u_x + iy * v_x),
            -(ixy * u + iyy * v + ix * u_y + iy * v_y),
            -(2 * ixx * u_x + 2 * ixy * v_x),
            -(ixx * u_y + ixy * (u_x + v_y) + iyy * v_x),
            -(2 * ixy * u_y + 2 * iyy * v_y),
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        )
    )


def transition(q: Array, noise: Array | float = 0.0, dt: float = 1.0) -> Array:
    """One frame of ``q' = f(q) + noise`` by one classical Runge-Kutta step, the noise held constant inside
    it."""
    k1 = rate(q) + noise
    k2 = rate(q + 0.5 * dt * k1) + noise
    k3 = rate(q + 0.5 * dt * k2) + noise
    k4 = rate(q + dt * k3) + noise
    return q + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def root_with_motion_first(covariance: Array) -> Array:
    """``U`` with ``U^T U = covariance`` (12, 12) by Cholesky in the order motion, brightness."""
    order = [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]
    root = np.empty_like(covariance)
    root[:, order] = np.linalg.cholesky(covariance[np.ix_(order, order)]).T
    return root


@dataclass
class Settings:
    """What the patent fixes (Q, R, zero start) and what it leaves open (initial covariance, sigma-point
    constants)."""

    process_noise: Array
    measurement_noise: float
    initial_covariance: Array
    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0

    @classmethod
    def patent(cls) -> Settings:
        """The patent's profile with ``P0 = I``."""
        return cls(PROCESS_NOISE, MEASUREMENT_NOISE, np.ones(12))


class ReferenceFilter:
    """filterpy's unscented filter set up for one pixel: ``step(z)`` predicts and updates.

    ``augmented``: sigma points of the state with its process noise (24 dimensions, 49 points), else 12
    dimensions and additive Q (25 points). ``motion_first``: the square root that spreads the points takes the
    motion before the brightness, as jacoflow's form "fast" does. Beyond second order the points depend on it:
    with the patent's constants filterpy's own order, brightness first, follows the ramp more closely.
    """

    def __init__(self, settings: Settings, *, augmented: bool, motion_first: bool = False) -> None:
        self.settings, self.augmented = settings, augmented
        n = 24 if augmented else 12
        root = root_with_motion_first if motion_first else None
        points = MerweScaledSigmaPoints(n, settings.alpha, settings.beta, settings.kappa, sqrt_method=root)
        observe = observation_matrix()
        self.filter = UnscentedKalmanFilter(
            dim_x=n,
            dim_z=9,
            dt=1.0,
            hx=lambda state: observe @ state[:12],
            fx=self._move_augmented if augmented else (lambda state, dt: transition(state, dt=dt)),
            points=points,
        )
        self.filter.R = settings.measurement_noise * np.eye(9)
        self.filter.Q = np.zeros((24, 24)) if augmented else np.diag(settings.process_noise)
        self._start(np.zeros(12), np.diag(settings.initial_covariance))

    @staticmethod
    def _move_augmented(state: Array, dt: float) -> Array:
        return np.concatenate([transition(state[:12], state[12:], dt), state[12:]])

    def _start(self, mean: Array, covariance: Array) -> None:
        """Sets the state; the augmented form appends fresh process noise."""
        if not self.augmented:
            self.filter.x, self.filter.P = mean.copy(), covariance.copy()
            return
        self.filter.x = np.concatenate([mean, np.zeros(12)])
        self.filter.P = np.zeros((24, 24))
        self.filter.P[:12, :12] = covariance
        self.filter.P[12:, 12:] = np.diag(self.settings.process_noise)

    def step(self, z: Array) -> tuple[Array, Array]:
        """Predicts over one frame and updates with nine brightness values; returns mean (12,) and
        covariance (12, 12)."""
        self.filter.predict()
        # Some releases keep the points that were moved, which leaves Q out of the innovation covariance of
        # the additive form.
        self.filter.sigmas_f = self.filter.points_fn.sigma_points(self.filter.x, self.filter.P)
        self.filter.update(z)
        mean = self.filter.x[:12].copy()
        covariance = self.filter.P[:12, :12].copy()
        covariance = 0.5 * (covariance + covariance.T)
        self._start(mean, covariance)
        return mean, covariance


def run(
    measurements: Array, settings: Settings, *, augmented: bool, motion_first: bool = False
) -> tuple[Array, Array]:
    """Means (T, 12) and covariances (T, 12, 12) after each frame."""
    estimator = ReferenceFilter(settings, augmented=augmented, motion_first=motion_first)
    states = [estimator.step(z) for z in measurements]
    return np.array([m for m, _ in states]), np.array([c for _, c in states])


def settle_frame(means: Array, tolerance: float = 0.25) -> int:
    """The last frame at which u or v is off by ``tolerance`` px/frame or more: from the next one on both
    stay inside."""
    off = np.abs(means[:, 6:8] - true_motion()[:2]).max(axis=1) >= tolerance
    return int(np.flatnonzero(off)[-1]) if off.any() else -1


def report(name: str, means: Array) -> str:
    """The experiment's figures as lines of text."""
    names = ("u", "v", "u_x", "v_x", "u_y", "v_y")
    late = means[200:, 6:] - true_motion()
    lines = [
        f"{name}:",
        f"  after frame 0: I {means[0, 0]:.6f}  Ix {means[0, 1]:.9f}  Iy {means[0, 2]:.2e}"
        f"  m {np.abs(means[0, 6:]).max():.1e}",
        f"  after frame 1: u {means[1, 6]:.5f}  v {means[1, 7]:.5f}  v_y {means[1, 11]:.5f}",
        f"  last frame off by 0.25 px or more: {settle_frame(means)}",
        "  frames 200-399, rms error: "
        + "  ".join(f"{n} {e:.4f}" for n, e in zip(names, np.sqrt((late**2).mean(axis=0)))),
        "  frames 200-399, bias:      "
        + "  ".join(f"{n} {e:+.4f}" for n, e in zip(names, late.mean(axis=0))),
    ]
    return "\n".join(lines)


def main() -> None:
    """Prints the reference experiment's figures; ``--save`` keeps states and covariances of some frames."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--save", type=Path, help="folder for .npz files with the measurements, means and some covariances"
    )
    options = parser.parse_args()
    measurements = ramp_measurements(400)
    for augmented in (True, False):
        name = "augmented" if augmented else "non_augmented"
        means, covariances = run(measurements, Settings.patent(), augmented=augmented)
        print(report(name, means))
        if options.save is not None:
            options.save.mkdir(parents=True, exist_ok=True)
            frames = np.array([0, 1, 2, 10, 399])
            np.savez(
                options.save / f"{name}.npz",
                measurements=measurements,
                means=means,
                frames=frames,
                covariances=covariances[frames],
            )


if __name__ == "__main__":
    main()
