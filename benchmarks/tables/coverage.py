"""How often 95 % intervals of u, v, divergence and curl hold the truth: coarse-to-fine estimate, scenes and
recordings.

    python -m benchmarks.tables.coverage [--only fitted held_out recordings] [--data FOLDER]
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks import report
from benchmarks.scenes import recordings as samples
from benchmarks.scenes.coverage import FITTED, HELD_OUT, Plan
from benchmarks.scores.flow import differences, inside, usable

Array = NDArray[np.floating]
Row = dict[str, object]
QUANTITIES = ("u", "v", "divergence", "curl")
MARGIN = 16
"""Left out along each side, px: what enters the frame has no counterpart."""
NORMAL = 1.959964
"""Half the width of a 95 % interval, standard deviations."""
ASKED = (0.92, 0.97)
"""Shares of the truth that the intervals should hold."""


def estimate(frames: list[Any], preset: str) -> jacoflow.FlowField:
    """The estimate whose intervals are looked at."""
    method = jacoflow.CoarseToFine(preset=preset, time_scheme="pair" if len(frames) == 2 else None)
    return jacoflow.flow(*frames, method=method)


def held(
    found: jacoflow.FlowField, flow: Array, jacobian: Array, where: NDArray[np.bool_]
) -> dict[str, float]:
    """Share of the pixels `where` whose interval holds the truth, for each of `QUANTITIES`."""
    # Divergence and curl are rates over the step, formed of the true displacement as of the estimated one.
    truth = jacoflow.FlowField.from_arrays(flow, jacobian=jacobian, interval=found.interval)
    shares = {}
    for name in QUANTITIES:
        error = np.abs(found.value(name) - truth.value(name))[where]
        shares[name] = float((error <= NORMAL * found.std(name)[where]).mean())
    return shares


def scene_rows(plan: Plan, seeds: list[int], count: int, preset: str, border: bool = False) -> Iterator[Row]:
    """One row a family: shares over all its noise levels and seeds, then the worst and the best of its
    single scenes; `border`: of the margin alone."""
    for family in plan.families:
        shares = []
        for noise, seed in itertools.product(plan.noises, seeds):
            frames, truth = family.frames(plan.size, noise, seed, count)
            where = inside(truth.flow.shape[:2], MARGIN) ^ border
            shares.append(held(estimate(frames, preset), truth.flow, truth.jacobian, where))
        row: Row = {"scene": family.name, "frames": count}
        for name in QUANTITIES:
            row[name] = float(np.mean([share[name] for share in shares]))
        for name in QUANTITIES:
            row[f"{name}_by_noise"] = " ".join(f"{share[name]:.2f}" for share in shares)
        yield row


def summary(rows: list[Row], title: str) -> Row:
    """The mean of the rows, and how many of their shares are within `ASKED`."""
    values = np.array([[float(str(row[name])) for name in QUANTITIES] for row in rows])
    good = int(((values >= ASKED[0]) & (values <= ASKED[1])).sum())
    means = dict(zip(QUANTITIES, values.mean(axis=0).tolist(), strict=True))
    return {
        "scene": title,
        **means,
        "as_asked": f"{good} of {values.size} within {ASKED[0]:g}-{ASKED[1]:g}, "
        f"all {values.min():.2f}-{values.max():.2f}",
    }


def table(
    plan: Plan, seeds: list[int], frames: list[int], preset: str = "balanced", border: bool = False
) -> list[Row]:
    """All families, and the mean."""
    rows: list[Row] = []
    for count in frames:
        own = list(scene_rows(plan, seeds, count, preset, border))
        rows += [summary(own, f"all, {count} frames"), *own]
    return rows


def recordings(data: Path, preset: str = "balanced") -> list[Row]:
    """Shares on recordings: off motion boundaries and away from edges; derivatives against differences of
    the truth, which have errors of their own."""
    if samples.cv2 is None:
        return []
    rows: list[Row] = []
    found, missing = samples.read_all(samples.FLOWS, data)
    for sample, count in ((sample, count) for sample in found for count in (2, 3)):
        if count > len(sample.frames):
            continue
        field = estimate(sample.pair() if count == 2 else sample.frames, preset)
        where = usable(sample.truth) & field.valid
        rows.append(
            {
                "scene": sample.name,
                "frames": count,
                **held(field, sample.truth, differences(sample.truth), where),
            }
        )
    return rows + [{"scene": line, "frames": "missing"} for line in missing]


SEEDS = {"fitted": (1, 2), "held_out": (3, 4)}
TABLES = {
    "fitted": report.Table(
        "Share of 95 % intervals that hold the truth, scenes of the fit",
        lambda o: table(FITTED, list(SEEDS["fitted"][: 1 if o.quick else 2]), [2, 3]),
    ),
    "held_out": report.Table(
        "Share of 95 % intervals that hold the truth, other scenes",
        lambda o: table(HELD_OUT, list(SEEDS["held_out"][: 1 if o.quick else 2]), [2, 3]),
    ),
    "recordings": report.Table(
        "Share of 95 % intervals that hold the truth, recordings off motion boundaries",
        lambda o: [] if o.data is None else recordings(o.data),
    ),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
