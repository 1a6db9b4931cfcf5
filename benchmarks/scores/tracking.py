"""How far a track is from the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.scenes.textures import Array
from benchmarks.scenes.tracking import Truth

NEAR = 3.0
"""A centre counts as found within this many px."""
OVERLAP = 0.5
"""A box counts as found with more than this share of intersection over union."""
SETTLED = 6
"""Frames before this one do not count in root-mean-square errors: the filter is still finding its
velocity."""


@dataclass(frozen=True)
class Track:
    """Output of a tracker; the first axis is time (T), frame 0 is the start. NaN where it has none."""

    boxes: Array
    """(T, 4), x, y, width, height, px, with x = centre - width / 2."""
    displacements: Array
    """(T, 2), measured step since the frame before, px."""
    velocities: Array | None = None
    """(T, 2), filtered velocity, px/frame."""
    windows: Array | None = None
    """(T, 2), center of the searched window, px."""
    scales: Array | None = None
    """(T,)."""
    rotations: Array | None = None
    """(T,), rad."""
    milliseconds: float = float("nan")
    """CPU time of a frame on one thread."""

    @property
    def centres(self) -> Array:
        """(T, 2), x and y, px."""
        return self.boxes[:, :2] + self.boxes[:, 2:] / 2


def overlap(boxes: Array, others: Array) -> Array:
    """(T,), area of the intersection over area of the union of boxes (T, 4); 0 where they do not touch."""
    low = np.maximum(boxes[:, :2], others[:, :2])
    high = np.minimum(boxes[:, :2] + boxes[:, 2:], others[:, :2] + others[:, 2:])
    common = np.clip(high - low, 0.0, None).prod(axis=1)
    union = boxes[:, 2:].prod(axis=1) + others[:, 2:].prod(axis=1) - common
    return np.divide(common, union, out=np.zeros_like(common), where=union > 0)


def scores(track: Track, truth: Truth) -> dict[str, float]:
    """Figures of one track; those that the tracker or the scene does not have are left out.

    `on3`: share of frames with the centre within 3 px; `success`: share with intersection over union above
    0.5; `centre_error`: median, px; `displacement_error_x`, `_y` and `velocity_error_x`, `_y`: root mean
    square against the true step since the frame before, px, from frame 6 on; `window_on3`: as on3, of the
    window's middle; `scale_error`: greatest relative one; `angle_error`: greatest, degrees; `mean_overlap`;
    `milliseconds` a frame.
    """
    counted = truth.scored
    distances = np.linalg.norm(track.centres - truth.centres, axis=1)[counted]
    overlaps = overlap(track.boxes, truth.boxes)[counted]
    figures = {
        "on3": float((distances <= NEAR).mean()),
        "success": float((overlaps > OVERLAP).mean()),
        "centre_error": float(np.median(np.nan_to_num(distances, nan=np.inf))),
        "mean_overlap": float(overlaps.mean()),
        "milliseconds": track.milliseconds,
    }
    steps = np.diff(truth.centres, axis=0, prepend=np.nan)
    settled = counted & (np.arange(len(counted)) >= SETTLED)
    for name, said in (("displacement", track.displacements), ("velocity", track.velocities)):
        if said is not None:
            figures |= {
                f"{name}_error_{axis}": _root_mean_square((said - steps)[settled, k])
                for k, axis in enumerate("xy")
            }
    if track.windows is not None:
        figures["window_on3"] = float(
            (np.linalg.norm(track.windows - truth.centres, axis=1)[counted] <= NEAR).mean()
        )
    if track.scales is not None and truth.scales is not None:
        figures["scale_error"] = float(np.abs(track.scales / truth.scales - 1)[counted].max())
    if track.rotations is not None and truth.angles is not None:
        figures["angle_error"] = float(np.rad2deg(np.abs(track.rotations - truth.angles)[counted].max()))
    return figures


def _root_mean_square(errors: Array) -> float:
    """Over the frames with a value; NaN if there is none."""
    known = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")
