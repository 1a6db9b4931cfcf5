"""Published values of 3-D motion that no chance is in, recomputed."""

from __future__ import annotations

import numpy as np

from benchmarks import report
from benchmarks.scenes import motion3d as scenes
from jacoflow import motion3d

Row = dict[str, object]

U0, W0 = scenes.motion("oblique")
GRID = {
    "lateral": ((1.632, 23.71, 36.13, 14.53), (1.808, 26.71, 36.13, 14.90), (1.634, 23.74, 36.13, 14.53)),
    "oblique": ((2.840, 37.05, 41.41, 21.66), (4.219, 58.46, 57.31, 27.92), (2.873, 37.53, 41.85, 21.77)),
}
"""Published deviations on the 21 x 21 grid, noise 0.1: of the bound, (17) and (25); of the direction,
degrees, and of w, mrad."""
SIX_NUMBERS = (0.337146, 0.206645, -0.483972, 0.097092, -0.197473, -0.725699)
ON_SPHERE = (0.222428, 0.472128, 0.275799)


def fixed_values() -> list[Row]:
    """What theory gives without chance, beside the published digits."""
    rows: list[Row] = []
    tell = lambda value, asked, got: rows.append({"value": value, "asked": asked, "got": float(f"{got:.6g}")})
    # Affine flow from that at the point and beside it on its tangent surface.
    at, surface, h = np.array([0.2, -0.1]), np.array([0.8, 0.3, -0.4]), 1e-5
    flow = lambda step: motion3d.predict_flow([at + step], U0, W0, [surface[0] + surface[1:] @ step])[0]
    slopes = [(flow(h * axis) - flow(-h * axis)) / (2 * h) for axis in np.eye(2)]
    for name, figure, got in zip(
        ("u", "v", "u_x", "v_x", "u_y", "v_y"),
        SIX_NUMBERS,
        np.concatenate([flow(0 * at), *slopes]),
        strict=True,
    ):
        tell(f"six numbers: {name}", figure, got)
    around = motion3d.predict_flow([[0.48, -0.6, 0.64]], U0, W0, [0.8], projection="sphere")[0]
    for axis, figure, got in zip("xyz", ON_SPHERE, around, strict=True):
        tell(f"flow on the sphere: {axis}", figure, got)
    side = np.linspace(-0.6, 0.6, 21)
    points = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    nu = scenes.depths("smooth", points / 0.6, np.random.default_rng(0))
    for name, figures in GRID.items():
        bound = motion3d.motion_bound(points, *scenes.motion(name), nu, noise_std=0.1)
        for what, covariance, published in zip(
            ("CRLB", "(17)", "(25)"),
            (bound.crlb, bound.ml_covariance, bound.ideal_covariance),
            figures,
            strict=True,
        ):
            got = [
                np.degrees(np.sqrt(np.trace(covariance[:2, :2]))),
                *(1e3 * np.sqrt(np.diag(covariance)[2:])),
            ]
            for part, figure, value in zip(
                ("direction, deg", "w_x, mrad", "w_y, mrad", "w_z, mrad"), published, got, strict=True
            ):
                tell(f"21 x 21 grid, {name}, {what}: {part}", figure, value)
    sideways = motion3d.lateral_bound(np.linspace(0.5, 1.5, 101), noise_std=0.3)
    tell("one unknown (29)", 8.8940e-4, sideways.ml_variance)
    tell("one unknown (31)", 8.9109e-4, sideways.ones_variance)
    tell("one unknown, CRLB", 8.2128e-4, sideways.crlb)
    tell("one unknown, crossover sigma", 0.30369, sideways.crossover)
    return rows


TABLES = {"fixed": report.Table("3-D motion: values without chance", lambda _: fixed_values())}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
