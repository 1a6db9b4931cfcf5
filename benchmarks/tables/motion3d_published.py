"""The published tables of 3-D motion, recomputed: each function gives the rows of one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.rivals import motion3d as rivals
from benchmarks.scenes import motion3d as scenes
from benchmarks.scores.motion3d import ELLIPSOID, angle, rms, squared
from jacoflow import motion3d

Array = NDArray[np.float64]
Row = dict[str, object]


def both(values: Sequence[float]) -> str:
    """Median / root mean square, as the tables have it."""
    return f"{np.nanmedian(values):.2f} / {np.sqrt(np.nanmean(np.square(values))):.2f}"


def error(truth: scenes.Scene, u: Array, w: Array, tangent: Array) -> Array:
    """(psi, w) of the truth as seen from an estimate, (5,), rad and rad/frame."""
    return np.concatenate([tangent @ truth.u, truth.w - w])


THEORY = (
    ("uniform", "lateral", 5000, 0.3, (1.26, 1.34, 1.05, 0.94, 1.13)),
    ("uniform", "oblique", 500, 0.1, (2.04, 2.07, 1.72, 0.98, 1.14)),
    ("uniform", "oblique", 5000, 0.3, (3.30, 3.13, 1.52, 1.12, 2.53)),
    ("two", "oblique", 5000, 0.3, (1.40, 1.35, 0.91, 1.07, 1.56)),
    ("uniform", "forward", 500, 0.03, (0.61, 0.60, 0.55, 1.04, 1.12)),
    ("sphere", "oblique", 500, 0.3, (1.86, 1.77, 1.51, 1.03, 1.19)),
)
"""Depths, motion, points, noise; published: rms of ML, (17), CRLB, Mahalanobis distances under both."""


def theory(trials: int) -> list[Row]:
    """ML at the minimum nearest to the truth: it follows its predicted covariance (17) and not the bound."""
    rows: list[Row] = []
    for depth, name, n, noise_std, asked in THEORY:
        errors, spreads, distances = [], [], []
        for seed in range(max(20, trials // 4) if n == 5000 else trials):
            make = (
                scenes.sphere(name, n, noise_std, seed)
                if depth == "sphere"
                else scenes.differential(depth, name, n, noise_std, seed)
            )
            found = motion3d.estimate_motion(
                make.points,
                make.flow,
                noise_std=noise_std,
                projection=make.projection,
                placement="start",
                method="ml",
                initial=(make.u, make.w),
            )
            bound = motion3d.motion_bound(
                make.points, make.u, make.w, make.depths, noise_std=noise_std, projection=make.projection
            )
            delta = np.concatenate([bound.tangent @ found.translation, found.rotation - make.w])
            errors.append(angle(found.translation, make.u))
            spreads.append(bound.direction_std[:2])
            distances.append([squared(delta, c) / 5 for c in (bound.ml_covariance, bound.crlb)])
        spread, distance = np.sqrt(np.mean(np.square(spreads), 0)), np.mean(distances, 0)
        got = (rms(errors), spread[1], spread[0], *distance)
        names = ("ML rms", "(17)", "CRLB", "m(17)", "m(CRLB)")
        row: Row = {"case": f"{depth} {name} n={n} sigma {noise_std}", "trials": len(errors)}
        for column, value, figure in zip(names, got, asked, strict=True):
            row[column], row[f"{column} asked"] = round(float(value), 2), figure
        rows.append(row)
    return rows


TRUE_WEIGHTS = (
    ("uniform", 0.1, (1.65, 1.65, 2.03)),
    ("uniform", 0.2, (3.07, 3.08, 4.79)),
    ("two", 0.3, (2.86, 2.95, 4.40)),
)
"""Depths, noise; published: rms with true depths in the weights, (25), ML; oblique motion, 500 points."""


def true_weights(trials: int) -> list[Row]:
    """Ideal weights are reached with the true depths (25)."""
    rows: list[Row] = []
    for depth, noise_std, asked in TRUE_WEIGHTS:
        errors, plain, spreads = [], [], []
        for seed in range(trials):
            make = scenes.differential(depth, "oblique", 500, noise_std, seed)
            found = motion3d.estimate_motion(
                make.points,
                make.flow,
                noise_std=noise_std,
                placement="start",
                initial=(make.u, make.w),
                method="efficient",
                weight_inv_depth=make.depths,
            )
            errors.append(angle(found.translation, make.u))
            plain.append(angle(found.ml.translation, make.u))
            spreads.append(
                motion3d.motion_bound(make.points, make.u, make.w, make.depths, noise_std=noise_std).direction_std[2]
            )
        got = (rms(errors), rms(spreads), rms(plain))
        row: Row = {"case": f"{depth} oblique n=500 sigma {noise_std}", "trials": trials}
        for column, value, figure in zip(("true depths rms", "(25)", "ML rms"), got, asked, strict=True):
            row[column], row[f"{column} asked"] = round(value, 2), figure
        rows.append(row)
    return rows


ONE_UNKNOWN = {"ML / (29)": "ml", "ones / (31)": "ones", "shrunk / its formula": "shrunk"}
"""Columns of the variances of section 5, and the weights they are of."""


def one_unknown(trials: int) -> list[Row]:
    """Section 5 of the paper, translation in the image plane: variances over (29), (31) and that of shrunk
    weights.

    And how often the 95 % interval holds, with the noise known and unknown.
    """
    rows: list[Row] = []
    rng = np.random.default_rng(5)
    for n, sigmas in ((1000, (0.1, 0.30369, 0.6, 1.0)), (50, (1.0,))):
        nu = np.linspace(0.5, 1.5, n)
        for noise_std in sigmas:
            bound = motion3d.lateral_bound(nu, noise_std=noise_std)
            errors: dict[str, list[float]] = {weights: [] for weights in ONE_UNKNOWN.values()}
            inside: list[bool] = []
            for _ in range(trials):
                flow = np.stack([nu, 0 * nu], -1) + noise_std * rng.normal(size=(n, 2))
                for weights in errors:
                    errors[weights].append(
                        motion3d.estimate_lateral(flow, noise_std=noise_std, weights=weights).angle
                    )  # type: ignore[arg-type]
                unknown = motion3d.estimate_lateral(flow)
                inside.append(unknown.angle**2 < 1.96**2 * unknown.variance)
            predicted = (bound.ml_variance, bound.ones_variance, bound.shrunk_variance)
            row: Row = {"n": n, "sigma": noise_std, "crossover": round(bound.crossover, 4), "trials": trials}
            for (name, weights), figure in zip(ONE_UNKNOWN.items(), predicted, strict=True):
                row[name] = round(float(np.mean(np.square(errors[weights])) / figure), 3)
            row["shrunk / best of both"] = round(
                rms(errors["shrunk"]) ** 2 / min(rms(errors["ml"]), rms(errors["ones"])) ** 2, 3
            )
            row["coverage, shrunk, unknown sigma"] = round(float(np.mean(inside)), 3)
            rows.append(row)
    return rows


PRACTICAL = (
    ("uniform", "oblique", 500, 0.2, 0.6, (5.76, 4.32, 4.34, 3.08, 3.28, 32.6, 21.6, 107, 83)),
    ("two", "oblique", 500, 0.3, 0.6, (4.54, 4.08, 4.07, 3.25, 2.84, 27.0, 13.9, 84, 81)),
    ("smooth", "lateral", 1000, 0.3, 0.6, (5.73, 4.01, 3.32, 3.12, 3.40, 88.7, 60.2, 125, 94)),
    ("smooth", "oblique", 500, 0.1, 0.6, (4.68, 3.45, 2.80, 2.77, 2.85, 36.9, 44.8, 98, 62)),
    ("smooth", "oblique", 5000, 0.2, 0.6, (5.95, 2.33, 2.10, 1.98, 1.83, 39.6, 43.8, 124, 45)),
    ("layers", "oblique", 500, 0.2, 0.6, (5.53, 4.66, 3.88, 3.32, 3.41, 33.3, 25.2, 83, 64)),
    ("layers", "forward", 500, 0.15, 0.6, (3.10, 3.47, 2.10, 1.90, 1.94, 4.6, 14.4, 49, 36)),
    ("ground", "oblique", 1000, 0.1, 0.6, (3.42, 3.29, 1.71, 1.68, 1.79, 35.0, 26.1, 32, 24)),
    ("ground", "off", 1000, 0.15, 0.6, (4.10, 3.14, 1.99, 1.91, 1.95, 19.8, 43.2, 58, 32)),
    ("smooth", "oblique", 2000, 0.02, 0.2, (1.20, 1.20, 1.14, 1.13, 1.25, 34.5, 2.1, 30, 29)),
    ("uniform", "oblique", 500, 0.03, 0.6, (0.46, 0.46, 0.46, 0.45, 0.49, 2.0, 0.52, 10, 10)),
)
"""Scene, motion, points, noise, half width; published: ML, normal prior, efficient, true depths, CRLB,
linear, unbiased; rotation, mrad, of ML and efficient."""
PRACTICAL_COLUMNS = (
    "ML",
    "prior",
    "efficient",
    "true depths",
    "CRLB",
    "linear",
    "unbiased",
    "rot ML",
    "rot eff.",
)


def holds(truth: scenes.Scene, found: motion3d.MotionEstimate, covariance: Array) -> bool:
    """Whether a 95 % ellipsoid around an estimate holds the truth."""
    return squared(error(truth, found.translation, found.rotation, found.tangent), covariance) < ELLIPSOID


def gauss_newton(found: motion3d.MotionEstimate) -> Array | None:
    """The usual covariance `H^-1` of maximum likelihood, from (17), `M^-1 H M^-1`, and the bound `M^-1` at
    its minimum; None where these are not known."""
    if found.ml.covariance is None or not (
        np.isfinite(found.crlb).all() and np.isfinite(found.ml.covariance).all()
    ):
        return None
    return found.crlb @ np.linalg.solve(found.ml.covariance, found.crlb)


def practical(trials: int) -> list[Row]:
    """The search everywhere: rms errors of the direction in degrees, of the rotation in mrad, and how
    often the 95 % ellipsoid holds the truth."""
    rows: list[Row] = []
    for depth, name, n, noise_std, h, asked in PRACTICAL:
        columns: dict[str, list[float]] = {column: [] for column in PRACTICAL_COLUMNS}
        inside, plain, newton, count = [], [], [], max(20, trials // 3) if n == 5000 else trials
        for seed in range(count):
            make = scenes.differential(depth, name, n, noise_std, seed, h)
            run = lambda make=make, noise_std=noise_std, **options: motion3d.estimate_motion(
                make.points, make.flow, noise_std=noise_std, placement="start", **options
            )
            found, ideal = (
                run(method="efficient"),
                run(initial=(make.u, make.w), method="efficient", weight_inv_depth=make.depths),
            )
            columns["ML"].append(angle(found.ml.translation, make.u))
            columns["prior"].append(angle(run(method="efficient", smoother="prior").translation, make.u))
            columns["efficient"].append(angle(found.translation, make.u))
            columns["true depths"].append(angle(ideal.translation, make.u))
            columns["CRLB"].append(
                float(
                    motion3d.motion_bound(
                        make.points, make.u, make.w, make.depths, noise_std=noise_std
                    ).direction_std[0]
                )
            )
            columns["linear"].append(angle(rivals.linear(make.points, make.flow), make.u))
            columns["unbiased"].append(angle(rivals.unbiased(make.points, make.flow), make.u))
            columns["rot ML"].append(1e3 * float(np.linalg.norm(found.ml.rotation - make.w)))
            columns["rot eff."].append(1e3 * float(np.linalg.norm(found.rotation - make.w)))
            inside.append(holds(make, found, found.covariance))
            likelihood = run(method="ml")
            plain.append(holds(make, likelihood, likelihood.covariance))
            if (usual := gauss_newton(likelihood)) is not None:
                newton.append(holds(make, likelihood, usual))
        row: Row = {
            "case": f"{depth} {name} n={n} sigma {noise_std}" + (f" h={h}" if h != 0.6 else ""),
            "trials": count,
        }
        for (column, values), figure in zip(columns.items(), asked, strict=True):
            row[column], row[f"{column} asked"] = round(rms(values), 2), figure
        row["ML / efficient"] = round(rms(columns["ML"]) / rms(columns["efficient"]), 2)
        for name, values in (
            ("coverage", inside),
            ("coverage, ML", plain),
            ("coverage, Gauss-Newton", newton),
        ):
            row[name] = round(float(np.mean(values)), 2)
        rows.append(row)
    return rows


PIXELS: tuple[tuple[str, str, float, float, dict[str, float], tuple[str, ...]], ...] = (
    (
        "uniform",
        "oblique",
        0.3,
        4,
        {},
        ("0.61 / 0.78", "0.63 / 0.77", "8.6 / 9.2", "0.63 / 0.79", "0.76 / 0.84"),
    ),
    ("uniform", "oblique", 0.5, 2, {}, ("2.6 / 3.5", "2.2 / 2.7", "22 / 26", "3.2 / 6.4", "5.4 / 7.5")),
    ("smooth", "lateral", 0.5, 2, {}, ("3.3 / 5.8", "2.8 / 3.7", "76 / 78", "17 / 59", "12 / 61")),
    ("smooth", "oblique", 0.3, 4, {}, ("1.63 / 1.74", "0.99 / 1.24", "25 / 23", "2.1 / 5.6", "2.0 / 14")),
    ("smooth", "forward", 0.5, 2, {}, ("5.6 / 6.2", "3.1 / 3.6", "17 / 26", "11 / 15", "11 / 16")),
    ("ground", "oblique", 0.5, 2, {}, ("1.7 / 2.7", "1.0 / 1.3", "19 / 29", "1.9 / 5.6", "1.8 / 4.4")),
    (
        "ground",
        "forward",
        0.3,
        4,
        {},
        ("0.16 / 0.16", "0.14 / 0.16", "2.0 / 2.2", "0.14 / 0.16", "0.14 / 0.17"),
    ),
    (
        "uniform",
        "oblique",
        0.3,
        4,
        {"outliers": 0.4},
        ("0.73 / 0.93", "0.70 / 0.91", "6.4 / 7.1", "7.5 / 7.5", "5.0 / 6.2"),
    ),
    (
        "uniform",
        "oblique",
        0.3,
        4,
        {"outliers": 0.6},
        ("1.2 / 1.7", "1.1 / 1.7", "6.4 / 7.1", "4.5 / 6.8", "4.5 / 7.5"),
    ),
    (
        "smooth",
        "oblique",
        0.3,
        6,
        {"mover": 0.2},
        ("1.2 / 1.4", "0.94 / 1.3", "13 / 18", "23 / 23", "1.7 / 13"),
    ),
    (
        "smooth",
        "forward",
        0.3,
        6,
        {"mover": 0.35},
        ("0.83 / 1.1", "0.77 / 0.95", "6.3 / 7.0", "9.2 / 9.2", "3.3 / 4.4"),
    ),
)
"""Scene, motion, noise and median flow, px, disturbance; published median / rms of ML, efficient and
OpenCV's."""


