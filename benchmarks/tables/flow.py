"""Pixels per second of flow with its Jacobian, against OpenCV's flows (which have no Jacobian)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

import jacoflow
from benchmarks import report
from benchmarks.rivals import flow as rivals
from benchmarks.scores.timing import race
from benchmarks.settings import SPEED, Setting

SIZES = ((640, 480), (1920, 1080))
THREADS = (1, 2)


def wider() -> str | None:
    """The instruction set beyond AVX2 that this processor has, if it has one: OpenCV takes what there is."""
    try:
        jacoflow.estimate(np.zeros((3, 16, 16), np.uint8), method="windowed", simd="avx512")
    except ValueError:
        return None
    return "avx512"


def speed(
    rounds: int, width: int = 640, height: int = 480, ours: list[Setting] = SPEED
) -> list[dict[str, object]]:
    """One row for each of our settings and number of threads, and for each rival on one thread; the same
    8-bit frames for all, a pair for the rivals.

    The presets run a second time with the instruction set beyond AVX2, where there is one.
    """
    scene = jacoflow.scenes.Scene(
        "waves", width=width, height=height, random_state=1, speed=2.0, wavelength=256.0
    )
    camera = jacoflow.scenes.Sensor(noise=1.0, rounding="nearest", saturate=True)
    frames = [camera.apply_u8(scene.frame(t - 1.0), index=t) for t in range(3)]
    contestants: dict[tuple[str, int], Callable[[], object]] = {}
    for setting in ours:
        given = frames[3 - setting.frames :]
        for threads in THREADS:
            contestants[setting.name, threads] = partial(setting.field, given, threads=threads)
        if setting.name.startswith("coarse to fine") and (simd := wider()) is not None:
            for threads in THREADS:
                contestants[f"{setting.name}, {simd}", threads] = partial(
                    setting.field, given, threads=threads, simd=simd
                )
    if rivals.cv2 is not None:
        rivals.cv2.setNumThreads(1)
        for name, flow in rivals.RIVALS.items():
            contestants[name, 1] = partial(flow, frames[1], frames[2])
    times = race(contestants, rounds)
    rows: list[dict[str, object]] = []
    for (name, threads), measured in times.items():
        one_thread = times[name, 1]
        row: dict[str, object] = {
            "method": name,
            "threads": threads,
            "milliseconds": measured.busiest * 1e3,
            "megapixels_per_second": width * height / measured.busiest / 1e6,
        }
        for rival in rivals.RIVALS:
            time = times.get((rival, 1))
            row[f"times_{rival}"] = time.busiest / measured.busiest if time else None
        rows.append(
            {
                **row,
                "speedup_cpu": one_thread.busiest / measured.busiest,
                "speedup_wall": one_thread.wall / measured.wall,
            }
        )
    return rows


TABLES = {
    f"{width}": report.Table(
        f"Flow per second, {width} x {height}",
        lambda o, size=(width, height): (
            [] if o.quick and size != SIZES[0] else speed(report.rounds(o), *size)
        ),
    )
    for width, height in SIZES
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
