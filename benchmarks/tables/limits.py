"""How far a step from frame to frame may go, beside OpenCV; how close two motions in a region may be, how
small an object, and how much noise there may be.

    python -m benchmarks.tables.limits [--quick]
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks import report
from benchmarks.rivals import flow as rivals
from benchmarks.scenes import recordings as samples
from benchmarks.scenes import steps

try:
    import av
except ImportError:
    av = None

Row = dict[str, object]
TURNS, ENLARGEMENTS, SHIFTS = (5, 10, 15, 20, 30), (1.05, 1.1, 1.2, 1.3, 1.5), (8, 16, 32, 48, 64)
COARSE_SHIFTS = (32, 48, 56, 64, 72)
DIFFERENCES, NOISES, FRACTIONS = (0.1, 0.2, 0.3, 0.5, 1.0), (0.0, 1.0, 2.0, 4.0, 8.0, 16.0), (0.25, 0.37, 0.8)
SEEDS = (0, 1, 2)
RATES = {
    "turn by 15 degrees": (steps.turn(np.radians(15)), "curl", 2 * np.radians(15)),
    "enlargement by 1.20": (1.2 * np.eye(2), "divergence", 2 * np.log(1.2)),
    "enlargement by 0.82": (0.82 * np.eye(2), "divergence", 2 * np.log(0.82)),
}
"""Steps -> their matrices, what is measured of them, and its truth."""
RADII, ANGLES = (15.0, 20.0, 25.0, 30.0, 45.0), (0.02, 0.06, 0.18)
SQUARE = (40, 40, 81, 81)
"""The region that is measured."""
MARGIN = 24
"""Pixels at the edges that are left out."""
CODERS: dict[str, tuple[str | None, dict[str, str]]] = {
    "none": (None, {}),
    "Motion JPEG": ("mjpeg", {"qmin": "3", "qmax": "3"}),
    "H.264, crf 6": ("libx264", {"crf": "6"}),
    "H.264, crf 18": ("libx264", {"crf": "18"}),
    "H.264, crf 23": ("libx264", {"crf": "23"}),
}
"""Row -> name of the coder, and its options."""
CODED_SHIFTS = (0.4, 0.8, 2.3)
METHODS = {"coarse_to_fine": "curl", "windowed": "curl", "flow filter": "curl", "lucas_kanade": "u"}
"""Method -> what is measured of its field; the last has no slopes."""
TRUTH, FILTERED, INNER = {"curl": 0.02, "u": 0.2}, 40, (13, 10, 70, 52)
"""Curl, rad/frame, and u in the middle, px/frame; frames that the filter gets; and the region."""


def cases() -> dict[str, tuple[NDArray[np.float64], tuple[float, float]]]:
    """Names of steps, their matrices and shifts."""
    turns = {f"turn by {degrees} degrees": (steps.turn(np.radians(degrees)), (0.0, 0.0)) for degrees in TURNS}
    larger = {f"enlargement by {factor:.2f}": (factor * np.eye(2), (0.0, 0.0)) for factor in ENLARGEMENTS}
    return turns | larger | {f"shift by {px} px": (np.eye(2), (float(px), 0.0)) for px in SHIFTS}


def limits(seeds: tuple[int, ...]) -> list[Row]:
    """Median end-point error, px, inside the frame; of ours with the share of sites that are `valid`, and of
    silent ones: valid, and off by more than a pixel and five standard deviations."""
    rows: list[Row] = []
    for name, (matrix, shift) in cases().items():
        truth = steps.flow(matrix, shift)
        inside = _inside(truth)
        found: dict[str, list[float]] = {}
        for seed in seeds:
            picture = steps.texture(seed)
            before, first, second = (
                steps.moved(picture, np.linalg.matrix_power(matrix, k), (k * shift[0], k * shift[1])) for k in (-1, 0, 1)
            )
            for what, field in (("pair", jacoflow.flow(first, second)), ("triple", jacoflow.flow(before, first, second))):
                error = np.linalg.norm(field.flow - truth, axis=-1)[inside]
                valid, silent = _shares(field, truth, inside)
                found.setdefault(f"{what}, px", []).append(float(np.nanmedian(error)))
                found.setdefault(f"{what}, valid", []).append(valid)
                found.setdefault(f"{what}, silent", []).append(silent)
            if samples.cv2 is not None:
                grey = [np.rint(frame).astype(np.uint8) for frame in (first, second)]
                for rival, run in rivals.RIVALS.items():
                    error = np.linalg.norm(run(*grey) - truth, axis=-1)[inside]
                    found.setdefault(rival, []).append(float(np.median(error)))
        rows.append({"step": name} | {key: float(np.mean(values)) for key, values in found.items()})
    return rows


def large_rates(seeds: tuple[int, ...]) -> list[Row]:
    """Rates of large steps, by `measure` of a disc: their errors and stated ones as shares of the truth, root
    mean squares over fine texture and waves in 8 bits."""
    rows: list[Row] = []
    for name, (matrix, quantity, true) in RATES.items():
        found: dict[str, list[float]] = {}
        for seed in seeds:
            for picture in (steps.texture(seed), steps.waves(seed)):
                frames = [np.rint(steps.moved(picture, np.linalg.matrix_power(matrix, k))) for k in (-1, 0, 1)]
                before, first, second = (np.clip(frame, 0, 255).astype(np.uint8) for frame in frames)
                for what, field in (("pair", jacoflow.flow(first, second)), ("triple", jacoflow.flow(before, first, second))):
                    measured = field.measure(quantity, (*steps.CENTRE, 45.0))
                    if np.isfinite(measured.value):
                        found.setdefault(f"{what}, error", []).append(measured.value / true - 1)
                        found.setdefault(f"{what}, std", []).append(measured.std / true)
        rows.append({"step": name} | {key: _rms(values) for key, values in found.items()})
    return rows


def unrelated(seeds: tuple[int, ...]) -> list[Row]:
    """Shares of the sites that are `valid` between frames of independent noise of a pixel, of noise that
    moves too far, and of moving texture in noise as strong as itself and stronger."""
    rows: list[Row] = []
    for name, (ratio, shift) in {
        "independent noise": (None, 0), "noise of a pixel, 64 px": (0.0, 64), "texture, noise as strong": (1.0, 2),
        "texture, noise twice as strong": (2.0, 2),
    }.items():
        row: Row = {"frames": name}
        for what, count in (("pair", 2), ("triple", 3)):
            shares = []
            for seed in seeds:
                rng = np.random.default_rng(seed)
                if not ratio:
                    picture = rng.integers(0, 256, (steps.SIZE, 2 * steps.SIZE)).astype(np.uint8)
                    frames = [picture[:, (2 - k) * shift :][:, : steps.SIZE] for k in range(count)]
                    if ratio is None:
                        frames = [rng.integers(0, 256, (steps.SIZE, steps.SIZE)).astype(np.uint8) for _ in range(count)]
                else:
                    picture = steps.texture(seed)
                    frames = [
                        frame + rng.normal(0.0, ratio * frame.std(), frame.shape)
                        for frame in (steps.moved(picture, np.eye(2), (float(k * shift), 0.0)) for k in range(count))
                    ]
                shares.append(float(jacoflow.flow(*frames).valid.mean()))
            row[what] = float(np.mean(shares))
        rows.append(row)
    return rows


def turning_waves(seeds: tuple[int, ...]) -> list[Row]:
    """Turns of a texture without fine detail under a grey level of noise: shares of the sites inside the
    frame that are `valid`, and of silent ones, as in `limits`."""
    turns = {degrees: (steps.turn(np.radians(degrees)), 0.0) for degrees in TURNS[:3]}
    return _held(steps.waves, "turn, degrees", turns, seeds)


def coarse_shifts(seeds: tuple[int, ...]) -> list[Row]:
    """The same of texture with coarse parts that moves by a large part of the frame."""
    return _held(steps.coarse, "shift, px", {shift: (np.eye(2), float(shift)) for shift in COARSE_SHIFTS}, seeds)


def _held(
    texture: Callable[[int], NDArray[np.float64]], name: str,
    motions: Mapping[int, tuple[NDArray[np.float64], float]], seeds: tuple[int, ...],
) -> list[Row]:
    """Shares of the sites that stay inside the frame that are `valid` and silent; a row for each matrix and
    shift along x."""
    rows: list[Row] = []
    for value, (matrix, shift) in motions.items():
        truth = steps.flow(matrix, (shift, 0.0))
        inside = _inside(truth)
        found: dict[str, list[float]] = {}
        for seed in seeds:
            picture, rng = texture(seed), np.random.default_rng(seed)
            powers = [(np.linalg.matrix_power(matrix, k), (k * shift, 0.0)) for k in (-1, 0, 1)]
            frames = [eight_bit(steps.moved(picture, *power), 1.0, rng) for power in powers]
            for what, field in (("pair", jacoflow.flow(*frames[1:])), ("triple", jacoflow.flow(*frames))):
                valid, silent = _shares(field, truth, inside)
                found.setdefault(f"{what}, valid", []).append(valid)
                found.setdefault(f"{what}, silent", []).append(silent)
        rows.append({name: value} | {what: float(np.mean(shares)) for what, shares in found.items()})
    return rows


def _inside(truth: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Sites off the edges that the motion leaves in the frame."""
    y, x = np.mgrid[: steps.SIZE, : steps.SIZE]
    ends = np.stack([x, y], axis=-1) + truth
    inside = ((ends >= 0) & (ends < steps.SIZE)).all(axis=-1)
    inside[:MARGIN], inside[-MARGIN:], inside[:, :MARGIN], inside[:, -MARGIN:] = (False,) * 4
    return np.asarray(inside)


