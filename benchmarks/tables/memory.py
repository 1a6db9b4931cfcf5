"""Memory of dense estimates.

    python -m benchmarks.tables.memory

`memory`: peak of resident memory during one estimate, over that before it, in planes of one 4-byte number per
pixel. Each estimate runs in a process of its own, which has made one on small frames before: what libraries
take once is not counted. The result is counted.

`faults`: page faults per frame of a stream and per call of `estimate`, after the third, each result replacing
the one before; and the processor time of a stream with covariance over that without.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import jacoflow
from benchmarks import report

PRESETS = ("fast", "balanced", "accurate")
SIZE = (1920, 1080)
"""Width and height of the frames, px."""
CHILD = "--child"
"""First argument of a process that makes estimates."""
WARM_UP = 64
"""Side of the small frames, px."""
BEFORE, COUNTED = 3, 8
"""Estimates of a stream that are not counted, and that are."""


def frames(width: int, height: int) -> np.ndarray:
    """Three 8-bit frames of one moving surface that passes in front of another: motion boundaries take the
    most memory."""
    camera = jacoflow.scenes.Sensor(noise=1.0, rounding="nearest", saturate=True)
    surfaces = [
        jacoflow.scenes.Scene(
            "waves", width=width, height=height, random_state=seed, speed=2.0, wavelength=256.0
        )
        for seed in (1, 2)
    ]
    pictures = []
    for t in range(3):
        behind, before = (surface.frame(t - 1.0) for surface in surfaces)
        edge = width // 2 + 4 * t
        behind[:, edge:] = before[:, edge:]
        pictures.append(camera.apply_u8(behind, index=t))
    return np.stack(pictures)


def highest() -> float:
    """The most memory that this process has held so far, bytes."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM:")) * 1024.0
    except (OSError, StopIteration):
        # May be that of the process that started this one.
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (
            1.0 if sys.platform == "darwin" else 1024.0
        )


def method(preset: str, count: int) -> jacoflow.CoarseToFine:
    """The method for so many frames."""
    return jacoflow.CoarseToFine(preset=preset, time_scheme="pair" if count == 2 else None)


def peak(file: str, preset: str, count: int, covariance: bool) -> list[float]:
    """Planes that the estimate from the last `count` frames of the file needs, in this process."""
    given = [np.ascontiguousarray(frame) for frame in np.load(file)[-count:]]
    chosen = method(preset, count)
    jacoflow.flow(*[frame[:WARM_UP, :WARM_UP] for frame in given], method=chosen, covariance=covariance)
    before = highest()
    jacoflow.flow(*given, method=chosen, covariance=covariance)
    return [(highest() - before) / (4.0 * given[0].size)]


def stream(file: str, preset: str, count: int, covariance: bool) -> list[float]:
    """Page faults per frame of a stream, and its processor time, ms; the frames go there and back."""
    given = list(np.load(file))
    there_and_back = [given[(0, 1, 2, 1)[k % 4]] for k in range(count - 1 + BEFORE + COUNTED)]
    estimator = jacoflow.FlowEstimator(method=method(preset, count), covariance=covariance)
    return counted(estimator.push, there_and_back)


def calls(file: str, preset: str, count: int, covariance: bool) -> list[float]:
    """The same of calls of `estimate`."""
    given = [np.ascontiguousarray(frame) for frame in np.load(file)[-count:]]
    chosen = method(preset, count)
    return counted(
        lambda frames: jacoflow.flow(*frames, method=chosen, covariance=covariance),
        [given] * (BEFORE + COUNTED),
    )


def counted(step: Callable[[Any], object], arguments: Sequence[object]) -> list[float]:
    """Page faults and processor time, ms, per call of the last calls of `step`."""
    result = None
    for argument in arguments[:-COUNTED]:
        result = step(argument)
    before, started = resource.getrusage(resource.RUSAGE_SELF).ru_minflt, time.process_time()
    for argument in arguments[-COUNTED:]:
        result = step(argument)
    spent = 1e3 * (time.process_time() - started) / COUNTED
    faults = (resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before) / COUNTED
    del result
    return [faults, spent]


MODES = {mode.__name__: mode for mode in (peak, stream, calls)}


def in_child(mode: str, file: Path, preset: str, count: int, covariance: bool) -> list[float]:
    """What a mode measures, in a process of its own."""
    options = [mode, str(file), preset, str(count), str(int(covariance))]
    command = [sys.executable, "-m", "benchmarks.tables.memory", CHILD, *options]
    found = subprocess.run(command, check=True, capture_output=True, text=True)
    return [float(number) for number in found.stdout.split()]


def cases(width: int, height: int) -> Iterator[tuple[Path, str, int]]:
    """The frames' file, every preset and number of frames."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frames.npy"
        np.save(file, frames(width, height))
        for preset, count in product(PRESETS, (2, 3)):
            yield file, preset, count


def rows(width: int, height: int) -> Iterator[dict[str, object]]:
    """One row a preset and number of frames: planes without and with covariance, the result's among them."""
    for file, preset, count in cases(width, height):
        [without], [planes] = (in_child("peak", file, preset, count, covariance) for covariance in (False, True))
        yield {"preset": preset, "frames": count, "planes": without, "planes_with_covariance": planes}


def fault_rows(width: int, height: int) -> Iterator[dict[str, object]]:
    """One row a preset and number of frames: page faults and the cost of the covariance."""
    for file, preset, count in cases(width, height):
        row: dict[str, object] = {"preset": preset, "frames": count}
        spent = {}
        for covariance in (False, True):
            suffix = "_with_covariance" if covariance else ""
            row[f"stream{suffix}"], spent[covariance] = in_child("stream", file, preset, count, covariance)
            row[f"calls{suffix}"], _ = in_child("calls", file, preset, count, covariance)
        yield {**row, "covariance_cost": spent[True] / spent[False]}


TABLES = {
    "memory": report.Table(
        f"Peak of resident memory, planes of one 4-byte number per pixel, {SIZE[0]} x {SIZE[1]}",
        lambda _: list(rows(*SIZE)),
    ),
    "faults": report.Table(
        f"Page faults per frame and per call, {SIZE[0]} x {SIZE[1]}; time with covariance over that without",
        lambda _: list(fault_rows(*SIZE)),
    ),
}

if __name__ == "__main__":
    if len(sys.argv) == 7 and sys.argv[1] == CHILD:
        print(*MODES[sys.argv[2]](sys.argv[3], sys.argv[4], int(sys.argv[5]), sys.argv[6] == "1"))
    else:
        report.main(__doc__, TABLES)
