"""Flow between frames that are not equally bright, beside saturated pixels and over large motions; and, with
`--data`, a real pair of unequal brightness and driving recordings.

    python -m benchmarks.tables.disturbed [--only brightness specks shifts recordings] [--data FOLDER]
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks import report
from benchmarks.rivals import flow as rivals
from benchmarks.scenes import disturbed as scenes
from benchmarks.scenes import recordings as samples

Array = NDArray[np.floating]
Row = dict[str, object]
PRESETS = ("fast", "balanced", "accurate")
SEEDS = (11, 12)
MOVES = ((0.5, 0.0), (6.3, -2.4))
SHIFTS = ((24, 0), (48, 0), (56, 0), (0, -64), (80, 0), (80, 60))


def flows(frames: list[Array]) -> dict[str, Array]:
    """Ours by preset, and OpenCV's."""
    found = {
        preset: jacoflow.flow(*frames, method=jacoflow.CoarseToFine(preset=preset), covariance=False).flow
        for preset in PRESETS
    }
    eight_bit = [np.clip(np.rint(frame), 0, 255).astype(np.uint8) for frame in frames]
    if samples.cv2 is not None:
        found |= {name: run(*eight_bit) for name, run in rivals.RIVALS.items()}
    return found


def brightness(seeds: tuple[int, ...]) -> list[Row]:
    """Root-mean-square errors, px, over all motions and seeds."""
    rows: list[Row] = []
    for change in (None, *scenes.CHANGES):
        squares: dict[str, list[float]] = {}
        for move in MOVES:
            for seed in seeds:
                for name, flow in flows(scenes.changed_pair(seed, move, change)).items():
                    error = scenes.inner(flow - np.array(move))
                    squares.setdefault(name, []).append(float((error**2).sum(axis=-1).mean()))
        rows.append({"second frame": change or "equal"} | {k: float(np.sqrt(np.mean(v))) for k, v in squares.items()})
    return rows


def specks(seeds: tuple[int, ...]) -> list[Row]:
    """Change of the flow by 20 saturated pixels, farther than 20 px from them, in standard deviations."""
    rows: list[Row] = []
    for preset in PRESETS:
        changes = []
        for seed in seeds:
            clean, spoilt, far = scenes.specks(seed)
            fields = [
                jacoflow.flow(*frames, method=jacoflow.CoarseToFine(preset=preset)) for frames in (clean, spoilt)
            ]
            std = np.stack([fields[0].std("u"), fields[0].std("v")], axis=-1)
            changes.append((np.abs(fields[1].flow - fields[0].flow) / std)[far])
        every = np.concatenate(changes)
        rows.append({"preset": preset, "mean": float(every.mean()), "share above .1": float(np.mean(every > 0.1))})
    return rows


def shifts(seeds: tuple[int, ...]) -> list[Row]:
    """Median errors, px, of what stays in the frame."""
    rows: list[Row] = []
    for shift in SHIFTS:
        errors: dict[str, list[float]] = {}
        for seed in seeds:
            for name, flow in flows(scenes.shifted_speckle(seed, shift)).items():
                error = np.linalg.norm(flow - np.array(shift), axis=-1)[scenes.FOUND]
                errors.setdefault(name, []).append(float(np.median(error)))
        rows.append({"shift": f"{shift[0]}, {shift[1]}"} | {k: float(np.mean(v)) for k, v in errors.items()})
    return rows


