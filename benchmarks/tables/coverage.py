"""How often 95 % intervals hold the truth: u, v, divergence and curl of the coarse-to-fine estimate on made scenes and on recordings.

    python -m benchmarks.tables.coverage [--held-out] [--border] [--seeds 1 2] [--frames 2 3] [--preset balanced] [--data FOLDER]

The scenes `FITTED` are those that the covariance's constants were fitted on; `HELD_OUT` differ in seed, size, texture, motion and noise, and were not.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks import report
from benchmarks.scenes import recordings as samples
from benchmarks.scores.flow import differences, inside, usable
from jacoflow import scenes

Array = NDArray[np.floating]
Row = dict[str, object]
QUANTITIES = ("u", "v", "divergence", "curl")
MARGIN = 16
"""Left out along each side, px: what enters the frame has no counterpart."""
NORMAL = 1.959964
"""Half the width of a 95 % interval, deviations."""
ASKED = (0.92, 0.97)
"""Shares of the truth that the intervals should hold."""


@dataclass(frozen=True)
class Family:
    """A carrier and a motion."""

    carrier: str
    motion: str
    name: str
    parameters: dict[str, float] = field(default_factory=dict, hash=False)

    def frames(self, size: tuple[int, int], noise: float, seed: int, count: int) -> tuple[list[Array], Any]:
        """What an 8-bit camera sees, and the exact mean flow at the pixels that the estimate belongs to."""
        scene = scenes.Scene(self.motion, width=size[0], height=size[1], random_state=seed, carrier=self.carrier, **self.parameters)
        camera = scenes.Sensor(noise=noise, rounding="nearest", saturate=True, random_state=seed)
        times = (0.0, 1.0) if count == 2 else (-1.0, 0.0, 1.0)
        pictures = [camera.apply_u8(scene.frame(t), index=int(t) + 8) for t in times]
        return pictures, scene.truth(0.0, between=(0.0, 1.0))


def affine(u: float, v: float, u_x: float = 0.0, v_x: float = 0.0, u_y: float = 0.0, v_y: float = 0.0) -> tuple[str, dict[str, float]]:
    """The scene of one affine motion."""
    return "affine", {"u": u, "v": v, "u_x": u_x, "v_x": v_x, "u_y": u_y, "v_y": v_y}


MOTIONS: dict[str, tuple[str, dict[str, float]]] = {
    "still": affine(0.1, 0.05),
    "affine": affine(3.3, -2.2, 0.01, 0.02, -0.02, 0.01),
    "fast": affine(7.4, 6.7, 0.02, -0.03, 0.02, -0.01),
    "vortex": ("vortex", {"circulation": 400.0, "core": 25.0}),
    "waves": ("waves", {"speed": 1.5, "wavelength": 128.0}),
    "turbulence": ("turbulence", {"speed": 2.0, "longest": 192.0}),
}
CARRIERS: dict[str, tuple[str, dict[str, float]]] = {"noise": ("noise", {}), "speckle": ("speckle", {}), "particles": ("particles", {})}
OTHER_MOTIONS: dict[str, tuple[str, dict[str, float]]] = {
    "slide": affine(0.31, 0.62),
    "spin": affine(2.7, -4.4, -0.004, 0.03, -0.03, -0.004),
    "quick": affine(6.3, -5.6, 0.02, 0.01, -0.015, 0.015),
    "vortex": ("vortex", {"circulation": 550.0, "core": 30.0}),
    "waves": ("waves", {"speed": 2.2, "wavelength": 110.0}),
    "turbulence": ("turbulence", {"speed": 1.6, "longest": 170.0}),
}
OTHER_CARRIERS: dict[str, tuple[str, dict[str, float]]] = {
    "noise 1.7 px": ("noise", {"sigma": 1.7, "std": 30.0}),
    "noise 2.6 px": ("noise", {"sigma": 2.6, "std": 45.0}),
    "speckle 3 px": ("speckle", {"radius": 3.0}),
    "particles 3.2 px": ("particles", {"diameter": 3.2, "density": 0.06}),
    "particles 2.5 px": ("particles", {"diameter": 2.5, "density": 0.04}),
}


def families(
    carriers: dict[str, tuple[str, dict[str, float]]], motions: dict[str, tuple[str, dict[str, float]]]
) -> list[Family]:
    """Every combination."""
    return [
        Family(carrier, motion, f"{texture}, {moving}", {**look, **path})
        for (texture, (carrier, look)), (moving, (motion, path)) in itertools.product(carriers.items(), motions.items())
    ]


@dataclass(frozen=True)
class Plan:
    """Families seen at some noise levels."""

    families: list[Family]
    noises: tuple[float, ...]
    size: tuple[int, int]


FITTED = Plan(families(CARRIERS, MOTIONS), (0.0, 1.0, 2.0, 4.0), (192, 192))
HELD_OUT = Plan(families(OTHER_CARRIERS, OTHER_MOTIONS), (0.5, 2.0, 3.0), (224, 160))


def estimate(frames: list[Any], preset: str) -> jacoflow.FlowField:
    """The estimate whose intervals are looked at."""
    return jacoflow.estimate(frames, method="coarse_to_fine", preset=preset, time_scheme="pair" if len(frames) == 2 else None)


def held(found: jacoflow.FlowField, flow: Array, jacobian: Array, where: NDArray[np.bool_]) -> dict[str, float]:
    """Share of the pixels `where` whose interval holds the truth, for each of `QUANTITIES`."""
    truth = {
        "u": flow[..., 0],
        "v": flow[..., 1],
        "divergence": jacobian[..., 0, 0] + jacobian[..., 1, 1],
        "curl": jacobian[..., 1, 0] - jacobian[..., 0, 1],
    }
    shares = {}
    for name in QUANTITIES:
        error = np.abs(found.value(name) - truth[name])[where]
        shares[name] = float((error <= NORMAL * found.std(name)[where]).mean())
    return shares


def scene_rows(plan: Plan, seeds: list[int], count: int, preset: str, border: bool = False) -> Iterator[Row]:
    """One row a family: shares over all its noise levels and seeds, then the worst and the best of its single scenes; `border`: of the margin alone."""
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
    """The mean of the rows, and how many of their shares are as asked."""
    values = np.array([[float(str(row[name])) for name in QUANTITIES] for row in rows])
    good = int(((values >= ASKED[0]) & (values <= ASKED[1])).sum())
    means = dict(zip(QUANTITIES, values.mean(axis=0).tolist(), strict=True))
    return {"scene": title, **means, "as_asked": f"{good} of {values.size} within {ASKED[0]:g}-{ASKED[1]:g}, all {values.min():.2f}-{values.max():.2f}"}


def table(plan: Plan, seeds: list[int], frames: list[int], preset: str = "balanced", border: bool = False) -> list[Row]:
    """All families, and the mean."""
    rows: list[Row] = []
    for count in frames:
        own = list(scene_rows(plan, seeds, count, preset, border))
        rows += [summary(own, f"all, {count} frames"), *own]
    return rows


def recordings(data: Path, preset: str = "balanced") -> list[Row]:
    """Shares on recordings: off motion boundaries and away from edges; derivatives against differences of the truth, which have errors of their own."""
    if samples.cv2 is None:
        return []
    rows: list[Row] = []
    found, missing = samples.read_all(samples.FLOWS, data)
    for sample, count in ((sample, count) for sample in found for count in (2, 3)):
        if count > len(sample.frames):
            continue
        field = estimate(sample.pair() if count == 2 else sample.frames, preset)
        where = usable(sample.truth) & field.valid
        rows.append({"scene": sample.name, "frames": count, **held(field, sample.truth, differences(sample.truth), where)})
    return rows + [{"scene": line, "frames": "missing"} for line in missing]


def sections(quick: bool, data: Path | None) -> dict[str, list[Row]]:
    """The tables of `compare.py`."""
    seeds = [1] if quick else [1, 2]
    out = {
        "Share of 95 % intervals that hold the truth, scenes of the fit": table(FITTED, seeds, [2, 3]),
        "Share of 95 % intervals that hold the truth, other scenes": table(HELD_OUT, [seed + 2 for seed in seeds], [2, 3]),
    }
    if data is not None:
        out["Share of 95 % intervals that hold the truth, recordings off motion boundaries"] = recordings(data)
    return out


def main() -> None:
    """Prints the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--held-out", action="store_true", help="the scenes that the constants were not fitted on")
    parser.add_argument("--border", action="store_true", help=f"only the outermost {MARGIN} px, which the other tables leave out")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--frames", type=int, nargs="+", default=[2, 3])
    parser.add_argument("--preset", default="balanced")
    parser.add_argument("--data", type=Path, help="folder of recordings with truth: those instead of scenes")
    options = parser.parse_args()
    if options.data is not None:
        rows = recordings(options.data, options.preset)
    else:
        rows = table(HELD_OUT if options.held_out else FITTED, options.seeds, options.frames, options.preset, options.border)
    print("\n".join(report.table_lines(rows)))


if __name__ == "__main__":
    main()
