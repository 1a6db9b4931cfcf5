"""How often the stated covariances of the motion of a flow field hold: rendered rooms of chance with exact truth (`motion3d_rooms`), two frames of 320 x 240 px, f = 300 px.

    python benchmarks/motion3d_fields.py [--trials 40] [--only coarse_to_fine windowed]

Flow by both methods that have a field of windows, in noise of 1.5 and 5 grey levels, each estimated robustly (the default), from all points, and from patches of 48 px. `quick`: translational flow of some 2 px, beyond what the windowed method is made for; `slow`: a quarter of it. Columns as in `motion3d_coverage`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any, Literal

import jacoflow
import motion3d_rooms as rooms
from jacoflow import motion3d
from motion3d_coverage import Estimated, Row, row

TRIALS = 40
Method = Literal["coarse_to_fine", "windowed"]
METHODS: tuple[Method, ...] = ("coarse_to_fine", "windowed")
NOISES = (1.5, 5.0)
STEPS = {"quick": 0.02, "slow": 0.005}
"""How far the camera moves between both frames, in units of which walls are 1.2 to 3 away."""
TURN = 0.3
"""Most that it turns, in shares of that."""
WAYS: dict[str, dict[str, Any]] = {"default": {}, "robust=False": {"robust": False}, "patches=48": {"patches": 48}}


def fields(method: Method, noise: float, step: float, trials: int) -> list[tuple[jacoflow.FlowField, rooms.Room]]:
    """Flow fields of rooms, and these."""
    made = [rooms.room(seed, step, TURN * step) for seed in range(trials)]
    return [(jacoflow.estimate(rooms.frames(one, noise, seed), method=method), one) for seed, one in enumerate(made)]


def estimated(seen: list[tuple[jacoflow.FlowField, rooms.Room]], way: str) -> Iterator[Estimated]:
    """Their motions, estimated in one way, and the true ones."""
    for field, made in seen:
        yield motion3d.estimate_field_motion(field, rooms.K, **WAYS[way])[0], made.u, made.w


def table(trials: int = TRIALS, only: list[Method] | None = None) -> list[Row]:
    """One row for each method, noise, speed and way."""
    rows: list[Row] = []
    for method in only or METHODS:
        for speed, step in STEPS.items():
            for noise in NOISES:
                seen = fields(method, noise, step, trials)
                rows += [row(f"{method}, {speed}, noise {noise:g}, {way}", estimated(seen, way)) for way in WAYS]
    return rows


def main() -> None:
    """Prints the table."""
    from compare import table_lines

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--only", nargs="+", choices=METHODS)
    options = parser.parse_args()
    print("\n".join(table_lines(table(options.trials, options.only))))


if __name__ == "__main__":
    main()
