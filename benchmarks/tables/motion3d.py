"""Every published table of 3-D motion beside our figures and OpenCV's on the same flow, and recordings from files to numbers.

    python -m benchmarks.tables.motion3d [--only fixed theory weights one practical pixels six claims honesty coverage layouts fields speed recordings] [--trials 1.0] [--data FOLDER]

`--trials` multiplies the number of trials of each table. Figures that are asked of us are typed from the specification; all others are computed here.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.report import table_lines
from benchmarks.rivals import motion3d as rivals
from benchmarks.scenes import motion3d as scenes
from benchmarks.scores import timing
from benchmarks.tables import motion3d_claims as further
from benchmarks.tables import motion3d_coverage as coverage
from benchmarks.tables import motion3d_drive as driving
from benchmarks.tables import motion3d_fields as fields
from benchmarks.tables import motion3d_fixed as fixed
from benchmarks.tables import motion3d_honesty as honesty
from benchmarks.tables import motion3d_layouts as layouts
from benchmarks.tables import motion3d_published as scores
from benchmarks.tables import motion3d_recordings as recordings
from benchmarks.tables import motion3d_six as six
from jacoflow import motion3d

Row = dict[str, object]
SPEED_ASKED = {1000: (5, 5, 15), 100_000: (80, 300, 200)}
"""Points; milliseconds on two threads asked for ML, what the weights add, robust ML."""


TABLES = scores.TABLES | {"six": ("Six numbers a patch against flow", six.six_numbers, 240)}
"""Tables of random scenes by name: title, what makes it, trials."""
NAMES = ["fixed", *TABLES, "claims", "honesty", "coverage", "layouts", "fields", "speed", "recordings"]
"""Sections of the tables."""


def speed(rounds: int) -> list[Row]:
    """Milliseconds of CPU of the busiest thread, ours on one and two threads and OpenCV's, in turns on the same flow."""
    rows: list[Row] = []
    for n in SPEED_ASKED:
        make = scenes.two_views("smooth", "oblique", 0.3, 4, 1, n=n)
        settings = {"ML": {"method": "ml"}, "efficient": {"method": "efficient"}, "robust ML": {"method": "ml", "robust": True}, "robust efficient": {"robust": True}}

        def ours(options: dict[str, object], threads: int, make: scenes.Scene = make) -> object:
            return motion3d.estimate_motion(make.points, make.flow, scenes.K, sigma=0.3, threads=threads, **options)  # type: ignore[arg-type]

        def theirs(method: str, make: scenes.Scene = make) -> object:
            return rivals.two_view(make.points, make.flow, scenes.K, 0.3, method)

        contestants = {f"{name}, {t} threads": (lambda o=options, t=t: ours(o, t)) for name, options in settings.items() for t in (1, 2)}
        if rivals.cv2 is not None:
            # USAC_ACCURATE ends the process with so many points.
            names = {name: method for name, method in rivals.METHODS.items() if n < 10_000 or method != "USAC_ACCURATE"}
            contestants |= {name: (lambda m=method: theirs(m)) for name, method in names.items()}
        best = timing.race(contestants, rounds if n < 10_000 else max(2, rounds // 4))
        for name, time in best.items():
            rows.append({"points": n, "who": name, "CPU ms": round(1e3 * time.busiest, 2), "clock ms": round(1e3 * time.wall, 2)})
        ml, weights, robust = (best[f"{name}, 2 threads"].busiest for name in ("ML", "efficient", "robust ML"))
        for what, got, asked in zip(("ML", "the weights add", "robust ML"), (ml, weights - ml, robust), SPEED_ASKED[n], strict=True):
            rows.append({"points": n, "who": f"asked, 2 threads: {what}", "CPU ms": round(1e3 * got, 2), "asked ms": asked})
    return rows


def sections(only: list[str] | None = None, factor: float = 1.0, data: Path | None = None, rounds: int = 12) -> dict[str, list[Row]]:
    """Tables by title."""
    out: dict[str, list[Row]] = {}
    wanted = lambda name: only is None or name in only
    if wanted("fixed"):
        out["3-D motion: values without chance"] = fixed.fixed_values()
    for name, (title, table, trials) in TABLES.items():
        if wanted(name):
            out[f"3-D motion: {title}"] = table(max(4, round(factor * trials)))
    if wanted("claims"):
        out["3-D motion: displacements over a whole frame, without noise"] = further.displacements(max(4, round(factor * further.LAYOUTS)))
        out["3-D motion: single figures"] = further.claims(max(4, round(factor * further.TRIALS)))
    if wanted("honesty"):
        out["3-D motion: what is said of scenes by chance"] = honesty.table(max(12, round(factor * honesty.TRIALS)))
    if wanted("coverage"):
        out["3-D motion: where covariances are hardest to state"] = coverage.table(max(12, round(factor * coverage.TRIALS)))
    if wanted("layouts"):
        out["3-D motion: where the points lie, what shape their noise has, planes and long displacements"] = layouts.table(max(12, round(factor * layouts.TRIALS)))
    if wanted("fields"):
        out["3-D motion: flow fields of rendered rooms"] = fields.table(max(4, round(factor * fields.TRIALS)))
    if wanted("speed"):
        out["3-D motion: speed"] = speed(rounds)
    if data is not None and wanted("recordings"):
        if (data / "kitti_odometry").is_dir():
            out["3-D motion: a drive with true poses, medians"] = recordings.drive(data)
            out["3-D motion: rotations of the drive and of its reference, pair by pair"] = driving.poses(data)
            out["3-D motion: errors that go together on the drive"] = driving.together(data)
            out["3-D motion: do halves of the picture differ by what their covariances say?"] = recordings.spacings(data)
        if (data / "ttc_kitti_lidar").is_dir():
            out["3-D motion: time to contact of the car ahead"] = recordings.car(data)
    return out


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=NAMES)
    parser.add_argument("--trials", type=float, default=1.0)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--rounds", type=int, default=12)
    arguments = parser.parse_args()
    for name in arguments.only or NAMES:
        for title, rows in sections([name], arguments.trials, arguments.data, arguments.rounds).items():
            print(f"\n## {title}\n")
            print("\n".join(table_lines(rows)), flush=True)


if __name__ == "__main__":
    main()
