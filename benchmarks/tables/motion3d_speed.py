"""CPU time of 3-D motion beside OpenCV's essential matrices, on the same flow of two views."""

from __future__ import annotations

from benchmarks import report
from benchmarks.rivals import motion3d as rivals
from benchmarks.scenes import motion3d as scenes
from benchmarks.scores import timing
from jacoflow import motion3d

Row = dict[str, object]
SPEED_ASKED = {1000: (5, 5, 15), 100_000: (80, 300, 200)}
"""Points; specified milliseconds on two threads of ML, of what the weights add, of robust ML."""


def speed(rounds: int) -> list[Row]:
    """Milliseconds of CPU of the busiest thread, ours on one and two threads and OpenCV's, in turns on the
    same flow."""
    rows: list[Row] = []
    for n in SPEED_ASKED:
        make = scenes.two_views("smooth", "oblique", 0.3, 4, 1, n=n)
        settings = {
            "ML": {"method": "ml"},
            "efficient": {"method": "efficient"},
            "robust ML": {"method": "ml", "robust": True},
            "robust efficient": {"robust": True},
        }

        def ours(options: dict[str, object], threads: int, make: scenes.Scene = make) -> object:
            return motion3d.estimate_motion(
                make.points, make.flow, scenes.K, noise_std=0.3, threads=threads, **options
            )  # type: ignore[arg-type]

        def theirs(method: str, make: scenes.Scene = make) -> object:
            return rivals.two_view(make.points, make.flow, scenes.K, 0.3, method)

        contestants = {
            f"{name}, {t} threads": (lambda o=options, t=t: ours(o, t))
            for name, options in settings.items()
            for t in (1, 2)
        }
        if rivals.cv2 is not None:
            # USAC_ACCURATE ends the process with so many points.
            names = {
                name: method
                for name, method in rivals.METHODS.items()
                if n < 10_000 or method != "USAC_ACCURATE"
            }
            contestants |= {name: (lambda m=method: theirs(m)) for name, method in names.items()}
        best = timing.race(contestants, rounds if n < 10_000 else max(2, rounds // 4))
        for name, time in best.items():
            rows.append(
                {
                    "points": n,
                    "who": name,
                    "CPU ms": round(1e3 * time.busiest, 2),
                    "clock ms": round(1e3 * time.wall, 2),
                }
            )
        ml, weights, robust = (
            best[f"{name}, 2 threads"].busiest for name in ("ML", "efficient", "robust ML")
        )
        for what, got, asked in zip(
            ("ML", "the weights add", "robust ML"), (ml, weights - ml, robust), SPEED_ASKED[n], strict=True
        ):
            rows.append(
                {
                    "points": n,
                    "who": f"asked, 2 threads: {what}",
                    "CPU ms": round(1e3 * got, 2),
                    "asked ms": asked,
                }
            )
    return rows


TABLES = {"speed": report.Table("3-D motion: speed", lambda o: speed(report.rounds(o)))}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
