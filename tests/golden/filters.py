"""Writes filters.json: filterpy's linear, extended and unscented filters on a turning and falling body.

    python tests/golden/filters.py

The system is fixed here and in tests/filter/kalman.rs: state (x, y, speed, heading), range and bearing
measured from the origin; every number is a plain formula.
"""

import math
from pathlib import Path

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from record import write

STEPS = 30
Q = np.diag([1e-3, 1e-3, 1e-2, 1e-3])
R = np.diag([0.04, 1e-3])
X0 = np.array([3.0, 4.0, 1.0, 0.3])
P0 = np.diag([0.5, 0.5, 0.2, 0.1])


def move(x: np.ndarray, dt: float = 0.5) -> np.ndarray:
    """Constant speed and heading."""
    return np.array([x[0] + dt * x[2] * math.cos(x[3]), x[1] + dt * x[2] * math.sin(x[3]), x[2], x[3]])


def move_jacobian(x: np.ndarray, dt: float = 0.5) -> np.ndarray:
    """Derivative of move."""
    f = np.eye(4)
    f[0, 2], f[0, 3] = dt * math.cos(x[3]), -dt * x[2] * math.sin(x[3])
    f[1, 2], f[1, 3] = dt * math.sin(x[3]), dt * x[2] * math.cos(x[3])
    return f


def see(x: np.ndarray) -> np.ndarray:
    """Range and bearing."""
    return np.array([math.hypot(x[0], x[1]), math.atan2(x[1], x[0])])


def see_jacobian(x: np.ndarray) -> np.ndarray:
    """Derivative of see."""
    r2 = x[0] ** 2 + x[1] ** 2
    r = math.sqrt(r2)
    return np.array([[x[0] / r, x[1] / r, 0, 0], [-x[1] / r2, x[0] / r2, 0, 0]])


def measurement(t: int) -> list[float]:
    """A path that the filters do not know, with wiggles instead of random noise."""
    return [5.2 + 0.4 * t + 0.1 * math.sin(1.7 * t), 0.9 - 0.012 * t + 0.02 * math.cos(2.3 * t)]


def take(kf, steps) -> dict:  # noqa: ANN001
    """Runs a filter and keeps what it holds after each fifth step."""
    rows = []
    for t in range(STEPS):
        steps(kf, np.array(measurement(t)))
        if t % 5 == 4:
            likelihood = float(kf.log_likelihood)
            rows.append({"x": kf.x.tolist(), "P": kf.P.ravel().tolist(), "log_likelihood": likelihood})
    return rows


def unscented(alpha: float, beta: float, kappa: float, redraw: bool) -> list:
    """filterpy's filter; with new points after the prediction where asked."""
    points = MerweScaledSigmaPoints(4, alpha, beta, kappa)
    kf = UnscentedKalmanFilter(4, 2, 0.5, see, lambda x, dt: move(x, dt), points)
    kf.x, kf.P, kf.Q, kf.R = X0.copy(), P0.copy(), Q, R

    def step(kf, z):  # noqa: ANN001, ANN202
        kf.predict()
        # The installed release may or may not draw new points by itself: say which are meant.
        if redraw:
            kf.sigmas_f = points.sigma_points(kf.x, kf.P)
        kf.update(z)

    return take(kf, step)


def extended() -> list:
    """filterpy's extended filter, its linear prediction replaced by the non-linear one."""
    kf = ExtendedKalmanFilter(4, 2)
    kf.x, kf.P, kf.Q, kf.R = X0.copy(), P0.copy(), Q, R

    def step(kf, z):  # noqa: ANN001, ANN202
        f = move_jacobian(kf.x)
        kf.x, kf.P = move(kf.x), f @ kf.P @ f.T + Q
        kf.update(z, see_jacobian, see)

    return take(kf, step)


def linear() -> list:
    """filterpy's linear filter on the first two components with constant velocity."""
    kf = KalmanFilter(4, 2)
    kf.x, kf.P, kf.Q, kf.R = X0.copy(), P0.copy(), Q, R
    kf.F = np.eye(4) + 0.5 * np.eye(4, k=2)
    kf.H = np.eye(2, 4)

    def step(kf, z):  # noqa: ANN001, ANN202
        kf.predict()
        kf.update(z)

    return take(kf, step)


def main() -> None:
    """Runs everything."""
    record = {
        "unscented": unscented(1.0, 2.0, 0.0, True),
        "unscented_narrow": unscented(0.1, 2.0, -1.0, True),
        "extended": extended(),
        "linear": linear(),
    }
    path = Path(__file__).parent / "filters.json"
    write(path, record)


if __name__ == "__main__":
    main()
