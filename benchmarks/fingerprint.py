"""Hashes of results on fixed scenes: shows that a change of words, names or rooms changed no bit.

    python -m benchmarks.fingerprint                                            # prints the hashes
    python -m benchmarks.fingerprint --write benchmarks/fingerprint.json
    python -m benchmarks.fingerprint --compare benchmarks/fingerprint.json      # fails where a hash differs

Computed without vector instructions (`JACOFLOW_SIMD=scalar`), so that the hashes do not depend on the
processor. They may depend on the C library, whose elementary functions round differently from version to
version.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

os.environ["JACOFLOW_SIMD"] = "scalar"

import numpy as np

import jacoflow

Named = Iterator[tuple[str, list[Any]]]
CAMERA = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]
"""Camera of the motion scenes, px."""


def digest(values: list[Any]) -> str:
    """First 16 digits of the SHA-256 of arrays, numbers and words."""
    total = hashlib.sha256()
    for value in values:
        if value is None or isinstance(value, str):
            total.update(repr(value).encode())
        else:
            array = np.ascontiguousarray(value)
            # One bit pattern for every NaN and for both zeros.
            if array.dtype.kind == "f":
                array = np.where(np.isnan(array), np.array(np.nan, array.dtype), array + 0)
            total.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
    return total.hexdigest()[:16]


def texture(height: int, width: int, seed: int) -> np.ndarray:
    """Blurred random cells, grey levels 0 to 255."""
    rng = np.random.default_rng(seed)
    cells = (
        rng.integers(30, 220, (height // 4 + 1, width // 4 + 1))
        .repeat(4, 0)
        .repeat(4, 1)[:height, :width]
        .astype(float)
    )
    for axis in (0, 1):
        cells = (np.roll(cells, 1, axis) + 2 * cells + np.roll(cells, -1, axis)) / 4
    return cells


def field_parts(field: Any) -> list[Any]:
    return [field.flow, field.jacobian, field.covariance, field.status]


def fields() -> Named:
    vortex = jacoflow.scenes.Scene("vortex", width=96, height=80).frames(4)
    disc = jacoflow.scenes.Scene("disc", width=96, height=96).frames(3)
    shifted = np.stack([np.roll(texture(120, 140, 1), 5 * k, 1) for k in range(3)]).astype(np.uint8)
    for preset in ("fast", "balanced", "accurate"):
        yield (
            f"field {preset} vortex",
            field_parts(
                jacoflow.estimate(vortex[:3], ends="drop", method=jacoflow.CoarseToFine(preset=preset), threads=1)
            ),
        )
        yield (
            f"field {preset} shifted pair",
            field_parts(
                jacoflow.flow(*shifted[:2], method=jacoflow.CoarseToFine(preset=preset), threads=1)
            ),
        )
    yield "field balanced float64", field_parts(jacoflow.estimate(disc.astype(float), ends="drop", threads=1))
    for method in ("windowed", "instantaneous", "lucas_kanade", "horn_schunck"):
        yield f"field {method}", field_parts(jacoflow.estimate(vortex[:3], ends="drop", method=method, threads=1))
    yield "field recursive", field_parts(jacoflow.estimate(vortex, ends="drop", temporal="recursive", threads=1))
    field = jacoflow.estimate(disc, fps=25.0, threads=1)[1]
    yield (
        "derived",
        [field.value(name) for name in jacoflow.quantities()] + [field.std("curl"), field.std("divergence")],
    )
    for profile in ("patent", "measured"):
        filtered = jacoflow.FlowFilter(profile=profile, threads=1)
        for frame in disc:
            last = filtered.push(frame)
        yield f"flow filter {profile}", [*field_parts(last), filtered.state]
    corners = jacoflow.corners(shifted[0])
    yield "corners", [np.asarray(part) for part in (corners if isinstance(corners, tuple) else (corners,))]


def moving_square(count: int) -> np.ndarray:
    """Frames 96 x 96 of a square of 13 px that goes 1 px right and .5 px down a frame before a texture."""
    rng = np.random.default_rng(5)
    frames = np.repeat((texture(96, 96, 2) * 0.3 + 60)[None], count, 0)
    for t in range(count):
        frames[t, 20 + t // 2 : 33 + t // 2, 20 + t : 33 + t] = 200
    return np.clip(frames + rng.normal(0, 2, frames.shape), 0, 255).round().astype(np.uint8)


def tracks() -> Named:
    frames = moving_square(20)
    result = jacoflow.track.track(frames, bbox=(19.5, 19.5, 13, 13))
    yield "track layered", [result.position, result.velocity, result.covariance]
    street = jacoflow.scenes.TargetScene("people_static", random_state=1, scale=0.5)
    frames = [street.frame(t) for t in range(60, 72)]
    followed = jacoflow.track.track_particles(frames, street.boxes()[60], threads=1)
    yield "track particle", [np.asarray(step.boxes) for step in followed]


def stereo_views(count: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Left and right views, 120 x 160: a wall at disparity 4 and a box at disparity 10 that goes 3 px
    right a step."""
    rng = np.random.default_rng(7)
    wall, box = texture(120, 200, 3), texture(50, 40, 4)
    for t in range(count):
        views = []
        for shift, place in ((0, 0), (4, 10)):
            view = wall[:, 20 + shift : 180 + shift].copy()
            left = 40 + 3 * t - place
            view[40:90, left : left + 40] = box
            views.append(np.clip(view + rng.normal(0, 2, view.shape), 0, 255).round().astype(np.uint8))
        yield views[0], views[1]


