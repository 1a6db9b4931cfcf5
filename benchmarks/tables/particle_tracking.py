"""The particle tracker beside OpenCV's trackers on scenes of targets that look alike and on recordings.

    python -m benchmarks.tables.particle_tracking [--only TABLE ...] [--runs 3] [--recordings 10 11]

Every tracker gets the true box of each target in its first frame. A cell is success in % / mean overlap
(intersection over union) / mean error of the centre in px, over recordings (seeds of the scene), runs (seeds
of the tracker) and targets. Success: the centre in the target's own true box in 80 % of the frames, and a
mean overlap of 0.3 in the last ten. OpenCV's trackers run once a recording, one for each target.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from benchmarks import report
from benchmarks.rivals.particle import Contestant, Sequence, Settings, rivals
from benchmarks.scenes import particle_recordings
from benchmarks.scores.particle import FOUND, ended_at_truth, multiple_object, overlaps, success
from jacoflow import scenes
from jacoflow.track import ParticleTracker

Row = dict[str, object]
PAPER_SCENES = ("people_handheld", "cars_handheld", "people_static")
"""Scenes of the paper: both handheld ones and the static one."""
HARD_SCENES = ("slow_cross", "stop_and_go", "pillar")
PAPER, IMPROVED = ("colour", "velocity", "distance", "foreground"), ("colour", "velocity", "tracks")
"""Factors of the likelihood in each mode."""
RECORDINGS, RUNS, SEEDS = (10, 11), 3, (0, 1, 2)
"""Seeds of the scenes and runs of the tracker on them, and its seeds on recordings, by default."""
IMPROVED_MODE, PAPER_MODE = Settings("improved mode", "improved"), Settings("paper mode", "paper")


def without(mode: str, factors: tuple[str, ...], factor: str) -> Settings:
    """A mode without one factor of its likelihood."""
    left = tuple(each for each in factors if each != factor)
    return Settings(f"{mode} mode without {factor}", mode, {"likelihoods": left})


LIKELIHOODS = (PAPER_MODE, *(without("paper", PAPER, factor) for factor in PAPER[::-1]), IMPROVED_MODE)
READINGS = (
    *(
        Settings(f"paper mode, foreground {name}", "paper", {"foreground": name})
        for name in ("ratio", "literal", "posterior", "affine")
    ),
    Settings("paper mode, systematic resampling", "paper", {"resampling": "systematic"}),
    Settings(
        "paper mode, systematic, below N/2", "paper", {"resampling": "systematic", "ess_threshold": 0.5}
    ),
)
PARTS = (
    IMPROVED_MODE,
    *(without("improved", IMPROVED, factor) for factor in IMPROVED),
    Settings("improved mode with distance", "improved", {"likelihoods": (*IMPROVED, "distance")}),
    Settings("improved mode with foreground", "improved", {"likelihoods": (*IMPROVED, "foreground")}),
    Settings(
        "improved mode, systematic, below N/2", "improved", {"resampling": "systematic", "ess_threshold": 0.5}
    ),
    Settings("improved mode, 300 and 600 particles", "improved", {"n_particles": 300, "n_near": 600}),
    Settings("improved mode, 100 and 200 particles", "improved", {"n_particles": 100, "n_near": 200}),
)


def scene(name: str, recording: int) -> Sequence:
    """A recording of a scene."""
    made = scenes.TargetScene(name, random_state=recording)
    return Sequence(name, made.frames(), made.boxes())


def comparison(
    names: Iterable[str], contestants: list[Contestant], recordings: Iterable[int], runs: int
) -> list[Row]:
    """One row for each tracker, one column for each scene, then means over the scenes."""
    figures: dict[str, dict[str, list[dict[str, float]]]] = {each.name: {} for each in contestants}
    for name in names:
        for recording in recordings:
            sequence = scene(name, recording)
            for each in contestants:
                for seed in range(runs if each.random else 1):
                    figures[each.name].setdefault(name, []).extend(
                        success(each.follow(sequence, seed), sequence.boxes)
                    )
    rows: list[Row] = []
    for tracker, by_scene in figures.items():
        means = {
            name: {key: float(np.mean([figure[key] for figure in each])) for key in each[0]}
            for name, each in by_scene.items()
        }
        cells = {
            name: f"{100 * each['success']:.0f} / {each['overlap']:.2f} / {each['centre_error']:.1f}"
            for name, each in means.items()
        }
        over_scenes = {
            key: float(np.mean([each[key] for each in means.values()])) for key in ("success", "overlap")
        }
        count = {len(each) for each in by_scene.values()}
        row: Row = {"tracker": tracker, "n": "-".join(str(each) for each in sorted(count)), **cells}
        rows.append(
            {
                **row,
                "mean success, %": round(100 * over_scenes["success"], 1),
                "mean overlap": round(over_scenes["overlap"], 3),
            }
        )
    return rows


def campus(data: Path, ours: list[Contestant], others: list[Contestant]) -> list[Row]:
    """Multiple object tracking of eight people: ours on frames of 320 x 240, OpenCV's on those of 640 x
    480."""
    full = particle_recordings.campus(data)
    if full is None:
        return []
    half = particle_recordings.halved(full)
    rows: list[Row] = []
    for each in [*ours, *others]:
        sequence = half if each.random else full
        for seed in SEEDS if each.random else SEEDS[:1]:
            boxes = each.follow(sequence, seed)
            ended = multiple_object(ended_at_truth(boxes, sequence.boxes), sequence.boxes)
            whole = {
                name: round(value, 3) if name in ("MOTA", "IDF1") else int(value)
                for name, value in multiple_object(boxes, sequence.boxes).items()
            }
            row: Row = {"tracker": each.name, "seed": seed if each.random else "", **whole}
            row |= {
                f"{name}, ended at the truth": round(ended[name], 3) for name in ("MOTA", "IDF1") if ended
            }
            means = np.nanmean(overlaps(boxes, sequence.boxes), axis=0)
            rows.append({**row, "mean overlap of each target": " ".join(f"{value:.2f}" for value in means)})
    return rows


def single(data: Path, contestants: list[Contestant]) -> list[Row]:
    """Mean overlap and number of frames with an overlap of 0.5 or more, of recordings with one or two
    targets."""
    rows: list[Row] = []
    for sequence in particle_recordings.single(data):
        for each in contestants:
            for seed in SEEDS if each.random else SEEDS[:1]:
                shares = overlaps(each.follow(sequence, seed), sequence.boxes)
                found = " ".join(f"{int((column >= FOUND).sum())}/{len(column)}" for column in shares.T)
                means = " ".join(f"{value:.2f}" for value in np.nanmean(shares, axis=0))
                rows.append(
                    {
                        "recording": sequence.name,
                        "tracker": each.name,
                        "seed": seed if each.random else "",
                        "mean overlap of each target": means,
                        f"frames with {FOUND} or more": found,
                    }
                )
    return rows


def speed(threads: int = 2, rounds: int = 3) -> list[Row]:
    """Time of a frame of 720 x 480 with two targets that cross, 1000 particles each and 2000 while they
    are near, beside CSRT, in one run."""
    made = scenes.TargetScene("people_handheld", random_state=SEEDS[0], scale=1.0)
    frames, boxes = made.frames(), made.boxes()
    times: dict[str, list[float]] = {}
    for mode in ("improved", "paper") * rounds:
        tracker = ParticleTracker(frames[0], boxes[0], mode=mode, threads=threads)
        for frame in frames[1:]:
            start = time.perf_counter()
            tracker.update(frame)
            times.setdefault(f"{mode} mode", []).append(1e3 * (time.perf_counter() - start))
    for each in rivals(("CSRT", "KCF")):
        start = time.perf_counter()
        each.follow(Sequence("speed", frames, boxes), 0)
        times[f"{each.name}, one thread"] = [1e3 * (time.perf_counter() - start) / (len(frames) - 1)]
    return [
        {
            "tracker": name,
            "mean, ms": round(float(np.mean(each)), 1),
            "median, ms": round(float(np.median(each)), 1),
        }
        for name, each in times.items()
    ]


def among(options: report.Options, settings: Iterable[Settings], *beside: Contestant) -> list[Contestant]:
    """Those whose name holds one of the parts in `--trackers`."""
    candidates = [*(each.contestant() for each in settings), *beside]
    wanted = options.trackers
    return [each for each in candidates if wanted is None or any(part in each.name for part in wanted)]


def on(options: report.Options, names: Iterable[str], contestants: list[Contestant]) -> list[Row]:
    """The comparison on scenes; `quick`: one recording, one run."""
    seeds, runs = (RECORDINGS[:1], 1) if options.quick else (options.recordings, options.runs)
    return comparison(names, contestants, seeds, runs) if contestants else []


MODES = (IMPROVED_MODE, PAPER_MODE)
TABLES = {
    "likelihoods": report.Table(
        "Particle tracker, each factor of the likelihood left out",
        lambda o: on(o, PAPER_SCENES, among(o, LIKELIHOODS, *rivals())),
    ),
    "readings": report.Table(
        "Particle tracker, readings of the paper", lambda o: on(o, PAPER_SCENES, among(o, READINGS))
    ),
    "parts": report.Table(
        "Particle tracker, parts of the improved mode", lambda o: on(o, HARD_SCENES, among(o, PARTS))
    ),
    "scenes": report.Table(
        "Particle tracker, ten scenes",
        lambda o: on(
            o, scenes.target_scenes(), among(o, (*MODES, without("paper", PAPER, "foreground")), *rivals())
        ),
    ),
    "speed": report.Table(
        "Particle tracker, time of a frame of 720 x 480, two targets, two threads", lambda _: speed()
    ),
    "campus": report.Table(
        f"Particle tracker, {particle_recordings.CAMPUS}",
        lambda o: [] if o.data is None else campus(o.data, among(o, MODES), among(o, (), *rivals())),
    ),
    "recordings": report.Table(
        "Particle tracker, other recordings",
        lambda o: [] if o.data is None else single(o.data, among(o, MODES, *rivals())),
    ),
}
ARGUMENTS = {
    "--trackers": {"nargs": "+", "help": "parts of the names of the trackers to run"},
    "--runs": {"type": int, "default": RUNS, "help": "runs of the particle tracker a recording"},
    "--recordings": {"type": int, "nargs": "+", "default": RECORDINGS, "help": "seeds of the scenes"},
}

if __name__ == "__main__":
    report.main(__doc__, TABLES, ARGUMENTS)
