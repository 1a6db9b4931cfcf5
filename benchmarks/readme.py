"""Writes the tables of README.md and docs/limits.md out of the newest dated file of results.

    python -m benchmarks.readme [--check]

A table stands between `<!-- table: NAME -->` and `<!-- end -->`; NAME is a key of `TABLES` here. `--check`
changes nothing and fails where they are not what this command would write. `make readme` runs it.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from benchmarks.report import Record, Rows, lines, newest

ROOT = Path(__file__).parents[1]
DOCUMENTS = (ROOT / "README.md", ROOT / "docs" / "limits.md")
BLOCK = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
RECORDINGS = {
    "RubberWhale": "RubberWhale",
    "Dimetrodon": "Dimetrodon",
    "Yosemite without sky": "Yosemite, no sky",
    "Sintel alley_1 clean": "Sintel alley_1",
    "PIV DNS_turbulence_00001": "PIV, turbulence",
    "PIV backstep_Re800_00001": "PIV, backward step",
}
BOUNDARIES = {"Urban2": "Urban2", "Venus": "Venus", "Sintel cave_2 final": "Sintel cave_2"}
FLOWS = {
    "OpenCV DIS medium": "OpenCV DIS medium",
    "OpenCV Farneback": "OpenCV Farneback",
    "coarse to fine, fast": "`fast`",
    "coarse to fine, balanced": "`balanced`",
    "coarse to fine, balanced, pair": "`balanced`, pair",
    "coarse to fine, accurate": "`accurate`",
}
TRACKERS = {
    "jacoflow layered": "`GradientTracker`",
    "OpenCV CSRT": "CSRT",
    "OpenCV CSRT 3x": "CSRT, frames enlarged 3x",
    "OpenCV KCF": "KCF",
    "OpenCV MedianFlow": "MedianFlow",
    "OpenCV MIL": "MIL",
    "OpenCV MOSSE": "MOSSE",
}
PARTICLE_TRACKERS = {
    "improved mode": "`ParticleTracker`",
    "OpenCV CSRT": "CSRT",
    "OpenCV KCF": "KCF",
    "OpenCV MIL": "MIL",
}
STEREO_SCENES = {"crossing": 3, "curved": 1, "cart": 1, "small": 2}
"""Scenes and the label of their nearest moving object."""
MATCHERS = {
    "sgm, row offset estimated": "`edge_disparity`, rows estimated",
    "OpenCV SGBM": "OpenCV SGBM",
    "OpenCV SGBM, rows aligned": "OpenCV SGBM, rows aligned for it",
}
RECORDED_MATCHERS = {
    "sgm, rows given": "`edge_disparity`",
    "OpenCV SGBM": "OpenCV SGBM",
    "OpenCV BM 15": "OpenCV BM",
}
LIMITS = "Limits of a step"
RATES = "Rates of large steps"
UNRELATED = "Unrelated frames"
WAVES = "Turning waves"
COARSE = "Shifts of coarse texture"
CODED = "Shifts through coders of video"
TWO_MOTIONS = "Two motions in a region"
NOISE = "Noise of a pair"
METHODS = "Turning by method"
DISCS = "Turning discs"
HARD = "Tracking, 28 hard scenes, share of frames found / median error of the centre in px"
SCENES = "Particle tracker, ten scenes"
CHANCE = "3-D motion: what is said of scenes by chance"
VIEWS = "3-D motion: Two views in pixels beside OpenCV"
FILTER = "Flow filter, microseconds per pixel and frame, 640 x 480"


def where(rows: Rows, **wanted: object) -> dict[str, object]:
    """The first row with these values; empty if there is none."""
    return next((row for row in rows if all(row.get(key) == value for key, value in wanted.items())), {})


def number(value: object, digits: int = 3) -> str:
    """A rounded number; empty where there is none."""
    return f"{value:.{digits}f}" if isinstance(value, int | float) else ""


def flow(record: Record) -> list[str]:
    """Errors on recordings, and times of a pair on one thread."""
    body = []
    for sample, name in RECORDINGS.items():
        rows = [
            where(record.sections["Accuracy on recordings"], sample=sample, method=method) for method in FLOWS
        ]
        body.append([name, *(_both(row, "end_point_error", 3, "jacobian_error", 4) for row in rows)])
    for size in ("640 x 480", "1920 x 1080"):
        times = record.sections[f"Flow per second, {size}"]
        # All are timed on a pair; with three frames only `balanced` is.
        pairs = [
            method if method.startswith("OpenCV") else method.removesuffix(", pair") + ", pair"
            for method in FLOWS
        ]
        pairs[list(FLOWS).index("coarse to fine, balanced")] = "coarse to fine, balanced"
        found = [where(times, method=method, threads=1).get("milliseconds") for method in pairs]
        body.append([f"ms, {size}, one thread", *(number(each, 0) for each in found)])
    return lines(["", *FLOWS.values()], body)


def intervals(record: Record) -> list[str]:
    """Shares of 95 % intervals that hold on recordings, and normalised squared errors."""
    rows = record.sections["Intervals on recordings"]
    names = ("u", "v", "jacobian", "nees", "all")
    body = []
    for sample, name in (RECORDINGS | BOUNDARIES).items():
        found = where(rows, sample=sample, preset="balanced", frames=2)
        body.append([name, *(number(found.get(each), 2) for each in names)])
    return lines(["", "u", "v", "Jacobian", "squared error / variance", "flow, all pixels"], body)


def limits(record: Record) -> list[str]:
    """Errors of ours and others by the size of the step."""
    names = {"pair, px": "pair", "pair, valid": "valid", "pair, silent": "silent", "triple, px": "triple"}
    names |= {"triple, valid": "valid", "triple, silent": "silent"}
    names |= {rival: rival for rival in ("OpenCV DIS medium", "OpenCV Farneback")}
    body = [[str(row["step"]), *(number(row.get(name), 3) for name in names)] for row in record.sections[LIMITS]]
    return lines(["median error, px", *names.values()], body)


def large_rates(record: Record) -> list[str]:
    """Errors of measured rates and what is stated, by the step."""
    names = ("pair, error", "pair, std", "triple, error", "triple, std")
    body = [[str(row["step"]), *(number(row.get(name), 4) for name in names)] for row in record.sections[RATES]]
    return lines(["step", *names], body)


def unrelated(record: Record) -> list[str]:
    """Shares of valid sites between frames with little or nothing in common."""
    body = [[str(row["frames"]), *(number(row.get(name), 3) for name in ("pair", "triple"))] for row in record.sections[UNRELATED]]
    return lines(["valid", "pair", "triple"], body)


def turning_waves(record: Record) -> list[str]:
    """Shares of valid and of silent sites of a texture without fine detail, by the turn."""
    return held(record.sections[WAVES], "turn, degrees")


def coarse_shifts(record: Record) -> list[str]:
    """The same of texture with coarse parts, by the shift."""
    return held(record.sections[COARSE], "shift, px")


def coded(record: Record) -> list[str]:
    """Errors of shifts through the coders of video."""
    names = ("ok", "error, px", "std, px", "error of the mean, px")
    body = [[str(row["coder"]), *(number(row.get(name), 3) for name in names)] for row in record.sections[CODED]]
    return lines(["coder", *names], body)


def held(rows: Rows, motion: str) -> list[str]:
    """Shares of valid and of silent sites, by the motion."""
    names = ("pair, valid", "pair, silent", "triple, valid", "triple, silent")
    body = [[number(row[motion], 0), *(number(row.get(name), 3) for name in names)] for row in rows]
    return lines([motion, *names], body)


def two_motions(record: Record) -> list[str]:
    """What `measure` says of a region of two motions, by their difference."""
    names = {"no dominant motion": "no dominant motion", "u, px": "u off by, px", "std of u": "std"}
    names |= {"u_x": "u_x off by", "std of u_x": "std"}
    body = [[number(row["difference, px"], 1), *(number(row.get(name), 4) for name in names)] for row in record.sections[TWO_MOTIONS]]
    return lines(["difference, px", *names.values()], body)


def turning_discs(record: Record) -> list[str]:
    """What `measure` says of small objects that turn before a wall."""
    digits = {"radius, px": 0, "turn, rad": 2, "ok": 2, "value": 3, "std": 3}
    body = [[number(row.get(name), places) for name, places in digits.items()] for row in record.sections[DISCS]]
    return lines(list(digits), body)


def noise(record: Record) -> list[str]:
    """Errors and stated errors of the means of a pair, by the noise."""
    names = ("error of u", "std of u", "error of divergence", "std of divergence")
    body = [[number(row["noise, grey levels"], 0), *(number(row.get(name), 3) for name in names)] for row in record.sections[NOISE]]
    return lines(["noise, grey levels", *names], body)


def other_methods(record: Record) -> list[str]:
    """What `measure` says of turning texture, by the method of the field."""
    names = ("value", "scatter", "std")
    rows = record.sections[METHODS]
    body = [[str(row["method"]), str(row["measured"]), *(number(row.get(name), 3) for name in names)] for row in rows]
    return lines(["method", "measured", "over the truth", "scatter", "std"], body)


def _both(row: dict[str, object], first: str, digits: int, second: str, more: int) -> str:
    """Two figures of a row."""
    return f"{number(row.get(first), digits)} / {number(row.get(second), more)}" if row else ""


def tracking(record: Record) -> list[str]:
    """Shares of frames found, times and overlaps on recordings."""
    body = []
    for title, name in (
        (HARD, "28 hard scenes"),
        ("Tracking, Simulations 1 to 3", "24 simulations of the paper's kind"),
    ):
        means = where(record.sections[title], scene="mean success")
        body.append([name, *(number(means.get(tracker)) for tracker in TRACKERS)])
    twins = where(record.sections["Tracking, scenes in which others win"], scene="crossings kept, of 14")
    body.append(["crossings with a twin kept, of 14", *(str(twins.get(tracker, "")) for tracker in TRACKERS)])
    times = where(record.sections[HARD], scene="ms/frame, one thread")
    body.append(["ms a frame, 256 x 256", *(number(times.get(tracker), 2) for tracker in TRACKERS)])
    recorded = record.sections["Tracking, recordings"]
    for name in dict.fromkeys(str(row["recording"]) for row in recorded if "tracker" in row):
        found = (where(recorded, recording=name, tracker=tracker).get("mean_overlap") for tracker in TRACKERS)
        body.append([f"{name}: mean overlap", *(number(each, 2) for each in found)])
    return lines(["", *TRACKERS.values()], body)


def particles(record: Record) -> list[str]:
    """Success on the scenes, MOTA and IDF1, overlaps on recordings."""
    body = []
    rows = record.sections[SCENES]
    found = [where(rows, tracker=tracker) for tracker in PARTICLE_TRACKERS]
    cells = (_both(row, "mean success, %", 0, "mean overlap", 2) for row in found)
    body.append(["ten scenes: targets kept, % / mean overlap", *cells])
    campus = record.sections["Particle tracker, TUD-Campus"]
    means = [[_mean(campus, tracker, name) for name in ("MOTA", "IDF1")] for tracker in PARTICLE_TRACKERS]
    body.append(
        ["TUD-Campus (eight people): MOTA / IDF1", *(f"{number(a, 2)} / {number(b, 2)}" for a, b in means)]
    )
    recorded = record.sections["Particle tracker, other recordings"]
    for name in dict.fromkeys(str(row["recording"]) for row in recorded):
        own = [row for row in recorded if row["recording"] == name]
        cells = (_overlaps(own, tracker) for tracker in PARTICLE_TRACKERS)
        body.append([f"{name}: mean overlap", *cells])
    return lines(["", *PARTICLE_TRACKERS.values()], body)


def _mean(rows: Rows, tracker: str, name: str) -> float | None:
    """Mean over the seeds."""
    values = [float(str(row[name])) for row in rows if row["tracker"] == tracker]
    return sum(values) / len(values) if values else None


def _overlaps(rows: Rows, tracker: str) -> str:
    """Overlap of each target, mean over the seeds."""
    seeds = [str(row["mean overlap of each target"]).split() for row in rows if row["tracker"] == tracker]
    return ", ".join(f"{sum(map(float, each)) / len(each):.2f}" for each in zip(*seeds, strict=True))


def stereo(record: Record) -> list[str]:
    """Outliers and accepted pixels without a match, on the synthetic scenes."""
    rows = record.sections["Disparity of edge pixels, scenes with exact truth"]
    body = [
        [
            name,
            *(
                _both(where(rows, scene=scene, method=method), "outliers", 3, "occluded", 3)
                for scene in STEREO_SCENES
            ),
        ]
        for method, name in MATCHERS.items()
    ]
    recorded = record.sections["Disparity of edge pixels, recordings"]
    names = list(dict.fromkeys(str(row["recording"]) for row in recorded if "method" in row))
    more = [
        [
            name,
            *(
                _both(where(recorded, recording=each, method=method), "outliers", 3, "density", 2)
                for each in names
            ),
        ]
        for method, name in RECORDED_MATCHERS.items()
    ]
    return [
        *lines(["outliers / occluded", *STEREO_SCENES], body),
        "",
        *lines(["outliers / density", *(name.split(",")[0] for name in names)], more),
    ]


def stereo_tracking(record: Record) -> list[str]:
    """Purity, errors of the nearest object's motion and time of a step."""
    body: list[list[str]] = [[], [], []]
    for scene, label in STEREO_SCENES.items():
        rows = record.sections[f"Stereo tracking, {scene}"]
        row = where(rows, mode="improved")
        body[0].append(number(row["purity"]))
        body[1].append(str(row[f"speed {label}"]).split(" (")[0])
        paper = where(rows, mode="paper")
        body[2].append(f"{number(row['ms a step'], 0)} ({number(paper.get('ms a step'), 0)})")
    names = (
        "purity of the clusters",
        "median error of the nearest object's motion: u, v (px), w (disparity) a step",
        "ms a step, two threads (mode of the paper)",
    )
    return lines(["", *STEREO_SCENES], ([name, *cells] for name, cells in zip(names, body, strict=True)))


