"""The particle tracker on recordings of the ten synthetic scenes, on every fourth frame of some of them, and
on recordings of people and joggers: targets kept, overlap, outcomes of tests, time.

JACOFLOW_ABLATION=quick takes the three hardest scenes and no recordings.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.ablation import outcomes
from benchmarks.rivals.particle import Sequence, Settings
from benchmarks.scenes import particle_recordings
from benchmarks.scores.particle import ended_at_truth, multiple_object, overlaps, success
from jacoflow import scenes

REAL = ("recordings, overlap", "campus, MOTA", "campus, IDF1")
LARGER_IS_BETTER = ("kept", "overlap", "fast, kept", "fast, overlap", *REAL, "tests")
RECORDINGS = range(31, 37)
"""Seeds of the synthetic recordings; none of them is used elsewhere."""
FAST, FAST_RECORDINGS = 4, (31, 32)
"""Frames from one to the next of fast targets, and seeds of their recordings."""
SEEDS = range(10)
"""Seeds of the tracker on recordings of real scenes."""
QUICK = ("slow_cross", "stop_and_go", "pillar")


def sequences(recordings: Iterable[int] = RECORDINGS, every: int = 1) -> Iterator[Sequence]:
    """The synthetic recordings, every so many frames of them."""
    quick = os.environ.get("JACOFLOW_ABLATION") == "quick"
    for name in QUICK if quick else scenes.target_scenes():
        for recording in recordings:
            made = scenes.TargetScene(name, random_state=recording)
            frames = np.stack([made.frame(t) for t in range(0, len(made), every)])
            yield Sequence(name, frames, made.boxes()[::every])


def rows() -> dict[str, list[float]]:
    """One value for each synthetic target, for each target of a real recording and seed."""
    contestant = Settings("improved", "improved").contestant()
    found: dict[str, list[float]] = {"kept": [], "overlap": [], "fast, kept": [], "fast, overlap": [], "ms": []}
    found["tests"] = outcomes.passed("test_particle_track.py")
    for sequence in sequences():
        begun = time.process_time()
        boxes = contestant.follow(sequence, 0)
        found["ms"].append(1e3 * (time.process_time() - begun) / len(boxes))
        for figures in success(boxes, sequence.boxes):
            found["kept"].append(figures["success"])
            found["overlap"].append(figures["overlap"])
    for sequence in sequences(FAST_RECORDINGS, FAST):
        for figures in success(contestant.follow(sequence, 0), sequence.boxes):
            found["fast, kept"].append(figures["success"])
            found["fast, overlap"].append(figures["overlap"])
    data = os.environ.get("JACOFLOW_DATA")
    if data is None or os.environ.get("JACOFLOW_ABLATION") == "quick":
        return found
    found |= {name: [] for name in REAL}
    for sequence in particle_recordings.single(Path(data)):
        for seed in SEEDS:
            shares = overlaps(contestant.follow(sequence, seed), sequence.boxes)
            found["recordings, overlap"] += np.nanmean(shares, axis=0).tolist()
    if (campus := particle_recordings.campus(Path(data))) is not None:
        half = particle_recordings.halved(campus)
        for seed in SEEDS:
            measures = multiple_object(ended_at_truth(contestant.follow(half, seed), half.boxes), half.boxes)
            found["campus, MOTA"].append(measures.get("MOTA", np.nan))
            found["campus, IDF1"].append(measures.get("IDF1", np.nan))
    return found