def _shares(field: jacoflow.FlowField, truth: NDArray[np.float64], inside: NDArray[np.bool_]) -> tuple[float, float]:
    """Shares of the sites inside that are `valid`, and of those that are, and are off by more than a pixel
    and five standard deviations."""
    error = np.linalg.norm(field.flow - truth, axis=-1)[inside]
    std, valid = np.hypot(field.std("u"), field.std("v"))[inside], field.valid[inside]
    return float(valid.mean()), float((valid & (error > 1) & (error > 5 * std)).mean())


def eight_bit(frame: NDArray[np.float64], noise: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """A frame as a camera gives it, with white noise of `noise` grey levels."""
    return np.asarray(np.clip(np.rint(frame + rng.normal(0, noise, frame.shape)), 0, 255), dtype=np.uint8)


def two_motions(seeds: tuple[int, ...]) -> list[Row]:
    """`measure` of a square of which one half moves by `difference` px and the other stands still: distance
    of (u, u_x) from the nearer motion, with the stated standard deviations, root mean squares."""
    rows: list[Row] = []
    for difference in DIFFERENCES:
        found = []
        for seed in seeds:
            picture, rng = steps.texture(seed), np.random.default_rng(seed)
            still, gone = (steps.moved(picture, np.eye(2), (shift, 0.0)) for shift in (0.0, difference))
            right = np.arange(steps.SIZE)[None, :] > steps.CENTRE[0]
            frames = [eight_bit(frame, 1.0, rng) for frame in (still, np.where(right, gone, still))]
            found.append(jacoflow.flow(*frames).measure("u", SQUARE))
        known = [each for each in found if each.status == "ok"]
        row: Row = {"difference, px": difference, "no dominant motion": 1 - len(known) / len(found)}
        if known:
            u = [min(abs(each.value), abs(each.value - difference)) for each in known]
            u_x = [each.motion[2] for each in known]
            row["u, px"], row["std of u"] = _rms(u), _rms([each.std for each in known])
            row["u_x"], row["std of u_x"] = _rms(u_x), _rms([float(np.sqrt(each.covariance[2, 2])) for each in known])
        rows.append(row)
    return rows


def turning_discs(seeds: tuple[int, ...]) -> list[Row]:
    """Textured discs that turn before a textured wall that stands still, from a pair: `measure` of the
    angular velocity 3 px inside their edges, as shares of the truth, medians."""
    rows: list[Row] = []
    y, x = np.mgrid[: steps.SIZE, : steps.SIZE]
    for radius in RADII:
        for angle in ANGLES:
            found = []
            for seed in seeds:
                picture, wall = steps.texture(seed), steps.moved(steps.texture(seed + 100), np.eye(2))
                inside = np.hypot(x - steps.CENTRE[0], y - steps.CENTRE[1]) < radius
                frames = [np.where(inside, steps.moved(picture, steps.turn(k * angle)), wall) for k in range(2)]
                rng = np.random.default_rng(seed)
                field = jacoflow.flow(*(eight_bit(frame, 1.0, rng) for frame in frames))
                found.append(field.measure("angular_velocity", (*steps.CENTRE, radius - 3.0)))
            known = [each for each in found if each.status == "ok"]
            row: Row = {"radius, px": radius, "turn, rad": angle, "ok": len(known) / len(found)}
            if known:
                row["value"] = float(np.median([each.value for each in known])) / angle
                row["std"] = float(np.median([each.std for each in known])) / angle
            rows.append(row)
    return rows


def noise(seeds: tuple[int, ...]) -> list[Row]:
    """Means over a square of a texture that moves by a fraction of a pixel and grows by a hundredth, from a
    pair:
    errors of u and of the divergence as shares of the truth, with the stated ones, root mean squares."""
    rows: list[Row] = []
    for level in NOISES:
        found: dict[str, list[float]] = {}
        for seed in seeds:
            picture, rng = steps.texture(seed), np.random.default_rng(seed)
            for shift in FRACTIONS:
                for name, true, matrix in (("u", shift, np.eye(2)), ("divergence", 2 * np.log(1.01), 1.01 * np.eye(2))):
                    moved = [steps.moved(picture, np.eye(2)), steps.moved(picture, matrix, (shift, 0.0))]
                    field = jacoflow.flow(*(eight_bit(frame, level, rng) for frame in moved))
                    value, std, _ = field.region_mean(name, SQUARE)
                    found.setdefault(f"error of {name}", []).append(value / true - 1)
                    found.setdefault(f"std of {name}", []).append(std / true)
        rows.append({"noise, grey levels": level} | {name: _rms(values) for name, values in found.items()})
    return rows


def coded(seeds: tuple[int, ...]) -> list[Row]:
    """Shifts by parts of a pixel through the coders of video, by `measure` of a square: errors of a step and
    of the mean of four, px, with the stated standard deviation of a step; root mean squares. Rows whose coder
    is not installed are left out."""
    rows: list[Row] = []
    for coder, (name, options) in CODERS.items():
        if name is not None and (av is None or name not in av.codecs_available):
            continue
        step, mean, std, count = [], [], [], 0
        for seed in seeds:
            for shift in CODED_SHIFTS:
                picture, rng = steps.waves(seed), np.random.default_rng(seed)
                frames = [eight_bit(steps.moved(picture, np.eye(2), (k * shift, 0.0)), 1.0, rng) for k in range(6)]
                if name is not None:
                    frames = through(name, options, frames)
                found = [jacoflow.flow(*frames[k : k + 2]).measure("u", SQUARE) for k in range(1, 5)]
                known = [each for each in found if each.status == "ok"]
                count += len(found)
                step += [each.value - shift for each in known]
                std += [each.std for each in known]
                mean += [float(np.mean([each.value for each in known])) - shift] if known else []
        shares: Row = {"coder": coder, "ok": len(step) / count}
        rows.append(shares | {"error, px": _rms(step), "std, px": _rms(std), "error of the mean, px": _rms(mean)})
    return rows


def through(name: str, options: dict[str, str], frames: list[NDArray[np.uint8]]) -> list[NDArray[np.uint8]]:
    """Frames as they come back from a coder."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mkv"
        with av.open(str(path), "w") as container:
            stream = container.add_stream(name, rate=25, options=options)
            stream.width, stream.height = steps.SIZE, steps.SIZE
            stream.pix_fmt = "yuvj420p" if name == "mjpeg" else "yuv420p"
            for frame in frames:
                shown = av.VideoFrame.from_ndarray(frame, format="gray").reformat(format=stream.pix_fmt)
                container.mux(stream.encode(shown))
            container.mux(stream.encode())
        return [np.asarray(frame, dtype=np.uint8) for frame in jacoflow.io.frames(path)]


def other_methods(seeds: tuple[int, ...]) -> list[Row]:
    """What `measure` says of a region of fine texture that turns, by the method of the field: value, its
    standard deviation and that of the values, as shares of the truth."""
    rows: list[Row] = []
    for method, name in METHODS.items():
        found = []
        for seed in range(4 * len(seeds)):
            rng = np.random.default_rng(seed)
            scene = jacoflow.scenes.Scene(
                "affine", width=96, height=72, random_state=seed, carrier="speckle",
                u=TRUTH["u"], v=0.0, u_x=0.0, v_x=0.5 * TRUTH["curl"], u_y=-0.5 * TRUTH["curl"], v_y=0.0,
            )
            frames = [eight_bit(scene.frame(float(k)), 1.0, rng) for k in range(FILTERED if method == "flow filter" else 3)]
            if method == "flow filter":
                stream = jacoflow.FlowFilter(profile="measured", grid=jacoflow.SamplingGrid(stride=3))
                field = [stream.push(frame) for frame in frames][-1]
            else:
                field = jacoflow.flow(*frames, method=method)
            measured = field.measure(name, INNER)
            found.append((measured.value / TRUTH[name], measured.std / TRUTH[name]))
        values, stds = zip(*found, strict=True)
        rows.append({"method": method, "measured": name, "value": float(np.mean(values)), "std": float(np.mean(stds)), "scatter": float(np.std(values))})
    return rows


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


TABLES = {
    "limits": report.Table("Limits of a step", lambda o: limits(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "large_rates": report.Table("Rates of large steps", lambda o: large_rates(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "unrelated": report.Table("Unrelated frames", lambda o: unrelated(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "turning_waves": report.Table("Turning waves", lambda o: turning_waves(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "coarse_shifts": report.Table("Shifts of coarse texture", lambda o: coarse_shifts(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "two_motions": report.Table("Two motions in a region", lambda o: two_motions(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "turning_discs": report.Table("Turning discs", lambda o: turning_discs(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "noise": report.Table("Noise of a pair", lambda o: noise(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "coded": report.Table("Shifts through coders of video", lambda o: coded(SEEDS[: 1 if o.quick else len(SEEDS)])),
    "other_methods": report.Table("Turning by method", lambda o: other_methods(SEEDS[: 1 if o.quick else len(SEEDS)])),
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
