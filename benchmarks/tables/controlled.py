"""Textures moved by smooth velocity fields with exact truth: errors beside Farneback's flow, plain and
smoothed, and beside the bound that noise sets.

python -m benchmarks.tables.controlled
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks import report
from benchmarks.rivals import flow as rivals
from benchmarks.scenes.controlled import Case, Picture, cases, frame, gradient, truth
from benchmarks.scores import noise_bound
from benchmarks.scores.flow import differences, end_point_error, inside, jacobian_error
from benchmarks.settings import CONTROLLED, Setting

Array = NDArray[np.floating]
Row = dict[str, object]
MARGIN = 24
"""Left out along each side, px: what enters the frame has no counterpart."""
RATIOS = (
    "end_point_gain",
    "efficient_gain",
    "jacobian_gain",
    "jacobian_gain_over_smoothed",
    "jacobian_over_bound",
)


@dataclass(frozen=True)
class Contestant:
    """An estimator of flow and Jacobian."""

    name: str
    estimate: Callable[[list[Picture]], tuple[Array, Array]]
    """Flow (H, W, 2) and Jacobian (H, W, 2, 2) from the frames of times 0, 1 (pair) or -1, 0, 1 (triple)."""
    frames: int = 2
    moment: float = 0.0
    """When a pair's result is that of a pixel: 0 in the first frame, 0.5 halfway. A triple's: in the
    middle frame."""
    forward: bool = False
    """Whether a triple's result is the step to the next frame, and not the mean of both."""
    windows: Callable[[list[Picture]], float | Array] | None = None
    """Standard deviation of its plain Gaussian window, px, for the noise bound: one, or (H, W)."""

    @classmethod
    def of(cls, setting: Setting) -> Contestant:
        """One of our settings."""
        moment = 0.0 if setting.frames == 3 else setting.moment
        return cls(
            setting.name, setting.estimate, setting.frames, moment, setting.forward, setting.plain_windows
        )

    def times(self) -> tuple[float, ...]:
        """Times of its frames."""
        return (0.0, 1.0) if self.frames == 2 else (-1.0, 0.0, 1.0)

    def truth(self, case: Case) -> tuple[Array, Array]:
        """What it should answer."""
        first, last = (0.0, 1.0) if self.forward else (self.times()[0], self.times()[-1])
        return truth(
            case.wavelength, case.speed, case.seed, self.moment, (first - self.moment, last - self.moment)
        )

    def errors(self, case: Case) -> tuple[float, float, float]:
        """Mean end-point error, px; share of the pixels with an answer; error of the Jacobian's entries,
        1/frame."""
        flow, jacobian = self.estimate([frame(case, t) for t in self.times()])
        exact, slopes = self.truth(case)
        where = inside(exact.shape[:2], MARGIN)
        return (*end_point_error(flow, exact, where), jacobian_error(jacobian, slopes, where))

    def bound(self, case: Case) -> float | None:
        """The least-squares noise bound of its windows (see :mod:`noise_bound`), 1/frame."""
        if self.windows is None:
            return None
        slopes = gradient(case.wavelength, case.speed, case.seed, self.moment)
        windows = self.windows([frame(case, t) for t in self.times()])
        return noise_bound.jacobian_bound(
            slopes, windows, case.noise, inside(slopes.shape[:2], MARGIN), self.frames
        )

    def efficient(self, case: Case) -> float:
        """Mean end-point error, px, of an efficient estimate from as many frames in the best window (see
        :mod:`noise_bound`)."""
        exact, _ = self.truth(case)
        slopes = gradient(case.wavelength, case.speed, case.seed, self.moment)
        return noise_bound.efficient_end_point_error(
            slopes, exact, case.noise, inside(exact.shape[:2], MARGIN), self.frames
        )


