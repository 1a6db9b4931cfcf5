"""Pixels per second of flow with its Jacobian, against OpenCV's Farneback flow (which has no Jacobian)."""

from __future__ import annotations

import numpy as np

import jacoflow
from timing import race

try:
    import cv2
except ImportError:
    cv2 = None

WIDTH, HEIGHT = 640, 480
# Name in the table, method, whether with the covariance (which is Python's default).
ROWS = (
    ("instantaneous", "instantaneous", False),
    ("instantaneous with covariance", "instantaneous", True),
    ("windowed", "windowed", False),
)


def speed(rounds: int) -> list[dict[str, object]]:
    """One row for each method and number of threads; f32 frames for ours, 8-bit frames (all it takes) for OpenCV, one thread there."""
    scene = jacoflow.scenes.Scene("affine", width=WIDTH, height=HEIGHT, seed=1)
    seen = jacoflow.scenes.Sensor(rounding="nearest", saturate=True)
    frames = [seen.apply_u8(scene.frame(t), index=t) for t in range(3)]
    single = [frame.astype(np.float32) for frame in frames]
    contestants = {}
    for name, method, covariance in ROWS:
        for threads in (1, 2):
            contestants[f"{name} {threads}"] = lambda m=method, n=threads, c=covariance: jacoflow.estimate(
                single, method=m, threads=n, covariance=c
            )
    if cv2 is not None:
        cv2.setNumThreads(1)
        contestants["farneback 1"] = lambda: cv2.calcOpticalFlowFarneback(
            frames[0], frames[1], None, 0.5, 5, 15, 3, 5, 1.1, 0
        )
    times = race(contestants, rounds)
    rival = times.get("farneback 1")
    rows: list[dict[str, object]] = []
    for name, measured in times.items():
        method, threads = name.rsplit(" ", 1)
        one_thread = times[f"{method} 1"]
        rows.append(
            {
                "method": method,
                "threads": int(threads),
                "megapixels_per_second": WIDTH * HEIGHT / measured.busiest / 1e6,
                "times_farneback": rival.busiest / measured.busiest if rival else None,
                "speedup_cpu": one_thread.busiest / measured.busiest,
                "speedup_wall": one_thread.wall / measured.wall,
            }
        )
    return rows