def correlated(one: Array, other: Array, side: int = 64) -> tuple[Array, Array]:
    """Displacements of windows by the peak of their cross-correlation, and where they are in the first frame,
    (n, 2). The second time windows are offset by the first displacement, half in each frame: so they show the
    same particles, those at the middle of both exposures. Peaks are fitted by Gaussians, particles' own shape
    (J. Westerweel, Meas. Sci. Technol. 8, 1997)."""
    places, found = [], []
    for y in range(0, one.shape[0] - side + 1, side // 2):
        for x in range(0, one.shape[1] - side + 1, side // 2):
            rough = displacement(one, other, (x, y), np.zeros(2), side)
            moved = None if rough is None else displacement(one, other, (x, y), np.rint(rough), side)
            if moved is not None:
                places.append((x + side / 2, y + side / 2) - moved / 2)
                found.append(moved)
    return np.array(places), np.array(found)


def displacement(one: Array, other: Array, corner: tuple[int, int], offset: Array, side: int) -> Array | None:
    """Of windows that lie `offset` px apart; None beyond the frames or without a peak."""
    before = np.array(corner) - (offset // 2).astype(int)
    after = before + offset.astype(int)
    if min(*before, *after) < 0 or (np.maximum(before, after) + side > one.shape[::-1]).any():
        return None
    a, b = (frame[y : y + side, x : x + side] for frame, (x, y) in ((one, before), (other, after)))
    spectrum = np.conj(np.fft.rfft2(a - a.mean())) * np.fft.rfft2(b - b.mean())
    surface = np.fft.fftshift(np.fft.irfft2(spectrum))
    j, i = np.unravel_index(surface.argmax(), surface.shape)
    if min(i, j) == 0 or max(i, j) == side - 1:
        return None
    peak = np.array([surface[j, i - 1 : i + 2], surface[j - 1 : j + 2, i]])
    if peak.min() <= 0:
        return None
    low, top, high = np.log(peak).T
    return offset + [i - side / 2, j - side / 2] + 0.5 * (low - high) / (low - 2 * top + high)


def kitti(path: Path) -> Array:
    """A flow of the KITTI benchmarks, (H, W, 2), NaN where unknown."""
    stored = samples.cv2.imread(str(path), samples.cv2.IMREAD_UNCHANGED).astype(float)
    flow = (stored[..., 2:0:-1] - 32768) / 64
    flow[stored[..., 0] == 0] = np.nan
    return flow


def recordings(data: Path | None) -> list[Row]:
    """The pair of unequal brightness: median distance from window correlation, px. Driving: mean end-point
    error, px, and share of pixels that are off by more than 3 px and 5 %."""
    if data is None or samples.cv2 is None:
        return []
    rows: list[Row] = []
    folder = data / "piv_openpiv" / "test2"
    if folder.exists():
        pair = [samples.read_grey(folder / f"2image_0{k}.tif") for k in (0, 1)]
        one, other = (frame.astype(float) for frame in pair)
        by_hand = (other - other.mean()) / other.std() * one.std() + one.mean()
        places, wanted = correlated(one, other)
        columns, lines = np.rint(places).astype(int).T
        for what, second in (("as recorded", other), ("equalised by hand", by_hand)):
            distances = {
                name: float(np.median(np.linalg.norm(flow[lines, columns] - wanted, axis=-1)))
                for name, flow in flows([one, second]).items()
            }
            rows.append({"recording": f"double-frame PIV, {what}"} | distances)
    drives = {
        "KITTI 2012 000151": ("kitti2012/image_0/000151_10.png", "kitti2012/image_0/000151_11.png", "kitti2012/flow_noc/000151_10.png"),
        "KITTI 2015 000000": ("kitti2015/000000/frame1.png", "kitti2015/000000/frame2.png", "kitti2015/000000/flow_gt.png"),
    }
    for name, paths in drives.items():
        if all((data / path).exists() for path in paths):
            truth = kitti(data / paths[2])
            known, row = np.isfinite(truth).all(axis=-1), {"recording": name}
            for method, flow in flows([samples.read_grey(data / path) for path in paths[:2]]).items():
                error = np.linalg.norm(flow - truth, axis=-1)[known]
                is_wrong = (error > 3) & (error > 0.05 * np.linalg.norm(truth, axis=-1)[known])
                row[method] = f"{error.mean():.2f}, {100 * is_wrong.mean():.1f} %"
            rows.append(row)
    return rows


TABLES = {
    "brightness": report.Table(
        "Frames that are not equally bright", lambda o: brightness(SEEDS[: 1 if o.quick else len(SEEDS)])
    ),
    "specks": report.Table("Saturated pixels", lambda o: specks((0,) if o.quick else (0, 1, 2))),
    "shifts": report.Table("Large shifts", lambda o: shifts((7,) if o.quick else (7, 8, 9))),
    "recordings": report.Table("Unequal brightness and large motion, recordings", lambda o: recordings(o.data)),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
