"""Disparity of edge pixels: ours beside OpenCV's semi-global matching and block matching.

    python -m benchmarks.tables.stereo [--quick]

Synthetic scenes with exact truth, some steps of each. All methods are judged at the same edge pixels of the
left view, each at its own resolution. OpenCV matches whole rows: on these scenes, whose cameras are not
aligned, it is shown as it is and with the right view moved by the true row offset.
"""

from __future__ import annotations

from benchmarks import report
from benchmarks.rivals.stereo import Matcher, edge_pixels, matchers
from benchmarks.scenes import stereo as stereo_scenes
from benchmarks.scenes.stereo_pairs import STEPS, Pair, scene_pairs
from benchmarks.scores.stereo import Counts, count, figures
from benchmarks.scores.timing import race

Row = dict[str, object]
ASKED = {
    "paper": {
        "crossing": (0.958, 0.150, 0.035, 0.055),
        "curved": (0.965, 0.225, 0.031, 0.034),
        "cart": (0.970, 0.099, 0.033, 0.049),
        "small": (0.969, 0.089, 0.025, 0.050),
    },
    "paper, support 0.6": {
        "crossing": (0.861, 0.122, 0.011, 0.017),
        "curved": (0.889, 0.206, 0.013, 0.012),
        "cart": (0.897, 0.075, 0.015, 0.024),
        "small": (0.879, 0.069, 0.007, 0.019),
    },
    "sgm": {
        "crossing": (0.940, 0.097, 0.003, 0.014),
        "curved": (0.956, 0.098, 0.002, 0.012),
        "cart": (0.957, 0.087, 0.004, 0.018),
        "small": (0.951, 0.083, 0.003, 0.015),
    },
}
"""Figures of the specification: density, MAE, outliers, occluded."""


def judge(pairs: list[Pair], chosen: list[Matcher], rounds: int) -> list[tuple[Matcher, Row]]:
    """Figures and time of every method over the pairs."""
    edges = [edge_pixels(pair.left) for pair in pairs]
    times = race({each.name: (lambda each=each: each.match(pairs[0])) for each in chosen}, rounds)
    rows: list[tuple[Matcher, Row]] = []
    for each in chosen:
        counts: list[Counts] = [
            count(each.match(pair), edge, pair.truth, pair.visible)
            for pair, edge in zip(pairs, edges, strict=True)
        ]
        spent = times[each.name]
        rows.append(
            (
                each,
                {
                    "method": each.name,
                    **figures(counts),
                    "ms, wall": 1e3 * spent.wall,
                    "ms, busiest thread": 1e3 * spent.busiest,
                },
            )
        )
    return rows


def drawn(names: list[str], rounds: int) -> list[Row]:
    """One row for each scene and method, and the specified figures of ours."""
    rows: list[Row] = []
    for name in names:
        for each, row in judge(scene_pairs(stereo_scenes.SCENES[name]()), matchers(), rounds):
            rows.append({"scene": name, **row})
            if each.asked is not None:
                figures_asked = dict(
                    zip(("density", "MAE", "outliers", "occluded"), ASKED[each.asked][name], strict=True)
                )
                rows.append({"scene": name, "method": f"{each.name}: asked", **figures_asked})
    return rows


TABLES = {
    "synthetic": report.Table(
        "Disparity of edge pixels, scenes with exact truth",
        lambda o: drawn(["crossing", "small"] if o.quick else list(STEPS), report.rounds(o)),
    )
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