BLOCK = 24
"""Trials that the published figures of two views are of."""


def blocks(errors: Sequence[float]) -> str:
    """The least and largest median / rms of so many trials in a row as the published figures are of."""
    rows = np.reshape(errors[: len(errors) // BLOCK * BLOCK], (-1, BLOCK))
    if not len(rows):
        return ""
    medians, roots = np.median(rows, 1), np.sqrt(np.mean(rows**2, 1))
    return f"{medians.min():.2f} to {medians.max():.2f} / {roots.min():.2f} to {roots.max():.2f}"


def pixels(trials: int) -> list[Row]:
    """Exact two-view motion in pixels, beside OpenCV on the same flow: median / rms error of the direction in
    degrees, median of the rotation in mrad.

    Beside ours: what true depths in the weights give on the same flow, the bound, what (17) predicts of ML,
    and the least and largest median and rms of 24 trials in a row. The published figures are of so many: that
    of the ground seen obliquely lies below the bound, and that of ML over the smooth scene seen sideways
    below (17).
    """
    rows: list[Row] = []
    for depth, name, noise_std, median, disturbed, asked in PIXELS:
        columns: dict[str, list[float]] = {column: [] for column in ("ML", "efficient", *rivals.METHODS)}
        turns: dict[str, list[float]] = {column: [] for column in ("efficient", *rivals.METHODS)}
        labels, ideal, predicted = [], [], []
        inside: dict[str, list[bool]] = {"sigma": [], "unknown sigma": []}
        robust = bool(disturbed)
        for seed in range(trials):
            make = scenes.two_views(depth, name, noise_std, median, seed, **disturbed)  # type: ignore[arg-type]
            found = motion3d.estimate_motion(
                make.points, make.flow, scenes.K, noise_std=noise_std, robust=robust, method="efficient"
            )
            columns["ML"].append(angle(found.ml.translation, make.u))
            columns["efficient"].append(angle(found.translation, make.u))
            turns["efficient"].append(1e3 * float(np.linalg.norm(found.rotation - make.w)))
            labels.append(float(np.mean(found.inliers == make.inliers)))
            unknown = motion3d.estimate_motion(
                make.points, make.flow, scenes.K, robust=robust, method="efficient"
            )
            for kind, told in zip(inside, (found, unknown), strict=True):
                if told.status == "ok":
                    inside[kind].append(holds(make, told, told.covariance))
            if not disturbed:
                near = {"initial": (make.u, make.w), "weight_inv_depth": make.depths}
                ideal.append(
                    angle(
                        motion3d.estimate_motion(
                            make.points, make.flow, scenes.K, noise_std=noise_std, method="efficient", **near
                        ).translation,
                        make.u,
                    )
                )  # type: ignore[arg-type]
                predicted.append(
                    motion3d.motion_bound(
                        make.points, make.u, make.w, make.depths, scenes.K, noise_std=noise_std
                    ).direction_std[:2]
                )
            turn, mean = scenes.exponential(make.w)
            for column, method in rivals.METHODS.items():
                if rivals.cv2 is None:
                    continue
                direction, rotation = rivals.two_view(make.points, make.flow, scenes.K, noise_std, method)
                columns[column].append(angle(direction, mean @ make.u))
                turns[column].append(
                    1e3 * float(np.arccos(np.clip((np.trace(rotation.T @ turn) - 1) / 2, -1, 1)))
                )
        words = "".join(f", {value:.0%} {what}" for what, value in disturbed.items())
        row: Row = {"case": f"{depth} {name} {noise_std} px, {median} px{words}", "trials": trials}
        for (column, values), figure in zip(columns.items(), asked, strict=True):
            row[column], row[f"{column} asked"] = both(values) if values else "", figure
        row["true depths"] = both(ideal) if ideal else ""
        row["bound"], row["(17)"] = (
            np.round(np.sqrt(np.mean(np.square(predicted), 0)), 2).tolist() if predicted else ("", "")
        )
        for column in ("ML", "efficient"):
            row[f"{BLOCK} trials, {column}"] = blocks(columns[column])
        row["rot mrad eff."] = round(float(np.median(turns["efficient"])), 2)
        row["rot mrad MAGSAC"] = (
            round(float(np.nanmedian(turns["USAC_MAGSAC"])), 2) if turns["USAC_MAGSAC"] else ""
        )
        row["right labels %"] = round(100 * float(np.mean(labels)), 1) if disturbed else ""
        for kind, values in inside.items():
            row[f"coverage, {kind}"] = round(float(np.mean(values)), 2) if values else ""
            row[f"ok, {kind}"] = len(values)
        rows.append(row)
    return rows


TABLES = {
    name: report.Table(f"3-D motion: {title}", lambda o, rows=rows, own=own: rows(report.trials(o, own)))
    for name, (title, rows, own) in {
        "theory": ("ML follows (17), not the bound", theory, 200),
        "weights": ("True depths in the weights reach (25)", true_weights, 120),
        "one": ("One unknown: variances over their formulas", one_unknown, 3000),
        "practical": ("Scenes, searched everywhere", practical, 200),
        "pixels": ("Two views in pixels beside OpenCV", pixels, 240),
    }.items()
}


if __name__ == "__main__":
    report.main(__doc__, TABLES)
