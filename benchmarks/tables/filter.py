"""Microseconds per pixel and frame of the affine-flow filter, against filterpy on one pixel; with the
answers compared to the reference."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks import report
from benchmarks.scores.timing import race

try:
    from benchmarks.rivals import flow_filter as reference
except ImportError:
    reference = None  # filterpy or scipy is missing

WIDTH, HEIGHT = 640, 480
FORMS = ("augmented", "non_augmented", "fast")


def ramp_stack(count: int) -> NDArray[np.float64]:
    """The patent's turning ramp, rounded down and smoothed by 3 px, (count, HEIGHT, WIDTH), with scene
    point (60, 80) inside."""
    scene = jacoflow.scenes.Scene(
        "ramp", width=WIDTH, height=HEIGHT, origin=(60 - WIDTH // 2, 80 - HEIGHT // 2)
    )
    frames = np.floor(scene.frames(count))
    if reference is None:
        return frames
    return np.array([reference.smooth(frame, 3.0) for frame in frames])


def speed(rounds: int) -> list[dict[str, object]]:
    """One row for each form, precision and number of threads."""
    steps = 8
    stack = ramp_stack(steps)
    pixel_steps = WIDTH * HEIGHT * steps
    contestants = {}
    for form in FORMS:
        for dtype in ("float32", "float64"):
            for threads in (1, 2):
                frames = stack.astype(dtype)
                contestants[f"{form} {dtype} {threads}"] = lambda f=form, d=dtype, n=threads, s=frames: (
                    follow(s, f, d, n)
                )
    times = race(contestants, rounds)
    rivals = {}
    if reference is not None:
        measurements = reference.ramp_measurements(40)
        settings = reference.Settings.patent()
        rival_times = race(
            {
                name: lambda a=augmented: reference.run(measurements, settings, augmented=a)
                for name, augmented in (("augmented", True), ("non_augmented", False))
            },
            max(2, rounds // 2),
        )
        rivals = {name: t.busiest / len(measurements) * 1e6 for name, t in rival_times.items()}
    rows: list[dict[str, object]] = []
    for name, measured in times.items():
        form, dtype, threads = name.split()
        ours = measured.busiest / pixel_steps * 1e6
        one_thread = times[f"{form} {dtype} 1"]
        rows.append(
            {
                "form": form,
                "precision": dtype,
                "threads": int(threads),
                "us_per_pixel_step": ours,
                "filterpy_us_augmented": rivals.get("augmented"),
                "filterpy_us_non_augmented": rivals.get("non_augmented"),
                "times_filterpy_augmented": rivals["augmented"] / ours if rivals else None,
                "times_filterpy_non_augmented": rivals["non_augmented"] / ours if rivals else None,
                "speedup_cpu": one_thread.busiest / measured.busiest,
                "speedup_wall": one_thread.wall / measured.wall,
            }
        )
    return rows


def follow(stack: NDArray[np.floating], form: str, dtype: str, threads: int) -> jacoflow.FlowField:
    """The last field of a filter that has seen the stack."""
    tracker = jacoflow.FlowFilter(profile=jacoflow.FilterProfile(form=form), precision=dtype, threads=threads)
    field = None
    for frame in stack:
        field = tracker.push(frame)
    return field


def agreement(frames: int = 400) -> list[dict[str, object]]:
    """Largest relative difference of the motion state from the reference over `frames` frames of the
    experiment, at the pixel (60, 80)."""
    if reference is None:
        return []
    origin = (reference.PIXEL[0] - 32, reference.PIXEL[1] - 32)
    scene = jacoflow.scenes.Scene("ramp", width=64, height=64, origin=origin)
    stack = [reference.smooth(np.floor(scene.frame(t)), 3.0) for t in range(frames)]
    measurements = np.array([image[31:34, 31:34].ravel() for image in stack])
    rows: list[dict[str, object]] = []
    for form in FORMS:
        settings = reference.Settings.patent()
        means, _ = reference.run(
            measurements, settings, augmented=form == "augmented", motion_first=form == "fast"
        )
        for dtype in ("float64", "float32"):
            tracker = jacoflow.FlowFilter(
                profile=jacoflow.FilterProfile(form=form),
                precision=dtype,
                grid=jacoflow.SamplingGrid(points=[(32, 32)]),
            )
            ours = []
            for image in stack:
                field = tracker.push(image.astype(dtype))
                ours.append(
                    np.concatenate([np.ravel(field.flow), np.ravel(np.swapaxes(field.jacobian, -1, -2))])
                )
            difference = np.abs(np.array(ours) - means[:, 6:]).max(axis=0)
            relative = float((difference / np.abs(means[:, 6:]).max(axis=0)).max())
            order = "motion first" if form == "fast" else "brightness first"
            rows.append(
                {
                    "form": form,
                    "reference_square_root": order,
                    "precision": dtype,
                    "frames": frames,
                    "largest_relative_difference": relative,
                }
            )
    return rows


TABLES = {
    "speed": report.Table(
        "Flow filter, microseconds per pixel and frame, 640 x 480",
        lambda o: speed(max(2, report.rounds(o) // 2)),
    ),
    "agreement": report.Table(
        "Flow filter, agreement with the reference", lambda o: agreement(60 if o.quick else 400)
    ),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