def motion(record: Record) -> list[str]:
    """Status `ok` on random scenes; direction errors on two views beside OpenCV."""
    total = where(record.sections[CHANCE], scenes="all")
    share = float(str(total["ok"])) / float(str(total["trials"]))
    first = lines(
        ["random scenes", "status `ok`", "of these wrong", "95 % ellipses that hold the truth"],
        [[str(total["trials"]), f"{100 * share:.1f} %", str(total["wrong"]), number(total["holds"])]],
    )
    methods = {
        "efficient": "`estimate_motion`",
        "USAC_MAGSAC": "OpenCV MAGSAC",
        "5-point RANSAC": "OpenCV RANSAC",
    }
    body = [[str(row["case"]), *(str(row[method]) for method in methods)] for row in record.sections[VIEWS]]
    return [*first, "", *lines(["median / rms error of the direction, degrees", *methods.values()], body)]


def parts(record: Record) -> list[str]:
    """Speed of the filter and of the mixture beside filterpy and scikit-learn, on one thread."""
    body = []
    for form in ("augmented", "non_augmented"):
        row = where(record.sections[FILTER], form=form, precision="float64", threads=1)
        ours, theirs = float(str(row["us_per_pixel_step"])), float(str(row[f"filterpy_us_{form}"]))
        name = f"unscented flow filter, {form.replace('_', '-')}, us a pixel and frame"
        body.append([name, f"{ours:.2f}", f"{theirs:.0f} (filterpy)"])
    rows = record.sections["Weighted mixtures, a round"]
    sizes = {"components": 12, "points": 5000, "dimensions": 3}
    found = [
        where(rows, method=method, **sizes)["milliseconds_per_round"]
        for method in ("jacoflow, 1 thread", "scikit-learn")
    ]
    name = "weighted mixture, 12 components, 5000 points, 3 dimensions, ms a round"
    body.append([name, number(found[0], 2), f"{number(found[1], 1)} (scikit-learn)"])
    return lines(["", "jacoflow", "other library"], body)


