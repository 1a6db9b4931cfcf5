"""Parts of the gradient tracker beside their specification: masks, gain of one step, gate in noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks import report
from benchmarks.rivals.trackers import has_reference
from benchmarks.scenes.textures import Array, background

Row = dict[str, object]
ORDERS = (1, 2, 3, 4)
STEPS = (0.25, 0.5, 1.0)
"""Shifts along x, px; along y it is half of them the other way."""
GAINS = {4: (0.259, 0.521, 1.074), 2: (0.328, 0.660, 1.348)}
"""Published mean of u after one step, by order, for the shifts above, px."""
WINDOW = 5
UNGATED = {"min_sigma": 0.0, "cond_max": 1e9, "step_max": 1e9}
"""Published figures are over all pixels."""
MARGIN = 14
"""Left out along each side, px."""
MASKED = 6
"""Width of the rim where masks and windows leave the frame, px: no flow there."""


def table() -> list[Row]:
    """All rows, specified beside reached; none without the feature `reference`."""
    if not has_reference():
        return []
    from jacoflow import reference

    return [*mask_rows(reference), *gain_rows(reference), *gate_rows(reference)]


def reference_masks(order: int) -> tuple[Array, Array, Array]:
    """Value and slopes along x and y at the middle of the least-squares polynomial of total degree `order`
    over 5 x 5: three masks (5, 5), [row, column] = [y, x]."""
    y, x = (axis.ravel().astype(float) for axis in np.mgrid[-2:3, -2:3])
    powers = [(i, j) for i in range(order + 1) for j in range(order + 1 - i)]
    fit = np.linalg.pinv(np.stack([x**i * y**j for i, j in powers], axis=1))
    value, along_x, along_y = (fit[powers.index(power)].reshape(5, 5) for power in ((0, 0), (1, 0), (0, 1)))
    return value, along_x, along_y


def mask_rows(reference: Any) -> list[Row]:
    """The masks against least squares."""
    rows: list[Row] = []
    for order in ORDERS:
        pairs = zip(reference.derivative_kernels(order), reference_masks(order), strict=True)
        worst = max(float(np.abs(np.asarray(own) - exact).max()) for own, exact in pairs)
        rows.append(
            {
                "what": f"masks of order {order}: greatest difference from least squares",
                "asked": "<= 1e-12",
                "reached": worst,
            }
        )
    return rows


def shifted_texture(step: float) -> tuple[Array, Array]:
    """A texture and the same moved by (step, -step / 2) px, by splines of fifth order that continue across
    the edges; (96, 96) each."""
    first = background("smooth:2,128,40", 7, 96)
    return first, ndimage.shift(first, (-step / 2, step), order=5, mode="grid-wrap")


def gain_rows(reference: Any) -> list[Row]:
    """Mean of u after a single step."""
    rows: list[Row] = []
    for order, asked in GAINS.items():
        for step, mean in zip(STEPS, asked, strict=True):
            flow = inner_flow(
                reference.local_flow(*shifted_texture(step), window=WINDOW, order=order, **UNGATED)
            )
            reached = float(np.nanmean(flow[..., 0]))
            rows.append(
                {
                    "what": f"mean u, px, one step of order {order} for a shift of {step:g} px",
                    "asked": f"{mean} +- 0.005",
                    "reached": reached,
                }
            )
    return rows


def gate_rows(reference: Any) -> list[Row]:
    """Share of the pixels of a still, noisy picture that count as moving, without the gate of gradient
    strength and with it."""
    rows: list[Row] = []
    for kind, min_sigma, asked in (
        ("smooth:4,90,20", 0.0, "0.05"),
        ("flat:90", 0.0, "0.59"),
        ("smooth:4,90,20", 2.5, "< 0.0005"),
    ):
        flow = accepted_flow(reference.local_flow(*still_pair(kind), min_sigma=min_sigma))
        moving = (np.abs(flow[MASKED:-MASKED, MASKED:-MASKED]) >= 0.5).any(axis=-1)
        rows.append(
            {
                "what": f"share of moving pixels in still {kind}, gate {min_sigma:g}",
                "asked": asked,
                "reached": float(moving.mean()),
            }
        )
    return rows


def still_pair(kind: str) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Two pictures of the same background with noise of 2 grey levels, rounded."""
    rng = np.random.default_rng(0)
    still = background(kind, 3)
    first, second = (
        np.rint(np.clip(still + rng.normal(0.0, 2.0, still.shape), 0, 255)).astype(np.uint8) for _ in range(2)
    )
    return first, second


def accepted_flow(field: Any) -> Array:
    """(H, W, 2), px; NaN where no flow was accepted."""
    return np.where(np.asarray(field.valid)[..., None], np.asarray(field.flow, float), np.nan)


def inner_flow(field: Any) -> Array:
    """The accepted flow away from the frame's edges."""
    return accepted_flow(field)[MARGIN:-MARGIN, MARGIN:-MARGIN]


TABLES = {"parts": report.Table("Tracking, parts of the gradient tracker", lambda _: table())}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