def farneback(case: Case) -> Row:
    """Errors of Farneback's flow as it is, with its central differences, and smoothed by the
    Savitzky-Golay window that suits its Jacobian best."""
    flow = rivals.farneback(frame(case, 0.0), frame(case, 1.0))
    exact, slopes = truth(case.wavelength, case.speed, case.seed, 0.0, (0.0, 1.0))
    where = inside(exact.shape[:2], MARGIN)
    setting, smooth, jacobian = rivals.best(
        rivals.savitzky_golay_fits(flow), lambda _, j: jacobian_error(j, slopes, where)
    )
    return {
        "farneback_end_point_error": end_point_error(flow, exact, where)[0],
        "farneback_jacobian_error": jacobian_error(differences(flow), slopes, where),
        "smoothed_end_point_error": end_point_error(smooth, exact, where)[0],
        "smoothed_jacobian_error": jacobian_error(jacobian, slopes, where),
        "smoothed_window_and_order": f"{setting['window']}, {setting['order']}",
    }


def row(case: Case, rival: dict[str, object], contestant: Contestant) -> Row:
    """One scene: errors of both sides, how many times ours are smaller, how many times those of an
    efficient estimate are, and how far above the noise bound the Jacobian's is."""
    flow, share, slope = contestant.errors(case)
    bound, efficient = contestant.bound(case), contestant.efficient(case)
    gains = [
        float(str(rival[name]))
        for name in ("farneback_end_point_error", "farneback_jacobian_error", "smoothed_jacobian_error")
    ]
    return {
        "wavelength": case.wavelength,
        "speed": case.speed,
        "noise": case.noise,
        **rival,
        "method": contestant.name,
        "share": share,
        "end_point_error": flow,
        "jacobian_error": slope,
        "efficient_end_point_error": efficient,
        "end_point_gain": gains[0] / flow,
        "efficient_gain": gains[0] / efficient,
        "jacobian_gain": gains[1] / slope,
        "jacobian_gain_over_smoothed": gains[2] / slope,
        "jacobian_bound": bound if bound is not None else "",
        "jacobian_over_bound": slope / bound if bound is not None else "",
    }


def summary(name: str, method: str, rows: list[Row], combine: Callable[[str, Array], float]) -> Row:
    """A row of the ratios of `rows`, each combined by `combine(name of the ratio, its values)`; those that
    no row has are left out."""
    ratios = {ratio: np.array([each[ratio] for each in rows if each[ratio] != ""], float) for ratio in RATIOS}
    return {
        "wavelength": name,
        "method": method,
        **{ratio: combine(ratio, values) for ratio, values in ratios.items() if values.size},
    }


def worst(ratio: str, values: Array) -> float:
    """Gains are bad when small, the ratio to the bound when large."""
    return float(values.max() if ratio == "jacobian_over_bound" else values.min())


def geometric_mean(_: str, values: Array) -> float:
    """The mean of ratios."""
    return float(np.exp(np.log(values).mean()))


def table(cases: list[Case], contestants: list[Contestant]) -> list[Row]:
    """One row for each contestant and case, then the worst and the geometric mean of its ratios; the mean
    over the noisy scenes apart, as the bound of the others is nothing but the rounding to grey levels."""
    if rivals.cv2 is None:
        return []
    peers = [farneback(case) for case in cases]
    rows: list[Row] = []
    for contestant in contestants:
        own = [row(case, peer, contestant) for case, peer in zip(cases, peers, strict=True)]
        rows += own
        rows += [
            summary("worst", contestant.name, own, worst),
            summary("geometric mean", contestant.name, own, geometric_mean),
        ]
        noisy = [each for case, each in zip(cases, own, strict=True) if case.noise > 0]
        if 0 < len(noisy) < len(own):
            rows.append(summary("geometric mean, with noise", contestant.name, noisy, geometric_mean))
    return rows


TABLES = {
    "controlled": report.Table(
        "Accuracy on scenes with exact truth",
        lambda o: table(
            cases(speeds=(2.0, 8.0)) if o.quick else cases(),
            [Contestant.of(setting) for setting in CONTROLLED],
        ),
    )
}

if __name__ == "__main__":
    report.main(__doc__, TABLES)
