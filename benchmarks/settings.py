"""Our side of every table: settings of `jacoflow.estimate`. A new one is one line here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import jacoflow
from benchmarks.scores import noise_bound

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Setting:
    """Options of `jacoflow.estimate` under a name."""

    name: str
    options: dict[str, Any]
    frames: int = 3
    """The most frames it is given: 2 for a pair even where there are three."""
    moment: float = 0.5
    """Where between the two frames of a pair its field belongs: 0 the first, 0.5 the middle. Three frames:
    always the middle one."""
    forward: bool = False
    """Whether three frames give the step from the middle one to the next, not the mean of both steps."""
    window: float | None = None
    """Its window, the standard deviation of a Gaussian in px, for the noise bound; None: it chooses one at
    each pixel."""

    def field(self, frames: Sequence[NDArray[Any]], **more: Any) -> jacoflow.FlowField:
        """The estimate from two or three frames."""
        return jacoflow.flow(*frames, **{**self.options, **more})

    def plain_windows(self, frames: Sequence[NDArray[Any]]) -> float | Array:
        """Its window, or those it chose for the slopes, (H, W), px: the plain Gaussian ones as noisy as
        those of fourth order that it uses."""
        if self.window is not None:
            return self.window
        chosen = self.field(frames, diagnostics=True).window
        assert chosen is not None
        return chosen.astype(float) * noise_bound.plain_window(slopes=True)

    def estimate(self, frames: Sequence[NDArray[Any]]) -> tuple[Array, Array]:
        """Flow (H, W, 2) and Jacobian (H, W, 2, 2)."""
        field = self.field(frames)
        return field.flow.astype(float), field.jacobian.astype(float)


def windowed(smooth: float, window: float, **more: Any) -> Setting:
    """The single-level windowed estimator."""
    options = {
        "method": jacoflow.Windowed(window_sigma=window, **more),
        "preprocess": jacoflow.Preprocess(smooth=smooth),
        "covariance": False,
        "precision": "float64",
    }
    return Setting(
        f"windowed, one level, smoothed {smooth:g} px, window {window:g} px", options, window=window
    )


def coarse_to_fine(preset: str, frames: int = 3) -> Setting:
    """The estimator for everyday frames."""
    options = {"method": jacoflow.CoarseToFine(preset=preset), "covariance": False}
    return Setting(
        f"coarse to fine, {preset}" + (", pair" if frames == 2 else ""),
        options,
        frames=frames,
        moment=0.0,
        forward=True,
    )


PRESETS = ("fast", "balanced", "accurate")
RECORDINGS = [
    windowed(1.5, 4.0),
    windowed(2.5, 6.0),
    *(coarse_to_fine(preset) for preset in PRESETS),
    coarse_to_fine("balanced", frames=2),
]
"""The same for every recording."""

CONTROLLED = [
    windowed(1.5, 4.0, rows="brightness"),
    coarse_to_fine("balanced", frames=2),
    coarse_to_fine("balanced"),
]
"""The same for every scene with exact truth."""

SPEED = [
    Setting("instantaneous", {"method": "instantaneous", "covariance": False}),
    Setting("instantaneous with covariance", {"method": "instantaneous", "covariance": True}),
    Setting("windowed", {"method": "windowed", "covariance": False}),
    Setting("windowed, pair", {"method": "windowed", "covariance": False}, frames=2),
    *(coarse_to_fine(preset, frames=2) for preset in PRESETS),
    coarse_to_fine("balanced"),
]
"""Timed with one thread and with two."""