def stereo() -> Named:
    left, right = next(stereo_views(1))
    found = jacoflow.stereo.edge_disparity(left, right, disparity_range=(-4, 16))
    yield "edge disparity", [found.disparity, found.rows, found.cols, found.values, found.row_offset]
    tracker = jacoflow.track.StereoTracker(disparity_range=(-4, 16), threads=1)
    parts: list[Any] = []
    for views in stereo_views(5):
        step = tracker.update(*views)
        parts += [len(step.clusters)] + [np.asarray(cluster.mean) for cluster in step.clusters]
    yield "stereo tracker", parts


def scene(seed: int, outliers: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    points = rng.uniform((0, 0), (640, 480), (300, 2))
    depths = rng.uniform(0.01, 0.03, 300)
    flow = jacoflow.motion3d.predict_flow(points, [0.6, 0.2, 0.75], [0.002, -0.003, 0.001], depths, CAMERA)
    flow = flow + rng.normal(0, 0.1, flow.shape)
    wrong = rng.uniform(size=300) < outliers
    flow[wrong] += rng.uniform(-8, 8, (wrong.sum(), 2))
    return points, flow


def motion_parts(motion: Any) -> list[Any]:
    return [motion.camera_translation, motion.covariance, motion.inv_depth]


def motions() -> Named:
    for seed in range(3):
        points, flow = scene(seed, 0.0)
        for method in ("ml", "efficient", "auto"):
            found = jacoflow.motion3d.estimate_motion(points, flow, CAMERA, method=method, threads=1)
            yield f"motion {method} {seed}", motion_parts(found)
        points, flow = scene(seed, 0.3)
        yield (
            f"motion robust {seed}",
            motion_parts(jacoflow.motion3d.estimate_motion(points, flow, CAMERA, robust=True, threads=1)),
        )


def mixtures() -> Named:
    rng = np.random.default_rng(11)
    points = np.concatenate([rng.normal(m, 1.0, (80, 2)) for m in ((0, 0), (8, 1), (3, 9))])
    fitted = jacoflow.mixture.VariationalGaussianMixture(5, random_state=1).fit(points)
    yield "mixture variational", [fitted.means_, fitted.covariances_, fitted.weights_]
    found = jacoflow.mixture.DirichletProcessGaussianMixture(random_state=1).fit(points)
    yield "mixture dirichlet", [found.means_, found.covariances_, found.weights_]
    image = np.stack([texture(60, 80, k) for k in (6, 7, 8)], -1).astype(np.uint8)
    yield "segmentation", [jacoflow.segment.felzenszwalb(image)]


GROUPS: dict[str, Callable[[], Named]] = {
    "fields": fields,
    "tracks": tracks,
    "stereo": stereo,
    "motions": motions,
    "mixtures": mixtures,
}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=list(GROUPS), default=list(GROUPS))
    parser.add_argument("--write", type=Path, help="JSON file for the hashes")
    parser.add_argument(
        "--compare", type=Path, help="JSON file of earlier hashes; exit status 1 where one differs"
    )
    arguments = parser.parse_args()
    found = {}
    for group in arguments.only:
        for name, values in GROUPS[group]():
            found[name] = digest(values)
            print(f"{found[name]}  {name}", flush=True)
    if arguments.write:
        arguments.write.write_text(json.dumps(found, indent=1) + "\n")
    if arguments.compare:
        before = json.loads(arguments.compare.read_text())
        different = [name for name, value in found.items() if before.get(name) != value]
        print(
            f"{len(found) - len(different)} of {len(found)} as before",
            *(f"differs: {name}" for name in different),
            sep="\n",
        )
        return 1 if different else 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