TABLES: dict[str, tuple[Callable[[Record], list[str]], tuple[str, ...]]] = {
    "flow": (flow, ("Accuracy on recordings",)),
    "intervals": (intervals, ("Intervals on recordings",)),
    "tracking": (tracking, (HARD, "Tracking, recordings")),
    "particles": (particles, (SCENES, "Particle tracker, TUD-Campus", "Particle tracker, other recordings")),
    "stereo": (stereo, ("Disparity of edge pixels, scenes with exact truth",)),
    "stereo_tracking": (stereo_tracking, tuple(f"Stereo tracking, {scene}" for scene in STEREO_SCENES)),
    "motion": (motion, (CHANCE, VIEWS)),
    "limits": (limits, (LIMITS,)),
    "large_rates": (large_rates, (RATES,)),
    "unrelated": (unrelated, (UNRELATED,)),
    "turning_waves": (turning_waves, (WAVES,)),
    "coarse_shifts": (coarse_shifts, (COARSE,)),
    "two_motions": (two_motions, (TWO_MOTIONS,)),
    "turning_discs": (turning_discs, (DISCS,)),
    "noise": (noise, (NOISE,)),
    "coded": (coded, (CODED,)),
    "other_methods": (other_methods, (METHODS,)),
    "parts": (parts, (FILTER, "Weighted mixtures, a round")),
}
"""Table of a document -> its maker, and sections of the results that it needs."""


def written(text: str, record: Record) -> str:
    """A document with its tables written from the record."""

    def block(match: re.Match[str]) -> str:
        maker, needed = TABLES[match.group(2)]
        missing = [title for title in needed if title not in record.sections]
        if missing:
            body: Iterable[str] = [f"Not measured in {record.date}: {', '.join(missing)}."]
        else:
            body = maker(record)
        return match.group(1) + "\n" + "\n".join(body) + "\n\n" + match.group(3)

    return BLOCK.sub(block, text)


def main() -> int:
    """Writes or checks the documents."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="fail where a document would change")
    is_check = parser.parse_args().check
    record = newest()
    if record is None:
        sys.exit("benchmarks/results: expected a dated file, got none")
    differ = 0
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        new = written(text, record)
        if is_check and new != text:
            print(f"{document.name}: expected the tables that `make readme` writes, got others")
            differ = 1
        elif not is_check:
            document.write_text(new, encoding="utf-8")
    return differ


if __name__ == "__main__":
    sys.exit(main())
