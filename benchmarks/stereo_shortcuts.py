"""What two short cuts of the stereo tracker save and cost.

    python benchmarks/stereo_shortcuts.py [--seeds 3]

- *Prior*: candidates within 3 px of the disparity that the step before leads to, moved by the true motion: the best that any prediction could do. On a fence, whose pales look alike, and on people who cross.
- *Predicted windows*: `StereoTracker(predicted_windows=True)`, templates looked for within 2 cells of the last motion.

Outliers are edge pixels more than 1 px off the best truth within 2 px. Times are wall time.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from numpy.typing import NDArray

import jacoflow
import stereo_scenes
from jacoflow.track import StereoTracker
from stereo import edge_pixels
from stereo_scores import count, figures
from stereo_tracking import follow
from stereo_tracking_scores import gross

Row = dict[str, object]


def led_to(before: NDArray[np.floating], shown: stereo_scenes.Step) -> NDArray[np.float32]:
    """Where the disparities of a step, (H, W), px, are at the next one: moved, and spread to the 5 x 5 px about each place, nearer ones over farther; NaN elsewhere."""
    height, width = before.shape
    rows, columns = np.nonzero(np.isfinite(before))
    u, v, w = shown.motion[rows, columns].T
    values = before[rows, columns] + w
    order = np.argsort(values)
    x, y = np.rint(columns + u).astype(int)[order], np.rint(rows + v).astype(int)[order]
    out = np.full(before.shape, np.nan, np.float32)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            inside = (x + dx >= 0) & (x + dx < width) & (y + dy >= 0) & (y + dy < height)
            out[(y + dy)[inside], (x + dx)[inside]] = values[order][inside]
    return out


def prior_row(scene: stereo_scenes.Scene, method: str, with_prior: bool) -> Row:
    """Quality and time of matching, with and without what the step before says."""
    found, counts, times = None, [], []
    film = scene.film()
    for t, shown in enumerate(film):
        prior = led_to(found, film[t - 1]) if with_prior and found is not None else None
        begun = time.perf_counter()
        found = jacoflow.stereo.edge_disparity(shown.left, shown.right, disparity_range=scene.disparity_range, row_offset=scene.row_offset, method=method, prior=prior).disparity
        if t > 0:
            times.append(time.perf_counter() - begun)
            counts.append(count(found, edge_pixels(shown.left), shown.disparity, shown.visible))
    return {"scene": scene.name, "method": method, "prior": "within 3 px" if with_prior else "none", **figures(counts), "ms": 1e3 * float(np.median(times))}


def windows_row(scene: stereo_scenes.Scene, predicted: bool, seeds: int) -> Row:
    """Gross errors and time of the tracker with and without predicted windows, over several films."""
    labels = sorted({layer.label for layer in scene.layers})
    scores, times = [], []
    for seed in range(seeds):
        tracker = StereoTracker(n_components=16, disparity_range=scene.disparity_range, random_state=seed, predicted_windows=predicted)
        score, spent = follow(scene, scene.film(noise_seed=1000 * seed + scene.seed), tracker, False)
        scores.append(score)
        times.append(spent)
    row: Row = {"scene": scene.name, "windows": "predicted" if predicted else "everywhere", "purity": float(np.mean([score.purity() for score in scores]))}
    errors = [score.motion_errors() for score in scores]
    for label in labels:
        row[f"gross {label}, %"] = 100 * float(np.mean([gross(error[label]) for error in errors if label in error]))
    return {**row, "ms a step": 1e3 * float(np.median(times))}


def sections(seeds: int) -> dict[str, list[Row]]:
    """Both tables, by title."""
    crossing, fence = stereo_scenes.crossing(), stereo_scenes.fence()
    priors = [prior_row(scene, method, with_prior) for scene in (fence, crossing) for method in ("classes", "sgm") for with_prior in (False, True)]
    windows = [windows_row(crossing, predicted, seeds) for predicted in (False, True)]
    return {"Disparity with a prior from the step before": priors, "Tracking with predicted windows": windows}


def main() -> None:
    """Prints the tables."""
    import compare

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="films of the second table")
    for title, rows in sections(parser.parse_args().seeds).items():
        print(f"## {title}\n\n" + "\n".join(compare.table_lines(rows)) + "\n")


if __name__ == "__main__":
    main()
