"""Peak of resident memory during one estimate, over that before it, in planes of one 4-byte number per pixel.

    python -m benchmarks.tables.memory

Each estimate runs in a process of its own, which has made one on small frames before: what libraries take
once is not counted. The result is counted.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

import jacoflow
from benchmarks import report

PRESETS = ("fast", "balanced", "accurate")
SIZE = (1920, 1080)
"""Width and height of the frames, px."""
CHILD = "--child"
"""First argument of a process that makes one estimate."""
WARM_UP = 64
"""Side of the small frames, px."""


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


def measure(file: str, preset: str, count: int, covariance: bool) -> float:
    """Planes that the estimate from the last `count` frames of the file needs, in this process."""
    given = [np.ascontiguousarray(frame) for frame in np.load(file)[-count:]]
    method = jacoflow.CoarseToFine(preset=preset, time_scheme="pair" if count == 2 else None)
    jacoflow.estimate([frame[:WARM_UP, :WARM_UP] for frame in given], method=method, covariance=covariance)
    before = highest()
    jacoflow.estimate(given, method=method, covariance=covariance)
    return (highest() - before) / (4.0 * given[0].size)


def rows(width: int, height: int) -> Iterator[dict[str, object]]:
    """One row a preset and number of frames: planes without and with covariance, the result's among them."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frames.npy"
        np.save(file, frames(width, height))
        for preset, count in product(PRESETS, (2, 3)):
            row: dict[str, object] = {"preset": preset, "frames": count}
            for covariance in (False, True):
                child = [
                    sys.executable,
                    "-m",
                    "benchmarks.tables.memory",
                    CHILD,
                    str(file),
                    preset,
                    str(count),
                    str(int(covariance)),
                ]
                found = subprocess.run(child, check=True, capture_output=True, text=True)
                row["planes_with_covariance" if covariance else "planes"] = float(found.stdout)
            yield row


TABLES = {
    "memory": report.Table(
        f"Peak of resident memory, planes of one 4-byte number per pixel, {SIZE[0]} x {SIZE[1]}",
        lambda _: list(rows(*SIZE)),
    )
}

if __name__ == "__main__":
    if len(sys.argv) == 6 and sys.argv[1] == CHILD:
        print(measure(sys.argv[2], sys.argv[3], int(sys.argv[4]), sys.argv[5] == "1"))
    else:
        report.main(__doc__, TABLES)
